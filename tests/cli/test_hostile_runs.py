"""Command lines and case files are rejected in one line, or run as written."""

import contextlib
import logging
import math
import os
import tomllib
import warnings
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import meshio
import numpy as np
import pytest
from hypothesis import strategies as st

from skfem_textile.cases.scenes import SCENES
from skfem_textile.cli import main as cli
from tests.helpers.hostile import (
    RIGHT,
    Family,
    UnclearError,
    expect,
    expect_equal,
    folder_content,
    options,
    rejected,
)
from tests.helpers.hostile.damage import damaged
from tests.helpers.hostile.run_results import Results, differences

# Starts of log messages of a run that is not verbose.
LOG = (
    *(
        "load factor ",
        "the path was not resolved",
        "there is no state to resume",
        "solver ",
    ),
    "nothing changes with the load factor",
)

# Prefix of every message of the command line.
PREFIX = "skfem-textile: "

# A step of a coarse strip with rates takes half a minute.
SECONDS = 120.0


class Ended(NamedTuple):
    """Exit code, stdout and stderr of a command line."""

    code: int
    out: str
    err: str


def run_line(words):
    """Run a line in this process, its output redirected through descriptors."""
    logging.getLogger("skfem_textile").handlers.clear()
    with TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        files = [Path(folder, name) for name in ("out", "err")]
        for number, path in enumerate(files, start=1):
            file = stack.enter_context(open(path, "wb"))
            stack.callback(os.dup2, os.dup(number), number)
            os.dup2(file.fileno(), number)
        out = stack.enter_context(open(1, "w", encoding="utf-8", closefd=False))
        err = stack.enter_context(
            open(2, "w", errors="backslashreplace", closefd=False)
        )
        stack.enter_context(contextlib.redirect_stdout(out))
        stack.enter_context(contextlib.redirect_stderr(err))
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("always")
        try:
            code = cli.main(list(words))
        except SystemExit as end:
            code = end.code
        stack.close()
        return Ended(code, *(path.read_text(errors="replace") for path in files))


def rejected_in_one_line(ended, before):
    """The outcome of a rejection: one line, and all files unchanged."""
    after = folder_content(Path())
    expect(after == before, f"refused, but files changed: {ended.err[:300]}")
    text, end, more = ended.err.partition("\n")
    if not text.startswith(f"{PREFIX}error: ") or not end or more or ended.out:
        raise UnclearError(ended)
    return rejected(text)


def expect_clear(ended, is_verbose):
    """Check the output of a run, with one message for each early stop."""
    lines = ended.err.splitlines()
    errors = [text for text in lines if text.startswith(PREFIX)]
    log = [text for text in lines if not text.startswith(PREFIX)]
    printed = ended.out.splitlines()
    is_clear = len(errors) == ended.code and all(map(str.isprintable, lines + printed))
    is_known = is_verbose or all(text.startswith(LOG) for text in log)
    if not (
        is_clear and is_known and printed[-1:][0].startswith("results written to ")
    ):
        raise UnclearError(ended)


# Lines


def attempt_line(line):
    os.mkdir("here")  # a line may name the folder above it
    with contextlib.chdir("here"):
        fill_folder("strip" in line.words)
        before = folder_content(Path())
        ended = run_line(line.words)
        if ended.code == 2:
            expect(
                line.verdict != options.TAKEN, f"a sound line is refused: {ended.err}"
            )
            return rejected_in_one_line(ended, before)
        expect(line.verdict != options.REFUSED, f"taken: {ended}")
        if "results written to " not in ended.out:
            if ended.code or not ended.out.strip() or folder_content(Path()) != before:
                raise UnclearError(ended)
            return RIGHT
        if ended.code not in (0, 1):
            raise UnclearError(ended)
        expect_clear(ended, line.is_verbose)
        if line.is_cut:
            return RIGHT  # it may run another case, in another folder
        results = Results(Path(line.out))
        results.check(ended.code == 0)
        if line.odd:
            check_odd_word(*line.odd, results.case)
        else:
            compare_with_line(line, results.case)
        folder = line.checkpoint and Path(line.checkpoint)
        kept = Path(line.out, "checkpoint") if folder == "" else folder
        results.check_checkpoint(kept)
        return RIGHT


def check_odd_word(path, word, case):
    """Check that a number that was taken is the one that TOML or Python reads."""
    table, key = path.split(".")
    if isinstance(value := case.get(table, {}).get(key), float):
        try:
            number = tomllib.loads(f"x = {word}")["x"]
        except tomllib.TOMLDecodeError:
            number = word
        expect_equal(path, value, float(number))


def compare_with_line(line, case):
    """Check a written case for the values of the line, and defaults otherwise."""
    expected, scene = defaults(line.scene), SCENES[line.scene].declaration
    source = options.kind_of_mesh(line.scene, line.values)
    expected["mesh"] = {"source": source, "as_is": False}
    if source == options.GRADED:
        expected["mesh"] |= {"density": 1.0}
    elif source in options.MESHES:
        expected["mesh"] |= {"size": [*scene.size], "jitter": scene.jitter, "seed": 1}
    name = options.formulation(line.values)
    if name in line.values.values() or name != expected["formulation"]["name"]:
        expected["formulation"] = {"name": name}
    expected["output"] = expected["output"] | {"pictures": False}
    for path, value in line.values.items():
        table, key = path.split(".")
        expected[table] = expected[table] | {key: value}
    expect_equal("differences", list(differences("", expected, case)), [])


@cache
def text_of_defaults(scene):
    with TemporaryDirectory() as folder:
        file = Path(folder, "case.toml")
        run_line(["init", str(file), "--scene", scene])
        return file.read_text(encoding="utf-8")


