"""Trials of command lines: exit code, messages and results against a plain reading."""

import contextlib
import logging
import os
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random

import meshio
import numpy as np

from skfem_textile.cli import main as cli

from ..folders import folder_content
from ..trial import RIGHT, SILENT, UNCLEAR, Family, Finding, checked, refused
from .command_lines import random_line, sound_line
from .documented import UnreadableError
from .reader import AskedError, RunLine, read
from .results import check_results
from .rules import may_be_refused, refuse_contradictions

#: One in this many trials draws pictures, which takes seconds.
_DRAWN = 200

#: Starts of log messages of a run that is not verbose.
_LOG = ("load factor ", "the path was not resolved", "nothing to resume", "solver ")

#: Time limit of a trial: a step of a coarse strip with rates takes half a minute.
_SECONDS = 120.0

#: With what every message of the command line begins.
PREFIX = "skfem-textile: "


def attempt(seed: int, folder: Path) -> Finding:
    """Try the line of a seed."""
    random, whole = Random(seed), folder
    folder = whole / "here"  # a line may name the folder above it
    folder.mkdir()
    os.chdir(folder)
    is_drawn = seed % _DRAWN == _DRAWN - 1
    words = sound_line(random) if is_drawn else random_line(random)
    _fill_folder(folder, words)
    before = folder_content(whole)
    expected, certain = _expected(words)
    code, out, err = run_line(words, folder)
    shown = repr(words)[:1000]
    if code == 2:
        untouched = before == folder_content(whole)
        return _refusal(shown, expected, certain, err, untouched)
    if isinstance(expected, str) and certain:
        return Finding(SILENT, shown, f"exit {code}, but {expected}")
    if code == 0 and not isinstance(expected, RunLine):
        is_answer = bool(out.strip()) and before == folder_content(whole)
        return Finding(RIGHT if is_answer else UNCLEAR, shown, out)
    if code not in (0, 1):
        return Finding(UNCLEAR, shown, f"exit code {code}")
    if complaint := _unclear(expected, code, out, err):
        return Finding(UNCLEAR, shown, complaint)
    return checked(shown, check_results, expected, code == 0)


def _expected(words: Sequence[str]) -> tuple[RunLine | str, bool]:
    """What a line says, or why it must be refused; and whether that is certain."""
    if words[:1] != ["run"]:
        return "no run", words not in (["list"], ["--version"])
    plain = [word for word in words if word != "--"]
    try:
        line = read(plain)
        refuse_contradictions(line)
    except AskedError:
        return "help", False
    except UnreadableError as reason:
        return str(reason) or "unreadable", True
    return line, len(plain) == len(words) and not may_be_refused(line)


def _refusal(
    shown: str, expected: RunLine | str, certain: bool, err: str, untouched: bool
) -> Finding:
    if isinstance(expected, RunLine) and certain:
        return Finding(SILENT, shown, f"a sound line is refused: {err[:300]}")
    return refused_in_one_line(shown, err, untouched)


def refused_in_one_line(shown: str, err: str, untouched: bool) -> Finding:
    """The finding of a refusal, which must be one line and leave all files alone."""
    if not untouched:
        return Finding(SILENT, shown, f"refused, but files changed: {err[:300]}")
    text, end, more = err.partition("\n")
    if not text.startswith(f"{PREFIX}error: ") or not end or more:
        return Finding(UNCLEAR, shown, err)
    return refused(shown, text)


def _unclear(line: RunLine, code: int, out: str, err: str) -> str:
    """The output of a run that is not clear; empty if all of it is clear."""
    lines = err.splitlines()
    own = [text for text in lines if text.startswith(PREFIX)]
    if len(own) != code or not all(text.isprintable() for text in lines):
        return f"exit code {code}: {err[:500]}"
    log = [text for text in lines if not text.startswith(PREFIX)]
    if not line.values.get("verbose") and not all(x.startswith(_LOG) for x in log):
        return err[:500]
    if not all(text.isprintable() for text in out.splitlines()):
        return out[:500]
    last = out.splitlines()[-1] if out else ""
    return "" if last.startswith("results in ") else f"stdout: {out[-300:]}"


def run_line(words: Sequence[str], folder: Path) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command line."""
    logging.getLogger("skfem_textile").handlers.clear()
    files = [Path(f"{folder}.{name}") for name in ("out", "err")]
    try:
        with _descriptors_to(files), warnings.catch_warnings():
            warnings.simplefilter("always")
            try:
                code = cli.main(list(words))
            except SystemExit as end:
                code = end.code
        return code, *(path.read_text(errors="replace") for path in files)
    finally:
        for path in files:
            path.unlink(missing_ok=True)


@contextlib.contextmanager
def _descriptors_to(files: Sequence[Path]) -> Iterator[None]:
    """Send the descriptors 1 and 2, and the streams on them, to files."""
    kept = [os.dup(1), os.dup(2)]
    for number, path in enumerate(files, start=1):
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, number)
        os.close(file)
    try:
        with (
            open(1, "w", encoding="utf-8", closefd=False) as out,
            open(2, "w", errors="backslashreplace", closefd=False) as err,
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            yield
    finally:
        for number, descriptor in enumerate(kept, start=1):
            os.dup2(descriptor, number)
            os.close(descriptor)


def _fill_folder(folder: Path, words: Sequence[str]) -> None:
    """Make what words may name: meshes, sound and damaged, and obstacles."""
    sides = (40.0, 60.0) if "strip" in words else (50.0, 100.0)
    x, y = np.meshgrid(*(np.linspace(0, side, 3) for side in sides))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    triangles = np.vstack([quads[:, :3], quads[:, [0, 2, 3]]])
    for name, kind, cells in (
        ("quads good.vtu", "quad", quads),
        ("triangles good.vtu", "triangle", triangles),
    ):
        meshio.Mesh(points, {kind: cells}).write(folder / name)
    junk = bytes(range(256)) * 4
    for name in ("junk.msh", "junk.vtu", "junk.inp", "file"):
        (folder / name).write_bytes(junk)
    (folder / "empty.vtu").touch()
    curve = "displacement (mm),force (N)\n0,0\n5,2\n"
    (folder / "curve.csv").write_text(curve)
    for name in ("folder", "there", "blocked/summary.json", "junk", "unfinished"):
        (folder / name).mkdir(parents=True)
    (folder / "junk" / "run.npz").write_bytes(junk)
    (folder / "junk" / "state_000000.npz").write_bytes(junk)
    for study in ("stability", "formulations"):
        (folder / "unfinished" / f"{study}-unfinished.jsonl").write_text("{}\n")
    (folder / "there" / "summary.json").write_text("of an earlier run")


FAMILY = Family("options", attempt, trials=10_000, short=60, seconds=_SECONDS)
