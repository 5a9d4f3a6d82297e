import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from skfem import Basis, BilinearForm, ElementVector, MeshQuad, asm
from skfem.helpers import grad

from skfem_textile import (
    CENTRE,
    GAUSS,
    ElementQuad1Fluctuation,
    Fabric,
    Full,
    HourglassBasis,
    Linear,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    quad_basis,
)
from skfem_textile.forms.in_plane import resistance
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import (
    Coupled,
    derivative,
    distorted,
    distorted_for,
    fit_mesh,
    one_quad,
    random_u,
)

seeds = st.integers(0, 2**32 - 1)
FORMULATIONS = [
    *(Full(), OnePoint(0.0), OnePoint(3.0), OnePoint(3.0, "continuity")),
    *(Macro(), Quadratic()),
]
many, few = settings(max_examples=15), settings(max_examples=2)


class Stiffening(Linear):
    """A nonlinear law: value = stiffness · (x + x³)."""

    def energy(self, x):
        return self.stiffness * (x**2 / 2 + x**4 / 4)

    def value(self, x):
        return self.stiffness * (x + x**3)

    def tangent(self, x):
        return self.stiffness * (1 + 3 * x**2)


FABRICS = [
    Fabric(100.0, 0.0),
    Fabric((100.0, 0.0), 2.0, warp=(2, 1), weft=(-1, 1)),
    Fabric(
        Stiffening(100.0), Stiffening(2.0), warp=lambda x: np.stack([1 + x[1], x[0]])
    ),
    Fabric(Coupled(100.0, 60.0), 2.0, warp=(2, 1), weft=(-1, 2)),
]


@pytest.mark.parametrize(
    "of_states",
    [settings(max_examples=1), pytest.param(many, marks=pytest.mark.slow)],
)
@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
@pytest.mark.parametrize(
    "fabric", FABRICS, ids=["plain", "one family", "curved", "coupled"]
)
def test_residual_and_tangent_are_derivatives(formulation, fabric, of_states):
    @given(seed=seeds)
    @of_states
    def are_derivatives(seed):
        check_derivatives(formulation, fabric, seed)

    are_derivatives()


def check_derivatives(formulation, fabric, seed):
    ply = Ply(distorted_for(formulation, seed), fabric, formulation)
    u, du = random_u(ply, seed), random_u(ply, seed + 1, 1.0)
    # Near a closed corner differences do not approximate derivatives.
    assume(ply.corners.area_ratio(u).min() > 0.1)
    work, f, K = derivative(ply.energy, u, du), ply.residual(u), ply.tangent(u)
    scale = np.abs(f).max() * np.abs(du).sum()
    assert work == pytest.approx(f @ du, abs=1e-7 * scale)
    change = derivative(ply.residual, u, du)
    np.testing.assert_allclose(change, K @ du, atol=1e-6 * abs(K).max())
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()


@BilinearForm
def all_gradient_components(u, v, w):
    C = np.random.default_rng(0).random((2, 2, 2, 2))
    return np.einsum("iJ...,iJkL,kL...->...", grad(v), C, grad(u))


def assembled(*bases):
    return sum(asm(all_gradient_components, basis) for basis in bases).toarray()


def test_centre_and_hourglass_sum_to_a_linear_problem_on_parallelograms():
    skew = np.array([[1.0, 0.4], [0.1, 0.8]])
    mesh = MeshQuad(skew @ MeshQuad().refined(1).p, MeshQuad().refined(1).t)
    both = assembled(quad_basis(mesh, CENTRE), HourglassBasis(mesh))
    np.testing.assert_allclose(both, assembled(quad_basis(mesh, GAUSS)), atol=1e-14)


def test_centre_and_hourglass_sum_to_a_linear_problem_on_any_quad():
    """With the areas of the points, not with a quarter of the area of the element."""
    mesh, element = distorted(5), ElementVector(ElementQuad1Fluctuation())
    centre, whole = quad_basis(mesh, CENTRE), assembled(quad_basis(mesh, GAUSS))
    both = assembled(centre, Basis(mesh, element, quadrature=GAUSS))
    np.testing.assert_allclose(both, whole, atol=1e-14)
    with_quarters = assembled(centre, HourglassBasis(mesh))
    assert np.abs(with_quarters - whole).max() > 1e-3


