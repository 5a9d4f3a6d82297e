"""Pictures of plies: fields, fibres and acceptance checks; and animations.

An animation shows a field on the moving ply, as a GIF or as a video by ffmpeg.
"""

import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from numpy import ndarray
from scipy.spatial import KDTree
from skfem import Mesh

from ..fabric.directions import FibreDirections
from ..io.results import fields_on_tool, has_tools
from ..mesh.splitting import original_elements
from ..solve.result import Result, StepError
from ..solve.states import State
from .drawing import atomic_file, draw, flat_frames, picture_path, pyvista_drawing
from .fields import (
    DIVERGING,
    FIELDS,
    Drawn,
    Field,
    fibres_of,
    field_of,
    reach,
    refuse_other_than_result,
    results_of,
    scale_of,
    shapes_of,
    values_of,
)
from .layout import PAGE, PRINTED, lay_out
from .sheet import (
    FAMILIES,
    REFUSED,
    THREADS,
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
    """Results, each in one state, with drawing options, and a default ``width``."""

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
        width: float | None = None,
    ) -> None:
        if size is None and plotter is None:
            size = width
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

    def values(self, field: Field) -> list[ndarray]:
        """Values of a field for each result."""
        pairs = zip(self.results, self.states, strict=True)
        return [values_of(field, result.ply, at.u) for result, at in pairs]

    def on_one_scale(
        self, field: Field, cmap: Any = None, clim: Sequence[float] | None = None
    ) -> tuple[list[ndarray], Scale]:
        """Values of a field for each result, and their common scale."""
        values = self.values(field)
        return values, scale_of(field, values, cmap, clim)

    def panels(
        self,
        values: Sequence[ndarray] = (),
        scale: Scale | None = None,
        *,
        fibres: bool = False,
        marked: Sequence[ndarray] = (),
        titles: Sequence[str] = (),
    ) -> list[Panel]:
        """One panel for each result, with its title if ``titles`` is empty."""
        n = len(self.results)
        none: list[None] = [None] * n
        columns = zip(
            titles or self.titles(),
            self.shapes,
            values or none,
            [fibres_of(x.ply) for x in self.results] if fibres else none,
            marked or [np.empty(0, dtype=int)] * n,
            strict=True,
        )
        return [
            Panel(title, shape, each, scale, lines, elements)
            for title, shape, each, lines, elements in columns
        ]


#: Key of elements with a risk of wrinkling.
RISK = "Risk of wrinkling"


def key_of_marks(name: str, panels: Sequence[Panel]) -> list[tuple[str, str]]:
    """Key of marked elements, if there are any."""
    return [(name, REFUSED)] if any(panel.marked.size for panel in panels) else []


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
        The off-screen plotter for further drawing; for a file of vector graphics, or of
        plies in the plane, the figure.

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
    row = picture.panels(fields, scale, fibres=fibres)
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
    (warp, weft), scale = _strains(picture, cmap, clim)
    low, high = extent(picture.shapes)
    tall = high[1] - low[1] > high[0] - low[0]
    rows = [[*warp, *weft]] if len(warp) == 1 and tall else [warp, weft]
    return picture.drawn(rows, Legend(0, len(rows[0]), scale))


