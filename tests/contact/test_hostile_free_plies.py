"""Plies that loads push onto tools, or away from them.

A valid ply is in equilibrium with its loads, whose sum is known, and stays near its
tools.  One that nothing stops is refused in one line.
"""

import warnings
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    Ply,
    StepError,
    Tool,
    Traction,
    drape,
)
from tests.helpers.hostile import (
    RIGHT,
    Family,
    WrongAnswerError,
    expect,
    expect_close,
    rejected,
    seeds,
)

# Largest error of the balance of all forces, relative to the loads, and largest
# displacement, relative to the size of the ply and the motions of the tools.
BALANCE, BOUND = 1e-3, 3.0

IN_PLANE = {
    "x": Condition("left", (0.0, None, None)),
    "y": Condition("bottom", (None, 0.0, None)),
}
HELD = {
    "x": Condition("left", (0.0, None, 0.0)),
    "y": Condition("bottom", (None, 0.0, None)),
    "z": Condition("right", (None, None, 0.0)),
}


class Scene(NamedTuple):
    """A ply to be loaded: terms, conditions, and the sum of its constant loads in N."""

    terms: list
    conditions: dict
    load: float = 0.0
    far: float = 0.0


class Blank:
    """A square ply with random side, mesh, stiffnesses and loads."""

    def __init__(self, seed):
        self.rng = rng = np.random.default_rng(seed)
        self.cells, self.side = int(rng.integers(4, 8)), rng.uniform(40.0, 200.0)
        self.up = int(rng.choice([-1, 1]))  # side of the ply to which a load pushes
        self.gap = self.side * 10 ** rng.uniform(-4, -1)
        self.pressure = 10 ** rng.uniform(-6, -2)
        self.steps = int(rng.integers(1, 4))
        self.fabric = Fabric(
            10 ** rng.uniform(2, 5),
            10 ** rng.uniform(-1.5, 0),
            bending=(rng.uniform(1, 20),) * 2,
        )

    @property
    def area(self):
        return self.side**2

    def ply(self, terms):
        s = np.linspace(-0.5, 0.5, self.cells + 1) * self.side
        mesh = MeshQuad.init_tensor(s, s)
        inner = np.setdiff1d(np.arange(mesh.nvertices), mesh.boundary_nodes())
        p, most = mesh.p.copy(), 0.2 * self.side / self.cells
        p[:, inner] += self.rng.uniform(-most, most, (2, inner.size))
        mesh = MeshQuad(p, mesh.t).with_defaults()
        return Ply(mesh, self.fabric, terms=terms, dimension=3)

    def weight(self, share=1.0):
        force = (0.0, 0.0, share * self.up * self.pressure)
        return BodyForce(force, factor=1.0, name="weight")

    def plate(self, side, name="plate", **options):
        """A plate above or below the ply."""
        plane = drape.Plane((0.0, 0.0, side * self.gap))
        return Tool(plane, side=-side, name=name, **options)

    def ball(self, side, travel=0.0, name="punch"):
        radius = self.side * self.rng.uniform(0.3, 1.0)
        centre = (0.0, 0.0, side * (radius + self.gap))
        motion = (0.0, 0.0, -side * travel)
        return Tool(drape.Sphere(radius, centre), motion=motion, name=name)

    def holder(self):
        plane = drape.Plane((0.0, 0.0, self.up * self.gap))
        return Holder(plane, pressure=self.pressure, side=-self.up, name="holder")

    @property
    def force(self):
        """Sum of a weight or pressure in N."""
        return self.up * self.pressure * self.area

    def tension(self):
        pull = 10 ** self.rng.uniform(-2, 0)
        return [
            Traction(edge, force, factor=1.0, name=edge)
            for edge, force in (("right", (pull, 0, 0)), ("top", (0, pull, 0)))
        ]


def bent(blank):
    """Loads that bend a held ply by less than its side."""
    blank.pressure = min(blank.pressure, 20 * min(blank.fabric.bending) / 1e7)
    return blank


