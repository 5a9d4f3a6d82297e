"""Corners of cells at the edges of a tool.

A net is laid away from its start.  Where an edge of the tool turns back towards the
start, the last corner of a cell follows from three others in another order.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy import ndarray

from .crossings import Net
from .laying import Status, crossing
from .seams import Seams
from .triangle_mesh import TriangleMesh

# Steps from the opposite corner of a cell to a missing one.
_STEPS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


def with_corners(
    tool: TriangleMesh, net: Net, margin: float, seams: Seams | None = None
) -> Net:
    """Net with the missing corners of cells that have another corner on the tool.

    Parameters
    ----------
    tool
        The tool.
    net
        The net.
    margin
        Distance beyond the edges in mm up to which a crossing counts as on the tool.
    seams
        Seams of darts.
    """
    x, status = net.positions.copy(), net.status.copy()
    labels = (
        np.zeros(status.shape, dtype=int) if net.seams is None else net.seams.copy()
    )
    while True:
        corners = _missing(status)
        near = np.zeros(corners[0].shape[1], dtype=bool)
        for of in corners[:3]:
            on = tool.beyond_edges(x[:, *of]) <= margin
            if seams is not None:
                _, beyond = seams.labels(x[:, *of], labels[None, *of])
                on &= beyond <= 0
            near |= on
        for one, other in combinations([labels[*of] for of in corners[:3]], 2):
            near &= (one != -other) | (one == 0)
        corner, one, other, missing = (of[:, near] for of in corners)
        if not missing.size:
            known = labels if labels.any() else None
            return replace(net, positions=x, status=status, seams=known)
        found, result = crossing(
            tool, x[:, *one], x[:, *other], x[:, *corner], net.cell
        )
        laid = result == Status.LAID
        # A corner that cannot be laid is not tried again.
        status[*missing] = np.where(laid, Status.LAID, Status.BEHIND)
        x[:, *missing[:, laid]] = found[:, laid]
        if seams is not None:
            before = np.array([labels[*one], labels[*other]])
            labels[*missing] = seams.labels(found, before)[0]


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
