"""The arguments of the command ``show``."""

import argparse
from pathlib import Path
from typing import Any

from ...registration import angle

_DIRECTIONS = "fibre directions of each element, as for `run` (default: those of MESH)"


def add_show(commands: Any) -> None:
    """Add the command to those of a parser."""
    show = commands.add_parser(
        "show", help="draw a mesh and its fibres, and write the directions to files"
    )
    add = show.add_argument
    add("mesh", metavar="MESH", help="a file of quadrilaterals or triangles")
    add("--out", type=Path, required=True, metavar="DIR", help="where files go")
    add("--no-render", action="store_true", help="write no picture")
    add("--directions", metavar="FILE", help=_DIRECTIONS)
    for name in ("warp", "weft"):
        one = angle(name, None, f"angle of the {name} to the x axis in every element")
        add(f"--{name}", type=_number(one.read), metavar="DEG", help=one.help)


def _number(read: Any) -> Any:
    def told(word: str) -> float:
        try:
            return read(word)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return told
