"""A plain reader of the files that sweeps write: which lines are good."""

import json
from hashlib import sha256
from typing import Any, NamedTuple

_START, _FOUND, _DIGEST, _END = '{"case": ', ', "found": ', ', "digest": "', '"}'


class SweepContent(NamedTuple):
    """What a file holds.

    Attributes
    ----------
    good
        Results by the names of their cases.
    is_sweep
        Whether the file is empty, or a sweep wrote at least one of its lines.
    kept
        The bytes that no sweep may remove: all but a last line that is cut off.
    """

    good: dict[str, Any]
    is_sweep: bool
    kept: bytes


def read(content: bytes) -> SweepContent:
    """Read the bytes of a file.

    A case that has several results has none, unless they are equal.
    """
    *lines, rest = content.split(b"\n")
    entries = [entry for line in lines if (entry := _entry(line))]
    results: dict[str, set[str]] = {}
    for case, result in entries:
        results.setdefault(case, set()).add(result)
    good = {
        case: json.loads(of_case.pop())
        for case, of_case in results.items()
        if len(of_case) == 1
    }
    torn = rest[: len(_START)] == _START.encode()[: len(rest)]
    kept = content[: len(content) - len(rest)] if torn else content
    return SweepContent(good, bool(entries) or not content, kept)


def line(case: str, result: Any) -> bytes:
    """A line as a sweep writes it."""
    name = json.dumps(case, ensure_ascii=False)
    return sealed(f"{_START}{name}{_FOUND}{json.dumps(result)}".encode())


def sealed(start: bytes) -> bytes:
    """The start of a line, case and result, with its digest and its end."""
    start += _DIGEST.encode()
    return start + sha256(start).hexdigest()[:16].encode() + _END.encode() + b"\n"


def _entry(text: bytes) -> tuple[str, str] | None:
    """Case and result of a line; None if no sweep writes such a line."""
    start, mark, _end = text.rpartition(_DIGEST.encode())
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
