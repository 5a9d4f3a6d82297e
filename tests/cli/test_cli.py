import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

from skfem_textile import (
    LoadStepper,
    Ply,
    Result,
)
from skfem_textile.cli import main as cli
from skfem_textile.cli import pictures
from skfem_textile.plot import offscreen

MESH = Path(__file__).parents[2] / "examples" / "strip.msh"
QUICK = ["--size", "3x4", "--steps", "3", "--cs", "10", "--no-render"]


def run(tmp_path, *arguments):
    return cli.main(["run", "strip", "--out", str(tmp_path / "out"), *arguments])


def refused(capsys, *arguments):
    """The one line with which bad input is refused."""
    try:
        code = cli.main(arguments)
    except SystemExit as end:
        code = end.code
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    return err


def test_list_names_the_scenes(capsys):
    assert cli.main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = ["strip", "picture_frame", "trellis", "bias_extension"]
    assert [line.split()[0] for line in lines] == names


def test_a_solver_is_taken_by_name_or_refused_in_one_line(
    tmp_path, capsys, monkeypatch
):
    assert run(tmp_path, *QUICK, "--solver", "superlu") == 0
    capsys.readouterr()
    monkeypatch.setattr(
        "skfem_textile.solve.linear.choice.find_spec", lambda name: None
    )
    again = ("run", "strip", "--out", str(tmp_path / "b"), *QUICK)
    said = refused(capsys, *again, "--solver", "cholmod")
    assert "solver 'cholmod' needs cvxopt: pip install cvxopt" in said


def test_a_run_writes_summary_history_and_fields(tmp_path, capsys):
    assert run(tmp_path, *QUICK, "--shear-stiffness", "0.5") == 0
    out = tmp_path / "out"
    assert {p.name for p in out.iterdir()} == {"summary.json", "history.csv", "fields"}
    summary = json.loads((out / "summary.json").read_text())
    assert set(summary) == {
        *("scene", "formulation", "n_elements", "n_dofs", "converged", "load_factor"),
        *("load_steps", "linear_solves", "energy", "tension_energy"),
        *("shear_energy", "corners_energy", "stabilisation_energy", "path_resolved"),
        *("max_fibre_strain",),
        *("mesh_fibre_strain", "max_fibre_tension", "max_shear_angle_deg"),
        *("min_det_F", "wall_time_s", "assembly_time_s", "solve_time_s", "reaction_x"),
        *("reaction_y", "displacement_error_rms", "displacement_error_max"),
        *("shear_angle_error_rms_deg", "inputs", "negative_pivots", "stable"),
        *("steps_cut", "factorisations", "solver", "solver_reason"),
    }
    assert summary["inputs"]["cs"] == 10.0
    assert summary["inputs"]["size"] == [3, 4]
    assert summary["scene"] == "strip"
    assert summary["formulation"] == "one-point"
    assert summary["converged"] is True
    assert summary["n_elements"] == 12
    assert summary["shear_energy"] > 0
    with open(out / "history.csv") as file:
        assert len(list(csv.DictReader(file))) == summary["load_steps"] + 1
    assert len(list((out / "fields").glob("*.vtu"))) == summary["load_steps"] + 1
    assert "max_fibre_strain" in capsys.readouterr().out


def test_a_run_takes_a_mesh_file_and_full_integration(tmp_path):
    arguments = "--mesh", str(MESH), "--formulation", "full", "--steps", "4"
    assert run(tmp_path, *arguments, "--no-render") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["formulation"] == "full"
    assert summary["n_elements"] == 184
    assert summary["energy"] == pytest.approx(162.631, rel=1e-5)


def interrupt_at(monkeypatch, number):
    """Interrupt the command line after so many states, the undeformed one included."""
    keep = LoadStepper._keep

    def interrupt(stepper, *arguments):
        if len(stepper.states) == number:
            raise KeyboardInterrupt
        keep(stepper, *arguments)

    monkeypatch.setattr(LoadStepper, "_keep", interrupt)


