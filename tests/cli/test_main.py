"""Commands, defaults of scenes, and messages for invalid input."""

import json

import meshio
import numpy as np
import pytest

from skfem_textile.cases import SCENES, case_from_tables
from skfem_textile.cli import main as cli
from tests.helpers.command_line import QUICK, rejected

# Commands, and responses to invalid input, signals and unusual words


def test_list_names_the_scenes(capsys):
    assert cli.main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [
        *("strip", "picture_frame", "trellis", "bias_extension", "specimen"),
        *("cantilever", "buckling"),
        *("hemisphere", "cylinder", "double_dome", "saddle", "drape"),
        *("hemisphere_forming", "double_dome_forming", "forming"),
    ]
    assert [line.split()[0] for line in lines] == names


def test_an_unknown_scene_is_rejected(tmp_path, capsys):
    error = rejected(capsys, "run", "stripe", "--out", str(tmp_path))
    assert "'stripe'" in error
    assert "strip" in error


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--set", "formulation.cs_N_per_mm=-1"), "stabilisation must be"),
        (("--set", "formulation.cs_N_per_mm=much"), "expected one of a number, auto"),
        (("--shear-law", "sin2", "--shear-stiffness", "-1"), "shear stiffness must be"),
        (("--fibre-stiffness", "-5"), "tension stiffness must be"),
        (("--fibre-stiffness", "0"), "no stiffness"),
        (("--shear-stiffness", "nan"), "must be a finite number, got nan"),
        (("--steps", "0"), "steps must be a whole number"),
        (
            ("--steps", "99999999999999999999999"),
            "from 1 to 1000000, got 99999999999999999999999",
        ),
        (("--size", "10"), "expected NXxNY, such as 10x15, got '10'"),
        (("--size", "0x5"), "at least 1x1"),
        (("--size", "1000000x1000000"), "llocate"),
        (("--size", "99999999999x1"), "mesh.size must be an integer <= 1000000"),
        (("--set", "mesh.jitter=2"), "jitter must be at least 0 and below 1"),
        (("--set", "mesh.seed=-1"), "seed must be"),
        (("--rotate", "nan"), "scene.rotate_deg must be a finite number"),
        (("--rotate", "1e17"), "scene.rotate_deg must be a number <= 36000.0"),
        (
            ("--mesh", "curly"),
            "mesh.source curly is neither an existing file nor one of graded",
        ),
        (("--formulation", "fuller"), "--formulation"),
        (
            ("--set", "formulation.stabilisation=magic"),
            "requires that formulation.name is one-point",
        ),
        (("--set", "stepping.method=magic"), "'magic': expected one of"),
        (("--set", "stepping.warn_only=['magic']"), "stepping.warn_only is 'magic'"),
        (("--set", "stepping.methods=newton"), "did you mean 'method'"),
        (("--set", "steps=4"), "such as stepping.steps=5, got 'steps=4'"),
        (("--set", "scene.name.x=4"), "name is a value, not a table"),
        (("--set", "mesh.size=3"), "mesh.size must be an array, got an integer"),
        (("--set", "scene.name=trellis"), "name the scene after `run`"),
        (("--set", "mesh.seed=2", "mesh.seed=3"), "mesh.seed is given twice"),
        (("--set", "stepping.steps=2\nfoo=9"), "stepping.steps must be an integer"),
        (
            ("--set", f"scene.{'a.' * 1500}b=1"),
            "expected KEY=VALUE, such as stepping.steps=5",
        ),
        (("--set", "formulation.name=x - at $.y"), "is 'x - at $.y': expected one of"),
        (("--set", "tension.file=a.csv"), "a table of a law has no key"),
    ],
)
def test_invalid_input_is_rejected_before_output(tmp_path, capsys, arguments, message):
    out = str(tmp_path / "out")
    error = rejected(capsys, "run", "strip", "--out", out, "--no-render", *arguments)
    assert message in error
    assert list(tmp_path.iterdir()) == []


def test_usual_notations_of_numbers_are_accepted(tmp_path):
    options = ("--force", "top=.5,1.", "--set", "scene.rotate_deg=.5", "mesh.seed=02")
    assert cli.main(["run", "strip", *QUICK, *options, "--out", str(tmp_path)]) == 0
    inputs = json.loads((tmp_path / "summary.json").read_text())["inputs"]
    assert inputs["loads"]["force_N"] == {"top": [0.5, 1.0]}
    assert (inputs["scene"]["rotate_deg"], inputs["mesh"]["seed"]) == (0.5, 2)


def test_invalid_numbers_are_rejected(capsys, tmp_path):
    out = ("--out", str(tmp_path / "o"))
    message = rejected(capsys, "run", "trellis", "--fibres", "nan", *out)
    assert "scene.warp_deg must be a finite number" in message


def test_the_middle_of_a_long_line_is_elided(tmp_path, capsys):
    out = ("--out", str(tmp_path / "o"))
    message = rejected(capsys, "run", "strip", *out, "--size", "9" * 5000)
    assert len(message) < 500
    assert "argument --size: expected NXxNY, such as 10x15, got '999" in message
    assert " ... " in message


@pytest.mark.parametrize("word", ["--size=--", "--out=--"])
def test_two_dashes_are_rejected_as_a_value(tmp_path, capsys, word):
    message = rejected(capsys, "run", "strip", "--out", str(tmp_path), word, *QUICK)
    assert "expected a value, got" in message


def test_a_folder_name_that_looks_like_an_option_is_rejected(tmp_path, capsys):
    out = ["--out", str(tmp_path / "out")]
    message = rejected(capsys, "run", "strip", *QUICK, *out, "--resume", "--paper x")
    assert "'--paper x' is not an option" in message


