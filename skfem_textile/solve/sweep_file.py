"""A file with the results of a sweep, one line for each."""

import json
import logging
import os
from collections import Counter
from hashlib import sha256
from pathlib import Path
from typing import Any

from .sealed import Lock

log = logging.getLogger(__name__)

# How every line begins, and the names of its entries in order.
_LINE_START = b'{"case": '
_ENTRIES = ["case", "found", "digest"]

# Number of lines, or of cases, that a message lists.
_LISTED = 5

_FOREIGN = "{} is not what a sweep wrote: remove it or name another file"


class ResultsFile:
    """A file with a line of JSON for every case that has a result, each with a digest.

    The file is locked.  It is changed only if it is new or holds a line that a sweep
    wrote.

    Attributes
    ----------
    earlier
        Results that an earlier sweep left there, by the names of their cases.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._names = path, set[str]()
        if path.exists() and not path.is_file():
            raise ValueError(_FOREIGN.format(path))
        with open(path, "ab"):
            self._lock = Lock(path)
        try:
            self.earlier = self._read()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the lock of the file."""
        self._lock.release()

    def _read(self) -> dict[str, Any]:
        """Read the results; a warning lists the lines that are not used."""
        content = self._path.read_bytes()
        *lines, unfinished = content.split(b"\n")
        entries = [_entry(line) for line in lines]
        if content and not any(entries):
            raise ValueError(_FOREIGN.format(self._path))
        if _LINE_START.startswith(unfinished[: len(_LINE_START)]):
            # A sweep died while it wrote; if the last line is whole this cuts nothing.
            os.truncate(self._path, len(content) - len(unfinished))
        else:
            with open(self._path, "ab") as file:
                file.write(b"\n")
        if unfinished:
            entries.append(None)
        # Several results of a case count as none, unless they are equal.
        count = Counter(case for case, _ in set(filter(None, entries)))
        used = {i: e for i, e in enumerate(entries, 1) if e and count[e[0]] == 1}
        unused = [str(i) for i in range(1, len(entries) + 1) if i not in used]
        if unused:
            log.warning(
                "%s: damaged, or at odds with each other, and their cases run again: "
                "line(s) %s",
                self._path,
                shortened(unused, ", "),
            )
        return {case: json.loads(result) for case, result in used.values()}

    def check_name(self, name: str) -> str:
        """The name; refuses one that another case has, or that changes between runs."""
        if name in self._names:
            raise ValueError(f"two cases are named {name}: give a key that tells them")
        if " at 0x" in name:
            raise ValueError(f"a case is named {name}: give a key that lasts")
        self._names.add(name)
        return name

    def add(self, name: str, result: Any) -> Any:
        """Write a result; return what a later sweep will read.

        Raises
        ------
        OSError
            If it cannot be written.
        TypeError
            If JSON cannot hold it.
        """
        result_text = json.dumps(result, ensure_ascii=False, default=_as_json)
        name_text = json.dumps(name, ensure_ascii=False)
        start = f'{{"case": {name_text}, "found": {result_text}, "digest": "'.encode()
        try:
            with open(self._path, "ab") as file:
                file.write(start + _digest(start) + b'"}\n')
        except OSError as error:
            raise OSError(
                f"cannot write results to {self._path}: {error.strerror or error}; "
                "what it holds remains, and a sweep goes on from there"
            ) from None
        return json.loads(result_text)


def _entry(line: bytes) -> tuple[str, str] | None:
    """Name and result, as JSON, of a line; None if no sweep wrote the line."""
    start, digest, end = line[:-18], line[-18:-2], line[-2:]
    if end != b'"}' or digest != _digest(start):
        return None
    try:
        entry = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(entry, dict) or list(entry) != _ENTRIES:
        return None
    name = entry["case"]
    return (name, json.dumps(entry["found"])) if isinstance(name, str) else None


def _digest(start: bytes) -> bytes:
    return sha256(start).hexdigest()[:16].encode()


def _as_json(array: Any) -> Any:
    """Arrays and numbers of numpy as lists and numbers."""
    try:
        return array.tolist()
    except AttributeError:
        raise TypeError(
            f"a sweep cannot write a {type(array).__name__} to a file: return numbers, "
            "text, lists or dicts"
        ) from None


def shortened(items: list[str], separator: str) -> str:
    """The first items on one line, and the number of the others."""
    more = [f"and {len(items) - _LISTED} more"] if items[_LISTED:] else []
    return separator.join(items[:_LISTED] + more)
