"""Options of the command ``fit``, by the kind of test."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from . import words
from .options import add_outputs

# Options of a command: keywords of `argparse` by flag.
Options: TypeAlias = dict[str, dict[str, Any]]


def option(
    text: str, of: Any = None, metavar: str | None = None, **more: Any
) -> dict[str, Any]:
    """Keywords of an option; its help ends with its default, if any."""
    default = " (default: %(default)s)" if more.get("default") else ""
    keywords = {"help": text + default, "type": of, "metavar": metavar, **more}
    return {key: value for key, value in keywords.items() if value is not None}


def repeated(text: str, of: Any, metavar: str) -> dict[str, Any]:
    """Keywords of an option that may be repeated."""
    return option(text, of, metavar, action="append", default=[])


def _size(what: str) -> dict[str, Any]:
    """Option for a specimen size: one value for all files, or one for each."""
    return option(
        f"{what} in mm: one value for all files, or one for each",
        float,
        "MM",
        nargs="+",
    )


_READING: Options = {
    "--encoding": option("encoding of the files (default: from their bytes)"),
    "--separator": option(
        "separator of the columns: ; , | tab or space (default: from the rows)"
    ),
    "--decimal": option("decimal mark (default: from the numbers)", choices=(".", ",")),
    "--column": repeated(
        "column of a quantity, by number or heading (default: from the headings); may "
        "be repeated",
        words.column,
        "COLUMN=NUMBER",
    ),
    "--unit": repeated(
        "unit of a quantity (default: from the headings); may be repeated",
        words.unit,
        "COLUMN=UNIT",
    ),
    "--sign": repeated(
        "factor 1 or -1 of a quantity (default: forces are positive at the largest "
        "displacement); may be repeated",
        words.sign,
        "COLUMN=SIGN",
    ),
}

_BRANCH: Options = {
    "--branch": option(
        "rows that are fitted: loading, unloading or both",
        choices=("loading", "unloading", "both"),
        default="loading",
    ),
    "--cycle": option(
        "number of the fitted cycle (default: the first one that reaches the largest "
        "displacement)",
        int,
        "N",
    ),
    "--keep-outliers": option("fit also outliers", action="store_true"),
}

_SLACK: Options = {
    "--slack": option(
        "displacement at which the fabric begins to carry load (default: estimated)",
        float,
        "MM",
    ),
}

_AT_REST: Options = {
    "--force-at-rest": option(
        "force of the undeformed fabric, such as the weight of a clamp (default: "
        "estimated)",
        float,
        "N",
    ),
}

_FAMILY: Options = {
    "--family": option(
        "fibre family along the strips", default="warp", choices=("warp", "weft")
    )
}

#: Options of the files of each kind of test.
OF_FILES: dict[str, Options] = {
    "strip": {
        **_FAMILY,
        "--width": _size("width of the strip"),
        "--length": _size("length of the strip between the clamps"),
        **_READING,
        **_BRANCH,
        **_SLACK,
    },
    "picture-frame": {
        "--frame-side": _size("side of the frame from hinge to hinge"),
        "--fabric-side": _size("side of the sheared square of fabric"),
        **_READING,
        **_BRANCH,
        **_SLACK,
        **_AT_REST,
    },
    "bias-extension": {
        "--width": _size("width of the specimen"),
        "--height": _size("height of the specimen between the clamps"),
        "--warp": option(
            "angle between fibres and clamps", words.degrees, "DEG", default=45.0
        ),
        **_READING,
        **_BRANCH,
        **_SLACK,
        **_AT_REST,
    },
    "biaxial": {
        "--warp-width": _size("width of the specimen transverse to the warp force"),
        "--weft-width": _size("width of the specimen transverse to the weft force"),
        **_READING,
        **_BRANCH,
        **_SLACK,
    },
    "cantilever": {
        "--weight": option(
            "weight per area in N/mm2, such as 6e-6 for 0.6 kg/m2", float, "W"
        ),
        **_FAMILY,
        "--chord-angle": option(
            "chord angle of all readings, for files without that column, such as 41.5",
            words.degrees,
            "DEG",
        ),
        **_READING,
    },
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
        "a bending stiffness from cantilever tests, by the elastica (Peirce)",
        {**OF_FILES["cantilever"], **_FABRIC},
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
            **_SHEAR,
            **_SIMULATE,
            **_VALIDATE,
        },
    ),
}


def add_fit(parser: ArgumentParser, named: Sequence[str] | None) -> None:
    """Add the kinds of tests; only the named kind gets its options, all if None."""
    tests = parser.add_subparsers(dest="test", required=True)
    for name, (description, options) in TESTS.items():
        one = tests.add_parser(name, help=description, description=description)
        if named is not None and name not in named[:1]:
            continue
        one.add_argument(
            "data",
            type=Path,
            nargs="+",
            metavar="DATA",
            help="TOML files with a table [[test]] for each kind of test"
            if name == "joint"
            else "files of the tests, or folders that contain them",
        )
        add_outputs(one)
        for flag, keywords in options.items():
            one.add_argument(flag, **keywords)
