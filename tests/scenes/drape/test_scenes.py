"""The scenes of plies on tools, and tension on their edges."""

import json
from functools import partial

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Fabric,
    Locking,
    OnSurface,
    Quadratic,
    Tabulated,
    drape,
)
from skfem_textile.cli import main as cli
from skfem_textile.fabric import Linear
from skfem_textile.scenes import Case, cylinder, edge_tension, hemisphere, saddle
from skfem_textile.scenes import draped_ply as draped_module
from skfem_textile.scenes.draped_ply import draped_ply
from skfem_textile.scenes.edge_tension import EdgeTension, edge_net
from tests.helpers import arguments_of
from tests.helpers.tools import square

# The scenes of plies on tools, from Python and the command line


meshio = pytest.importorskip("meshio")
pytestmark = pytest.mark.usefixtures("no_interval", "coarse_net")


def run(scene, steps=1, fabric=None, **more):
    fabric = fabric or Fabric(1e4, 0.1, scene.warp, scene.weft)
    case = Case(scene=scene, fabric=fabric, steps=steps, **more)
    result = case.run()
    return result, case.summary(result)


def degrees(angle):
    return float(np.radians(angle))


@pytest.mark.parametrize("fibres", [0, 45])
def test_a_hemisphere_agrees_with_its_chebyshev_net(fibres):
    errors = []
    for n in (4, 8):
        _, summary = run(hemisphere(size=(n, n), fibres=degrees(fibres)))
        assert summary["converged"]
        assert summary["wrinkle_risk_share_of_area"] == 0
        assert summary["bridging_share_of_area"] < 0.02  # except in the free corner
        assert "exact_answer" not in summary
        errors.append(summary["shear_angle_error_rms_deg"])
    assert errors[1] < 0.05
    assert errors[0] / errors[1] > 2.5


@pytest.mark.parametrize(("build", "fibres"), [(hemisphere, 45), (saddle, 0)])
def test_a_quarter_agrees_with_the_whole(build, fibres, monkeypatch):
    """Also their nets, whose cells are a share of the ply."""
    ends = []
    for part, n in (("quarter", 2), ("whole", 4)):
        for module in (draped_module, edge_tension):
            monkeypatch.setattr(module, "CELLS", 16 * n)
        ends.append(run(build(size=(n, n), fibres=degrees(fibres), part=part)))
    (quarter, one), (whole, other) = ends
    assert whole.ply.mesh.nelements == 4 * quarter.ply.mesh.nelements
    assert one["max_shear_angle_deg"] == pytest.approx(
        other["max_shear_angle_deg"], rel=1e-4
    )
    assert one["max_contact_pressure_N_per_mm2"] == pytest.approx(
        other["max_contact_pressure_N_per_mm2"], rel=0.02
    )
    assert 4 * one["energy"] == pytest.approx(other["energy"], rel=1e-3)


@pytest.mark.parametrize(("fibres", "most"), [(0, 1e-8), (20, 0.1), (45, 0.1)])
def test_a_cylinder_causes_no_shear(fibres, most):
    _, summary = run(cylinder(size=(8, 8), fibres=degrees(fibres)))
    assert summary["exact_max_shear_angle_deg"] == 0
    assert summary["shear_angle_error_max_deg"] < most
    assert summary["max_contact_pressure_N_per_mm2"] == pytest.approx(0.02, rel=0.05)


def test_exchanging_warp_and_weft_changes_the_bridging_of_a_saddle():
    """Exchanging x and y inverts the saddle."""
    result, summary = run(saddle(size=(6, 6)))
    pressure = drape.contact_pressure(
        result.ply, result.tool(1.0), *arguments_of(result.states[-1])
    )
    assert pressure.max() == pytest.approx(-pressure.min(), rel=1e-3)
    assert 0.3 < summary["bridging_share_of_area"] < 0.6
    assert summary["exact_answer"] == "none: no exact solution is known"


