"""Picture files, validated before drawing, and figures of matplotlib in one style."""

import contextlib
import os
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from ..mesh.user_input import with_article
from .layout import TITLE

#: Suffixes of vector graphics.
VECTORS = (".svg", ".pdf", ".eps")

#: Suffixes of pictures; a name without a suffix becomes a PNG.
SUFFIXES = (".png", *VECTORS)

# Dots per inch of a PNG, as journals require.
_DOTS = 300

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
        figure.savefig(file, dpi=_DOTS, metadata=_NO_DATE.get(suffix))


def save_pixels(pixels: Any, path: Path) -> None:
    """Write pixels as a PNG with 300 dots per inch."""
    from PIL import Image

    with atomic_file(path, ".png") as file:
        Image.fromarray(pixels).save(file, dpi=(_DOTS, _DOTS))


def figure_style(size: float = TITLE) -> AbstractContextManager[None]:
    """Context in which figures have one style, with text of a size in points.

    Examples
    --------
    >>> with figure_style():
    ...     mpl.rcParams["font.size"], mpl.rcParams["axes.spines.top"]
    (8.0, False)
    """
    return mpl.rc_context(
        {
            "font.size": size,
            "axes.titlesize": "medium",
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.linewidth": 0.6,
            "lines.linewidth": 1.0,
        }
    )


@contextlib.contextmanager
def new_figure(filename: str | os.PathLike[str] | None) -> Iterator[Figure]:
    """Yield a figure in the style of all figures, which is written at the end.

    The name of the file, which may be None, is validated first.
    """
    path = None if filename is None else picture_path(filename)
    with figure_style():
        figure = Figure(layout="constrained")
        yield figure
        save(figure, path)
