"""Meshes that options describe: made and read; and what formulations make of them."""

import json

import meshio
import numpy as np
import pytest

from skfem_textile.cli import main as cli
from skfem_textile.cli import results
from tests.helpers.command_line import MESH, refused, run


def test_a_run_takes_a_mesh_file_and_full_integration(tmp_path):
    arguments = "--mesh", str(MESH), "--formulation", "full", "--steps", "4"
    assert run(tmp_path, *arguments, "--no-render") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["formulation"] == "full"
    assert summary["n_elements"] == 184
    assert summary["energy"] == pytest.approx(162.631, rel=1e-5)


def test_a_bad_mesh_file_is_refused(tmp_path, capsys):
    file = tmp_path / "bad.msh"
    file.write_text("no mesh")
    out = str(tmp_path / "out")
    assert "bad.msh" in refused(
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
def test_a_run_has_macro_elements_unless_another_formulation_is_named(
    tmp_path, scene, more, formulation, parts
):
    out = tmp_path / "out"
    common = ("--size", "2x4", "--steps", "2", "--no-render")
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
def test_every_scene_takes_delaunays_triangles(tmp_path, scene, formulation, elements):
    out = tmp_path / "out"
    options = ("--mesh", "delaunay", "--size", "3x6", "--steps", "2", "--no-render")
    command = ["run", scene, "--out", str(out), *options, *formulation]
    assert cli.main([*command, "--shear-stiffness", "0.5"]) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert summary["n_elements"] == elements * 2 * 18


def test_a_run_takes_quadratic_triangles_and_writes_everything(tmp_path):
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


@pytest.mark.parametrize(
    ("cells", "parts"),
    [
        ([("triangle", FILE_TRIANGLES)], 3 * 8),
        ([("quad", FILE_QUADS)], 4 * 4),
        ([("triangle", FILE_TRIANGLES[[0, 4]]), ("quad", FILE_QUADS[1:])], 3 * 6),
    ],
    ids=["triangles", "quadrilaterals", "both"],
)
def test_a_file_of_any_cells_is_split_inside(tmp_path, cells, parts):
    mesh = saved_strip(tmp_path / "m.msh", cells)
    assert run(tmp_path, "--mesh", mesh, "--steps", "2", "--no-render") == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["formulation"], summary["n_elements"]) == ("macro", parts)


def test_what_quadratic_triangles_cannot_be_made_of_is_refused(tmp_path, capsys):
    both = [("triangle", FILE_TRIANGLES[[0, 4]]), ("quad", FILE_QUADS[1:])]
    mesh = saved_strip(tmp_path / "m.msh", both)
    out = str(tmp_path / "out")
    command = ("run", "strip", "--out", out, "--formulation", "quadratic")
    said = refused(capsys, *command, "--mesh", mesh)
    assert "with both triangles and quadrilaterals is: give one of either" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("option", ["size=[3, 4]", "jitter=0.1", "seed=2"])
def test_options_of_a_mesh_to_make_are_refused_beside_a_file(tmp_path, capsys, option):
    out = ("--out", str(tmp_path / "o"))
    said = refused(
        capsys, "run", "strip", *out, "--mesh", str(MESH), "--set", f"mesh.{option}"
    )
    assert f"mesh.{option.partition('=')[0]} is of a mesh to make" in said
    assert list(tmp_path.iterdir()) == []


def test_inputs_are_those_of_the_mesh_that_is_used(tmp_path):
    quick = ("--formulation", "full", "--steps", "1", "--no-render")
    for mesh, made in (("aligned", ([2, 2], 0.3, 1)), (str(MESH), (None, None, None))):
        size = ("--size", "2x2") if made[0] else ()
        assert run(tmp_path, *quick, "--mesh", mesh, *size) == 0
        inputs = json.loads((tmp_path / "out" / "summary.json").read_text())["inputs"]
        found = tuple(inputs["mesh"].get(key) for key in ("size", "jitter", "seed"))
        assert found == made
