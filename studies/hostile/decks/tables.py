"""Trials of damaged tables: laws, fibre directions and curves of tests as CSV."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy import ndarray
from numpy.random import Generator

from skfem_textile import Tabulated
from skfem_textile.calibration.curves import read_curve
from skfem_textile.io import read_directions

from ..meshes.text_damage import damaged
from ..trial import UNCLEAR, Family, Finding, WrongAnswerError, checked, refused

# Columns that a table may have: how much their units are in radians, strains, N/mm, mm
# and N, as documented.
_UNITS = {
    "shear angle": {"deg": np.pi / 180, "rad": 1.0},
    "moment": {"N mm/mm2": 1.0, "N/mm": 1.0},
    "fibre strain": {"-": 1.0, "%": 0.01},
    "tension": {"N/mm": 1.0, "kN/m": 1.0},
    "displacement": {"mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4},
    "force": {"N": 1.0, "kN": 1e3, "cN": 0.01, "lbf": 4.4482216152605},
}

# The same by other names and units, which damage may write.
_ALSO = {
    "angle": "shear angle",
    "shear moment": "moment",
    "load": "force",
    "extension": "displacement",
    "degrees": "deg",
    "radians": "rad",
    "1": "-",
}

_HEADING = re.compile(r"(.*?)\((.*?)\)")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)

# Agreement of two readers of the same numbers.
_ROUND_OFF = 1e-12


def _attempt(seed: int, folder: Path) -> Finding:
    """Read a damaged table, and compare it with its text."""
    rng = np.random.default_rng([18, seed])
    kinds = list(_KINDS)
    names = kinds[rng.integers(0, len(kinds))]
    content, damage = damaged(_sound(names, rng), rng)
    path = folder / "table.csv"
    path.write_bytes(content)
    try:
        found = _KINDS[names](path)
    except ValueError as error:
        if not damage:
            return Finding(UNCLEAR, damage, f"refused though whole: {error}")
        return refused(damage, str(error))
    return checked(f"{damage}: {content!r}", _compare, found, content)


def _sound(names: tuple[str, ...], rng: Generator) -> bytes:
    """A table with columns of these names, which rise from 0."""
    n = int(rng.integers(2, 7))
    rows = np.cumsum(rng.uniform(0.1, 4.0, (n, len(names))), axis=0).round(3)
    headings = list(names)
    if names == _DIRECTIONS:
        rows[:, 0] = np.arange(1, n + 1)
    else:
        rows[0] = 0.0
        units = [str(rng.choice(list(_UNITS[name]))) for name in names]
        headings = [f"{name} ({u})" for name, u in zip(names, units, strict=True)]
    lines = [headings, *[[f"{x:g}" for x in row] for row in rows]]
    end = str(rng.choice(["\n", "\r\n"]))
    return (end.join(map(",".join, lines)) + end).encode()


def _law(path: Path) -> dict[str, ndarray]:
    law = Tabulated.from_csv(path, extrapolation="linear")
    return dict(enumerate(law.points))  # type: ignore[arg-type]


def _directions(path: Path) -> dict[str, ndarray]:
    found = read_directions(path)
    return dict(zip(_DIRECTIONS[1:], (found.warp, found.weft), strict=True))


_DIRECTIONS = ("element", "warp_angle_deg", "weft_angle_deg")
_KINDS: Mapping[tuple[str, ...], Callable[[Path], Mapping[str, ndarray]]] = {
    ("shear angle", "moment"): _law,
    ("fibre strain", "tension"): _law,
    _DIRECTIONS: _directions,
    ("displacement", "force"): read_curve,
    ("force", "shear angle", "displacement"): read_curve,
}


def _compare(found: Mapping[str, ndarray], content: bytes) -> None:
    """Raise unless the numbers of a table are those of its text."""
    text = content.decode("utf-8-sig")
    if '"' in text:
        return  # quotes may hide commas and ends of lines
    lines = [line.split(",") for line in re.split(r"\r\n|\n|\r", text)]
    lines = [line for line in lines if any(map(str.strip, line))]
    header = [cell.strip() for cell in lines[0]]
    for key, column in found.items():
        numbers, factor = _column(header, lines[1:], key)
        if key in _DIRECTIONS:
            elements, _ = _column(header, lines[1:], "element")
            angle = np.radians(numbers[np.argsort(elements)])
            numbers, factor = np.array([np.cos(angle), np.sin(angle)]), 1.0
        if not np.isfinite(column).all():
            raise WrongAnswerError(f"{key}: {column}")
        same = np.shape(column) == numbers.shape and np.allclose(
            column, numbers * factor, rtol=_ROUND_OFF, atol=_ROUND_OFF
        )
        if not same:
            raise WrongAnswerError(f"{key}: {column} instead of {numbers * factor}")


def _column(
    header: list[str], lines: list[list[str]], key: str | int
) -> tuple[ndarray, float]:
    """Numbers of a column as they stand, and how much their unit is."""
    names = [_named(cell) for cell in header]
    place = key if isinstance(key, int) else [name for name, _ in names].index(key)
    cells = [line[place].strip() for line in lines]
    if odd := [cell for cell in cells if not _NUMBER.fullmatch(cell)]:
        raise WrongAnswerError(f"{odd} were taken for numbers")
    name, unit = names[place]
    factor = _UNITS[name][unit] if name in _UNITS else 1.0
    return np.array(cells, dtype=float), factor


def _named(cell: str) -> tuple[str, str]:
    """Name and unit of a heading."""
    heading = _HEADING.fullmatch(cell)
    if not heading:
        return cell, ""
    name = re.sub(r"[\s_]+", " ", heading[1].strip().lower())
    unit = heading[2].strip()
    return _ALSO.get(name, name), _ALSO.get(unit, unit)


FAMILY = Family("tables", _attempt, 3000, 30)
