"""Sweep of a case over values of its keys, and a table of the figures of its runs."""

import logging
import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import structs
from numpy import ndarray

from ..io.file_numbers import word_of, write_table
from ..mesh.progress import shown, unlogged
from ..mesh.user_input import error_text, errors_in, printable
from ..scenes.samples import printed_numbers, run_unlogged
from ..scenes.scene import Case
from ..solve.quantities import IN_PLANE, IN_SPACE
from ..sweep import SweepError, ThisThread, sweep
from .build import built
from .read import (
    CaseFile,
    CaseFileError,
    declared,
    first_name,
    index_of,
    read_tables,
    varied,
    with_value,
)
from .schema import Output
from .write import WrittenCase, tables_of

log = logging.getLogger(__name__)

#: Columns after the figures: linear solves, load factor of the last state, the reason
#: why it is not the whole load, and warnings.
SOLVES, REACHED, REASON, WARNINGS = (
    "linear solves",
    "load factor",
    "reason",
    "warnings",
)

# Relative change of figures that is not an effect of a value.  Chosen: below the digits
# of a terminal, above the tolerance of an equilibrium (1e-5 of the energy lost).
_NO_EFFECT = 1e-4

# Keys that require one run of one case.
_SINGLE = "fabric.samples", "stepping.tolerance"


@dataclass(frozen=True, eq=False)
class Variant:
    """Case with one combination of values.

    Attributes
    ----------
    values
        Values by key.
    file
        Declaration of the case.
    case
        The case.
    """

    values: Mapping[str, Any]
    file: CaseFile
    case: Case

    @property
    def label(self) -> str:
        """The values in one line."""
        return _label(self.values)

    def name(self) -> str:
        """Name of the run in a file of results: it identifies the case."""
        return f"{self.label} of {WrittenCase(self.file).checksum()}"


