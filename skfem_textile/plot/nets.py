"""Pictures of kinematic nets on tools."""

import os
from typing import TYPE_CHECKING

import numpy as np

from ..drape import Axes, Net, Sheet
from ..drape.triangle_mesh import TriangleMesh
from .drawing import draw
from .fields import reach, tool_under
from .sheet import REFUSED, Legend, Panel, Scale, Shape, extent, in_perspective
from .sheet import Sheet as Picture

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.figure import Figure

# Default width of the picture in mm.
_WIDTH = 130.0


def net_on_tool(
    net: Net,
    tool: TriangleMesh,
    locking_angle: float | None = None,
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Shear angle of the cells of a net on its tool.

    Seen from the side that the tool faces where the net starts.

    Parameters
    ----------
    net
        The net.
    tool
        The tool.
    locking_angle
        Shear angle in radians; cells that shear by more are marked.

    Other parameters, returned value and exceptions as for `field`.
    """
    axes = Axes.at(tool, net.start)
    sheet = Sheet.of_net(net)
    points = axes.of_ply(sheet.positions).T
    on = Shape(points, (sheet.elements,), tool=tool_under(points, tool.moved(*axes)))
    (shape,) = in_perspective([on])
    angle = np.degrees(np.abs(sheet.shear_angle()))
    scale = Scale.of("Shear angle (°)", reach([angle], symmetric=False), "viridis", None)
    marked, keys = np.empty(0, dtype=int), []
    if locking_angle is not None:
        marked = np.flatnonzero(angle > np.degrees(locking_angle))
        keys = [(f"Above {np.degrees(locking_angle):g}°", REFUSED)]
    panel = Panel("", shape, angle, scale, marked=marked)
    picture = Picture([[panel]], [Legend(0, 1, scale, keys)], extent([shape]))
    return draw(picture, filename, plotter, _WIDTH if size is None else size)
