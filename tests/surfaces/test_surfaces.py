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
    OnSurface,
    Ply,
    StepError,
    drape,
    equilibrium_near,
)
from skfem_textile.io import read_surface
from skfem_textile.solve.on_surface import check_surface
from skfem_textile.surfaces.surface import (
    GrowingSurface,
    OffSurfaceError,
    is_on,
    onto,
)
from tests.helpers import graph, sphere
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


# Surfaces with an inconsistent gradient or Hessian are refused, and no others


PARTS = "level", "gradient", "hessian"


class Changed:
    """A surface of which some parts are changed functions of their values."""

    def __init__(self, surface, **changes):
        for part in PARTS:
            old = getattr(surface, part)
            change = changes.get(part, lambda values: values)
            setattr(self, part, lambda x, old=old, change=change: change(old(x)))


class Limited:
    """A sphere that raises an error at some points, given by a function of x."""

    def __init__(self, error, beyond):
        for part in PARTS:
            setattr(self, part, partial(self._call, part, error, beyond))

    @staticmethod
    def _call(part, error, beyond, x):
        if beyond(x):
            raise error("beyond the table")
        return getattr(SPHERE, part)(x)


def ply(side=100.0, cells=6, at=(0.0, 0.0), **options):
    s = np.linspace(0, side, cells + 1)
    mesh = MeshQuad.init_tensor(s + at[0], s + at[1]).with_defaults()
    return Ply(mesh, Fabric(1e4, 0.1, **options), dimension=3)


def nodes_of(body):
    return np.pad(body.nodes, ((0, 1), (0, 0)))


def height(function):
    return drape.HeightField(
        lambda x, y: drape.Height(*function(x, y, np.zeros_like(x)))
    )


SPHERE = drape.Sphere(150.0, (0, 0, -150))
DOME = drape.double_dome()


def first_row(values):
    changed = values.copy()
    changed[0] *= 1.1
    return changed


CHANGES = (
    ("gradient", (np.negative, partial(np.multiply, 1.05), np.zeros_like, first_row)),
    ("hessian", (np.negative, partial(np.multiply, 2), np.zeros_like, first_row)),
)


@pytest.mark.parametrize("surface", [SPHERE, DOME, drape.Cylinder(60.0, (0, 0, -60))])
@pytest.mark.parametrize(("part", "changes"), CHANGES)
def test_inconsistent_surfaces_are_refused(surface, part, changes):
    whole = {"gradient": "level", "hessian": "gradient"}[part]
    number = r"-?\d[\d.e+-]*"
    message = (
        rf"condition 'tool': {part} of the surface differs from the slope of {whole} "
        rf"at \({number}, {number}, {number}\): along [xyz] .*{whole}.* changes by "
        rf"{number} per mm, and .*{part}.* is {number}; slopes are over 0.1 mm: "
    )
    body = ply()
    for change in changes:
        wrong = OnSurface(Changed(surface, **{part: change}))
        with pytest.raises(ValueError, match=message) as error:
            LoadStepper(body, {"tool": wrong}, 1)
        assert "\n" not in str(error.value)
    start = drape.displacement(body.nodes, drape.exponential_map(surface, body.nodes))
    with pytest.raises(ValueError, match="differs from the slope"):
        equilibrium_near(body, {"tool": wrong}, start)


def test_the_message_contains_both_numbers_at_the_position():
    wrong = OnSurface(Changed(SPHERE, hessian=lambda H: 0.5 * H))
    with pytest.raises(ValueError, match="differs") as error:
        LoadStepper(ply(), {"tool": wrong}, 1)
    words = str(error.value).split()
    slope, value = float(words[words.index("by") + 1]), words[words.index("is") + 1]
    assert float(value.strip(";")) == pytest.approx(0.5 * slope, rel=0.01)


