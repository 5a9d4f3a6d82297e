"""Surfaces: derivatives, curvatures, growth and triangles."""

import meshio
import numpy as np
import pytest

from skfem_textile import (
    drape,
)
from skfem_textile.io import read_surface
from skfem_textile.surfaces.surface import (
    GrowingSurface,
    OffSurfaceError,
    is_on,
    onto,
    tangents,
)
from tests.helpers import sphere
from tests.helpers.tools import plate

RNG = np.random.default_rng(1)


SURFACES = {
    "plane": drape.Plane((1, 2, 3), (1, -2, 2)),
    "cylinder": drape.Cylinder(3.0, (1, 0, 2), (1, 2, 3)),
    "sphere": drape.Sphere(4.0, (1, 2, 0)),
    "cone": drape.Cone(0.6, (1, 1, -9), (0.2, 0.1, 1)),
    "torus": drape.Torus(9.0, 2.0, (0, 1, 0), (0.3, 0, 1)),
    "punch": drape.Punch(3.0, (3, 2, 4), (0.2, 0.1, 1)),
    "die": drape.Die(3.0, 1.5, (3, 2, 4), (0.2, 0.1, 1)),
    "double dome": drape.double_dome(6.0, 18.0, 7.5, 0.25, 6.0),
    "triangles": drape.TriangleMesh(*[sphere(600)[0] * 5, sphere(600)[1]]),
    "grown": GrowingSurface(drape.Sphere(4.0, (0, 0, -4)), np.zeros(3), 0.3),
}

every_surface = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)


def points(surface):
    """Points near a surface."""
    x = onto(surface, RNG.uniform(2, 5, (3, 40)))
    return x + RNG.uniform(-0.05, 0.05, x.shape)


@every_surface
def test_derivatives_agree_with_differences_of_the_level(surface):
    x, d, h = points(surface), RNG.standard_normal((3, 40)), 1e-5
    level = (surface.level(x + h * d) - surface.level(x - h * d)) / (2 * h)
    gradient = (surface.gradient(x + h * d) - surface.gradient(x - h * d)) / (2 * h)
    slope = surface.gradient(x)
    np.testing.assert_allclose(level, (slope * d).sum(axis=0), rtol=1e-7, atol=1e-7)
    hessian = surface.hessian(x)
    np.testing.assert_allclose(
        gradient, np.einsum("ijn,jn->in", hessian, d), rtol=1e-6, atol=1e-6
    )
    np.testing.assert_allclose(hessian, hessian.swapaxes(0, 1), atol=1e-12)


@every_surface
def test_points_are_projected_onto_the_surface(surface):
    x = points(surface)
    assert not is_on(surface, x)
    assert is_on(surface, onto(surface, x))


def test_points_move_along_free_directions_only():
    x = np.array([[1.0], [2.0], [4.5]])
    free = np.diag([0.0, 0.0, 1.0])[None]
    end = onto(SURFACES["sphere"], x, free)
    np.testing.assert_array_equal(end[:2], x[:2])
    assert end[2, 0] == pytest.approx(4.0)
    with pytest.raises(OffSurfaceError, match="cannot be projected onto the surface"):
        onto(SURFACES["sphere"], np.array([[9.0], [2.0], [1.0]]), free)


def test_the_level_of_a_punch_is_the_distance_from_its_section():
    """The distance outside, and to half of the radius inside."""
    punch = drape.Punch(30.0, (1, 2, 3), (0, 0, -1))
    away, turn = RNG.uniform(15, 60, 200), RNG.uniform(0, 2 * np.pi, 200)
    below = RNG.uniform(-80, 0, 200)
    shaft = np.array([away * np.cos(turn), away * np.sin(turn), below])
    polar = RNG.uniform(0, np.pi / 2, 200)
    ring = away * np.sin(polar)
    end = np.array([ring * np.cos(turn), ring * np.sin(turn), away * np.cos(polar)])
    for x in (shaft, end):
        x = x * [[1], [1], [-1]] + [[1], [2], [3]]
        np.testing.assert_allclose(punch.level(x), away - 30, atol=1e-9)


