"""Pictures of kinematic nets on tools."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..nets.sheet import Pieces, Sheet
from ..nets.start_search import BestStart
from ..surfaces.surface import Axes
from ..surfaces.triangle_mesh import TriangleMesh
from .drawing import draw, legend_below, new_figure
from .fields import FIELDS, reach, tool_under
from .layout import PAGE, default_width
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
    scale = _scale("Magnitude of the shear angle (°)", reach([angle]))
    marked, keys = np.empty(0, dtype=int), []
    if locking_angle is not None:
        marked = np.flatnonzero(angle > np.degrees(locking_angle))
        keys = [(f"Above {np.degrees(locking_angle):g}°", REFUSED)]
    fibres = Fibres.of(sheet.flat, shape.cells, sheet.warp, sheet.weft)
    panels = [
        Panel("", shape, angle, scale, marked=marked),
        Panel("", shape, fibres=fibres),
    ]
    legends = [Legend(0, 1, scale, keys), Legend(1, 2, keys=FAMILIES)]
    picture = Picture([panels], legends, extent([shape]))
    return draw(picture, filename, plotter, PAGE if size is None else size)


def _scale(label: str, limits: tuple[float, float]) -> Scale:
    """Colours of the shear angle in all pictures, between two magnitudes."""
    return Scale.of(label, limits, FIELDS["shear_angle"].cmap, signed=True)


# Length of the line along the warp at a start, and smallest and largest height of the
# map, relative to its width.
_LINE, _LOWEST, _HIGHEST = 0.05, 0.4, 1.4


def starts(
    best: BestStart,
    tool: TriangleMesh,
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Map of all starts of a search on their tool, with the shear of their nets.

    The tool is seen along the coordinate axis that is closest to its mean normal.  A
    line at each place is the direction of the warp.

    Parameters
    ----------
    best
        Result of `drape.best_start`.
    tool
        The tool.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.
    """
    with new_figure(filename) as figure:
        corners = tool.facets.points[:, tool.facets.triangles()]
        a, b, c = corners.swapaxes(0, 1)
        normal = np.cross(b - a, c - a, axis=0).sum(axis=1)
        up = int(np.abs(normal).argmax())
        i, j = (k for k in range(3) if k != up)
        at, along = best.points[[i, j]], best.directions[[i, j]]
        low, high = (f(corners, axis=(1, 2))[[i, j]] for f in (np.min, np.max))
        width = default_width(1) / 25.4
        span = high - low
        height = (
            0.75 * width * float(np.clip(span[1] / span[0], _LOWEST, _HIGHEST)) + 0.9
        )
        half = 0.5 * _LINE * float(span.max()) * along
        laid = np.isfinite(best.measures)
        figure.set_size_inches(width, height)
        axes = figure.add_subplot()
        flat = corners[[i, j]].transpose(2, 1, 0)
        axes.add_collection(
            PolyCollection(list(flat), facecolor="0.93", edgecolor="0.93", lw=0.2)
        )
        ends = np.array([at - half, at + half])
        axes.plot(*ends[:, :, laid].swapaxes(0, 1), color="black", lw=0.5, zorder=4)
        axes.plot(*at[:, ~laid], "x", color="0.55", markersize=3, zorder=2)
        degrees = np.degrees(best.measures[laid])
        x, y = at[:, laid]
        scale = _scale("Shear angle (°)", (degrees.min(), degrees.max()))
        shown = {"cmap": scale.colours, "vmin": scale.low, "vmax": scale.high}
        dots = axes.scatter(x, y, c=degrees, s=9, zorder=3, **shown)
        figure.colorbar(dots, ax=axes, label=scale.label)
        chosen = np.asarray(best.start.point)[[i, j]]
        axes.plot(*chosen, "o", mfc="none", mec=REFUSED, markersize=9, zorder=4)
        axes.set(aspect="equal", xlabel=f"{'xyz'[i]} (mm)", ylabel=f"{'xyz'[j]} (mm)")
        axes.autoscale_view()
        looks: dict[str, dict[str, Any]] = {
            "best start": {"marker": "o", "mfc": "none", "mec": REFUSED, "ms": 7},
            "folds or leaves a gap": {"marker": "x", "color": "0.55", "ms": 4},
        }
        handles = [Line2D([], [], ls="", label=k, **looks[k]) for k in looks]
        legend_below(figure, handles[: 1 if laid.all() else 2], columns=2)
    return figure
