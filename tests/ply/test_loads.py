"""Loads: resultants, equilibrium and rejected arguments."""

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
    OnePoint,
    Ply,
    Pressure,
    Quadratic,
    Traction,
)
from tests.helpers import distorted


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


def test_a_force_on_nodes_is_shared_equally():
    mesh = MeshQuad().refined(1).with_defaults()
    force = Force(lambda x: x[1] == 1, (3.0, 6.0))
    ply = Ply(mesh, Fabric(1e3), Full(), terms=[force])
    force = ply.nodal(ply.load(ply.basis.zeros(), 1.0))
    top = ply.nodes[1] == 1
    np.testing.assert_allclose(force[:, top].T, [[1.0, 2.0]] * 3)
    assert not force[:, ~top].any()


def test_the_twist_of_both_families_has_an_energy():
    """z = c x y has the twist c, and no curvature along the fibres."""
    mesh = MeshQuad().refined(2).scaled(10.0).with_defaults()
    ply = Ply(mesh, Fabric(1e3, bending=(5.0, 7.0), twist=3.0), Full(), dimension=3)
    u = ply.basis.zeros()
    x, y = ply.nodes[:2]
    u.reshape(-1, 3)[:, 2] = 0.01 * x * y
    (term,) = (term for term in ply.terms if term.name == "bending")
    energy = term.energy(u, 1.0, {})
    assert energy == pytest.approx(0.5 * 3.0 * 0.01**2 * 100)
