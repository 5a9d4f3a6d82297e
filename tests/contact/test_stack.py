"""Plies that are formed together: contact, friction, thickness and refusals."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    Ply,
    Quadratic,
    Stack,
    StepError,
    Tool,
    Traction,
    drape,
)
from skfem_textile.scenes import hemisphere_forming

FABRIC = Fabric(1e3, 0.5, bending=(5.0, 5.0))
STRIP = MeshQuad.init_tensor(np.linspace(0, 40, 5), np.linspace(0, 20, 3))
STRIP = STRIP.with_defaults()
PRESSURE = 0.01


def strip(fabric=FABRIC, mesh=STRIP, **options):
    return Ply(mesh, fabric, **{"dimension": 3, **options})


def pulled_out(friction, n, numbers):
    """Force in N that pulls plies out of n pressed ones, the others being held."""
    base = Tool(drape.Plane((0, 0, 0.5), (0, 0, 1)), side=-1, name="base")
    top = Holder(drape.Plane((0, 0, 0.5)), pressure=PRESSURE, side=-1, name="top")
    plies = [strip() for _ in range(n)]
    stack = Stack(plies, friction=friction, thickness=1.0 / n, terms=[base, top])
    held = {}
    for i in range(1, n + 1):
        name, moves = ("right", 0.3) if i in numbers else ("left", 0.0)
        held[f"ply {i}"] = Condition(f"ply {i}: {name}", (moves, 0.0, None))
    run = LoadStepper(stack, held, steps=2).run()
    return sum(run.states[-1].reactions[f"ply {i}"][0] for i in numbers)


@pytest.mark.parametrize(
    ("n", "pulled", "sum_of_mu"), [(2, [2], 0.3), (3, [2], 0.6), (4, [2, 4], 0.9)]
)
def test_plies_are_pulled_out_against_friction_on_both_sides(n, pulled, sum_of_mu):
    force = PRESSURE * 40 * 20
    assert pulled_out(0.3, n, pulled) == pytest.approx(force * sum_of_mu, rel=1e-4)


def test_each_pair_of_plies_has_its_own_friction():
    table = [[0, 0.1, 0.5], [0.1, 0, 0.4], [0.5, 0.4, 0]]
    force = PRESSURE * 40 * 20
    assert pulled_out(table, 3, [2]) == pytest.approx(force * 0.5, rel=1e-4)


def formed(n, angles=(0.0,), thickness=0.0, friction=0.0, travel=25.0):
    """Result of a ply, or of a stack of plies at these angles, formed a little."""
    gap = 0.3 + n * thickness
    scene = hemisphere_forming("aligned", size=(4, 4), travel=travel, gap=gap)

    def ply(degrees, **more):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        fabric = Fabric(1e3, 0.1, (c, s), (-s, c), bending=(5.0, 5.0))
        ends = scene.fibre_ends
        return Ply(scene.mesh, fabric, dimension=3, fibre_ends=ends, **more)

    terms = [*scene.loads, *scene.tools]
    one = n == 1
    plies = [ply(angles[i % len(angles)]) for i in range(n)]
    whole = (
        ply(angles[0], terms=terms)
        if one
        else Stack(plies, thickness=thickness, friction=friction, terms=terms)
    )
    return LoadStepper(whole, scene.conditions, steps=2).run()


def largest_angle(result, elements):
    ply = result.ply
    return np.degrees(np.abs(ply.shear_angle(result.u, ply.centre)))[elements].max()


@pytest.mark.parametrize("n", [2, 3])
def test_equal_plies_are_formed_as_one_with_as_many_times_the_force(n):
    alone, stacked = formed(1), formed(n)
    force = alone.states[-1].reactions["punch"][2]
    assert stacked.states[-1].reactions["punch"][2] == pytest.approx(n * force, 1e-3)
    angle = largest_angle(alone, slice(None))
    for number in range(1, n + 1):
        of_ply = largest_angle(stacked, stacked.ply.part(number))
        assert of_ply == pytest.approx(angle, abs=0.1)


def test_forces_of_tools_balance_at_any_angle():
    result = formed(2, (0.0, 45.0), thickness=0.5, friction=0.2)
    forces = result.states[-1].reactions
    tools = sum(forces[name][2] for name in ("punch", "die", "holder"))
    assert forces["punch"][2] > 1.0
    assert tools == pytest.approx(0.0, abs=1e-8)


def test_plies_keep_their_thickness_from_each_other():
    result = formed(2, (0.0, 45.0), thickness=0.5)
    stack, last = result.ply, result.states[-1]
    assert stack.at_rest[2][stack.nodes_of(1)] == pytest.approx(-0.25)
    assert stack.at_rest[2][stack.nodes_of(2)] == pytest.approx(0.25)
    (contact,) = stack.contacts
    gaps = contact.gaps(last.u, 1.0, last.parameters[contact.name])
    assert gaps.min() > -1e-7
    pressed = contact.forces(last.u, 1.0, last.parameters[contact.name])
    assert pressed.sum() > 1.0


def test_nodes_of_the_coarser_ply_behind_the_finer_one_are_found():
    fine = MeshQuad.init_tensor(np.linspace(0, 40, 9), np.linspace(0, 20, 5))
    stack = Stack([strip(), strip(mesh=fine)])
    (contact,) = stack.contacts
    u = stack.basis.zeros().reshape(-1, 3)
    assert set(contact.rows) == set(range(*stack.nodes_of(2).indices(len(u))))
    u[7, 2] = 1.0  # in the middle of the lower ply, through the upper one
    flat = np.zeros(u.size)
    assert contact.passed(flat, 0.0, u.ravel(), 1.0).tolist() == []
    u[7, 2] = 2.5
    assert contact.passed(flat, 0.0, u.ravel(), 1.0).tolist() == [7]


def test_a_smaller_ply_leaves_the_others_exposed():
    inner = MeshQuad.init_tensor(np.linspace(10, 30, 3), np.linspace(5, 15, 3))
    stack = Stack([strip(), strip(mesh=inner), strip()])
    names = [x.name for x in stack.contacts]
    assert names == ["plies 1 and 2", "plies 1 and 3", "plies 2 and 3"]
    _, outer, _ = stack.contacts
    at = stack.nodes[:, stack.nodes_of(1)]
    covered = (np.abs(at - [[20], [10]]) <= [[10], [5]]).all(axis=0)
    assert outer.rows.tolist() == np.flatnonzero(~covered).tolist()


PULL = Traction("right", (1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Stack([strip()]), "at least two plies, got 1"),
        (
            lambda: Stack([strip(), Ply(STRIP, FABRIC)]),
            "ply 2 is in its plane: use dimension=3",
        ),
        (
            lambda: Stack([strip(), strip(terms=[PULL])]),
            "ply 2 has terms, 'traction on right': add them to the stack",
        ),
        (
            lambda: Stack([strip(formulation=Quadratic(80.0)), strip()]),
            "ply 1 has the formulation 'quadratic': use one of quadrilaterals",
        ),
        (
            lambda: Stack([strip(), strip(fibre_ends={"left": "mirror"})]),
            "the fibre ends of plies 1 and 2 differ",
        ),
        (
            lambda: Stack([strip(), strip(mesh=STRIP.translated((100.0, 0.0)))]),
            "no ply lies on another",
        ),
        (lambda: Stack([strip(), 3]), "ply 2 must be a Ply, got 3"),
        (
            lambda: Stack([strip(), strip()], friction=-0.1),
            "friction between plies must be",
        ),
        (
            lambda: Stack([strip(), strip()], friction=[[0, 0.1], [0.2, 0]]),
            "must be symmetric, but plies 1 and 2 have 0.1 and 0.2",
        ),
        (
            lambda: Stack([strip(), strip()], friction=[[0, 0.1]]),
            "needs 2 rows of 2 coefficients",
        ),
        (
            lambda: Stack([strip(), strip()], friction=[[0, None], [None, 0]]),
            "must be symmetric, but plies 1 and 2 have None and None",
        ),
        (
            lambda: Stack([strip(), strip()], thickness=[0.1, 0.2, 0.3]),
            "3 thicknesses for 2 plies",
        ),
        (lambda: Stack([strip(), strip()], thickness=-0.1), "at least 0 mm"),
    ],
)
def test_invalid_stacks_are_refused_in_one_line(make, message):
    with pytest.raises(ValueError, match=r"^[^\n]*$") as refusal:
        make()
    assert message in str(refusal.value)


def test_a_resumed_run_ends_in_the_same_state(tmp_path):
    def stepper():
        base = Tool(drape.Plane((0, 0, 0.5), (0, 0, 1)), side=-1, name="base")
        top = Holder(drape.Plane((0, 0, 0.5)), pressure=PRESSURE, side=-1, name="top")
        plies = [strip(), strip()]
        stack = Stack(plies, friction=0.3, thickness=0.5, terms=[base, top])
        held = {
            "lower": Condition("ply 1: left", (0.0, 0.0, None)),
            "upper": Condition("ply 2: right", (1.0, 0.0, None)),
        }
        return stack, held

    class StopError(Exception):
        pass

    def stop(state):
        if state.load_factor >= 0.5:
            raise StopError

    stack, held = stepper()
    whole = LoadStepper(stack, held, steps=4).run()
    stack, held = stepper()
    options = {"steps": 4, "checkpoint": tmp_path}
    with pytest.raises(StepError):
        LoadStepper(stack, held, on_step=stop, **options).run()
    stack, held = stepper()
    resumed = LoadStepper(stack, held, **options).run(resume=True)
    assert (resumed.u == whole.u).all()
    assert resumed.states[-1].energy_lost == whole.states[-1].energy_lost
