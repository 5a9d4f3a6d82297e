"""Pictures of plies: fields, fibres and acceptance checks."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..fabric.directions import FibreDirections
from ..io.results import fields_on_tool, has_tools
from ..mesh.splitting import original_elements
from ..solve.result import Result, StepError
from ..solve.states import State
from .drawing import draw
from .fibre_lines import Fibres
from .fields import (
    DIVERGING,
    FIELDS,
    Drawn,
    Field,
    fibres_of,
    field_of,
    on_one_scale,
    reach,
    results_of,
    scale_of,
    shapes_of,
    values_of,
)
from .layout import PAGE
from .picture_files import picture_path
from .sheet import (
    FAMILIES,
    REFUSED,
    THREADS,
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


class View(TypedDict, total=False):
    """Options common to all pictures of results; see `field`."""

    filename: str | os.PathLike[str] | None
    plotter: "pv.Plotter | None"
    state: int
    show_edges: bool | None
    size: float | tuple[float, float] | None


class Options(View, total=False):
    """Options of pictures of a field."""

    titles: Sequence[str]
    cmap: Any
    clim: Sequence[float] | None
    fibres: bool


class Picture:
    """Results, each in one state, with drawing options."""

    def __init__(
        self,
        drawn: Sequence[Drawn],
        titles: Sequence[str] = (),
        *,
        filename: str | os.PathLike[str] | None = None,
        plotter: "pv.Plotter | None" = None,
        state: int = -1,
        show_edges: bool | None = None,
        size: float | tuple[float, float] | None = None,
    ) -> None:
        if filename is not None:
            picture_path(filename)
        self.results, self.states = results_of(drawn, state)
        results, alone = self.results, len(self.results) == 1
        several = [] if alone else [x.ply.formulation.title for x in results]
        self._names = titles or several or [""]
        if len(self._names) != len(results):
            raise ValueError(
                f"{len(results)} results require {len(results)} titles, got "
                f"{len(titles)}"
            )
        self.shapes = shapes_of(results, self.states)
        self._show_edges, self._how = show_edges, (filename, plotter, size)

    def titles(self, drawn: str = "", alone: str = "") -> list[str]:
        """Titles of the results, with load factor and travel of a ply between tools.

        They begin with what is ``drawn``; ``alone`` replaces an empty name of a result.
        """
        titles = []
        for name, result, state in zip(
            self._names, self.results, self.states, strict=True
        ):
            stage = stage_of(result, state) if has_tools(result.ply) else ""
            first = ", ".join(filter(None, (drawn, name or alone)))
            if first and stage:
                stage = f", {stage[0].lower()}{stage[1:]}"
            titles.append(first + stage)
        return titles

    def drawn(
        self, rows: Sequence[Sequence[Panel]], *legends: Legend
    ) -> "pv.Plotter | Figure":
        """Picture of rows of panels and their legends."""
        sheet = Sheet(rows, legends, extent(self.shapes), self._show_edges)
        return draw(sheet, *self._how)

    def on_one_scale(
        self, field: Field, cmap: Any = None, clim: Sequence[float] | None = None
    ) -> tuple[list[ndarray], Scale]:
        """Values of a field for each result, and their common scale."""
        return on_one_scale(self.results, self.states, field, cmap, clim)


def field(
    *results: Drawn,
    field: str | Field = "shear_angle",
    titles: Sequence[str] = (),
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    fibres: bool = False,
    **options: Unpack[View],
) -> "pv.Plotter | Figure":
    """Field on the deformed plies, one panel per result, with a common scale.

    Plane plies are drawn from above, plies in space in perspective.

    Parameters
    ----------
    *results
        Results of runs; or a basis, its DOF vector and a fabric, as for `fibre_fields`.
    field
        Name in `FIELDS`, or a custom `Field`.
    titles
        One short title per result. By default none or, for several results, their
        formulations.
    filename
        Output file: PNG with 300 dots per inch, or vector graphics (.svg, .pdf, .eps).
    plotter
        Draw into the subplots of this plotter, one panel each, starting with the active
        one. Pictures in several subplots share a scale if they have the same ``clim``.
    state
        Index of the state in ``result.states``; -1 is the last.
    cmap
        Matplotlib colour map from one end of the scale to the other; by default the
        colour map of the field, which has its middle at zero if values have a sign.
    clim
        Limits of the scale; by default round numbers that enclose all values and zero.
        Arrows mark values beyond the limits.
    fibres
        If True, draw the fibres of both families on the field.
    show_edges
        If True, draw element edges; by default if the mean element has a side of at
        least 1.3 mm on the picture. The outline of a ply is always drawn.
    size
        Width in mm, or width and height. The default width is 85 mm (journal column),
        or 174 mm (page) for three or more panels side by side; the height follows.

    Returns
    -------
    pyvista.Plotter or matplotlib.figure.Figure
        The off-screen plotter for further drawing; for vector graphics the figure.

    Raises
    ------
    ImportError
        If pyvista or matplotlib is not installed; the message gives the command.
    RuntimeError
        If off-screen drawing fails; the message names the packages to install.
    ValueError
        If results are missing, titles do not match the results, or the state, field or
        colour map is unknown; if limits do not increase, the size is too small, or the
        plotter has too few subplots; if the suffix is not supported, or requests vector
        graphics from a plotter.
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
    picture = Picture(results, titles, **options)
    fields, scale = picture.on_one_scale(field_of(field), cmap, clim)
    row = [
        Panel(title, shape, values, scale, fibres_of(result.ply) if fibres else None)
        for title, shape, values, result in zip(
            *(picture.titles(), picture.shapes, fields, picture.results), strict=True
        )
    ]
    return picture.drawn([row], Legend(0, len(row), scale, THREADS if fibres else ()))