@pytest.mark.parametrize("option", ["--out", "--checkpoint", "--resume"])
def test_a_folder_without_a_name_is_rejected(tmp_path, capsys, monkeypatch, option):
    monkeypatch.chdir(tmp_path)
    message = rejected(capsys, "run", "strip", *QUICK, "--out", "o", option, "")
    assert f"argument {option}: the name of a folder must not be empty" in message
    assert list(tmp_path.iterdir()) == []


# Results of a run with only the scene specified


def plain_run(capsys, scene, out):
    """Summary and inputs of a plain run, which prints nothing to stderr.

    The strip, as in the paper without shear stiffness, is an exception: its exact
    energy is zero, and the computed energy is the discretisation error.
    """
    assert cli.main(["run", scene, "--no-render", "--out", str(out)]) == 0
    warnings = capsys.readouterr().err.splitlines()
    assert bool(warnings) == (scene == "strip")
    for warning in warnings:
        assert warning.endswith("the fabric has no shear stiffness, so specify one")
    summary = json.loads((out / "summary.json").read_text())
    is_graded = summary["inputs"]["mesh"]["source"] == "graded"
    assert summary["formulation"] == ("quadratic" if is_graded else "macro")
    assert summary["stable"]
    assert summary["path_resolved"]
    return summary, summary["inputs"]


@pytest.mark.parametrize("scene", ["strip", "picture_frame", "trellis"])
def test_a_plain_run_is_close_to_its_exact_solution(tmp_path, capsys, scene):
    summary, inputs = plain_run(capsys, scene, tmp_path)
    assert summary["displacement_error_rms"] < 0.02  # mm, of 60 to 100 mm
    assert summary["shear_angle_error_rms_deg"] < 0.4
    if scene != "picture_frame":  # its mesh is graded
        assert summary["n_elements"] == 4 * np.prod(inputs["mesh"]["size"])
    if scene == "picture_frame":  # it follows from its shear stiffness
        gamma = np.pi / 4
        expected = 100 * inputs["shear"]["stiffness_N_per_mm"] * gamma * np.cos(gamma)
        assert summary["reaction_x"] == pytest.approx(expected, rel=1e-2)


@pytest.mark.usefixtures("no_interval")
@pytest.mark.parametrize("scene", ["cantilever", "buckling"])
def test_a_plain_run_in_space_is_close_to_its_exact_solution(tmp_path, capsys, scene):
    summary, _ = plain_run(capsys, scene, tmp_path)
    if scene == "cantilever":
        assert summary["tip_error_over_length"] < 1e-3
    else:
        assert summary["force_over_exact"] == pytest.approx(1.0, abs=3e-3)
        assert summary["height_over_exact"] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.usefixtures("no_interval")
@pytest.mark.parametrize("scene", ["hemisphere", "cylinder", "double_dome", "saddle"])
def test_a_plain_run_on_a_tool_gives_the_net(tmp_path, capsys, scene):
    summary, _ = plain_run(capsys, scene, tmp_path)
    assert summary["wrinkle_risk_share_of_area"] == 0
    if scene in ("hemisphere", "cylinder"):
        assert summary["shear_angle_error_max_deg"] < 0.05


def test_the_other_scenes_are_the_bias_extension():
    others = {"strip", "picture_frame", "trellis", "cantilever", "buckling"}
    tools = {"hemisphere", "cylinder", "double_dome", "saddle", "drape"}
    formed = {"hemisphere_forming", "double_dome_forming", "forming"}
    assert set(SCENES) - others - tools - formed == {"bias_extension", "specimen"}


@pytest.mark.usefixtures("no_interval")
def test_a_plain_bias_extension_shows_its_three_zones(tmp_path, capsys):
    summary, inputs = plain_run(capsys, "bias_extension", tmp_path)
    fibres, shear = (inputs[law]["stiffness_N_per_mm"] for law in ("tension", "shear"))
    assert fibres / shear >= 2e5
    expected = 1 - summary["load_lost_to_fibre_stretch"]
    assert summary["load_over_exact"] == pytest.approx(expected, abs=0.01)
    last = meshio.read(tmp_path / "fields" / f"step_{summary['load_steps']:04d}.vtu")
    centre = last.points[last.cells[0].data, :2].mean(axis=1)
    angle = last.cell_data["shear_angle"][0]

    def mean_near(x, y):
        return angle[np.linalg.norm(centre - (x, y), axis=1) < 8].mean()

    assert mean_near(25, 50) == pytest.approx(40, abs=2)
    assert mean_near(25, 5) == pytest.approx(0, abs=2)
    assert mean_near(8, 25) == pytest.approx(20, abs=2)


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ("bias_extension", ["(default: graded)", "(default: 100000.0)"]),
        ("strip", ["(default: 10x15)", "(default: 10000.0)", "(default: 0.0)"]),
        ("trellis", ["(default: 10000.0)", "(default: 0.5)", "(default: macro)"]),
    ],
)
def test_the_help_of_a_scene_lists_its_defaults(capsys, scene, message):
    with pytest.raises(SystemExit):
        cli.main(["run", scene, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    for words in message:
        assert words in text


@pytest.mark.parametrize("scene", sorted(SCENES.keys() - {"drape", "forming"}))
def test_only_scenes_in_the_plane_have_a_rotation_option(scene):
    dimension = case_from_tables({"scene": {"name": scene}}).scene.dimension
    assert ("rotate_deg" in SCENES[scene].__struct_fields__) == (dimension == 2)


def test_other_laws_replace_the_defaults_of_a_scene(tmp_path, capsys):
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
    message = rejected(capsys, *command, "--shear-stiffness", "0.4")
    assert "shear.stiffness_N_per_mm requires that shear.law is linear" in message
