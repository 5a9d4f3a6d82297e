"""Trials of case files: refused in one line, or run as they say."""

import math
import tomllib
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from ...folders import folder_content
from ...meshes.text_damage import damaged
from ...trial import (
    RIGHT,
    SILENT,
    UNCLEAR,
    Family,
    Finding,
    WrongAnswerError,
    checked,
)
from ..trials import PREFIX, refused_in_one_line, run_line
from .sound_cases import SHEAR, TEST, sound_case, unknown_keys

#: A case with more elements or steps is not run, as it takes long.
_MOST_ELEMENTS, _MOST_STEPS = 100, 4

#: One in this many accepted cases is run again as it was written back.
_AGAIN = 3

# How often each file is damaged: the case, then its tables.
_WEIGHTS = (3, 1, 1)

# Values of other kinds, or that few keys take.
_ODD = (
    *("nan", "-inf", "1e400", "true", "''", '"\\u0000"', "[]", "{}", "[1, 'a']"),
    *("1979-05-27", "0x10", "-1", "0", "1_0", '"free"', "[[1]]", "{a = 1}", "1e308"),
    *('"é\\n"', '"..\\u001b[2J"', '"auto"', '"case.toml"', "9" * 30, "9" * 5000),
)

_SECONDS = 60.0


def attempt(seed: int, folder: Path) -> Finding:
    """Damage a case file, or a table that it names, and run it."""
    random, rng = Random(seed), np.random.default_rng(seed)
    files = {"case.toml": sound_case(random), "shear.csv": SHEAR, "test.csv": TEST}
    name = random.choices(list(files), _WEIGHTS)[0]
    content = files[name].encode()
    if name == "case.toml" and random.random() < 0.4:
        content, damage = _odd_value(content, random), "odd value"
    else:
        content, damage = damaged(content, rng)
    for file, text in files.items():
        (folder / file).write_bytes(content if file == name else text.encode())
    shown = f"{name}: {damage}: {content[:600]!r}"
    if _takes_long(folder / "case.toml"):
        return Finding(RIGHT, shown, "not run")
    return _finding(folder, shown, bool(damage), random.randrange(_AGAIN) == 0)


def _finding(folder: Path, shown: str, damage: bool, again: bool) -> Finding:
    before = folder_content(folder)
    code, _, err = run_line(["run", "case.toml", "--out", "out"], folder)
    own = [line for line in err.splitlines() if line.startswith(PREFIX)]
    if code == 2:
        if not damage:
            return Finding(SILENT, shown, f"a sound case is refused: {err[:300]}")
        return refused_in_one_line(shown, err, before == folder_content(folder))
    if code not in (0, 1) or len(own) != code:
        return Finding(UNCLEAR, shown, f"exit code {code}: {err[:500]}")
    return checked(shown, _check_written, folder, again and code == 0)


def _check_written(folder: Path, again: bool) -> None:
    """Compare the written case with the one that was given, and its run.

    Raises
    ------
    WrongAnswerError
        If they differ.
    """
    given = tomllib.loads((folder / "case.toml").read_bytes().decode("utf-8-sig"))
    written = tomllib.loads((folder / "out" / "case.toml").read_text(encoding="utf-8"))
    if unknown := unknown_keys(given):
        raise WrongAnswerError(f"taken with {unknown}")
    if wrong := [*_differences("", given, written)]:
        raise WrongAnswerError(", ".join(wrong))
    if not again:
        return
    code, _, err = run_line(["run", "out/case.toml", "--out", "again"], folder)
    if code:
        raise WrongAnswerError(f"the written case ends with {code}: {err[:300]}")
    for name in ("case.toml", "history.csv", "curve.csv"):
        if (folder / "out" / name).read_bytes() != (
            folder / "again" / name
        ).read_bytes():
            raise WrongAnswerError(f"the written case has another {name}")


def _differences(where: str, given: Any, written: Any) -> Iterator[str]:
    """Where what is given is not what is written; names of files may differ."""
    if isinstance(given, dict) and isinstance(written, dict):
        for key, value in given.items():
            if key in written:
                yield from _differences(f"{where}.{key}", value, written[key])
            elif value != {}:
                yield f"{where}.{key} is not written"
    elif isinstance(given, list) and isinstance(written, list):
        if len(given) != len(written):
            yield f"{where} is {written!r}, not {given!r}"
        for one, other in zip(given, written, strict=False):
            yield from _differences(where, one, other)
    elif isinstance(written, str) and written.startswith("case_files/"):
        return
    elif isinstance(given, int) and isinstance(written, float):
        if float(given) != written:
            yield f"{where} is {written!r}, not {given!r}"
    elif given != written and not (given != given and written != written):
        yield f"{where} is {written!r}, not {given!r}"


def _odd_value(content: bytes, random: Random) -> bytes:
    """The file with an odd value in place of one."""
    lines = content.decode().splitlines()
    with_value = [i for i, line in enumerate(lines) if " = " in line]
    i = random.choice(with_value)
    key = lines[i].partition(" = ")[0]
    lines[i] = f"{key} = {random.choice(_ODD)}"
    return "\n".join([*lines, ""]).encode()


def _takes_long(file: Path) -> bool:
    """Whether a file says numbers of steps or elements that take long."""
    try:
        content = tomllib.loads(file.read_bytes().decode("utf-8-sig"))
        steps = content.get("stepping", {}).get("steps", 20)
        size = content.get("mesh", {}).get("size", [10, 15])
        elements = math.prod(abs(float(n)) for n in size)
        tolerance = "tolerance" in content.get("stepping", {})
        return bool(steps > _MOST_STEPS or elements > _MOST_ELEMENTS or tolerance)
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
        return False  # no case: it is refused


FAMILY = Family("case files", attempt, trials=2000, short=25, seconds=_SECONDS)