def defaults(scene):
    return tomllib.loads(text_of_defaults(scene))


def fill_folder(is_strip):
    """Create the files that words may name:

    meshes, valid and damaged, and obstacles.
    """
    sides = (40.0, 60.0) if is_strip else (100.0, 100.0)
    x, y = np.meshgrid(*(np.linspace(0, side, 3) for side in sides))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
    triangles = np.vstack([quads[:, :3], quads[:, [0, 2, 3]]])
    for kind, cells in (("quad", quads), ("triangle", triangles)):
        meshio.Mesh(points, {kind: cells}).write(f"{kind}s good.vtu")
    junk = bytes(range(256)) * 4
    for name in ("folder", "there", "blocked/summary.json", "junk"):
        Path(name).mkdir(parents=True)
    for name in ("junk.msh", "junk.vtu", "junk.inp", "file", "junk/run.npz"):
        Path(name).write_bytes(junk)
    Path("junk", "state_000000.npz").write_bytes(junk)
    Path("empty.vtu").touch()
    Path("curve.csv").write_text("displacement (mm),force (N)\n0,0\n5,2\n")
    Path("there", "summary.json").write_text("of an earlier run")


# Case files

# Files beside a case file.
SHEAR = "shear angle (deg),moment (N mm/mm2)\n0,0\n20,0.05\n40,0.2\n85,2.5\n"
TEST = "displacement (mm),force (N),angle (deg)\n0,0,0\n2,1.5,5\n4,3.5,10\n"

# A case with more elements or steps takes long and is not run.
MOST_ELEMENTS, MOST_STEPS = 100, 4

# Values of other kinds, or valid for few keys only.
ODD = (
    *("nan", "-inf", "1e400", "true", "''", '"\\u0000"', "[]", "{}", "[1, 'a']"),
    *("1979-05-27", "0x10", "-1", "0", "1_0", '"free"', "[[1]]", "{a = 1}", "1e308"),
    *('"é\\n"', '"..\\u001b[2J"', '"auto"', '"case.toml"', "9" * 30, "9" * 5000),
)


class CaseFile(NamedTuple):
    """A case and its files, of which one may be damaged.

    ``is_again`` is True if the written case runs again.
    """

    damage: str
    files: dict[str, bytes]
    is_again: bool


@st.composite
def case_files(draw):
    text = options.case_text(lambda *of: draw(st.sampled_from(of)))
    files = {"case.toml": text, "shear.csv": SHEAR, "test.csv": TEST}
    name = draw(st.sampled_from(("case.toml",) * 3 + ("shear.csv", "test.csv")))
    if name == "case.toml" and draw(st.integers(0, 4)) < 2:
        lines, damage = text.splitlines(), "odd value"
        entries = [i for i, line in enumerate(lines) if " = " in line]
        i, odd = draw(st.sampled_from(entries)), draw(st.sampled_from(ODD))
        lines[i] = f"{lines[i].partition(' = ')[0]} = {odd}"
        content = "\n".join([*lines, ""]).encode()
    else:
        content, damage = draw(damaged(files[name].encode()))
    files = {key: text.encode() for key, text in files.items()} | {name: content}
    return CaseFile(damage, files, draw(st.integers(0, 2)) == 0)


def attempt_case(hostile):
    for name, content in hostile.files.items():
        Path(name).write_bytes(content)
    if takes_long(hostile.files["case.toml"]):
        return RIGHT
    before = folder_content(Path())
    ended = run_line(["run", "case.toml", "--out", "out"])
    if ended.code == 2:
        expect(hostile.damage, f"a sound case is refused: {ended.err}")
        return rejected_in_one_line(ended, before)
    messages = [line for line in ended.err.splitlines() if line.startswith(PREFIX)]
    if ended.code not in (0, 1) or len(messages) != ended.code:
        raise UnclearError(ended)
    tables = tomllib.loads(hostile.files["case.toml"].decode("utf-8-sig"))
    written = tomllib.loads(Path("out", "case.toml").read_text(encoding="utf-8"))
    expect_equal("differences", list(differences("", tables, written)), [])
    if hostile.is_again and ended.code == 0:
        again = run_line(["run", "out/case.toml", "--out", "again"])
        expect(not again.code, f"the written case ends with {again}")
        for name in ("case.toml", "history.csv", "curve.csv"):
            files = (Path(out, name).read_bytes() for out in ("out", "again"))
            expect(len({*files}) == 1, f"the written case has another {name}")
    return RIGHT


def takes_long(content):
    """True if a file contains numbers of steps or elements that take long."""
    try:
        case = tomllib.loads(content.decode("utf-8-sig"))
        stepping, mesh = case.get("stepping", {}), case.get("mesh", {})
        elements = math.prod(abs(float(n)) for n in mesh.get("size") or (10, 15))
        is_many = stepping.get("steps", 20) > MOST_STEPS or elements > MOST_ELEMENTS
        return is_many or "tolerance" in stepping
    except (ValueError, TypeError, AttributeError, OverflowError, RecursionError):
        return False  # without a case it is rejected


FAMILIES = (
    Family("options", options.any_line(), attempt_line, 2500, 60, SECONDS),
    Family("case files", {"": case_files()}, attempt_case, 2000, 25, SECONDS / 2),
)


@pytest.mark.dear("random lines of the whole command line")
def test_a_line_is_rejected_or_runs_as_written():
    FAMILIES[0].check(4)


@pytest.mark.dear("random case files")
def test_a_case_file_is_rejected_or_runs_as_written():
    FAMILIES[1].check(2)
