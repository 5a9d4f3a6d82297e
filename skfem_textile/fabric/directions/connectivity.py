"""Whether fibre directions follow the edges of elements by accident.

A program that takes the first edge of an element for the first axis of its material
gives directions that change with the numbering of its nodes.  On a mesh whose edges do
not all go one way such directions differ from element to element without a reason.
"""

import logging

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ...mesh.splitting import original_elements
from ..kinematics import rotated
from .per_element import FibreDirections

log = logging.getLogger(__name__)

# Angle within which a direction is that of an edge.  Chosen: far above the six digits
# of a deck (1e-6 rad), and so small that one element in 1500 is as near by chance.
_ALONG_DEG = 0.05

# Share of the elements whose direction must be that of the edge.  Chosen: most.
_SHARE = 0.9

# Spread of the edges up to which they go one way, as on a regular mesh, where fibres
# along edges are meant.
_ONE_WAY_DEG = 1.0


def directions_warning(mesh: Mesh, directions: FibreDirections) -> str:
    """A sentence where directions seem to come from the numbering of nodes, or empty.

    It tells of a family that runs along the same edge of nearly every element, counted
    from the element's first node, or across it, while these edges go several ways.

    Parameters
    ----------
    mesh
        The mesh; of a split or cut mesh the user's elements count.
    directions
        Directions in these elements.
    """
    cells, _ = original_elements(mesh)
    directions.refuse_other(cells)
    for name in ("warp", "weft"):
        direction = getattr(directions, name)
        for number, edges in _edges(mesh, cells).items():
            for how, turned in (("along", edges), ("across", rotated(edges))):
                near = _apart_deg(direction, turned) < _ALONG_DEG
                if near.mean() >= _SHARE and _spread_deg(edges) > _ONE_WAY_DEG:
                    return (
                        f"the {name} runs {how} edge {number} of {near.sum()} of "
                        f"{near.size} elements, though these edges go several ways: "
                        "directions seem to follow the numbering of nodes; state them "
                        "by angles, vectors or a reference curve"
                    )
    return ""


def warn_of_directions(mesh: Mesh, directions: FibreDirections) -> None:
    """Log the sentence of `directions_warning` as a warning, if there is one."""
    if said := directions_warning(mesh, directions):
        log.warning(said)


def _edges(mesh: Mesh, cells: tuple[ndarray, ...]) -> dict[int, ndarray]:
    """Of each number of an edge, from 1 on, the edge vectors of all elements."""
    least = min(len(cell) for cell in cells)
    return {
        i + 1: np.hstack(
            [
                mesh.p[:, cell[(i + 1) % len(cell)]] - mesh.p[:, cell[i]]
                for cell in cells
            ]
        )
        for i in range(least)
    }


def _apart_deg(u: ndarray, v: ndarray) -> ndarray:
    """Angles in degrees between lines, from 0 to 90."""
    cross, dot = u[0] * v[1] - u[1] * v[0], (u * v).sum(axis=0)
    return np.degrees(np.arctan2(np.abs(cross), np.abs(dot)))


def _spread_deg(edges: ndarray) -> float:
    """By how much lines differ from their mean direction, in degrees."""
    z = edges[0] + 1j * edges[1]
    z = (z / np.abs(z)) ** 2  # either sense of a line
    mean = z.mean()
    if abs(mean) == 0:
        return 90.0
    return float(np.degrees(np.abs(np.angle(z / mean)).max()) / 2)
