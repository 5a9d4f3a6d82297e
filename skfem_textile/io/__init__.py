"""Meshes in, in any format that meshio knows, and results out."""

from .reading import read_mesh
from .results import FIELDS, write_fields, write_history, write_summary

__all__ = [
    "FIELDS",
    "read_mesh",
    "write_fields",
    "write_history",
    "write_summary",
]
