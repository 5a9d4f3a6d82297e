"""Commands, defaults of scenes, and messages for invalid input."""

import json

import meshio
import numpy as np
import pytest

from skfem_textile.cases import SCENES, case_from_tables
from skfem_textile.cli import main as cli
from skfem_textile.declarations.scenes import PlaneScene
from skfem_textile.fabric.catalogue import catalogue
from tests.helpers.command_line import rejected

pytestmark = pytest.mark.usefixtures("no_interval")


def test_list_names_the_scenes_and_fabrics(capsys):
    assert cli.main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [
        *("strip", "picture_frame", "trellis", "bias_extension"),
        *("simple_shear", "specimen", "cantilever", "buckling"),
        *("hemisphere", "cylinder", "double_dome", "saddle", "drape"),
        *("hemisphere_forming", "double_dome_forming", "forming"),
    ]
    assert [line.split()[0] for line in lines] == [*names, "fabrics"]
    assert lines[-1].endswith(", ".join(catalogue()))


def test_the_middle_of_a_long_line_is_elided(tmp_path, capsys):
    out = ("--out", str(tmp_path / "o"))
    message = rejected(capsys, "run", "strip", *out, "--size", "9" * 5000)
    assert len(message) < 500
    assert "argument --size: expected NXxNY, such as 10x15, got '999" in message
    assert " ... " in message


# Results of a run with the defaults of its scene


def plain_run(capsys, scene, out, how):
    """Summary and inputs of a plain run, which prints nothing to stderr.

    The strip, as in the paper without shear stiffness, is an exception: its exact
    energy is zero, and the computed energy is the discretisation error.
    """
    line = ["run", scene, *how.split(), "--no-render", "--out", str(out)]
    assert cli.main(line) == 0
    warnings = capsys.readouterr().err.splitlines()
    assert bool(warnings) == (scene == "strip")
    for warning in warnings:
        assert warning.endswith("the fabric has no shear stiffness, so specify one")
    summary = json.loads((out / "summary.json").read_text())
    in_plane = issubclass(SCENES[scene].declaration, PlaneScene)
    assert summary["formulation"] == ("quadratic" if in_plane else "macro")
    assert summary["stable"]
    assert summary["path_resolved"]
    return summary, summary["inputs"]


IN_PLANE = {
    "displacement_error_rms": (0.0, 0.02),  # mm, of 60 to 100 mm
    "shear_angle_error_rms_deg": (0.0, 0.4),
}
WITHOUT_WRINKLES = {"wrinkle_risk_share_of_area": (0.0, 0.0)}
OF_NET = WITHOUT_WRINKLES | {"shear_angle_error_max_deg": (0.0, 0.05)}
ARCH = {"force_over_exact": (1.0, 3e-3), "height_over_exact": (1.0, 2e-3)}
TIP = {"tip_error_over_length": (0.0, 1e-3)}

#: Reaction of a picture frame of 100 mm with its shear stiffness of 0.5 N/mm.
FORCE = 100 * 0.5 * np.pi / 4 * np.cos(np.pi / 4)


@pytest.mark.parametrize(
    ("scene", "how", "expected"),
    [
        ("strip", "--steps 4", IN_PLANE | {"n_elements": (2 * 150, 0)}),
        ("trellis", "--steps 2", IN_PLANE | {"n_elements": (2 * 100, 0)}),
        (
            "picture_frame",
            "--steps 2",
            IN_PLANE | {"reaction_x": (FORCE, 1e-2 * FORCE)},
        ),
        ("simple_shear", "", IN_PLANE | {"load_over_exact": (1.0, 5e-3)}),
        ("cantilever", "--steps 2 --size 16x1", TIP),
        ("buckling", "--steps 3 --size 12x1", ARCH),
        ("hemisphere", "--size 12x12", OF_NET),
        ("cylinder", "--size 4x4", OF_NET),
        pytest.param(
            *("double_dome", "", WITHOUT_WRINKLES),
            marks=pytest.mark.dear("a coarser mesh warns of its stabilisation"),
        ),
        ("saddle", "--size 4x4", WITHOUT_WRINKLES),
    ],
)
def test_a_plain_run_is_close_to_its_exact_solution(
    tmp_path, capsys, scene, how, expected
):
    """On a tool it has the net, without wrinkles."""
    summary, _ = plain_run(capsys, scene, tmp_path, how)
    for key, (exact, tolerance) in expected.items():
        assert summary[key] == pytest.approx(exact, abs=tolerance)


def test_a_plain_bias_extension_shows_its_three_zones(tmp_path, capsys):
    summary, inputs = plain_run(capsys, "bias_extension", tmp_path, "--steps 4")
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
        ("trellis", ["which they roll; may be repeated", "(default: auto)"]),
    ],
)
def test_the_help_of_a_scene_has_meanings_and_defaults(capsys, scene, message):
    with pytest.raises(SystemExit):
        cli.main(["run", scene, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert [words for words in message if words not in text] == []


def test_only_scenes_in_the_plane_have_a_rotation_option():
    for scene in SCENES.keys() - {"drape", "forming"}:
        dimension = case_from_tables({"scene": {"name": scene}}).scene.dimension
        assert ("rotate_deg" in SCENES[scene].__struct_fields__) == (dimension == 2)
