"""What a run shows of which nothing but the scene is said."""

import json

import meshio
import numpy as np
import pytest

from skfem_textile.cases import SCENES, case_from_tables
from skfem_textile.cli import main as cli
from tests.helpers.command_line import refused


def plain_run(capsys, scene, out):
    """Summary and inputs of a plain run; it says nothing on stderr.

    But for the strip, as in the paper without shear stiffness: its energy should be
    zero, and what there is, is of the discretisation.
    """
    assert cli.main(["run", scene, "--no-render", "--out", str(out)]) == 0
    warnings = capsys.readouterr().err.splitlines()
    assert bool(warnings) == (scene == "strip")
    for warning in warnings:
        assert warning.endswith("the fabric has no shear stiffness, give it one")
    summary = json.loads((out / "summary.json").read_text())
    assert summary["formulation"] == "macro"
    assert summary["stable"]
    assert summary["path_resolved"]
    return summary, summary["inputs"]


@pytest.mark.parametrize("scene", ["strip", "picture_frame", "trellis"])
def test_a_plain_run_comes_near_its_exact_answer(tmp_path, capsys, scene):
    summary, inputs = plain_run(capsys, scene, tmp_path)
    assert summary["displacement_error_rms"] < 0.02  # mm, of 60 to 100 mm
    assert summary["shear_angle_error_rms_deg"] < 0.4
    assert summary["n_elements"] == 4 * np.prod(inputs["mesh"]["size"])


@pytest.mark.parametrize("scene", ["cantilever", "buckling"])
def test_a_plain_run_in_space_comes_near_its_exact_answer(tmp_path, capsys, scene):
    summary, _ = plain_run(capsys, scene, tmp_path)
    if scene == "cantilever":
        assert summary["tip_error_over_length"] < 1e-3
    else:
        assert summary["force_over_exact"] == pytest.approx(1.0, abs=3e-3)
        assert summary["height_over_exact"] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("scene", ["hemisphere", "cylinder", "double_dome", "saddle"])
def test_a_plain_run_on_a_tool_finds_the_net(tmp_path, capsys, scene):
    summary, _ = plain_run(capsys, scene, tmp_path)
    assert summary["wrinkle_risk_share_of_area"] == 0
    if scene in ("hemisphere", "cylinder"):
        assert summary["shear_angle_error_max_deg"] < 0.05


def test_the_other_scenes_are_the_bias_extension():
    others = {"strip", "picture_frame", "trellis", "cantilever", "buckling"}
    tools = {"hemisphere", "cylinder", "double_dome", "saddle", "drape"}
    assert set(SCENES) - others - tools == {"bias_extension", "specimen"}


def test_a_plain_picture_frame_has_the_load_of_its_shear_stiffness(tmp_path, capsys):
    summary, inputs = plain_run(capsys, "picture_frame", tmp_path)
    gamma = np.pi / 4
    expected = 100 * inputs["shear"]["stiffness_N_per_mm"] * gamma * np.cos(gamma)
    assert summary["reaction_x"] == pytest.approx(expected, rel=1e-2)


def test_a_plain_bias_extension_shows_its_three_zones(tmp_path, capsys):
    summary, inputs = plain_run(capsys, "bias_extension", tmp_path)
    fibres, shear = (inputs[law]["stiffness_N_per_mm"] for law in ("tension", "shear"))
    assert fibres / shear >= 2e5
    assert summary["load_over_exact"] == pytest.approx(1.0, abs=0.05)
    last = meshio.read(tmp_path / "fields" / f"step_{summary['load_steps']:04d}.vtu")
    centre = last.points[last.cells[0].data, :2].mean(axis=1)
    angle = last.cell_data["shear_angle"][0]

    def mean_near(x, y):
        return angle[np.linalg.norm(centre - (x, y), axis=1) < 8].mean()

    assert mean_near(25, 50) == pytest.approx(40, abs=2)
    assert mean_near(25, 5) == pytest.approx(0, abs=2)
    assert mean_near(8, 25) == pytest.approx(20, abs=2)


@pytest.mark.parametrize(
    ("scene", "said"),
    [
        ("bias_extension", ["(default: 8x16)", "(default: 100000.0)"]),
        ("strip", ["(default: 10x15)", "(default: 10000.0)", "(default: 0.0)"]),
        ("trellis", ["(default: 10000.0)", "(default: 0.5)", "(default: macro)"]),
    ],
)
def test_the_help_of_a_scene_tells_its_own_defaults(capsys, scene, said):
    with pytest.raises(SystemExit):
        cli.main(["run", scene, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    for words in said:
        assert words in text


@pytest.mark.parametrize("scene", [name for name in SCENES if name != "drape"])
def test_scenes_in_the_plane_alone_offer_to_be_turned(scene):
    dimension = case_from_tables({"scene": {"name": scene}}).scene.dimension
    assert ("rotate_deg" in SCENES[scene].__struct_fields__) == (dimension == 2)


def test_defaults_of_a_scene_do_not_stand_in_the_way_of_other_laws(tmp_path, capsys):
    out = ("--no-render", "--size", "2x4", "--steps", "1", "--out", str(tmp_path / "o"))
    polynomial = (
        "--shear-law",
        "polynomial",
        "--set",
        "shear.coefficients_N_per_mm=[0.5]",
    )
    command = ("run", "bias_extension", *polynomial, *out)
    assert cli.main(command) == 0
    capsys.readouterr()
    said = refused(capsys, *command, "--shear-stiffness", "0.4")
    assert "shear.stiffness_N_per_mm goes with shear.law linear" in said
