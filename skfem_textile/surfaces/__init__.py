"""Surfaces: level sets, analytic tools, triangles of files and their repair."""
