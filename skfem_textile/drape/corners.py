"""Corners of cells at the edges of a tool.

A net is laid away from its start.  Where an edge of the tool turns back towards the
start, the last corner of a cell follows from three others in another order.
"""

from dataclasses import replace

import numpy as np
from numpy import ndarray

from .crossings import Net
from .laying import Status, crossing
from .triangle_mesh import TriangleMesh

# Steps from the opposite corner of a cell to a missing one.
_STEPS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


def with_corners(tool: TriangleMesh, net: Net, margin: float) -> Net:
    """Net with the missing corners of cells that have another corner on the tool.

    Parameters
    ----------
    tool
        The tool.
    net
        The net.
    margin
        Distance beyond the edges in mm up to which a crossing counts as on the tool.
    """
    x, status = net.positions.copy(), net.status.copy()
    while True:
        corner, one, other, missing = _missing(status)
        near = np.array(
            [tool.beyond_edges(x[:, *of]) <= margin for of in (corner, one, other)]
        ).any(axis=0)
        corner, one, other, missing = (
            of[:, near] for of in (corner, one, other, missing)
        )
        if not missing.size:
            return replace(net, positions=x, status=status)
        found, result = crossing(
            tool, x[:, *one], x[:, *other], x[:, *corner], net.cell
        )
        # A corner that cannot be laid is not tried again.
        status[*missing] = np.where(result == Status.LAID, result, Status.BEHIND)
        laid = result == Status.LAID
        x[:, *missing[:, laid]] = found[:, laid]


def _missing(status: ndarray) -> list[ndarray]:
    """Corners of cells of which one is missing: opposite to it, next to it, and it.

    Numbers of crossings, four of shape (2, n).
    """
    laid, edge = status == Status.LAID, status == Status.EDGE
    i, j = np.nonzero(edge)
    found = []
    for di, dj in _STEPS:
        a, b = i - di, j - dj
        inside = (a >= 0) & (b >= 0) & (a < status.shape[0]) & (b < status.shape[1])
        p, q, a, b = i[inside], j[inside], a[inside], b[inside]
        whole = laid[a, b] & laid[p, b] & laid[a, q]
        found.append(np.array([[a, b], [p, b], [a, q], [p, q]])[:, :, whole])
    joined = np.concatenate(found, axis=2)
    _, first = np.unique(joined[3], axis=1, return_index=True)
    return list(joined[:, :, first])
