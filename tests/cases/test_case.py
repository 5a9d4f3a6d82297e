"""Scenes, fabrics, formulations and meshes that options describe."""

import sys

import numpy as np
import pytest

from skfem_textile import Fabric, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.scenes import bias_extension
from tests.helpers.command_line import MESH, QUICK, computed, rejected
from tests.helpers.specimen import save_strip

pytestmark = pytest.mark.usefixtures("no_interval")

# Options of scene, fabric, formulation and solver

SMALL = "--size 2x3 --steps 2 --no-render"


def test_a_solver_is_set_by_name_or_rejected_in_one_line(tmp_path, capsys, monkeypatch):
    assert computed(tmp_path, "strip", SMALL, "--solver superlu")["solver"] == "superlu"
    capsys.readouterr()
    monkeypatch.setitem(sys.modules, "cvxopt.cholmod", None)
    again = ("run", "strip", "--out", str(tmp_path / "b"), *QUICK)
    message = rejected(capsys, *again, "--solver", "cholmod")
    assert "solver 'cholmod' needs cvxopt: pip install cvxopt" in message


def test_a_run_accepts_a_method_checks_and_a_stabilisation_by_name(tmp_path):
    options = '--set stepping.method=plain stepping.warn_only=["stability","work"]'
    options += " formulation.cs_N_per_mm=auto"
    summary = computed(tmp_path, "picture_frame", SMALL, "--shear-angle 10", options)
    stepping = summary["inputs"]["stepping"]
    assert stepping["method"] == "plain"
    assert stepping["warn_only"] == ["stability", "work"]
    assert summary["inputs"]["formulation"]["cs_N_per_mm"] == "auto"


STRAIGHT = "--fibres 20 --weft 100 --bend 0 --shear-stiffness 0"


@pytest.mark.parametrize(
    ("scene", "options", "inputs"),
    [
        ("picture_frame", "--shear-angle 60 --rotate 20", {"shear_angle_deg": 60}),
        ("trellis", "--fibres 10 --weft 80 --bend 0 --rotate 20", {"warp_deg": 10}),
        ("trellis", f"{STRAIGHT} --free right --roller left=60", {"free": ["right"]}),
        (
            "trellis",
            f"{STRAIGHT} --roller top=20 --roller right=-70",
            {"roller_deg": {"top": 20, "right": -70}},
        ),
        ("trellis", f"{STRAIGHT} --free top --free left", {"free": ["top", "left"]}),
    ],
)
def test_frames_are_exact_with_any_sides(tmp_path, scene, options, inputs):
    common = "--size 2x2 --steps 2 --no-render"
    summary = computed(tmp_path, scene, common, options)
    assert summary["scene"] == scene
    assert summary["stable"]
    assert summary["displacement_error_max"] < 1e-9
    assert summary["inputs"]["scene"].items() >= inputs.items()
    shear = 60 if scene == "picture_frame" else 45
    assert summary["max_shear_angle_deg"] == pytest.approx(shear)


def test_half_a_bias_extension_runs_with_given_fibres(tmp_path):
    fibres = "--fibres 40 --shear-stiffness 0.5 --steps 1 --no-render"
    how = "--mesh aligned --mesh-as-is --set formulation.cs_N_per_mm=5"
    whole, half = (
        computed(tmp_path / part, "bias_extension", fibres, how, of)["load_over_exact"]
        for part, of in (("whole", "--size 4x8"), ("half", "--size 2x8 --part half"))
    )
    assert half == pytest.approx(whole, rel=1e-6)
    theta = np.radians(40.0)
    scene = bias_extension("aligned", (4, 8), warp=theta, weft=np.pi - theta)
    fabric = Fabric(1e5, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, Macro(5.0))
    summary = scene.summary(LoadStepper(ply, scene.conditions, 1).run())
    assert whole == pytest.approx(summary["load_over_exact"], rel=1e-9)


@pytest.mark.parametrize("kind", ["energy", "rate"])
def test_a_run_accepts_the_papers_stabilisation(tmp_path, kind):
    options = f"--formulation one-point --set formulation.stabilisation={kind}"
    options += " --shear-stiffness 1 --set formulation.cs_N_per_mm=10 --mesh-as-is"
    few = "--size 2x4 --shear-angle 5 --steps 1 --no-render"
    summary = computed(tmp_path, "bias_extension", few, options)
    scene = bias_extension(size=(2, 4), shear_angle=np.radians(5.0))
    fabric = Fabric(1e5, 1.0, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, OnePoint(10.0, kind))
    expected = LoadStepper(ply, scene.conditions, 1).run().summary()
    found = summary["stabilisation_energy"]
    assert found == pytest.approx(expected["stabilisation_energy"], rel=1e-9)


