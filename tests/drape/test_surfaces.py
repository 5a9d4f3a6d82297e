"""Surfaces: derivatives, curvatures, growth, triangles and consistency checks."""

from functools import partial

import meshio
import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    MeshError,
    OnSurface,
    Ply,
    StepError,
    drape,
    equilibrium_near,
)
from skfem_textile.io import read_surface
from skfem_textile.solve.surface import GrowingSurface, OffSurfaceError, is_on, onto
from skfem_textile.solve.surface.on_surface import check_surface
from tests.helpers import facing_outwards, graph, sphere

# Surfaces: derivatives, curvatures that are known, growth, smoothed triangles


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


def test_derivatives_of_triangles_agree_with_differences_far_away_too():
    """The weights are wider there, because the nearest vertex is farther away."""
    surface, h = SURFACES["triangles"], 1e-5
    away = RNG.standard_normal((3, 40))
    x = away / np.linalg.norm(away, axis=0) * RNG.uniform(6.5, 12.0, 40)
    for d in np.eye(3)[:, :, None]:
        slope = surface.level(x + h * d) - surface.level(x - h * d)
        bend = surface.gradient(x + h * d) - surface.gradient(x - h * d)
        gradient = (surface.gradient(x) * d).sum(axis=0)
        hessian = np.einsum("ijn,jk->in", surface.hessian(x), d)
        np.testing.assert_allclose(slope / (2 * h), gradient, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(bend / (2 * h), hessian, rtol=1e-5, atol=1e-5)


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


def test_curvatures_of_sphere_cylinder_and_torus():
    outer = np.array([[11.0], [1.0], [0.0]])
    torus = drape.Torus(9.0, 2.0, (0, 1, 0))
    np.testing.assert_allclose(
        torus.hessian(outer)[..., 0], np.diag([0, 1 / 11, 1 / 2]), atol=1e-15
    )
    sphere = drape.Sphere(4.0).hessian(np.array([[4.0], [0.0], [0.0]]))
    np.testing.assert_allclose(sphere[..., 0], np.diag([0, 0.25, 0.25]))
    cylinder = drape.Cylinder(4.0).hessian(np.array([[4.0], [7.0], [0.0]]))
    np.testing.assert_allclose(cylinder[..., 0], np.diag([0, 0, 0.25]))


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


def test_the_tip_of_a_punch_is_as_curved_as_a_sphere():
    tip = np.array([[0.0], [0.0], [30.0]])
    for method in ("gradient", "hessian"):
        of_punch, of_sphere = (
            getattr(surface, method)(tip)
            for surface in (drape.Punch(30.0), drape.Sphere(30.0))
        )
        np.testing.assert_allclose(of_punch, of_sphere, atol=1e-15)


def test_the_level_of_a_die_is_the_distance_from_its_section():
    """The distance outside is computed from points along plane, fillet and wall."""
    die, turn = drape.Die(80.0, 10.0, (0, 0, 1)), np.linspace(0, np.pi / 2, 2001)
    r, z = 90 - 10 * np.sin(turn), 11 - 10 * np.cos(turn)
    far = np.linspace(0, 100, 20001)
    section = np.array(
        [[*r, *(90 + far), *(80 + 0 * far)], [*z, *(1 + 0 * far), *(11 + far)]]
    )
    x = np.array(
        [RNG.uniform(41, 150, 300), 0 * np.ones(300), RNG.uniform(-40, 60, 300)]
    )
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


def test_a_surface_grows_out_of_its_tangent_plane():
    x, sphere = RNG.uniform(-1, 1, (3, 9)), drape.Sphere(4.0, (0, 0, -4))
    np.testing.assert_allclose(GrowingSurface(sphere, np.zeros(3), 0.0).level(x), x[2])
    half = GrowingSurface(sphere, np.zeros(3), 0.5)
    larger = drape.Sphere(8.0, (0, 0, -8))
    np.testing.assert_allclose(half.level(x), larger.level(x))
    np.testing.assert_allclose(half.hessian(x), larger.hessian(x))


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_normals_of_an_stl_file_agree_with_the_sphere(tmp_path, form):
    p, t = sphere(2502)
    assert t.shape[1] == 5000
    file = tmp_path / "sphere.stl"
    meshio.Mesh(100 * p.T, [("triangle", t.T)]).write(file, binary=form == "binary")
    surface = read_surface(file)
    x = RNG.standard_normal((3, 4000))
    n = x / np.linalg.norm(x, axis=0)
    x = onto(surface, 100 * n)
    g = surface.gradient(x)
    cosine = (g * x).sum(axis=0) / np.linalg.norm(g, axis=0) / np.linalg.norm(x, axis=0)
    assert np.degrees(np.arccos(np.minimum(cosine, 1))).max() < 0.1  # required: 1
    assert np.abs(np.linalg.norm(x, axis=0) - 100).max() < 2e-3


def test_normals_and_curvatures_of_triangles_are_continuous():
    surface = SURFACES["triangles"]
    parameter = np.linspace(0, 1, 4001)
    path = np.array([np.cos(parameter), np.sin(parameter), 0.3 + 0 * parameter])
    path = 5 * path / np.linalg.norm(path, axis=0)
    for values in (surface.gradient(path), surface.hessian(path)):
        steps = np.abs(np.diff(values, axis=-1)).max()
        coarse = np.abs(np.diff(values[..., ::2], axis=-1)).max()
        assert coarse == pytest.approx(2 * steps, rel=0.1)  # no jump


def test_invalid_surfaces_are_rejected(tmp_path):
    p, t = sphere(30)
    for build, message in (
        (lambda: drape.Sphere(-1.0), "radius must be a positive length"),
        (lambda: drape.Plane(normal=(0, 0, 0)), "normal must not be zero"),
        (lambda: drape.Cylinder(1.0, (0, 0)), "must be three finite numbers"),
        (lambda: drape.Cone(2.0), "between 0 and"),
        (lambda: drape.Torus(1.0, 2.0), "must be smaller"),
        (lambda: drape.Punch(-3.0), "punch: radius must be a positive length"),
        (lambda: drape.Die(3.0, 0.0), "fillet must be a positive length"),
        (lambda: drape.double_dome(waist=1.0), "waist at least 0 and less than 1"),
        (lambda: drape.TriangleMesh(p[:, :9], t[:, :0]), "triangles must be"),
        (lambda: drape.TriangleMesh(p, t + 1), "undefined vertex"),
        (lambda: drape.TriangleMesh(p * np.nan, t), "has a corner at"),
        (lambda: drape.TriangleMesh(p[:2], t), "finite"),
        (lambda: drape.TriangleMesh(p, t[:, :2]), "vertices, but at least"),
    ):
        with pytest.raises(ValueError, match=message):
            build()
    with pytest.raises(MeshError, match="no such file"):
        read_surface(tmp_path / "none.stl")
    empty = tmp_path / "empty.stl"
    empty.write_text("nothing")
    with pytest.raises(MeshError, match=r"empty\.stl"):
        read_surface(empty)


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


def test_a_surface_beside_the_box_has_no_triangles_there():
    sphere = drape.Sphere(1.0, (9, 9, 9))
    x, t = drape.triangles_on(sphere, np.full(3, -1.0), np.full(3, 1.0), 8)
    assert x.shape == (3, 0)
    assert t.shape == (3, 0)


# Meshes of triangles as tools: edges, and evaluation by a ply


SIDE, CELLS = 60.0, 30


def bowl(hole=0.0):
    """A shallow bowl over a square of triangles, with a square hole in its middle."""
    s = np.linspace(-SIDE / 2, SIDE / 2, CELLS + 1)
    p, t = graph(s, lambda x, y: (x**2 + y**2) / 200)
    centres = p[:2, t].mean(axis=1)
    return drape.TriangleMesh(p, t[:, np.abs(centres).max(axis=0) > hole / 2])


def on_bowl(x, y):
    x, y = np.broadcast_arrays(x, y)
    return np.array([x, y, (x**2 + y**2) / 200])


def test_points_over_the_triangles_are_not_beyond_their_edges():
    rng = np.random.default_rng(1)
    x = on_bowl(*rng.uniform(-SIDE / 2, SIDE / 2, (2, 400)))
    tool = bowl()
    assert not tool.beyond_edges(x).any()
    np.testing.assert_array_equal(tool.beyond_edges(tool.facets.points), 0.0)


@pytest.mark.parametrize("distance", [1.0, 5.0, 40.0])
def test_points_beyond_edges_and_corners_have_their_distance(distance):
    side = SIDE / 2
    x = on_bowl(
        np.array([side + distance, -side - distance, 7.3, side + distance]),
        np.array([0.0, 11.1, side + distance, side + distance]),
    )
    beyond = bowl().beyond_edges(x)
    flat = distance * np.array([1, 1, 1, np.sqrt(2)])
    assert (beyond > 0.9 * flat).all()
    assert (beyond < 1.2 * flat).all()


def test_points_in_a_hole_are_beyond_its_edges():
    tool, whole = bowl(hole=20.0), bowl()
    x = on_bowl(np.array([0.0, 8.0, 9.9, 10.1, 20.0]), np.zeros(5))
    np.testing.assert_allclose(tool.beyond_edges(x), [10, 2, 0, 0, 0], rtol=0.05)
    assert not whole.beyond_edges(x).any()


def test_a_closed_surface_has_no_points_beyond_edges():
    x, t = drape.triangles_on(drape.Sphere(1.0), *np.full((2, 3), [[-1.1], [1.1]]), 12)
    t = facing_outwards(x, t)
    rng = np.random.default_rng(2)
    assert not drape.TriangleMesh(x, t).beyond_edges(rng.normal(size=(3, 99))).any()


@pytest.mark.parametrize("scale", [1e-300, 1e160, 1e306])
def test_a_surface_with_infinite_areas_is_rejected(scale):
    facets = bowl().facets
    with pytest.raises(
        MeshError, match=r"extend over .* mm: specify coordinates in mm"
    ):
        drape.TriangleMesh(scale * facets.points, facets.triangles())


def test_derivatives_at_the_same_points_are_computed_once(monkeypatch):
    tool, calls = bowl(), []
    mean = tool._quadrics.mean
    monkeypatch.setattr(tool._quadrics, "mean", lambda x: calls.append(1) or mean(x))
    x = on_bowl(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
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


def test_points_near_and_far_give_the_same_result_together_and_alone():
    """For any number of vertices within reach."""
    tool, rng = bowl(), np.random.default_rng(3)
    x = rng.normal(size=(3, 60)) * rng.choice([1.0, 30.0, 900.0], 60)
    level, hessian = tool.level(x), tool.hessian(x)
    for i in range(60):
        one = tool.level(x[:, [i]]), tool.hessian(x[:, [i]])
        np.testing.assert_allclose(one[0], level[i], rtol=1e-12)
        np.testing.assert_allclose(one[1][..., 0], hessian[..., i], rtol=1e-9)


def test_geodesics_on_triangles_agree_with_the_exact_surface():
    side = np.linspace(-25, 25, 7)
    X = np.array(np.meshgrid(side, side)).reshape(2, -1)
    exact = drape.HeightField(
        lambda x, y: drape.Height(
            *((x**2 + y**2) / 200, x / 100, y / 100),
            *(0.01 + 0 * x, 0 * x, 0.01 + 0 * x),
        )
    )
    error = drape.exponential_map(bowl(), X) - drape.exponential_map(exact, X)
    assert np.abs(error).max() < 1e-3 * np.linalg.norm(X, axis=0).max()


# Surfaces with an inconsistent gradient or Hessian are rejected, and no others


class Changed:
    """A surface with one part changed."""

    def __init__(self, surface, **changes):
        for part in ("level", "gradient", "hessian"):
            old = getattr(surface, part)
            change = changes.get(part, lambda values: values)
            setattr(self, part, lambda x, old=old, change=change: change(old(x)))


def ply(side=100.0, cells=6, at=(0.0, 0.0)):
    s = np.linspace(0, side, cells + 1)
    mesh = MeshQuad.init_tensor(s + at[0], s + at[1]).with_defaults()
    return Ply(mesh, Fabric(1e4, 0.1), dimension=3)


def bind(surface, **settings):
    LoadStepper(ply(**settings), {"tool": OnSurface(surface)}, 1)


def height(function):
    return drape.HeightField(
        lambda x, y: drape.Height(*function(x, y, np.zeros_like(x)))
    )


SPHERE = drape.Sphere(150.0, (0, 0, -150))
TORUS = drape.Torus(200.0, 80.0, (200.0, 0.0, 0.0), (0, 1, 0))
DOME = drape.double_dome()


def first_row(values):
    changed = values.copy()
    changed[0] *= 1.1
    return changed


@pytest.mark.parametrize("surface", [SPHERE, DOME, drape.Cylinder(60.0, (0, 0, -60))])
@pytest.mark.parametrize(
    ("part", "change"),
    [
        ("gradient", lambda g: -g),
        ("gradient", lambda g: 1.05 * g),
        ("gradient", np.zeros_like),
        ("gradient", first_row),
        ("hessian", lambda H: -H),
        ("hessian", np.zeros_like),
        ("hessian", lambda H: 2 * H),
        ("hessian", first_row),
    ],
)
def test_inconsistent_surfaces_are_rejected_before_any_work(surface, part, change):
    whole = {"gradient": "level", "hessian": "gradient"}[part]
    number = r"-?\d[\d.e+-]*"
    message = (
        rf"condition 'tool': {part} of the surface differs from the slope of {whole} "
        rf"at \({number}, {number}, {number}\): along [xyz] .*{whole}.* changes by "
        rf"{number} per mm, and .*{part}.* is {number}; slopes are over 0.1 mm: "
    )
    wrong, body = Changed(surface, **{part: change}), ply()
    with pytest.raises(ValueError, match=message) as error:
        LoadStepper(body, {"tool": OnSurface(wrong)}, 1)
    assert "\n" not in str(error.value)
    start = drape.displacement(body.nodes, drape.exponential_map(surface, body.nodes))
    with pytest.raises(ValueError, match="differs from the slope"):
        equilibrium_near(body, {"tool": OnSurface(wrong)}, start)


def test_the_message_contains_both_numbers_at_the_position():
    sphere = drape.Sphere(150.0, (0, 0, -150))
    wrong = Changed(sphere, hessian=lambda H: 0.5 * H)
    with pytest.raises(ValueError, match="differs") as error:
        bind(wrong)
    words = str(error.value).split()
    slope, value = float(words[words.index("by") + 1]), words[words.index("is") + 1]
    assert float(value.strip(";")) == pytest.approx(0.5 * slope, rel=0.01)


SOUND = {
    "plane above": drape.Plane((0, 0, 40.0), (0.1, 0.2, 1)),
    "pole in the middle": drape.Sphere(150.0, (50.0, 50.0, -150.0)),
    "equator": drape.Sphere(60.0, (0, 0, -60)),
    "large sphere": drape.Sphere(1e6, (0, 0, -1e6)),
    "tip": drape.Cone(0.8, (50.0, 50.0, 0.0), (0, 0, -1)),
    "tip at a node": drape.Cone(0.8, (0.0, 0.0, 0.0), (0, 0, -1)),
    "on the axis of a torus": drape.Torus(60.0, 20.0, (50.0, 50.0, -20.0)),
    "torus": TORUS,
    "double dome": DOME,
    "grown": GrowingSurface(SPHERE, np.zeros(3), 0.3),
    "not grown": GrowingSurface(SPHERE, np.zeros(3), 0.0),
    "parabola on one side alone": height(
        lambda x, y, o: (
            *(
                np.where(x > 50, (x - 50) ** 2 / 80, o),
                np.where(x > 50, (x - 50) / 40, o),
            ),
            *(o, np.where(x > 50, 1 / 40, o), o, o),
        )
    ),
    "a roof": height(
        lambda x, y, o: (abs(x - 50) / 2, np.sign(x - 50) / 2, o, o, o, o)
    ),
    "not beyond the nodes": height(
        lambda x, y, o: (np.sqrt(x), 0.5 / np.sqrt(x), o, -0.25 * x**-1.5, o, o)
    ),
}


@pytest.mark.parametrize("surface", SOUND.values(), ids=SOUND)
@pytest.mark.parametrize("cells", [1, 4, 5, 16])
def test_consistent_surfaces_are_accepted(surface, cells):
    with np.errstate(all="ignore"):
        body = ply(cells=cells)
        check_surface("tool", surface, np.pad(body.nodes, ((0, 1), (0, 0))))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("away", [0.0, 1e6])
def test_scale_and_position_have_no_effect(scale, away):
    body = ply(side=80.0, at=(away, 0.0))
    x = scale * np.pad(body.nodes, ((0, 1), (0, 0)))
    centre = scale * np.array([away, 0.0, -100.0])
    sphere = drape.Sphere(100.0 * scale, centre)
    for factor in (1e-6, 1.0, 1e6):  # of level, which need not be the distance
        level = {
            part: lambda v, f=factor: f * v for part in ("level", "gradient", "hessian")
        }
        check_surface("tool", Changed(sphere, **level), x)
        wrong = level | {"hessian": lambda v, f=factor: 0.9 * f * v}
        with pytest.raises(ValueError, match="hessian of the surface differs"):
            check_surface("tool", Changed(sphere, **wrong), x)


@pytest.mark.parametrize("side", [20.0, 60.0, 150.0, 400.0])
def test_triangles_are_consistent_up_to_their_edges_and_beyond(side):
    s = np.linspace(-40, 40, 25)
    body = ply(side=side, cells=8, at=(-side / 2, -side / 2))
    waves = graph(s, lambda x, y: 20 * np.cos(x / 20) * np.cos(y / 25))
    tool = drape.TriangleMesh(*waves)
    nodes = np.pad(body.nodes, ((0, 1), (0, 0)))
    check_surface("tool", tool, nodes)
    with pytest.raises(ValueError, match="gradient of the surface differs"):
        check_surface("tool", Changed(tool, gradient=lambda g: 1.05 * g), nodes)


def limited(error, lowest=-np.inf, furthest=100.0):
    """A sphere that raises an error at points that are low or far away."""

    def call(part, x):
        if np.min(x[2]) < lowest or np.max(x[0]) > furthest:
            raise error("beyond the table")
        return getattr(SPHERE, part)(x)

    surface = Changed(SPHERE)
    for part in ("level", "gradient", "hessian"):
        setattr(surface, part, partial(call, part))
    return surface


@pytest.mark.parametrize("error", [RuntimeError, ValueError, KeyError, OverflowError])
def test_a_surface_undefined_beyond_the_nodes_is_accepted(error):
    nodes = np.pad(ply().nodes, ((0, 1), (0, 0)))
    assert nodes[0].max() == 100
    check_surface("tool", limited(error), nodes)


def test_another_error_beyond_the_nodes_is_reported_with_its_cause():
    message = "'tool': level of the surface raised TypeError: beyond the table"
    with pytest.raises(ValueError, match=message) as error:
        bind(limited(TypeError))
    assert isinstance(error.value.__cause__, TypeError)


def test_arrays_of_another_shape_beside_the_nodes_are_rejected():
    nodes = ply().nodes.shape[1]
    wrong = Changed(SPHERE, hessian=lambda H: H if H.shape[2] == nodes else H[0])
    with pytest.raises(ValueError, match="hessian of the surface must have the shape"):
        bind(wrong)


@pytest.mark.parametrize("error", [RuntimeError, KeyError])
@pytest.mark.parametrize("lowest", [-2.0, -30.0])
def test_a_run_stops_at_the_last_state_before_its_surface_ends(error, lowest):
    """In an iteration, or in the prediction along geodesics."""
    tool = OnSurface(limited(error, lowest, np.inf))
    held = {"tool": tool, "x": Condition([0], (0.0, 0.0, None))}
    held["turn"] = Condition([1], (0.0, None, None))
    text = (
        f"of the surface raised {error.__name__}: .?beyond the table.?; try a surface"
    )
    with pytest.raises(StepError, match=text) as stop:
        LoadStepper(bent(ply()), held, 2).run()
    assert "\n" not in str(stop.value)


def test_a_surface_that_fails_at_the_touching_point_is_rejected():
    def single(part, x):
        if x.shape[1] == 1:
            raise KeyError("one point")
        return getattr(SPHERE, part)(x)

    surface = Changed(SPHERE)
    for part in ("level", "gradient", "hessian"):
        setattr(surface, part, partial(single, part))
    message = "'tool': level of the surface raised KeyError: 'one point'"
    with pytest.raises(ValueError, match=message) as error:
        LoadStepper(ply(), {"tool": OnSurface(surface)}, 1).run()
    assert isinstance(error.value.__cause__, KeyError)


def test_a_surface_that_fails_beside_the_nodes_has_no_checkpoint(tmp_path):
    body = ply()
    held = {"tool": OnSurface(limited(KeyError)), "x": Condition([0], (0.0, 0.0, None))}
    message = "'tool': level of the surface raised KeyError: 'beyond the table'"
    with pytest.raises(ValueError, match=message):
        LoadStepper(bent(body), held, 1, checkpoint=tmp_path / "run").run()


def bent(body):
    return Ply(body.mesh, Fabric(1e4, 0.1, bending=(5.0, 5.0)), dimension=3)
