"""Plies on tools of triangles have the same results as on the exact surface."""

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.io import read_surface
from skfem_textile.scenes import drape as on_tool
from skfem_textile.scenes import hemisphere
from skfem_textile.scenes.drape import contact_point
from tests.helpers import tool_shapes
from tests.helpers.tools import bump_height, case_of, plate, write_sphere

pytestmark = pytest.mark.usefixtures("no_interval", "coarse_net")


def run(scene):
    case = case_of(scene, 5.0)
    result = case.run()
    return result, case.summary(result)


@pytest.mark.dear("5000 triangles are as accurate as a sphere")
def test_triangles_of_a_sphere_cause_its_shear(tmp_path):
    """At a fibre angle without the symmetry of a quarter."""
    mesh = read_surface(write_sphere(tmp_path / "ball.stl"))
    kwargs = {"size": (8, 8), "fibres": np.radians(17.0), "tension": 2.0}
    result, summary = run(on_tool(mesh, **kwargs))
    exact, _ = run(hemisphere(part="whole", **kwargs))
    error = result.ply.shear_angle(result.u) - exact.ply.shear_angle(exact.u)
    assert np.degrees(np.abs(error).max()) < 0.001
    assert np.degrees(np.abs(exact.ply.shear_angle(exact.u)).max()) > 20
    top = [summary[f"touches_at_{axis}_mm"] for axis in "xyz"]
    assert top == pytest.approx([13, -7, 140], abs=0.02)
    assert summary["beyond_tool_share_of_area"] == 0
    assert "beyond_tool" not in summary


FACES_DOWN = "faces down at the contact point"


def on_plate(height, side):
    x, t = plate(n=11, height=height)
    small = {"size": (2, 2), "width": 100.0, "height": 100.0, "tension": 0.0}
    return run(on_tool(drape.TriangleMesh(x, t[::side]), **small))[1]


def test_an_inverted_tool_is_reported():
    plain, away = (
        on_plate(lambda x, y: -(x**2 + y**2) / 400, side) for side in (1, -1)
    )
    assert "off_triangles" not in plain
    assert "faces_away" not in plain
    assert FACES_DOWN in away["faces_away"]
    assert away["max_shear_angle_deg"] == pytest.approx(plain["max_shear_angle_deg"])


def test_an_inverted_tool_curved_both_ways_is_reported():
    figures = on_plate(lambda x, y: bump_height(x, y) - bump_height(x - 60, y), -1)
    assert figures["min_contact_pressure_N_per_mm2"] < 0
    assert figures["max_contact_pressure_N_per_mm2"] > 0
    assert FACES_DOWN in figures["faces_away"]


def test_a_ply_on_a_flat_tool_has_no_bridging():
    """At any inclination; the pressure of round-off is 1e-8 N/mm²."""
    x, t = plate(n=15, height=lambda x, y: 0.3 * x - 0.2 * y)
    tool, middle = drape.TriangleMesh(x, t), np.zeros(3)
    _, data = run(on_tool(tool, point=middle, size=(4, 4), width=120.0, height=120.0))
    assert 0 < abs(data["min_contact_pressure_N_per_mm2"]) < 1e-7
    assert data["bridging_share_of_area"] == 0


def test_a_rigidly_moved_tool_causes_the_same_shear():
    """Rotated about y, with the normal in the xz plane: x of the ply follows."""
    x, t = plate(n=13)
    c, s = np.cos(0.6), np.sin(0.6)
    Q, shift = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.array([40.0, 9.0, -7.0])
    surface = drape.TriangleMesh(x, t)
    other = drape.TriangleMesh(Q @ x + shift[:, None], t)
    kwargs = {"size": (2, 2), "width": 150.0, "fibres": 0.4, "tension": 0.0}
    spot = np.array([-10.0, 0.0, bump_height(-10.0, 0.0)])
    (one, summary), (two, after) = (
        run(on_tool(surface, point=spot, **kwargs)),
        run(on_tool(other, point=Q @ spot + shift, **kwargs)),
    )
    error = one.ply.shear_angle(one.u) - two.ply.shear_angle(two.u)
    assert np.degrees(np.abs(error).max()) < 0.01
    assert summary["max_shear_angle_deg"] > 5
    at, then = (
        np.array([it[f"max_shear_angle_at_{axis}_mm"] for axis in "xyz"])
        for it in (summary, after)
    )
    np.testing.assert_allclose(then, Q @ at + shift, atol=0.1)


@pytest.mark.parametrize(
    ("height", "top"),
    [
        (bump_height, (5, 0, 30)),
        (lambda x, y: 0 * x + 4, (0, 0, 4)),  # flat
        (lambda x, y: np.sqrt(200**2 - x**2), (0, 0, 200)),  # a ridge along y
        (lambda x, y: bump_height(np.abs(x) - 35, y), (40, 0, 30)),  # two
    ],
)
def test_a_ply_first_touches_the_highest_point_nearest_to_the_middle(height, top):
    scene = on_tool(drape.TriangleMesh(*plate(height=height)))
    point = scene.axes.origin * (np.sign(scene.axes.origin[0]), 1, 1)
    assert point == pytest.approx(top, abs=0.1)
    np.testing.assert_allclose(scene.axes.turn, np.eye(3), atol=0.01)


