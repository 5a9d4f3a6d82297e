"""Meshes and fibre directions as input of Abaqus."""

import re
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy import ndarray

#: Names of two orientations, whose first directions are those of the families: no
#: orientation of Abaqus holds families that differ in their angle from element to
#: element.
WARP, WEFT = "WARP", "WEFT"

#: The set of elements without directions, and the set of the others.
NOT_COVERED, COVERED = "NOT_COVERED", "COVERED"

# Members of a set in a line: Abaqus takes 16.
_IN_A_LINE = 16

_TYPES = {3: "M3D3", 4: "M3D4R"}


def deck_of(
    cells: Sequence[ndarray],
    points: ndarray,
    warp: ndarray,
    weft: ndarray,
    normal: ndarray,
    node_sets: Mapping[str, ndarray] = MappingProxyType({}),
) -> str:
    """A deck of elements with the direction of both families in each.

    The orientations ``WARP`` and ``WEFT`` have the direction of a family for their
    first axis, in a distribution of points a and b: a along the fibres, and b at right
    angles to them in the plane of the element.  Numbers have all their digits.

    Parameters
    ----------
    cells
        The elements as node numbers, arrays of shape (3, n) and (4, n).
    points
        Positions of the nodes, shape (3, n).
    warp, weft
        Unit directions in these elements, shape (3, n_elements).  Elements with NaN
        have none: they are the set ``NOT_COVERED``, and the others ``COVERED``.
    normal
        Unit normals of the elements, shape (3, n_elements).
    node_sets
        Numbers of nodes from 0 on by the name of their set.
    """
    return "\n".join(
        [
            "*HEADING",
            "mesh and fibre directions, by skfem_textile; lengths in mm",
            *_mesh(cells, points),
            *(
                x
                for name, nodes in node_sets.items()
                for x in _set("NSET", name, nodes)
            ),
            *_covered(np.isfinite(warp).all(axis=0)),
            "*DISTRIBUTION TABLE, NAME=AXES",
            "COORD3D, COORD3D",
            *_family(WARP, warp, normal),
            *_family(WEFT, weft, normal),
            "",
        ]
    )


def _mesh(cells: Sequence[ndarray], points: ndarray) -> Iterator[str]:
    n_nodes = 1 + max(cell.max() for cell in cells)
    yield "*NODE"
    for i, (x, y, z) in enumerate(points[:, :n_nodes].T.tolist(), 1):
        yield f"{i}, {x!r}, {y!r}, {z!r}"
    first = 1
    for cell in cells:
        yield f"*ELEMENT, TYPE={_TYPES[len(cell)]}, ELSET=PLY"
        for i, nodes in enumerate((cell.T + 1).tolist(), first):
            yield ", ".join(map(str, [i, *nodes]))
        first += cell.shape[1]


def _set(keyword: str, name: str, members: ndarray) -> Iterator[str]:
    """A set of what is numbered from 0 on."""
    if not len(members):
        return
    shown = re.sub(r"\W", "_", name)
    yield f"*{keyword}, {keyword}={shown}"
    for i in range(0, len(members), _IN_A_LINE):
        yield ", ".join(map(str, (members[i : i + _IN_A_LINE] + 1).tolist()))


def _covered(covered: ndarray) -> Iterator[str]:
    """Sets of the elements with directions and without, if there are some without."""
    if not covered.all():
        yield from _set("ELSET", COVERED, np.flatnonzero(covered))
        yield from _set("ELSET", NOT_COVERED, np.flatnonzero(~covered))


def _family(name: str, direction: ndarray, normal: ndarray) -> Iterator[str]:
    """The orientation of a family and its distribution."""
    yield f"*ORIENTATION, NAME={name}, SYSTEM=RECTANGULAR"
    yield f"{name}_AXES"
    yield "3, 0."
    yield f"*DISTRIBUTION, NAME={name}_AXES, LOCATION=ELEMENT, TABLE=AXES"
    yield ", 1., 0., 0., 0., 1., 0."
    axes = np.vstack([direction, np.cross(normal, direction, axis=0)]) + 0.0  # no -0.0
    for i in np.flatnonzero(np.isfinite(axes).all(axis=0)):
        yield ", ".join(map(repr, [int(i) + 1, *axes[:, i].tolist()]))
