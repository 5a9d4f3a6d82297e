"""Numbers in cells, and the decimal mark of a file."""

import re
from collections.abc import Iterable

import numpy as np

#: Decimal marks by name.
MARKS = {".": "decimal point", ",": "decimal comma"}

# Largest magnitude of a test value, and smallest nonzero one: values are squared.
_LARGEST, _SMALLEST = 1e50, 1e-50

# Digits in groups of three, separated by a mark, a space or an apostrophe.
_NUMBER = (
    r"[+-]?(?:(?:\d{{1,3}}(?:([{other}    '’])\d{{3}})(?:\1\d{{3}})*|\d+)"
    r"(?:{mark}\d*)?|{mark}\d+)(?:[eE][+-]?\d+)?"
)
_OTHER = {".": ",", ",": "."}
_PATTERNS = {
    mark: re.compile(_NUMBER.format(mark=re.escape(mark), other=other), re.ASCII)
    for mark, other in _OTHER.items()
}
_GROUPED = re.compile(r"[,.    '’](?=\d{3}(?!\d))", re.ASCII)


def is_number(cell: str) -> bool:
    """True if a cell is a number with either decimal mark."""
    text = _plain(cell)
    return any(p.fullmatch(text) for p in _PATTERNS.values()) and text[-1:] != ","


def number(cell: str, mark: str) -> float:
    """Number in a cell; nan if there is none, or it is too large for a test."""
    text = _plain(cell)
    if not _PATTERNS[mark].fullmatch(text):
        return np.nan
    whole, found, rest = text.partition(mark)
    value = float(_GROUPED.sub("", whole) + found.replace(",", ".") + rest)
    if not abs(value) < _LARGEST:
        return np.nan
    return value if abs(value) > _SMALLEST else 0.0


def _plain(cell: str) -> str:
    return cell.strip().replace("−", "-")


def decimal_mark(cells: Iterable[str], separator: str) -> str:
    """Decimal mark of the numbers of a file.

    A mark that occurs twice in a number, or before the other one, separates thousands.
    A mark that is not followed by three digits, or follows a zero, is decimal.

    Raises
    ------
    ValueError
        If every number allows both readings, or numbers contradict one another.
    """
    evidence: dict[str, str] = {}
    doubtful: dict[str, str] = {}
    for cell in cells:
        text = _plain(cell)
        last = max(text.rfind("."), text.rfind(","))
        if last < 0:
            continue
        mark, other = text[last], _OTHER[text[last]]
        if text.count(mark) > 1:
            evidence.setdefault(other, text)
        elif other in text or not _may_be_thousands(text, mark):
            evidence.setdefault(mark, text)
        else:
            doubtful.setdefault(mark, text)
    if separator == ",":  # an unquoted comma is not a decimal mark
        doubtful.pop(".", None)
        if "," not in evidence and "," not in doubtful:
            return "."
    if len(evidence) == 2:
        one, two = evidence.values()
        raise ValueError(
            f"numbers such as '{one}' and '{two}' have different decimal marks: "
            "specify one with --decimal"
        )
    if evidence:
        return next(iter(evidence))
    if doubtful:
        mark, text = next(iter(doubtful.items()))
        other = _OTHER[mark]
        decimal, thousands = (f"{number(text, m):g}" for m in (mark, other))
        raise ValueError(
            f"'{text}' may be {decimal} or {thousands}, and no number in the file "
            f"decides: use --decimal '{mark}' for {decimal}, or --decimal "
            f"'{other}' for {thousands}"
        )
    return "."


def _may_be_thousands(text: str, mark: str) -> bool:
    whole, _, rest = text.lstrip("+-").partition(mark)
    grouped = len(rest) == 3 and rest.isdecimal() and 0 < len(whole) <= 3
    return grouped and whole[0] != "0"
