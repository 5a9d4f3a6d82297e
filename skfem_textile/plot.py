"""Pictures of fibre strain and shear angle on the deformed ply, off screen."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy import ndarray

from .fields import cell_fields
from .offscreen import require_offscreen
from .result import Result

_HEIGHT, _BAR = 520, 110  # pixels of a panel and of the scale below
_FAMILIES = ("Warp", "Weft")


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
        One title per result; their formulations if not given.
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
    """
    fields = [cell_fields(r.ply, r.u) for r in results]
    rows = [[100 * f[f"fibre_strain_{i}"] for f in fields] for i in (1, 2)]
    names = [f"{family} strain" for family in _FAMILIES]
    scale = max((np.abs(x).max() for row in rows for x in row), default=0.0) or 1.0
    return _draw(
        results,
        titles,
        filename,
        rows=rows,
        names=names,
        label="Fibre strain (%)",
        limits=(-scale, scale),
        colours="RdBu_r",
    )


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
    return _draw(
        results,
        titles,
        filename,
        rows=[row],
        names=["Shear angle"],
        label="Shear angle (degrees)",
        limits=(min(low, 0.0), max(high, 0.0) or 1.0),
        colours="viridis",
    )


def _draw(
    results: Sequence[Result],
    titles: Sequence[str],
    filename: str | os.PathLike[str] | None,
    *,
    rows: list[list[ndarray]],
    names: list[str],
    label: str,
    limits: tuple[float, float],
    colours: str,
) -> pv.Plotter:
    """A grid of panels, and below it one bar for their common scale."""
    if not results:
        raise ValueError("nothing to draw: give at least one result")
    titles = titles or [r.ply.formulation.name for r in results]
    if len(titles) != len(results):
        raise ValueError(f"{len(results)} results need as many titles: {len(titles)}")
    require_offscreen()
    n, m = len(rows), len(results)
    plies = [_deformed(result) for result in results]
    width, height, camera, reach = _view(plies)
    plotter = pv.Plotter(
        off_screen=True,
        shape=(n + 1, m),
        row_weights=[height] * n + [_BAR],
        groups=[(n, slice(None))],
        border=False,
        window_size=[width * m, height * n + _BAR],
    )
    plotter.set_background("white")
    for i, row in enumerate(rows):
        for j, (ply, values) in enumerate(zip(plies, row, strict=True)):
            plotter.subplot(i, j)
            actor = plotter.add_mesh(
                ply.copy(),
                scalars=values,
                clim=limits,
                cmap=colours,
                lighting=False,
                show_edges=True,
                edge_color="#606060",
                show_scalar_bar=False,
            )
            title = f"{names[i]}, {titles[j]}"
            plotter.add_text(title, position="upper_edge", font_size=10, color="black")
            plotter.camera_position = camera
            plotter.enable_parallel_projection()
            plotter.camera.parallel_scale = reach
    plotter.subplot(n, 0)
    _scale_bar(plotter, label, actor.mapper)
    if filename is not None:
        _write(plotter, Path(filename))
    return plotter


def _deformed(result: Result) -> pv.UnstructuredGrid:
    mesh, u = result.ply.mesh, result.ply.nodal(result.u)
    points = np.pad(mesh.p + u, ((0, 1), (0, 0))).T
    return pv.UnstructuredGrid({pv.CellType.QUAD: mesh.t.T}, points)


def _view(plies: Sequence[pv.UnstructuredGrid]) -> tuple[int, int, list, float]:
    """Panel size in pixels, camera, and half the height that it shows.

    The same for all plies, filling the panel but for a margin and a title.
    """
    points = np.vstack([ply.points for ply in plies])
    low, high = points.min(axis=0), points.max(axis=0)
    span, centre = high - low, 0.5 * (low + high)
    width = int(np.clip(_HEIGHT * span[0] / span[1], 0.7 * _HEIGHT, 2 * _HEIGHT))
    reach = 0.58 * max(span[1], span[0] * _HEIGHT / width)
    centre[1] += 0.06 * reach  # room for the title
    eye = centre + np.array([0, 0, reach])
    return width, _HEIGHT, [eye, centre, (0, 1, 0)], reach


def _scale_bar(plotter: pv.Plotter, label: str, mapper: pv.DataSetMapper) -> None:
    bar = plotter.add_scalar_bar(
        label + "\n",
        mapper=mapper,
        n_labels=5,
        fmt="%.3g",
        color="black",
        title_font_size=16,
        label_font_size=15,
        unconstrained_font_size=True,
        width=0.7,
        height=0.6,
        position_x=0.15,
        position_y=0.1,
    )
    bar.SetVerticalTitleSeparation(8)


def _write(plotter: pv.Plotter, path: Path) -> None:
    """Write a PNG beside its place, then put it there."""
    unfinished = path.with_name(f".unfinished-{path.name}")
    plotter.screenshot(unfinished)
    os.replace(unfinished, path)
