"""The options of the command ``fit``."""

import math

from ...registration import Option, angle


def _bound(word: str) -> tuple[str, tuple[float, float]]:
    name, _, ends = word.partition("=")
    try:
        low, high = (float(end) for end in ends.split(","))
    except ValueError:
        low = high = math.nan
    if not (name and low < high):
        raise ValueError(f"{word!r} is not like c1=0,1")
    return name, (low, high)


def _unit(word: str) -> tuple[str, str]:
    name, _, unit = word.partition("=")
    if not (name and unit):
        raise ValueError(f"{word!r} is not like force=kN")
    return name, unit


def _size(name: str, help: str) -> Option:  # noqa: A002
    """A size of specimens: one for all, or one for each file."""
    said = f"{help}, in mm: one for all files or one for each"
    return Option(name=name, help=said, read=float, words="+", metavar="MM")


_COMMON = (
    Option(
        name="unit",
        help="unit of a column, where the first row of a file does not tell it; may be "
        "repeated",
        default=(),
        read=_unit,
        repeated=True,
        metavar="COLUMN=UNIT",
    ),
    Option(
        name="bound",
        help="least and largest value of a parameter; may be repeated",
        default=(),
        read=_bound,
        repeated=True,
        metavar="NAME=LOW,HIGH",
    ),
    Option(
        name="fabric",
        help="a fabric.json of another fit, whose other laws are kept",
        metavar="FILE",
    ),
    Option(
        name="points",
        help="points of a table beside 0",
        default=8,
        read=int,
        metavar="N",
    ),
    Option(
        name="extrapolation",
        help="of a table beyond the data: refuse every state, which is the default, or "
        "go on in a straight line",
        choices=("refuse", "linear"),
    ),
)

_SHEAR = (
    Option(
        name="law",
        help="polynomial of odd powers, linear, sin2, locking or tabulated",
        default="polynomial",
        metavar="LAW",
    ),
    Option(
        name="degree",
        help="highest power of the polynomial, odd",
        default=5,
        read=int,
        metavar="N",
    ),
    angle(
        "up-to",
        None,
        "shear angle up to which points are taken; without it up to 40 where the angle "
        "is theoretical, and all where it is measured or the tests are simulated",
    ),
    Option(
        name="fibre-stiffness",
        help="of fabric.json, and of simulated tests, in N/mm (default: 1e5, or that "
        "of --fabric)",
        read=float,
        metavar="E",
    ),
    *_COMMON,
)

#: The options of each kind of test.
TESTS: dict[str, tuple[str, tuple[Option, ...]]] = {
    "picture-frame": (
        "a shear law from picture-frame tests",
        (
            _size("frame-side", "side of the frame from hinge to hinge"),
            _size("fabric-side", "side of the square of fabric that is sheared"),
            *_SHEAR,
        ),
    ),
    "bias-extension": (
        "a shear law from bias-extension tests",
        (
            _size("width", "width of the specimen"),
            _size("height", "height of the specimen between the clamps"),
            angle("warp", 45.0, "angle between fibres and clamps"),
            *_SHEAR,
            Option(
                name="simulate",
                help="fit simulated tests, with so many element edges across the width",
                read=int,
                metavar="N",
            ),
        ),
    ),
    "biaxial": (
        "tension laws from biaxial tests, one file for each ratio of the strains",
        (
            Option(
                name="law",
                help="crimp-toe, linear or tabulated for each family, or "
                "crimp-interchange",
                default="crimp-toe",
                metavar="LAW",
            ),
            _size("warp-width", "width across the pull of the warp"),
            _size("weft-width", "width across the pull of the weft"),
            *_COMMON,
        ),
    ),
}
