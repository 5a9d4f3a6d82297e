"""Recordings of tests, from the files of testing machines.

Missing information is determined from the content of a file, and stated; an option
overrules each decision.  A file that allows two readings is refused with both.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...fabric.law import Resistance, refuse_other_units
from ...fabric.laws.tabulated import ANGLE, CURVATURE
from ...mesh.user_input import errors_in, excerpt, printable
from .layout import (
    SEPARATORS,
    Block,
    Line,
    blocks_of,
    column_headings,
    read_text,
    separator_of,
)
from .motion import (
    Segment,
    driving_in,
    explained,
    falls,
    goes_on,
    is_no_motion,
    is_noise,
    jumps_back,
    label_of,
    moved_in,
    turned_columns,
)
from .numbers import MARKS, decimal_mark, is_number, number
from .quantities import (
    COLUMNS,
    FORCES,
    UNITLESS,
    column_named,
    quantity_of,
    split_heading,
)

# Endings of the files of a folder that are read.
_ENDINGS = (".csv", ".txt", ".tsv", ".dat", ".asc")

# Largest share of rows without a number: above it, the layout is not understood.
_FAULTY = 0.1

# Number of rows that a statement lists.
_LISTED = 5

# Share of the longest table below which a table beside the segments contains results,
# such as maxima.
_SHORT = 0.2


@dataclass(frozen=True)
class Format:
    """Properties of a file that take precedence over its content.

    Parameters
    ----------
    encoding
        Encoding, such as ``latin-1``.
    separator
        Separator of the columns: a character, or ``tab`` or ``space``.
    decimal
        Decimal mark, ``.`` or ``,``.
    columns
        Column of a quantity of `COLUMNS`: its number from 1 on, or its heading.
    units
        Unit of a quantity.
    signs
        Sign of a quantity, 1 or -1: its numbers are multiplied by it.

    Raises
    ------
    ValueError
        If a name is not a quantity, or a property is unknown.
    """

    encoding: str | None = None
    separator: str | None = None
    decimal: str | None = None
    columns: Mapping[str, int | str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    signs: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for option, given in (
            ("column", self.columns),
            ("unit", self.units),
            ("sign", self.signs),
        ):
            for name in given:
                if name not in COLUMNS:
                    raise ValueError(
                        f"--{option} {name}: unknown column: choose one of "
                        f"{', '.join(COLUMNS)}"
                    )
        if self.separator is not None and self.character not in SEPARATORS:
            raise ValueError(
                "the separator must be one of ; , | tab space, got "
                f"{printable(self.separator)!r}"
            )
        if self.decimal is not None and self.decimal not in MARKS:
            raise ValueError(
                f"the decimal mark must be . or , but got {printable(self.decimal)!r}"
            )

    @property
    def character(self) -> str | None:
        """Separator as a character."""
        names = {"tab": "\t", "space": " ", "\\t": "\t"}
        return names.get(self.separator or "", self.separator)


@dataclass(frozen=True, eq=False)
class Recording:
    """Columns of one test as recorded, in mm, N, radians, N/mm, and strains as numbers.

    Attributes
    ----------
    name
        Name of the test: of its file, with a number for several tests in one file.
    columns
        Values by the names of `COLUMNS`, each of shape (n,); nan for an empty cell.
    rows
        Line of each value in the file, shape (n,).
    statements
        Description of the reading, and which rows contain no numbers.
    """

    name: str
    columns: Mapping[str, ndarray]
    rows: ndarray
    statements: tuple[str, ...]

    def column(self, name: str) -> ndarray:
        """A column that must exist.

        Raises
        ------
        ValueError
            If it is missing.
        """
        if name not in self.columns:
            raise ValueError(
                f"{self.name}: the column {name!r} is missing: name it in the file, or "
                f"specify it, such as --column {_option(name)}=2"
            )
        return self.columns[name]

    def select(self, rows: ndarray, *statements: str) -> "Recording":
        """Recording of selected rows, a mask or indices, with further statements."""
        columns = {name: column[rows] for name, column in self.columns.items()}
        said = (*self.statements, *statements)
        return Recording(self.name, columns, self.rows[rows], said)

    def complete(self, *names: str) -> "Recording":
        """Recording of the rows with numbers in all of these columns.

        Raises
        ------
        ValueError
            If a column is missing, or contains no number.
        """
        known = np.all([np.isfinite(self.column(name)) for name in names], axis=0)
        if not known.any():
            raise ValueError(f"{self.name}: the file contains no rows of numbers")
        if known.all():
            return self
        return self.select(
            known, f"{rows_text(self.rows[~known])} without numbers: left out"
        )


def rows_text(rows: Sequence[int] | ndarray) -> str:
    """Rows of a file in a sentence, such as ``rows 3, 7``."""
    listed = ", ".join(str(int(row)) for row in rows[:_LISTED])
    more = len(rows) - _LISTED
    rest = f" and {more} more" if more > 0 else ""
    return f"row{'s' if len(rows) > 1 else ''} {listed}{rest}"


def read_recordings(
    path: str | os.PathLike[str], form: Format | None = None
) -> list[Recording]:
    r"""Recordings of a file, or of all files of a folder.

    A file contains one test or several, one below the other or side by side.  Its
    encoding, separator, decimal mark, headings, columns, units and signs are
    determined from its content.

    Parameters
    ----------
    path
        File or folder.
    form
        Properties that take precedence over the content.

    Returns
    -------
    list of Recording

    Raises
    ------
    ValueError
        If a file is not a table of a test, or allows two readings; one line names the
        file, and the option that decides.
    OSError
        If it cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> file = Path("pull.csv")
    >>> _ = file.write_text("Weg;Kraft\nmm;kN\n0,0;0,0\n1,5;0,25\n")
    >>> (recording,) = read_recordings(file)
    >>> recording.columns["force"]
    array([  0., 250.])
    >>> for part in recording.statements[0].split(", force"):
    ...     print(part)
    read: separator semicolon, decimal comma, displacement from column 1 (Weg, mm)
     from column 2 (Kraft, kN)
    """
    path, form = Path(path), form or Format()
    files = [path]
    if path.is_dir():
        files = sorted(x for x in path.iterdir() if x.suffix.lower() in _ENDINGS)
    if not files:
        raise ValueError(
            f"{printable(path)}: the folder contains no file *{', *'.join(_ENDINGS)}"
        )
    return [one for file in files for one in _File(file, form).recordings()]


@dataclass(frozen=True)
class _Column:
    """Position, heading, quantity and unit of a column; ``named`` by its heading."""

    position: int
    heading: str
    quantity: str
    unit: str
    named: bool

    @property
    def label(self) -> str:
        """The column in a message."""
        called = f" ('{excerpt(self.heading)}')" if self.heading else ""
        return f"column {self.position + 1}{called}"


class _File:
    """One file: its layout, then its columns, then numbers."""

    def __init__(self, path: Path, form: Format) -> None:
        self.path, self.form, self.file = path, form, printable(path)
        self.text, self.encoding = read_text(path, form.encoding)
        self._units: dict[str, str] = {}  # of headings, for tables without units
        if not self.text.removeprefix("\ufeff").strip():
            raise ValueError(f"{self.file}: the file is empty")

    @cached_property
    def separator(self) -> str:
        """Separator of the columns."""
        return self.form.character or separator_of(self.text)

    @cached_property
    def blocks(self) -> list[Block]:
        """Blocks of numbers; short ones only if they may be segments of a test."""
        blocks = blocks_of(self.text, self.separator)
        if not blocks:
            raise ValueError(f"{self.file}: the file contains no rows of numbers")
        least = _SHORT * max(len(block.rows) for block in blocks)
        known = [_names(block) for block in blocks if len(block.rows) >= least]
        return [x for x in blocks if len(x.rows) >= least or _names(x) in known]

    @cached_property
    def decimal(self) -> str:
        """Decimal mark."""
        if self.form.decimal is not None:
            return self.form.decimal
        cells = (
            cell
            for block in self.blocks
            for _, row in block.rows
            for cell in row
            if is_number(cell)
        )
        with errors_in(f"{self.file}: "):
            return decimal_mark(cells, self.separator)

    def recordings(self) -> list[Recording]:
        """Tests of the file, each of one table or of several segments."""
        parts = [part for block in self.blocks for part in self._parts(block)]
        tables = [self._tables(block) for block in parts]
        below = (list(filter(None, each)) for each in zip_longest(*tables))
        tests = [test for each in below for test in _joined(each)]
        longest = max(_length(test) for test in tests)
        tests = [test for test in tests if _length(test) >= _SHORT * longest]
        tests.sort(key=lambda test: (test[0].read.rows[0], test[0].place))
        found = []
        for i, test in enumerate(tests, start=1):
            name = f"{self.path.name}, test {i}" if len(tests) > 1 else self.path.name
            recording = _whole(name, test)
            self._refuse_noise(recording, test)
            found.append(_with_directions(recording, self.form))
        return found

    def _refuse_noise(self, recording: Recording, test: Sequence["_Table"]) -> None:
        """An error if a driving quantity or the force of a test is noise."""
        name, columns = recording.name, recording.columns
        labels = {column.quantity: column.label for column in test[0].columns}
        forces = [columns[key] for key in FORCES if key in columns]
        for key in driving_in(columns) if forces else ():
            if is_no_motion(columns[key], forces):
                raise ValueError(
                    f"{name}: {labels[key]} contains noise, not {key}: its trend "
                    "is not larger than its scatter, and the force does not depend on "
                    f"it: {self._instead(key, test, forces)}"
                )
            if "force" in columns and is_noise(columns["force"], columns[key]):
                raise ValueError(
                    f"{name}: {labels['force']} contains noise, not the force "
                    f"of the test: it does not depend on the {key}: specify another "
                    "column, such as --column force=2"
                )

    def _instead(
        self, quantity: str, test: Sequence["_Table"], forces: Sequence[ndarray]
    ) -> str:
        """Advice to specify a column that may be a quantity, if there is one."""
        units, found = COLUMNS[quantity], {}
        for column in self._columns(test[0].block):
            if column.unit not in units or column in test[0].columns:
                continue
            rows = [row for table in test for row in table.block.rows]
            values = self._numbers(rows, column.position)
            if values.size != forces[0].size or is_no_motion(values, forces):
                continue
            found[column] = explained(forces[0], values)
        if not found:
            return f"specify another column, such as --column {_option(quantity)}=1"
        best = max(found, key=lambda column: found[column])
        return f"use {best.label} with --column {_option(quantity)}={best.position + 1}"

    def _parts(self, block: Block) -> list[Block]:
        """A block, cut at blank lines or titles below which another test begins.

        Its displacement jumps back there, or a title names another specimen.
        """
        lines = np.array([line for line, _ in block.rows])
        gaps = np.flatnonzero(np.diff(lines) > 1) + 1
        if not gaps.size:
            return [block]
        moved = moved_in(self._recording(block, self._repeats(block)[0]).columns)
        if moved.size != lines.size:
            return [block]
        parts, begin, label = [block], 0, label_of([x for _, x in block.titles])
        for gap in gaps.tolist():
            titles = [x for x in block.faulty if lines[gap - 1] < x[0] < lines[gap]]
            name = label_of([cells for _, cells in titles])
            back = jumps_back(moved[begin:gap], moved[gap], float(np.ptp(moved)))
            if back or name not in ("", label):
                parts[-1:] = parts[-1].cut(int(lines[gap]), titles)
                begin, label = gap, name
        return parts

    def _tables(self, block: Block) -> list["_Table"]:
        """Tables of a block, beside one another, with rows."""
        label = label_of([cells for _, cells in block.titles])
        repeats = self._repeats(block)
        used = {column.position for columns in repeats for column in columns}
        others = {
            i: self._numbers(block.rows, i)
            for i in range(block.width if len(self.blocks) > 1 else 0)
            if i not in used
        }
        found = []
        for place, columns in enumerate(repeats):
            read = self._recording(block, columns)
            if len(read.rows) or len(self.blocks) == 1:
                moved = moved_in(read.columns)
                found.append(_Table(moved, others, label, read, place, block, columns))
        return found

    def _repeats(self, block: Block) -> list[list[_Column]]:
        """Columns of each test of a block."""
        columns = self._columns(block)
        by_quantity: dict[str, list[_Column]] = {}
        for column in columns:
            if column.quantity:
                by_quantity.setdefault(column.quantity, []).append(column)
        for name, given in self.form.columns.items():
            chosen = columns[self._position(columns, given)]
            for found in by_quantity.values():
                found[:] = [one for one in found if one.position != chosen.position]
            by_quantity[name] = [replace(chosen, quantity=name, named=True)]
        for name, found in by_quantity.items():
            if len(named := [one for one in found if one.named]) and len(found) > 1:
                by_quantity[name] = named
        by_quantity = {name: found for name, found in by_quantity.items() if found}
        if not by_quantity:
            raise ValueError(self._no_columns(columns, block))
        counts = {len(found) for found in by_quantity.values()}
        if len(counts) == 1 and len(by_quantity) > 1:
            return [list(one) for one in zip(*by_quantity.values(), strict=True)]
        for name, found in by_quantity.items():
            if len(found) > 1:
                raise ValueError(
                    f"{self.file}: {' and '.join(one.label for one in found)} may each "
                    f"be the {name}: specify one, such as --column "
                    f"{_option(name)}={found[0].position + 1}"
                )
        return [[found[0] for found in by_quantity.values()]]

    def _columns(self, block: Block) -> list[_Column]:
        columns = []
        for i, (heading, unit) in enumerate(column_headings(block)):
            name, own = split_heading(heading)
            unit = own or split_heading(f"({unit})")[1] if unit or own else ""
            unit = self._units.setdefault(name, unit) if name and not unit else unit
            self._units[name] = unit
            quantity, named = quantity_of(name, unit)
            columns.append(_Column(i, name, quantity, unit, named))
        return columns

    def _numbers(self, rows: Sequence[Line], position: int) -> ndarray:
        """Numbers of a column; nan for other cells."""
        return np.array([number(cells[position], self.decimal) for _, cells in rows])

    def _position(self, columns: Sequence[_Column], given: int | str) -> int:
        if isinstance(given, int):
            if 1 <= given <= len(columns):
                return given - 1
            raise ValueError(
                f"{self.file}: there are {len(columns)} columns, and no column {given}"
            )
        for column in columns:
            if column.heading.lower() == given.strip().lower():
                return column.position
        headings = ", ".join(repr(excerpt(column.heading)) for column in columns)
        raise ValueError(
            f"{self.file}: no column is named {printable(given)!r}: the columns are "
            f"{headings}"
        )

    def _no_columns(self, columns: Sequence[_Column], block: Block) -> str:
        headings = [excerpt(column.heading) for column in columns if column.heading]
        first = block.rows[0][0]
        if self.separator == "," and self.form.separator is None and not headings:
            return (
                f"{self.file}, row {first}: {block.width} numbers have no headings, or "
                "commas both separate columns and mark decimals: save the file with "
                "semicolons, or specify --separator and --column displacement=1 "
                "--column force=2"
            )
        called = f"are named {', '.join(headings)}" if headings else "have no headings"
        return (
            f"{self.file}, row {first}: the columns {called}: specify which is which, "
            "such as --column displacement=1 --column force=2, or name them in the "
            f"file: {', '.join(COLUMNS)}"
        )

    def _recording(self, block: Block, columns: Sequence[_Column]) -> Recording:
        rows = np.array([line for line, _ in block.rows])
        values, notes, parts = {}, [], []
        filled = np.zeros(len(rows), dtype=bool)
        for column in columns:
            cells = [row[column.position] for _, row in block.rows]
            given = np.array([cell != "" for cell in cells])
            unit = self.form.units.get(column.quantity, column.unit)
            factor = self._factor(column, unit)
            found = factor * self._numbers(block.rows, column.position)
            wrong = np.flatnonzero(np.isnan(found) & given)
            if wrong.size:
                notes.append(
                    f"{rows_text(rows[wrong])}: '{excerpt(cells[wrong[0]])}' is not a "
                    f"number: the {column.quantity} is left out"
                )
            self._refuse_faulty(block, wrong, cells)
            filled |= given
            self._check_unit(column, unit, rows, found)
            sign = self.form.signs.get(column.quantity, 1)
            values[column.quantity] = sign * found
            turned = ", sign turned" if sign < 0 else ""
            called = ", ".join(filter(None, [excerpt(column.heading), unit]))
            parts.append(
                f"{column.quantity} from column {column.position + 1} ({called})"
                f"{turned}"
            )
        if block.faulty:
            lines = [line for line, _ in block.faulty]
            text = excerpt(self.separator.join(block.faulty[0][1]))
            notes.append(
                f"{rows_text(lines)}: no numbers of the table ('{text}'): left out"
            )
        how = [f"separator {SEPARATORS[self.separator]}"] if block.width > 1 else []
        how.append(MARKS[self.decimal])
        if self.encoding not in ("utf-8", "utf-8-sig"):
            how.insert(0, f"encoding {self.encoding}")
        read = f"read: {', '.join([*how, *parts])}"
        kept = filled.nonzero()[0]
        values = {key: column[kept] for key, column in values.items()}
        return Recording(self.path.name, values, rows[kept], (read, *notes))

    def _refuse_faulty(self, block: Block, wrong: ndarray, cells: list[str]) -> None:
        lines: list[Line] = block.faulty
        if wrong.size + len(lines) <= _FAULTY * len(block.rows):
            return
        if wrong.size:
            line, text = block.rows[wrong[0]][0], cells[wrong[0]]
        else:
            line, text = lines[0][0], self.separator.join(lines[0][1])
        raise ValueError(
            f"{self.file}, row {line}: expected {block.width} cells with finite "
            f"numbers, got '{excerpt(text)}': the separator was read as "
            f"{SEPARATORS[self.separator]} and numbers with a {MARKS[self.decimal]}; "
            "specify --separator or --decimal if they differ"
        )

    def _factor(self, column: _Column, unit: str) -> float:
        name, allowed = column.quantity, COLUMNS[column.quantity]
        if unit in allowed:
            return allowed[unit]
        weight, first = f"{unit}f", next(iter(allowed))  # weight of a mass, such as kg
        got = f"got '{excerpt(unit)}'"
        if any(unit in units for units in COLUMNS.values()):
            do = "check whether columns are swapped"
        elif not unit:
            got = "and it has none"
            do = (
                f"specify it, such as --unit {_option(name)}={first}, or in the "
                f"heading, such as '{name} ({first})'"
            )
        elif weight in allowed:
            do = f"use --unit {_option(name)}={weight} for the weight of this mass"
        else:
            do = "convert the column, or specify its unit with --unit if it is wrong"
        raise ValueError(
            f"{self.file}: the unit of the column {name!r} must be one of "
            f"{', '.join(allowed)}, {got}: {do}"
        )

    def _check_unit(
        self, column: _Column, unit: str, rows: ndarray, values: ndarray
    ) -> None:
        allowed = COLUMNS[column.quantity]
        if allowed[unit] != 1 or allowed not in UNITLESS:
            return
        of: Resistance = "shear" if allowed is ANGLE else "tension"
        if allowed is CURVATURE:
            of = "bending"
        for row, x in zip(rows, values, strict=True):
            if np.isfinite(x):
                refuse_other_units(f"{self.file}, row {row}: {column.quantity}", x, of)


@dataclass(frozen=True, eq=False)
class _Table(Segment):
    """A table as read, its place beside other tables, and its columns."""

    read: Recording
    place: int
    block: Block
    columns: Sequence[_Column]


def _names(block: Block) -> frozenset[str]:
    """Quantities of a block by its headings."""
    names = (split_heading(heading) for heading, _ in column_headings(block))
    return frozenset(filter(None, (column_named(name) for name, _ in names)))


def _length(test: Sequence[_Table]) -> int:
    return sum(len(table.read.rows) for table in test)


def _joined(tables: Sequence[_Table]) -> list[list[_Table]]:
    """Tests of tables one below the other, each of one or several segments."""
    moved = np.concatenate([table.moved for table in tables])
    motion = float(np.ptp(moved)) if moved.size else 0.0
    tests: list[list[_Table]] = []
    for table in tables:
        if tests and _continues(tests[-1], table, motion):
            tests[-1].append(table)
        else:
            tests.append([table])
    return tests


def _continues(test: Sequence[_Table], table: _Table, motion: float) -> bool:
    if test[0].read.columns.keys() != table.read.columns.keys():
        return False
    if not table.moved.size or not test[0].moved.size:  # readings
        return table.label in ("", test[-1].label)
    return goes_on(test, table, motion)


def _whole(name: str, test: Sequence[_Table]) -> Recording:
    """Recording of the segments of a test, with what was read of each."""
    parts = [table.read for table in test]
    columns = {
        key: np.concatenate([part.columns[key] for part in parts])
        for key in parts[0].columns
    }
    said = dict.fromkeys(text for part in parts for text in part.statements)
    if len(parts) > 1:
        begins = rows_text([int(part.rows[0]) for part in parts])
        said[f"{len(parts)} tables, from {begins} on, are segments of one test"] = None
    rows = np.concatenate([part.rows for part in parts])
    return Recording(name, columns, rows, tuple(said))


def _option(name: str) -> str:
    """Name of a column on a command line."""
    return f"'{name}'" if " " in name else name


def _with_directions(recording: Recording, form: Format) -> Recording:
    """Recording with forces positive in tension, and displacements along them."""
    turned = turned_columns(recording.columns, form.signs)
    if len(turned) == 2 and "force" in turned and falls(turned["force"]):
        raise ValueError(
            f"{recording.name}: the force is negative and its magnitude decreases from "
            "the first row on, as in unloading with a turned sign, or in a test with a "
            "negative zero of the force: use --sign force=-1 or --sign force=1"
        )
    if not turned:
        return recording
    read, *rest = recording.statements
    names = " and ".join(turned)
    statements = (f"{read}, sign of {names} turned", *rest)
    columns = {**recording.columns, **turned}
    return replace(recording, columns=columns, statements=statements)