@pytest.mark.parametrize("shear", [0.0, 1.0])
@pytest.mark.parametrize(
    ("formulation", "modes"), [(Full(), 3), (OnePoint(1.0), 3), (OnePoint(0.0), 5)]
)
def test_zero_energy_modes_of_one_element(formulation, modes, shear):
    """Rigid motions and, without shear stiffness, one more."""
    ply = Ply(one_quad(), Fabric(1.0, shear), formulation)
    stiffness = np.linalg.eigvalsh(ply.tangent(ply.basis.zeros()).toarray())
    assert np.sum(stiffness < 1e-12) == modes + (shear == 0.0)


def polyline(knots, turns):
    """A path of unit speed through the origin, bent at the knots."""
    steps = np.diff(knots) * np.array([np.cos(turns), np.sin(turns)])
    return np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)


@pytest.mark.parametrize(
    "formulation",
    [f for f in FORMULATIONS if f != OnePoint(3.0, "continuity")],
    ids=repr,
)
@given(seed=seeds)
@few
def test_a_sum_of_two_unit_speed_paths_has_no_energy(formulation, seed):
    """x = f(X₁) + g(X₂) with |f′| = |g′| = 1, bent along the lines of the mesh."""
    mesh = rectangle(3, 2, (4, 5), "aligned")
    rng = np.random.default_rng(seed)
    X, Y = np.unique(mesh.p[0]), np.unique(mesh.p[1])
    f = polyline(X, rng.uniform(-0.6, 0.6, X.size - 1))
    g = polyline(Y, np.pi / 2 + rng.uniform(-0.6, 0.6, Y.size - 1))
    ply = Ply(fit_mesh(mesh, formulation), Fabric(1e4), formulation)
    x = [
        np.interp(ply.nodes[0], X, f[i]) + np.interp(ply.nodes[1], Y, g[i])
        for i in (0, 1)
    ]
    u = (x - ply.nodes).T.ravel()
    assert np.abs(ply.shear_angle(u)).max() > 0.01
    assert np.abs(ply.fibre_strain(u)).max() < 1e-14
    assert ply.energy(u) < 1e-20


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
@given(seed=seeds)
@few
def test_uniform_shear_has_no_energy_on_any_mesh(formulation, seed):
    ply = Ply(distorted_for(formulation, seed), Fabric(1e4), formulation)
    a, b = np.random.default_rng(seed).uniform(-0.7, 0.7, 2)
    F = np.array([[np.cos(a), np.sin(b)], [np.sin(a), np.cos(b)]])
    u = ((F - np.eye(2)) @ ply.nodes).T.ravel()
    assert ply.energy(u) < 1e-20
    np.testing.assert_allclose(ply.shear_angle(u), a + b, atol=1e-12)


@pytest.mark.parametrize(
    "formulation",
    [OnePoint(), Macro()]
    + [OnePoint(3.0, k) for k in ("energy", "rate", "isotropic", "continuity")],
    ids=repr,
)
def test_a_homogeneous_motion_of_curved_fibres_has_no_stabilisation_energy(formulation):
    ply = Ply(distorted_for(formulation, 1), FABRICS[2], formulation)
    u = (np.array([[0.2, 0.5], [-0.3, 0.1]]) @ ply.nodes).T.ravel()
    assert np.ptp(ply.shear_angle(u)) > 0.1
    assert abs(ply.energies(u)["stabilisation"]) < 1e-20
    np.testing.assert_allclose(ply.residuals(u)["stabilisation"], 0, atol=1e-12)


def test_the_node_order_of_a_cell_has_no_effect():
    mesh = distorted(2)
    clockwise = MeshQuad(mesh.p, mesh.t[::-1])
    one, other = (Ply(m, FABRICS[1], OnePoint(2.0)) for m in (mesh, clockwise))
    u = random_u(one, 7)
    assert one.energy(u) == pytest.approx(other.energy(u), rel=1e-12)


def test_the_resistance_is_twice_differentiable_and_zero_where_corners_are_open():
    J = np.array([0.08, 0.02])
    for below, above in zip(resistance(J - 1e-12), resistance(J + 1e-12), strict=True):
        np.testing.assert_allclose(below, above, rtol=1e-8, atol=1e-6)
    assert resistance(np.array([0.02]))[0] == pytest.approx(np.log(4.0) ** 3)
    assert all((part == 0).all() for part in resistance(np.array([0.08, 0.5, 3])))
    grid = np.linspace(-0.5, 0.08, 200)
    b, slope, curvature = resistance(grid)
    assert (np.diff(b) < 0).all()
    assert (slope[:-1] < 0).all()
    assert (curvature[:-1] > 0).all()
