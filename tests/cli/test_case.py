"""Scenes, fabrics, formulations and meshes that options describe."""

import json
import sys

import meshio
import numpy as np
import pytest

from skfem_textile import Fabric, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.cli import main as cli
from skfem_textile.cli import results
from skfem_textile.scenes import bias_extension, strip
from tests.helpers.command_line import MESH, QUICK, rejected, run

pytestmark = pytest.mark.usefixtures("no_interval")

# Options of scene, fabric, formulation and solver


WARN_ONLY = 'stepping.warn_only=["stability", "work"]'


def test_a_solver_is_set_by_name_or_rejected_in_one_line(tmp_path, capsys, monkeypatch):
    assert run(tmp_path, *QUICK, "--solver", "superlu") == 0
    capsys.readouterr()
    monkeypatch.setitem(sys.modules, "cvxopt.cholmod", None)
    again = ("run", "strip", "--out", str(tmp_path / "b"), *QUICK)
    message = rejected(capsys, *again, "--solver", "cholmod")
    assert "solver 'cholmod' needs cvxopt: pip install cvxopt" in message


def test_a_run_accepts_a_method_and_checks_by_name(tmp_path):
    arguments = ("--set", "stepping.method=plain", WARN_ONLY)
    assert run(tmp_path, *QUICK, *arguments) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["inputs"]["stepping"]["method"] == "plain"
    assert summary["inputs"]["stepping"]["warn_only"] == ["stability", "work"]


