"""Surfaces in a run: inconsistent ones are refused, a run ends where they end."""

from contextlib import nullcontext
from functools import partial

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
from skfem_textile.solve.continuation import path_warning
from skfem_textile.solve.on_surface import check_surface
from skfem_textile.surfaces.surface import (
    GrowingSurface,
)
from tests.helpers import graph

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


class Spiked:
    """Plane z = 5 with a spike of 500 mm at x = 0, on which the Hessian is wrong."""

    def level(self, x):
        return x[2] - 5 - 500 * self._spike(x)

    def gradient(self, x):
        return np.stack([1000 / 9 * x[0] * self._spike(x), 0 * x[0], 1 + 0 * x[0]])

    def hessian(self, x):
        H = np.zeros((3, *x.shape))
        H[0, 0] = 1000 / 9 * (1 - 2 * (x[0] / 3) ** 2) * self._spike(x)
        return np.where(x[2] < 100, H, 0.0)

    def _spike(self, x):
        return np.exp(-((x[0] / 3) ** 2))


def test_surfaces_are_checked_near_the_ply_alone():
    """As smoothed triangles, of which points over an opening are projected far away."""
    X = np.array([[0.0, 0.0, 20.0, 40.0], [0.0, 30.0, 0.0, 40.0], np.zeros(4)])
    check_surface("die", Spiked(), X)
    with pytest.raises(ValueError, match="hessian of the surface differs"):
        check_surface("die", Spiked(), X + np.array([[0.0], [0.0], [500.0]]))


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


@pytest.mark.parametrize(
    ("height", "lean", "text"),
    [
        (3e-5, 3e-5, ""),
        (3e-4, 0.0, "is 0.0003 mm away"),
        (0.0, 3e-4, "is inclined by 0.017°"),
    ],
)
def test_a_surface_that_grows_touches_the_plane_of_the_ply(height, lean, text):
    plane = drape.Plane((0.0, 0.0, height), (lean, 0.0, 1.0))
    with pytest.raises(ValueError, match=text) if text else nullcontext():
        OnSurface(plane).at("tool", 0.5)


def test_a_warning_lists_five_load_factors():
    assert "0.4, 0.5: " in path_warning(0.1 * np.arange(1, 6))
    assert "0.4, 0.5, ...: " in path_warning(0.1 * np.arange(1, 7))
