"""Loads: resultants, equilibrium, limit points and rejected arguments."""

import re
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq
from skfem import (
    BilinearForm,
    ElementQuad1,
    FacetBasis,
    Functional,
    LinearForm,
    MeshQuad,
)
from skfem.helpers import dot

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Force,
    Forms,
    FormTerm,
    Full,
    LoadStepper,
    Macro,
    Newton,
    OnePoint,
    Ply,
    Pressure,
    Quadratic,
    Sin2,
    Traction,
)
from tests.helpers import distorted
from tests.helpers.random_plies import Crimped

# Loads: resultants, equilibrium and limit points


def test_a_load_acts_on_elements_that_are_small_relative_to_the_mesh():
    """Also on those whose inverse mapping scikit-fem refuses."""
    x = np.array([0.0, 150.0, 300.0 - 1e-2, 300.0])
    mesh = MeshQuad.init_tensor(x, x).with_defaults()
    with pytest.raises(Exception, match="didn't converge"):
        FacetBasis(mesh.translated((100.0, 100.0)), ElementQuad1())
    mesh = mesh.translated((100.0, 100.0)).with_defaults()
    ply = Ply(mesh, Fabric(1e3, 1.0), terms=[Traction("top", (0.0, 0.5))])
    force = ply.nodal(ply.load(ply.basis.zeros(), 1.0)).sum(axis=1)
    assert force == pytest.approx([0.0, 150.0])


CLAMP = {"clamp": Condition("bottom")}


def square(formulation):
    return Ply(distorted(1).with_defaults(), Fabric(1e3, 1.0), formulation)


EVERY = [Full(), OnePoint(), Macro(), Quadratic()]
every_formulation = pytest.mark.parametrize("formulation", EVERY, ids=repr)


LOADS = [
    Force("top", (0.3, 2.0)),
    Traction("top", (0.1, 0.4)),
    Traction("right", lambda x: np.stack([0 * x[0], 0.1 * x[1]])),
    BodyForce((0.0, 0.05)),
    Force(lambda x: x[1] > 1.99, (0.2, 1.0)),
]


@pytest.mark.parametrize(
    ("formulation", "load"),
    [*((f, LOADS[0]) for f in EVERY), *((EVERY[3], load) for load in LOADS[1:])],
)
def test_the_reaction_balances_the_load(formulation, load):
    """To ten digits, in every formulation; only supports are counted."""
    ply = square(formulation).with_terms(load)
    state = LoadStepper(ply, CLAMP, 1).run().states[-1]
    applied = ply.nodal(ply.load(state.u, 1.0)).sum(axis=1)
    assert np.linalg.norm(applied) > 0.01
    error = np.abs(state.reactions["clamp"] + applied).max()
    assert error < 1e-10 * np.abs(applied).max()


@every_formulation
def test_a_force_is_spread_by_length_and_a_traction_by_position(formulation):
    ply = square(formulation)
    top = ply.mesh.facets[:, ply.mesh.boundaries["top"]]
    length = np.linalg.norm(np.diff(ply.mesh.p[:, top], axis=1), axis=0).sum()
    force = ply.with_terms(Force("top", (3.0, -1.0)))
    traction = ply.with_terms(Traction("top", np.array([3.0, -1.0]) / length))
    u = ply.basis.zeros()
    np.testing.assert_allclose(force.load(u, 0.5), traction.load(u, 0.5), atol=1e-12)
    assert force.nodal(force.load(u, 0.5)).sum(axis=1) == pytest.approx([1.5, -0.5])


