"""Files in the styles of usual testing machines, written from known curves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

#: Force units and their factors from N, and length units from mm.
FORCE_UNITS = {"N": 1.0, "kN": 1e-3, "mN": 1e3, "lbf": 1 / 4.4482216152605}
LENGTH_UNITS = {"mm": 1.0, "cm": 0.1, "m": 1e-3, "in": 1 / 25.4}

# Digits after the decimal mark by unit.
_DIGITS = {
    **{"mm": 4, "cm": 5, "m": 7, "in": 5, "s": 2},
    **{"N": 4, "kN": 7, "mN": 1, "lbf": 5},
}

# Rate of the machine in mm/s, for the column of time.
_RATE = 0.5

#: Columns of a curve: displacement in mm and force in N in the order of recording.
Curve = tuple[ndarray, ndarray]


@dataclass(frozen=True)
class Machine:
    """Style of the export of a testing machine.

    Attributes
    ----------
    preamble
        Lines above the tables, cells separated by tabs.
    headings
        Names of time, displacement and force, in the order of the columns; `order`
        names what they are.
    units
        ``row`` for units in a separate row, ``(`` or ``[`` for brackets in the
        headings, ``in`` for a word.
    separators, decimals, encodings
        Choices of the machine, or of the locale of its computer.
    beside
        True if repeats are side by side, else one below the other.
    title
        Line above a repeat, with its number; empty for none.
    quoted
        True if cells are in quotes.
    """

    preamble: tuple[str, ...]
    headings: tuple[str, ...]
    order: tuple[str, ...]
    units: str
    separators: tuple[str, ...]
    decimals: tuple[str, ...]
    encodings: tuple[str, ...]
    beside: bool = False
    title: str = ""
    quoted: bool = False


#: Machines by name.
MACHINES = {
    "Zwick testXpert": Machine(
        (
            *("Prüfprotokoll", "Kunde:\tTextillabor", "Prüfer:\tMüller"),
            *("Vorkraft\t0,5\tN", "Prüfgeschwindigkeit\t30\tmm/min", ""),
        ),
        ("Prüfzeit", "Standardweg", "Standardkraft"),
        ("time", "displacement", "force"),
        "row",
        (";", "\t"),
        (",",),
        ("latin-1", "utf-8-sig", "utf-16"),
        title="Probe {}",
    ),
    "Instron Bluehill": Machine(
        ("Operator name\tlab", "Specimen width\t100.0\tmm", "Rate 1\t30\tmm/min"),
        ("Time", "Extension", "Load"),
        ("time", "displacement", "force"),
        "(",
        (",", ";"),
        (".", ","),
        ("utf-8", "utf-8-sig"),
        title="Specimen {}",
        quoted=True,
    ),
    "MTS TestSuite": Machine(
        ("MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A", "Data Acquisition: Timed", ""),
        ("Time", "Axial Force", "Axial Displacement"),
        ("time", "force", "displacement"),
        "row",
        ("\t", " "),
        (".",),
        ("utf-8", "latin-1"),
    ),
    "Shimadzu Trapezium": Machine(
        ("Name\tfabric", "Test Mode\tSingle", "Test Type\tTensile"),
        ("Time", "Force", "Stroke"),
        ("time", "force", "displacement"),
        "row",
        (",", "\t"),
        (".",),
        ("utf-8", "utf-16"),
        beside=True,
    ),
    "data acquisition": Machine(
        ("# sampling rate 10 Hz",),
        ("load_cell", "position"),
        ("force", "displacement"),
        "[",
        (" ", "\t", "|"),
        (".", ","),
        ("utf-8",),
    ),
    "spreadsheet": Machine(
        (),
        ("Déplacement", "Charge"),
        ("displacement", "force"),
        "in",
        (";", "\t"),
        (",",),
        ("utf-8-sig", "cp1252", "utf-16"),
        beside=True,
    ),
}


@dataclass(frozen=True)
class Export:
    """Choices of one file; see `Machine`."""

    machine: str
    separator: str
    decimal: str
    encoding: str
    force_unit: str
    length_unit: str
    sign: int

    @classmethod
    def drawn(cls, machine: str, rng: np.random.Generator) -> "Export":
        """Choices at random among the options of the machine."""
        of = MACHINES[machine]
        separator = str(rng.choice(of.separators))
        marks = [mark for mark in of.decimals if mark != separator or of.quoted]
        return cls(
            machine,
            separator,
            str(rng.choice(marks)),
            str(rng.choice(of.encodings)),
            str(rng.choice(list(FORCE_UNITS))),
            str(rng.choice(list(LENGTH_UNITS))),
            int(rng.choice([1, -1])),
        )

    def written(self, curves: Sequence[Curve], with_units: bool = True) -> bytes:
        """The file of some curves."""
        of = MACHINES[self.machine]
        lines = [line.split("\t") for line in of.preamble]
        tables = [self._rows(curve) for curve in curves]
        heads = self._headings(with_units)
        if of.beside:
            lines += [head * len(tables) for head in heads]
            width, longest = len(heads[0]), max(map(len, tables))
            padded = [t + [[""] * width] * (longest - len(t)) for t in tables]
            lines += [
                [cell for row in rows for cell in row]
                for rows in zip(*padded, strict=True)
            ]
        else:
            for i, table in enumerate(tables):
                lines += [[of.title.format(i + 1)]] if of.title else []
                lines += [*heads, *table, [""]]
        between = "  " if self.separator == " " else self.separator
        text = "\r\n".join(between.join(map(self._cell, cells)) for cells in lines)
        return (text + "\r\n").encode(self.encoding)

    def _cell(self, text: str) -> str:
        return f'"{text}"' if MACHINES[self.machine].quoted and text else text

    def _headings(self, with_units: bool) -> list[list[str]]:
        of = MACHINES[self.machine]
        own = {"time": "s", "force": self.force_unit, "displacement": self.length_unit}
        units = [own[quantity] for quantity in of.order]
        if not with_units:
            return [list(of.headings)]
        if of.units == "row":
            return [list(of.headings), units]
        pairs = list(zip(of.headings, units, strict=True))
        if of.units == "in":
            return [[f"{name} in {unit}" for name, unit in pairs]]
        close = {"(": ")", "[": "]"}[of.units]
        gap = "" if self.separator == " " else " "
        return [[f"{name}{gap}{of.units}{unit}{close}" for name, unit in pairs]]

    def _rows(self, curve: Curve) -> list[list[str]]:
        moved, force = curve
        time = np.concatenate([[0.0], np.abs(np.diff(moved)).cumsum()]) / _RATE
        columns = {
            "time": (time, "s"),
            "displacement": (moved * LENGTH_UNITS[self.length_unit], self.length_unit),
            "force": (
                self.sign * force * FORCE_UNITS[self.force_unit],
                self.force_unit,
            ),
        }
        texts = [
            [f"{x:.{_DIGITS[unit]}f}".replace(".", self.decimal) for x in values]
            for values, unit in (
                columns[quantity] for quantity in MACHINES[self.machine].order
            )
        ]
        return [list(row) for row in zip(*texts, strict=True)]
