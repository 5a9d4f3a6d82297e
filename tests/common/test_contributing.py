"""What CONTRIBUTING.md shows works as it is printed there."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import skfem_textile

PACKAGE = Path(skfem_textile.__file__).parent
TEXT = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text()
SHOWN = r"`(skfem_textile/\S+\.py)`:\n\n```python\n(.*?)```"
FILES = dict(re.findall(SHOWN, TEXT, re.DOTALL))


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the package with the files that the page shows."""
    folder = tmp_path_factory.mktemp("checkout")
    ignored = shutil.ignore_patterns("__pycache__", "studies")
    shutil.copytree(PACKAGE, folder / "skfem_textile", ignore=ignored)
    for name, text in FILES.items():
        assert not (folder / name).exists()
        (folder / name).write_text(text)
    return folder


def skfem(checkout, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "skfem_textile", *arguments],
        cwd=checkout,
        env={**os.environ, "PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_page_shows_a_scene_of_at_most_60_lines_and_a_law():
    assert list(FILES) == [
        "skfem_textile/scenes/lean.py",
        "skfem_textile/fabric/laws/cubic.py",
    ]
    assert FILES["skfem_textile/scenes/lean.py"].count("\n") <= 60


def test_a_scene_is_added_by_one_file(checkout):
    assert "lean " in skfem(checkout, "list").stdout
    told = skfem(checkout, "run", "lean", "--help").stdout
    assert "shear angle at the end (default: 40.0)" in told


@pytest.mark.parametrize(
    "mesh",
    [
        ("--rotate", "20"),
        ("--formulation", "one-point"),
        ("--formulation", "quadratic"),
    ],
)
def test_a_law_and_a_scene_of_the_page_are_run_together(checkout, tmp_path, mesh):
    law = ("--shear-law", "cubic", "--shear-stiffness", "0.5")
    small = ("--size", "3x3", "--steps", "2", "--no-render", "--shear-angle", "30")
    command = ("run", "lean", *small, *law, *mesh, "--out", str(tmp_path / "out"))
    child = skfem(checkout, *command)
    assert (child.returncode, child.stderr) == (0, "")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["displacement_error_max"] < 1e-9
    assert summary["max_shear_angle_deg"] == pytest.approx(30)
    gamma = 0.5235987755982988
    density = 0.5 * (gamma**2 / 2 + gamma**4 / 4)
    assert summary["shear_energy"] == pytest.approx(density * 80**2)
    assert summary["inputs"]["shear_law"] == "cubic"