@pytest.mark.parametrize("size", [(1, 1), (1, 2), (2, 1), (2, 8), (3, 3), (5, 4)])
def test_a_whole_ply_is_held_by_three_nodes_however_coarse_its_mesh(size):
    scene = hemisphere(size=size, part="whole", width=200.0, height=80.0)
    names = "middle_x", "turn_left", "turn_right"
    nodes = [scene.conditions[name].where[0] for name in names]
    assert len(set(nodes)) == 3
    middle, left, right = scene.mesh.p[:, nodes].T
    assert left[0] < 0 < right[0]
    if size != (1, 2):  # where the opposite node is the middle one
        np.testing.assert_allclose(left, -right)
    assert np.hypot(*middle) == np.hypot(*scene.mesh.p).min()
    beside = scene.mesh.p[:, scene.mesh.p[0] > 1e-6]
    away = np.hypot(*(beside - [[50.0], [0.0]]))
    assert np.hypot(*(right - [50.0, 0.0])) == away.min()


def test_the_summary_without_tension_and_bending_denies_a_net():
    _, free = run(hemisphere(size=(2, 2), tension=0.0))
    assert "the state differs from the kinematic net" in free["not_the_net"]
    _, pulled = run(hemisphere(size=(2, 2)))
    assert "not_the_net" not in pulled
    scene = hemisphere(size=(2, 2), tension=0.0)
    _, bent = run(scene, fabric=Fabric(1e4, 0.1, bending=(5.0, 5.0)))
    assert "not_the_net" not in bent


def test_the_wrinkling_angle_is_in_the_summary():
    shares = []
    for angle in (90, 15):
        scene = hemisphere(size=(3, 3), tension=0.0)
        fabric = Fabric(1e4, 0.1, wrinkling_angle=degrees(angle))
        shares.append(run(scene, 1, fabric)[1]["wrinkle_risk_share_of_area"])
    assert 0 < shares[0] < shares[1] < 1


def test_the_edge_tension_of_locking_laws_follows_from_their_moments():
    scene = hemisphere(size=(8, 8))
    law = Locking(0.1, degrees(50))
    _, summary = run(scene, fabric=Fabric(1e4, law))
    assert summary["shear_angle_error_rms_deg"] < 0.1


def test_quadratic_triangles_are_draped():
    """The pressure at the pole is due to two tensions of 2 N/mm on R = 100 mm."""
    _, summary = run(hemisphere("delaunay", size=(6, 6)), formulation=Quadratic())
    assert summary["shear_angle_error_rms_deg"] < 0.5
    assert summary["min_contact_pressure_N_per_mm2"] == pytest.approx(0.04, rel=0.1)
    assert summary["bridging_share_of_area"] == 0


SMALL = "--size", "2x2", "--steps", "2", "--no-render"


def test_fields_of_a_tool_are_written_for_the_state_on_it(tmp_path):
    line = "run", "saddle", *SMALL, "--mesh", "delaunay", "--out", str(tmp_path)
    assert cli.main(line) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    fields = meshio.read(tmp_path / "fields" / "step_0000.vtu")
    assert "warp_direction" in fields.cell_data
    assert not {"wrinkle_risk", "bridging"} & set(fields.cell_data)
    fields = meshio.read(tmp_path / "fields" / "step_0001.vtu")
    assert {"wrinkle_risk", "bridging", "warp_direction"} < set(fields.cell_data)
    pressure = fields.point_data["contact_pressure"]
    assert np.isfinite(pressure).all()
    assert pressure.max() == pytest.approx(summary["max_contact_pressure_N_per_mm2"])
    on_elements = meshio.read(tmp_path / "fields" / "own_step_0001.vtu")
    assert len(on_elements.cell_data["bridging"][0]) == 8
    flat = "run", "strip", *SMALL, "--out", str(tmp_path)
    assert cli.main(flat) == 0
    fields = meshio.read(tmp_path / "fields" / "step_0002.vtu")
    assert not {"wrinkle_risk", "bridging"} & set(fields.cell_data)


def test_a_table_from_zero_on_suffices_for_shear_of_one_sign():
    """No iteration from the net leaves the table."""
    law = Tabulated(np.radians([0, 60]), [0, 0.2])
    result, _ = run(hemisphere(size=(4, 4)), fabric=Fabric(1e4, law))
    assert result.converged
    assert result.ply.shear_angle(result.u).min() > 0


