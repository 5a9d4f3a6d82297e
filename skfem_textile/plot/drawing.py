"""Grids of deformed plies in colours, drawn off screen with pyvista."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv
from matplotlib.ticker import MaxNLocator
from numpy import ndarray

from ..solve.result import Result, State
from .offscreen import require_offscreen
from .picture_files import picture_path

_PANEL = 520  # pixels, height of a panel of a single picture
_BAR = 120  # pixels, height of a scale
_LEAST_WIDTH = 640  # pixels; room for the numbers on a scale


class Picture(NamedTuple):
    """What to draw: rows of one field per result by their name, and their scale."""

    rows: dict[str, list[ndarray]]
    label: str
    limits: tuple[float, float]
    colours: str

    @property
    def ticks(self) -> ndarray:
        """Round numbers on the scale, from its one end to the other."""
        locator = MaxNLocator(6, steps=[1, 2, 2.5, 4, 5, 10])
        return np.asarray(locator.tick_values(*self.limits))


class View(NamedTuple):
    """Width and height of a panel in pixels, camera, and half the height it shows."""

    width: int
    height: int
    camera: list
    reach: float

    @classmethod
    def of(cls, plies: Sequence[pv.UnstructuredGrid], height: int = _PANEL) -> "View":
        """One view for all plies, which fill it but for a margin and a title."""
        points = np.vstack([ply.points for ply in plies])
        low, high = points.min(axis=0), points.max(axis=0)
        span, centre = high - low, 0.5 * (low + high)
        width = int(np.clip(height * span[0] / span[1], 0.7 * height, 2 * height))
        reach = 0.58 * max(span[1], span[0] * height / width)
        centre[1] += 0.06 * reach  # room for the title
        eye = centre + np.array([0, 0, reach])
        return cls(width, height, [eye, centre, (0, 1, 0)], reach)

    def apply(self, plotter: pv.Plotter) -> None:
        """Point the camera of the active panel."""
        plotter.camera_position = self.camera
        plotter.enable_parallel_projection()
        plotter.camera.parallel_scale = self.reach


def draw(
    results: Sequence[Result],
    titles: Sequence[str],
    filename: str | os.PathLike[str] | None,
    picture: Picture,
) -> pv.Plotter:
    """Rows of panels, one column per result, and below them their common scale.

    Raises
    ------
    RuntimeError, ValueError, FileNotFoundError
        As `checked`.
    """
    path, titles = checked(results, titles, filename)
    plies = [deformed(result, result.states[-1]) for result in results]
    view = View.of(plies)
    plotter = grid(view, len(picture.rows), len(results), slice(None))
    for i, (name, fields) in enumerate(picture.rows.items()):
        for j, values in enumerate(fields):
            plotter.subplot(i, j)
            actor = panel(
                plotter, plies[j], values, picture, f"{name}, {titles[j]}", view
            )
    plotter.subplot(len(picture.rows), 0)
    scale_bar(plotter, picture, actor)
    if path is not None:
        write_png(plotter, path)
    return plotter


def grid(view: View, n: int, m: int, *scales: slice) -> pv.Plotter:
    """N × m empty panels, and a row for scales below them, over the given columns."""
    heights = [view.height] * n + [_BAR]
    plotter = pv.Plotter(
        off_screen=True,
        shape=(n + 1, m),
        row_weights=heights,
        groups=[(n, scale) for scale in scales],
        border=False,
        window_size=[max(view.width * m, _LEAST_WIDTH), sum(heights)],
    )
    plotter.set_background("white")
    return plotter


def deformed(result: Result, state: State) -> pv.UnstructuredGrid:
    """The ply in its current shape, with straight edges between the vertices."""
    mesh, u = result.ply.mesh, result.ply.nodal(state.u)
    points = np.pad(mesh.p + u[:, : mesh.nvertices], ((0, 1), (0, 0))).T
    cell = {3: pv.CellType.TRIANGLE, 4: pv.CellType.QUAD}[len(mesh.t)]
    return pv.UnstructuredGrid({cell: mesh.t.T}, points)


def panel(
    plotter: pv.Plotter,
    ply: pv.UnstructuredGrid,
    values: ndarray,
    picture: Picture,
    title: str,
    view: View,
) -> pv.Actor:
    """Draw one ply in colours, the edges of its elements and a title."""
    actor = plotter.add_mesh(
        ply.copy(),
        scalars=values,
        clim=(picture.ticks[0], picture.ticks[-1]),
        cmap=picture.colours,
        lighting=False,
        show_scalar_bar=False,
        name="ply",
    )
    edges = ply.extract_all_edges()
    plotter.add_mesh(edges, color="#404040", line_width=1.5, name="edges")
    decorate(plotter, title, view)
    return actor


def decorate(plotter: pv.Plotter, title: str, view: View) -> None:
    """Give the active panel its title and its camera."""
    size = max(9, 11 * view.height // _PANEL)
    plotter.add_text(
        title, position="upper_edge", font_size=size, color="black", name="title"
    )
    view.apply(plotter)


def scale_bar(plotter: pv.Plotter, picture: Picture, actor: pv.Actor) -> None:
    """Draw the scale of a picture in the active panel."""
    bar = plotter.add_scalar_bar(
        picture.label + "\n",
        mapper=actor.mapper,
        n_labels=len(picture.ticks),
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


def checked(
    results: Sequence[Result],
    titles: Sequence[str],
    filename: str | os.PathLike[str] | None,
) -> tuple[Path | None, Sequence[str]]:
    """The path and the titles, refused if something is wrong with them or with GL.

    Raises
    ------
    ValueError
        If there is no result, not one title per result, or the file is to be no PNG.
    FileNotFoundError
        If the folder of the file is not there.
    RuntimeError
        If nothing can be drawn off screen here; the message says what to install.
    """
    if not results:
        raise ValueError("nothing to draw: give at least one result")
    titles = titles or [r.ply.formulation.title for r in results]
    if len(titles) != len(results):
        raise ValueError(f"{len(results)} results need as many titles: {len(titles)}")
    path = None if filename is None else picture_path(filename)
    require_offscreen()
    return path, titles


def write_png(plotter: pv.Plotter, path: Path) -> None:
    """Write a PNG beside its place, then put it there."""
    unfinished = path.with_name(f".unfinished-{path.stem}.png")
    plotter.screenshot(unfinished)
    unfinished.replace(path)
