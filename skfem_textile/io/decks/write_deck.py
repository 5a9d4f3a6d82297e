"""Meshes and fibre directions as input of Abaqus."""

import re
from collections.abc import Iterator, Sequence

import numpy as np
from numpy import ndarray
from skfem import Mesh

#: Names of two orientations, whose first directions are those of the families: no
#: orientation of Abaqus holds families that differ in their angle from element to
#: element.
WARP, WEFT = "WARP", "WEFT"

# Members of a set in a line: Abaqus takes 16.
_IN_A_LINE = 16

_TYPES = {3: "M3D3", 4: "M3D4R"}


def deck_of(
    mesh: Mesh,
    cells: Sequence[ndarray],
    points: ndarray,
    warp: ndarray,
    weft: ndarray,
) -> str:
    """A deck of the user's elements with the direction of both families in each.

    The orientations ``WARP`` and ``WEFT`` have the direction of a family for their
    first axis, in a distribution of points a and b.  Numbers have all their digits.

    Parameters
    ----------
    mesh
        The mesh, whose boundaries become sets of nodes.
    cells
        The user's elements as node numbers, shapes (3, n) and (4, n).
    points
        Positions of the nodes, shape (2, n).
    warp, weft
        Directions in these elements, shape (2, n_elements).
    """
    return "\n".join(
        [
            "*HEADING",
            "mesh and fibre directions, by skfem_textile; lengths in mm",
            *_mesh(mesh, cells, points),
            "*DISTRIBUTION TABLE, NAME=AXES",
            "COORD3D, COORD3D",
            *_family(WARP, warp),
            *_family(WEFT, weft),
            "",
        ]
    )


def _mesh(mesh: Mesh, cells: Sequence[ndarray], points: ndarray) -> Iterator[str]:
    n_nodes = 1 + max(cell.max() for cell in cells)
    yield "*NODE"
    for i, (x, y) in enumerate(points[:, :n_nodes].T.tolist(), 1):
        yield f"{i}, {x!r}, {y!r}, 0.0"
    first = 1
    for cell in cells:
        yield f"*ELEMENT, TYPE={_TYPES[len(cell)]}, ELSET=PLY"
        for i, nodes in enumerate((cell.T + 1).tolist(), first):
            yield ", ".join(map(str, [i, *nodes]))
        first += cell.shape[1]
    for name, edges in (mesh.boundaries or {}).items():
        ends = np.unique(mesh.facets[:, np.asarray(edges)])
        yield from _set("NSET", name, ends[ends < n_nodes] + 1)


def _set(keyword: str, name: str, members: ndarray) -> Iterator[str]:
    if not len(members):
        return
    shown = re.sub(r"\W", "_", name)
    yield f"*{keyword}, {keyword}={shown}"
    for i in range(0, len(members), _IN_A_LINE):
        yield ", ".join(map(str, members[i : i + _IN_A_LINE].tolist()))


def _family(name: str, direction: ndarray) -> Iterator[str]:
    """The orientation of a family and its distribution."""
    yield f"*ORIENTATION, NAME={name}, SYSTEM=RECTANGULAR"
    yield f"{name}_AXES"
    yield "3, 0."
    yield f"*DISTRIBUTION, NAME={name}_AXES, LOCATION=ELEMENT, TABLE=AXES"
    yield ", 1., 0., 0., 0., 1., 0."
    for i, (x, y) in enumerate(direction.T.tolist(), 1):
        yield f"{i}, {x!r}, {y!r}, 0., {-y!r}, {x!r}, 0."