def test_a_punch_pushes_points_on_its_axis_to_the_tip():
    punch, h = drape.Punch(30.0), 1e-4
    axis = np.array([0, 0, 1.0])[:, None] * np.linspace(-199.5, 28.5, 229)
    assert (punch.level(axis) < 0).all()
    assert (punch.gradient(axis)[2] > 1e-3).all()
    for x in (axis, axis + RNG.uniform(-12, 12, axis.shape)):
        for d in np.eye(3)[:, :, None]:
            bend = (punch.gradient(x + h * d) - punch.gradient(x - h * d)) / (2 * h)
            expected = np.einsum("ijn,jk->in", punch.hessian(x), d)
            np.testing.assert_allclose(bend, expected, atol=1e-5)


def test_the_level_of_a_die_is_the_distance_from_its_section():
    """The distance outside is computed from points along plane, fillet and wall."""
    die, turn = drape.Die(80.0, 10.0, (0, 0, 1)), np.linspace(0, np.pi / 2, 501)
    r, z = 90 - 10 * np.sin(turn), 11 - 10 * np.cos(turn)
    far = np.linspace(0, 100, 4001)
    section = np.array(
        [[*r, *(90 + far), *(80 + 0 * far)], [*z, *(1 + 0 * far), *(11 + far)]]
    )
    x = np.array([RNG.uniform(41, 150, 100), np.zeros(100), RNG.uniform(-40, 60, 100)])
    away = np.hypot(*(x[::2, :, None] - section[:, None])).min(axis=1)
    level = die.level(x)
    np.testing.assert_allclose(np.abs(level), away, atol=2e-3)
    inside = (x[2] > 1) & (x[0] > 90) | (x[2] > 11) & (x[0] > 80)
    assert (level[inside] < 0).all()
    assert (level[x[0] < 80] > 0).all()


def test_a_die_has_a_gradient_and_no_singular_curvature_on_its_axis():
    die, h = drape.Die(80.0, 10.0), 1e-4
    axis = np.array([0, 0, 1.0])[:, None] * np.linspace(-400, 400, 801)
    x = axis + 1e-6 * np.eye(3)[:, :1]
    for at in (x, axis):
        assert (die.level(at) > 50).all()
        assert (np.linalg.norm(die.gradient(at), axis=0) > 1e-3).all()
        assert np.abs(die.hessian(at)).max() < 0.1
    for d in np.eye(3)[:, :, None]:
        bend = (die.gradient(x + h * d) - die.gradient(x - h * d)) / (2 * h)
        off = np.abs(bend - np.einsum("ijn,jk->in", die.hessian(x), d))
        assert np.median(off) < 1e-8
        assert (off > 1e-6).sum() <= 3  # the curvature jumps where the wall begins


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "surface", [drape.Die(80.0, 10.0), drape.Punch(30.0), drape.double_dome()]
)
def test_surfaces_are_finite_far_away(surface):
    far = 1e152 * np.array([[1, 0, 0, 1], [0, -1, 0, 1], [0, 0, 1, -1]])
    for method in "level", "gradient", "hessian":
        assert np.isfinite(getattr(surface, method)(far)).all()
    on_axis = np.array([[0.0], [0.0], [1e160]])
    assert np.isfinite(surface.hessian(on_axis)).all()


def test_lengths_in_another_unit_are_refused():
    with pytest.raises(ValueError, match=r"^sphere: centre is 1e\+155 mm: check its"):
        drape.Sphere(30.0, (0, 0, -1e155))
    with pytest.raises(ValueError, match=r"^die: radius is 1e\+200 mm: check its unit"):
        drape.Die(1e200, 3.0)


def test_a_surface_grows_out_of_its_tangent_plane():
    x, sphere = RNG.uniform(-1, 1, (3, 9)), drape.Sphere(4.0, (0, 0, -4))
    np.testing.assert_allclose(GrowingSurface(sphere, np.zeros(3), 0.0).level(x), x[2])
    half = GrowingSurface(sphere, np.zeros(3), 0.5)
    larger = drape.Sphere(8.0, (0, 0, -8))
    np.testing.assert_allclose(half.level(x), larger.level(x))
    np.testing.assert_allclose(half.hessian(x), larger.hessian(x))
    away = np.array([1.0, 2.0, 3.0])
    there = drape.Sphere(4.0, away - (0, 0, 4))
    for t in (0.0, 0.5):
        here = GrowingSurface(sphere, np.zeros(3), t).level(x)
        moved = GrowingSurface(there, away, t).level(x + away[:, None])
        np.testing.assert_allclose(moved, here, atol=1e-12)


