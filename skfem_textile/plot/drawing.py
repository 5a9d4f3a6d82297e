"""Drawing of sheets, as vectors with matplotlib and as pixels with pyvista; files.

Vector graphics of a ply in space include lines that faces hide, but not lines that a
tool hides.
"""

import contextlib
import os
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle
from numpy import ndarray

from ..mesh.requirements import require
from ..mesh.user_input import with_article
from .layout import (
    KEY,
    POINT,
    PRINTED,
    TITLE,
    Bar,
    Layout,
    Slot,
    Writing,
    default_width,
    font_file,
    lay_out,
)
from .sheet import Panel, Sheet, in_front_of_tool, lines_of

if TYPE_CHECKING:
    import pyvista as pv


def draw(
    sheet: Sheet,
    filename: str | os.PathLike[str] | None,
    plotter: "pv.Plotter | None",
    size: float | tuple[float, float] | None,
) -> "pv.Plotter | Figure":
    """Draw a sheet into a plotter or a new picture, and write the file."""
    path = None if filename is None else picture_path(filename)
    if plotter is None:
        layout = lay_out(sheet, size)
        if is_vector(path):
            figure = _figure_of(sheet, layout)
            save(figure, path)
            return figure
        plotter = pyvista_drawing().new_plotter(layout, PRINTED)
        pyvista_drawing().draw_new(plotter, sheet, layout)
    elif is_vector(path):
        raise ValueError(
            f"{path}: a plotter cannot draw vector graphics: use the suffix .png or "
            "omit the file name"
        )
    elif isinstance(size, tuple):
        raise ValueError(
            f"with a plotter, size must be the width of its window in mm, got {size}"
        )
    else:
        columns = (plotter.shape if len(plotter.shape) == 2 else (1, 1))[1]
        width = default_width(columns) if size is None else size
        pyvista_drawing().draw_into(plotter, sheet, width)
    if path:
        from PIL import Image

        with atomic_file(path, ".png") as file:
            pixels = Image.fromarray(plotter.screenshot(return_img=True))
            pixels.save(file, dpi=(PRINTED, PRINTED))
    return plotter


def pyvista_drawing() -> Any:
    """Import the module that draws with pyvista, which takes a second."""
    require("a picture of pixels", "plot", "pyvista")
    return import_module(".pyvista_drawing", __package__)


# Width in points of the edge that closes gaps between polygons in viewers.
_SEAM = 0.4


def _figure_of(sheet: Sheet, layout: Layout) -> Figure:
    """Figure with the panels, scales and keys of a sheet as vector graphics."""
    inch = 25.4
    figure = Figure(figsize=(layout.width / inch, layout.height / inch))
    page = figure.add_axes((0, 0, 1, 1))
    page.set(xlim=(0, layout.width), ylim=(0, layout.height))
    page.set_axis_off()
    for panel in (panel for row in layout.panels for panel in row):
        _draw_panel(page, panel, sheet)
        for line in panel.title:
            _write(page, line)
    for legend in layout.legends:
        for bar in legend.bars:
            _draw_bar(page, bar)
        for colour, x, y in legend.strokes:
            page.add_line(Line2D([x, x + KEY], [y, y], color=colour, lw=1.5))
        for writing in legend.writings:
            _write(page, writing)
    return figure


def _draw_panel(page: mpl.axes.Axes, slot: Slot, sheet: Sheet) -> None:
    panel = slot.panel
    scale = slot.scale_of(sheet.extent)
    middle = 0.5 * (sheet.extent[0] + sheet.extent[1])

    def on_page(points: ndarray) -> ndarray:
        return slot.middle + scale * (points - middle)[..., :2]

    faces, colours, depths = _faces(panel)
    order = np.argsort(depths, kind="stable")
    polygons = PolyCollection(  # far ones first, so that near ones hide them
        [on_page(faces[i]) for i in order], facecolors=colours[order], edgecolors="face"
    )
    polygons.set(linewidth=_SEAM, joinstyle="round")
    page.add_collection(polygons, autolim=False)
    for ends, colour, width in lines_of(panel, scale, sheet.show_edges):
        lines = LineCollection(
            list(on_page(in_front_of_tool(ends, panel.shape.tool))),
            colors=colour,
            linewidths=width / POINT,
            capstyle="round",
        )
        page.add_collection(lines, autolim=False)


def _faces(panel: Panel) -> tuple[list[ndarray], ndarray, ndarray]:
    """Corners, colours and depths of elements and of triangles of their tool."""
    shape, scale = panel.shape, panel.scale
    faces = [face for cell in shape.cells for face in shape.points[cell.T]]
    if scale is None or panel.values is None:
        colours = _grey(shape.greys)
    else:
        colours = scale.colours((panel.values - scale.low) / (scale.high - scale.low))
    depths = shape.centres[:, 2]
    if tool := shape.tool:
        faces += list(tool.points[tool.triangles.T])
        colours = np.vstack([colours, _grey(tool.shades)])
        behind = tool.centres[:, 2] - shape.sides.max()  # behind the ply on it
        depths = np.concatenate([depths, behind])
    return faces, colours, depths