def test_a_mesh_of_one_element_has_no_jumps(tmp_path, capfd):
    jumps = "--formulation one-point --set formulation.stabilisation=continuity"
    size = "--size 1x1 --steps 1 --no-render --set formulation.cs_N_per_mm=3"
    computed(tmp_path, "picture_frame", jumps, size)
    assert "JumpBasis" not in capfd.readouterr().err


def test_a_force_acts_beside_the_conditions_and_rotates_with_the_scene(tmp_path):
    """The scene has no exact solution then; reactions are along its axes."""
    force = "--force top=2,1", "--shear-stiffness 1"
    plain, turned = (
        computed(tmp_path, "strip", SMALL, *force, "--rotate", angle)
        for angle in ("0", "30")
    )
    for summary in (plain, turned):
        assert summary["inputs"]["loads"]["force_N"] == {"top": [2.0, 1.0]}
        assert "forces act" in summary["exact_answer"]
        assert summary["force on top_potential"] < 0
    for key in ("energy", "reaction_x", "reaction_y"):
        assert turned[key] == pytest.approx(plain[key], rel=1e-6)


# Meshes from options: generated and read; splitting by formulations


def test_a_run_accepts_a_mesh_file_and_full_integration(tmp_path):
    options = f"--mesh {MESH} --formulation full --steps 1 --no-render"
    summary = computed(tmp_path, "strip", options)
    assert summary["formulation"] == "full"
    assert summary["n_elements"] == 184
    assert not {"size", "jitter", "seed"} & summary["inputs"]["mesh"].keys()
    assert summary["energy"] == pytest.approx(162.631, rel=1e-5)


SCENES = "strip", "trellis", "bias_extension", "picture_frame"
ONE_POINT, QUADRATIC = "--formulation one-point", "--formulation quadratic"
MACRO = "--formulation macro"

#: Options of elements; their formulation and their number in a cell of a grid.
ELEMENTS = [
    ("", "auto", 2),
    ("--formulation macro", "macro", 4),
    ("--set formulation.cs_N_per_mm=4", "macro", 4),
    (ONE_POINT, "one-point", 1),
    (QUADRATIC, "quadratic", 2),
    ("--mesh delaunay --formulation macro", "macro", 6),
    (f"--mesh delaunay {ONE_POINT}", "one-point", 6),
    (f"--mesh delaunay {QUADRATIC}", "quadratic", 2),
]


@pytest.mark.parametrize(
    ("scene", "more", "formulation", "parts"),
    [
        (scene, *elements)
        for scene in SCENES
        for i, elements in enumerate(ELEMENTS)
        if scene == "strip" or i == 5
    ],
)
def test_every_scene_has_every_kind_of_elements(
    tmp_path, scene, more, formulation, parts
):
    """Quadratic elements without singular fibres, unless another one is named."""
    common = "--size 2x2 --steps 1 --no-render --shear-stiffness 0.5 --mesh irregular"
    common += " --mesh-as-is" * (scene != "strip")
    summary = computed(tmp_path, scene, common, more, "--rotate 30")
    assert summary["n_elements"] == parts * 4
    assert summary["inputs"]["formulation"]["name"] == formulation
    formulation = formulation.replace("auto", "quadratic")
    assert summary["formulation"] == formulation
    assert summary["inputs"]["mesh"]["size"] == [2, 2]
    of_user = 2 if "delaunay" in more else 1
    own = list((tmp_path / "fields").glob("own_step_*.vtu"))
    states = summary["load_steps"] + 1
    assert len(own) == (states if parts != of_user else 0)
    assert len(list((tmp_path / "fields").glob("step_*.vtu"))) == states
    if formulation == "quadratic":
        assert summary["max_fibre_strain"] < summary["mesh_fibre_strain"]


@pytest.mark.parametrize(
    ("cells", "options", "elements"),
    [
        ("triangles", MACRO, 3 * 8),
        ("quadrilaterals", MACRO, 4 * 4),
        ("both", MACRO, 3 * 6),
        ("triangles", QUADRATIC, 8),
        ("quadrilaterals", QUADRATIC, 8),
        ("both", QUADRATIC, 8),
        ("both", "", 8),
    ],
)
def test_cells_of_a_file_are_split_or_cut(tmp_path, cells, options, elements):
    mesh = save_strip(tmp_path / "m.msh", cells)
    few = "--steps 1 --no-render"
    summary = computed(tmp_path / "out", "strip", "--mesh", mesh, options, few)
    assert summary["n_elements"] == elements
    assert summary["formulation"] == ("macro" if options == MACRO else "quadratic")
