"""Files of fields, histories and summaries."""

import json
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from skfem_textile import Condition, Fabric, Full, LoadStepper, Macro, OnePoint, Ply
from skfem_textile.io import write_draped, write_fields, write_history, write_summary
from skfem_textile.io.results import cell_fields
from skfem_textile.mesh.splitting import split
from skfem_textile.scenes import strip
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import distorted, random_u


@pytest.fixture(scope="module")
def result():
    scene = strip(size=(2, 3))
    ply = Ply(scene.mesh, Fabric(1e4, 0.5), OnePoint(5.0))
    return LoadStepper(ply, scene.conditions, steps=2).run()


def test_fields_are_written_for_every_state(tmp_path, result):
    write_fields(result, tmp_path)
    files = sorted(tmp_path.glob("*.vtu"))
    assert [f.name for f in files] == [f"step_000{i}.vtu" for i in range(3)]
    saved = meshio.read(files[-1])
    assert set(saved.point_data) == {"displacement"}
    of_families = {
        f"{family}_{name}"
        for family in ("warp", "weft")
        for name in ("strain", "tension", "direction")
    }
    assert set(saved.cell_data) == {"shear_angle", *of_families}
    u = result.ply.nodal(result.u)
    np.testing.assert_allclose(saved.point_data["displacement"][:, :2], u.T)
    np.testing.assert_array_equal(saved.points[:, :2], result.ply.mesh.p.T)
    steps = ElementTree.parse(tmp_path / "steps.pvd").findall("Collection/DataSet")
    assert [step.get("file") for step in steps] == [f.name for f in files]
    assert [float(step.get("timestep")) for step in steps] == [
        state.load_factor for state in result.states
    ]
    np.testing.assert_allclose(
        saved.cell_data["shear_angle"][0],
        np.degrees(result.ply.shear_angle(result.u))[:, 0],
    )
    np.testing.assert_allclose(
        np.linalg.norm(saved.cell_data["weft_direction"][0], axis=1), 1.0
    )


@pytest.mark.parametrize("series", ["steps.pvd", "own_steps.pvd"])
def test_a_series_of_steps_is_warped_once(tmp_path, series):
    pv = pytest.importorskip("pyvista")
    scene = strip(split(rectangle(40, 60, (2, 3), "irregular", 0.3)))
    ply = Ply(scene.mesh, Fabric(1e4), Macro())
    result = LoadStepper(ply, scene.conditions, steps=2).run()
    write_fields(result, tmp_path)
    reader = pv.get_reader(tmp_path / series)
    assert reader.time_values == [state.load_factor for state in result.states]
    reader.set_active_time_value(1.0)
    (fields,) = reader.read()
    n = fields.n_points
    assert fields.active_scalars_name == "shear_angle"
    np.testing.assert_array_equal(fields.points[:, :2], ply.nodes.T[:n])
    current = (ply.nodes + ply.nodal(result.u)).T[:n]
    np.testing.assert_allclose(fields.warp_by_vector().points[:, :2], current)


def test_a_ply_in_space_is_written_in_space(tmp_path):
    mesh = rectangle(2, 2, (2, 2), "irregular", 0.0, 1)
    ply = Ply(mesh, Fabric(100.0, 1.0), Macro(), dimension=3)
    lift = Condition("right", (0.0, 0.0, 0.5))
    result = LoadStepper(ply, {"left": Condition("left"), "right": lift}, 2).run()
    write_fields(result, tmp_path)
    last = meshio.read(tmp_path / "own_step_0002.vtu")
    moved = last.point_data["displacement"]
    np.testing.assert_allclose(moved, ply.nodal(result.u)[:, : len(moved)].T)
    assert moved[:, 2].max() == pytest.approx(0.5)
    assert (last.cell_data["warp_direction"][0][:, 2] > 0.2).all()
    write_history(result, tmp_path / "history.csv")
    head = (tmp_path / "history.csv").read_text().splitlines()[0]
    assert "right_reaction_z" in head
    assert "right_displacement_z" in head
    write_draped(result, tmp_path)
    draped = meshio.read(tmp_path / "fibres.vtu")
    assert draped.points[:, 2].max() == pytest.approx(0.5)
    np.testing.assert_allclose(
        draped.cell_data["warp_direction"][0], last.cell_data["warp_direction"][0]
    )
    rows = (tmp_path / "fibres.csv").read_text().splitlines()
    assert len(rows) == 1 + ply.on_users_elements(np.ones(ply.mesh.nelements)).size


def test_the_extreme_of_several_points_is_written():
    ply = Ply(distorted(1), Fabric(10.0), Full())
    u = random_u(ply, 1)
    strain = ply.fibre_strain(u)[0]
    written = cell_fields(ply, u)["warp_strain"]
    np.testing.assert_array_equal(np.abs(written), np.abs(strain).max(axis=1))
    assert (written < 0).any()


def test_history_and_summary_are_written(tmp_path, result):
    write_history(result, tmp_path / "history.csv")
    header, *rows = (tmp_path / "history.csv").read_text().splitlines()
    assert header.startswith(
        "load_factor,linear_solves,residual,tolerance,negative_pivots,min_det_F,"
        "max_fibre_strain,mesh_fibre_strain,bottom_displacement_x,"
    )
    assert len(rows) == 3
    for row, state in zip(rows, result.history(), strict=True):
        written = [float(x) for x in row.split(",")]
        np.testing.assert_allclose(written, list(state.values()), rtol=1e-11)
        assert len(row.split(",")[-1].strip("-").replace(".", "")) <= 12
    write_summary(result.summary(), tmp_path / "summary.json")
    assert json.loads((tmp_path / "summary.json").read_text()) == result.summary()


def test_stale_steps_are_removed(tmp_path, result):
    (tmp_path / "step_0099.vtu").write_text("stale")
    (tmp_path / "step_notes.txt").write_text("mine")
    write_fields(result, tmp_path)
    assert not (tmp_path / "step_0099.vtu").exists()
    assert (tmp_path / "step_notes.txt").exists()