def contact_sheet(
    *results: Drawn, titles: Sequence[str] = (), **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Warp strain, weft strain and shear angle in columns, one row per result.

    Parameters, returned value and exceptions as for `field`.
    """
    picture = Picture(results, titles, **options)
    strains, strain = _strains(picture)
    angles, shear = picture.on_one_scale(FIELDS["shear_angle"])
    rows = [*zip(*strains, picture.panels(angles, shear), strict=True)]
    return picture.drawn(rows, Legend(0, 2, strain), Legend(2, 3, shear))


def fibre_directions(
    *results: Drawn, titles: Sequence[str] = (), **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Fibres of warp (blue) and weft (red), at equal distances in the flat ply.

    Parameters, returned value and exceptions as for `field`.
    """
    picture = Picture(results, titles, **options)
    titled = picture.titles(alone="Fibre directions")
    row = picture.panels(fibres=True, titles=titled)
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
    picture = Picture(results, **options)
    if not all(hasattr(at, "verdict") for at in picture.states):
        raise ValueError("a displacement on a basis has no checks: pass a Result")
    ended = [run.quantity for run in runs if isinstance(run, StepError)]
    shown_field = field_of(field or next(filter(FIELDS.get, ended), "area_ratio"))
    fields, scale = picture.on_one_scale(shown_field, cmap, clim)
    titles = map(_check_title, results, picture.states)
    row = [
        panel._replace(title=str(run), marked=run.elements)
        if isinstance(run, StepError)
        else panel
        for run, panel in zip(
            runs, picture.panels(fields, scale, titles=[*titles]), strict=True
        )
    ]
    keys = key_of_marks("Elements where the step was rejected", row)
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


def _strains(
    picture: Picture, cmap: Any = None, clim: Sequence[float] | None = None
) -> tuple[list[list[Panel]], Scale]:
    """Panels of warp and weft with a common scale."""
    fields = {"Warp": FIELDS["warp_strain"], "Weft": FIELDS["weft_strain"]}
    strains = [picture.values(one) for one in fields.values()]
    of_both = replace(fields["Warp"], label="Fibre strain (%)")
    scale = scale_of(of_both, [values for row in strains for values in row], cmap, clim)
    rows = [
        picture.panels(row, scale, titles=picture.titles(family))
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
    picture = Picture(results, titles, width=PAGE, **options)
    on_tools = map(_on_tool, picture.results, picture.states)
    pressures, at_risk = zip(*on_tools, strict=True)
    angles, shear = picture.on_one_scale(FIELDS["shear_angle"])
    limits = reach(pressures)
    scale = Scale.of("Contact pressure (N/mm²)", limits, DIVERGING, signed=True)
    sheared = picture.panels(angles, shear, marked=at_risk)
    rows = [*zip(sheared, picture.panels(pressures, scale), strict=True)]
    keys = key_of_marks(RISK, sheared)
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


# Dots per inch of a GIF, as on a screen; videos, which are enlarged, have more.
_DOTS = 150

# Longest duration of a frame, of the motion, and of the last frame in addition, in ms.
# Chosen by eye.
_FRAME, _MOTION, _REST = 120, 4000, 1000

# Formats of videos: arguments of ffmpeg for the codec and its quality.  Constant
# quality, chosen by eye: lines of fibres are sharp.
_CODECS = {
    ".webm": ("-c:v", "libvpx-vp9", "-crf", "34", "-b:v", "0", "-cpu-used", "2"),
    ".mp4": ("-c:v", "libx264", "-crf", "23", "-movflags", "+faststart"),
}


def animation(
    result: Result,
    filename: str | os.PathLike[str],
    field: str | Field = "shear_angle",
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    fibres: bool = False,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> None:
    """Write a field on the moving ply, one frame per state on one scale.

    Tools between which a ply is formed are drawn, those in front of it translucent.

    Parameters
    ----------
    result
        Result whose states are drawn.
    filename
        Output file: GIF with 6 pixels per mm, or a video (.webm or .mp4) with 12, which
        requires the program ffmpeg.

    Other parameters and exceptions as for `field`; `FileNotFoundError` also if ffmpeg
    is not installed, and `RuntimeError` if it fails.
    """
    refuse_other_than_result("animation", result)
    path = picture_path(filename, (".gif", *_CODECS))
    suffix = path.suffix.lower() or ".gif"
    if suffix in _CODECS and shutil.which("ffmpeg") is None:
        raise FileNotFoundError(
            f"{path}: videos are written by ffmpeg, which is not installed: install "
            "it, or write a .gif file"
        )
    sheets = _sheets(result, field_of(field), cmap, clim, fibres, show_edges)
    frames = _drawn(sheets, size, PRINTED if suffix in _CODECS else _DOTS)
    duration = min(_FRAME, _MOTION // len(frames))
    with atomic_file(path, suffix) as file:
        if suffix in _CODECS:
            _write_video(file, frames, duration)
        else:
            _write_gif(file, frames, duration)


def _sheets(
    result: Result,
    field: Field,
    cmap: Any,
    clim: Sequence[float] | None,
    fibres: bool,
    show_edges: bool | None,
) -> list[Sheet]:
    """Content of the frames."""
    states = result.states
    shapes = shapes_of([result] * len(states), states, veiled=True)
    values = [values_of(field, result.ply, state.u) for state in states]
    scale = scale_of(field, values, cmap, clim)
    of_ply = fibres_of(result.ply) if fibres else None
    legend = Legend(0, 1, scale, THREADS if fibres else ())
    reach = extent(shapes)
    return [
        Sheet(
            [[Panel(stage_of(result, state), shape, each, scale, of_ply)]],
            *([legend], reach, show_edges),
        )
        for state, shape, each in zip(states, shapes, values, strict=True)
    ]


def _drawn(
    sheets: Sequence[Sheet], size: float | tuple[float, float] | None, dots: float
) -> list[ndarray]:
    """Pixels of each sheet, of shape (height, width, 3), drawn in one window."""
    layouts = [lay_out(sheet, size) for sheet in sheets]
    if sheets[0].is_flat:
        return flat_frames(sheets, layouts, dots)
    renderer, frames = pyvista_drawing(), []
    plotter = renderer.new_plotter(layouts[0], dots)
    for sheet, layout in zip(sheets, layouts, strict=True):
        plotter.clear()
        renderer.draw_new(plotter, sheet, layout)
        frames.append(plotter.screenshot(return_img=True))
    plotter.close()
    return frames


def _write_gif(file: Path, frames: Sequence[ndarray], duration: int) -> None:
    """Write frames with a common palette, made from an equal part of each frame."""
    from PIL import Image

    n = len(frames)
    some = np.concatenate([x.reshape(-1, 3)[i::n] for i, x in enumerate(frames)])
    palette = Image.fromarray(some[None]).quantize().getpalette()
    assert palette is not None
    first, *others = map(Image.fromarray, _in_palette(frames, palette))
    for picture in first, *others:
        picture.putpalette(palette)
    durations = [duration] * len(others) + [duration + _REST]
    first.save(file, save_all=True, append_images=others, duration=durations, loop=0)


def _in_palette(frames: Sequence[ndarray], palette: Sequence[int]) -> list[ndarray]:
    """For each pixel of frames the number of the nearest colour of a palette."""
    packed = [
        red.astype(np.int32) << 16 | green.astype(np.int32) << 8 | blue
        for red, green, blue in (np.moveaxis(frame, -1, 0) for frame in frames)
    ]
    used = np.zeros(1 << 24, bool)
    for each in packed:
        used[each] = True
    of_used = np.flatnonzero(used)
    colours = np.column_stack([of_used >> 16, of_used >> 8 & 255, of_used & 255])
    number = np.zeros(used.size, np.uint8)
    number[of_used] = KDTree(np.reshape(palette, (-1, 3))).query(colours)[1]
    return [number[each] for each in packed]


def _write_video(file: Path, frames: Sequence[ndarray], duration: int) -> None:
    """Pass the frames to ffmpeg, cut to an even number of pixels, as codecs require."""
    height, width = (n - n % 2 for n in frames[0].shape[:2])
    raw = "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"
    rate = "-r", f"1000/{duration}"
    exact = "-fflags", "+bitexact", "-flags:v", "+bitexact"
    codec = *_CODECS[file.suffix], "-pix_fmt", "yuv420p", *exact
    rest = [frames[-1]] * (_REST // duration)
    pixels = b"".join(
        np.ascontiguousarray(frame[:height, :width]).tobytes()
        for frame in [*frames, *rest]
    )
    done = subprocess.run(
        ["ffmpeg", "-loglevel", "error", "-y", *raw, *rate, "-i", "-", *codec, file],
        input=pixels,
        capture_output=True,
        check=False,
    )
    if done.returncode:
        reason = done.stderr.decode(errors="replace").strip().splitlines() or ["?"]
        raise RuntimeError(f"{file.name}: ffmpeg failed: {reason[-1]}")