@pytest.mark.parametrize(
    ("tool", "top"),
    [
        (tool_shapes.deep_box(60.0, 40.0, 20.0, flange=5.0, size=2.5), (0, 0, 20)),
        (tool_shapes.hat(120.0, flange=10.0, size=7.0), (0, 0, 40)),
        (tool_shapes.ring(size=9.0), None),
    ],
)
def test_the_middle_of_a_flat_top_is_its_centroid(tool, top):
    """Whatever its triangles are; a ring does not contain its centroid."""
    tool = drape.TriangleMesh(*tool)
    if top is None:
        with pytest.raises(ValueError, match="is at its edge or on a slope"):
            contact_point(tool)
    else:
        np.testing.assert_allclose(contact_point(tool), top, atol=1e-3)


def test_a_patch_of_a_tenth_of_a_metre_fits_a_tool_of_ten_metres():
    tool = drape.TriangleMesh(*plate(5e3, 15, lambda x, y: 0 * x))
    scene = on_tool(tool, width=100.0, height=100.0, size=(2, 2))
    np.testing.assert_allclose(np.ptp(scene.mesh.p, axis=1), 100.0)


def test_a_hole_of_the_tool_is_beyond_its_edges():
    x, t = plate(height=lambda x, y: 0 * x)
    solid = np.hypot(*x[:2, t].mean(axis=1) - [[50], [0]]) > 20
    scene = on_tool(drape.TriangleMesh(x, t[:, solid]), size=(12, 12), tension=0.0)
    _, summary = run(scene)
    share = np.pi * 20**2 / 180**2
    assert summary["beyond_tool_share_of_area"] == pytest.approx(share, rel=0.3)


@pytest.mark.parametrize("point", [None, (12.0, 30.0, bump_height(12.0, 30.0))])
def test_a_regular_coarse_tool_is_rotated_without_change_of_its_surface(point):
    """Many vertices are equidistant there, and a fit uses only some."""
    x, t = plate(n=11)
    tool = drape.TriangleMesh(x, t)
    scene = on_tool(tool, point=point, size=(4, 4), width=80.0, height=80.0)
    surface, turn = scene.conditions["tool"].surface, scene.axes.turn
    rotated = scene.axes.of_ply(x)
    np.testing.assert_allclose(surface.level(rotated), tool.level(x), atol=1e-10)
    slope, bend = surface.gradient(rotated), surface.hessian(rotated)
    np.testing.assert_allclose(turn @ slope, tool.gradient(x), atol=1e-10)
    turned = np.einsum("ik,kln,jl->ijn", turn, bend, turn)
    np.testing.assert_allclose(turned, tool.hessian(x), atol=1e-10)
    np.testing.assert_array_equal(
        surface.beyond_edges(rotated) > 0, tool.beyond_edges(x) > 0
    )
    scene.conditions["tool"].at("tool", 0.5)  # it touches the plane of the ply


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("axis", "tilt"), [("x", -0.005), ("x", 0.005), ("y", 0.005)])
def test_a_wall_is_viewed_along_its_normal(axis, tilt, side):
    """Upright to half a degree; z of the tool replaces x across the wall."""
    x, t = plate(n=15)
    order = {"x": [2, 0, 1], "y": [1, 2, 0]}[axis]
    x = np.array([[1], [1], [side]]) * x + np.array([[0], [0], [tilt]]) * x[:1]
    wall = drape.TriangleMesh(x[order], t[::side])
    position = np.array([5.0, 0.0, 30.0 * side])[order]
    turn = on_tool(wall, point=position, tension=0.0).axes.turn
    outwards = side * np.eye(3)["xyz".index(axis)]
    first = np.eye(3)[{"x": 2, "y": 0}[axis]]
    expected = np.column_stack([first, np.cross(outwards, first), outwards])
    np.testing.assert_allclose(turn, expected, atol=0.03)


def test_edge_tensions_off_the_top_of_a_tool_are_balanced():
    """No node prevents the ply from sliding; the net alone would need 10 N there."""
    round_top = plate(n=15, height=lambda x, y: 30 * np.exp(-(x**2 + y**2) / 3200))
    tool = drape.TriangleMesh(*round_top)
    kwargs = {"width": 100.0, "height": 100.0, "size": (4, 4)}
    result, off_top = run(on_tool(tool, point=(30.0, 0.0, 22.6), **kwargs))
    assert off_top["max_holding_force_N"] < 0.01
    balance = result.states[-1].parameters["edge tension"]["balance"]
    assert np.linalg.norm(result.ply.nodal(balance), axis=0).sum() > 5