def shear_angle(*results: Drawn, **options: Unpack[Options]) -> "pv.Plotter | Figure":
    """Shear angle in degrees, one panel per result, with a common scale.

    Parameters, returned value and exceptions as for `field`.
    """
    return field(*results, field="shear_angle", **options)


def fibre_strain(
    *results: Drawn,
    titles: Sequence[str] = (),
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    **options: Unpack[View],
) -> "pv.Plotter | Figure":
    """Fibre strain of warp (above) and weft (below), one column per result.

    The strain is the argument of the tension law: in macro-elements the mean over an
    element, otherwise the value at the element's points. All panels share a diverging
    scale, symmetric about zero. For a single result that is taller than wide, warp and
    weft are side by side.

    Parameters, returned value and exceptions as for `field`.
    """
    picture = Picture(results, titles, **options)
    rows, scale = _strain_rows(picture, cmap, clim)
    low, high = extent(picture.shapes)
    if len(picture.results) == 1 and high[1] - low[1] > high[0] - low[0]:
        rows = [[panel for row in rows for panel in row]]
    return picture.drawn(rows, Legend(0, len(rows[0]), scale))


def contact_sheet(
    *results: Drawn, titles: Sequence[str] = (), **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Warp strain, weft strain and shear angle in columns, one row per result.

    Parameters, returned value and exceptions as for `field`.
    """
    picture = Picture(results, titles, **options)
    strains, strain = _strain_rows(picture)
    angles, shear = picture.on_one_scale(FIELDS["shear_angle"])
    rows = []
    for warp, weft, title, values in zip(
        *strains, picture.titles(), angles, strict=True
    ):
        rows.append([warp, weft, Panel(title, warp.shape, values, shear)])
    return picture.drawn(rows, Legend(0, 2, strain), Legend(2, 3, shear))


def fibre_directions(
    *results: Drawn, titles: Sequence[str] = (), **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Fibres of warp (blue) and weft (red), at equal distances in the flat ply.

    Parameters, returned value and exceptions as for `field`.
    """
    picture, row = Picture(results, titles, **options), []
    titled = picture.titles(alone="Fibre directions")
    for result, title, shape in zip(
        picture.results, titled, picture.shapes, strict=True
    ):
        row.append(Panel(title, shape, fibres=fibres_of(result.ply)))
    return picture.drawn([row], Legend(0, len(row), keys=FAMILIES))


def verdict(
    *runs: Result | StepError,
    field: str | Field | None = None,
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    **options: Unpack[View],
) -> "pv.Plotter | Figure":
    """Acceptance checks of states as titles above a field, and rejected steps.

    Parameters
    ----------
    *runs
        Results, and exceptions of runs that stopped. For an exception the message is
        the title, the last converged state is drawn, and the critical elements are
        marked.
    field
        Name in `FIELDS`, or a custom `Field`. By default, if a run stopped at the end
        of a law, the shear angle or fibre strain in this law (of the first such run);
        otherwise the smallest area ratio in each element, which is zero where an
        element folds.

    Other parameters, returned value and exceptions as for `field`.
    """
    results = [run.result if isinstance(run, StepError) else run for run in runs]
    picture, row = Picture(results, **options), []
    if not all(hasattr(at, "verdict") for at in picture.states):
        raise ValueError("a displacement on a basis has no checks: pass a Result")
    ended = [run.quantity for run in runs if isinstance(run, StepError)]
    shown_field = field_of(field or next(filter(None, ended), "area_ratio"))
    fields, scale = picture.on_one_scale(shown_field, cmap, clim)
    for run, result, shape, at, values in zip(
        runs, results, picture.shapes, picture.states, fields, strict=True
    ):
        panel = Panel(_check_title(result, at), shape, values, scale)
        if isinstance(run, StepError):
            panel = panel._replace(title=str(run), marked=run.elements)
        row.append(panel)
    some = any(panel.marked.size for panel in row)
    keys = [("Elements where the step was rejected", REFUSED)] if some else []
    return picture.drawn([row], Legend(0, len(row), scale, keys))


def _check_title(result: Result, state: State) -> str:
    """Acceptance checks of a state as a title."""
    checks = state.verdict
    n = checks.negative_pivots
    stability = "stable" if checks.stable else "not stable"
    if n:
        stability += f", {n} negative pivot{'s' if n > 1 else ''}"
    return (
        f"Load factor {state.load_factor:.4g}{_moved(result, state)}: {stability}, "
        f"smallest area ratio {checks.min_det_F:.3g}, largest fibre strain "
        f"{100 * checks.max_fibre_strain:.2g} %"
    )


def _strain_rows(
    picture: Picture, cmap: Any = None, clim: Sequence[float] | None = None
) -> tuple[list[list[Panel]], Scale]:
    """Panels of warp and weft with a common scale."""
    pairs = list(zip(picture.results, picture.states, strict=True))
    fields = {"Warp": FIELDS["warp_strain"], "Weft": FIELDS["weft_strain"]}
    strains = [
        [values_of(f, result.ply, at.u) for result, at in pairs]
        for f in fields.values()
    ]
    of_both = replace(fields["Warp"], label="Fibre strain (%)")
    scale = scale_of(of_both, [values for row in strains for values in row], cmap, clim)
    rows = [
        [
            Panel(title, shape, values, scale)
            for title, shape, values in zip(
                picture.titles(family), picture.shapes, row, strict=True
            )
        ]
        for family, row in zip(fields, strains, strict=True)
    ]
    return rows, scale


def mesh_and_fibres(
    mesh: Mesh,
    directions: FibreDirections,
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    show_edges: bool = True,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Mesh with fibres of warp (blue) and weft (red), before a run.

    Parameters
    ----------
    mesh
        The mesh; for a split or cut mesh the user's elements are drawn.
    directions
        Directions in the elements.

    Other parameters, returned value and exceptions as for `field`; `ValueError` if
    there is not one direction per element.
    """
    cells, _ = original_elements(mesh)
    directions.refuse_other(cells)
    n = directions.warp.shape[1]
    shape = Shape(np.pad(mesh.p, ((0, 1), (0, 0))).T, cells)
    fibres = Fibres.of(mesh.p, cells, directions.warp, directions.weft)
    panel = Panel(f"Mesh and fibres, {n} elements", shape, fibres=fibres)
    sheet = Sheet([[panel]], [Legend(0, 1, keys=FAMILIES)], extent([shape]), show_edges)
    return draw(sheet, filename, plotter, size)


def draped(
    *results: Result, titles: Sequence[str] = (), **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Shear angle and contact pressure of plies on tools, one row per ply.

    Elements with a risk of wrinkling are marked on the shear angle. A negative pressure
    is tensile: there the ply bridges the tool. The default width is 174 mm.

    Parameters, returned value and exceptions as for `field`; `ValueError` for a ply
    without a tool.
    """
    if not (options.get("size") or options.get("plotter")):
        options["size"] = PAGE
    picture = Picture(results, titles, **options)
    pairs = zip(picture.results, picture.states, strict=True)
    pairs_of_fields = [_on_tool(result, at) for result, at in pairs]
    angles, shear = picture.on_one_scale(FIELDS["shear_angle"])
    pressures = reach([pressure for pressure, _ in pairs_of_fields])
    scale = Scale.of("Contact pressure (N/mm²)", pressures, DIVERGING, signed=True)
    rows = []
    for title, shape, angle, (pressure, at_risk) in zip(
        picture.titles(), picture.shapes, angles, pairs_of_fields, strict=True
    ):
        sheared = Panel(title, shape, angle, shear, marked=at_risk)
        rows.append([sheared, Panel(title, shape, pressure, scale)])
    some = any(at_risk.size for _, at_risk in pairs_of_fields)
    keys = [("Risk of wrinkling", REFUSED)] if some else []
    return picture.drawn(rows, Legend(0, 1, shear, keys), Legend(1, 2, scale))


def _on_tool(result: Result, state: State) -> tuple[ndarray, ndarray]:
    """Contact pressure of elements, and elements with a risk of wrinkling."""
    ply, surface = result.ply, result.tool(state.load_factor)
    if surface is None:
        raise ValueError("a ply does not lie on a tool: add a condition OnSurface")
    if state.load_factor != 1:
        raise ValueError(
            f"a ply does not lie on its tool at the load factor {state.load_factor:g}: "
            "draw a state at the load factor 1"
        )
    points, cells = fields_on_tool(ply, surface, state)
    pressure = points["contact_pressure"][ply.mesh.t].mean(axis=0)
    return pressure, np.flatnonzero(cells["wrinkle_risk"])


def stage_of(result: Result, state: State) -> str:
    """Load factor of a state, and travel and rotation of the tools that move."""
    return f"Load factor {state.load_factor:.2f}{_moved(result, state)}"


def _moved(result: Result, state: State) -> str:
    return "".join(f", {tool}" for tool in result.tool_motions(state.load_factor))
