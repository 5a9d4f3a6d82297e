"""Text of a file of unknown encoding."""

import codecs
from pathlib import Path

from ...mesh.user_input import printable

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
