"""A kinematic net over a ply that is laid on a tool."""

import numpy as np
from numpy import ndarray

from ...drape import Net, net
from ...solve.surface import OnSurface

#: Cells of a net over the longer side of the ply.  Chosen: directions of its threads at
#: the edges are off by 1e-4.
CELLS = 64


def net_over(
    points: ndarray,
    on_tool: OnSurface,
    t: float,
    angles: tuple[float, float],
    beyond: int = 0,
) -> Net:
    """A net that reaches up to points of a ply, or beyond them.

    Parameters
    ----------
    points
        Points of the flat ply in mm, shape (2, n).
    on_tool, t
        The surface, and the load factor to which it has grown.
    angles
        Inclination of warp and weft at rest in radians.
    beyond
        Cells that it reaches beyond them.

    Raises
    ------
    ValueError
        As from `net`.
    """
    cell = float(np.ptp(points, axis=1).max()) / CELLS
    flat, touch = np.array([np.cos(angles), np.sin(angles)]), on_tool.touch
    ends = np.linalg.solve(flat, points - np.array(touch)[:, None]) / cell
    further = [[[i], [j]] for i in (-beyond, beyond) for j in (-beyond, beyond)]
    over = np.hstack([ends + np.array(step) for step in further])
    reach = np.array([np.maximum(-over.min(axis=1), 0), over.max(axis=1)])
    warp, weft = np.ceil(reach).astype(int).T.tolist()
    return net(
        *(on_tool.at("tool", t), cell, tuple(warp), tuple(weft)),
        angles=angles,
        touch=touch,
        over=cell * flat @ over + np.array(touch)[:, None],
    )
