"""Options of the command ``fit``, by the kind of test."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path

from ..declarations import words
from ..declarations.words import OF_FILES, Options, option, repeated
from .options import add_outputs

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
