"""The case that a run leaves: a run of it gives the same results."""

import shutil
import tomllib
from itertools import pairwise

import numpy as np
import pytest

from skfem_textile import Fabric, Sin2
from skfem_textile.cases import case_from_file
from skfem_textile.cli import main as cli
from skfem_textile.fabric.directions import FibreDirections, directions_of
from skfem_textile.fabric.files import write_law
from skfem_textile.io import write_directions, write_fabric
from skfem_textile.scenes import bias_extension
from tests.helpers.command_line import MESH
from tests.helpers.specimen import SPECIMEN, assert_runs_alike, run, summary_of, written

OF_FILES = """
[scene]
name = "bias_extension"
[mesh]
size = [3, 6]
directions = "fibres.csv"
[fabric]
file = "cloth.inp"
thickness_mm = 0.2
[stepping]
steps = 2
solver = "superlu"
[output]
pictures = false
"""


def test_a_run_of_the_written_case_is_the_same_bit_for_bit(tmp_path):
    outs = [tmp_path / name for name in ("a", "b", "c")]
    assert run(written(tmp_path), outs[0]) == 0
    shutil.rmtree(tmp_path / "tables")  # the results have a copy
    for before, after in pairwise(outs):
        assert_runs_alike(before, after, "curve.csv")
    first, last = (summary_of(out) for out in (outs[0], outs[-1]))
    assert [first.pop("inputs"), last.pop("inputs")]
    assert first == last


def test_a_run_of_the_written_case_is_the_same_with_the_solver_of_the_machine(tmp_path):
    auto = SPECIMEN.replace('solver = "superlu"', 'solver = "auto"')
    assert run(written(tmp_path, auto), tmp_path / "a") == 0
    assert run(tmp_path / "a" / "case.toml", tmp_path / "b") == 0
    first, last = (
        np.loadtxt(tmp_path / out / "curve.csv", delimiter=",", skiprows=1)
        for out in "ab"
    )
    assert np.abs(first - last).max() <= 1e-10 * np.abs(first).max()


def test_a_line_and_the_case_that_it_leaves_are_the_same(tmp_path):
    """On a mesh of triangles from a file."""
    line = ["run", "strip", "--mesh", str(MESH), "--steps", "2", "--no-render"]
    laws = ["--shear-law", "sin2", "--shear-stiffness", "1", "--solver", "superlu"]
    laws += ["--formulation", "one-point"]
    assert (
        cli.main([*line, *laws, "--force", "top=1,0", "--out", str(tmp_path / "a")])
        == 0
    )
    copied = tmp_path / "a" / "case_files" / "mesh.msh"
    assert copied.read_bytes() == MESH.read_bytes()
    assert_runs_alike(tmp_path / "a", tmp_path / "b")


def test_a_law_of_a_file_is_beside_the_written_case(tmp_path):
    write_law(Sin2(0.3), tmp_path / "law.json")
    line = ["run", "strip", "--size", "3x4", "--steps", "2", "--no-render"]
    line += ["--shear-law", str(tmp_path / "law.json")]
    assert cli.main([*line, "--out", str(tmp_path / "a")]) == 0
    (tmp_path / "law.json").unlink()
    assert case_from_file(tmp_path / "a" / "case.toml").fabric.shear_law == Sin2(0.3)
    assert cli.main([*line[:-2], "--out", str(tmp_path / "a")]) == 0
    assert not (tmp_path / "a" / "case_files" / "shear.json").exists()


def test_directions_and_fabric_are_of_files_beside_the_case(tmp_path):
    """And of the results, whose case has copies of them."""
    scene = bias_extension(size=(3, 6))
    own = Fabric(warp=scene.warp, weft=scene.weft)
    given = directions_of(scene.mesh, own)
    turned = FibreDirections.of_angles(*(angle + 5 for angle in given.angles_deg()))
    inputs = tmp_path / "inputs"
    inputs.mkdir()
    write_directions(inputs / "fibres.csv", scene.mesh, turned)
    write_fabric(inputs / "cloth.inp", Fabric(1e5, Sin2(0.3)), 0.2)
    (inputs / "one.toml").write_text(OF_FILES)
    assert run(inputs / "one.toml", tmp_path / "a") == 0
    case = case_from_file(inputs / "one.toml")
    gamma = np.array([0.5])
    assert case.fabric.shear_law.value(gamma) == pytest.approx(
        Sin2(0.3).value(gamma), rel=1e-4
    )
    shutil.rmtree(inputs)
    assert_runs_alike(tmp_path / "a", tmp_path / "b", "fibres.csv")
    text = (tmp_path / "a" / "case.toml").read_text()
    assert "[tension]" not in text
    assert tomllib.loads(text)["fabric"] == {
        "file": "case_files/fabric.inp",
        "thickness_mm": 0.2,
        "units": "N mm",
    }
