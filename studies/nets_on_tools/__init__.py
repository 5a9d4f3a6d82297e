"""Nets on triangulated tools, against a commercial code, areas and exact lengths."""
