"""Test curves from CSV files with units, and checks of their initial force.

An undeformed fabric carries no force.  A curve that begins with a nonzero force
includes the weight of clamps, the friction of a frame or a pretension, which no law
represents.
"""

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy import ndarray

from ..fabric.law import Resistance, refuse_other_units
from ..fabric.laws.tabulated import ANGLE, HEADING, read_lines
from ..mesh.user_input import excerpt, number_of_text

_LENGTH = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4}
_FORCE = {"N": 1.0, "kN": 1000.0, "cN": 0.01, "lbf": 4.4482216152605}
_STRAIN = {"-": 1.0, "1": 1.0, "%": 0.01}
_FORCE_PER_LENGTH = {"N/mm": 1.0, "kN/m": 1.0}

#: Columns of a test by name, with the factors of their units to mm, N, radians, strain
#: and N/mm.
COLUMNS: dict[str, dict[str, float]] = {
    "displacement": _LENGTH,
    "force": _FORCE,
    "half-width of the force": _FORCE,
    "shear angle": ANGLE,
    "normalised shear force": _FORCE_PER_LENGTH,
    "warp strain": _STRAIN,
    "weft strain": _STRAIN,
    "warp force": _FORCE,
    "weft force": _FORCE,
    "overhang": _LENGTH,
    "chord angle": ANGLE,
}

# Alternative names of the columns.
_ALSO = {"angle": "shear angle", "extension": "displacement", "load": "force"}

# Largest magnitude of a test value, and smallest nonzero one: values are squared.
_LARGEST, _SMALLEST = 1e50, 1e-50

_SPACES = re.compile(r"[\s_]+")


def read_curve(
    path: str | os.PathLike[str],
    units: Mapping[str, str] | None = None,
    gaps: bool = False,
) -> dict[str, ndarray]:
    """Columns of a test, in mm, N, radians, N/mm, and strains as numbers.

    The first row names the columns, with their units in round or square brackets:
    ``displacement (mm),force (N)``, in any order.  `COLUMNS` lists the names; other
    columns are ignored.

    Parameters
    ----------
    path
        The file, in UTF-8.
    units
        Units of columns by name; they take precedence over the first row.
    gaps
        If True, cells may be empty; they become nan.

    Returns
    -------
    dict of ndarray
        Columns by name, each of shape (n_points,).

    Raises
    ------
    ValueError
        If the file is not valid; one line names the file and the row or column.
    OSError
        If it cannot be read.
    """
    file, lines = read_lines(path)
    header = lines[0][1]
    positions: dict[str, tuple[int, float]] = {}
    for i, cell in enumerate(header):
        heading = HEADING.fullmatch(cell)
        word, unit = (heading[1], heading[2]) if heading else (cell, "")
        if (name := column_named(word)) not in COLUMNS:
            continue
        if name in positions:
            raise ValueError(
                f"{file}, row 1: two columns are named {name!r}: keep one of them"
            )
        positions[name] = i, _factor(file, name, (units or {}).get(name, unit))
    if not positions:
        raise ValueError(
            f"{file}, row 1: the header must name at least one of "
            f"{', '.join(COLUMNS)}, got '{excerpt(','.join(header))}'"
        )
    if len(lines) < 2:
        raise ValueError(f"{file}: the file contains no rows of numbers")
    rows = [_numbers(file, *line, positions.values(), gaps) for line in lines[1:]]
    columns = dict(zip(positions, np.transpose(rows), strict=True))
    for name, column in columns.items():
        of: Resistance = "shear" if COLUMNS[name] is ANGLE else "tension"
        unit_is_one = positions[name][1] == 1  # radians, or a ratio
        if unit_is_one and COLUMNS[name] in (ANGLE, _STRAIN):
            for (line, _), x in zip(lines[1:], column, strict=True):
                refuse_other_units(f"{file}, row {line}: {name}", x, of)
    return columns


def read_test(
    path: str | os.PathLike[str], units: Mapping[str, str] | None, *needed: str
) -> tuple[str, dict[str, ndarray]]:
    """File name and columns of a test; the columns ``needed`` must exist."""
    columns, name = read_curve(path, units), Path(path).name
    for column in needed:
        if column not in columns:
            raise ValueError(f"{name}: the column {column!r} is missing")
    return name, columns


def column_named(word: str) -> str:
    """Name of a column in `COLUMNS`, from a name or an alternative name."""
    name = _SPACES.sub(" ", word.strip().lower())
    return _ALSO.get(name, name)


def _factor(file: str, name: str, unit: str) -> float:
    allowed = COLUMNS[name]
    if unit in allowed:
        return allowed[unit]
    if unit in {u for other, units in COLUMNS.items() if other != name for u in units}:
        raise ValueError(
            f"{file}: the unit of the column {name!r} must be one of "
            f"{', '.join(allowed)}, got '{unit}': check whether columns are swapped"
        )
    found = f"got '{excerpt(unit)}'" if unit else "and it has none"
    raise ValueError(
        f"{file}: the unit of the column {name!r} must be one of {', '.join(allowed)}, "
        f"{found}: specify it in the header, such as '{name} ({next(iter(allowed))})', "
        "or with --unit"
    )