def test_a_weight_and_a_pre_tension_are_in_balance_before_the_load_grows():
    weight = BodyForce((0.0, -0.02), factor=1.0)
    ply = square(OnePoint()).with_terms(weight, Traction("top", (0.0, 1.0), factor=1.0))
    right = Condition(lambda x: (x[0] > 2.99) & (x[1] > 0), 0.1, direction=(1, 0))
    pulled = CLAMP | {"pull": right}
    states = LoadStepper(ply, pulled, 4).run().states
    first = states[0]
    assert first.load_factor == 0.0
    assert first.residuals[-1] <= first.tolerance
    assert first.verdict.stable
    assert np.abs(first.u).max() > 1e-4
    total = first.reactions["clamp"] + first.reactions["pull"]
    area, edges = ply.basis.dx.sum(), 3.0
    assert total[1] == pytest.approx(0.02 * area - edges, rel=1e-9)


def test_a_stiffness_that_grows_with_the_load_is_not_a_limit_point():
    """Its energy depends on the load factor, and not on the work alone."""
    glue = Forms(
        Functional(lambda w: 25 * w["t"] * dot(w["u"], w["u"])),
        LinearForm(lambda v, w: 50 * w["t"] * dot(w["u"], v)),
        BilinearForm(lambda u, v, w: 50 * w["t"] * dot(u, v)),
    )
    ply = square(Full())
    ply = ply.with_terms(FormTerm("glue", glue, ply.basis), Force("top", (5.0, 1.0)))
    assert LoadStepper(ply, CLAMP, 4).run().converged


def test_the_work_of_a_load_equals_the_stored_energy():
    """Also of one that is not proportional to the load factor."""
    load = Force("top", (0.0, 4.0), factor=lambda t: t**2)
    result = LoadStepper(square(Full()).with_terms(load), CLAMP, 20).run()
    for state in result.states:
        expected = -4.0 * state.load_factor**2
        assert state.reactions["clamp"][1] == pytest.approx(expected, abs=1e-9)
    row = result.history()[-1]
    assert row["work"] == pytest.approx(row["energy"], rel=1e-3)


@pytest.mark.parametrize("steps", [1, pytest.param(7, marks=pytest.mark.slow)])
def test_a_load_is_limited_by_the_peak_of_the_tension(steps):
    """A law with a peak of T/λ: exact, on one element."""

    class Softening:
        def energy(self, x):
            return 1e3 * 0.1 * (0.1 - (0.1 + x) * np.exp(-x / 0.1))

        def value(self, x):
            return 1e3 * x * np.exp(-x / 0.1)

        def tangent(self, x):
            return 1e3 * (1 - x / 0.1) * np.exp(-x / 0.1)

    peak = 1 / (1 / 0.1 + 1)
    limit = 1e3 * peak * np.exp(-1.0)
    ply = Ply(MeshQuad().with_defaults(), Fabric(Softening(), 1.0), Full())
    ply = ply.with_terms(Force("right", (3 * limit, 0.0)))
    rollers = {
        "held": Condition("left", 0.0, direction=(1, 0)),
        "below": Condition("bottom", 0.0, direction=(0, 1)),
        "above": Condition("top", 0.0, direction=(0, 1)),
    }
    stepper = LoadStepper(ply, rollers, steps)
    with pytest.raises(RuntimeError, match="the load exceeds a limit") as stopped:
        stepper.run()
    largest = 3 * stopped.value.result.states[-1].load_factor
    assert 0.99 < largest <= 1.0


def coarse(fabric, formulation, loads=(), halvings=2):
    """A square ply with sides of 10 mm."""
    mesh = MeshQuad().refined(halvings).scaled(10.0).with_defaults()
    return Ply(mesh, fabric, formulation, loads)


#: A square sheared by a force along its top: the largest force for the sin² law.
SIDEWAYS = np.array([1.0, -1.0]) / np.sqrt(2)


def sheared_by(total, factor):
    fabric, load = Fabric(1e3, Sin2(0.5)), Force("top", total * SIDEWAYS, factor)
    return coarse(fabric, Full(), [load], halvings=1)


@cache
def ramped_limit():
    """The load factor at which a ramped load of 3.75 N passes its limit."""
    ramped = sheared_by(3.75, lambda t: t)
    with pytest.raises(RuntimeError, match="the load exceeds a limit") as stopped:
        LoadStepper(ramped, CLAMP, 2).run()
    return stopped.value.result.states[-1].load_factor