def test_a_run_interrupted_before_its_first_state_says_so(
    tmp_path, capsys, monkeypatch
):
    interrupt_at(monkeypatch, 0)
    assert run(tmp_path, *QUICK) == 130
    assert capsys.readouterr().err == "skfem-textile: interrupted\n"
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_run_leaves_its_last_state_and_is_resumed(
    tmp_path, capsys, monkeypatch
):
    assert run(tmp_path, *QUICK) == 0
    out = tmp_path / "out"
    whole = (out / "history.csv").read_text()
    with monkeypatch.context() as patch:
        interrupt_at(patch, 2)
        assert run(tmp_path, *QUICK, "--checkpoint") == 130
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "interrupted; the state at load factor 0.333333 is written" in said
    assert "--resume goes on" in said
    summary = json.loads((out / "summary.json").read_text())
    assert summary["load_factor"] == pytest.approx(1 / 3)
    assert (out / "history.csv").read_text() == "".join(
        whole.splitlines(keepends=True)[:3]
    )
    assert "resume" in refused(
        capsys, "run", "strip", "--out", str(out), *QUICK, "--checkpoint"
    )
    assert run(tmp_path, *QUICK, "--resume") == 0
    assert (out / "history.csv").read_text() == whole


def test_a_checkpoint_may_lie_anywhere_and_is_refused_by_another_run(tmp_path, capsys):
    folder = str(tmp_path / "c")
    assert run(tmp_path, *QUICK, "--checkpoint", folder) == 0
    assert not (tmp_path / "out" / "checkpoint").exists()
    again = ("--resume", folder, "--fibre-stiffness", "2e4")
    command = ("run", "strip", "--out", str(tmp_path / "new"), *QUICK, *again)
    capsys.readouterr()
    assert "is of another run: warp law was Linear" in refused(capsys, *command)
    assert not (tmp_path / "new").exists()


def test_resume_goes_on_where_checkpoint_says(tmp_path, capsys, monkeypatch):
    folder = str(tmp_path / "c")
    with monkeypatch.context() as patch:
        interrupt_at(patch, 2)
        assert run(tmp_path, *QUICK, "--checkpoint", folder) == 130
    capsys.readouterr()
    assert run(tmp_path, *QUICK, "--checkpoint", folder, "--resume", "-v") == 0
    assert "resumed at load factor 0.333333" in capsys.readouterr().err
    other = ("run", "strip", "--out", str(tmp_path / "out"), *QUICK)
    said = refused(capsys, *other, "--checkpoint", folder, "--resume", folder + "d")
    assert "name different folders" in said


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (ValueError("no ink"), 0, ("no pictures: no ink", "")),
        (
            KeyboardInterrupt,
            130,
            ("", "interrupted; the numbers are written, pictures are not\n"),
        ),
    ],
)
def test_pictures_that_fail_lose_no_numbers(
    tmp_path, capsys, monkeypatch, error, code, told
):
    def draw(*_):
        raise error

    monkeypatch.setattr(pictures, "draw", draw)
    assert run(tmp_path, *QUICK[:-1]) == code
    assert (tmp_path / "out" / "summary.json").exists()
    out, err = capsys.readouterr()
    assert told[0] in out
    assert err == (f"skfem-textile: {told[1]}" if told[1] else "")


def test_numbers_that_json_does_not_have_are_null(tmp_path, monkeypatch):
    summary = Result.summary
    odd = {"energy": np.inf, "stable": np.nan, "load_steps": 1e308}
    monkeypatch.setattr(Result, "summary", lambda result: summary(result) | odd)
    assert run(tmp_path, *QUICK) == 0

    def refuse(constant):
        raise ValueError(constant)

    text = (tmp_path / "out" / "summary.json").read_text()
    found = json.loads(text, parse_constant=refuse)
    assert (found["energy"], found["stable"]) == (None, None)
    assert found["load_steps"] == 1e308


def test_the_load_is_drawn_over_the_displacement_of_the_driven_edge(
    tmp_path, monkeypatch
):
    pytest.importorskip("pyvista")
    curves = pytest.importorskip("skfem_textile.plot.curves")
    drawn = []
    monkeypatch.setattr(curves, "curves", lambda *given: drawn.append(given))
    for scene, axis in (("strip", "x"), ("bias_extension", "y")):
        out = tmp_path / scene
        options = ("--size", "2x4", "--steps", "2", "--rotate", "30")
        assert cli.main(["run", scene, "--out", str(out), *options]) == 0
        panels, xlabel, ylabel, _ = drawn.pop()
        assert xlabel == f"Mean displacement of the driven edge along {axis} (mm)"
        assert ylabel == "Force (N)"
        summary = json.loads((out / "summary.json").read_text())
        (lines,) = panels.values()
        for name in "xy":
            moved, force = lines[f"along {name}"]
            assert force[-1] == pytest.approx(summary[f"reaction_{name}"])
            assert moved[0] == 0
            assert moved[-1] > 5
    assert moved[-1] == pytest.approx(2 * moved[1], rel=0.2)


