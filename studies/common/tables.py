"""Rows and tables as text: CSV, Markdown and JSON."""

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

_WORDS = {"": None, "None": None, "True": True, "False": False}


def csv_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows as CSV, with a column for every key of any row.

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


def rows_of_csv(text: str) -> list[dict[str, Any]]:
    r"""The rows of `csv_table`: numbers, booleans and text; an empty cell is None.

    Examples
    --------
    >>> rows_of_csv("a,b,c\n1,,True\n2,0.5,x\n")
    [{'a': 1, 'b': None, 'c': True}, {'a': 2, 'b': 0.5, 'c': 'x'}]
    """
    rows = csv.DictReader(io.StringIO(text))
    return [{key: _value(cell) for key, cell in row.items()} for row in rows]


def _value(cell: str) -> Any:
    """What `csv_table` wrote into a cell."""
    if cell in _WORDS:
        return _WORDS[cell]
    for number in (int, float):
        try:
            return number(cell)
        except ValueError:
            continue
    return cell


def markdown_table(head: Sequence[object], lines: Iterable[Sequence[object]]) -> str:
    """A table in Markdown.

    Examples
    --------
    >>> print(markdown_table(["n", "N"], [[1, "0.5"]]), end="")
    | n | N |
    |---|---|
    | 1 | 0.5 |
    """
    text = [f"| {' | '.join(map(str, line))} |" for line in (head, *lines)]
    text.insert(1, "|" + "---|" * len(head))
    return "\n".join(text) + "\n"


def json_text(content: Any) -> str:
    """Content as JSON; refuses nan, which JSON does not have."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
