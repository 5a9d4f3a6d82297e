"""Coulomb friction of tools and holders: exact forces, work, jamming and resume."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import diags
from skfem import MeshQuad

from skfem_textile import (
    CheckpointError,
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    MatrixTerm,
    OnePoint,
    Ply,
    Quadratic,
    StepError,
    ToleranceStepper,
    Tool,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.contact import (
    Compaction,
    MeasuredCompaction,
    box_of,
    placed_tools,
    tool_history,
)
from skfem_textile.contact.compaction import RigidHolder
from skfem_textile.contact.figures import _against_wrinkles
from skfem_textile.contact.friction import Friction
from skfem_textile.ply.parameters import Values
from tests.helpers.tools import plate

PLANE = drape.Plane((0.0, 0.0, 0.0))


def grid(length, width, nx, ny):
    x, y = np.linspace(0, length, nx + 1), np.linspace(0, width, ny + 1)
    return MeshQuad.init_tensor(x, y).with_defaults()


# A belt on a drum


def wrapped(mu, wrap, n, radius=30.0):
    """Ply, state and angle between neighbours of a belt pulled over a drum."""
    mesh = grid(radius * wrap, 2.0, n, 1)
    drum = drape.Cylinder(radius, (0, 0, -radius), (0, 1, 0))
    tool = Tool(drum, side=1, friction=mu, elastic_slip=0.01, name="drum")
    terms = [Traction("left", (-1.0, 0, 0), factor=1.0), tool]
    fabric = Fabric(1e4, 1.0, bending=(1e-3, 1e-3))
    ply = Ply(mesh, fabric, OnePoint(), terms, dimension=3)
    angle, y = ply.nodes[0] / radius, ply.nodes[1]
    x = np.array([radius * np.sin(angle), y, radius * (np.cos(angle) - 1)])
    ahead = np.array([np.cos(wrap), 0.0, -np.sin(wrap)])
    end = np.flatnonzero(ply.nodes[0] > radius * wrap - 1e-9)
    rest = np.setdiff1d(np.arange(len(y)), end)
    u = drape.displacement(ply.nodes, x)
    pulled = u.reshape(-1, 3)[end[0]] + ahead
    conditions = {
        "rest": Condition(rest, (None, 0.0, None)),
        "end": Condition(end, (pulled[0], 0.0, pulled[2])),
    }
    at_rest = ply.parameters_at_rest
    on_drum = Values({**at_rest["drum"], "slips_from": x})
    checks = ("work", "stabilisation", "deviation", "corners", "surface", "slack")
    start = {**at_rest, "drum": on_drum}
    state = equilibrium_near(ply, conditions, u, parameters=start, warn_only=checks)
    return ply, state


@pytest.mark.parametrize(
    ("mu", "wrap", "n"), [(0.1, 30, 30), (0.3, 90, 60), (0.4, 180, 120)]
)
def test_a_belt_on_a_drum_is_a_polygon_with_friction_at_its_corners(mu, wrap, n):
    """Its tension grows by (1 + μ tan δ/2)/(1 − μ tan δ/2) at a corner of the angle δ.

    The first corner has half an element of the drum on one side only: its friction is
    not along the bisector, but along the drum.
    """
    ply, state = wrapped(mu, np.radians(wrap), n)
    tension = ply.fibre_tension(state.u, state.parameters)[0].mean(axis=1)
    x = ply.positions(state.u)[:, ply.nodes[1] < 1e-9]
    x = x[:, np.argsort(ply.nodes[0][ply.nodes[1] < 1e-9])]
    out = x[:, :-1] - [[0.0], [0.0], [-30.0]]
    out[1] = 0.0
    n = out / np.linalg.norm(out, axis=0)
    along = np.array([n[2], 0 * n[0], -n[0]])
    before, expected = np.array([-1.0, 0.0, 0.0]), 1.0
    for i, segment in enumerate(np.diff(x, axis=1).T):
        ahead = segment / np.linalg.norm(segment)
        pulls = along[:, i] + mu * n[:, i]
        expected *= -(before @ pulls) / (ahead @ pulls)
        before = -ahead
    last = tension[ply.mesh.p[0, ply.mesh.t].mean(axis=0).argmax()]
    assert last == pytest.approx(expected, rel=5e-4)


# A strip between two plates


@cache
def between_plates(amplitude, cycles, steps, slip=0.02):
    """Strip that is pulled along, or back and forth, between a plate and a holder."""
    mesh = grid(50.0, 10.0, 10, 2)
    friction = {"side": 1, "elastic_slip": slip}
    plate = Tool(PLANE, friction=0.2, name="plate", **friction)
    holder = Holder(PLANE, pressure=0.01, friction=0.35, name="holder", **friction)
    fabric = Fabric(1e4, 1.0, bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, terms=[plate, holder], dimension=3)

    def path(t):
        return amplitude * (np.sin(2 * np.pi * cycles * t) if cycles else t)

    conditions = {
        "pull": Condition(
            "right", lambda X, t: path(t) + 0 * X[0], direction=(1, 0, 0)
        ),
        "y": Condition("right", (None, 0.0, None)),
    }
    checks = ("stabilisation", "deviation")
    return LoadStepper(ply, conditions, steps=steps, warn_only=checks).run()


BOUND = (0.2 + 0.35) * 0.01 * 500.0


@pytest.mark.parametrize("steps", [1, 3])
def test_a_strip_between_two_plates_is_pulled_by_the_friction_of_both(steps):
    result = between_plates(2.0, 0, steps)
    assert result.states[-1].reactions["pull"][0] == pytest.approx(BOUND, rel=1e-6)
    assert result.path_resolved
    assert "without friction only" in result.error.reason


def test_potentials_of_tools_are_independent_of_the_number_of_steps():
    """They do not contain the potential of friction, which belongs to a step."""
    for steps in (1, 3):
        potentials = between_plates(2.0, 0, steps).states[-1].potentials
        assert potentials == pytest.approx({"plate": 0.0, "holder": 0.0}, abs=1e-9)


def test_the_work_of_sliding_is_that_of_the_pull_less_what_is_elastic():
    """The bound times the path, less the elastic slip and stretch of the strip."""
    result = between_plates(2.0, 0, 3)
    lost = result.states[-1].energy_lost
    elastic = 0.02 + BOUND * 50.0 / (3 * 1e4 * 10.0)
    assert sum(lost.values()) == pytest.approx(BOUND * (2.0 - elastic), rel=1e-4)
    assert lost["holder"] / 0.35 == pytest.approx(lost["plate"] / 0.2, rel=1e-6)


@pytest.mark.dear("alone reverses the motion of a ply with friction")
def test_a_loop_dissipates_its_area():
    result = between_plates(2.0, 1, 8)
    force = np.array([state.reactions["pull"][0] for state in result.states])
    work = sum(result.states[-1].energy_lost.values())
    assert np.abs(force).max() == pytest.approx(BOUND, rel=1e-6)
    elastic = 0.02 + BOUND * 50.0 / (3 * 1e4 * 10.0)
    # From rest to the amplitude, back to the other one, and to the middle: the start
    # costs the elastic slip once, each return twice.
    assert work == pytest.approx(BOUND * (8.0 - 5 * elastic), rel=1e-3)
    assert result.linear_solves <= 32  # 36 without predicted forces in the tangent


def test_a_strip_slips_elastically_below_its_bound():
    """A pull of 0.04 of 0.15 N/mm moves it by this share of its elastic slip."""
    plate = Tool(PLANE, side=1, friction=0.3, name="plate")
    weight = Holder(PLANE, pressure=0.01, side=1, name="weight")
    load = Traction("right", (0.04, 0.0, 0.0))
    mesh = grid(50.0, 10.0, 5, 1)
    fabric = Fabric(1e6, 10.0, bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, terms=[plate, weight, load], dimension=3)
    held = {"y": Condition("bottom", (None, 0.0, None))}
    state = LoadStepper(ply, held, steps=1).run().states[-1]
    assert state.u[::3] == pytest.approx(0.02 * 0.04 / 0.15, rel=0.05)


# A holder with a force


@pytest.mark.parametrize(
    "law",
    [
        Compaction(0.3, 1e-3, 8.0),
        MeasuredCompaction((0.3, 0.25, 0.2), (0.0, 0.004, 0.03)),
    ],
)
def test_a_rigid_holder_presses_with_its_force_at_the_distance_of_its_law(law):
    """On a flat ply the pressure is the force over the area."""
    force = 10.0
    plate = Tool(PLANE, side=1, friction=0.2, name="plate")
    press = {"force": force, "compaction": law, "friction": 0.35}
    holder = Holder(PLANE, side=1, **press)
    fabric = Fabric(1e6, 1.0, bending=(1.0, 1.0))
    ply = Ply(grid(50.0, 10.0, 5, 1), fabric, terms=[plate, holder], dimension=3)
    conditions = {
        "pull": Condition("right", lambda X, t: t + 0 * X[0], direction=(1, 0, 0)),
        "y": Condition("right", (None, 0.0, None)),
    }
    checks = ("stabilisation", "deviation")
    result = LoadStepper(ply, conditions, steps=1, warn_only=checks).run()
    state, history = result.states[-1], tool_history(result)
    thickness = history["holder_distance_mm"][-1]
    assert law.pressure_at(thickness) == pytest.approx(force / 500.0, rel=1e-3)
    assert state.reactions["plate"][2] == pytest.approx(force, rel=1e-9)
    assert state.reactions["pull"][0] == pytest.approx(0.55 * force, rel=1e-6)


@pytest.mark.parametrize("law", [Compaction, MeasuredCompaction])
def test_a_rigid_holder_presses_on_quadratic_triangles(law):
    """Their corners have no area and bear nothing."""
    given = {
        Compaction: (0.3, 1e-3, 8.0),
        MeasuredCompaction: ((0.3, 0.25, 0.2), (0.0, 0.004, 0.03)),
    }[law]
    plate = Tool(PLANE, side=1, friction=0.2, name="plate")
    holder = Holder(PLANE, side=1, force=10.0, compaction=law(*given), friction=0.35)
    mesh, fabric = grid(50.0, 10.0, 3, 1).to_meshtri(), Fabric(1e5, 1.0)
    terms = [plate, holder]
    ply = Ply(mesh, fabric, Quadratic(), terms, dimension=3)
    conditions = {
        "pull": Condition("right", lambda X, t: t + 0 * X[0], direction=(1, 0, 0)),
        "y": Condition("right", (None, 0.0, None)),
    }
    state = LoadStepper(ply, conditions, steps=1).run().states[-1]
    assert state.reactions["plate"][2] == pytest.approx(10.0, rel=1e-9)
    assert state.reactions["pull"][0] == pytest.approx(5.5, rel=1e-6)
    corners = np.arange(mesh.nvertices)
    assert not state.parameters["holder"]["pressures"][corners].any()


def test_a_sheared_part_of_the_ply_bears_more_of_the_force():
    law = Compaction(0.3, 1e-3, 8.0)
    areas, weight = np.array([3.0, 2.0, 0.0]), np.array([1.0, 1.2, 1.0])
    pressures, distance = RigidHolder("holder", lambda t: 5.0 * t, law).pressed(
        1.0, areas, weight
    )
    expected = law.pressure_at(distance / weight)
    assert pressures[:2] == pytest.approx(expected[:2], rel=1e-9)
    assert pressures[2] == 0.0
    none = RigidHolder("holder", lambda t: 5.0 * t, law).pressed(1e-20, areas, weight)
    assert not none.pressures.any()  # a force of round-off
    none = RigidHolder("holder", lambda t: 5.0 * t, law).pressed(0.0, areas, weight)
    assert none.distance == pytest.approx(0.36)
    assert not none.pressures.any()


def test_a_run_is_not_resumed_with_another_law_of_compaction_or_slip(tmp_path):
    def stepper(law=(0.3, 1e-3, 8.0), slip=0.02):
        plate = Tool(PLANE, side=1, friction=0.2, elastic_slip=slip, name="plate")
        holder = Holder(PLANE, side=1, force=5.0, compaction=Compaction(*law))
        mesh, fabric = grid(50.0, 10.0, 2, 1), Fabric(1e5, 1.0)
        ply = Ply(mesh, fabric, terms=[plate, holder], dimension=3)
        held = {"held": Condition("right", (0.0, 0.0, None))}
        return LoadStepper(ply, held, steps=1, checkpoint=tmp_path)

    stepper().run()
    stepper().run(resume=True)
    for other in ((0.3, 1e-2, 8.0), (0.31, 1e-3, 8.0), (0.3, 1e-3, 8.01)):
        with pytest.raises(ValueError, match="law of compaction of 'holder' differ"):
            stepper(other).run(resume=True)
    with pytest.raises(ValueError, match="elastic slip of 'plate' differ"):
        stepper(slip=0.03).run(resume=True)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"bump": 0.01},
            "surface of 'plate' differ: restore its file if this was changed since",
        ),
        ({"outline": 90.0 * np.array([[-1, 1, 1], [-1, -1, 2]])}, "outline of 'plate'"),
    ],
)
def test_a_tool_that_changed_since_the_run_is_named(tmp_path, changed, message):
    """Also a triangle far from the ply."""

    def stepper(bump=0.0, **options):
        points, triangles = plate(60.0, 9, lambda x, y: 0 * x)
        points[2, 0] -= bump
        surface = drape.TriangleMesh(points, triangles)
        tool = Tool(surface, side=1, name="plate", **options)
        holder = Holder(PLANE, side=1, pressure=0.01)
        terms = [tool, holder]
        ply = Ply(grid(50.0, 10.0, 2, 1), Fabric(1e5, 1.0), terms=terms, dimension=3)
        held = {"held": Condition("right", (0.0, 0.0, None))}
        return LoadStepper(ply, held, steps=1, checkpoint=tmp_path)

    stepper().run()
    with pytest.raises(CheckpointError, match=f"to another run: its {message}"):
        stepper(**changed).run(resume=True)


def test_an_initial_guess_is_refused_with_friction_of_tools():
    """It would take one step, whatever the path, on which friction depends."""
    plate = Tool(PLANE, side=1, friction=0.2)
    ply = Ply(grid(9.0, 9.0, 1, 1), Fabric(1e5, 1.0), terms=[plate], dimension=3)
    held = {"held": Condition("right")}
    with pytest.raises(ValueError, match="initial_guess: friction of tools requires"):
        LoadStepper(ply, held, initial_guess=ply.basis.zeros())


def test_the_die_carries_the_force_on_a_sheared_ply():
    """Its area is cos γ times the flat one, its thickness without pressure 1/cos γ."""
    law, angle = Compaction(0.3, 1e-3, 8.0), np.radians(30)
    plate = Tool(PLANE, side=1, name="plate")
    holder = Holder(PLANE, side=1, force=10.0, compaction=law)
    terms = [plate, holder]
    ply = Ply(grid(20.0, 20.0, 2, 2), Fabric(1e4, 1.0), terms=terms, dimension=3)
    edge = ply.mesh.boundary_nodes()
    conditions = {
        "x": Condition(edge, lambda X, t: X[1] * np.sin(t * angle), (1, 0, 0)),
        "y": Condition(edge, lambda X, t: X[1] * (np.cos(t * angle) - 1), (0, 1, 0)),
    }
    state = LoadStepper(ply, conditions, steps=2).run().states[-1]
    share = np.cos(angle)
    expected = 0.3 / share * (1 + 10.0 / (400.0 * share * 1e-3)) ** (-1 / 8)
    assert state.parameters["holder"]["distance"] == pytest.approx(expected, rel=1e-9)
    assert state.reactions["plate"][2] == pytest.approx(10.0, rel=1e-9)


class Saturating:
    """A law with a largest pressure."""

    free = 0.3

    def pressure_at(self, thickness):
        return 0.01 * np.clip(1 - thickness / self.free, 0.0, 1.0)


def test_a_large_force_has_a_thickness_or_the_law_is_refused():
    areas, force = np.array([100.0, 100.0]), 1e6
    measured = MeasuredCompaction((0.3, 0.25, 0.2), (0.0, 0.004, 0.03))
    found = RigidHolder("holder", lambda t: force, measured).pressed(
        1.0, areas, np.ones(2)
    )
    assert 0 < found.distance < 1e-3
    expected = pytest.approx(force / 200.0, rel=1e-9)
    assert measured.pressure_at(found.distance) == expected
    saturating = RigidHolder("holder 'ring'", lambda t: force, Saturating())
    with pytest.raises(ValueError, match=r"^holder 'ring': .* than the force 1e"):
        saturating.pressed(1.0, areas, np.ones(2))


@pytest.mark.parametrize("last", [(0.010, 0.0101), (0.010, 0.02)])
def test_a_measured_law_rises_beyond_its_last_point(last):
    """Also one that flattens towards it, whose curve ends level."""
    law = MeasuredCompaction((0.3, 0.25, 0.2), (0.0, *last))
    p = law.pressure_at(np.array([0.2, 0.19, 0.1]))
    ratio = (1 / 0.1 - 1 / 0.2) / (1 / 0.19 - 1 / 0.2)
    assert p[0] == pytest.approx(last[1])
    assert p[1] > p[0] + 1e-5
    assert p[2] - p[0] == pytest.approx(ratio * (p[1] - p[0]))  # linear in 1/t


# A hemisphere


def formed(friction):
    """Punch force, and works of punch and holder, of a ply that a holder presses."""
    turn, half = np.linspace(0, 2 * np.pi, 73), 40.0
    circle = np.array([np.cos(turn), np.sin(turn)])
    ring = np.hstack([4 * half * circle, 26.0 * circle])
    options = {"friction": friction, "elastic_slip": 0.005}
    punch = drape.Punch(20.0, (0, 0, -20.1))
    terms = [
        Traction("right", (0.05, 0, 0), factor=1.0),
        Traction("top", (0, 0.05, 0), factor=1.0),
        Tool(punch, (0, 0, 8.0), name="punch", **options),
        Tool(drape.Die(22.0, 4.0, (0, 0, 0.1)), name="die", **options),
        Holder(
            drape.Plane((0, 0, 0.1)), pressure=6e-3, side=-1, outline=ring, **options
        ),
    ]
    ends = {"left": "mirror", "bottom": "mirror"}
    fabric = Fabric(1e3, 0.5, bending=(2.0, 2.0))
    mesh = grid(half, half, 4, 4)
    ply = Ply(mesh, fabric, terms=terms, dimension=3, fibre_ends=ends)
    held = {
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
    }
    states = LoadStepper(ply, held, steps=6).run().states
    holder = next(term for term in ply.terms if term.name == "holder")

    def pressure(s):
        f = holder.residual(s.u, s.load_factor, s.parameters["holder"])
        return -f[2::3]

    force = np.array([s.reactions["punch"][2] for s in states])
    of_punch = np.trapezoid(force, [8.0 * s.load_factor for s in states])
    of_holder = sum(
        0.5 * (pressure(a) + pressure(b)) @ (b.u - a.u)[2::3]
        for a, b in pairwise(states)
    )
    return force[-1], of_punch, of_holder, states


def stored(state):
    tractions = (x for k, x in state.potentials.items() if k.startswith("traction"))
    return sum(state.energies.values()) + sum(tractions)


@pytest.mark.dear("two formed plies")
def test_friction_raises_the_force_of_a_punch_whose_work_is_stored_or_lost():
    """As without friction, where sums by trapezoids miss 1.6 % in six steps."""
    off = []
    for friction in 0.0, 0.3:
        force, of_punch, of_holder, states = formed(friction)
        lost = sum(states[-1].energy_lost.values())
        risen = stored(states[-1]) - stored(states[0])
        off.append((risen + lost) / (of_punch + of_holder) - 1)
        if not friction:
            free = force
    assert force > 1.3 * free
    assert lost > 0.3 * of_punch
    assert off[1] == pytest.approx(off[0], abs=0.001)
    assert abs(off[0]) < 0.02
    assert of_holder > 0.02 * of_punch


# A disc that turns under a ply


def test_a_disc_that_turns_pulls_the_ply_around_with_its_bound_at_each_radius():
    mesh = grid(20.0, 20.0, 4, 4).translated((-10.0, -10.0)).with_defaults()

    def turn(t):
        c, s = np.cos(0.2 * t), np.sin(0.2 * t)
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.zeros(3)

    disc = Tool(PLANE, motion=turn, side=1, friction=0.3, name="disc")
    weight = Holder(PLANE, pressure=0.01, side=1, name="weight")
    ply = Ply(mesh, Fabric(1e5, 1e4), terms=[disc, weight], dimension=3)
    sides = {name: Condition(name, (0, 0, None)) for name in ("left", "right")}
    state = LoadStepper(ply, sides, steps=3).run().states[-1]
    contact = next(term for term in ply.terms if term.name == "disc")
    p = state.parameters["disc"]
    f = contact.friction.forces(state.u, 1.0, p).T
    x = contact._points.positions(state.u)
    torque = (x[0] * f[1] - x[1] * f[0]).sum()
    assert p["bound"].sum() == pytest.approx(0.3 * 0.01 * 400.0, rel=1e-9)
    assert -torque == pytest.approx(p["bound"] @ np.hypot(x[0], x[1]), rel=1e-3)


# Bounds that change within a step


RISING = {"pressure": lambda t: 0.0001 + 0.0199 * t, "friction": 0.3}
FALLING = {"pressure": lambda t: 0.02 - 0.0199 * t, "friction": 0.3}
JUMPING = {"pressure": 0.01, "friction": lambda t: 0.2 if t <= 0.5 else 0.4}


@pytest.mark.parametrize("weight", [RISING, FALLING, JUMPING])
@pytest.mark.parametrize("steps", [2, 4])
def test_the_work_of_sliding_is_independent_of_the_steps(weight, steps):
    """The mean bound, 1.2 N, times the path of 2 mm, less the elastic slip."""
    moved = {name: Condition(name, (2.0, 0.0, None)) for name in ("left", "right")}
    lost = between(None, steps, moved, **weight).states[-1].energy_lost
    assert lost == pytest.approx({"plate": 2.4, "weight": 2.4}, rel=0.02)


@pytest.mark.parametrize("weight", [RISING, FALLING])
@pytest.mark.parametrize("steps", [2, 16])
def test_the_error_of_the_work_is_estimated_by_bounds_at_ends_of_steps(weight, steps):
    """Of a bound that grows to B, or falls from it, along a path s: B s/2 by steps."""
    moved = {name: Condition(name, (2.0, 0.0, None)) for name in ("left", "right")}
    result = between(None, steps, moved, **weight)
    errors = [result.summary()[f"{x}_energy_lost_error"] for x in ("plate", "weight")]
    assert errors == pytest.approx([2.4 / steps] * 2, rel=0.05)
    text = "N·mm, has an estimated error of up to 1.2 N·mm in the computed part"
    warned = [x for x in result.warnings if "work of friction on tool 'plate'" in x]
    assert [text in x for x in warned] == [True] * (steps == 2)


def test_the_history_of_friction_belongs_to_the_run_on_its_mesh():
    """A displacement from another mesh replaces neither its steps nor its history."""
    plate = Tool(PLANE, side=1, friction=0.3, name="plate")
    ply = Ply(grid(20.0, 20.0, 1, 1), Fabric(1e5, 1e4), terms=[plate], dimension=3)
    held = {"left": Condition("left")}
    with pytest.raises(ValueError, match="friction of tools requires steps: omit it"):
        LoadStepper(ply, held, initial_guess=ply.basis.zeros())

    def stepper_at(density):
        return LoadStepper(ply, held)

    with pytest.raises(ValueError, match="requires laws and tools without friction"):
        ToleranceStepper(stepper_at, tolerance=0.01)


def advanced(placement, x, normal, force):
    """Work on a point with 2 N on a tool, and a force after a step between places x."""
    friction = Friction(lambda t: 0.3, 0.02, placement, lambda u: u.reshape(3, 1))
    rotation, _ = placement(1.0)
    values = {"bound": 0.3 * force, "normal": rotation.T @ normal[:, None]}
    p = Values({**friction.at_rest(x[0]), "pressed": np.array([2.0]), **values})
    return friction.advanced(p, x[1], 1.0, force)["work"]


def test_a_point_on_a_drum_that_turns_slips_along_an_arc():
    up, bound = np.array([0.0, 0.0, 1.0]), 0.6
    c, s = np.cos(1), np.sin(1)

    def turning(t):
        return (
            np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) if t else np.eye(3)
        ), 0 * up

    work = advanced(turning, (30 * up, 30 * up), up, np.array([2.0]))
    assert work == pytest.approx(bound * (30.0 - 0.02))


@pytest.mark.parametrize(("follows", "share"), [(0, 0.02 / 4.02), (1, 1.02 / 4.02)])
def test_a_point_that_a_tool_leaves_rubs_while_it_follows(follows, share):
    """The plate recedes by 4 mm and moves sideways by 2 mm; the bound falls to 0."""
    up = np.array([0.0, 0.0, 1.0])

    def receding(t):
        return np.eye(3), np.array([2 * t, 0.0, -4 * t])

    work = advanced(receding, (0 * up, -follows * up), up, np.array([0.0]))
    assert work == pytest.approx(share * 0.3 * (2.0 - 0.02))


# Motions that turn within a step


def turned(t, angle=2.0):
    c, s = np.cos(angle * t), np.sin(angle * t)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.zeros(3)


def returned(t):
    return 2 * (1 - abs(1 - 2 * t)), 0.0, 0.0


def between(motion, steps, conditions=None, pressure=0.01, friction=0.0):
    """Square ply of 4 N between a weight and a plate, or conditions, that move."""
    mesh = grid(20.0, 20.0, 1, 1).translated((-10.0, -10.0)).with_defaults()
    plate = Tool(PLANE, motion=motion, side=1, friction=0.3, name="plate")
    weight = Holder(PLANE, pressure=pressure, side=1, friction=friction, name="weight")
    ply = Ply(mesh, Fabric(1e5, 1e4), OnePoint(), [plate, weight], dimension=3)
    held = conditions or {
        name: Condition(name, (0, 0, None)) for name in ("left", "right")
    }
    checks = ("work", "stabilisation", "deviation")
    return LoadStepper(ply, held, steps=steps, warn_only=checks).run()


def turns(number):
    return lambda t: turned(t, 2 * np.pi * number)


def edge(motion):
    """Conditions of an edge that moves by a motion in the plane."""

    def value(axis):
        def at(X, t):
            R, c = motion(t)
            return (R[:2, :2] @ X - X)[axis] + c[axis]

        return at

    return {
        "x": Condition("left", value(0), direction=(1, 0, 0)),
        "y": Condition("left", value(1), direction=(0, 1, 0)),
    }


PULLED_BACK = {
    "x": Condition("left", lambda X, t: returned(t)[0] + 0 * X[0], direction=(1, 0, 0)),
    "y": Condition("left", (None, 0.0, None)),
}


@pytest.mark.parametrize(
    ("case", "steps", "missed"),
    [
        ((turned,), 1, 16),  # 1 − sin(1)/1
        ((turned,), 2, 4),
        ((turned,), 8, 0),
        ((turns(8),), 1, 100),
        ((turns(16),), 1, 100),
        ((returned,), 1, 100),
        ((returned,), 3, 50),
        ((returned,), 2, 0),
        ((lambda t: (2 * t, 0, 0),), 1, 0),
    ],
)
def test_a_motion_that_turns_within_a_step_is_a_warning(case, steps, missed):
    """The path is then not resolved, although there is an equilibrium."""
    result = between(*case, steps)
    turns = [x for x in result.warnings if "the motion turns within the step" in x]
    assert result.path_resolved == (not missed)
    assert len(turns) == bool(missed)
    assert not missed or f"step: {missed}% of the work of friction" in turns[0]


@pytest.mark.parametrize(("steps", "resolved"), [(1, False), (2, True), (3, False)])
def test_supports_that_turn_back_within_a_step_are_a_warning(steps, resolved):
    result = between(None, steps, PULLED_BACK)
    assert result.path_resolved == resolved
    warned = any("the motion turns within the step" in x for x in result.warnings)
    assert warned != resolved


@pytest.mark.parametrize(
    ("motion", "missed"), [(turned, 16), (turns(1 / 4), 10), (turns(8), 100)]
)
def test_supports_that_turn_within_a_step_are_a_warning(motion, missed):
    """1 − sin(θ/2)/(θ/2) of the work is missed, all of it after whole turns."""
    result = between(None, 1, edge(motion))
    expected = f"step: {missed}% of the work of friction"
    assert any(expected in x for x in result.warnings)


def test_supports_that_move_straight_and_faster_are_no_warning():
    def faster(t):
        return np.eye(3), np.array([np.interp(t, [0, 0.75, 1], [0, 0.1, 2]), 0, 0])

    assert between(None, 1, edge(faster)).path_resolved
    assert between(faster, 1).path_resolved


def test_an_edge_that_turns_with_a_tool_does_not_slide():
    result = between(turned, 1, edge(turned))
    assert result.path_resolved
    assert result.states[-1].energy_lost["plate"] == pytest.approx(0.0, abs=1e-3)


def test_a_ply_that_follows_a_tool_slips_in_no_step():
    """It turns with the plate, and not along the straight lines between its states."""
    plate = Tool(PLANE, motion=turned, side=1, friction=0.3, name="plate")
    weight = Holder(PLANE, pressure=0.01, side=1, name="weight")
    mesh = grid(20.0, 20.0, 2, 2).translated((-10.0, -10.0)).with_defaults()
    terms = [plate, weight]
    ply = Ply(mesh, Fabric(1e3, 10.0), OnePoint(), terms, dimension=3)
    checks = ("work", "stabilisation", "deviation")
    held = {"centre": Condition(lambda X: (X == 0).all(axis=0), (0, 0, None))}
    result = LoadStepper(ply, held, steps=4, warn_only=checks).run()
    assert result.path_resolved
    x = ply.positions(result.u)[:2]
    c, s = np.cos(2.0), np.sin(2.0)
    assert x == pytest.approx(np.array([[c, -s], [s, c]]) @ ply.nodes, abs=0.1)


def test_a_step_that_misses_the_work_of_friction_is_halved_on_request():
    plate = Tool(PLANE, motion=returned, side=1, friction=0.3, name="plate")
    weight = Holder(PLANE, pressure=0.01, side=1, name="weight")
    terms = [plate, weight]
    ply = Ply(grid(20.0, 20.0, 1, 1), Fabric(1e5, 1e4), OnePoint(), terms, dimension=3)
    held = {name: Condition(name, (0, 0, None)) for name in ("left", "right")}
    checks = ("stabilisation", "deviation")
    result = LoadStepper(ply, held, steps=1, warn_only=checks).run()
    assert [state.load_factor for state in result.states] == [0.0, 0.5, 1.0]
    assert result.path_resolved


# A wedge


@pytest.mark.parametrize("slope", [1.0, 0.25, 0.15])
def test_a_ply_slides_up_a_wedge_however_much_friction_presses_it_there(slope):
    """Its contact force follows from balance, also where fixed-point updates diverge.

    They change the error of the bound by the factor −μ/slope.
    """
    mu, load = 0.2, 10.0
    angle = np.arctan(slope)
    normal = (-np.sin(angle), 0.0, np.cos(angle))
    incline = Tool(
        drape.Plane((10.0, 0.0, -1e-9), normal),
        side=1,
        friction=mu,
        elastic_slip=1e-5,
        name="incline",
    )

    class Guide:
        def on(self, basis):
            stiffness = np.tile([1e-3, 1e4, 1e4], basis.N // 3)
            return MatrixTerm("guide", diags(stiffness).tocsr())

    mesh = grid(10.0, 10.0, 2, 2)
    terms = [Guide(), incline, Traction("left", (load / 10.0, 0, 0))]
    fabric = Fabric(1e4, 10.0, bending=(10.0, 10.0))
    ply = Ply(mesh, fabric, terms=terms, dimension=3)
    held = {"y": Condition("bottom", (None, 0.0, None))}
    result = LoadStepper(ply, held, steps=2).run()
    state = result.states[-1]
    pushed = load - 1e-3 * state.u[::3].sum()
    expected = pushed / (np.sin(angle) + mu * np.cos(angle))
    assert state.parameters["incline"]["force"].sum() == pytest.approx(
        expected, rel=1e-6
    )
    assert result.linear_solves < 150


# The term


def moved_term(seed, friction=0.3):
    """A holder and a tool that touch a ply which has slipped, with their state."""
    rng = np.random.default_rng(seed)
    mesh = grid(20.0, 20.0, 3, 3)
    sphere = drape.Sphere(60.0, (10, 10, -60.0))
    options = {"side": 1, "friction": friction, "elastic_slip": 0.05}
    kind = [
        Tool(sphere, motion=(0.1, 0.05, 0.2), **options),
        Holder(sphere, pressure=0.1, **options),
    ][seed % 2]
    ply = Ply(mesh, Fabric(1e3, 1.0), terms=[kind], dimension=3)
    term = ply.terms[-1]
    n = term.nodes.shape[1]
    values = dict(term.parameters.at_rest())
    if "force" in values:
        values |= {"force": rng.uniform(0, 2, n), "stiffness": np.full(n, 50.0)}
    values["shear"] = rng.normal(0, 0.3, (3, n))
    u = rng.normal(0, 0.1, ply.basis.N)
    return rng, term, u, term.parameters.updated(Values(values), u, 0.7)


@pytest.mark.parametrize("seed", range(4))
def test_friction_is_the_derivative_of_its_energy_and_stays_below_its_bound(seed):
    rng, term, u, p = moved_term(seed)
    d = rng.normal(size=u.size)
    h = 1e-6
    ends = [term.energy(u + s * h * d, 0.7, p) for s in (1, -1)]
    slope = term.residual(u, 0.7, p) @ d
    assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(slope, rel=1e-5)
    ends = [term.friction.forces(u + s * h * d, 0.7, p) for s in (1, -1)]
    moved = (term._points.matrix @ d.reshape(-1, 3)).T
    K = term.friction.stiffness(u, 0.7, p)
    change = np.einsum("ijn,jn->ni", K, moved)
    numerical = (ends[0] - ends[1]) / (2 * h)
    assert np.abs(numerical - change).max() < 1e-5 * np.abs(change).max()
    force = np.linalg.norm(term.friction.forces(u, 0.7, p), axis=1)
    assert (force <= p["bound"] * (1 + 1e-12)).all()
    assert force.max() > 0


@pytest.mark.parametrize("kind", [Tool, Holder])
def test_points_on_planes_of_symmetry_rub_along_the_planes(kind):
    """Forces there do not depend on motions off the planes, nor does the tangent."""
    rng, amount = np.random.default_rng(5), {Tool: {}, Holder: {"pressure": 0.1}}[kind]
    tool = kind(PLANE, side=1, friction=0.3, elastic_slip=0.05, **amount)
    ends = {"left": "mirror", "bottom": "mirror"}
    mesh, fabric = grid(20.0, 20.0, 3, 3), Fabric(1e3, 1.0)
    ply = Ply(mesh, fabric, terms=[tool], dimension=3, fibre_ends=ends)
    term, n = ply.terms[-1], ply.nodes.shape[1]
    values = dict(term.parameters.at_rest())
    if "force" in values:
        values |= {"force": rng.uniform(1, 2, n), "stiffness": np.full(n, 50.0)}
    u, d = rng.normal(0, 0.01, (2, ply.basis.N))
    p = term.parameters.updated(Values(values), u, 0.7)
    h = 1e-5
    ends = [term.residual(u + s * h * d, 0.7, p).reshape(-1, 3).T for s in (1, -1)]
    numerical = (ends[0] - ends[1]) / (2 * h)
    found = (term.tangent(u, 0.7, p) @ d).reshape(-1, 3).T
    off = numerical - found
    off[0, ply.nodes[0] == 0] = off[1, ply.nodes[1] == 0] = 0  # held there
    assert np.abs(off).max() < 1e-5 * np.abs(found).max()


def test_normals_are_in_the_axes_of_a_tool_that_turns_about_an_axis_in_its_plane():
    def tilted(t):
        c, s = np.cos(t), np.sin(t)
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.zeros(3)

    tool = Tool(PLANE, motion=tilted, side=1, friction=0.3)
    ply = Ply(grid(9.0, 9.0, 2, 2), Fabric(1e3, 1.0), terms=[tool], dimension=3)
    term = ply.terms[-1]
    p = term.parameters.updated(term.parameters.at_rest(), ply.basis.zeros(), 0.7)
    assert pytest.approx(np.tile([0.0, 0.0, 1.0], (25, 1))) == p["normal"].T


def test_a_bound_that_falls_shortens_the_elastic_slip_of_the_last_state():
    """A step sideways by ε turns the force by 45°; a bound of 0 has no force."""
    place = np.eye(3), np.zeros(3)
    friction = Friction(lambda t: 0.3, 0.05, lambda t: place, lambda u: u.reshape(3, 2))
    p = Values(
        {
            "bound": np.array([0.5, 0.0]),
            "normal": np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]]),
            "shear": np.array([[2.0, 2.0], [0.0, 0.0], [0.0, 0.0]]),
            "slips_from": np.zeros((3, 2)),
        }
    )
    sideways = np.array([[0.0, 0.0], [0.05, 0.05], [0.0, 0.0]])
    force = friction.forces(sideways.ravel(), 1.0, p)
    assert force[0] == pytest.approx(np.array([0.5, 0.5, 0.0]) / np.sqrt(2))
    assert not force[1].any()


def test_without_friction_a_tool_has_no_further_parameters():
    _, term, _, p = moved_term(0, friction=0.0)
    assert term.friction is None
    assert set(p) - {"shear"} == {"force", "stiffness"}


def test_a_run_with_friction_is_resumed_bit_for_bit(tmp_path):
    class KilledError(Exception):
        pass

    def kill(state):
        if state.load_factor > 0.4:
            raise KilledError

    def stepper(**options):
        mesh = grid(30.0, 30.0, 3, 3)
        tool = {"friction": 0.2}
        punch = Tool(
            drape.Sphere(20.0, (0, 0, -20.0)), motion=(0, 0, 6.0), name="punch", **tool
        )
        die = drape.Die(22.0, 3.0, (0, 0, 0.1))
        terms = [punch, Tool(die, name="die", **tool)]
        fabric = Fabric(1e3, 0.5, bending=(2.0, 2.0))
        ends = {"left": "mirror", "bottom": "mirror"}
        ply = Ply(mesh, fabric, OnePoint(), terms, dimension=3, fibre_ends=ends)
        held = {
            "x": Condition("left", (0.0, None, None)),
            "y": Condition("bottom", (None, 0.0, None)),
        }
        return LoadStepper(ply, held, steps=2, **options)

    with pytest.raises(StepError):
        stepper(on_step=kill, checkpoint=tmp_path).run()
    resumed = stepper(checkpoint=tmp_path).run(resume=True).states[-1]
    whole = stepper().run().states[-1]
    assert np.array_equal(resumed.u, whole.u)
    for name, values in whole.parameters.items():
        for key, value in values.items():
            assert np.array_equal(resumed.parameters[name][key], value)
    assert whole.parameters["punch"]["bound"].any()


# Warnings


def pressed_strip(**holder):
    """Result of a strip that a holder presses on a plate, and a lid far above it."""
    plate = Tool(PLANE, side=1, friction=0.2, name="plate")
    lid = Tool(drape.Plane((0, 0, 5.0)), side=-1, friction=0.2, name="lid")
    holder = Holder(PLANE, side=1, **holder)
    fabric = Fabric(1e6, 1.0, bending=(1.0, 1.0))
    terms = [plate, lid, holder]
    ply = Ply(grid(50.0, 10.0, 2, 1), fabric, terms=terms, dimension=3)
    held = {"pull": Condition("right", (0.1, 0.0, None))}
    return LoadStepper(ply, held, steps=1, warn_only=("stabilisation",)).run()


def test_friction_of_a_tool_that_touches_nothing_is_a_warning(caplog):
    result = pressed_strip(pressure=0.01, friction=0.3)
    expected = (
        "friction of tool 'lid' has no effect: no free node presses on it: check its "
        "position, motion and unit of length, and conditions along its normal"
    )
    assert [x for x in result.warnings if "friction" in x] == [expected]
    assert "untouched_tools" not in result.summary()  # it is said once
    assert caplog.text.count(expected) == 1
    early = [replace(result.states[-1], load_factor=0.5)]
    assert result.ply.contradictions(early) == []


@pytest.mark.parametrize(
    ("kind", "zero"),
    [
        ("pressure", {"pressure": 0.0}),
        ("force", {"force": 0.0, "compaction": Compaction(0.4, 1e-3, 7.0)}),
    ],
)
def test_friction_of_a_holder_that_never_presses_is_a_warning(kind, zero):
    """It touches the ply, but does not press."""
    result = pressed_strip(**zero, friction=0.3)
    text = f"friction of tool 'holder' has no effect: its {kind} is 0: increase it, or "
    assert [x for x in result.warnings if "'holder'" in x] == [
        f"{text}omit the friction"
    ]


def test_friction_of_zero_is_no_warning():
    """Neither of a tool that touches nothing nor of a long elastic slip."""
    lid = drape.Plane((0, 0, 5.0))
    zero = {"friction": lambda t: 0.0, "elastic_slip": 50.0}
    terms = [Tool(lid, side=-1, name="lid", **zero)]
    fabric = Fabric(1e6, 1.0, bending=(1.0, 1.0))
    ply = Ply(grid(50.0, 10.0, 2, 1), fabric, terms=terms, dimension=3)
    held = {"pull": Condition("right", (0.1, 0.0, 0.0)), "left": Condition("left")}
    result = LoadStepper(ply, held, steps=1, warn_only=("stabilisation",)).run()
    assert not [x for x in result.warnings if "friction" in x]


def test_a_holder_with_a_force_stands_at_its_distance():
    """One with a prescribed pressure has no position."""
    law = MeasuredCompaction((0.3, 0.25, 0.2), (0.0, 0.004, 0.03))
    heights = []
    for holder in ({"force": 14.0, "compaction": law}, {"pressure": 0.01}):
        result = pressed_strip(**holder)
        states, box = result.states[-1:], box_of(result.ply, result.states)
        (tools,) = placed_tools(result.ply, states, *box)
        heights.append({x.name: x.points[2] for x in tools if x.name == "holder"})
        distance = tool_history(result).get("holder_distance_mm", [None])[-1]
        assert heights[-1].keys() == ({"holder"} if distance else set())
        for z in heights[-1].values():
            assert z == pytest.approx(distance)


@pytest.mark.parametrize(("force", "beyond"), [(14.0, False), (16.0, True)])
def test_a_force_beyond_the_last_measured_point_is_a_warning(force, beyond):
    """The last pressure, 0.03 N/mm², is the pressure of 15 N on 500 mm²."""
    law = MeasuredCompaction((0.3, 0.25, 0.2), (0.0, 0.004, 0.03))
    result = pressed_strip(force=force, compaction=law)
    thickness = tool_history(result)["holder_distance_mm"][-1]
    expected = (
        f"force of tool 'holder' compresses the ply to {thickness:.4g} mm: its law of "
        "compaction ends at 0.2 mm and is extrapolated"
    )
    assert [x for x in result.warnings if "compaction" in x] == [expected] * beyond


@pytest.mark.parametrize(("slip", "warned"), [(0.5, False), (2.0, True)])
def test_an_elastic_slip_of_the_size_of_elements_is_a_warning(slip, warned):
    holder = Holder(PLANE, pressure=0.1, side=1, friction=0.3, elastic_slip=slip)
    ply = Ply(grid(50.0, 10.0, 2, 1), Fabric(1e3, 1.0), terms=[holder], dimension=3)
    rest, lost = ply.parameters_at_rest, {"holder": 1.0}
    state = SimpleNamespace(
        u=ply.basis.zeros(), load_factor=1.0, parameters=rest, energy_lost=lost
    )
    expected = (
        "friction of tool 'holder' is elastic up to a slip of 2 mm, its elastic_slip, "
        f"over 5% of the size of an element, {ply.mesh.param():.3g} mm: it restrains "
        "the ply too little: use 0.02 to 0.1 mm"
    )
    assert ply.contradictions([state]) == [expected] * warned


def test_advice_against_wrinkles_names_what_the_holder_states():
    law = Compaction(0.3, 1e-3, 8.0)
    for stated, advice in (
        ({"gap": 0.3}, "Reduce the gap of the holder"),
        ({"pressure": 0.1}, "Increase the pressure of the holder"),
        ({"force": 5.0, "compaction": law}, "Increase the force of the holder"),
    ):
        holder = Holder(PLANE, side=1, **stated)
        ply = Ply(grid(9.0, 9.0, 1, 1), Fabric(1.0, 1.0), terms=[holder], dimension=3)
        assert _against_wrinkles(ply).startswith(f"{advice}, or increase the tension")


def test_a_force_without_a_ply_under_the_holder_is_a_warning():
    law, ring = Compaction(0.3, 1e-3, 8.0), [[30, 51, 51, 30], [-1, -1, 11, 11]]
    holder = Holder(PLANE, force=5.0, compaction=law, side=1, outline=ring)
    ply = Ply(grid(50.0, 10.0, 5, 1), Fabric(1e3, 1.0), terms=[holder], dimension=3)
    states = []
    for t, pulled in (0.5, 10.0), (1.0, 25.0):
        u = np.tile([-pulled, 0.0, 0.0], ply.nodes.shape[1])
        values = ply.terms[-1].parameters.updated(Values({}), u, t)
        parameters = {"holder": values}
        states.append(SimpleNamespace(u=u, load_factor=t, parameters=parameters))
    expected = (
        "force of tool 'holder', 5 N, does not act at load factor 1, because no part "
        "of the ply is under it: its outline must cover a part of the ply while it "
        "presses"
    )
    assert ply.contradictions(states[:1]) == []
    assert ply.contradictions(states) == [expected]


@pytest.mark.parametrize(("outline", "lift"), [(False, 9.0), (True, 9.0), (False, 2.0)])
def test_pressure_on_a_part_that_is_beyond_the_surface_is_a_warning(outline, lift):
    """The left half of a ply is lifted through the plane on which a holder presses."""
    right = [[30, 51, 51, 30], [-1, -1, 11, 11]]
    plane = drape.Plane((0, 0, 0.1))
    ring = right if outline else None
    holder = Holder(plane, pressure=1e-4, side=-1, outline=ring)
    mesh = grid(50.0, 10.0, 10, 2)  # whose elements of 5 mm are split
    ply = Ply(mesh, Fabric(1e3, 1.0), terms=[holder], dimension=3)
    u = np.zeros((ply.nodes.shape[1], 3))
    u[ply.nodes[0] < 24, 2] = lift
    values = ply.terms[-1].parameters.updated(Values({}), u.ravel(), 1.0)
    state = SimpleNamespace(u=u.ravel(), load_factor=1.0, parameters={"holder": values})
    expected = (
        "tool 'holder' also presses on a part of the ply that is beyond its surface, "
        "by up to 8.9 mm: it is over an opening, and needs an outline"
    )
    warned = lift > 5 and not outline
    assert ply.contradictions([state]) == [expected] * warned
