"""What the command line says, and what happens where it cannot be said."""

import os
import sys
from typing import TextIO

# Characters of a line on stderr: a word of the command line may have any number.
_LONGEST = 400


class OutputError(OSError):
    """What was found cannot be written or printed."""


def say(text: str, end: str = "\n") -> None:
    """Print to stdout at once; characters that it does not have by their codes.

    Raises
    ------
    BrokenPipeError
        If nobody reads on.
    OutputError
        If it cannot be printed for another reason.
    """
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    shown = text.encode(encoding, "backslashreplace").decode(encoding)
    try:
        print(shown, end=end, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        silence(sys.stdout)
        raise OutputError(f"cannot print: {error.strerror or error}") from None


def complain(text: str) -> None:
    """Print one line to stderr, if that can be written; without a long one's middle."""
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    if len(shown) > _LONGEST:
        shown = f"{shown[: _LONGEST // 2]} ... {shown[-_LONGEST // 2 :]}"
    if sys.stderr is None:
        return
    try:
        print(f"skfem-textile: {shown}", file=sys.stderr, flush=True)
    except OSError:
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Let the last flush of a stream that cannot be written go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
