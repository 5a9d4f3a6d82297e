"""A plain reader of the files that sweeps write: which lines are good."""

import json
from hashlib import sha256
from typing import Any, NamedTuple

_START, _FOUND, _DIGEST, _END = '{"case": ', ', "found": ', ', "digest": "', '"}'


class Read(NamedTuple):
    """What a file holds.

    Attributes
    ----------
    good
        Results by the names of their cases.
    is_sweep
        Whether a line of it is one that a sweep wrote, or it is empty.
    kept
        The bytes that no sweep may take away: all but a last line that was torn.
    """

    good: dict[str, Any]
    is_sweep: bool
    kept: bytes


def read(content: bytes) -> Read:
    """Read the bytes of a file.

    A case that has several results has none, unless they are equal.
    """
    *lines, rest = content.split(b"\n")
    told = [entry for line in lines if (entry := _entry(line))]
    results: dict[str, set[str]] = {}
    for case, found in told:
        results.setdefault(case, set()).add(found)
    good = {
        case: json.loads(found.pop())
        for case, found in results.items()
        if len(found) == 1
    }
    head = _START.encode()
    torn = rest[: len(head)] == head[: len(rest)]
    kept = content[: len(content) - len(rest)] if torn else content
    return Read(good, bool(told) or not content, kept)


def line(case: str, found: Any) -> bytes:
    """A line as a sweep writes it."""
    name = json.dumps(case, ensure_ascii=False)
    return sealed(f"{_START}{name}{_FOUND}{json.dumps(found)}".encode())


def sealed(start: bytes) -> bytes:
    """The start of a line, case and result, with its digest and its end."""
    start += _DIGEST.encode()
    return start + sha256(start).hexdigest()[:16].encode() + _END.encode() + b"\n"


def _entry(text: bytes) -> tuple[str, str] | None:
    """Case and result of a line; None of one that is not as a sweep writes it."""
    start, mark, _ = text.rpartition(_DIGEST.encode())
    if not mark or sealed(start) != text + b"\n":
        return None
    try:
        entry = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(entry, dict) or list(entry) != ["case", "found", "digest"]:
        return None
    if not isinstance(entry["case"], str):
        return None
    return entry["case"], json.dumps(entry["found"])
