"""Pictures of plies: fields in colours, fibres, and what was found of states."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..fabric.directions import FibreDirections
from ..io.results import cell_fields, fields_on_tool
from ..mesh.splitting import original_elements
from ..solve.result import Result, StepError
from ..solve.states import State
from .fields import FIELDS, Field, field_of, reach, values_of
from .layout import PAGE
from .renderers.drawing import draw
from .shapes import chosen, on_one_scale
from .sheet import (
    REFUSED,
    WARP,
    WEFT,
    Fibres,
    Legend,
    Panel,
    Scale,
    Shape,
    Sheet,
    extent,
)

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.figure import Figure


# Names of families, and of the fields of their strains.
_STRAINS = {"Warp": "warp_strain", "Weft": "weft_strain"}


class Options(TypedDict, total=False):
    """What all pictures take; `field` says what each is."""

    titles: Sequence[str]
    filename: str | os.PathLike[str] | None
    plotter: "pv.Plotter | None"
    state: int
    cmap: Any
    clim: Sequence[float] | None
    show_edges: bool | None
    size: float | tuple[float, float] | None


def field(
    *results: Result,
    field: str | Field = "shear_angle",
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    state: int = -1,
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """A field on the deformed plies, one panel per result, all on one scale.

    Plies in their plane are seen from above, plies in space in perspective.

    Parameters
    ----------
    *results
        Results of runs.
    field
        Name in `FIELDS`, or a `Field` of one's own.
    titles
        One short title per result.  If not given, what is drawn, with its unit; of
        several results their formulations.
    filename
        Where to write a PNG with 300 dots per inch, or vectors: .svg, .pdf or .eps.
    plotter
        Draw into the subplots of this plotter, from the active one on, a panel into
        each, and not into a new plotter.  Pictures in several subplots share a scale
        if they have the same ``clim``.
    state
        Number of the state in ``result.states``; -1 is the last.
    cmap
        Colours, as matplotlib knows them; those of the field if not given.
    clim
        Least and largest value on the scale; if not given, round numbers that hold
        every value and zero.  Arrows at the scale tell of values beyond.
    show_edges
        Whether the edges of elements are drawn; if not given, where the mean element
        has a side of 1.3 mm on the picture.  The outline of a ply is always drawn.
    size
        Width in mm, or width and height.  If not given, 85 mm, a column of a journal;
        174 mm, a page, from three panels side by side on; and as high as needed.

    Returns
    -------
    pyvista.Plotter or matplotlib.figure.Figure
        The plotter, off screen, for further drawing; of vectors the figure.

    Raises
    ------
    ImportError
        If pyvista or matplotlib is not installed; the message says how to.
    RuntimeError
        If nothing can be drawn off screen here; the message says what to install.
    ValueError
        If there is no result, not one title per result, no such state, field or colour
        map; if limits do not rise, the size leaves no room, or the plotter has too few
        subplots; if the name of the file has another suffix, or asks for vectors of a
        plotter.
    FileNotFoundError
        If the folder of the file does not exist.

    Examples
    --------
    >>> from skfem_textile import Fabric, LoadStepper, Ply, plot
    >>> from skfem_textile.scenes import strip
    >>> scene = strip(size=(3, 4))
    >>> ply = Ply(scene.mesh, Fabric(1e4))
    >>> result = LoadStepper(ply, scene.conditions, steps=4).run()
    >>> figure = plot.field(result, field="displacement", filename="moved.pdf")
    ... # doctest: +SKIP
    """
    titles, shapes, states = chosen(results, titles, state, filename)
    shown, scale = on_one_scale(results, states, field_of(field), cmap, clim)
    row = [
        Panel(title or scale.label, shape, values, scale)
        for title, shape, values in zip(titles, shapes, shown, strict=True)
    ]
    legend = Legend(0, len(row), scale)
    sheet = Sheet([row], [legend], extent(shapes), show_edges)
    return draw(sheet, filename, plotter, size)


def shear_angle(*results: Result, **options: Unpack[Options]) -> "pv.Plotter | Figure":
    """Shear angle in degrees, one panel per result, all on one scale.

    Parameters, returned value and errors as for `field`.
    """
    return field(*results, field="shear_angle", **options)


def fibre_strain(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    state: int = -1,
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Fibre strain of warp (above) and weft (below), one column per result.

    The strain is that which enters the law of tension: in macro-elements the mean
    over an element, otherwise that at the element's own points.  All panels share one
    diverging scale, symmetric about zero.  Of one result that is taller than wide warp
    and weft are side by side.

    Parameters, returned value and errors as for `field`.
    """
    titles, shapes, states = chosen(results, titles, state, filename)
    rows, scale = _strain_rows(results, titles, shapes, states, cmap, clim)
    low, high = extent(shapes)
    if len(results) == 1 and high[1] - low[1] > high[0] - low[0]:
        rows = [[panel for row in rows for panel in row]]
    legend = Legend(0, len(rows[0]), scale)
    sheet = Sheet(rows, [legend], (low, high), show_edges)
    return draw(sheet, filename, plotter, size)