@pytest.mark.parametrize(
    "factor",
    [
        pytest.param(
            lambda t: 1 - abs(2 * t - 1),
            marks=pytest.mark.dear("finds the limit twice, to a percent"),
        ),
        *(
            pytest.param(factor, marks=pytest.mark.slow)
            for factor in (lambda t: 4 * t * (1 - t), lambda t: t**8)
        ),
    ],
    ids=["there and back", "parabola", "late"],
)
@pytest.mark.parametrize("steps", [4, pytest.param(10, marks=pytest.mark.slow)])
def test_a_limit_point_is_reported_for_any_later_load(factor, steps):
    """To a percent of the load; no step passes it to the state on its other side."""
    ply = sheared_by(3.75, factor)
    with pytest.raises(RuntimeError, match="the load exceeds a limit") as stopped:
        LoadStepper(ply, CLAMP, steps).run()
    low, high = map(
        float, re.findall(r"factors (\S+) and (\S+): ", str(stopped.value))[0]
    )
    assert factor(low) == pytest.approx(ramped_limit(), rel=0.01)
    assert factor(high) == pytest.approx(factor(low), rel=0.01)


@pytest.mark.parametrize("halvings", [1, pytest.param(6, marks=pytest.mark.slow)])
def test_a_limit_point_close_to_the_end_of_a_step_is_reported(halvings):
    ply = sheared_by(1.01 * 3.75 * ramped_limit(), lambda t: t)
    with pytest.raises(RuntimeError, match="the load exceeds a limit"):
        LoadStepper(ply, CLAMP, 2, max_halvings=halvings).run()


@pytest.mark.parametrize("formulation", [Full(), OnePoint()], ids=repr)
def test_a_constant_load_is_not_a_limit_point(formulation):
    """Its work without motion is round-off."""
    ply = coarse(Fabric(1e3, 1.0), formulation)
    held = Force("top", (1.0, 2.0), factor=lambda t: min(1.0, 2 * t))
    assert LoadStepper(ply.with_terms(held), CLAMP, 2).run().converged
    on_clamp = BodyForce((0.01, -0.02), factor=1.0), Traction("bottom", (0.0, 1.0))
    assert LoadStepper(ply.with_terms(*on_clamp), CLAMP, 2).run().converged


def test_a_load_beyond_the_limit_at_rest_is_rejected():
    with pytest.raises(RuntimeError, match="loads that grow with the load factor"):
        LoadStepper(sheared_by(3.75, 1.0), CLAMP, 2, method=Newton(most=2)).run()


def test_a_ply_without_stiffness_at_rest_supports_a_load():
    ply = coarse(Fabric(1e3, Crimped(1e3)), Full(), [Force("top", (50.0, 0.0))])
    result = LoadStepper(ply, CLAMP, 2).run()
    assert result.converged
    forces = result.states[-1].reactions["clamp"]
    np.testing.assert_allclose(forces, [-50.0, 0.0], atol=1e-9)


def test_a_boundary_without_edges_has_no_load_and_every_edge_counts_once():
    mesh = distorted(1).with_defaults()
    top = mesh.boundaries["top"]
    mesh = mesh.with_boundaries({"none": top[:0], "twice": np.append(top, top)})
    ply = Ply(mesh, Fabric(1e3, 1.0), Full())
    for load in (Traction("none", (0, 1)), Force("none", (0, 1))):
        with pytest.raises(ValueError, match="'none' has no edge"):
            ply.with_terms(load)
    once, twice = (
        ply.with_terms(Traction(name, (0, 1))).load(ply.basis.zeros(), 1.0)
        for name in ("top", "twice")
    )
    np.testing.assert_array_equal(once, twice)


# A pressure that follows the surface, and the edges that it needs


EVERY_ELEMENT = {"quadrilaterals": Full(), "triangles": Quadratic()}
every_element = pytest.mark.parametrize(
    "formulation", EVERY_ELEMENT.values(), ids=EVERY_ELEMENT
)


