"""Picture files: validation of paths before drawing, and writing."""

import contextlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..mesh.user_input import with_article

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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


def save(figure: "Figure", path: Path | None) -> None:
    """Write a figure in the format of the suffix; without a path do nothing."""
    import matplotlib as mpl

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