VALID = {
    "weight on a plate": lambda b: Scene(
        [b.weight(), b.plate(b.up)], IN_PLANE, b.force
    ),
    "weight on a plate, a punch on the other side": lambda b: Scene(
        [b.weight(), b.plate(b.up), b.ball(-b.up)], IN_PLANE, b.force
    ),
    "holder and die": lambda b: Scene([b.holder(), b.plate(b.up)], IN_PLANE, b.force),
    "holder, weight and die": lambda b: Scene(
        [b.holder(), b.weight(-0.5), b.plate(b.up)], IN_PLANE, 0.5 * b.force
    ),
    "held edges, a tool far away": lambda b: Scene(
        [bent(b).weight(), Tool(drape.Plane((0, 0, -9 * b.side)), name="far")],
        HELD,
        b.force,
    ),
    "held edges over a ball": lambda b: Scene(
        [bent(b).weight(), b.ball(b.up)], HELD, b.force
    ),
    "nothing touches between plates": lambda b: Scene(
        [*b.tension(), b.plate(1), b.plate(-1, "table", motion=(0, 0, 1.5 * b.gap))],
        IN_PLANE,
    ),
    "a punch and held edges": lambda b: Scene(
        [b.ball(-b.up, 0.1 * b.side)], HELD, far=0.1 * b.side
    ),
    "a punch and a plate with a holder": lambda b: Scene(
        [b.holder(), b.plate(b.up), b.ball(-b.up, 0.5 * b.gap)], IN_PLANE, b.force
    ),
}

INVALID = {
    "weight away from a punch": lambda b: Scene(
        [b.weight(), b.ball(-b.up, 0.2 * b.side)], IN_PLANE
    ),
    "weight away from a plate": lambda b: Scene([b.weight(), b.plate(-b.up)], IN_PLANE),
    "holder without a die": lambda b: Scene(
        [b.holder(), b.ball(-b.up, 0.2 * b.side)], IN_PLANE
    ),
    "holder alone": lambda b: Scene([b.holder()], IN_PLANE),
    "weight along a plate": lambda b: Scene(
        [
            BodyForce((b.pressure, 0, 0), factor=1.0, name="slope"),
            b.weight(),
            b.plate(b.up),
        ],
        {"y": IN_PLANE["y"]},
    ),
    "tools that never touch": lambda b: Scene([b.ball(-b.up, -0.2 * b.side)], IN_PLANE),
    "a pull, and a punch that never touches": lambda b: Scene(
        [b.ball(-b.up, -0.2 * b.side)],
        IN_PLANE | {"pull": Condition("right", (0.02 * b.side, None, None))},
    ),
    "a punch pushes a free ply": lambda b: Scene(
        [b.ball(-b.up, 0.5 * b.side)], IN_PLANE
    ),
    "weight beside the outline of a plate": lambda b: Scene(
        [
            b.weight(),
            b.plate(b.up, outline=9 * b.side + np.array([[0, 1, 0], [0, 0, 1.0]])),
        ],
        IN_PLANE,
    ),
}

SCENES = VALID | INVALID


def attempt(hostile):
    name, seed = hostile
    blank = Blank(seed)
    scene, valid = SCENES[name](blank), name in VALID
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            ply = blank.ply(scene.terms)
            result = LoadStepper(ply, scene.conditions, blank.steps).run()
        except (ValueError, StepError) as error:
            if valid:
                raise WrongAnswerError(f"refused though valid: {error}") from None
            return rejected(error)
    if not valid:
        expect(not result.states[-1].verdict.stable, "taken, though nothing stops it")
        return RIGHT
    check(result, scene, blank)
    return RIGHT


def check(result, scene, blank):
    """Check the balance of forces at all nodes and in total, and the displacement."""
    ply, state = result.ply, result.states[-1]
    reactions = sum(state.reactions.values())
    if scene.load:
        error = abs(float(reactions[2]) + scene.load) / abs(scene.load)
        expect_close("sum of the forces over the loads", error, 0.0, BALANCE)
    acting = abs(scene.load) / ply.nodes.shape[1]
    acting = acting or max(np.abs(x).max() for x in state.reactions.values())
    expect_close("forces on free nodes", state.residuals[-1] / acting, 0.0, BALANCE)
    most = BOUND * (blank.side + scene.far)
    expect(np.abs(state.u).max() <= most, f"moved by {np.abs(state.u).max()}")


FAMILY = Family(
    "free plies",
    {name: st.tuples(st.just(name), seeds) for name in SCENES},
    attempt,
    180,
    short=36,
    seconds=120.0,  # a punch that pushes a free ply is refused after many halvings
)


def test_loads_are_carried_or_the_ply_is_refused():
    FAMILY.check(1)
