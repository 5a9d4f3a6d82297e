"""Options of the commands, except ``run`` and ``fit``."""

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from ..cases.scenes import SCENES
from ..declarations import words
from .parser import COMMANDS

#: Units of tool files.
UNITS = ("mm", "cm", "m", "in")

_EXIT_CODES = (
    "exit code: 0 if there is a flat pattern of the whole part; 1 if there is none, or "
    "none with darts, or courses leave a part of the tool uncovered (all other results "
    "are written); 2 for invalid input; 130 if interrupted"
)

_DIRECTIONS = (
    "file with the fibre directions of each element, as for `run` (default: MESH)"
)


def add_list(parser: ArgumentParser, _: Any) -> None:
    """Add nothing: ``list`` has no options."""


def add_show(parser: ArgumentParser, _: Any) -> None:
    """Add the options of ``show``."""
    add = parser.add_argument
    add("mesh", metavar="MESH", help="mesh file of quadrilaterals or triangles")
    add("--out", type=Path, required=True, metavar="DIR", help="folder for results")
    add("--no-render", action="store_true", help="do not draw a picture")
    add("--directions", metavar="FILE", help=_DIRECTIONS)
    for name in ("warp", "weft"):
        text = f"angle of the {name} to the x axis in every element"
        add(f"--{name}", type=words.degrees, metavar="DEG", help=text)


def add_init(parser: ArgumentParser, _: Any) -> None:
    """Add the options of ``init``."""
    parser.add_argument(
        "file", type=words.case_file, metavar=words.CASE_FILE, help="case file to write"
    )
    parser.add_argument(
        "--scene",
        choices=tuple(SCENES),
        default="specimen",
        help="scene of the case (default: %(default)s)",
    )


def add_report(parser: ArgumentParser, _: Any) -> None:
    """Add the options of ``report``."""
    parser.add_argument(
        "folder", type=words.folder, metavar="DIR", help="results folder of a run"
    )
    parser.add_argument(
        "--test-curve",
        type=Path,
        metavar="FILE.csv",
        help="CSV file with a test curve, drawn instead of the one named in the case",
    )


def add_net(parser: ArgumentParser, _: Any) -> None:
    """Add the options of ``net``."""
    parser.description, parser.epilog = COMMANDS["net"].about, _EXIT_CODES
    add = parser.add_argument
    add(
        "--tool",
        nargs="+",
        required=True,
        metavar="FILE",
        help="STL, PLY, OBJ or 3MF files, or other files of triangles",
    )
    add("--unit", choices=UNITS, help="unit of the tool files (default: mm)")
    add("--out", type=Path, required=True, metavar="DIR", help="folder for results")
    add(
        "--fibres",
        type=words.degrees,
        metavar="DEG",
        help="angle of the warp to the x axis of the tool file, projected onto the "
        "tool (default: 0); the weft is at right angles; with --best the direction is "
        "fixed",
    )
    add(
        "--point",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="point of the tool in mm at which the first threads cross (default: the "
        "highest point, or a point near the middle)",
    )
    add(
        "--cell",
        type=words.length,
        metavar="MM",
        help="length of a cell (default: a hundredth of the diagonal of the tool)",
    )
    add(
        "--locking-angle",
        type=words.acute_degrees,
        metavar="DEG",
        help="shear angle of the fabric above which it wrinkles",
    )
    for family in ("warp", "weft"):
        add(
            f"--{family}-along",
            type=Path,
            metavar="FILE.csv",
            help=f"curve that the first {family} thread follows: a table with the "
            "columns x, y and z, or a DXF file (default: a geodesic)",
        )
    add(
        "--trim",
        type=Path,
        nargs="+",
        metavar="FILE.csv",
        help="closed curves along which the pattern is trimmed, tables or DXF files: "
        "the outline, then holes (default: the edges of the tool)",
    )
    add(
        "--best",
        nargs="?",
        const="largest",
        choices=("largest", "mean"),
        help="search for the point and the direction, or with --fibres the point, with "
        "the smallest largest (default), or mean, shear angle over the part",
    )
    add(
        "--darts",
        action="store_true",
        help="cut darts where the net folds or shears beyond the locking angle",
    )
    add(
        "--roll-width",
        type=words.length,
        metavar="MM",
        help="cover the tool with courses of this width, side by side",
    )
    add(
        "--overlap",
        type=float,
        default=0.0,
        metavar="MM",
        help="overlap of neighbouring courses (default: 0)",
    )
    add("--no-render", action="store_true", help="do not draw a picture")


def add_outputs(parser: ArgumentParser) -> None:
    """Add the folder of results and the flag for pictures."""
    add = parser.add_argument
    add(
        "--out",
        type=words.folder,
        required=True,
        metavar="DIR",
        help="folder for results",
    )
    add("--no-render", action="store_true", help="do not draw pictures")