def _grey(levels: ndarray) -> ndarray:
    return np.insert(np.tile(levels, (3, 1)), 3, 1.0, axis=0).T


def _draw_bar(page: mpl.axes.Axes, bar: Bar) -> None:
    """Draw a rectangle for each colour, extended below the next one to avoid gaps."""
    (x, y, width, height), colours = bar.box, bar.colours
    ends = x + width * np.arange(len(colours) + 1) / len(colours)
    for left, right, colour in zip(ends, [*ends[2:], ends[-1]], colours, strict=False):
        page.add_patch(Rectangle((left, y), right - left, height, fc=colour, ec="none"))
    for tip, colour in zip(bar.tips, (colours[0], colours[-1]), strict=True):
        if len(tip):
            page.add_patch(Polygon(tip, facecolor=colour, edgecolor="none"))
    for mark in bar.zero:
        page.add_patch(Rectangle(mark[:2], *mark[2:], fc="black", ec="none"))


def _write(page: mpl.axes.Axes, writing: Writing) -> None:
    page.text(
        writing.x,
        writing.y,
        writing.text,
        font=FontProperties(fname=font_file(), size=writing.size),
        ha=writing.align,
        va="center_baseline",
        parse_math=False,
    )


#: Suffixes of vector graphics.
VECTORS = (".svg", ".pdf", ".eps")

#: Suffixes of pictures; a name without a suffix becomes a PNG.
SUFFIXES = (".png", *VECTORS)

# PDF and EPS embed fonts as TrueType, as journals require; SVG output is reproducible.
_STYLE = {"pdf.fonttype": 42, "ps.fonttype": 42, "svg.hashsalt": "skfem_textile"}
_NO_DATE = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}


def picture_path(
    filename: str | os.PathLike[str], suffixes: Sequence[str] = SUFFIXES
) -> Path:
    """Validated path of a picture.

    Parameters
    ----------
    filename
        Output file.
    suffixes
        Accepted suffixes; a name without a suffix gets the first one.

    Raises
    ------
    ValueError
        If it is not a path, or its suffix is not accepted.
    FileNotFoundError
        If the folder of the file does not exist.
    """
    if not isinstance(filename, str | os.PathLike):
        raise ValueError(f"filename must be a path, not {with_article(filename)}")
    path = Path(filename)
    if path.suffix.lower() not in ("", *suffixes):
        raise ValueError(
            f"{path}: pictures can be written only to {', '.join(suffixes)} files: "
            f"name it {path.stem}{suffixes[0]}"
        )
    if not path.parent.is_dir():
        raise FileNotFoundError(f"{path}: the folder {path.parent} does not exist")
    return path


def is_vector(path: Path | None) -> bool:
    """True if a path has a suffix of vector graphics."""
    return path is not None and path.suffix.lower() in VECTORS


@contextlib.contextmanager
def atomic_file(path: Path, suffix: str) -> Iterator[Path]:
    """Yield a temporary name; the file is renamed at the end."""
    unfinished = path.with_name(f".unfinished-{path.stem}{suffix}")
    yield unfinished
    unfinished.replace(path)


def save(figure: Figure, path: Path | None) -> None:
    """Write a figure in the format of the suffix; without a path do nothing."""
    if path is None:
        return
    suffix = path.suffix.lower() or SUFFIXES[0]
    with mpl.rc_context(_STYLE), atomic_file(path, suffix) as file:
        figure.savefig(file, dpi=PRINTED, metadata=_NO_DATE.get(suffix))


# Style of all figures with axes.
_AXES_STYLE = {
    "axes.titlesize": "medium",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
}


@contextlib.contextmanager
def new_figure(
    filename: str | os.PathLike[str] | None, font_size: float = TITLE
) -> Iterator[Figure]:
    """Yield a figure in the style of all figures, which is written at the end.

    The name of the file, which may be None, is validated first.

    Examples
    --------
    >>> with new_figure(None):
    ...     mpl.rcParams["font.size"], mpl.rcParams["axes.spines.top"]
    (8.0, False)
    """
    path = None if filename is None else picture_path(filename)
    with mpl.rc_context({"font.size": font_size, **_AXES_STYLE}):
        figure = Figure(layout="constrained")
        yield figure
        save(figure, path)


def legend_below(
    figure: Figure, handles: Sequence[Artist], columns: int = 1, **how: Any
) -> None:
    """Add a legend with the labels of its handles below the axes."""
    figure.legend(
        handles=handles, loc="outside lower center", frameon=False, ncols=columns, **how
    )