def contact_sheet(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    state: int = -1,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Warp strain, weft strain and shear angle in columns, one row per result.

    Parameters, returned value and errors as for `field`.
    """
    titles, shapes, states = chosen(results, titles, state, filename)
    strains, strain = _strain_rows(results, titles, shapes, states)
    angles, shear = on_one_scale(results, states, FIELDS["shear_angle"])
    rows = [
        [
            warp,
            weft,
            Panel(
                _titled("Shear angle", title, "shear_angle"), warp.shape, values, shear
            ),
        ]
        for warp, weft, title, values in zip(*strains, titles, angles, strict=True)
    ]
    legends = [Legend(0, 2, strain), Legend(2, 3, shear)]
    return draw(
        Sheet(rows, legends, extent(shapes), show_edges), filename, plotter, size
    )


def fibre_directions(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    state: int = -1,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Directions of warp (blue) and weft (red): a line per element and family.

    Of elements that are closer than 2.5 mm on the picture some have lines.

    Parameters, returned value and errors as for `field`.
    """
    titles, shapes, states = chosen(results, titles, state, filename)
    row = []
    for result, title, shape, at in zip(results, titles, shapes, states, strict=True):
        fields = cell_fields(result.ply, at.u)
        names = "warp_direction", "weft_direction"
        fibres = Fibres(*(shape.seen(fields[name]) for name in names))
        row.append(Panel(title or "Fibre directions", shape, fibres=fibres))
    legend = Legend(0, len(row), keys=[("Warp", WARP), ("Weft", WEFT)])
    sheet = Sheet([row], [legend], extent(shapes), show_edges)
    return draw(sheet, filename, plotter, size)


def verdict(
    *runs: Result | StepError,
    field: str | Field | None = None,
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    state: int = -1,
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """What was found of states, in words above a field; where steps were refused.

    Parameters
    ----------
    *runs
        Results, and errors of runs that stopped.  Of an error the message is the title,
        the last good state is drawn, and the elements to blame are marked.
    field
        Name in `FIELDS`, or a `Field` of one's own.  If not given, the shear angle or
        fibre strain whose law ends where the first of the runs stopped that stopped at
        the end of a law; else the smallest area over the initial area in each element,
        which is zero where an element folds.

    Other parameters, returned value and errors as for `field`.
    """
    results = [run.result if isinstance(run, StepError) else run for run in runs]
    _, shapes, states = chosen(results, (), state, filename)
    ended = [run.quantity for run in runs if isinstance(run, StepError)]
    field = field or next(filter(None, ended), "area_ratio")
    shown, scale = on_one_scale(results, states, field_of(field), cmap, clim)
    row = []
    for run, shape, at, values in zip(runs, shapes, states, shown, strict=True):
        refused = isinstance(run, StepError)
        marked = run.elements if isinstance(run, StepError) else np.empty(0, dtype=int)
        title = str(run) if refused else _words(at)
        row.append(Panel(title, shape, values, scale, marked=marked))
    some = any(panel.marked.size for panel in row)
    keys = [("Elements where the step was refused", REFUSED)] if some else []
    legend = Legend(0, len(row), scale, keys)
    sheet = Sheet([row], [legend], extent(shapes), show_edges)
    return draw(sheet, filename, plotter, size)


def _words(state: State) -> str:
    """The verdict on a state, as a title."""
    found = state.verdict
    n = found.negative_pivots
    stability = "stable" if found.stable else "not stable"
    if n:
        stability += f", {n} negative pivot{'s' if n > 1 else ''}"
    return (
        f"Load factor {state.load_factor:.4g}: {stability}, smallest area ratio "
        f"{found.min_det_F:.3g}, largest fibre strain "
        f"{100 * found.max_fibre_strain:.2g} %"
    )


def _titled(name: str, title: str, field: str) -> str:
    """The title of a panel: its name and the result; of one alone the field."""
    return f"{name}, {title}" if title else FIELDS[field].label


def _strain_rows(
    results: Sequence[Result],
    titles: Sequence[str],
    shapes: Sequence[Shape],
    states: Sequence[State],
    cmap: Any = None,
    clim: Sequence[float] | None = None,
) -> tuple[list[list[Panel]], Scale]:
    """Panels of warp and of weft, on one scale."""
    both = [FIELDS[name] for name in _STRAINS.values()]
    pairs = list(zip(results, states, strict=True))
    shown = [[values_of(f, r.ply, at.u) for r, at in pairs] for f in both]
    found = reach([values for row in shown for values in row], symmetric=True)
    scale = Scale.of("Fibre strain in the law (%)", found, cmap or both[0].cmap, clim)
    rows = [
        [
            Panel(_titled(family, title, _STRAINS[family]), shape, values, scale)
            for title, shape, values in zip(titles, shapes, row, strict=True)
        ]
        for family, row in zip(_STRAINS, shown, strict=True)
    ]
    return rows, scale


def mesh_and_fibres(
    mesh: Mesh,
    directions: FibreDirections,
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """A mesh with warp (blue) and weft (red) in each element, before any run.

    Of elements that are closer than 2.5 mm on the picture some have lines.

    Parameters
    ----------
    mesh
        The mesh; of a split or cut mesh the user's elements are drawn.
    directions
        Directions in these elements.
    filename, plotter, show_edges, size
        As for `skfem_textile.plot.field`.

    Returns
    -------
    pyvista.Plotter or matplotlib.figure.Figure
        As `skfem_textile.plot.field`.

    Raises
    ------
    ImportError, RuntimeError, FileNotFoundError
        As `skfem_textile.plot.field`.
    ValueError
        As `skfem_textile.plot.field`, or if there is not one direction for each
        element.
    """
    cells, _ = original_elements(mesh)
    directions.refuse_other(cells)
    n = directions.warp.shape[1]
    shape = Shape(np.pad(mesh.p, ((0, 1), (0, 0))).T, cells)
    fibres = Fibres(_unit(directions.warp), _unit(directions.weft))
    panel = Panel(f"Mesh and fibres, {n} elements", shape, fibres=fibres)
    keys = [("Warp", WARP), ("Weft", WEFT)]
    sheet = Sheet([[panel]], [Legend(0, 1, keys=keys)], extent([shape]), show_edges)
    return draw(sheet, filename, plotter, size)


def _unit(vectors: ndarray) -> ndarray:
    """Columns of plane vectors as rows of unit vectors in space."""
    return np.pad(vectors / np.hypot(*vectors), ((0, 1), (0, 0))).T


# What is marked is drawn in this colour, and named so.
_RISK = [("Fibres may wrinkle", REFUSED)]


def draped(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    state: int = -1,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Shear angle and contact pressure of plies on tools, a row for each.

    Elements in which fibres may wrinkle are marked on the shear angle.  A pressure
    below zero is a pull: there the ply bridges the tool.

    Parameters
    ----------
    *results
        Results of runs of plies that lie on tools.
    titles, filename, plotter, state, show_edges, size
        As for `field`; 174 mm wide if no size is given.

    Returns
    -------
    pyvista.Plotter or matplotlib.figure.Figure
        As `field`.

    Raises
    ------
    ImportError, RuntimeError, FileNotFoundError
        As `field`.
    ValueError
        As `field`, or if a ply is on no tool.
    """
    titles, shapes, states = chosen(results, titles, state, filename)
    pairs = list(zip(results, states, strict=True))
    found = [_found(result, at) for result, at in pairs]
    angles, shear = on_one_scale(results, states, FIELDS["shear_angle"])
    pressures = [pressure for pressure, _ in found]
    label = "Contact pressure (N/mm²)"
    scale = Scale.of(label, reach(pressures, symmetric=True), "RdBu_r", None)
    rows = [
        [
            Panel(_named("Shear angle", title), shape, angle, shear, marked=at_risk),
            Panel(_named("Contact pressure", title), shape, pressure, scale),
        ]
        for title, shape, angle, (pressure, at_risk) in zip(
            titles, shapes, angles, found, strict=True
        )
    ]
    keys = _RISK if any(at_risk.size for _, at_risk in found) else []
    legends = [Legend(0, 1, shear, keys), Legend(1, 2, scale)]
    sheet = Sheet(rows, legends, extent(shapes), show_edges)
    return draw(sheet, filename, plotter, size or (None if plotter else PAGE))


def _named(name: str, title: str) -> str:
    return f"{name}, {title}" if title else name


def _found(result: Result, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Contact pressure of elements, and numbers of those at risk of wrinkles."""
    ply, surface = result.ply, result.tool(state.load_factor)
    if surface is None:
        raise ValueError("a ply is on no tool: it needs a condition OnSurface")
    points, cells = fields_on_tool(ply, surface, state)
    pressure = points["contact_pressure"][ply.mesh.t].mean(axis=0)
    return pressure, np.flatnonzero(cells["wrinkle_risk"])
