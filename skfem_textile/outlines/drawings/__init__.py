"""Curves of drawings in DXF and SVG files."""
