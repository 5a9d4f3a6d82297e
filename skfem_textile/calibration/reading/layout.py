"""Layout of a file: encoding, separator, and blocks of numbers with their headings."""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...mesh.user_input import printable
from .numbers import is_number
from .quantities import is_unit, recognised

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

#: Separators of columns by name, in the order of preference.
SEPARATORS = {
    ";": "semicolon",
    "\t": "tab",
    "|": "bar",
    ",": "comma",
    " ": "spaces",
}

# Number of heading rows above a block: names, channels, units.
_HEADINGS = 3

_LINE_END = re.compile(r"\r\n|\n|\r")
_WIDE_SPACE = re.compile(r"\t|\s{2,}")
_WITH_UNIT = re.compile(r"[^\s(\[]+(?:\s*[(\[][^)\]]*[)\]])?")

#: Cells of a line, and its number in the file.
Line = tuple[int, list[str]]


@dataclass(frozen=True)
class Block:
    """Rows of one repeat as text.

    Attributes
    ----------
    titles
        Lines above the headings, since the previous block.
    headings
        Rows above the numbers with as many cells, from top to bottom.
    rows
        Number of the line in the file, and cells, of each row of numbers.
    faulty
        Rows among them that have a different number of cells, or no number.
    """

    titles: list[Line]
    headings: list[Line]
    rows: list[Line]
    faulty: list[Line]

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.rows[0][1])

    def cut(self, line: int, titles: list[Line]) -> tuple["Block", "Block"]:
        """The rows above a line, and those from it on with titles above them."""
        faulty = [x for x in self.faulty if x not in titles]
        above, below = (
            [[x for x in of if (x[0] < line) == is_above] for of in (self.rows, faulty)]
            for is_above in (True, False)
        )
        return (
            Block(self.titles, self.headings, *above),
            Block(titles, self.headings, *below),
        )


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


def split(text: str, separator: str) -> list[Line]:
    """Cells of each line that is not empty."""
    lines = []
    for i, line in enumerate(_LINE_END.split(text.removeprefix("\ufeff")), 1):
        if separator == " ":
            cells = line.split()
        elif '"' in line:
            cells = next(csv.reader([line], delimiter=separator), [])
        else:
            cells = line.split(separator)
        cells = [cell.strip() for cell in cells]
        if any(cells):
            lines.append((i, cells))
    return lines


def separator_of(text: str) -> str:
    """Separator with the most rows of numbers; of these, the first of `SEPARATORS`.

    Rows of numbers alone count first, because another separator may leave parts of
    numbers beside texts.
    """

    def rows_of_numbers(separator: str) -> tuple[int, int]:
        rows = [cells for _, cells in split(text, separator) if _is_data(cells, 2)]
        alone = (cells for cells in rows if _only_numbers(cells))
        return _most_alike(alone), _most_alike(rows)

    best = max(SEPARATORS, key=rows_of_numbers)
    if rows_of_numbers(best)[1]:
        return best
    used = (one for one in SEPARATORS if one != " " and one in text)
    return next(used, ",")  # of a single column


def _most_alike(rows: Iterable[Sequence[str]]) -> int:
    """Number of rows with the most frequent number of cells."""
    return max(Counter(map(len, rows)).values(), default=0)


def blocks_of(text: str, separator: str) -> list[Block]:
    """Blocks of numbers.

    A line with a heading ends a block.  Numbers below it belong to the same block if
    there is no heading for each column, as for a comment.
    """
    lines = split(text, separator)
    least = 2 if any(_is_data(cells, 2) for _, cells in lines) else 1
    blocks: list[Block] = []
    above: list[Line] = []
    for line in lines:
        number, cells = line
        gap = bool(blocks) and len(cells) == blocks[-1].width and _only_numbers(cells)
        if not _is_data(cells, least) and not gap:
            above.append(line)
            continue
        headed = any(recognised(cell) for _, row in above for cell in row)
        known = headed or not blocks  # of the first block also in another language
        headings = _headings(text, above, len(cells), separator) if known else []
        if blocks and not headings:
            block = blocks[-1]
            fits = len(cells) <= block.width or not any(cells[block.width :])
            block.faulty.extend([*above, *([] if fits else [line])])
            if fits:
                filled = [*cells, *[""] * (block.width - len(cells))]
                block.rows.append((number, filled[: block.width]))
        else:
            after = [x for x in above if headings and x[0] > headings[-1][0]]
            titles = [x for x in above if not headings or x[0] < headings[0][0]]
            blocks.append(Block(titles, headings, [line], after))
        above = []
    if blocks:
        width = blocks[-1].width
        ends = [x for x in above if len(x[1]) <= width and _has_number(x[1])]
        blocks[-1].faulty.extend(ends)
    return blocks


def _has_number(cells: Sequence[str]) -> bool:
    """True for numbers, also damaged ones: digits without letters."""
    numbers = (any(map(str.isdigit, x)) and not any(map(str.isalpha, x)) for x in cells)
    return any(numbers) and not any(map(recognised, cells))


def _is_data(cells: Sequence[str], least: int) -> bool:
    """True if a line contains enough numbers, and at most as many other texts."""
    numbers = sum(map(is_number, cells))
    filled = sum(map(bool, cells))
    return numbers >= least and 2 * numbers >= filled


def _only_numbers(cells: Sequence[str]) -> bool:
    """True for numbers and empty cells."""
    return all(not cell or is_number(cell) for cell in cells)


def _headings(
    text: str, above: Sequence[Line], width: int, separator: str
) -> list[Line]:
    """Last lines above a block with as many cells as its rows."""
    found: list[Line] = []
    source = _LINE_END.split(text) if separator == " " else []
    for number, cells in reversed(above[-_HEADINGS:]):
        if separator == " ":
            cells = _heading_cells(source[number - 1], width)
        while len(cells) > width and not cells[-1]:
            cells = cells[:-1]
        if len(cells) == width and not any(map(is_number, cells)):
            found.append((number, cells))
        elif found:
            break
    return found[::-1]


def _heading_cells(line: str, width: int) -> list[str]:
    """Cells of a heading between spaces, which may occur within a cell."""
    ways = (_WIDE_SPACE.split(line.strip()), line.split(), _WITH_UNIT.findall(line))
    return next((cells for cells in ways if len(cells) == width), ways[0])


def column_headings(block: Block) -> list[tuple[str, str]]:
    """Name and unit of each column as text; the unit may be in a separate row."""
    names, units = [""] * block.width, [""] * block.width
    for _, cells in block.headings:
        if 2 * sum(map(is_unit, cells)) >= max(sum(map(bool, cells)), 1):
            units = cells
        elif not any(names) or sum(map(recognised, cells)) >= sum(
            map(recognised, names)
        ):
            names = cells
    return list(zip(names, units, strict=True))
