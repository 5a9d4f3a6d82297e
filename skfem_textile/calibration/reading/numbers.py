"""Text of a file, numbers in its cells, and columns that contain only noise."""

import codecs
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...mesh.user_input import printable

#: Decimal marks by name.
MARKS = {".": "decimal point", ",": "decimal comma"}

# Largest magnitude of a test value, and smallest nonzero one: values are squared.
_LARGEST, _SMALLEST = 1e50, 1e-50

# Digits in groups of three, separated by a mark, a space or an apostrophe.
_NUMBER = (
    r"[+-]?(?:(?:\d{{1,3}}(?:([{other}    '’])\d{{3}})(?:\1\d{{3}})*|\d+)"
    r"(?:{mark}\d*)?|{mark}\d+)(?:[eE][+-]?\d+)?"
)
_PATTERNS = {
    mark: re.compile(_NUMBER.format(mark=re.escape(mark), other=other), re.ASCII)
    for mark, other in ((".", ","), (",", "."))
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


class AmbiguousMarkError(ValueError):
    """A comma or point that may be a decimal mark or a separator of thousands."""


def decimal_mark(cells: Iterable[str], separator: str) -> str:
    """Decimal mark of the numbers of a file.

    A mark that occurs twice in a number, or before the other one, separates thousands.
    A mark that is not followed by three digits, or follows a zero, is decimal.

    Raises
    ------
    AmbiguousMarkError
        If every number allows both readings, or numbers contradict one another.
    """
    evidence: dict[str, str] = {}
    doubtful: dict[str, str] = {}
    for cell in cells:
        text = _plain(cell)
        last = max(text.rfind("."), text.rfind(","))
        if last < 0:
            continue
        mark = text[last]
        other = "," if mark == "." else "."
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
        raise AmbiguousMarkError(
            f"numbers such as '{one}' and '{two}' have different decimal marks: "
            "specify one with --decimal"
        )
    if evidence:
        return next(iter(evidence))
    if doubtful:
        mark, text = next(iter(doubtful.items()))
        decimal, thousands = (
            f"{number(text, m):g}" for m in (mark, "," if mark == "." else ".")
        )
        raise AmbiguousMarkError(
            f"'{text}' may be {decimal} or {thousands}, and no number in the file "
            f"decides: use --decimal '{mark}' for {decimal}, or --decimal "
            f"'{',' if mark == '.' else '.'}' for {thousands}"
        )
    return "."


def _may_be_thousands(text: str, mark: str) -> bool:
    whole, _, rest = text.lstrip("+-").partition(mark)
    grouped = len(rest) == 3 and rest.isdecimal() and 0 < len(whole) <= 3
    return grouped and whole[0] != "0"


# Byte-order marks; the longer ones first.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)

# Beginnings of files of spreadsheets: zip archives and compound files.
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")

# Share of zero bytes above which a text without a mark is in UTF-16: every second byte
# of Latin text is zero.
_ZEROS = 0.3


def read_text(path: Path, encoding: str | None = None) -> tuple[str, str]:
    """Text of a file, and its encoding.

    Without an encoding, a byte-order mark decides, then zero bytes (UTF-16), then
    whether the bytes are valid UTF-8; other files are read as Windows-1252, which
    contains Latin-1.

    Raises
    ------
    ValueError
        If the file is not a text file, is a workbook, or is not in the given encoding.
    OSError
        If it cannot be read.
    """
    data, file = path.read_bytes(), printable(path)
    if data.startswith(_WORKBOOKS):
        raise ValueError(
            f"{file}: the file is a workbook: save the sheet with the curve as CSV"
        )
    if encoding is not None:
        try:
            return data.decode(encoding), encoding
        except (UnicodeError, LookupError):
            raise ValueError(
                f"{file}: the file is not in the encoding {printable(encoding)!r}"
            ) from None
    candidates = [name for mark, name in _MARKS if data.startswith(mark)]
    if not candidates and data.count(0) > _ZEROS * len(data):
        odd = data[1::2].count(0)
        candidates = ["utf-16-le" if odd > data[::2].count(0) else "utf-16-be"]
    for name in candidates or ["utf-8", "cp1252", "latin-1"]:
        try:
            text = data.decode(name)
        except UnicodeError:
            continue
        if "\0" not in text:
            return text, name
    raise ValueError(f"{file}: the file is not a text file")


# Fewest rows: with fewer, noise may follow a curve.
_FEWEST = 12

# Degree of the smooth curve of a trend, such as loading and unloading; and number of
# classes in which a force is compared with its scatter.
_DEGREE, _CLASSES = 3, 10

# Share of a variance above which a trend exceeds the scatter.
_HALF = 0.5


def _without_spikes(values: ndarray) -> ndarray:
    """Values with their outliers moved to the 5 % and 95 % quantiles."""
    return np.clip(values, *np.quantile(values, [0.05, 0.95]))


def explained_by_order(values: ndarray) -> float:
    """Share of the variance that a cubic trend over the rows explains."""
    rows = np.linspace(-1.0, 1.0, values.size)
    trend = np.polynomial.Polynomial.fit(rows, values, _DEGREE)
    return _share(values, trend(rows))


def explained(values: ndarray, by: ndarray) -> float:
    """Share of the variance that means in classes of another column explain."""
    rank = np.searchsorted(np.sort(by), by)
    of_class = _CLASSES * rank // by.size
    counts = np.bincount(of_class)
    means = np.bincount(of_class, values) / np.maximum(counts, 1)
    return _share(values, means[of_class])


def is_no_motion(moved: ndarray, forces: Sequence[ndarray]) -> bool:
    """True if a column is noise: no trend over the rows, and no force depends on it.

    Parameters
    ----------
    moved
        The column, shape (n,).
    forces
        Forces in the same rows.
    """
    known = np.all(np.isfinite([moved, *forces]), axis=0)
    if known.sum() < _FEWEST:
        return False
    x, *of_forces = (_without_spikes(each[known]) for each in (moved, *forces))
    if explained_by_order(x) >= _HALF:
        return False
    return all(explained(force, x) < _HALF for force in of_forces)


def is_noise(force: ndarray, moved: ndarray) -> bool:
    """True if a force neither depends on the motion nor on its previous values.

    The mean square of the differences of successive values is twice the variance of
    independent ones (von Neumann 1941, Ann. Math. Statist. 12:367).
    """
    known = np.isfinite(force) & np.isfinite(moved)
    if known.sum() < _FEWEST:
        return False
    f, x = (_without_spikes(each[known]) for each in (force, moved))
    independent = np.mean(np.diff(f) ** 2) > 2 * _HALF * f.var() > 0
    return bool(independent and explained(f, x) < _HALF)


def _share(values: ndarray, smooth: ndarray) -> float:
    """Share of the variance of values that a smooth curve explains."""
    total = float(np.sum((values - values.mean()) ** 2))
    return 1 - float(np.sum((values - smooth) ** 2)) / total if total else 0.0
