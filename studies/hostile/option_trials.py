"""Trials of option lines: exit code, messages and results against a plain reading."""

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

from .mechanics import WrongError
from .option_lines import line, sound
from .option_names import UnreadableError
from .option_reader import AskedError, Read, read
from .option_results import check_results
from .option_rules import may_be_refused, refuse_contradictions
from .trial import RIGHT, SILENT, UNCLEAR, Family, Finding, refused

#: One in so many trials draws pictures, which take seconds.
_DRAWN = 200

#: What the log may say of a run that is not verbose.
_LOG = ("load factor ", "the path was not resolved", "nothing to resume", "solver ")

#: Time limit: coarse strips under the paper's rates take half a minute in one step.
_SECONDS = 120.0

_PREFIX = "skfem-textile: "


def attempt(seed: int, folder: Path) -> Finding:
    """Try the line of a seed."""
    random, whole = Random(seed), folder
    folder = whole / "here"  # that what is above it is no one else's
    folder.mkdir()
    os.chdir(folder)
    words = sound(random) if seed % _DRAWN == _DRAWN - 1 else line(random)
    _furnish(folder, words)
    before = _content(whole)
    expected, certain = _expected(words)
    code, out, err = _run(words, folder)
    shown = repr(words)[:1000]
    if code == 2:
        return _judge_refusal(shown, expected, certain, err, before == _content(whole))
    if isinstance(expected, str) and certain:
        return Finding(SILENT, shown, f"exit {code}, but {expected}")
    if code == 0 and not isinstance(expected, Read):
        told = bool(out.strip()) and before == _content(whole)
        return Finding(RIGHT if told else UNCLEAR, shown, out)
    if code not in (0, 1):
        return Finding(UNCLEAR, shown, f"exit code {code}")
    if complaint := _unclear(expected, code, out, err):
        return Finding(UNCLEAR, shown, complaint)
    try:
        check_results(expected, converged=code == 0)
    except WrongError as wrong:
        return Finding(SILENT, shown, str(wrong))
    return Finding(RIGHT, shown)


def _expected(words: Sequence[str]) -> tuple[Read | str, bool]:
    """What a line says, or why it says nothing; and whether that is certain."""
    if words[:1] != ["run"]:
        return "no run", words not in (["list"], ["--version"])
    plain = [word for word in words if word != "--"]
    try:
        found = read(plain)
        refuse_contradictions(found)
    except AskedError:
        return "help", False
    except UnreadableError as reason:
        return str(reason) or "unreadable", True
    return found, len(plain) == len(words) and not may_be_refused(found)


def _judge_refusal(
    shown: str, expected: Read | str, certain: bool, err: str, untouched: bool
) -> Finding:
    if isinstance(expected, Read) and certain:
        return Finding(SILENT, shown, f"a sound line is refused: {err[:300]}")
    if not untouched:
        return Finding(
            SILENT, shown, f"refused, but something was written: {err[:300]}"
        )
    text, end, more = err.partition("\n")
    if not text.startswith(f"{_PREFIX}error: ") or not end or more:
        return Finding(UNCLEAR, shown, err)
    return refused(shown, text)


def _unclear(read: Read, code: int, out: str, err: str) -> str:
    """What a run says that it should not; empty if it says what it should."""
    lines = err.splitlines()
    own = [text for text in lines if text.startswith(_PREFIX)]
    if len(own) != code or not all(text.isprintable() for text in lines):
        return f"exit code {code}: {err[:500]}"
    log = [text for text in lines if not text.startswith(_PREFIX)]
    if not read.values.get("verbose") and not all(x.startswith(_LOG) for x in log):
        return err[:500]
    if not all(text.isprintable() for text in out.splitlines()):
        return out[:500]
    said = out.splitlines()[-1] if out else ""
    return "" if said.startswith("results in ") else f"stdout: {out[-300:]}"


def _run(words: Sequence[str], folder: Path) -> tuple[int, str, str]:
    """Exit code, and what goes to the descriptors of stdout and stderr."""
    logging.getLogger("skfem_textile").handlers.clear()
    said = [Path(f"{folder}.{name}") for name in ("out", "err")]
    try:
        with _descriptors(said), warnings.catch_warnings():
            warnings.simplefilter("always")
            try:
                code = cli.main(list(words))
            except SystemExit as end:
                code = end.code
        return code, *(path.read_text(errors="replace") for path in said)
    finally:
        for path in said:
            path.unlink(missing_ok=True)


@contextlib.contextmanager
def _descriptors(said: Sequence[Path]) -> Iterator[None]:
    """Send the descriptors 1 and 2, and the streams on them, to files."""
    kept = [os.dup(1), os.dup(2)]
    for number, path in enumerate(said, start=1):
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


def _furnish(folder: Path, words: Sequence[str]) -> None:
    """What the words may name: meshes, good and bad, and things in the way."""
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
    for name in ("folder", "there", "blocked/summary.json", "junk", "unfinished"):
        (folder / name).mkdir(parents=True)
    (folder / "junk" / "run.npz").write_bytes(junk)
    (folder / "junk" / "state_000000.npz").write_bytes(junk)
    for study in ("stability", "formulations"):
        (folder / "unfinished" / f"{study}-unfinished.jsonl").write_text("{}\n")
    (folder / "there" / "summary.json").write_text("of an earlier run")


def _content(folder: Path) -> dict[str, bytes | None]:
    """All files and folders, with what the files hold."""
    return {
        str(path): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


FAMILY = Family("options", attempt, trials=10_000, short=60, seconds=_SECONDS)
