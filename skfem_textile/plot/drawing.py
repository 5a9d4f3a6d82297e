"""Drawing of sheets with matplotlib and, in space, pixels with pyvista; files.

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
import matplotlib.path as mpath
import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection, PolyCollection
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
    """Draw a sheet into a plotter or a new picture, and write the file.

    Files of plies in the plane are drawn with matplotlib: it takes a third of the time
    of a window of VTK, and needs no OpenGL.
    """
    path = None if filename is None else picture_path(filename)
    if plotter is None:
        layout = lay_out(sheet, size)
        if is_vector(path) or (path and sheet.is_flat):
            figure, page = _page_of(layout)
            _draw_panels(page, sheet, layout)
            _draw_legends(page, layout)
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
        _write_png(plotter.screenshot(return_img=True), path)
    return plotter


def pyvista_drawing() -> Any:
    """Import the module that draws with pyvista, which takes a second."""
    require("a plotter or a picture in space", "plot", "pyvista")
    return import_module(".pyvista_drawing", __package__)


# Width in points of the edge that closes gaps between polygons in viewers.
_SEAM = 0.4

# Number of lines and polygons of a path: many more exceed a limit of matplotlib.
_MANY = 1000


def _page_of(layout: Layout) -> tuple[Figure, mpl.axes.Axes]:
    """New figure, and the empty page that fills it, whose coordinates are in mm."""
    inch = 25.4
    figure = Figure(figsize=(layout.width / inch, layout.height / inch))
    page = figure.add_axes((0, 0, 1, 1))
    page.set(xlim=(0, layout.width), ylim=(0, layout.height))
    page.set_axis_off()
    return figure, page


def _draw_panels(page: mpl.axes.Axes, sheet: Sheet, layout: Layout) -> None:
    for panel in (panel for row in layout.panels for panel in row):
        _draw_panel(page, panel, sheet)
        for line in panel.title:
            _write(page, line)


def _draw_legends(page: mpl.axes.Axes, layout: Layout) -> None:
    for legend in layout.legends:
        for bar in legend.bars:
            _draw_bar(page, bar)
        for colour, x, y in legend.strokes:
            page.add_line(Line2D([x, x + KEY], [y, y], color=colour, lw=1.5))
        for writing in legend.writings:
            _write(page, writing)


def flat_frames(
    sheets: Sequence[Sheet], layouts: Sequence[Layout], dots_per_inch: float
) -> list[ndarray]:
    """Pixels of sheets in the plane with equal legends, shape (height, width, 3)."""
    (figure, page), frames = _page_of(layouts[0]), []
    figure.dpi = dots_per_inch
    canvas = FigureCanvasAgg(figure)
    _draw_legends(page, layouts[0])
    canvas.draw()
    legends = canvas.copy_from_bbox(figure.bbox)
    for sheet, layout in zip(sheets, layouts, strict=True):
        for drawn in page.collections, page.lines, page.patches, page.texts:
            for artist in [*drawn]:
                artist.remove()
        canvas.restore_region(legends)
        _draw_panels(page, sheet, layout)
        for artist in *page.collections, *page.texts:
            artist.draw(canvas.get_renderer())
        frames.append(np.array(canvas.buffer_rgba())[..., :3])
    return frames


def _draw_panel(page: mpl.axes.Axes, slot: Slot, sheet: Sheet) -> None:
    panel = slot.panel
    scale = slot.scale_of(sheet.extent)
    middle = 0.5 * (sheet.extent[0] + sheet.extent[1])

    def on_page(points: ndarray) -> ndarray:
        return np.asarray(slot.middle + scale * (points - middle)[..., :2])

    faces, colours, depths = _faces(panel)
    if sheet.is_flat:
        groups = _by_colour(colours)
    else:  # near ones hide far ones
        groups = list(np.argsort(depths, kind="stable")[:, None])
    polygons = [_path(on_page(faces[group]), closed=True) for group in groups]
    seams = {"edgecolors": "face", "linewidths": _SEAM, "joinstyle": "round"}
    _add(page, polygons, facecolors=colours[[g[0] for g in groups]], **seams)
    for ends, colour, width in lines_of(panel, scale, sheet.show_edges):
        lines = on_page(in_front_of_tool(ends, panel.shape.tool))
        _add(
            page,
            [_path(some) for some in np.split(lines, range(_MANY, len(lines), _MANY))],
            facecolors="none",
            edgecolors=colour,
            linewidths=width / POINT,
            capstyle="round",
        )


def _add(page: mpl.axes.Axes, paths: list[mpath.Path], **how: Any) -> None:
    page.add_collection(PathCollection(paths, **how), autolim=False)


def _path(lines: ndarray, closed: bool = False) -> mpath.Path:
    """Lines of shape (n, n_points, 2) as one path."""
    if closed:
        lines = np.hstack([lines, lines[:, :1]])
    n, k, _ = lines.shape
    codes = np.full((n, k), mpath.Path.LINETO)
    codes[:, 0] = mpath.Path.MOVETO
    if closed:
        codes[:, -1] = mpath.Path.CLOSEPOLY
    return mpath.Path(lines.reshape(-1, 2), codes.ravel())


def _by_colour(colours: ndarray) -> list[ndarray]:
    """Numbers of faces in groups of one colour, of at most `_MANY` faces."""
    order = np.lexsort(colours.T)
    along = colours[order]
    changes = np.flatnonzero((along[1:] != along[:-1]).any(axis=1)) + 1
    return np.split(order, np.union1d(changes, np.arange(_MANY, len(order), _MANY)))


def _faces(panel: Panel) -> tuple[ndarray, ndarray, ndarray]:
    """Corners, colours and depths of elements and of triangles of their tool.

    Of triangles the last corner is repeated: shape (n, 4, 3).
    """
    shape, scale = panel.shape, panel.scale
    faces = [shape.points[cell[[0, 1, 2, -1]].T] for cell in shape.cells]
    if scale is None or panel.values is None:
        colours = _grey(shape.greys)
    else:
        colours = scale.colours((panel.values - scale.low) / (scale.high - scale.low))
    depths = shape.centres[:, 2]
    if tool := shape.tool:
        faces.append(tool.points[tool.triangles[[0, 1, 2, 2]].T])
        colours = np.vstack([colours, _grey(tool.shades)])
        behind = tool.centres[:, 2] - shape.sides.max()  # behind the ply on it
        depths = np.concatenate([depths, behind])
    return np.concatenate(faces), colours, depths


def _grey(levels: ndarray) -> ndarray:
    return np.insert(np.tile(levels, (3, 1)), 3, 1.0, axis=0).T


def _draw_bar(page: mpl.axes.Axes, bar: Bar) -> None:
    """Draw a rectangle for each colour, extended below the next one to avoid gaps."""
    (x, y, width, height), colours = bar.box, bar.colours
    ends = x + width * np.arange(len(colours) + 1) / len(colours)
    left, right = ends[:-1], np.append(ends[2:], ends[-1])
    corners = np.empty((len(colours), 4, 2))
    corners[..., 0] = np.column_stack([left, right, right, left])
    corners[..., 1] = y, y, y + height, y + height
    rectangles = PolyCollection(list(corners), facecolors=colours, edgecolors="none")
    page.add_collection(rectangles, autolim=False)
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
        va="center",
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
    if not is_vector(path):
        _write_png(_pixels_of(figure), path)
        return
    suffix = path.suffix.lower()
    with mpl.rc_context(_STYLE), atomic_file(path, suffix) as file:
        figure.savefig(file, metadata=_NO_DATE.get(suffix))


def _pixels_of(figure: Figure) -> ndarray:
    """Pixels of a figure, drawn once: `savefig` draws it a second time for its layout.

    Shape (height, width, 3).
    """
    canvas, dots_per_inch = figure.canvas, figure.dpi
    figure.dpi = PRINTED
    drawn = FigureCanvasAgg(figure)
    try:
        drawn.draw()
    finally:
        figure.dpi = dots_per_inch
        figure.set_canvas(canvas)
    return np.asarray(drawn.buffer_rgba())[..., :3]


# Compression of pictures: the files are as small as by default, in two thirds of the
# time.
_COMPRESSION = 3


def _write_png(pixels: ndarray, path: Path) -> None:
    from PIL import Image

    with atomic_file(path, ".png") as file:
        picture = Image.fromarray(pixels)
        picture.save(file, dpi=(PRINTED, PRINTED), compress_level=_COMPRESSION)


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