@dataclass(frozen=True, eq=False)
class CaseSweep:
    """Figures of the runs of a sweep.

    Attributes
    ----------
    vary
        Values by key.
    rows
        A row for each combination of values, in their order: the values by key, the
        figures by name and unit, ``linear solves``, ``load factor``, ``reason`` and
        ``warnings``.  Figures describe the last state, at this load factor; between
        tools that in which a complete run is `Case.described`, for example before the
        punch returns.  A run without a converged step has none.  ``reason`` is
        empty for a run that applied the whole load.
    """

    vary: Mapping[str, tuple[Any, ...]]
    rows: Sequence[Mapping[str, Any]]

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        ends = SOLVES, REACHED, REASON, WARNINGS
        names = dict.fromkeys(name for row in self.rows for name in row)
        return [*(name for name in names if name not in ends), *ends]

    @property
    def compared(self) -> list[str]:
        """Columns that are drawn: force, largest shear angle and wrinkle risk."""
        names = [name for name in self.columns if name not in self.vary]
        angles = [f"{one.name} (°)" for one in (IN_SPACE, IN_PLANE)]
        chosen = [name for name in names if name.endswith("(N)")][:1]
        chosen += [name for name in names if name in angles]
        return chosen + [name for name in names if name.startswith("Wrinkle risk")]

    @property
    def incomplete(self) -> list[str]:
        """A line for each run that did not apply the whole load."""
        return [
            f"{_label({key: row[key] for key in self.vary})}: {row[REASON]}"
            for row in self.in_words
            if row[REASON]
        ]

    @property
    def without_effect(self) -> list[str]:
        """Keys whose values do not change any figure."""
        return [key for key in self.vary if self._has_no_effect(key)]

    def _has_no_effect(self, key: str) -> bool:
        ends = {SOLVES, REACHED, REASON, WARNINGS}
        groups: dict[str, list[dict[str, Any]]] = {}
        for row in self.rows:
            others = repr([row[name] for name in self.vary if name != key])
            figures = {x: row[x] for x in row.keys() - {*self.vary, *ends}}
            groups.setdefault(others, []).extend([figures] * bool(figures))
        pairs = [(rows[0], one) for rows in groups.values() for one in rows[1:]]
        return bool(pairs) and all(
            one.keys() == other.keys()
            and all(np.isclose(one[x], other[x], _NO_EFFECT, 0, True) for x in one)
            for one, other in pairs
        )

    @property
    def in_words(self) -> list[dict[str, Any]]:
        """The rows with a few words for each value that is a table or rows."""
        return [
            {**row, **{key: _word(row[key], of) for key, of in self.vary.items()}}
            for row in self.rows
        ]

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write all rows as CSV.

        Parameters
        ----------
        path
            The file.
        """
        cells = ([_cell(row.get(x)) for x in self.columns] for row in self.rows)
        write_table(path, self.columns, cells)

    @property
    def drawn(self) -> tuple[dict[str, list[Any]], dict[str, ndarray], ndarray]:
        """Arguments of `plot.compared_runs`: values, `compared` figures, complete."""
        values = {
            axis_of(key): [row[key] for row in self.in_words] for key in self.vary
        }
        figures = {
            name: np.array(
                [
                    [row.get(x, np.nan) for row in self.rows]
                    for x in (name, half_width_of(name))
                ]
            )
            for name in self.compared
        }
        complete = np.array([not row[REASON] for row in self.rows])
        return values, figures, complete


# Most characters of a table, or rows, that are shown as they are.
_LONGEST = 16


def _word(value: Any, values: Sequence[Any]) -> Any:
    """Number or word for a value, of tables and rows with its number if it is equal."""
    if isinstance(value, str) or len(str(value)) <= _LONGEST:
        return value
    word = _summarised(value)
    equal = [repr(x) for x in values if _summarised(x) == word]
    return word if len(equal) == 1 else f"{word} ({equal.index(repr(value)) + 1})"


def _summarised(value: Any) -> str:
    """Last value of rows, and the tool whose travel they follow; first of a table."""
    over, rows = "", value
    if isinstance(value, Mapping):
        rows = value.get("rows", ())
        over = f" over {value['travel_of']}" if "travel_of" in value else ""
        if not rows:
            return str(next(iter(value.values()), value))
    if isinstance(rows, list | tuple) and isinstance(rows[-1], list | tuple):
        last = rows[-1][1:]
        return f"to {', '.join(map(str, last))}{over}"
    return str(value)


def half_width_of(column: str) -> str:
    """Name of the column with the half-widths of a figure.

    Examples
    --------
    >>> half_width_of("Punch force (N)")
    'Punch force, half-width (N)'
    """
    words, _, unit = column.rpartition(" (")
    return f"{words}, half-width ({unit}"


def sweep_case(
    case: str | os.PathLike[str] | Mapping[str, Any],
    vary: Mapping[str, Sequence[Any]] | None = None,
    executor: Executor | None = None,
    out: str | os.PathLike[str] | None = None,
    *,
    folder: str | os.PathLike[str] = ".",
) -> CaseSweep:
    """Run a case with each combination of values of some of its keys.

    All cases are built before the first run.

    Parameters
    ----------
    case
        A case file, or tables with its keys and values.
    vary
        At least two values of each key, in the units of a case file, such as
        ``{"scene.fibres_deg": (0, 45), "tools.holder.force_N": (5, 10)}``; in addition
        to a table ``[vary]`` of the case.  A tool is selected by its name, or its
        number from 1; ``tools.*.friction`` is the friction of all tools.
    executor
        See `sweep`; by default `ThisThread`.
    out
        File to which every result is appended at once; finished runs in it are not
        repeated, unless their case or a file of it has changed.
    folder
        Folder to which file names in tables are relative.

    Raises
    ------
    CaseFileError
        If nothing varies, or a case is not valid; the message names its values.
    OSError
        If a file cannot be read.

    Examples
    --------
    >>> tables = {"scene": {"name": "picture_frame"}, "mesh": {"size": (2, 2)}}
    >>> vary = {"shear.stiffness_N_per_mm": (0.2, 0.4)}
    >>> found = sweep_case(tables | {"stepping": {"steps": 1}}, vary)
    >>> low, high = (row["Load (machine) (N)"] for row in found.rows)
    >>> round(high / low, 6)
    2.0
    """
    tables: Mapping[str, Any]
    if isinstance(case, Mapping):
        tables = case
    else:
        tables, folder = read_tables(Path(case)), Path(case).parent
    with errors_in("", CaseFileError):
        of_case = varied(tables.get("vary", {})) | varied(vary or {})
        found = variants({**tables, "vary": of_case}, folder)
        return run_variants(found, executor, out)


def variants(
    tables: Mapping[str, Any], folder: str | os.PathLike[str] = "."
) -> list[Variant]:
    """Build the cases of all combinations of the values in ``vary``.

    Parameters
    ----------
    tables
        Tables of a case.
    folder
        See `declared`.

    Raises
    ------
    ValueError
        See `sweep_case`.
    """
    vary = varied(tables.get("vary", {}))
    if not vary:
        raise ValueError("nothing varies: give a key at least two values, in [vary]")
    base = {name: table for name, table in tables.items() if name != "vary"}
    found: list[Variant] = []
    combinations = [*product(*vary.values())]
    with shown(lambda: f"preparing case {len(found) + 1} of {len(combinations)}"):
        for combination in combinations:
            values = dict(zip(vary, combination, strict=True))
            with errors_in(f"{_label(values)}: "):
                found.append(_variant(base, values, folder, logged=not found))
    _refuse_other_parts(found)
    return found


def _variant(
    base: Mapping[str, Any],
    values: Mapping[str, Any],
    folder: str | os.PathLike[str],
    logged: bool,
) -> Variant:
    """Case with a combination of values; the ply is built to check it."""
    tables = dict(base)
    for key, value in values.items():
        tables = with_value(tables, key, value)
    file = declared(tables, folder)
    for key in _SINGLE:
        table, name = key.split(".")
        if getattr(getattr(file, table), name) is not None:
            raise ValueError(f"{key} does not apply to a sweep: omit it")
    if logged:
        if structs.replace(file.output, pictures=True, describe=None) != Output():
            log.warning("a sweep leaves out the files of [output], except pictures")
        case = built(file)
        case.ply()
    else:
        with unlogged():
            case = built(file)
            case.ply()
    return Variant(values, file, case)


def _refuse_other_parts(found: Sequence[Variant]) -> None:
    """Refuse different computed parts of the ply, unless the parts are compared."""
    ends = [[*one.case.scene.fibre_ends.values()] for one in found]
    parts = {x.count("mirror"): one for x, one in zip(ends, found, strict=True)}
    tools = (tool for one in found for tool in one.case.scene.tools)
    has_force = any(getattr(tool, "force", None) is not None for tool in tools)
    if len(parts) > 1 and (has_force or "scene.part" not in found[0].values):
        one, other = [*parts.values()][:2]
        raise ValueError(
            f"the computed part of the ply, with its mesh and the force of a holder on "
            f"it, is not the same with {one.label} and {other.label}: set scene.part"
        )


def resolved_case(found: Sequence[Variant]) -> CaseFile:
    """Declaration of the first case with all values, in which file names are whole."""
    values: dict[str, dict[str, Any]] = {key: {} for key in found[0].values}
    for one in found:
        tables = tables_of(one.file)
        for key, value in one.values.items():
            values[key].setdefault(repr(value), _value_at(tables, key, value))
    vary = {key: tuple(of_key.values()) for key, of_key in values.items()}
    return structs.replace(found[0].file, vary=vary)


def _value_at(tables: Any, path: str, otherwise: Any) -> Any:
    """Text at a path of tables; any other value as it was given."""
    while path:
        if isinstance(tables, list):
            name, path = first_name(path, [str(one.get("name")) for one in tables])
            tables = tables[index_of(tables, name) or 0]
        elif isinstance(tables, Mapping):
            name, path = first_name(path, tables)
            tables = tables.get(name)
        else:
            return otherwise
    return tables if isinstance(tables, str) else otherwise


def run_variants(
    found: Sequence[Variant],
    executor: Executor | None = None,
    out: str | os.PathLike[str] | None = None,
) -> CaseSweep:
    """Run all cases; parameters as for `sweep_case`."""
    names = [one.name() for one in found]
    numbered = [(i, one.case) for i, one in enumerate(found)]
    key = partial(_name_of, names)
    called = ThisThread() if executor is None else executor
    ends: dict[int, dict[str, Any]] = {}
    with shown(lambda: f"run {len(ends) + 1} of {len(found)}"):
        try:
            for (i, _), end in sweep(_run, numbered, called, out=out, key=key):
                ends[i] = end
        except SweepError as failure:
            for (i, _), error in failure.failed:
                ends[i] = _end(reason=error_text(error))
    vary = {
        name: tuple(
            {repr(one.values[name]): one.values[name] for one in found}.values()
        )
        for name in found[0].values
    }
    rows = [{**one.values, **ends[i]} for i, one in enumerate(found) if i in ends]
    found_all = CaseSweep(vary, rows)
    for name in found_all.without_effect:
        log.warning(
            "the values of %s change no figure by more than %g of it: check that the "
            "case depends on this key",
            printable(name),
            _NO_EFFECT,
        )
    return found_all


def _name_of(names: Sequence[str], numbered: tuple[int, Case]) -> str:
    return names[numbered[0]]


def _run(numbered: tuple[int, Case]) -> dict[str, Any]:
    """Row of a run, without its values."""
    case = numbered[1]
    result, summary, reason = run_unlogged(case)
    if result is None:
        return _end(reason=reason)
    return {
        **_figures(summary),
        **_end(
            result.states[-1].load_factor,
            reason,
            result.linear_solves,
            "; ".join(summary.get("warnings", ())),
        ),
    }


def _end(
    reached: float = 0.0, reason: str = "", solves: int = 0, warnings: str = ""
) -> dict[str, Any]:
    return {SOLVES: solves, REACHED: reached, REASON: reason, WARNINGS: warnings}


def _figures(summary: Mapping[str, Any]) -> dict[str, float]:
    """Quantities that are printed first, by name and unit, and their half-widths."""
    figures: dict[str, float] = {}
    for one in printed_numbers(summary):
        scale = 100.0 if one.unit == "%" else 1.0
        name = f"{one.name} ({one.unit})"
        columns = {name: one.key}
        if one.has_interval:
            columns[half_width_of(name)] = f"{one.key}_half_width"
        for column, key in columns.items():
            value = summary.get(key)
            if isinstance(value, int | float):
                figures[column] = scale * value
    return figures


def _cell(value: Any) -> Any:
    """Cell of a table: numbers with 12 digits, other values as text."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return word_of(value) if is_number or value is None else str(value)


