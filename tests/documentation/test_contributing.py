"""The code in CONTRIBUTING.md works as printed."""

import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import skfem_textile
from conftest import CORE

PACKAGE = Path(skfem_textile.__file__).parent
TEXT = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text()
SHOWN = r"file\s+`(skfem_textile/\S+\.py)`:\n\n```python\n(.*?)```"
FILES = dict(re.findall(SHOWN, TEXT, re.DOTALL))
DECLARATION = (
    r"parameters\s+to\s+`(\S+)`(?:,\s+and\s+`(.*?)`\s+to\s+`(\w+)`\s+in\s+`(\S+)`)?:"
)
DECLARATIONS = re.findall(rf"{DECLARATION}\n\n```python\n(.*?)```", TEXT, re.DOTALL)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the package with the files that the page shows."""
    folder = tmp_path_factory.mktemp("checkout")
    ignored = shutil.ignore_patterns("__pycache__", "studies")
    shutil.copytree(PACKAGE, folder / "skfem_textile", ignore=ignored)
    for name, text in FILES.items():
        assert not (folder / name).exists()
        (folder / name).write_text(text)
    for file, member, union, listing, text in DECLARATIONS:
        with (folder / file).open("a") as declarations:
            declarations.write(f"\n\n{text}")
        if union:
            old = (folder / listing).read_text()
            new = re.sub(
                rf"(    {union} = \()(.*?)(\n    \))",
                rf"\1\2 {member}\3",
                old,
                flags=re.S,
            )
            assert new != old
            (folder / listing).write_text(new)
    return folder


#: Runs commands one after another; prints exit code, stdout and stderr of each.
SEVERAL = """
import contextlib, io, json, sys
from skfem_textile.cli.main import main

def told(command):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(command)
        except SystemExit as end:
            code = end.code
    return code, out.getvalue(), err.getvalue()

print(json.dumps([told(command) for command in json.loads(sys.argv[1])]))
"""


def run_commands(checkout, *commands):
    """Exit code, stdout and stderr of commands in the checkout, in one process."""
    child = subprocess.run(
        [sys.executable, "-c", SEVERAL, json.dumps(commands)],
        cwd=checkout,
        env={**os.environ, "PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert child.stderr == ""
    return json.loads(child.stdout)


def test_the_page_shows_a_scene_of_at_most_60_lines_and_a_law():
    assert list(FILES) == [
        "skfem_textile/scenes/lean.py",
        "skfem_textile/fabric/laws/stiffening.py",
    ]
    classes = [re.search(r"class (\w+)", text)[1] for *_, text in DECLARATIONS]
    assert classes == ["Lean", "Stiffening"]
    assert FILES["skfem_textile/scenes/lean.py"].count("\n") <= 60


def test_a_scene_is_added_by_a_file_and_a_declaration(checkout):
    listed, help_text = run_commands(checkout, ["list"], ["run", "lean", "--help"])
    assert "lean " in listed[1]
    assert "shear angle at the end (default: 40.0)" in help_text[1]


def test_a_law_and_a_scene_of_the_page_are_run_together(checkout, tmp_path):
    law = ("--shear-law", "stiffening", "--shear-stiffness", "0.5")
    small = ("--size", "3x3", "--steps", "2", "--no-render", "--shear-angle", "30")
    ways = {
        "rotated": ("--rotate", "20"),
        "one point": ("--formulation", "one-point"),
        "quadratic": ("--formulation", "quadratic"),
    }
    runs = run_commands(
        checkout,
        *(
            ("run", "lean", *small, *law, *command, "--out", str(tmp_path / name))
            for name, command in ways.items()
        ),
    )
    assert [(code, err) for code, _, err in runs] == [(0, "")] * 3
    density = -0.5 * math.log(math.cos(math.radians(30)))
    for name in ways:
        summary = json.loads((tmp_path / name / "summary.json").read_text())
        assert summary["displacement_error_max"] < 1e-9
        assert summary["max_shear_angle_deg"] == pytest.approx(30)
        assert summary["shear_energy"] == pytest.approx(density * 80**2)
        assert summary["inputs"]["shear"]["law"] == "stiffening"


def test_the_core_consists_of_tests_that_exist():
    for module, names in CORE.items():
        defined = re.findall(
            r"^def test_(\w+)\(", (PACKAGE.parent / module).read_text(), re.M
        )
        assert {*names.split()} <= {*defined}, module
