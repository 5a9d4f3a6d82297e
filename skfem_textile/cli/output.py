"""Output of the command line to stdout and stderr, and exit codes."""

import os
import sys
from typing import TextIO

#: Exit codes of a run that stops early, or whose results cannot be written, and of
#: invalid input.
STOPPED_EARLY, BAD_INPUT = 1, 2

# Maximum number of characters of a line on stderr; arguments can be of any length.
_LONGEST = 400


class OutputError(OSError):
    """Error if results cannot be written or printed."""


def say(text: str, end: str = "\n") -> None:
    """Print to stdout at once; escape characters that its encoding lacks.

    Raises
    ------
    BrokenPipeError
        If the reader closed the output.
    OutputError
        If printing fails for another reason.
    """
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    encodable = text.encode(encoding, "backslashreplace").decode(encoding)
    try:
        print(encodable, end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        silence(sys.stdout)
        raise OutputError(
            f"cannot write to the standard output: {error.strerror or error}"
        ) from None


def complain(text: str) -> None:
    """Print one line to stderr if possible; omit the middle of a long one."""
    line = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    if len(line) > _LONGEST:
        line = f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"
    if sys.stderr is None:
        return
    try:
        print(f"skfem-textile: {line}", file=sys.stderr, flush=True)
    except OSError:
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Redirect the final flush of an unwritable stream to the null device."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