def _numbers(
    file: str,
    line: int,
    row: list[str],
    columns: Iterable[tuple[int, float]],
    gaps: bool,
) -> list[float]:
    try:
        return [
            np.nan if gaps and not row[i].strip() else _finite(row[i], factor)
            for i, factor in columns
        ]
    except (ValueError, IndexError):
        raise ValueError(
            f"{file}, row {line}: expected finite numbers below {_LARGEST:g}, got "
            f"'{excerpt(','.join(row))}'"
        ) from None


def _finite(cell: str, factor: float) -> float:
    number = number_of_text(cell) * factor
    if not abs(number) < _LARGEST:
        raise ValueError
    return number if abs(number) > _SMALLEST else 0.0


# Initial range of a curve: its share of the whole range, the minimum number of points,
# and the largest share covered by these.  Chosen: a curve is nearly straight there.
_BEGINNING, _FEWEST, _FARTHEST = 0.2, 5, 0.35

# Largest distance of the first point from rest, relative to the range.
_FIRST = 0.06

# Thresholds for reporting a force at rest: relative to the largest force, and in
# standard deviations.  Chosen: noise exceeds it in one of a million curves.
_SHARE, _DEVIATIONS = 0.05, 5.0

# A curve begins late if its first point is beyond this share of the range, with less
# than this share of the largest force.
_LATE, _NOTHING = 0.2, 0.05

# Relative difference below which steps are equal; they are unequal above ten times
# this.
_EQUAL, _UNEQUAL = 0.02, 0.2

# Minimum number of steps for this check.
_FEWEST_STEPS = 8


def force_at_rest(x: ndarray, force: ndarray) -> float:
    """Force of a curve at 0; 0 if it may be noise.

    It is the intercept of a straight line through the beginning.  The noise is the
    larger of the values from second differences and from the line.  If a parabola, or
    the mean of the first two points, gives less than half of this force, the curve
    rises steeply from rest, as with friction in a frame, and has no force at rest.
    """
    order = np.argsort(x, kind="stable")
    x, force = x[order], force[order]
    end = float(x[-1])
    n = max(int(np.sum(x <= _BEGINNING * end)), _FEWEST)
    if len(x) <= n or not abs(x[0]) <= _FIRST * end or x[n - 1] > _FARTHEST * end:
        return 0.0
    z, f = x[:n] / end, force[:n]
    if not np.all(np.diff(z) > 0):
        return 0.0
    line, parabola = (np.polynomial.Polynomial.fit(z, f, d) for d in (1, 2))
    intercept, curved = float(line(0.0)), float(parabola(0.0))
    of_line = np.sqrt(np.sum((f - line(z)) ** 2) / (n - 2))
    of_curve = np.sqrt(np.mean(np.diff(force, 2) ** 2) / 6)
    spread = np.sqrt(1 / n + z.mean() ** 2 / np.sum((z - z.mean()) ** 2))
    least = max(
        _SHARE * float(np.abs(force).max()),
        _DEVIATIONS * spread * max(of_line, of_curve),
    )
    signed = np.sign(intercept) * np.array([curved, f[:2].mean()])
    steep = signed.min() < 0.5 * abs(intercept)
    return intercept if abs(intercept) > least and not steep else 0.0


def seems_swapped(driven: ndarray, force: ndarray) -> bool:
    """True if forces increase in equal steps, and the driving quantity does not.

    Testing machines move in equal steps: columns may be swapped, or the test is
    force-controlled.
    """
    if len(force) <= _FEWEST_STEPS or np.diff(force).min() <= 0:
        return False
    return _unevenness(force) < _EQUAL and _unevenness(driven) > _UNEQUAL


def rest_notes(name: str, x: ndarray, force: ndarray) -> list[str]:
    """Note on a curve, given by name, with a force at rest or a late beginning."""
    first = np.abs(force[np.argsort(x, kind="stable")][:2]).max()
    if x.min() > _LATE * x.max() and first < _NOTHING * np.abs(force).max():
        return [
            f"{name}: the curve begins far from rest with virtually no force: measure "
            "displacements from the point at which the fabric begins to carry load"
        ]
    offset = force_at_rest(x, force)
    if not offset:
        return []
    share = 100 * abs(offset) / np.abs(force).max()
    return [
        f"{name}: the force at rest is about {offset:.3g} N, {share:.0f} % of the "
        "largest force, and no law represents it: subtract the weight of clamps, "
        "friction and pretension before the fit"
    ]


def _unevenness(values: ndarray) -> float:
    """Largest deviation of a step from the mean step, relative to it."""
    steps = np.diff(values)
    mean = abs(steps.mean())
    return float(np.abs(steps - steps.mean()).max() / mean) if mean else np.inf
