"""Meshes, fibre directions and fabrics in and out, and results out."""

from .decks.fabrics import read_fabric, write_fabric
from .fibres import DRAPED, read_directions, write_directions, write_draped
from .reading import read_mesh
from .results import FIELDS, write_fields, write_history, write_summary
from .surfaces import read_surface

__all__ = [
    "DRAPED",
    "FIELDS",
    "read_directions",
    "read_fabric",
    "read_mesh",
    "read_surface",
    "write_directions",
    "write_draped",
    "write_fabric",
    "write_fields",
    "write_history",
    "write_summary",
]