def test_normals_of_an_stl_file_agree_with_the_sphere(tmp_path):
    p, t = sphere(1500)
    file = tmp_path / "sphere.stl"
    meshio.Mesh(100 * p.T, [("triangle", t.T)]).write(file, binary=True)
    surface = read_surface(file)
    x = RNG.standard_normal((3, 1000))
    n = x / np.linalg.norm(x, axis=0)
    x = onto(surface, 100 * n)
    g = surface.gradient(x)
    cosine = (g * x).sum(axis=0) / np.linalg.norm(g, axis=0) / np.linalg.norm(x, axis=0)
    assert np.degrees(np.arccos(np.minimum(cosine, 1))).max() < 0.1  # required: 1
    assert np.abs(np.linalg.norm(x, axis=0) - 100).max() < 2e-3


def test_normals_and_curvatures_of_triangles_are_continuous():
    surface = SURFACES["triangles"]
    parameter = np.linspace(0, 1, 2001)
    path = np.array([np.cos(parameter), np.sin(parameter), 0.3 + 0 * parameter])
    path = 5 * path / np.linalg.norm(path, axis=0)
    for values in (surface.gradient(path), surface.hessian(path)):
        steps = np.abs(np.diff(values, axis=-1)).max()
        coarse = np.abs(np.diff(values[..., ::2], axis=-1)).max()
        assert coarse == pytest.approx(2 * steps, rel=0.1)  # no jump


@pytest.mark.parametrize(
    "surface",
    [
        drape.Plane((0, 0, 0.3), (1, 2, 5)),
        drape.Sphere(0.8, (0.1, 0, 0)),
        drape.Torus(0.6, 0.25),
    ],
)
def test_triangles_on_a_surface_cover_it(surface):
    """Closed surfaces have no gaps, and all vertices are on the surface."""
    x, t = drape.triangles_on(surface, np.full(3, -1.0), np.full(3, 1.0), 24)
    np.testing.assert_allclose(surface.level(x), 0.0, atol=1e-6)
    edges = np.sort(np.hstack([t[[0, 1]], t[[1, 2]], t[[2, 0]]]), axis=0)
    pairs, count = np.unique(edges, axis=1, return_counts=True)
    assert count.max() == 2
    outer = x[:, pairs[:, count == 1].ravel()]
    assert (np.abs(outer).max(axis=0) > 0.95).all()  # at the box alone
    beside, none = drape.triangles_on(surface, np.full(3, 8.0), np.full(3, 9.0), 8)
    assert beside.shape == none.shape == (3, 0)


def test_derivatives_at_the_same_points_are_computed_once(monkeypatch):
    tool, calls = drape.TriangleMesh(*plate(n=15)), []
    mean = tool._quadrics.mean
    monkeypatch.setattr(tool._quadrics, "mean", lambda x: calls.append(1) or mean(x))
    x = np.array([[1.0, 2.0], [3.0, 4.0], [0.05, 0.1]])
    level, gradient, hessian = tool.level(x), tool.gradient(x), tool.hessian(x.copy())
    assert len(calls) == 1
    moved = x.copy()
    moved[0] += 1.0
    assert not np.array_equal(tool.level(moved), level)
    assert len(calls) == 2
    x[0] += 1.0  # the last requested points, changed in place
    np.testing.assert_array_equal(tool.level(x), tool.level(moved))
    for values in (gradient, hessian):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 0.0


@pytest.mark.parametrize(
    ("normal", "first", "expected"),
    [
        ((1.0, 0.0, -0.003), (0, 1, 0), (0, 0, 1)),  # a vertical wall: from outside
        ((1.0, 0.0, -0.03), (0, 1, 0), (0, 0, -1)),  # seen from above
    ],
)
def test_an_inclined_plane_is_seen_from_above(normal, first, expected):
    point = np.zeros(3)
    y = tangents(drape.Plane(point, normal), point, first)[:, 1]
    assert y == pytest.approx(expected, abs=0.04)


@pytest.mark.parametrize(("lean", "x_axis"), [(0.006, (0, 0, 1)), (0.05, (0, -1, 0))])
def test_the_axes_of_a_wall_normal_to_x_follow_z(lean, x_axis):
    point = np.zeros(3)
    axes = drape.Axes.at(drape.Plane(point, (1.0, lean, 0.0)), point)
    assert axes.turn[:, 0] == pytest.approx(x_axis, abs=0.06)
