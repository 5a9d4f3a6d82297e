"""Sheets become pictures: who draws them, and what is written."""

import os
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..layout import PRINTED, Layout, default_width, lay_out
from ..picture_files import is_vector, picture_path, save, save_pixels
from ..sheet import Sheet
from .offscreen import require_offscreen

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.figure import Figure


def draw(
    sheet: Sheet,
    filename: str | os.PathLike[str] | None,
    plotter: "pv.Plotter | None",
    size: float | tuple[float, float] | None,
) -> "pv.Plotter | Figure":
    """Draw a sheet into a plotter or a new picture, and write it.

    Raises
    ------
    ImportError, RuntimeError, ValueError, FileNotFoundError
        As `field`.
    """
    path = None if filename is None else picture_path(filename)
    if plotter is not None:
        return _draw_into(plotter, sheet, path, size)
    layout = lay_out(sheet, size)
    if is_vector(path):
        from .with_matplotlib import figure_of

        figure = figure_of(sheet, layout)
        save(figure, path)
        return figure
    drawn = new_plotter(layout, PRINTED)
    pyvista_renderer().draw_new(drawn, sheet, layout)
    if path:
        save_pixels(pixels(drawn), path)
    return drawn


def new_plotter(layout: Layout, dots_per_inch: float) -> "pv.Plotter":
    """An empty plotter off screen.

    Raises
    ------
    ImportError
        If pyvista is not installed.
    RuntimeError
        If nothing can be drawn off screen here.
    """
    renderer = pyvista_renderer()
    require_offscreen()
    return renderer.new_plotter(layout, dots_per_inch)


def pyvista_renderer() -> Any:
    """The module that draws with pyvista, which takes a second to load."""
    try:
        return import_module(".with_pyvista", __package__)
    except ModuleNotFoundError as error:
        message = f"{error}: pip install 'skfem-textile[plot]'"
        raise ModuleNotFoundError(message, name=error.name) from None


def pixels(plotter: "pv.Plotter") -> Any:
    """What a plotter shows, shape (height, width, 3)."""
    return plotter.screenshot(return_img=True)


def _draw_into(
    plotter: "pv.Plotter",
    sheet: Sheet,
    path: Path | None,
    size: float | tuple[float, float] | None,
) -> "pv.Plotter":
    if is_vector(path):
        raise ValueError(f"{path}: a plotter draws pixels: name it .png, or give none")
    if isinstance(size, tuple):
        raise ValueError("beside plotter, size is the width of its window in mm")
    columns = (plotter.shape if len(plotter.shape) == 2 else (1, 1))[1]
    width = default_width(columns) if size is None else size
    pyvista_renderer().draw_into(plotter, sheet, width)
    if path:
        save_pixels(pixels(plotter), path)
    return plotter
