"""Rows of results as CSV, JSON and Markdown tables, and formatted numbers."""

import csv
import io
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import isfinite, nan
from statistics import median as middle
from typing import Any, TypeAlias

#: A JSON-serialisable result: numbers, text, lists and dicts.
Row: TypeAlias = dict[str, Any]

#: Content of a column: a format of the entries of a row, or a function of the row.
Column: TypeAlias = str | Callable[[Row], object]

_WORDS = {"": None, "None": None, "True": True, "False": False}
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def csv_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV, with one column for each key in any row.

    Examples
    --------
    >>> csv_table([{"a": 1}, {"a": 2, "b": 0.5}]).splitlines()
    ['a,b', '1,', '2,0.5']
    """
    text = io.StringIO()
    columns = list(dict.fromkeys(key for row in rows for key in row))
    writer = csv.DictWriter(text, fieldnames=columns)
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def rows_of_csv(text: str) -> list[Row]:
    r"""Parse the text of `csv_table`: numbers, booleans, text; empty cells are None.

    A number in another format than `csv_table` writes remains text.

    Examples
    --------
    >>> rows_of_csv("a,b,c\n1,,True\n2,0.5,5e-1\n")
    [{'a': 1, 'b': None, 'c': True}, {'a': 2, 'b': 0.5, 'c': '5e-1'}]
    """
    rows = csv.DictReader(io.StringIO(text))
    return [{key: _value(cell) for key, cell in row.items()} for row in rows]


def _value(text: str) -> Any:
    """The value of a cell written by `csv_table`."""
    if text in _WORDS:
        return _WORDS[text]
    for number in (int, float):
        try:
            value = number(text)
        except ValueError:
            continue
        return value if str(value) == text else text
    return text


def json_text(content: Any) -> str:
    """Content as JSON; raises ValueError for nan, which JSON does not support."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def having(rows: Iterable[Row], **entries: Any) -> list[Row]:
    """The rows with these entries."""
    return [row for row in rows if entries.items() <= row.items()]


def grouped(rows: Iterable[Row], *keys: str) -> dict[Any, list[Row]]:
    """Rows grouped by the value of a key, or by tuples of the values of several keys.

    Examples
    --------
    >>> rows = [{"a": 1, "b": 2}, {"a": 1, "b": 3}]
    >>> list(grouped(rows, "a")), list(grouped(rows, "a", "b"))
    ([1], [(1, 2), (1, 3)])
    """
    groups: dict[Any, list[Row]] = {}
    for row in rows:
        entries = tuple(row.get(key) for key in keys)
        groups.setdefault(entries if keys[1:] else entries[0], []).append(row)
    return groups


def markdown_table(head: Iterable[object], lines: Iterable[Iterable[object]]) -> str:
    """A Markdown table.

    Examples
    --------
    >>> print(markdown_table(["n", "N"], [[1, "0.5"]]), end="")
    | n | N |
    |---|---|
    | 1 | 0.5 |
    """
    text = [f"| {' | '.join(map(str, line))} |" for line in ([*head], *lines)]
    text.insert(1, "|" + "---|" * (text[0].count(" | ") + 1))
    return "\n".join(text) + "\n"


def table(rows: Iterable[Row], columns: Mapping[str, Column]) -> str:
    """A Markdown table with a line for each row, and columns by heading.

    Examples
    --------
    >>> columns = {"n": "{n}", "load": "{load:.1f} N", "twice": lambda r: 2 * r["n"]}
    >>> print(table([{"n": 1, "load": 3.0}, {"n": 2, "load": None}], columns), end="")
    | n | load | twice |
    |---|---|---|
    | 1 | 3.0 N | 2 |
    | 2 | - | 4 |
    """
    lines = [[cell(row, column) for column in columns.values()] for row in rows]
    return markdown_table(columns, lines)


def cell(row: Row, column: Column) -> object:
    """The cell of a column in a row; ``-`` if the row lacks an entry."""
    if callable(column):
        return column(row)
    known = {k: x for k, x in row.items() if x is not None and x == x}
    try:
        return column.format_map(known)
    except KeyError:
        return "-"


def on(what: str, heads: Iterable[str]) -> list[str]:
    """Column headings with a common prefix."""
    return [f"{what}: {head}" for head in heads]


def percent(share: float | None, form: str = "+.2f") -> str:
    """A fraction in per cent; ``-`` if it is unknown.

    Examples
    --------
    >>> percent(0.0125), percent(-0.5, ".0f"), percent(float("nan"))
    ('+1.25 %', '-50 %', '-')
    """
    known = share is not None and isfinite(share)
    return f"{100 * share:{form}} %" if known else "-"  # type: ignore[operator]


def percent_of(key: str, form: str = "+.2f") -> Column:
    """A column of fractions in per cent."""
    return lambda row: percent(row[key], form)


def span(values: Iterable[float], form: str) -> str:
    """The smallest and the largest value.

    Examples
    --------
    >>> span([3.0, 1.26, 2.0], ".1f")
    '1.3 to 3.0'
    """
    known = [*values]
    return f"{min(known):{form}} to {max(known):{form}}"


def furthest(values: Iterable[float], middle: float = 0.0) -> float:
    """The known value furthest from a reference value; nan if none is known.

    Examples
    --------
    >>> furthest([0.1, -0.3, float("nan")])
    -0.3
    """
    known = (x for x in values if isfinite(x))
    return max(known, key=lambda x: abs(x - middle), default=nan)


def median(values: Iterable[float]) -> float:
    """The median of the known values; nan if none is known."""
    known = [x for x in values if isfinite(x)]
    return float(middle(known)) if known else nan


def minus(text: str) -> str:
    """Text with minus signs in place of hyphens."""
    return text.replace("-", "−")


def scientific(number: float, digits: int = 2) -> str:
    """A number in scientific notation.

    Examples
    --------
    >>> scientific(3.81e-7), scientific(6711131.8, 1), scientific(1e5)
    ('3.8·10⁻⁷', '7·10⁶', '10⁵')
    """
    factor, _, power = f"{number:.{digits - 1}e}".partition("e")
    factor = "" if float(factor) == 1 else f"{float(factor):g}·"
    return f"{factor}10{str(int(power)).translate(_RAISED)}"


def thousands(number: int) -> str:
    """An integer with spaces between thousands.

    Examples
    --------
    >>> thousands(60000)
    '60 000'
    """
    return f"{number:,}".replace(",", " ")
