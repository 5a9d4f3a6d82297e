"""A file with the results of a sweep, a line for each."""

import json
import logging
import os
from collections import Counter
from hashlib import sha256
from pathlib import Path
from typing import Any

from ..cli.output import OutputError
from ..solve.checkpoint.lock import Lock

log = logging.getLogger(__name__)

# What a line holds, in this order.
_ENTRIES = ["case", "found", "digest"]

# How many lines a message names.
_NAMED = 5


class Kept:
    """A file with a line of JSON for every case that has a result, each with a digest.

    It is locked, and changed only if it is new or a line in it is one of a sweep.

    Attributes
    ----------
    found
        What an earlier sweep left there, by the names of its cases.
    """

    _HEAD = b'{"case": '

    def __init__(self, out: Path) -> None:
        self._out, self._names = out, set[str]()
        if out.exists() and not out.is_file():
            raise _foreign(out)
        with open(out, "ab"):
            self._lock = Lock(out)
        try:
            self.found = self._read()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let others have the file."""
        self._lock.release()

    def _read(self) -> dict[str, Any]:
        """The results on file; lines that are not taken for one are told."""
        content = self._out.read_bytes()
        whole, newline, torn = content.rpartition(b"\n")
        lines = whole.split(b"\n") if newline else []
        entries = [_entry(line) for line in lines]
        if content and not any(entries):
            raise _foreign(self._out)
        if torn and self._HEAD.startswith(torn[: len(self._HEAD)]):
            os.truncate(self._out, len(whole + newline))  # a sweep died as it wrote
        elif torn:
            with open(self._out, "ab") as file:
                file.write(b"\n")
        results = Counter(case for case, _ in {e for e in entries if e})
        left = [i for i, e in enumerate(entries, 1) if not e or results[e[0]] > 1]
        if left := left + ([len(lines) + 1] if torn else []):
            some = ", ".join(map(str, left[:_NAMED]))
            more = f" and {len(left) - _NAMED} more" if len(left) > _NAMED else ""
            log.warning(
                "%s: damaged, or at odds with each other, and their cases run again: "
                "line(s) %s",
                self._out,
                some + more,
            )
        told = {case: json.loads(found) for case, found in filter(None, entries)}
        return {case: found for case, found in told.items() if results[case] == 1}

    def begin(self, name: str) -> bool:
        """Whether the case has a result; its name must be its own."""
        if name in self._names:
            raise ValueError(f"two cases are named {name}: give a key that tells them")
        if " at 0x" in name:
            raise ValueError(f"a case is named {name}: give a key that lasts")
        self._names.add(name)
        return name in self.found

    def add(self, name: str, found: Any) -> Any:
        """Write a result; returns what a later sweep will read.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        said, line = _line(name, found)
        try:
            with open(self._out, "ab") as file:
                file.write(line)
        except OSError as error:
            raise OutputError(
                f"cannot write results to {self._out}: {error.strerror or error}; "
                "what it holds remains, and a sweep goes on from there"
            ) from None
        return json.loads(said)


def _line(name: str, found: Any) -> tuple[str, bytes]:
    """A result as JSON, and the line that tells it with a digest of what is before."""
    said = json.dumps(found, ensure_ascii=False, default=_plain)
    case = json.dumps(name, ensure_ascii=False)
    start = f'{{"case": {case}, "found": {said}, "digest": "'.encode()
    return said, start + _digest(start) + b'"}\n'


def _entry(line: bytes) -> tuple[str, str] | None:
    """Case and result, as JSON, of a line; None of one that no sweep wrote."""
    start, digest, end = line[:-18], line[-18:-2], line[-2:]
    if end != b'"}' or digest != _digest(start):
        return None
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(entry, dict) or list(entry) != _ENTRIES:
        return None
    case = entry["case"]
    return (case, json.dumps(entry["found"])) if isinstance(case, str) else None


def _foreign(out: Path) -> ValueError:
    return ValueError(
        f"{out} is not what a sweep wrote: remove it or name another file"
    )


def _digest(start: bytes) -> bytes:
    return sha256(start).hexdigest()[:16].encode()


def _plain(array: Any) -> Any:
    """Arrays and numbers of numpy as lists and numbers."""
    try:
        return array.tolist()
    except AttributeError:
        raise TypeError(
            f"a sweep cannot write a {type(array).__name__} to a file: return numbers, "
            "text, lists or dicts"
        ) from None
