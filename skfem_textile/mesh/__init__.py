"""Meshes: checks, names, and the bases that forms go with."""
