"""Meshes split into quadrilaterals, or cut into triangles."""

from .edges import boundary_edges, named_edges
from .original import original_elements
from .quadrilaterals import SplitMesh, split, split_cells, was_split
from .triangles import CutMesh, cut, was_cut

__all__ = [
    "CutMesh",
    "SplitMesh",
    "boundary_edges",
    "cut",
    "named_edges",
    "original_elements",
    "split",
    "split_cells",
    "was_cut",
    "was_split",
]
