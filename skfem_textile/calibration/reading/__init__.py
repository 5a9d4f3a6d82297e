"""Reading of the files of testing machines."""

from .quantities import COLUMNS, column_named
from .recording import Format, Recording, read_recordings, rows_text

__all__ = [
    "COLUMNS",
    "Format",
    "Recording",
    "column_named",
    "read_recordings",
    "rows_text",
]
