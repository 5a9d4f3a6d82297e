"""The force of a holder is its pressure times the area within any valid outline."""

import numpy as np
import shapely
from hypothesis import strategies as st

from skfem_textile import Fabric, Holder, Ply, Quadratic, drape
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.hostile import RIGHT, Family, expect_close, rejected, seeds

PRESSURE = 0.01
SIZE = np.array([90.0, 60.0])

# Relative error of a force
TOLERANCE = 1e-6


def star(rng, corners=None):
    """A polygon around a point of the ply; not convex in general."""
    n = corners or rng.integers(3, 12)
    angle = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    radius = rng.uniform(8.0, 70.0, n)
    return rng.random(2)[:, None] * SIZE[:, None] + radius * [
        np.cos(angle),
        np.sin(angle),
    ]


def ring(rng):
    """A polygon with a hole, as one line that follows an edge twice."""
    t = np.linspace(0, 2 * np.pi, rng.integers(4, 30))
    centre = rng.random(2)[:, None] * SIZE[:, None]
    outer, inner = rng.uniform(30, 90), rng.uniform(5, 28)
    return centre + np.hstack(
        [r * np.array([np.cos(t), np.sin(t)]) for r in (outer, inner)]
    )


def on_nodes(rng):
    """A rectangle with edges through nodes of regular meshes."""
    low, high = np.sort(rng.choice(13, (2, 2), replace=True), axis=1).T
    high = np.maximum(high, low + 1)
    (x_0, y_0), (x_1, y_1) = low * SIZE / 12, high * SIZE / 12
    return np.array([[x_0, x_1, x_1, x_0], [y_0, y_0, y_1, y_1]])


def beside(rng):
    return star(rng) + 500.0 * rng.choice([-1, 1], (2, 1))


def crossing(rng):
    """A line with crossing edges; a star that is not convex may have none."""
    x = star(rng, 4)[:, [0, 2, 1, 3]]
    return crossing(rng) if shapely.Polygon(x.T).is_valid else x


def flat(rng):
    return rng.random((2, 1)) * 50 + np.outer(rng.random(2) + 0.1, rng.random(5) * 30)


VALID = {"star": star, "ring": ring, "on nodes": on_nodes}
INVALID = {"beside": beside, "crossing": crossing, "flat": flat}


def attempt(given, kind):
    """Compare the forces at rest and of a moved ply with areas of shapely."""
    rng = np.random.default_rng(given)
    outline = (VALID | INVALID)[kind](rng)
    mesh_kind = ("aligned", "irregular", "delaunay")[rng.integers(3)]
    n = int(rng.choice([3, 4, 6, 7, 12]))
    mesh = rectangle(*SIZE, (n, n), mesh_kind, 0.3, int(rng.integers(9)))
    turn, shift = rng.uniform(-3, 3), rng.uniform(-20, 20, 3)
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    holder = Holder(
        *(drape.Plane(), None, PRESSURE),
        motion=lambda t: (R, shift) if t else (np.eye(3), np.zeros(3)),
        side=1,
        outline=outline,
    )
    formulation = Quadratic(100) if mesh_kind == "delaunay" and n % 2 else None
    options = {"terms": [holder], "dimension": 3}
    fabric = Fabric(1e3, 0.1, bending=(5.0, 5.0))
    more = () if formulation is None else (formulation,)
    try:
        ply = Ply(mesh.with_defaults(), fabric, *more, **options)
    except ValueError as error:
        if kind in VALID and expected(outline) > 0:
            raise
        return rejected(error)
    (term,) = (x for x in ply.terms if x.name == "holder")
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))
    for t in (0.0, 1.0):  # it moves with the ply
        x = X if t == 0 else R @ X + shift[:, None]
        u = (x - X).T.ravel()
        force = term.forces(u, t, term.parameters.updated({}, u, t)).sum()
        right = PRESSURE * expected(outline)
        expect_close(
            f"force at {t:g}", force, right, TOLERANCE * PRESSURE * SIZE.prod()
        )
    if kind in INVALID:
        raise AssertionError("an invalid outline is accepted")
    return RIGHT


def expected(outline):
    """Area of the ply within an outline, where an odd number of edges surrounds it."""
    region = shapely.make_valid(shapely.Polygon(np.round(outline.T, 9)))
    return region.intersection(shapely.box(0, 0, *SIZE)).area


FAMILY = Family(
    "holders",
    {kind: st.tuples(seeds, st.just(kind)) for kind in (*VALID, *INVALID)},
    lambda given: attempt(*given),
    120,
)


def test_forces_are_pressure_times_area():
    FAMILY.check(6)