SOUND = {
    "plane above": drape.Plane((0, 0, 40.0), (0.1, 0.2, 1)),
    "pole in the middle": drape.Sphere(150.0, (50.0, 50.0, -150.0)),
    "tip": drape.Cone(0.8, (50.0, 50.0, 0.0), (0, 0, -1)),
    "tip at a node": drape.Cone(0.8, (0.0, 0.0, 0.0), (0, 0, -1)),
    "on the axis of a torus": drape.Torus(60.0, 20.0, (50.0, 50.0, -20.0)),
    "grown": GrowingSurface(SPHERE, np.zeros(3), 0.3),
    "not grown": GrowingSurface(SPHERE, np.zeros(3), 0.0),
    "parabola on one side alone": height(
        lambda x, y, o: (
            np.where(x > 50, (x - 50) ** 2 / 80, o),
            np.where(x > 50, (x - 50) / 40, o),
            *(o, np.where(x > 50, 1 / 40, o), o, o),
        )
    ),
    "a roof": height(
        lambda x, y, o: (abs(x - 50) / 2, np.sign(x - 50) / 2, o, o, o, o)
    ),
    "not beyond the nodes": height(
        lambda x, y, o: (np.sqrt(x), 0.5 / np.sqrt(x), o, -0.25 * x**-1.5, o, o)
    ),
    "an error beyond the nodes": Limited(ValueError, lambda x: x[0].max() > 100),
}


@pytest.mark.parametrize("surface", SOUND.values(), ids=SOUND)
def test_consistent_surfaces_are_accepted(surface):
    with np.errstate(all="ignore"):
        for cells in (1, 4, 5, 16):
            check_surface("tool", surface, nodes_of(ply(cells=cells)))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("away", [0.0, 1e6])
def test_scale_and_position_have_no_effect(scale, away):
    x = scale * nodes_of(ply(side=80.0, at=(away, 0.0)))
    sphere = drape.Sphere(100.0 * scale, scale * np.array([away, 0.0, -100.0]))
    for factor in (1e-6, 1.0, 1e6):  # of level, which need not be the distance
        level = dict.fromkeys(PARTS, partial(np.multiply, factor))
        check_surface("tool", Changed(sphere, **level), x)
        wrong = level | {"hessian": partial(np.multiply, 0.9 * factor)}
        with pytest.raises(ValueError, match="hessian of the surface differs"):
            check_surface("tool", Changed(sphere, **wrong), x)


@pytest.mark.parametrize("side", [20.0, 60.0, 400.0])
def test_triangles_are_consistent_up_to_their_edges_and_beyond(side):
    s = np.linspace(-40, 40, 25)
    nodes = nodes_of(ply(side=side, cells=8, at=(-side / 2, -side / 2)))
    waves = graph(s, lambda x, y: 20 * np.cos(x / 20) * np.cos(y / 25))
    tool = drape.TriangleMesh(*waves)
    check_surface("tool", tool, nodes)
    with pytest.raises(ValueError, match="gradient of the surface differs"):
        check_surface("tool", Changed(tool, gradient=partial(np.multiply, 1.05)), nodes)


RAISED = "level of the surface raised"
BESIDE = Changed(SPHERE, hessian=lambda H: H if H.shape[2] == 169 else H[0])


@pytest.mark.parametrize(
    ("surface", "message", "cause"),
    [
        (
            Limited(TypeError, lambda x: x[0].max() > 100),
            f"{RAISED} TypeError: beyond the table",
            TypeError,
        ),
        (
            Limited(KeyError, lambda x: x.shape[1] == 1),
            f"{RAISED} KeyError: 'beyond the table'",
            KeyError,
        ),
        (BESIDE, "hessian of the surface must have the shape", type(None)),
    ],
)
def test_surfaces_that_fail_beside_the_nodes_are_refused(surface, message, cause):
    body = ply()
    with pytest.raises(ValueError, match=f"'tool': {message}") as error:
        LoadStepper(body, {"tool": OnSurface(surface)}, 1).run()
    assert isinstance(error.value.__cause__, cause)


@pytest.mark.parametrize(("error", "low"), [(RuntimeError, -2), (KeyError, -30)])
def test_a_run_stops_at_the_last_state_before_its_surface_ends(error, low):
    """In an iteration, or in the prediction along geodesics."""
    tool = OnSurface(Limited(error, lambda x: x[2].min() < low))
    held = {"tool": tool, "x": Condition([0], (0.0, 0.0, None))}
    held["turn"] = Condition([1], (0.0, None, None))
    text = (
        f"of the surface raised {error.__name__}: .?beyond the table.?; try a surface"
    )
    with pytest.raises(StepError, match=text) as stop:
        LoadStepper(ply(cells=2, bending=(5.0, 5.0)), held, 2, max_halvings=1).run()
    assert "\n" not in str(stop.value)