@pytest.mark.parametrize(
    ("scene", "options", "shear"),
    [
        ("picture_frame", ("--shear-angle", "60"), 60),
        ("trellis", ("--fibres", "10", "--weft", "80", "--bend", "0"), 45),
    ],
)
def test_the_frames_run_by_name(tmp_path, scene, options, shear):
    out = tmp_path / "out"
    common = ("--size", "4x4", "--steps", "2", "--rotate", "20", "--no-render")
    assert cli.main(["run", scene, "--out", str(out), *common, *options]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["scene"] == scene
    assert summary["stable"]
    assert summary["max_shear_angle_deg"] == pytest.approx(shear)
    assert summary["displacement_error_max"] < 1e-9


@pytest.mark.parametrize(
    ("options", "rollers"),
    [
        (("--free", "right", "--roller", "left=60"), {"left": 60}),
        (
            ("--roller", "top=20", "--roller", "right=-70"),
            {"top": 20, "right": -70},
        ),
    ],
)
def test_sides_may_be_free_or_on_inclined_rollers(tmp_path, options, rollers):
    out = tmp_path / "out"
    common = ("--size", "4x4", "--steps", "3", "--no-render", "--bend", "0")
    fibres = ("--fibres", "20", "--weft", "100", "--shear-stiffness", "0")
    command = ["run", "trellis", "--out", str(out), *common, *fibres, *options]
    assert cli.main(command) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["displacement_error_max"] < 1e-9
    assert summary["inputs"]["scene"]["roller_deg"] == rollers


def test_several_sides_may_be_free(tmp_path):
    free = ("--free", "top", "--free", "left")
    out = tmp_path / "out"
    size = ("--size", "3x3", "--steps", "1", "--no-render")
    assert cli.main(["run", "trellis", "--out", str(out), *size, *free]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["inputs"]["scene"]["free"] == ["top", "left"]


def test_half_a_bias_extension_runs_with_given_fibres(tmp_path):
    loads = []
    for part, size in (("whole", "8x16"), ("half", "4x16")):
        out = tmp_path / part
        fibres = ("--fibres", "40", "--shear-stiffness", "0.5")
        common = (
            "--mesh",
            "aligned",
            "--steps",
            "2",
            "--set",
            "formulation.cs_N_per_mm=5",
            "--no-render",
        )
        command = ["run", "bias_extension", "--out", str(out), *common, *fibres]
        assert cli.main([*command, "--part", part, "--size", size]) == 0
        loads.append(json.loads((out / "summary.json").read_text())["load_over_exact"])
    assert loads[0] == pytest.approx(loads[1], rel=1e-6)
    theta = np.radians(40.0)
    scene = bias_extension("aligned", (8, 16), warp=theta, weft=np.pi - theta)
    fabric = Fabric(1e5, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, Macro(5.0))
    summary = scene.summary(LoadStepper(ply, scene.conditions, 2).run())
    assert loads[0] == pytest.approx(summary["load_over_exact"], rel=1e-9)


@pytest.mark.parametrize(
    ("scene", "options", "message"),
    [
        ("trellis", ("--free", "lid"), "argument --free: invalid choice: 'lid'"),
        ("trellis", ("--roller", "left"), "such as top=0,40, got 'left'"),
        (
            "trellis",
            ("--roller", "left=up"),
            "roller_deg must be a number, got text",
        ),
        (
            "trellis",
            ("--roller", "lid=3"),
            "scene.roller_deg is 'lid': expected one of top, right",
        ),
        (
            "trellis",
            ("--roller", "left=nan"),
            "scene.roller_deg.left must be a finite number",
        ),
        (
            "trellis",
            ("--free", "left", "--roller", "left=3"),
            "the side left is both in scene.free",
        ),
        ("trellis", ("--roller", "top=1", "--roller", "top=2"), "top is given twice"),
        ("trellis", ("--free", "left", "right", "top", "bottom"), "no side is held"),
        ("bias_extension", ("--fibres", "30", "--weft", "135"), "got 30 and 135"),
        ("bias_extension", ("--part", "third"), "argument --part: invalid choice"),
    ],
)
def test_inconsistent_sides_fibres_and_parts_are_rejected(
    tmp_path, capsys, scene, options, message
):
    out = str(tmp_path / "out")
    assert message in rejected(capsys, "run", scene, "--out", out, *options)
    assert list(tmp_path.iterdir()) == []


def test_a_rotated_run_reports_the_unrotated_axes(tmp_path):
    reactions = []
    for angle in ("0", "35"):
        assert run(tmp_path, *QUICK, "--rotate", angle) == 0
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        reactions.append((summary["reaction_x"], summary["reaction_y"]))
    assert reactions[0] == pytest.approx(reactions[1], rel=1e-6)


def test_a_run_accepts_the_papers_stabilisation(tmp_path):
    energies, scene = [], strip(size=(3, 4))
    one_point = (*QUICK, "--formulation", "one-point")
    for kind in ("energy", "rate"):
        assert (
            run(tmp_path, *one_point, "--set", f"formulation.stabilisation={kind}") == 0
        )
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        energies.append(summary["stabilisation_energy"])
        ply = Ply(scene.mesh, Fabric(1e4, 1.0), OnePoint(10.0, kind))
        result = LoadStepper(ply, scene.conditions, 3).run()
        expected = result.summary()["stabilisation_energy"]
        assert energies[-1] == pytest.approx(expected, rel=1e-9)
    assert energies[0] != energies[1]


def test_a_run_accepts_the_automatic_stabilisation(tmp_path):
    quick = ("--size", "3x4", "--steps", "3", "--no-render", "--shear-stiffness", "0.5")
    assert run(tmp_path, *quick, "--set", "formulation.cs_N_per_mm=auto") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["inputs"]["formulation"]["cs_N_per_mm"] == "auto"


def test_a_stabilisation_without_effect_is_rejected(capsys, tmp_path):
    command = ("run", "strip", "--out", str(tmp_path / "o"))
    for formulation in ("full", "quadratic"):
        message = rejected(
            capsys,
            *command,
            "--formulation",
            formulation,
            "--set",
            "formulation.cs_N_per_mm=4",
        )
        assert (
            "cs_N_per_mm requires that formulation.name is one-point or macro"
            in message
        )
    more = ("--formulation", "one-point", "--set", "formulation.deviation=20")
    message = rejected(capsys, *command, *more)
    assert (
        "formulation.deviation requires that formulation.name is quadratic" in message
    )
    more = (
        "--set",
        "formulation.cs_N_per_mm=4",
        "--set",
        "formulation.stabilisation=rate",
    )
    assert "stabilisation requires that formulation.name is one-point" in rejected(
        capsys, *command, *more
    )


def test_a_mesh_of_one_element_has_no_jumps(tmp_path, capfd):
    jumps = (
        "--formulation",
        "one-point",
        "--set",
        "formulation.stabilisation=continuity",
    )
    more = ("--size", "1x1", *jumps, "--set", "formulation.cs_N_per_mm=3")
    out = ("--out", str(tmp_path / "out"), "--steps", "1", "--no-render")
    assert cli.main(["run", "picture_frame", *out, *more]) == 0
    assert "JumpBasis" not in capfd.readouterr().err


def test_a_force_acts_beside_the_conditions_of_a_scene(tmp_path, capsys):
    """The force rotates with the scene, which has no exact solution then."""
    energies = []
    for more in (["--rotate", "0"], ["--rotate", "30"]):
        sheared = ["--shear-stiffness", "1", "--force", "top=2,1", *more]
        assert run(tmp_path, *QUICK, *sheared) == 0
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["inputs"]["loads"]["force_N"] == {"top": [2.0, 1.0]}
        assert "forces act" in summary["exact_answer"]
        assert summary["force on top_potential"] < 0
        energies.append(summary["energy"])
    assert energies[0] == pytest.approx(energies[1], rel=1e-6)


@pytest.mark.parametrize(
    "force", ["top", "top=1", "top=1,2,3", "=1,2", "top=nan,0", "lid=1,2"]
)
def test_an_invalid_force_is_rejected(tmp_path, capsys, force):
    out = ["--out", str(tmp_path / "out")]
    message = rejected(capsys, "run", "strip", *QUICK, *out, "--force", force)
    assert "force" in message
    assert not (tmp_path / "out").exists()


# Meshes from options: generated and read; splitting by formulations


def test_a_run_accepts_a_mesh_file_and_full_integration(tmp_path):
    arguments = "--mesh", str(MESH), "--formulation", "full", "--steps", "4"
    assert run(tmp_path, *arguments, "--no-render") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["formulation"] == "full"
    assert summary["n_elements"] == 184
    assert summary["energy"] == pytest.approx(162.631, rel=1e-5)


def test_an_invalid_mesh_file_is_rejected(tmp_path, capsys):
    file = tmp_path / "bad.msh"
    file.write_text("no mesh")
    out = str(tmp_path / "out")
    assert "bad.msh" in rejected(
        capsys, "run", "strip", "--out", out, "--mesh", str(file)
    )
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("scene", ["strip", "trellis", "bias_extension"])
@pytest.mark.parametrize(
    ("more", "formulation", "parts"),
    [
        ((), "macro", 4),
        (("--set", "formulation.cs_N_per_mm=4"), "macro", 4),
        (("--formulation", "one-point"), "one-point", 1),
    ],
)
def test_macro_elements_are_the_default(tmp_path, scene, more, formulation, parts):
    out = tmp_path / "out"
    common = ("--size", "2x4", "--steps", "1", "--no-render")
    more += ("--shear-stiffness", "0.5")
    assert cli.main(["run", scene, "--out", str(out), *common, *more]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["n_elements"] == parts * 8
    assert summary["formulation"] == formulation
    assert summary["inputs"]["formulation"]["name"] == formulation
    assert summary["inputs"]["mesh"]["size"] == [2, 4]
    assert (out / "fields" / "own_steps.pvd").exists() == (parts == 4)


@pytest.mark.parametrize(
    "scene", ["strip", "trellis", "bias_extension", "picture_frame"]
)
@pytest.mark.parametrize(
    ("formulation", "elements"),
    [((), 3), (("--formulation", "one-point"), 3), (("--formulation", "quadratic"), 1)],
)
def test_every_scene_accepts_delaunay_triangles(tmp_path, scene, formulation, elements):
    out = tmp_path / "out"
    options = ("--mesh", "delaunay", "--size", "3x6", "--steps", "1", "--no-render")
    command = ["run", scene, "--out", str(out), *options, *formulation]
    assert cli.main([*command, "--shear-stiffness", "0.5"]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["n_elements"] == elements * 2 * 18


def test_a_run_with_quadratic_triangles_writes_all_results(tmp_path):
    pytest.importorskip("pyvista")
    small = "--size", "3x4", "--steps", "1"
    assert run(tmp_path, *small, "--formulation", "quadratic") == 0
    out = tmp_path / "out"
    summary = json.loads((out / "summary.json").read_text())
    assert summary["formulation"] == "quadratic"
    assert summary["n_elements"] == 2 * 12
    assert summary["n_dofs"] == 2 * 7 * 9
    assert summary["stable"]
    assert summary["max_fibre_strain"] < summary["mesh_fibre_strain"]
    assert set(results.PICTURES) <= {p.name for p in out.iterdir()}
    for series in ("step_*.vtu", "own_step_*.vtu"):
        files = list((out / "fields").glob(series))
        assert len(files) == summary["load_steps"] + 1
    assert (out / "history.csv").exists()


@pytest.mark.parametrize("scene", ["picture_frame", "trellis", "bias_extension"])
def test_every_scene_accepts_quadratic_triangles(tmp_path, scene):
    out = tmp_path / "out"
    common = ("--size", "2x4", "--steps", "1", "--no-render", "--rotate", "30")
    more = ("--shear-stiffness", "0.5", "--formulation", "quadratic")
    assert cli.main(["run", scene, "--out", str(out), *common, *more]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["n_elements"] == 2 * 8
    assert summary["scene"] == scene


def save_strip(path, cells):
    """A strip of one of two kinds of cells in a file, its right edge named."""
    x, y = np.meshgrid([0.0, 20.0, 40.0], [0.0, 30.0, 60.0])
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    right = ("line", [[2, 5], [5, 8]])
    tags = [*(np.full(len(c), 2) for _, c in cells), [1, 1]]
    meshio.Mesh(
        points,
        [*cells, right],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"right": np.array([1, 1]), "ply": np.array([2, 2])},
    ).write(path, file_format="gmsh22")
    return str(path)


FILE_QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])


FILE_TRIANGLES = np.vstack([FILE_QUADS[:, [0, 1, 2]], FILE_QUADS[:, [0, 2, 3]]])


@pytest.mark.parametrize(
    "cells",
    [[("triangle", FILE_TRIANGLES)], [("quad", FILE_QUADS)]],
    ids=["triangles", "quadrilaterals"],
)
def test_quadratic_triangles_are_read_or_cut_from_a_file(tmp_path, cells):
    mesh = save_strip(tmp_path / "m.msh", cells)
    arguments = ("--formulation", "quadratic", "--steps", "1", "--no-render")
    assert run(tmp_path, "--mesh", mesh, *arguments) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["n_elements"] == 8
    assert summary["n_dofs"] == 2 * 25


@pytest.mark.parametrize(
    ("cells", "parts"),
    [
        ([("triangle", FILE_TRIANGLES)], 3 * 8),
        ([("quad", FILE_QUADS)], 4 * 4),
        ([("triangle", FILE_TRIANGLES[[0, 4]]), ("quad", FILE_QUADS[1:])], 3 * 6),
    ],
    ids=["triangles", "quadrilaterals", "both"],
)
def test_a_file_of_any_cells_is_split(tmp_path, cells, parts):
    mesh = save_strip(tmp_path / "m.msh", cells)
    assert run(tmp_path, "--mesh", mesh, "--steps", "1", "--no-render") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["formulation"], summary["n_elements"]) == ("macro", parts)


def test_meshes_unsuitable_for_quadratic_triangles_are_rejected(tmp_path, capsys):
    both = [("triangle", FILE_TRIANGLES[[0, 4]]), ("quad", FILE_QUADS[1:])]
    mesh = save_strip(tmp_path / "m.msh", both)
    out = str(tmp_path / "out")
    command = ("run", "strip", "--out", out, "--formulation", "quadratic")
    message = rejected(capsys, *command, "--mesh", mesh)
    assert "with both triangles and quadrilaterals: use a mesh of" in message
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["size=[3, 4]", "jitter=0.1", "seed=2"])
def test_options_of_grids_are_rejected_with_a_file(tmp_path, capsys, option):
    out = ("--out", str(tmp_path / "o"))
    message = rejected(
        capsys, "run", "strip", *out, "--mesh", str(MESH), "--set", f"mesh.{option}"
    )
    assert f"mesh.{option.partition('=')[0]} does not apply to the mesh" in message
    assert list(tmp_path.iterdir()) == []


def test_inputs_in_the_summary_describe_the_mesh_in_use(tmp_path):
    quick = ("--formulation", "full", "--steps", "1", "--no-render")
    for mesh, made in (("aligned", ([2, 2], 0.3, 1)), (str(MESH), (None, None, None))):
        size = ("--size", "2x2") if made[0] else ()
        assert run(tmp_path, *quick, "--mesh", mesh, *size) == 0
        inputs = json.loads((tmp_path / "out" / "summary.json").read_text())["inputs"]
        settings = tuple(inputs["mesh"].get(key) for key in ("size", "jitter", "seed"))
        assert settings == made