def test_steps_and_iterations_are_told_on_request(tmp_path, capsys):
    lines = []
    for verbose in ((), ("-v",), ("-vv",)):
        assert run(tmp_path, *QUICK, *verbose) == 0
        lines.append(capsys.readouterr().err.splitlines())
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert lines[0] == []
    solver, *states = lines[1]
    assert solver.startswith("linear solver ")
    assert len(states) == summary["load_steps"] + 1
    assert len(lines[2]) == len(lines[1]) + summary["linear_solves"]
    assert "N unbalanced, tolerance" in lines[2][2]


def test_a_run_takes_strategies_and_checks_by_name(tmp_path):
    arguments = ("--strategy", "newton", "--warn-only", "stability", "work")
    assert run(tmp_path, *QUICK, *arguments) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["inputs"]["strategy"] == ["newton"]
    assert summary["inputs"]["warn_only"] == ["stability", "work"]


@pytest.mark.parametrize(
    ("scene", "options", "shear"),
    [
        ("picture_frame", ("--shear-angle", "60"), 60),
        ("trellis", ("--warp", "10", "--weft", "80", "--bend", "0"), 45),
    ],
)
def test_the_frames_are_run_by_name(tmp_path, scene, options, shear):
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
        (("--free", "right", "--roller", "left=60"), [["left", 60]]),
        (
            ("--roller", "top=20", "--roller", "right=-70"),
            [["top", 20], ["right", -70]],
        ),
    ],
)
def test_sides_may_be_free_or_on_inclined_rollers(tmp_path, options, rollers):
    out = tmp_path / "out"
    common = ("--size", "4x4", "--steps", "3", "--no-render", "--bend", "0")
    fibres = ("--warp", "20", "--weft", "100")
    command = ["run", "trellis", "--out", str(out), *common, *fibres, *options]
    assert cli.main(command) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["displacement_error_max"] < 1e-9
    assert summary["inputs"]["roller"] == rollers


def test_a_run_takes_half_of_a_bias_extension_and_its_fibres(tmp_path):
    loads = []
    for part, size in (("whole", "8x16"), ("half", "4x16")):
        out = tmp_path / part
        fibres = ("--warp", "40", "--weft", "140", "--shear-stiffness", "0.5")
        common = ("--mesh", "aligned", "--steps", "2", "--cs", "5", "--no-render")
        command = ["run", "bias_extension", "--out", str(out), *common, *fibres]
        assert cli.main([*command, "--part", part, "--size", size]) == 0
        loads.append(json.loads((out / "summary.json").read_text())["load_over_exact"])
    assert loads[0] == pytest.approx(loads[1], rel=1e-6)
    assert loads[0] == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(
    ("scene", "options", "message"),
    [
        ("trellis", ("--free", "lid"), "argument --free: invalid choice: 'lid'"),
        ("trellis", ("--roller", "left"), "'left' is not like left=30"),
        ("trellis", ("--roller", "left=up"), "'left=up' is not like left=30"),
        ("trellis", ("--roller", "lid=3"), "no side 'lid'"),
        ("trellis", ("--roller", "left=nan"), "the left side must be held, free or on"),
        ("trellis", ("--free", "left", "--roller", "left=3"), "--roller left: that"),
        ("trellis", ("--roller", "top=1", "--roller", "top=2"), "--roller top: that"),
        ("trellis", ("--free", "left", "right", "top", "bottom"), "no side is held"),
        ("bias_extension", ("--warp", "30"), "not at 30 and 135"),
        ("bias_extension", ("--part", "third"), "argument --part: invalid choice"),
    ],
)
def test_sides_fibres_and_parts_that_do_not_fit_are_refused(
    tmp_path, capsys, scene, options, message
):
    out = str(tmp_path / "out")
    assert message in refused(capsys, "run", scene, "--out", out, *options)
    assert list(tmp_path.iterdir()) == []


def test_a_rotated_run_reports_the_unrotated_axes(tmp_path):
    reactions = []
    for angle in ("0", "35"):
        assert run(tmp_path, *QUICK, "--rotate", angle) == 0
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        reactions.append((summary["reaction_x"], summary["reaction_y"]))
    assert reactions[0] == pytest.approx(reactions[1], rel=1e-6)


