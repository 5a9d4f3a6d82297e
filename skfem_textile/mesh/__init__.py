"""Meshes: validation, names, splitting, and bases of the forms."""
