"""Grids of deformed plies in colours, drawn off screen with pyvista."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv
from matplotlib.ticker import MaxNLocator
from numpy import ndarray

from ..solve.result import Result
from ..solve.states import State
from .offscreen import require_offscreen
from .picture_files import picture_path

# Sizes and positions below are chosen by eye, so that nothing overlaps.
_PANEL_HEIGHT = 520  # pixels, of a picture with one row
_BAR_HEIGHT = 120  # pixels, of a scale
_LEAST_WIDTH = 640  # pixels; room for the numbers on a scale
_PANEL_WIDTHS = 0.7, 2.0  # least and largest width of a panel over its height
_REACH = 0.58  # half of the height that is shown, over the height of the ply
_TITLE = 0.06  # upward shift of the camera for the title, over the half height
_TITLE_SIZE, _LEAST_TITLE_SIZE = 11, 9  # points, at the panel height above, and least
_BAR_TEXT_SIZE = 20  # points
_BAR_WIDTH, _BAR_EXTENT = (
    0.7,
    0.6,
)  # width and height of a scale over those of its panel
_BAR_LEFT, _BAR_BOTTOM = 0.15, 0.1  # position of a scale in its panel
_BAR_TITLE_GAP = 8  # pixels between a scale and its title
_MOST_INTERVALS = 6  # between the numbers on a scale
_ROUND_STEPS = [1, 2, 2.5, 4, 5, 10]  # of the numbers on a scale, times powers of ten
_EDGE_COLOUR, _EDGE_WIDTH = "#404040", 1.5  # dark grey, pixels
_LEAST_ELEMENT = 10  # pixels of a mean side, below which edges would hide the colours


class Picture(NamedTuple):
    """Fields to draw and their scale: by name, a row with one field per result."""

    rows: dict[str, list[ndarray]]
    label: str
    limits: tuple[float, float]
    colours: str

    @property
    def ticks(self) -> ndarray:
        """Round numbers on the scale, from its one end to the other."""
        locator = MaxNLocator(_MOST_INTERVALS, steps=_ROUND_STEPS)
        return np.asarray(locator.tick_values(*self.limits))


class View(NamedTuple):
    """Width and height of a panel in pixels, its camera, and half the height shown."""

    width: int
    height: int
    camera: list
    reach: float

    @classmethod
    def of(
        cls, plies: Sequence[pv.UnstructuredGrid], height: int = _PANEL_HEIGHT
    ) -> "View":
        """One view for all plies, with a margin and room for a title."""
        points = np.vstack([ply.points for ply in plies])
        low, high = points.min(axis=0), points.max(axis=0)
        span, centre = high - low, 0.5 * (low + high)
        least, most = (share * height for share in _PANEL_WIDTHS)
        width = int(np.clip(height * span[0] / span[1], least, most))
        reach = _REACH * max(span[1], span[0] * height / width)
        centre[1] += _TITLE * reach
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
        As `check_arguments`.
    """
    path, titles = check_arguments(results, titles, filename)
    plies = [deformed(result, result.states[-1]) for result in results]
    view = View.of(plies)
    plotter = empty_panels(view, len(picture.rows), len(results), slice(None))
    for row, (name, fields) in enumerate(picture.rows.items()):
        for column, values in enumerate(fields):
            plotter.subplot(row, column)
            actor = panel(
                plotter,
                plies[column],
                values,
                picture,
                f"{name}, {titles[column]}",
                view,
            )
    plotter.subplot(len(picture.rows), 0)
    scale_bar(plotter, picture, actor)
    if path is not None:
        write_png(plotter, path)
    return plotter


def empty_panels(view: View, n_rows: int, n_columns: int, *scales: slice) -> pv.Plotter:
    """Rows and columns of empty panels, with a row of scales that span some columns."""
    heights = [view.height] * n_rows + [_BAR_HEIGHT]
    plotter = pv.Plotter(
        off_screen=True,
        shape=(n_rows + 1, n_columns),
        row_weights=heights,
        groups=[(n_rows, scale) for scale in scales],
        border=False,
        window_size=[max(view.width * n_columns, _LEAST_WIDTH), sum(heights)],
    )
    plotter.set_background("white")
    return plotter


def deformed(result: Result, state: State) -> pv.UnstructuredGrid:
    """The ply in its current shape, with straight edges between the vertices.

    Raises
    ------
    ValueError
        If it is a ply in space.
    """
    mesh, u = result.ply.mesh, result.ply.nodal(state.u)
    if len(u) == 3:
        raise ValueError(
            "pictures show plies in their plane: write the fields of a ply in space "
            "with write_fields, and look at them in a viewer"
        )
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
    edges = seen_edges(ply, view)
    plotter.add_mesh(edges, color=_EDGE_COLOUR, line_width=_EDGE_WIDTH, name="edges")
    decorate(plotter, title, view)
    return actor


def least_spacing(view: View) -> float:
    """Distance in mm of things that are still told apart."""
    return _LEAST_ELEMENT * 2 * view.reach / view.height


def mean_side(ply: pv.UnstructuredGrid) -> float:
    """Side of a square as large as the mean element, in mm."""
    return float(np.sqrt(ply.compute_cell_sizes()["Area"].mean()))


def seen_edges(ply: pv.UnstructuredGrid, view: View) -> pv.PolyData:
    """The edges of the elements; those of the ply alone where elements are small."""
    if mean_side(ply) >= least_spacing(view):
        return ply.extract_all_edges()
    return ply.extract_feature_edges(
        feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )


def decorate(plotter: pv.Plotter, title: str, view: View) -> None:
    """Give the active panel its title and its camera."""
    size = max(_LEAST_TITLE_SIZE, _TITLE_SIZE * view.height // _PANEL_HEIGHT)
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
        title_font_size=_BAR_TEXT_SIZE,
        label_font_size=_BAR_TEXT_SIZE,
        unconstrained_font_size=True,
        width=_BAR_WIDTH,
        height=_BAR_EXTENT,
        position_x=_BAR_LEFT,
        position_y=_BAR_BOTTOM,
    )
    bar.SetVerticalTitleSeparation(_BAR_TITLE_GAP)


def check_arguments(
    results: Sequence[Result],
    titles: Sequence[str],
    filename: str | os.PathLike[str] | None,
) -> tuple[Path | None, Sequence[str]]:
    """Check the path, the titles, and that VTK can draw.

    Raises
    ------
    ValueError
        If there is no result, not one title per result, or another suffix than .png.
    FileNotFoundError
        If the folder of the file does not exist.
    RuntimeError
        If nothing can be drawn off screen here; the message says what to install.
    """
    if not results:
        raise ValueError("nothing to draw: give at least one result")
    titles = titles or [result.ply.formulation.title for result in results]
    if len(titles) != len(results):
        raise ValueError(f"{len(results)} results need as many titles: {len(titles)}")
    path = None if filename is None else picture_path(filename)
    require_offscreen()
    return path, titles


def write_png(plotter: pv.Plotter, path: Path) -> None:
    """Write a PNG under a temporary name, then rename it."""
    unfinished = path.with_name(f".unfinished-{path.stem}.png")
    plotter.screenshot(unfinished)
    unfinished.replace(path)
