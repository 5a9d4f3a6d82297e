"""Meshes, fibre directions and fabrics in and out, and results out."""

from .decks.fabrics import OF_FABRICS, read_fabric, write_fabric
from .fibres import (
    DRAPED,
    OF_DIRECTIONS,
    read_directions,
    write_directions,
    write_draped,
)
from .reading import read_mesh
from .results import FIELDS, write_fields, write_history, write_summary
from .surfaces import read_surface

__all__ = [
    "DRAPED",
    "FIELDS",
    "OF_DIRECTIONS",
    "OF_FABRICS",
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
