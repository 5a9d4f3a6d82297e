"""Pictures of formed plies: fields and tools, sections, and forces over the travel."""

import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy import ndarray

from ..contact import (
    PlacedTool,
    areal_weight,
    contacts,
    placed_tools,
    tool_forces,
    travels,
)
from ..contact.figures import PARTS, driven_tool, mirror_images
from ..contact.placed import standing
from ..contact.risks import wrinkle_risk
from ..ply import Ply
from ..solve.result import Result
from ..solve.states import State
from ..surfaces.tool_mesh import cut_in_two
from .curves import COLOURS, curves
from .drawing import legend_below, new_figure
from .fields import FIELDS, refuse_other_than_result
from .layout import COLUMN, PAGE
from .pictures import RISK, Picture, View, key_of_marks, stage_of
from .sheet import FAMILIES, Legend, Scale

if TYPE_CHECKING:
    import pyvista as pv

    from ..contact import Process

# Width of the three panels in mm: labels are legible at 400 pixels.
_WIDTH = 105.0

# Number of phases beside each other.  Chosen by eye.
_IN_A_ROW = 2

# Label of the areal weight.
_AREAL_WEIGHT = "Areal weight relative to the flat ply"


def formed(
    *results: Result, titles: Sequence[str] = (), **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Shear angle, fibres and areal weight of formed plies, one row per ply.

    With the tools behind the ply where they stand: of each the faces towards the
    viewer.  Elements with a risk of wrinkling are marked on the shear angle.  The
    default width is 105 mm.

    Parameters, returned value and exceptions as for `field`; `ValueError` for a ply
    without tools.
    """
    picture = Picture(results, titles, width=_WIDTH, **options)
    for result in results:
        _refuse_without_tools(result)
    angles, shear = picture.on_one_scale(FIELDS["shear_angle"])
    pairs = zip(results, picture.states, strict=True)
    weights = [areal_weight(result.ply, at.u) for result, at in pairs]
    every = np.concatenate(weights)
    weight = Scale.of(_AREAL_WEIGHT, (every.min(), every.max()), "cividis")
    sheared = picture.panels(angles, shear, marked=_at_risk(picture))
    fibres, weighed = picture.panels(fibres=True), picture.panels(weights, weight)
    legends = (
        Legend(0, 1, shear, key_of_marks(RISK, sheared)),
        Legend(1, 2, keys=FAMILIES),
        Legend(2, 3, weight),
    )
    return picture.drawn([*zip(sheared, fibres, weighed, strict=True)], *legends)


def phases(
    result: Result, process: "Process", **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Shear angle at the end of each phase of a process, with the tools.

    Elements with a risk of wrinkling are marked.  The default width is 105 mm.

    Parameters
    ----------
    result
        Result of a run of the process.  One that stopped early is also drawn in its
        last state.
    process
        The process.
    **options
        Options as for `field`.

    Raises
    ------
    ValueError
        If no load step was completed; see also `formed`.
    """
    ends = process.at_ends(result)
    if not ends:
        raise ValueError("no load step was completed: there is no phase to draw")
    until = [replace(result, states=result.states[: i + 1]) for i in ends]
    picture = Picture(until, width=_WIDTH, **options)
    titles = []
    for one in until:
        t = one.states[-1].load_factor
        moved = ", ".join(map(str, one.tool_motions(t)))
        titles.append(": ".join(filter(None, (process.phase_at(t), moved))))
    angles, shear = picture.on_one_scale(FIELDS["shear_angle"])
    panels = picture.panels(angles, shear, marked=_at_risk(picture), titles=titles)
    rows = [panels[i : i + _IN_A_ROW] for i in range(0, len(panels), _IN_A_ROW)]
    marks = key_of_marks(RISK, panels)
    return picture.drawn(rows, Legend(0, len(rows[0]), shear, marks))


def _at_risk(picture: Picture) -> list[ndarray]:
    """Elements with a risk of wrinkling of each result of a picture."""
    pairs = zip(picture.results, picture.states, strict=True)
    return [
        np.flatnonzero(wrinkle_risk(result.ply, at.u, at.parameters))
        for result, at in pairs
    ]


# Number of cubes along the longest side of a section in which tools are triangulated,
# depth to which they are filled, relative to this side, number of sections by default,
# and margin around the ply relative to its size.  Chosen by eye.
_CUBES, _DEPTH, _SECTIONS, _MARGIN = 96, 0.04, 4, 0.06

# Line of a ply in a section, and share of white in the colour of tools.
_PLY: dict[str, Any] = {"color": "black", "linewidth": 1.2}
_PALE = 0.55

# Distance from the plane of a section, relative to the size of the ply, that is
# round-off: nodes there are on the plane.
_ON_PLANE = 1e-9


def section(
    result: Result,
    filename: str | os.PathLike[str] | None = None,
    *,
    angle: float = 0.0,
    states: Sequence[int] | None = None,
) -> Figure:
    """Section through a formed ply and its tools, one panel per state.

    Tools are filled to a small depth behind their faces.  Coordinates are in the axes
    ``stated`` by the tools; off the x axis, distances from the origin of the ply.

    Parameters
    ----------
    result
        Result of a run.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).
    angle
        Angle in radians to the x axis of the plane of the section, which contains the z
        axis.
    states
        Indices of states; by default four that are evenly spaced.

    Raises
    ------
    ValueError, FileNotFoundError
        For a ply without tools, and as `picture_path`.
    """
    with new_figure(filename) as figure:
        _refuse_without_tools(result)
        every = result.states
        if states is None:
            even = np.linspace(0, len(every) - 1, _SECTIONS).round().astype(int)
            states = np.unique(even).tolist()
        chosen = [every[i] for i in states]
        low, high = _extent(result.ply, chosen, angle)
        origin = _origin(result.ply, angle)
        columns = min(2, len(chosen))
        rows = -(-len(chosen) // columns)
        width = (PAGE if columns > 1 else COLUMN) / 25.4
        height = rows * (
            width / columns * (high[1] - low[1]) / (high[0] - low[0]) + 0.45
        )
        names = [tool.name for tool in standing(result.ply)]
        colours = dict(zip(names, cycle(COLOURS), strict=False))
        figure.set_size_inches(width, height + 0.3)
        tools = _tools(result.ply, chosen, angle, low, high)
        for i, (state, placed) in enumerate(zip(chosen, tools, strict=True), start=1):
            axes = figure.add_subplot(rows, columns, i, aspect="equal")
            for tool in placed:
                depth = _DEPTH * float((high - low).max())
                _fill(axes, tool, angle, depth, colours[tool.name], origin)
            cut = origin + _of_ply(result.ply, state, angle)
            axes.add_collection(LineCollection(list(cut), capstyle="round", **_PLY))
            xlim, ylim = zip(origin + low, origin + high, strict=True)
            axes.set(xlim=xlim, ylim=ylim, title=stage_of(result, state))
            axes.set(xlabel="In the plane (mm)" if angle else "x (mm)", ylabel="z (mm)")
        handles: list[Artist] = [Line2D([], [], label="ply", **_PLY)]
        handles += [Patch(color=c, label=name) for name, c in colours.items()]
        legend_below(figure, handles, columns=4)
    return figure


def _of_ply(ply: Ply, state: State, angle: float) -> ndarray:
    """Segments in which the plane of a section cuts a ply, shape (n, 2, 2)."""
    x = ply.positions(state.u)[:, : ply.mesh.nvertices]
    return _cut(x, cut_in_two((ply.mesh.t,)), angle)[0]


def _cut(x: ndarray, triangles: ndarray, angle: float) -> tuple[ndarray, ndarray]:
    """Segments in which a plane through the z axis cuts triangles, and these.

    Shapes (n, 2, 2) and (n,).
    """
    away = np.cos(angle) * x[1] - np.sin(angle) * x[0]
    away = np.where(np.abs(away) <= _ON_PLANE * np.ptp(x), 0.0, away)
    one, other = triangles, np.roll(triangles, -1, axis=0)
    crossed = (away[one] > 0) != (away[other] > 0)
    one, other = one.T[crossed.T], other.T[crossed.T]
    share = away[one] / (away[one] - away[other])
    in_plane = _in_plane(x, angle)
    points = in_plane[:, one] + share * (in_plane[:, other] - in_plane[:, one])
    return points.T.reshape(-1, 2, 2), np.flatnonzero(crossed.any(axis=0))


def _in_plane(x: ndarray, angle: float) -> ndarray:
    """Coordinates along the plane of a section and z, shape (2, n)."""
    return np.array([np.cos(angle) * x[0] + np.sin(angle) * x[1], x[2]])


def _origin(ply: Ply, angle: float) -> ndarray:
    """Origin of the ply in the coordinates of a section, shape (2,)."""
    x, _, z = contacts(ply)[0].stated(np.zeros((3, 1)))[:, 0]
    return np.array([0.0 if angle else x, z])


def _extent(ply: Ply, states: Sequence[State], angle: float) -> tuple[ndarray, ndarray]:
    """Corners of a section that contains a ply in all states, with a margin."""
    x = np.hstack([_in_plane(ply.positions(state.u), angle) for state in states])
    low, high = x.min(axis=1), x.max(axis=1)
    margin = _MARGIN * float((high - low).max())
    return low - margin, high + margin


def _tools(
    ply: Ply, states: Sequence[State], angle: float, low: ndarray, high: ndarray
) -> list[list[PlacedTool]]:
    """Tools near the plane of a section in each state."""
    along = np.outer((low[0], high[0]), (np.cos(angle), np.sin(angle)))
    margin = 2 * float((high - low).max()) / _CUBES
    box = (
        np.array([*along.min(axis=0) - margin, low[1]]),
        np.array([*along.max(axis=0) + margin, high[1]]),
    )
    return placed_tools(ply, states, *box, _CUBES)


def _fill(
    axes: Axes,
    tool: PlacedTool,
    angle: float,
    depth: float,
    colour: str,
    origin: ndarray,
) -> None:
    """Draw the face of a tool, and fill it to a depth behind the face."""
    ends, triangles = _cut(tool.points, tool.triangles, angle)
    ends = origin + ends
    normal = _in_plane(tool.normals[:, triangles], angle)
    length = np.linalg.norm(normal, axis=0)
    behind = depth * (normal / np.where(length > 0, length, 1.0)).T[:, None]
    body = np.concatenate([ends, (ends - behind)[:, ::-1]], axis=1)
    pale = to_rgb(colour) + _PALE * (1 - np.array(to_rgb(colour)))
    axes.add_collection(PolyCollection(list(body), color=[pale], lw=0.4, zorder=0))
    axes.add_collection(
        LineCollection(list(ends), color=colour, lw=0.6, capstyle="round")
    )


def tool_force(
    result: Result,
    filename: str | os.PathLike[str] | None = None,
    process: "Process | None" = None,
) -> Figure:
    """Plot the force of each tool, and of clamps, on the ply over the travel.

    The component along the motion of the tool that reaches deepest, against its travel;
    of clamps the magnitude.  If a half or quarter of the ply is computed, the
    label says that the forces are those on it.

    Parameters
    ----------
    result
        Result of a run.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).
    process
        Process of the run: each phase that has begun has a panel.

    Raises
    ------
    ValueError, FileNotFoundError
        For a ply without tools, and as `picture_path`.
    """
    _refuse_without_tools(result)
    far = travels(result)
    driven = driven_tool(result)
    clamps = [result.clamp_forces(state) for state in result.states]
    forces = tool_forces(result) | {
        key.removesuffix("_force_N"): np.array([row[key] for row in clamps])
        for key in clamps[0]
    }
    panels, first = {}, 0
    ends = process.at_ends(result) if process else [len(result.states) - 1]
    for end in ends:
        name = process.phase_at(result.states[end].load_factor) if process else ""
        of = slice(first, end + 1)
        panels[name] = {k: (far[driven][of], force[of]) for k, force in forces.items()}
        first = end
    part = PARTS.get(mirror_images(result.ply))
    what = f"Force on a {part} of the ply (N)" if part else "Force on the ply (N)"
    labels = f"Travel of {driven} (mm)", what
    return curves(panels, *labels, filename, same_scales=True)


def _refuse_without_tools(result: Result) -> None:
    refuse_other_than_result("a picture of tools", result)
    if not contacts(result.ply):
        raise ValueError("a ply has no tools between which it is formed: add a Tool")
