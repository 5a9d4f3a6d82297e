"""Pictures of kinematic nets on tools."""

import os
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from ..drape import Axes, Pieces, Sheet, TriangleMesh
from ..drape.sheet import unit
from .drawing import draw
from .fields import reach, shades_of, tool_under
from .layout import PAGE
from .sheet import (
    FAMILIES,
    REFUSED,
    Fibres,
    Legend,
    Panel,
    Scale,
    Shape,
    extent,
    in_perspective,
)
from .sheet import Sheet as Picture

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.figure import Figure


def net_on_tool(
    net: Pieces,
    tool: TriangleMesh,
    locking_angle: float | None = None,
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Shear angle of the cells of a net on its tool, and its fibres.

    Seen from the side that the tool faces where the net starts.

    Parameters
    ----------
    net
        The net, a net with darts, or a part of one.
    tool
        The tool.
    locking_angle
        Shear angle in radians; cells that shear by more are marked.

    Other parameters, returned value and exceptions as for `field`.
    """
    (first, _), *_ = pieces = net.pieces
    axes = Axes.at(tool, first.positions[:, *first.start])
    sheet = Sheet.of_net(net)
    points = axes.of_ply(sheet.positions).T
    on = Shape(points, (sheet.elements,), tool=tool_under(points, tool.moved(*axes)))
    (shape,) = in_perspective([on])
    angles = [piece.shear_angle()[cells] for piece, cells in pieces]
    angle = np.degrees(np.abs(np.concatenate(angles)))
    scale = Scale.of(
        "Shear angle (°)", reach([angle], symmetric=False), "viridis", None
    )
    marked, keys = np.empty(0, dtype=int), []
    if locking_angle is not None:
        marked = np.flatnonzero(angle > np.degrees(locking_angle))
        keys = [(f"Above {np.degrees(locking_angle):g}°", REFUSED)]
    corners = points[sheet.elements]
    across = corners[1] + corners[2] - corners[0] - corners[3]
    along = corners[2] + corners[3] - corners[0] - corners[1]
    fibres = Fibres(*(shape.seen(unit(v.T).T) for v in (across, along)))
    shades = shades_of(np.cross(across, along).T)
    greys = Scale("", 0.0, 1.0, mpl.colormaps["gray"])
    panels = [
        Panel("Shear angle", shape, angle, scale, marked=marked),
        Panel("Fibres", shape, shades, greys, fibres),
    ]
    legends = [Legend(0, 1, scale, keys), Legend(1, 2, keys=FAMILIES)]
    picture = Picture([panels], legends, extent([shape]))
    return draw(picture, filename, plotter, PAGE if size is None else size)
