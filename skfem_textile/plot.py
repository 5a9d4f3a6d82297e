"""Pictures of fibre strain and shear angle on the deformed ply, off screen."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv
from matplotlib.ticker import MaxNLocator
from numpy import ndarray

from .fields import cell_fields
from .offscreen import require_offscreen
from .result import Result

_HEIGHT, _BAR = 520, 120  # pixels of a panel and of the scale below
_LEAST_WIDTH = 640  # pixels; room for the numbers on the scale
_ROUND_OFF = 1e-8  # per cent or degrees; less than this is shown as nothing


def fibre_strain(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
) -> pv.Plotter:
    """Fibre strain of warp (above) and weft (below), one column per result.

    All panels share one diverging scale, symmetric about zero.

    Parameters
    ----------
    *results
        Results whose last state is drawn.
    titles
        One short title per result; their formulations if not given.
    filename
        Where to write a PNG.

    Returns
    -------
    pyvista.Plotter
        Off screen, ready for more.

    Raises
    ------
    RuntimeError
        If nothing can be drawn off screen here; the message says what to install.
    ValueError
        If there is no result, or not one title per result.
    FileNotFoundError
        If the folder of the file is not there.
    """
    fields = [cell_fields(r.ply, r.u) for r in results]
    rows = {
        f"{family} strain": [100 * f[f"fibre_strain_{i}"] for f in fields]
        for i, family in enumerate(("Warp", "Weft"), start=1)
    }
    largest = max((np.abs(x).max() for row in rows.values() for x in row), default=0.0)
    scale = max(largest, _ROUND_OFF)
    scene = _Picture(rows, "Fibre strain (%)", (-scale, scale), "RdBu_r")
    return _draw(results, titles, filename, scene)


def shear_angle(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
) -> pv.Plotter:
    """Shear angle in degrees, one panel per result, on a shared scale.

    Parameters, returned value and errors as for `fibre_strain`.
    """
    row = [cell_fields(r.ply, r.u)["shear_angle"] for r in results]
    low = min((x.min() for x in row), default=0.0)
    high = max((x.max() for x in row), default=0.0)
    limits = min(low, 0.0), max(high, _ROUND_OFF)
    scene = _Picture({"Shear angle": row}, "Shear angle (degrees)", limits, "viridis")
    return _draw(results, titles, filename, scene)


class _Picture(NamedTuple):
    """What to draw: rows of one field per result, by their name, and their scale."""

    rows: dict[str, list[ndarray]]
    label: str
    limits: tuple[float, float]
    colours: str


def _draw(
    results: Sequence[Result],
    titles: Sequence[str],
    filename: str | os.PathLike[str] | None,
    picture: _Picture,
) -> pv.Plotter:
    """A grid of panels, and below it one bar for their common scale."""
    if not results:
        raise ValueError("nothing to draw: give at least one result")
    titles = titles or [r.ply.formulation.title for r in results]
    if len(titles) != len(results):
        raise ValueError(f"{len(results)} results need as many titles: {len(titles)}")
    path = None if filename is None else Path(filename)
    if path is not None and not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: there is no folder {path.parent}")
    require_offscreen()

    n, m = len(picture.rows), len(results)
    plies = [_deformed(result) for result in results]
    view = _view(plies)
    plotter = pv.Plotter(
        off_screen=True,
        shape=(n + 1, m),
        row_weights=[_HEIGHT] * n + [_BAR],
        groups=[(n, slice(None))],
        border=False,
        window_size=[max(view.width * m, _LEAST_WIDTH), _HEIGHT * n + _BAR],
    )
    plotter.set_background("white")
    ticks = MaxNLocator(6, steps=[1, 2, 2.5, 4, 5, 10]).tick_values(*picture.limits)
    for i, (name, row) in enumerate(picture.rows.items()):
        for j, (ply, values) in enumerate(zip(plies, row, strict=True)):
            plotter.subplot(i, j)
            plotter.add_text(
                f"{name}, {titles[j]}",
                position="upper_edge",
                font_size=11,
                color="black",
            )
            limits = ticks[0], ticks[-1]
            actor = _panel(plotter, ply, values, limits, picture.colours, view)
    plotter.subplot(n, 0)
    _scale_bar(plotter, picture.label, len(ticks), actor.mapper)
    if path is not None:
        _write(plotter, path)
    return plotter


class _View(NamedTuple):
    """Width of a panel in pixels, camera, and half the height that it shows."""

    width: int
    camera: list
    reach: float


def _view(plies: Sequence[pv.UnstructuredGrid]) -> _View:
    """One view for all plies, which fill the panel but for a margin and a title."""
    points = np.vstack([ply.points for ply in plies])
    low, high = points.min(axis=0), points.max(axis=0)
    span, centre = high - low, 0.5 * (low + high)
    width = int(np.clip(_HEIGHT * span[0] / span[1], 0.7 * _HEIGHT, 2 * _HEIGHT))
    reach = 0.58 * max(span[1], span[0] * _HEIGHT / width)
    centre[1] += 0.06 * reach  # room for the title
    eye = centre + np.array([0, 0, reach])
    return _View(width, [eye, centre, (0, 1, 0)], reach)


def _deformed(result: Result) -> pv.UnstructuredGrid:
    mesh, u = result.ply.mesh, result.ply.nodal(result.u)
    points = np.pad(mesh.p + u, ((0, 1), (0, 0))).T
    return pv.UnstructuredGrid({pv.CellType.QUAD: mesh.t.T}, points)


def _panel(
    plotter: pv.Plotter,
    ply: pv.UnstructuredGrid,
    values: ndarray,
    limits: tuple[float, float],
    colours: str,
    view: _View,
) -> pv.Actor:
    """One ply in colours, and the edges of its elements."""
    actor = plotter.add_mesh(
        ply.copy(),
        scalars=values,
        clim=limits,
        cmap=colours,
        lighting=False,
        show_scalar_bar=False,
    )
    plotter.add_mesh(ply.extract_all_edges(), color="#404040", line_width=1.5)
    plotter.camera_position = view.camera
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = view.reach
    return actor


def _scale_bar(
    plotter: pv.Plotter, label: str, n_labels: int, mapper: pv.DataSetMapper
) -> None:
    bar = plotter.add_scalar_bar(
        label + "\n",
        mapper=mapper,
        n_labels=n_labels,
        fmt="%.3g",
        color="black",
        title_font_size=20,
        label_font_size=20,
        unconstrained_font_size=True,
        width=0.7,
        height=0.6,
        position_x=0.15,
        position_y=0.1,
    )
    bar.SetVerticalTitleSeparation(8)


def _write(plotter: pv.Plotter, path: Path) -> None:
    """Write a PNG beside its place, then put it there."""
    unfinished = path.with_name(f".unfinished-{path.stem}.png")
    plotter.screenshot(unfinished)
    os.replace(unfinished, path)
