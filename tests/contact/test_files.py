"""Files of formed plies: fields of contact, and tools where they stand."""

from xml.etree import ElementTree

import meshio
import numpy as np
import pytest

from skfem_textile.contact import (
    areal_weight,
    box_of,
    contacts,
    draw_in,
    placed_tools,
)
from skfem_textile.contact.figures import formed
from skfem_textile.contact.outline import inside, nearest
from skfem_textile.drape import Axes
from skfem_textile.io import write_fields
from tests.helpers.forming import GAP, RADIUS


@pytest.fixture(scope="module")
def folder(hemisphere, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    write_fields(hemisphere, folder)
    return folder


def test_fields_of_contact_are_written(hemisphere, folder):
    saved, ply = meshio.read(folder / "step_0003.vtu"), hemisphere.ply
    state, n = hemisphere.states[-1], ply.mesh.nvertices
    figures = formed(hemisphere)
    for tool in contacts(ply):
        gap = saved.point_data[f"{tool.name}_gap"]
        reached = np.isfinite(gap)
        assert gap[reached].min() > -figures[f"{tool.name}_penetration_mm"] - 1e-6
        assert (saved.point_data[f"{tool.name}_pressure"] >= 0).all()
        if tool.name != "punch":
            x = ply.nodal(state.u)[:2, :n] + ply.mesh.p
            assert not reached[np.hypot(*x) < 37].any()
    assert saved.point_data["punch_pressure"].max() > 0
    drawn = draw_in(ply, state.u)
    assert saved.point_data["draw_in"][drawn.nodes] == pytest.approx(drawn.inwards)
    assert np.isfinite(saved.point_data["draw_in"]).sum() == drawn.nodes.size
    weight = saved.cell_data["areal_weight_ratio"][0]
    assert weight == pytest.approx(areal_weight(ply, state.u))
    assert set(np.unique(saved.cell_data["wrinkle_risk"][0])) <= {0.0, 1.0}


def test_tools_stand_where_they_are_at_each_state(hemisphere, folder):
    """Corners of the punch are on its sphere, of the other tools on their planes."""
    series = ElementTree.parse(folder / "tools.pvd").findall("Collection/DataSet")
    assert [float(x.get("timestep")) for x in series] == [
        state.load_factor for state in hemisphere.states
    ]
    for entry, travel in zip(series, (0.0, 5.0, 10.0, 15.0), strict=True):
        saved = meshio.read(folder / entry.get("file"))
        tool, triangles = saved.cell_data["tool"][0], saved.cells_dict["triangle"]
        x = saved.points[np.unique(triangles[tool == 0])].T
        off = np.linalg.norm(x.T - (0, 0, travel - RADIUS - GAP / 2), axis=1) - RADIUS
        assert np.abs(off).max() < 1e-9
        for number, z in ((1, GAP / 2), (2, -GAP / 2)):
            x = saved.points[np.unique(triangles[tool == number])].T
            assert x[2] == pytest.approx(z)
            assert np.hypot(*x[:2]).min() == pytest.approx(38.0, abs=0.2)


def test_the_tools_of_a_run_that_stopped_stand_at_its_travel(stopped, tmp_path):
    write_fields(stopped.result, tmp_path)
    assert len(list(tmp_path.glob("tools_*.vtu"))) == 2
    saved = meshio.read(tmp_path / "tools_0001.vtu")
    assert saved.points[:, 2].max() == pytest.approx(5 - GAP / 2, abs=0.01)


def test_tools_are_written_in_the_axes_of_the_case(hemisphere, tmp_path):
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    write_fields(hemisphere, tmp_path, Axes(np.array([1.0, 2.0, 3.0]), turn))
    saved = meshio.read(tmp_path / "tools_0003.vtu")
    assert saved.points[:, 0].max() == pytest.approx(16 - GAP / 2, abs=0.01)


def test_normals_of_tools_point_to_the_ply(hemisphere):
    ply, states = hemisphere.ply, hemisphere.states
    box = box_of(ply, states)
    (tools,) = placed_tools(ply, states[-1:], *box)
    of = {tool.name: tool.normals for tool in tools}
    assert (of["die"][2] < 0).all()
    assert (of["holder"][2] > 0).all()
    assert (of["punch"][2] > 0).all()
    for tool in tools:
        assert (box[0] - 1 < tool.points.T).all()
        assert (box[1] + 1 > tool.points.T).all()


def test_nearest_points_on_an_outline():
    square = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    x = np.array([[0.5, 0.9, 2.0, -1.0], [0.1, 0.5, 2.0, 0.5]])
    assert nearest(square, x) == pytest.approx(
        np.array([[0.5, 1.0, 1.0, 0.0], [0.0, 0.5, 1.0, 0.5]])
    )
    assert inside(square, x).tolist() == [True, True, False, False]


def test_a_box_that_the_tool_does_not_reach_is_empty(hemisphere):
    far = np.full(3, 500.0), np.full(3, 510.0)
    assert placed_tools(hemisphere.ply, hemisphere.states[:2], *far) == [[], []]
