"""Curves of drawings in DXF and SVG files, and of tables."""

import os
import re
from pathlib import Path

# Beginnings of files: sections of a DXF file, possibly after comments, or its binary
# form; the root element of an SVG file, after a declaration.
_DXF = re.compile(
    rb"(?:\xef\xbb\xbf)?(\s*999\s*\n.*\n)*\s*0\s*\n\s*SECTION\b|AutoCAD Binary DXF"
)
_SVG = re.compile(rb"<([\w.-]+:)?svg[\s>]")

# Number of bytes in which the root element of an SVG file begins.
_HEAD = 65536


def kind_of_drawing(path: str | os.PathLike[str]) -> str | None:
    """``dxf`` or ``svg`` if a file contains a drawing, else None.

    The suffix counts where the file is empty, or its beginning is not text.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with open(path, "rb") as file:
        head = file.read(_HEAD)
    if _DXF.match(head):
        return "dxf"
    if _SVG.search(head):
        return "svg"
    if head.strip() and b"\0" not in head:
        return None
    suffix = Path(path).suffix.lower().removeprefix(".")
    return suffix if suffix in ("dxf", "svg") else None
