"""Damaged tables of laws, directions and curves are rejected, or read as written."""

import re
from functools import partial
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from skfem_textile import Tabulated
from skfem_textile.calibration import Format, read_recordings
from skfem_textile.io import read_directions
from tests.helpers.hostile import (
    RIGHT,
    Family,
    expect,
    expect_close,
    rejected_if_damaged,
    seeds,
)
from tests.helpers.hostile.damage import damaged

# Columns, and the factors of their units to radians, strains, N/mm, mm and N.
UNITS = {
    "shear angle": {"deg": np.pi / 180, "rad": 1.0},
    "moment": {"N mm/mm2": 1.0, "N/mm": 1.0},
    "fibre strain": {"-": 1.0, "%": 0.01},
    "tension": {"N/mm": 1.0, "kN/m": 1.0},
    "displacement": {"mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4},
    "force": {"N": 1.0, "kN": 1e3, "cN": 0.01, "lbf": 4.4482216152605},
}

# The same with other names and units, which damage may write.
ALSO = {
    **{"angle": "shear angle", "shear moment": "moment", "load": "force"},
    **{"extension": "displacement", "degrees": "deg", "radians": "rad", "1": "-"},
}

# Divisor of larger numbers, which exceed strains and angles.
BOUNDED = {"-": 25.0, "rad": 20.0}

DIRECTIONS = ("element", "warp_angle_deg", "weft_angle_deg")
HEADING = re.compile(r"(.*?)\((.*?)\)")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def law(path):
    return dict(enumerate(Tabulated.from_csv(path, extrapolation="linear").points))


def directions(path):
    read = read_directions(path)
    return dict(zip(DIRECTIONS[1:], (read.warp, read.weft), strict=True))


def curve(path):
    """Columns of a curve in the known format, and what is said of its reading."""
    signs = {"displacement": 1, "force": 1}
    form = Format(encoding="utf-8-sig", separator=",", decimal=".", signs=signs)
    (recording,) = read_recordings(path, form)
    complete = recording.complete(*recording.columns)
    return dict(complete.columns), complete


KINDS = {
    ("shear angle", "moment"): law,
    ("fibre strain", "tension"): law,
    DIRECTIONS: directions,
    ("displacement", "force"): curve,
    ("force", "shear angle", "displacement"): curve,
}


@st.composite
def tables(draw, names):
    """A damaged table with columns of these names, which rise from 0."""
    rng = np.random.default_rng(draw(seeds))
    n = int(rng.integers(2, 7))
    rows = np.cumsum(rng.uniform(0.1, 4.0, (n, len(names))), axis=0).round(3)
    headings = list(names)
    if names == DIRECTIONS:
        rows[:, 0] = np.arange(1, n + 1)
    else:
        rows[0] = 0.0
        units = [str(rng.choice(list(UNITS[name]))) for name in names]
        headings = [f"{name} ({u})" for name, u in zip(names, units, strict=True)]
        rows = rows / [BOUNDED.get(unit, 1.0) for unit in units]
    lines = [headings, *[[f"{x:g}" for x in row] for row in rows]]
    end = str(rng.choice(["\n", "\r\n"]))
    return names, *draw(damaged((end.join(map(",".join, lines)) + end).encode()))


def attempt(table):
    names, content, damage = table
    path = Path("table.csv")
    path.write_bytes(content)
    try:
        read = KINDS[names](path)
    except ValueError as error:
        return rejected_if_damaged(error, damage)
    text = content.decode("utf-8-sig")
    if '"' in text:
        return RIGHT  # quotes may hide commas and ends of lines
    lines = [line.split(",") for line in re.split(r"\r\n|\n|\r", text)]
    if isinstance(read, tuple):
        read, recording = read
        expected_of = partial(stated_column, recording, lines)
    else:
        header, *lines = [line for line in lines if any(map(str.strip, line))]
        expected_of = partial(plain_column, header, lines)
    for key, column in read.items():
        expected = expected_of(key)
        expect(np.isfinite(column).all(), f"{key}: {column}")
        expect(np.shape(column) == expected.shape, f"{key}: {column}, not {expected}")
        expect_close(key, column, expected, 1e-12 * (1 + np.abs(expected)).max())
    return RIGHT


def stated_column(recording, lines, key):
    """The numbers of a column, by the position and unit that the recording states."""
    stated = re.search(
        rf"{key} from column (\d+) \((?:.*?, )??([^ ,()]+)\)", recording.statements[0]
    )
    position, unit = int(stated[1]) - 1, ALSO.get(stated[2], stated[2])
    cells = [lines[row - 1][position].strip() for row in recording.rows]
    expect(all(map(NUMBER.fullmatch, cells)), f"{cells} were taken for numbers")
    # Lines without a digit are headings of further segments, or text.
    below = map(",".join, lines[recording.rows[0] - 1 :])
    others = len([line for line in below if re.search(r"\d", line)]) - len(cells)
    named = any("left out" in said for said in recording.statements)
    expect(others == 0 or named, "rows were left out silently")
    return np.array(cells, dtype=float) * UNITS[key][unit]


def plain_column(header, lines, key):
    """The numbers of a column, in the units of the library."""
    names = [named(cell.strip()) for cell in header]
    column = key if isinstance(key, int) else [name for name, _ in names].index(key)
    cells = [line[column].strip() for line in lines]
    expect(all(map(NUMBER.fullmatch, cells)), f"{cells} were taken for numbers")
    name, unit = names[column]
    numbers = np.array(cells, dtype=float) * UNITS.get(name, {unit: 1.0})[unit]
    if key not in DIRECTIONS:
        return numbers
    order = np.argsort(
        np.array([line[names.index(("element", ""))] for line in lines], float)
    )
    angles = np.radians(numbers[order])
    return np.array([np.cos(angles), np.sin(angles)])


def named(cell):
    """Name and unit of a heading."""
    heading = HEADING.fullmatch(cell)
    if not heading:
        return cell, ""
    name = re.sub(r"[\s_]+", " ", heading[1].strip().lower())
    unit = heading[2].strip()
    return ALSO.get(name, name), ALSO.get(unit, unit)


FAMILY = Family(
    "tables", {"": st.sampled_from(list(KINDS)).flatmap(tables)}, attempt, 3000
)


def test_a_damaged_table_is_rejected_or_read_as_written():
    FAMILY.check(40)