def test_a_run_that_stops_early_keeps_its_last_state(tmp_path, capsys, monkeypatch):
    def area_ratio(ply, u):
        return 10 - abs(u).max() * np.ones(ply.mesh.nelements)

    monkeypatch.setattr(Ply, "least_area_ratio", area_ratio)
    assert run(tmp_path, *QUICK) == 1
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["converged"] is False
    assert 0 < summary["load_factor"] < 1
    fields = sorted((tmp_path / "out" / "fields").glob("*.vtu"))
    assert len(fields) == summary["load_steps"] + 1
    assert capsys.readouterr().err.startswith("skfem-textile: stopped at load factor")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--cs", "-1"), "stabilisation must be"),
        (("--cs", "much"), "argument --cs: 'much' is no number, nor auto"),
        (("--shear-law", "sin2", "--shear-stiffness", "-1"), "shear stiffness must be"),
        (("--fibre-stiffness", "-5"), "tension stiffness must be"),
        (("--fibre-stiffness", "0"), "no stiffness"),
        (("--shear-stiffness", "nan"), "shear stiffness must be"),
        (("--steps", "0"), "steps must be at least 1"),
        (("--steps", "99999999999999999999999"), "no more than 1000000; got 9999999"),
        (("--size", "10"), "'10' is not like 10x15"),
        (("--size", "0x5"), "at least 1x1"),
        (("--size", "1000000x1000000"), "llocate"),
        (("--jitter", "2"), "jitter must be in"),
        (("--seed", "-1"), "seed must be"),
        (("--rotate", "nan"), "--rotate: 'nan' is no finite number"),
        (("--rotate", "1e17"), "--rotate: '1e17' is more than a hundred turns"),
        (("--mesh", "curly"), "--mesh curly: neither a file nor aligned"),
        (("--formulation", "fuller"), "--formulation"),
        (("--stabilisation", "magic"), "--stabilisation"),
        (("--strategy", "magic"), "--strategy"),
        (("--warn-only", "magic"), "--warn-only"),
    ],
)
def test_bad_input_is_refused_before_anything_is_written(
    tmp_path, capsys, arguments, message
):
    out = str(tmp_path / "out")
    error = refused(capsys, "run", "strip", "--out", out, "--no-render", *arguments)
    assert message in error
    assert list(tmp_path.iterdir()) == []


def test_a_bad_mesh_file_is_refused(tmp_path, capsys):
    file = tmp_path / "bad.msh"
    file.write_text("no mesh")
    out = str(tmp_path / "out")
    assert "bad.msh" in refused(
        capsys, "run", "strip", "--out", out, "--mesh", str(file)
    )
    assert not (tmp_path / "out").exists()


def test_an_unknown_scene_is_refused(tmp_path, capsys):
    error = refused(capsys, "run", "stripe", "--out", str(tmp_path))
    assert "'stripe'" in error
    assert "strip" in error


def test_an_output_folder_that_cannot_be_written_is_refused(tmp_path, capsys):
    (tmp_path / "file").write_text("in the way")
    out = str(tmp_path / "file" / "out")
    assert "file" in refused(capsys, "run", "strip", "--out", out, *QUICK)


def test_without_gl_everything_else_is_written(tmp_path, capsys, monkeypatch):
    pytest.importorskip("pyvista")
    monkeypatch.setattr(offscreen, "_can_draw", lambda environment: False)
    offscreen.require_offscreen.cache_clear()
    try:
        assert run(tmp_path, *QUICK[:-1]) == 0
    finally:
        offscreen.require_offscreen.cache_clear()
    assert (tmp_path / "out" / "summary.json").exists()
    assert not list((tmp_path / "out").glob("*.png"))
    said = [x for x in capsys.readouterr().out.splitlines() if "libegl1" in x]
    assert len(said) == 1