def test_oblique_fibres_and_an_eccentric_ply_have_no_exact_solution():
    assert "45 degrees" in hemisphere(fibres=degrees(30)).misfit
    for offset, reason in ((0.0, None), (-10.0, "a ply whose middle touches the pole")):
        lines = np.linspace(-40, 40, 7)
        mesh = MeshQuad.init_tensor(lines + offset, lines)
        misfit = hemisphere(mesh, part="whole").misfit
        assert (reason in misfit) if reason else not misfit


# Tension on the edges of plies on tools


TOUCH = 20.0, -10.0


def valley(x, y):
    """Without symmetry, and level at the touching point."""
    x, y, one = (x - TOUCH[0]) / 80, (y - TOUCH[1]) / 80, np.ones_like(x)
    return drape.Height(
        20 * (2 * x * x - x * y + y * y + x**3),
        (4 * x - y + 3 * x * x) / 4,
        (2 * y - x) / 4,
        (4 + 6 * x) / 320,
        -one / 320,
        2 * one / 320,
    )


def on_valley(cells, fibres=17.0, angle=90.0):
    """A ply with edge tension in the valley."""
    angles = tuple(np.radians([fibres, fibres + angle]))
    on_tool = OnSurface(drape.HeightField(valley), touch=TOUCH)
    place = {"corner": np.array(TOUCH) - 50.0}
    net = partial(edge_net, square(110.0, cells, **place).mesh, on_tool, angles)
    load = EdgeTension(on_tool, 2.0, angles, Linear(0.5), (), net)
    return square(110.0, cells, loads=[load], **place)


def test_edge_tension_grows_in_proportion_to_the_load_factor():
    ply = on_valley(6)
    u = ply.basis.zeros()
    np.testing.assert_allclose(ply.load(u, 0.3), 0.3 * ply.load(u, 1.0))


@pytest.mark.parametrize(("fibres", "angle"), [(17.0, 90.0), (33.0, 70.0)])
def test_edge_tension_is_that_of_a_net_laid_on_another_mesh(fibres, angle):
    """The resultant of the tractions depends on the net alone."""
    forces = []
    for cells in (6, 12):
        ply = on_valley(cells, fibres, angle)
        forces.append(ply.nodal(ply.load(ply.basis.zeros(), 1.0)).sum(axis=1))
    np.testing.assert_allclose(*forces, atol=0.01 * 2.0 * 110.0)


def along_the_tool(result, names, forces):
    """Components along the tool of forces at single nodes, shape (3, n)."""
    ply, u = result.ply, result.u
    nodes = list(names.values())
    x = np.pad(ply.nodes[:, nodes], ((0, 1), (0, 0))) + ply.nodal(u)[:, nodes]
    n = result.tool(1.0).gradient(x)
    n = n / np.linalg.norm(n, axis=0)
    return forces - (forces * n).sum(axis=0) * n


def test_supports_have_no_reactions_under_edge_tension():
    """On a tool and a ply without any symmetry."""
    surface = drape.HeightField(
        lambda x, y: valley(np.asarray(x) + TOUCH[0], np.asarray(y) + TOUCH[1])
    )
    options = {"size": (4, 4), "width": 110.0, "height": 90.0, "fibres": 0.3}
    scene = draped_ply("valley", surface, "irregular", **options)
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft)
    result = Case(scene=scene, fabric=fabric).run()
    state, ply = result.states[-1], result.ply
    names = "middle_x", "turn_left", "turn_right"
    nodes = {name: scene.conditions[name].where[0] for name in names}
    forces = np.array([state.reactions[name] for name in names]).T
    held = np.abs(along_the_tool(result, nodes, forces)).max()
    loads = np.abs(ply.load(state.u, 1.0, state.parameters)).sum()
    assert held < 2e-5 * loads
    assert scene.summary(result)["max_holding_force_N"] <= 2 * held + 1e-12
    balance = np.abs(state.parameters["edge tension"]["balance"]).sum()
    assert 1e-3 * loads < balance < 0.1 * loads
    inner = ply.nodal(state.parameters["edge tension"]["balance"])
    edge = np.unique(ply.mesh.facets[:, ply.mesh.boundary_facets()])
    assert np.abs(np.delete(inner, edge, axis=1)).max() < 1e-12
