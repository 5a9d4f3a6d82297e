"""Damaged files of sweeps are rejected and left unchanged, or completed correctly."""

import json
import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from hypothesis import strategies as st

from skfem_textile.mesh.progress import unlogged
from skfem_textile.sweep import sweep
from tests.helpers.hostile import (
    RIGHT,
    Family,
    expect,
    expect_equal,
    rejected,
)
from tests.helpers.hostile.damage import REPLACEMENTS, TO_BYTES, replace_file
from tests.helpers.sweep_cases import FOREIGN, FORGED, with_checksum

# Names of cases, with characters that JSON escapes.
CASES = ("0", "a b", "größe", '"', "\\", "two\nlines", "{}", "")

# A plain description of the file, independent of the library

START, FOUND, CHECKSUM = '{"case": ', ', "found": ', ', "checksum": "'


def line(case, result):
    name = json.dumps(case, ensure_ascii=False)
    return with_checksum(f"{START}{name}{FOUND}{json.dumps(result)}".encode())


def entry(text):
    """Case and result of a line; None if no sweep writes such a line."""
    start, mark, _ = text.rpartition(CHECKSUM.encode())
    if not mark or with_checksum(start) != text + b"\n":
        return None
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(content, dict) or list(content) != ["case", "found", "checksum"]:
        return None
    if not isinstance(content["case"], str):
        return None
    return content["case"], json.dumps(content["found"])


class Content(NamedTuple):
    """The content of a file.

    ``good`` are results by their cases; a case with several has none, unless they are
    equal.  ``is_sweep`` is True if the file is empty or has a line of a sweep, ``kept``
    are the bytes that no sweep may remove: all but a torn last line.
    """

    good: dict
    is_sweep: bool
    kept: bytes


def read(content):
    *lines, rest = content.split(b"\n")
    entries = [parsed for text in lines if (parsed := entry(text))]
    results = {}
    for case, result in entries:
        results.setdefault(case, set()).add(result)
    good = {
        case: json.loads(min(texts))
        for case, texts in results.items()
        if len(texts) == 1
    }
    is_torn = rest[: len(START)] == START.encode()[: len(rest)]
    preserved = content[: len(content) - len(rest)] if is_torn else content
    return Content(good, bool(entries) or not content, preserved)


# Damage

RESULTS = (0, 1.5, None, "text", [], {"value": 2}, float("nan"), 10**400)

foreign = st.sampled_from(FOREIGN)
forged = st.sampled_from(FORGED).map(with_checksum)


def inserted(draw, content, new):
    lines = content.splitlines(keepends=True)
    lines.insert(draw(st.integers(0, len(lines))), new)
    return b"".join(lines)


def one_less_or_twice(draw, content):
    lines = content.splitlines(keepends=True) or [b""]
    i = draw(st.integers(0, len(lines) - 1))
    change = draw(st.sampled_from(("without", "twice", "all twice")))
    if change == "without":
        return b"".join(lines[:i] + lines[i + 1 :])
    return content + (lines[i] if change == "twice" else content)


def edited(draw, content):
    """Another result of a case, in its place, with a valid checksum or the old one."""
    lines = content.splitlines(keepends=True) or [b""]
    i = draw(st.integers(0, len(lines) - 1))
    if not (parsed := entry(lines[i].removesuffix(b"\n"))):
        return content
    other = line(parsed[0], draw(st.sampled_from(RESULTS)))
    if draw(st.booleans()):
        other = other[:-19] + lines[i][-19:]
    lines[i : i + draw(st.integers(0, 1))] = [other]
    return b"".join(lines)


DAMAGES = (
    *TO_BYTES,
    lambda draw, x: b"".join(draw(st.permutations(x.splitlines(keepends=True)))),
    *(one_less_or_twice, one_less_or_twice),
    lambda draw, x: inserted(draw, x, draw(foreign) + b"\n"),
    lambda draw, x: draw(foreign) + b"\n" * draw(st.integers(0, 1)),
    lambda draw, x: x + draw(foreign),  # without its end
    lambda draw, x: inserted(draw, x, draw(forged)),
    lambda draw, x: draw(forged),
    edited,
    lambda draw, x: x.replace(b"\n", draw(st.sampled_from((b"\r\n", b"\n\n", b"\r")))),
    lambda draw, x: b"\xef\xbb\xbf" + x,  # a byte order mark
    lambda draw, x: x.replace(b"\n", b"", 1),  # two lines in one
    lambda draw, x: b"",
)


@st.composite
def files(draw):
    """The content of a file, and perhaps a replacement of the file."""
    number = draw(st.integers(1, len(CASES)))
    content = b"".join(line(case, result(case)) for case in CASES[:number])
    for _ in range(draw(st.sampled_from((1, 1, 2, 3)))):
        content = draw(st.sampled_from(DAMAGES))(draw, content)
    return content, draw(st.sampled_from([None] * 54 + [*REPLACEMENTS]))


def result(case):
    n = CASES.index(case)
    return {"value": n / 7, "text": case, "list": [1e300, -0.0, None, n]}


@unlogged()
def attempt(hostile):
    content, replacement = hostile
    out = Path("kept", "out.jsonl")
    out.parent.mkdir()
    out.write_bytes(content)
    if replacement:
        replace_file(out, replacement)
    is_file, called = out.is_file(), []
    before = out.read_bytes() if is_file else b""
    plain = read(before)

    def run(case):
        called.append(case)
        return result(case)

    try:
        with ThreadPoolExecutor(1) as executor:
            results = dict(sweep(run, CASES, executor, out=out, key=str))
    except (ValueError, OSError) as error:
        expect(not is_file or out.read_bytes() == before, f"changed, then {error}")
        # A broken link replaces the file; `exists` is false for it.
        is_free = is_file or not os.path.lexists(out)
        expect(not (plain.is_sweep and is_free), f"a sweep is refused: {error}")
        return rejected(error)
    expect(plain.is_sweep, "a file that no sweep wrote is taken")
    right = {case: plain.good.get(case, result(case)) for case in CASES}
    # NaN is not equal to itself.
    expect_equal(
        "results", repr(results), repr({case: right[case] for case in results})
    )
    expect_equal("cases", set(results), set(CASES))
    expect_equal("cases that ran", sorted(called), sorted({*CASES} - {*plain.good}))
    expect(out.read_bytes().startswith(plain.kept), "whole lines are lost")
    return RIGHT


FAMILY = Family("sweeps", {"": files()}, attempt, 1000, short=40)


def test_a_damaged_file_of_a_sweep_is_rejected_or_completed_correctly():
    FAMILY.check(15)
