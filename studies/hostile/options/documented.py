"""The options of ``skfem-textile run``, as documented."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from math import isfinite
from typing import Any, NamedTuple

KINDS = ("aligned", "irregular", "horizontal", "vertical", "delaunay")
SIDES = ("top", "right", "bottom", "left")

#: Solvers whose packages are installed; others are refused.
_INSTALLED_SOLVERS = (
    "superlu",
    *(
        solver
        for solver, package in (("cholmod", "cvxopt"), ("pardiso", "pypardiso"))
        if find_spec(package)
    ),
)

#: The value of an option for a folder that is given without a folder.
UNNAMED = True


class UnreadableError(Exception):
    """A line, or a word of it, that must be refused."""


class Option(NamedTuple):
    """One option.

    Parameters
    ----------
    read
        The value of a word; raises `UnreadableError` or ValueError if it has none.
    default
        The value if the option is not given.
    words
        How many words it takes, as in `argparse`: "" for one, "0" for none.
    repeated
        Which values count if it is given again: the "last" one or "all"; "count" for
        how often it is given.
    """

    read: Callable[[str], Any]
    default: Any
    words: str = ""
    repeated: str = "last"


def one_of(*names: str) -> Callable[[str], str]:
    """A reader of names."""

    def read(word: str) -> str:
        if word not in names:
            raise UnreadableError(f"{word!r} is none of {names}")
        return word

    return read


def _degrees(word: str) -> float:
    number = float(word)
    if not (isfinite(number) and abs(number) <= 36_000):
        raise UnreadableError(f"{word!r} is no angle")
    return number


def _size(word: str) -> list[int]:
    nx, ny = map(int, word.split("x"))
    return [nx, ny]


def _cs(word: str) -> float | str:
    return word if word == "auto" else float(word)


def _roller(word: str) -> list[Any]:
    side, sign, degrees = word.partition("=")
    if not sign:
        raise UnreadableError(f"{word!r} has no =")
    return [side, float(degrees)]


def _force(word: str) -> list[Any]:
    name, _, components = word.partition("=")
    force = [float(component) for component in components.split(",")]
    if not name or len(force) != 2:
        raise UnreadableError(f"{word!r} is not like top=0,100")
    return [name, force]


def _move(word: str) -> list[Any]:
    name, _, components = word.partition("=")
    move = [x if x == "free" else float(x) for x in components.split(",")]
    if not name or len(move) != 2:
        raise UnreadableError(f"{word!r} is not like top=0,40")
    return [name, move]


def _folder(word: str) -> str:
    if not word or word.startswith("--"):
        raise UnreadableError("a folder without a name, or an option")
    return word


_CHECKS = (
    "stability",
    "folding",
    "crease",
    "strain",
    "work",
    "stabilisation",
    "deviation",
    "corners",
    "surface",
)

#: Parameters of laws that are not tried here, and files of fabrics and directions, of
#: which no line has a sound one: any but the default is refused.
OF_OTHER_LAWS = {
    "directions": Option(str, None),
    "fabric": Option(str, None),
    "thickness": Option(float, None),
    "units": Option(str, "N mm"),
    "material": Option(str, None),
    "fibre-warp-crimp": Option(str, None),
    "fibre-weft-crimp": Option(str, None),
    "fibre-bending": Option(str, None),
    "fibre-toe": Option(str, None),
    "fibre-initial-stiffness": Option(str, None),
    "fibre-extrapolation": Option(one_of("refuse", "linear"), "refuse"),
    "fibre-continuation": Option(one_of("none", "odd"), "none"),
    "shear-extrapolation": Option(one_of("refuse", "linear"), "refuse"),
    "shear-continuation": Option(one_of("none", "odd"), "none"),
    "shear-locking-angle": Option(str, None),
    "shear-coefficients": Option(str, None),
    "shear-variable": Option(one_of("angle", "sine"), "angle"),
}

_LOADED = {
    "out": Option(_folder, None),
    "no-render": Option(str, False, "0"),
    "mesh": Option(str, "irregular"),
    "size": Option(_size, None),
    "jitter": Option(float, None),
    "seed": Option(int, None),
    "formulation": Option(one_of("one-point", "macro", "full", "quadratic"), "macro"),
    "cs": Option(_cs, "auto"),
    "stabilisation": Option(
        one_of("energy", "rate", "continuity", "isotropic"), "energy"
    ),
    "deviation": Option(float, None),
    "fibre-stiffness": Option(float, 1e4),
    "shear-stiffness": Option(float, 0.0),
    "shear-law": Option(one_of("linear", "sin2"), "linear"),
    "tension-law": Option(one_of("linear"), "linear"),
    **OF_OTHER_LAWS,
    "fibre-compression": Option(one_of("law", "none"), "law"),
    "fibre-pretension": Option(float, 0.0),
    "bending-warp": Option(float, 0.0),
    "bending-weft": Option(float, 0.0),
    "bending-twist": Option(float, 0.0),
    "shear-wrinkling-angle": Option(_degrees, 90.0),
    "force": Option(_force, [], "", "all"),
    "rotate": Option(_degrees, 0.0),
    "test-curve": Option(str, None),
    "steps": Option(int, 20),
    "tolerance": Option(float, None),
    "most-unknowns": Option(int, 50_000),
    "method": Option(one_of("newton", "plain"), "newton"),
    "warn-only": Option(
        one_of(*_CHECKS),
        ["work", "stabilisation", "deviation", "corners", "surface"],
        "*",
    ),
    "solver": Option(one_of("auto", *_INSTALLED_SOLVERS), "auto"),
    "checkpoint": Option(_folder, None, "?"),
    "resume": Option(_folder, None, "?"),
    "verbose": Option(str, 0, "0", "count"),
}

_SHEARED = {"shear-stiffness": Option(float, 0.5)}

_TRELLIS = {
    **_SHEARED,
    "warp": Option(_degrees, 0.0),
    "weft": Option(_degrees, 90.0),
    "shear-angle": Option(_degrees, 45.0),
    "bend": Option(_degrees, 30.0),
    "free": Option(one_of(*SIDES), [], "+", "all"),
    "roller": Option(_roller, [], "", "all"),
}

_BIAS = {
    **_SHEARED,
    "fibre-stiffness": Option(float, 1e5),
    "warp": Option(_degrees, 45.0),
    "weft": Option(_degrees, 135.0),
    "shear-angle": Option(_degrees, 40.0),
    "part": Option(one_of("whole", "half"), "whole"),
}

_SPECIMEN = {
    **_SHEARED,
    "fibre-stiffness": Option(float, 1e5),
    "width": Option(float, 50.0),
    "height": Option(float, 100.0),
    "warp": Option(_degrees, 45.0),
    "weft": Option(_degrees, 135.0),
    "move": Option(_move, [], "", "all"),
    "driven": Option(str, None),
}

#: What a specimen moves if nothing is said.
MOVES = [["bottom", [0.0, 0.0]], ["top", [0.0, 10.0]]]

#: The options of each scene.
OPTIONS: Mapping[str, Mapping[str, Option]] = {
    "strip": _LOADED,
    "picture_frame": {**_LOADED, **_SHEARED, "shear-angle": Option(_degrees, 45.0)},
    "trellis": {**_LOADED, **_TRELLIS},
    "bias_extension": {**_LOADED, **_BIAS},
    "specimen": {**_LOADED, **_SPECIMEN},
}

#: Defaults of the jitter, by scene, and of its seed.
JITTER = {"strip": 0.3, "picture_frame": 0.3, "trellis": 0.3}
JITTER |= {"bias_extension": 0.25, "specimen": 0.25}
SEED = 1
