"""Options of the commands, except ``run``."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..cases.scenes import SCENES
from ..declarations import words
from ..declarations.words import OF_FILES, Options, option, repeated
from ..mesh.user_input import IN_MM

#: Folder of results, and flag for pictures.
OUTPUTS: Options = {
    "--out": option("folder for results", words.folder, "DIR", required=True),
    "--no-render": option("do not draw pictures", action="store_true"),
}

_SHOW: Options = {
    "mesh": option(
        "mesh file of quadrilaterals or triangles; or a fabric of the catalogue or a "
        ".json file, whose laws and sources are shown",
        metavar="MESH|FABRIC",
    ),
    **OUTPUTS,
    "--out": option(
        "folder for results; a fabric is only printed without it", words.folder, "DIR"
    ),
    "--directions": option(
        "file with the fibre directions of each element, as for `run` (default: MESH)",
        metavar="FILE",
    ),
    **{
        f"--{name}": option(
            f"angle of the {name} to the x axis in every element", words.degrees, "DEG"
        )
        for name in ("warp", "weft")
    },
}

_NET: Options = {
    "--tool": option(
        "STL, PLY, OBJ or 3MF files, or other files of triangles",
        metavar="FILE",
        nargs="+",
        required=True,
    ),
    "--unit": option("unit of the tool files (default: mm)", choices=tuple(IN_MM)),
    **OUTPUTS,
    "--fibres": option(
        "angle of the warp to the x axis of the tool file, projected onto the tool "
        "(default: 0); the weft is at right angles; with --best the direction is fixed",
        words.degrees,
        "DEG",
    ),
    "--point": option(
        "point of the tool in mm at which the first threads cross (default: the "
        "highest point, or a point near the middle)",
        float,
        ("X", "Y", "Z"),
        nargs=3,
    ),
    "--cell": option(
        "length of a cell (default: a hundredth of the diagonal of the tool)",
        words.length,
        "MM",
    ),
    "--locking-angle": option(
        "shear angle of the fabric above which it wrinkles", words.acute_degrees, "DEG"
    ),
    **{
        f"--{family}-along": option(
            f"curve that the first {family} thread follows: a table with the columns "
            "x, y and z, or a DXF file (default: a geodesic)",
            Path,
            "FILE.csv",
        )
        for family in ("warp", "weft")
    },
    "--trim": option(
        "closed curves along which the pattern is trimmed, tables or DXF files: the "
        "outline, then holes (default: the edges of the tool)",
        Path,
        "FILE.csv",
        nargs="+",
    ),
    "--outline": option(
        "outline of the flat ply, its middle at the start: a drawing (.dxf, .svg), or "
        "a table of x and y (.csv); without --trim the part is what it covers",
        metavar="FILE",
    ),
    "--layer": option(
        "layers of the drawing that are read, or id of elements (default: all)",
        metavar="LAYER",
        nargs="+",
    ),
    "--outline-unit": option(
        "unit of length of the drawing (default: the file's, else mm)",
        choices=tuple(IN_MM),
    ),
    "--best": option(
        "search for the point and the direction, or with --fibres the point, with the "
        "smallest largest (default), or mean, shear angle over the part",
        nargs="?",
        const="largest",
        choices=("largest", "mean"),
    ),
    "--darts": option(
        "cut darts where the net folds or shears beyond the locking angle",
        action="store_true",
    ),
    "--roll-width": option(
        "cover the tool with courses of this width, side by side", words.length, "MM"
    ),
    "--overlap": option(
        "overlap of neighbouring courses (default: 0)", float, "MM", default=0.0
    ),
}

_FABRIC: Options = {
    "--fabric": option(
        "fabric.json of an earlier fit, whose other laws are kept", metavar="FILE"
    )
}

_COMMON: Options = {
    **_FABRIC,
    "--bound": repeated(
        "lower and upper bound of a parameter; may be repeated",
        words.bound,
        "NAME=LOW,HIGH",
    ),
    "--points": option(
        "number of points of a tabulated law, excluding 0", int, "N", default=8
    ),
    "--extrapolation": option(
        "tabulated law beyond the data: refuse every state (default), or extrapolate "
        "linearly",
        choices=("refuse", "linear"),
    ),
}

_SHEAR_LAW = option(
    "shear law: polynomial (odd powers), linear, sin2, locking or tabulated, or auto, "
    "the one with the best cross-validation",
    metavar="LAW",
    default="polynomial",
)

_TENSION_LAW = option(
    "tension law: crimp-toe, linear or tabulated for each family, or auto, the one "
    "with the best cross-validation; from biaxial tests also crimp-interchange",
    metavar="LAW",
    default="crimp-toe",
)

_BENDING_LAW = option(
    "bending law: linear, bilinear, polynomial (odd powers) or, for measured moments, "
    "tabulated; or auto, the one with the best cross-validation if the tests cover "
    "several curvatures, else linear",
    metavar="LAW",
    default="auto",
)

_BENDING: Options = {
    "--law": _BENDING_LAW,
    "--degree": option(
        "highest power of the polynomial, an odd number", int, "N", default=3
    ),
}

_SHEAR: Options = {
    "--degree": option(
        "highest power of the polynomial, an odd number", int, "N", default=5
    ),
    "--up-to": option(
        "largest shear angle of the fitted points (default: 40 for theoretical angles "
        "of bias extensions, the onset of slip for measured ones; no limit for picture "
        "frames or simulated tests)",
        words.degrees,
        "DEG",
    ),
    "--fibre-stiffness": option(
        "fibre stiffness in N/mm for fabric.json and for simulated tests (default: "
        "from --fabric, else 1e5)",
        float,
        "E",
    ),
    **_COMMON,
}

_VALIDATE: Options = {
    "--validate": option(
        "TOML file of bias extensions and picture frames, as for fit joint, that are "
        "not fitted: predict them by simulation, and compare",
        Path,
        "FILE",
    ),
}

_SIMULATE: Options = {
    "--simulate": option(
        "fit bias extensions by simulation, with this number of element edges across "
        "the width",
        int,
        "N",
    ),
}

#: Kinds of fits: help text and options.
TESTS: dict[str, tuple[str, Options]] = {
    "strip": (
        "a tension law from tensile tests along warp or weft",
        {"--law": _TENSION_LAW, **OF_FILES["strip"], **_COMMON},
    ),
    "picture-frame": (
        "a shear law from picture-frame tests",
        {
            "--law": _SHEAR_LAW,
            **OF_FILES["picture-frame"],
            **_SHEAR,
            **_VALIDATE,
        },
    ),
    "bias-extension": (
        "a shear law from bias-extension tests",
        {
            "--law": _SHEAR_LAW,
            **OF_FILES["bias-extension"],
            **_SHEAR,
            **_SIMULATE,
            **_VALIDATE,
        },
    ),
    "cantilever": (
        "a bending stiffness or law from cantilever tests, by the elastica (Peirce)",
        {**OF_FILES["cantilever"], **_BENDING, **_FABRIC},
    ),
    "bending": (
        "a bending law from measured moments and curvatures",
        {**OF_FILES["bending"], **_BENDING, **_COMMON},
    ),
    "biaxial": (
        "tension laws from biaxial tests, one file per strain ratio",
        {"--law": _TENSION_LAW, **OF_FILES["biaxial"], **_COMMON},
    ),
    "joint": (
        "all laws from tests of several kinds, listed in a TOML file",
        {
            "--shear-law": _SHEAR_LAW,
            "--tension-law": _TENSION_LAW,
            "--bending-law": _BENDING_LAW,
            **_SHEAR,
            **_SIMULATE,
            **_VALIDATE,
        },
    ),
}


#: Options of the commands that have neither scenes nor kinds of tests.
OPTIONS: dict[str, Options] = {
    "list": {},
    "show": _SHOW,
    "init": {
        "file": option("case file to write", words.case_file, words.CASE_FILE),
        "--scene": option(
            "scene of the case", choices=tuple(SCENES), default="specimen"
        ),
    },
    "report": {
        "folder": option("results folder of a run", words.folder, "DIR"),
        "--test-curve": option(
            "CSV file with a test curve, drawn instead of the one named in the case",
            Path,
            "FILE.csv",
        ),
    },
    "export": {"folder": option("results folder of a run", words.folder, "DIR")},
    "net": _NET,
}


def add_fit(parser: ArgumentParser, named: Sequence[str] | None) -> None:
    """Add the kinds of tests; only the named kind gets its options, all if None."""
    tests = parser.add_subparsers(dest="test", required=True)
    for name, (description, options) in TESTS.items():
        one = tests.add_parser(name, help=description, description=description)
        if named is not None and name not in named[:1]:
            continue
        data = "files of the tests, or folders that contain them"
        if name == "joint":
            data = "TOML files with a table [[test]] for each kind of test"
        add(one, {"data": option(data, Path, "DATA", nargs="+"), **OUTPUTS, **options})


def add(parser: Any, options: Options) -> None:
    """Add options of a table."""
    for flag, keywords in options.items():
        parser.add_argument(flag, **keywords)