def test_pictures_are_written_and_nothing_is_said_on_stderr(tmp_path):
    pytest.importorskip("pyvista")
    command = [sys.executable, "-m", "skfem_textile", "run", "strip", *QUICK[:-1]]
    child = subprocess.run(
        [*command, "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        check=True,
        env={k: v for k, v in os.environ.items() if k != "DISPLAY"},
    )
    assert child.stderr == ""
    names = {p.name for p in (tmp_path / "out").iterdir()}
    assert set(pictures.PICTURES) <= names


def test_a_run_takes_the_papers_stabilisation(tmp_path):
    energies = []
    for kind in ("energy", "rate"):
        assert run(tmp_path, *QUICK, "--stabilisation", kind) == 0
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        energies.append(summary["stabilisation_energy"])
    assert energies[0] != energies[1]
    assert energies[1] == pytest.approx(energies[0], rel=0.5)


@pytest.mark.parametrize("scene", ["strip", "trellis", "bias_extension"])
@pytest.mark.parametrize(("into", "parts"), [((), 6), (("quads",), 4)])
@pytest.mark.parametrize(
    ("more", "formulation"),
    [
        ((), "macro"),
        (("--cs", "4"), "macro"),
        (("--cs", "4", "--stabilisation", "isotropic"), "one-point"),
    ],
)
def test_quadrilaterals_may_be_split_first(
    tmp_path, scene, into, parts, more, formulation
):
    out = tmp_path / "out"
    common = ("--size", "2x4", "--steps", "2", "--no-render", "--split", *into)
    more += ("--shear-stiffness", "0.5")
    assert cli.main(["run", scene, "--out", str(out), *common, *more]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["n_elements"] == parts * 8
    assert summary["formulation"] == formulation
    assert summary["inputs"]["split"] == (into[0] if into else "triangles")


@pytest.mark.parametrize(
    "scene", ["strip", "trellis", "bias_extension", "picture_frame"]
)
@pytest.mark.parametrize(
    ("formulation", "elements"),
    [((), 3), (("--formulation", "one-point"), 3), (("--formulation", "quadratic"), 1)],
)
def test_every_scene_takes_delaunays_triangles(tmp_path, scene, formulation, elements):
    out = tmp_path / "out"
    options = ("--mesh", "delaunay", "--size", "3x6", "--steps", "2", "--no-render")
    command = ["run", scene, "--out", str(out), *options, *formulation]
    assert cli.main([*command, "--shear-stiffness", "0.5"]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["n_elements"] == elements * 2 * 18


def test_numbers_that_make_no_sense_are_refused(capsys, tmp_path):
    out = ("--out", str(tmp_path / "o"))
    assert "no finite number" in refused(
        capsys, "run", "trellis", "--warp", "nan", *out
    )
    triangles = ("--mesh", "delaunay", "--split", "quads")
    assert "has triangles" in refused(capsys, "run", "strip", *triangles, *out)


@pytest.mark.parametrize("option", ["--fibre-stiffness", "--shear-stiffness"])
def test_the_largest_numbers_are_refused_without_warnings(option, capsys, tmp_path):
    out = ("--out", str(tmp_path / "o"))
    said = refused(capsys, "run", "strip", *QUICK[:4], option, "1e308", *out)
    assert "a law has no finite energy or force at rest" in said
    assert list(tmp_path.iterdir()) == []


def test_sides_may_be_freed_one_by_one(tmp_path):
    free = ("--free", "top", "--free", "left")
    out = tmp_path / "out"
    size = ("--size", "3x3", "--steps", "1", "--no-render")
    assert cli.main(["run", "trellis", "--out", str(out), *size, *free]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["inputs"]["free"] == ["top", "left"]


def test_a_stabilisation_that_would_be_ignored_is_refused(capsys, tmp_path):
    command = ("run", "strip", "--out", str(tmp_path / "o"))
    for formulation in ("full", "quadratic"):
        said = refused(capsys, *command, "--formulation", formulation, "--cs", "4")
        assert "--cs goes with --formulation one-point or macro" in said
    more = ("--formulation", "one-point", "--deviation", "20")
    said = refused(capsys, *command, *more)
    assert "--deviation goes with --formulation quadratic" in said
    more = ("--split", "--formulation", "macro", "--cs", "4", "--stabilisation", "rate")
    assert "goes with --formulation one-point" in refused(capsys, *command, *more)


def test_a_run_takes_quadratic_triangles_and_writes_everything(tmp_path):
    pytest.importorskip("pyvista")
    assert run(tmp_path, *QUICK[:4], "--formulation", "quadratic") == 0
    out = tmp_path / "out"
    summary = json.loads((out / "summary.json").read_text())
    assert summary["formulation"] == "quadratic"
    assert summary["n_elements"] == 2 * 12
    assert summary["n_dofs"] == 2 * 7 * 9
    assert summary["stable"]
    assert summary["max_fibre_strain"] < summary["mesh_fibre_strain"]
    assert set(pictures.PICTURES) <= {p.name for p in out.iterdir()}
    assert len(list((out / "fields").glob("*.vtu"))) == summary["load_steps"] + 1
    assert (out / "history.csv").exists()


@pytest.mark.parametrize("scene", ["picture_frame", "trellis", "bias_extension"])
def test_every_scene_takes_quadratic_triangles(tmp_path, scene):
    out = tmp_path / "out"
    common = ("--size", "2x4", "--steps", "2", "--no-render", "--rotate", "30")
    more = ("--shear-stiffness", "0.5", "--formulation", "quadratic")
    assert cli.main(["run", scene, "--out", str(out), *common, *more]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["n_elements"] == 2 * 8
    assert summary["scene"] == scene


def saved_strip(path, cells):
    """A strip of one of two sorts of cells in a file, its right edge named."""
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
    mesh = saved_strip(tmp_path / "m.msh", cells)
    arguments = ("--formulation", "quadratic", "--steps", "2", "--no-render")
    assert run(tmp_path, "--mesh", mesh, *arguments) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["n_elements"] == 8
    assert summary["n_dofs"] == 2 * 25


def test_triangles_of_a_file_are_not_split_as_quadrilaterals(tmp_path, capsys):
    mesh = saved_strip(tmp_path / "m.msh", [("triangle", FILE_TRIANGLES)])
    out = ("--out", str(tmp_path / "out"))
    said = refused(capsys, "run", "strip", *out, "--mesh", mesh, "--split", "quads")
    assert "--split quads: the mesh has triangles" in said
    assert not (tmp_path / "out").exists()


def test_what_quadratic_triangles_cannot_be_made_of_is_refused(tmp_path, capsys):
    both = [("triangle", FILE_TRIANGLES[[0, 4]]), ("quad", FILE_QUADS[1:])]
    mesh = saved_strip(tmp_path / "m.msh", both)
    out = str(tmp_path / "out")
    command = ("run", "strip", "--out", out, "--formulation", "quadratic")
    said = refused(capsys, *command, "--mesh", mesh)
    assert "m.msh: triangles beside quadrilaterals must be split" in said
    assert "--split makes quadrilaterals" in refused(capsys, *command, "--split")
    assert not (tmp_path / "out").exists()


def test_a_run_takes_the_automatic_stabilisation(tmp_path):
    assert run(tmp_path, *QUICK, "--cs", "auto", "--shear-stiffness", "0.5") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["inputs"]["cs"] == "auto"


@pytest.mark.parametrize(
    "command",
    [
        ("study", "stability", "--out", "o"),
        ("run", "two_element", "--out", "o"),
        ("run", "strip", "--no-render", "--paper", "--out", "o"),
    ],
)
def test_studies_are_said_to_be_elsewhere(capsys, command):
    assert "run `python -m studies NAME --out DIR`" in refused(capsys, *command)


def test_a_second_run_into_a_folder_is_told_before_any_work(
    tmp_path, capsys, monkeypatch
):
    keep, codes = LoadStepper._keep, []

    def second(stepper, *arguments):
        keep(stepper, *arguments)
        if not codes:
            codes.append(None)
            codes[0] = run(tmp_path, *QUICK)

    monkeypatch.setattr(LoadStepper, "_keep", second)
    assert run(tmp_path, *QUICK) == 0
    assert codes == [2]
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"another run is writing to {tmp_path / 'out'}" in said


@pytest.mark.parametrize("option", ["--out", "--checkpoint", "--resume"])
def test_a_folder_without_a_name_is_refused(tmp_path, capsys, monkeypatch, option):
    monkeypatch.chdir(tmp_path)
    said = refused(capsys, "run", "strip", *QUICK, "--out", "o", option, "")
    assert f"argument {option}: a folder must have a name" in said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("option", ["--size=3x4", "--jitter=0.1", "--seed=2"])
def test_options_of_a_mesh_to_make_are_refused_beside_a_file(tmp_path, capsys, option):
    out = ("--out", str(tmp_path / "o"))
    said = refused(capsys, "run", "strip", *out, "--mesh", str(MESH), option)
    assert f"{option.partition('=')[0]} is of a mesh to make" in said
    assert list(tmp_path.iterdir()) == []


def test_inputs_are_those_of_the_mesh_that_is_used(tmp_path):
    quick = ("--formulation", "full", "--steps", "1", "--no-render")
    for mesh, made in (("aligned", ([2, 2], 0.3, 1)), (str(MESH), (None, None, None))):
        size = ("--size", "2x2") if made[0] else ()
        assert run(tmp_path, *quick, "--mesh", mesh, *size) == 0
        inputs = json.loads((tmp_path / "out" / "summary.json").read_text())["inputs"]
        assert (inputs["size"], inputs["jitter"], inputs["seed"]) == made


def test_what_is_refused_at_rest_leaves_no_checkpoint(tmp_path, capsys):
    quick = ("--size", "2x2", "--steps", "1", "--no-render", "--checkpoint")
    for stiffness in ("--fibre-stiffness", "--shear-stiffness"):
        command = ("run", "strip", "--out", str(tmp_path / "o"), *quick)
        said = refused(capsys, *command, stiffness, "1e308")
        assert "no finite energy or force at rest" in said
        assert list(tmp_path.iterdir()) == []


def test_a_checkpoint_that_cannot_be_resumed_is_refused_in_one_line(tmp_path, capsys):
    (tmp_path / "file").touch()
    out, folder = str(tmp_path / "o"), str(tmp_path / "file" / "c")
    said = refused(capsys, "run", "strip", "--out", out, *QUICK, "--resume", folder)
    assert "cannot write checkpoint" in said


@pytest.mark.parametrize("name", ["a\nb", "\udcff", "ü"])
def test_a_folder_of_any_name_is_told_in_one_line(tmp_path, name):
    command = [sys.executable, "-m", "skfem_textile", "run", "strip", *QUICK]
    child = subprocess.run(
        [*command, "--out", str(tmp_path / name)],
        capture_output=True,
        check=True,
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
    )
    assert (tmp_path / name / "summary.json").exists()
    assert child.stderr == b""
    assert child.stdout.splitlines()[-1].startswith(b"results in ")


def test_of_a_long_line_the_middle_is_left_out(tmp_path, capsys):
    out = ("--out", str(tmp_path / "o"))
    said = refused(capsys, "run", "strip", *out, "--size", "9" * 5000)
    assert len(said) < 500
    assert "argument --size: '999" in said
    assert " ... " in said
    assert said.endswith("' is not like 10x15\n")


def test_jumps_between_the_elements_of_one_are_none(tmp_path, capfd):
    more = ("--size", "1x1", "--stabilisation", "continuity", "--cs", "3")
    out = ("--out", str(tmp_path / "out"), "--steps", "1", "--no-render")
    assert cli.main(["run", "picture_frame", *out, *more]) == 0
    assert "JumpBasis" not in capfd.readouterr().err


def test_a_force_acts_beside_the_conditions_of_a_scene(tmp_path, capsys):
    """Turned with the scene; the summary says that there is no exact answer then."""
    energies = []
    for more in (["--rotate", "0"], ["--rotate", "30"]):
        sheared = ["--shear-stiffness", "1", "--force", "top=2,1", *more]
        assert run(tmp_path, *QUICK, *sheared) == 0
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert summary["inputs"]["force"] == [["top", [2.0, 1.0]]]
        assert "forces act" in summary["exact_answer"]
        assert summary["force on top_potential"] < 0
        energies.append(summary["energy"])
    assert energies[0] == pytest.approx(energies[1], rel=1e-6)


@pytest.mark.parametrize(
    "force", ["top", "top=1", "top=1,2,3", "=1,2", "top=nan,0", "lid=1,2"]
)
def test_a_force_that_nobody_can_mean_is_refused(tmp_path, capsys, force):
    out = ["--out", str(tmp_path / "out")]
    said = refused(capsys, "run", "strip", *QUICK, *out, "--force", force)
    assert force.split("=")[0] in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("word", ["--size=--", "--cs=--", "--out=--"])
def test_two_dashes_are_no_value(tmp_path, capsys, word):
    said = refused(capsys, "run", "strip", "--out", str(tmp_path), word, *QUICK)
    assert "is no value" in said


def test_what_looks_like_an_option_is_no_folder(tmp_path, capsys):
    out = ["--out", str(tmp_path / "out")]
    said = refused(capsys, "run", "strip", *QUICK, *out, "--resume", "--paper x")
    assert "'--paper x' is no option" in said
