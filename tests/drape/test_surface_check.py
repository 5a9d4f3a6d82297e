"""Surfaces whose gradient or Hessian contradicts them are refused, and no others."""

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
from skfem_textile.solve.surface import Grown
from tests.helpers import graph


class Changed:
    """A surface of which one part is changed."""

    def __init__(self, surface, **changes):
        for part in ("level", "gradient", "hessian"):
            own = getattr(surface, part)
            change = changes.get(part, lambda values: values)
            setattr(self, part, lambda x, own=own, change=change: change(own(x)))


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
def test_a_part_that_contradicts_another_is_refused_before_any_work(
    surface, part, change
):
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


def test_the_message_has_both_numbers_at_the_place():
    sphere = drape.Sphere(150.0, (0, 0, -150))
    wrong = Changed(sphere, hessian=lambda H: 0.5 * H)
    with pytest.raises(ValueError, match="differs") as error:
        bind(wrong)
    words = str(error.value).split()
    slope, own = float(words[words.index("by") + 1]), words[words.index("is") + 1]
    assert float(own.strip(";")) == pytest.approx(0.5 * slope, rel=0.01)


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
    "grown": Grown(SPHERE, np.zeros(3), 0.3),
    "not grown": Grown(SPHERE, np.zeros(3), 0.0),
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
def test_sound_surfaces_are_not_refused(surface, cells):
    with np.errstate(all="ignore"):
        body = ply(cells=cells)
        OnSurface(surface).check("tool", np.pad(body.nodes, ((0, 1), (0, 0))))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("away", [0.0, 1e6])
def test_scale_and_place_make_no_difference(scale, away):
    body = ply(side=80.0, at=(away, 0.0))
    x = scale * np.pad(body.nodes, ((0, 1), (0, 0)))
    centre = scale * np.array([away, 0.0, -100.0])
    sphere = drape.Sphere(100.0 * scale, centre)
    for factor in (1e-6, 1.0, 1e6):  # of level, which need not be the distance
        level = {
            part: lambda v, f=factor: f * v for part in ("level", "gradient", "hessian")
        }
        OnSurface(Changed(sphere, **level)).check("tool", x)
        wrong = level | {"hessian": lambda v, f=factor: 0.9 * f * v}
        with pytest.raises(ValueError, match="hessian of the surface differs"):
            OnSurface(Changed(sphere, **wrong)).check("tool", x)


@pytest.mark.parametrize("side", [20.0, 60.0, 150.0, 400.0])
def test_triangles_are_sound_up_to_their_edges_and_beyond(side):
    s = np.linspace(-40, 40, 25)
    body = ply(side=side, cells=8, at=(-side / 2, -side / 2))
    waves = graph(s, lambda x, y: 20 * np.cos(x / 20) * np.cos(y / 25))
    tool = drape.TriangleMesh(*waves)
    nodes = np.pad(body.nodes, ((0, 1), (0, 0)))
    OnSurface(tool).check("tool", nodes)
    with pytest.raises(ValueError, match="gradient of the surface differs"):
        OnSurface(Changed(tool, gradient=lambda g: 1.05 * g)).check("tool", nodes)


def limited(error, lowest=-np.inf, furthest=100.0):
    """A sphere that raises an error of points that are low or far away."""

    def call(part, x):
        if np.min(x[2]) < lowest or np.max(x[0]) > furthest:
            raise error("beyond the table")
        return getattr(SPHERE, part)(x)

    surface = Changed(SPHERE)
    for part in ("level", "gradient", "hessian"):
        setattr(surface, part, partial(call, part))
    return surface


@pytest.mark.parametrize("error", [RuntimeError, ValueError, KeyError, OverflowError])
def test_a_surface_that_is_not_defined_beyond_the_nodes_is_not_refused(error):
    nodes = np.pad(ply().nodes, ((0, 1), (0, 0)))
    assert nodes[0].max() == 100
    OnSurface(limited(error)).check("tool", nodes)


def test_another_error_beyond_the_nodes_is_told_with_its_cause():
    said = "'tool': level of the surface fails: TypeError beyond the table"
    with pytest.raises(ValueError, match=said) as found:
        bind(limited(TypeError))
    assert isinstance(found.value.__cause__, TypeError)


def test_arrays_of_another_shape_beside_the_nodes_are_refused():
    nodes = ply().nodes.shape[1]
    wrong = Changed(SPHERE, hessian=lambda H: H if H.shape[2] == nodes else H[0])
    with pytest.raises(ValueError, match="hessian of the surface must have the shape"):
        bind(wrong)


@pytest.mark.parametrize("error", [RuntimeError, KeyError])
@pytest.mark.parametrize("lowest", [-2.0, -30.0])
def test_a_run_whose_surface_ends_stops_at_the_last_good_state(error, lowest):
    """In an iteration, or where geodesics carry the ply before it."""
    tool = OnSurface(limited(error, lowest, np.inf))
    held = {"tool": tool, "x": Condition([0], (0.0, 0.0, None))}
    held["turn"] = Condition([1], (0.0, None, None))
    said = f"of the surface fails: {error.__name__} .?beyond the table.?; try a surface"
    with pytest.raises(StepError, match=said) as stop:
        LoadStepper(bent(ply()), held, 2).run()
    assert "\n" not in str(stop.value)


def test_a_surface_that_fails_where_the_ply_touches_it_is_refused():
    def single(part, x):
        if x.shape[1] == 1:
            raise KeyError("one point")
        return getattr(SPHERE, part)(x)

    surface = Changed(SPHERE)
    for part in ("level", "gradient", "hessian"):
        setattr(surface, part, partial(single, part))
    said = "'tool': level of the surface fails: KeyError 'one point'"
    with pytest.raises(ValueError, match=said) as found:
        LoadStepper(ply(), {"tool": OnSurface(surface)}, 1).run()
    assert isinstance(found.value.__cause__, KeyError)


def test_a_surface_that_fails_beside_the_nodes_has_no_checkpoint(tmp_path):
    body = ply()
    held = {"tool": OnSurface(limited(KeyError)), "x": Condition([0], (0.0, 0.0, None))}
    said = "'tool': level of the surface fails: KeyError 'beyond the table'"
    with pytest.raises(ValueError, match=said):
        LoadStepper(bent(body), held, 1, checkpoint=tmp_path / "run").run()


def bent(body):
    return Ply(body.mesh, Fabric(1e4, 0.1, bending=(5.0, 5.0)), dimension=3)