def _label(values: Mapping[str, Any]) -> str:
    """Values of keys in one line."""
    return ", ".join(f"{key}={printable(value)}" for key, value in values.items())


# Units at the ends of keys, and how they are written.
_UNITS = {
    "_N_per_mm2": "N/mm²",
    "_N_per_mm": "N/mm",
    "_N_mm": "N·mm",
    "_deg": "°",
    "_mm": "mm",
    "_N": "N",
}


def axis_of(key: str) -> str:
    """Key as the label of an axis, with its unit.

    Examples
    --------
    >>> axis_of("tools.holder.force_N"), axis_of("scene.fibres_deg")
    ('Holder force (N)', 'Fibres (°)')
    >>> axis_of("phases.up.tools.punch.friction")
    'Punch friction in phase up'
    >>> axis_of("phases.up.tools.holder.force_N")
    'Holder force in phase up (N)'
    """
    if key.startswith("phases."):
        _, phase, inner = key.split(".", 2)
        words, of, unit = axis_of(inner).partition(" (")
        return f"{words} in phase {phase}{of}{unit}"
    words = key.removeprefix("scene.").removeprefix("tools.").replace("*.", "")
    end = next((end for end in _UNITS if words.endswith(end)), "")
    text = words.removesuffix(end).replace(".", " ").replace("_", " ")
    return text[:1].upper() + text[1:] + (f" ({_UNITS[end]})" if end else "")


def legible(rows: Iterable[Mapping[str, Any]], names: Sequence[str]) -> list[list[str]]:
    """Cells of columns with four digits, for a terminal or a page."""
    return [
        [
            f"{row[name]:.4g}"
            if isinstance(row.get(name), float)
            else printable(row.get(name, ""))
            for name in names
        ]
        for row in rows
    ]