def pressed(formulation, value=0.7):
    mesh = distorted(1, jitter=0.2).with_defaults()
    return Ply(mesh, Fabric(10.0, 1.0), formulation, [Pressure(value)], dimension=3)


@every_element
def test_the_energy_is_pressure_times_the_volume_above_the_plane(formulation):
    ply = pressed(formulation)
    x, y = ply.nodes
    u = ply.basis.zeros()
    u[::3], u[1::3], u[2::3] = 0.5 * x, 0.2 * y, 1 + 0.3 * x
    volume = 1.5 * 1.2 * 6 * (1 + 0.3 * 1.5)
    assert ply.energies(u, 0.5)["pressure"] == pytest.approx(-0.35 * volume, rel=1e-12)


@every_element
def test_inside_the_force_is_pressure_times_area_along_the_normal(formulation):
    """On a plane that is rotated, stretched and lifted."""
    ply = pressed(formulation)
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))
    F = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    F *= np.linalg.det(F)
    F[:, 0] *= 1.7
    u = (F @ X - X + 3.0).T.ravel()
    f = -ply.nodal(ply.residuals(u, 1.0)["pressure"])
    share = ply.nodal(ply.with_terms().load(ply.basis.zeros(), 1.0))[2]
    x, y = ply.nodes
    inner = (x > 1e-9) & (x < 2.999) & (y > 1e-9) & (y < 1.999)
    assert inner.any()
    expected = 1.7 * F[:, 2:] * share[inner]
    np.testing.assert_allclose(f[:, inner], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "formulation",
    [OnePoint(), pytest.param(Quadratic(), marks=pytest.mark.slow)],
    ids=["quad", "tri"],
)
def test_a_sheet_between_two_edges_becomes_a_cylinder(formulation):
    """T/λ = p R, the arc λ L over the chord L."""
    L, E, p = 100.0, 1e3, 1.0
    mesh = MeshQuad.init_tensor(np.linspace(0, L, 17), np.linspace(0, 20, 2))
    mesh = mesh.with_defaults()
    fabric = Fabric(E, 0.1, bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, formulation, [Pressure(p)], dimension=3)
    conditions = {
        "left": Condition("left"),
        "right": Condition("right"),
        "across": Condition(lambda X: X[0] > -1, (None, 0.0, None)),
    }
    result = LoadStepper(ply, conditions, 2, solver="superlu").run()

    def unbalanced(half_angle):
        stretch = half_angle / np.sin(half_angle)
        return E * np.log(stretch) / stretch - p * L / (2 * np.sin(half_angle))

    angle = brentq(unbalanced, 1e-3, 1.5)
    height = L / 2 * np.tan(angle / 2)
    assert ply.nodal(result.u)[2].max() == pytest.approx(height, rel=5e-3)
    # Each fixed edge supports half of the pressure on the chord.
    force = result.states[-1].reactions["left"]
    assert force[2] == pytest.approx(-p * L * 20 / 2, rel=1e-6)


def test_edges_on_planes_of_symmetry_move_along_them():
    """A quarter of a square bulges like the whole square."""
    heights = []
    for side, n, fixed in (
        (100.0, 2, ("left", "bottom", "right", "top")),
        (50.0, 1, ("left", "bottom")),
    ):
        lines = np.linspace(0, side, n + 1)
        mesh = MeshQuad.init_tensor(lines, lines).with_defaults()
        ply = Ply(mesh, Fabric(1e3, 1.0), Full(), [Pressure(0.1)], dimension=3)
        conditions = {name: Condition(name) for name in fixed}
        if side < 100:
            conditions["right"] = Condition("right", direction=(1, 0, 0))
            conditions["top"] = Condition("top", direction=(0, 1, 0))
        result = LoadStepper(ply, conditions, 2, solver="superlu").run()
        heights.append(ply.nodal(result.u)[2].max())
    assert heights[1] == pytest.approx(heights[0], rel=1e-8)
