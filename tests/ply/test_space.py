"""Plies in space."""

import numpy as np
import pytest
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
)
from skfem_textile.forms.in_plane import RESISTING
from skfem_textile.forms.kernels import elements
from skfem_textile.scenes import bias_extension
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.direction import definite
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent
from tests.helpers import (
    Coupled,
    derivative,
    distorted,
    one_quad,
    random_u,
    values_at_rest,
    zero_modes,
)
from tests.helpers.plies import CURVED, lifted

# A ply in space: derivatives, frames, the plane as a special case


FABRICS = {
    "even": Fabric((100.0, 3.0), Sin2(0.7), warp=(2, 1), weft=(-1, 3)),
    "clockwise": Fabric((100.0, 3.0), Sin2(0.7), warp=(-1, 3), weft=(2, 1)),
    "curved": Fabric(50.0, 0.5, **CURVED),
    "bending": Fabric(50.0, 0.5, CURVED["warp"], (-1.0, 3.0), bending=(3.0, 1.0)),
    "coupled": Fabric(Coupled(100.0, 30.0), 0.5),
}
FORMULATIONS = {
    "full": Full(),
    "one point": OnePoint(),
    "isotropic": OnePoint(2.0, "isotropic"),
    "macro": Macro(),
    "quadratic": Quadratic(),
    "quadratic, mean": Quadratic(20.0),
}

every_pair = pytest.mark.parametrize(
    ("fabric", "formulation"),
    [
        *((FABRICS["bending"], formulation) for formulation in FORMULATIONS.values()),
        *((fabric, OnePoint()) for k, fabric in FABRICS.items() if k != "bending"),
    ],
)
every_formulation = pytest.mark.parametrize(
    "formulation", FORMULATIONS.values(), ids=FORMULATIONS
)


def in_space(fabric, formulation):
    return Ply(distorted(1, jitter=0.2), fabric, formulation, dimension=3)


def curved_state(ply, seed, height=0.3):
    """A surface with curvature in all directions, with no node in its plane."""
    u = random_u(ply, seed, 0.02)
    x, y = ply.nodes
    u[2::3] += height * np.sin(x) * np.cos(y)
    return u


def rotated(ply, u, Q):
    """The displacement that rotates the current shape."""
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))
    return (Q @ (X + ply.nodal(u)) - X).T.ravel()


def flat(u):
    """A displacement in the plane as one in space."""
    return np.pad(u.reshape(-1, 2), ((0, 0), (0, 1))).ravel()


@pytest.mark.parametrize("closing", [0.62, 0.66])  # on both sides of the parabola
def test_closing_corners_have_exact_derivatives_in_space(closing):
    ply = Ply(MeshQuad(), Fabric(1.0, 1.0), Full(), dimension=3)
    u = ply.basis.zeros()
    corner = np.flatnonzero((ply.nodes == 1).all(axis=0))[0]
    u[3 * corner : 3 * corner + 2] = -closing, -closing / 2
    u[2::3] += 0.01 * np.sin(np.arange(4))
    assert ply.corners.area_ratio(u).min() < RESISTING
    term, d = ply.terms[-1], random_u(ply, 3, 1.0)
    assert term.name == "corners"
    along, twice = term.residual(u, 1.0) @ d, term.tangent(u, 1.0) @ d
    rate = derivative(lambda x: term.energy(x, 1.0), u, d, 1e-5)
    assert rate == pytest.approx(along, rel=1e-6)
    numerical = derivative(lambda x: term.residual(x, 1.0), u, d, 1e-5)
    np.testing.assert_allclose(twice, numerical, atol=1e-5 * np.abs(twice).max())


@every_pair
def test_a_rotation_in_space_rotates_forces_and_preserves_energy(fabric, formulation):
    ply = in_space(fabric, formulation)
    u = curved_state(ply, 4)
    Q, _ = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))
    Q *= np.linalg.det(Q)
    v = rotated(ply, u, Q)
    assert ply.energies(v) == pytest.approx(ply.energies(u), rel=1e-10, abs=1e-13)
    f, g = ply.nodal(ply.residual(u)), ply.nodal(ply.residual(v))
    np.testing.assert_allclose(g, Q @ f, atol=1e-10 * np.abs(f).max())
    for measure in (ply.shear_angle, ply.law_strain, ply.least_area_ratio):
        np.testing.assert_allclose(measure(v), measure(u), rtol=0, atol=1e-10)
    assert ply.creased(v).size == ply.creased(u).size == 0


@every_pair
def test_a_flat_ply_has_the_same_forces_as_in_the_plane(fabric, formulation):
    mesh = distorted(1, jitter=0.2)
    plane = Ply(mesh, fabric, formulation)
    space = Ply(mesh, fabric, formulation, dimension=3)
    u = random_u(plane, 6, 0.03)
    assert space.energy(flat(u)) == pytest.approx(plane.energy(u), rel=1e-12)
    f = plane.residual(u)
    np.testing.assert_allclose(
        space.residual(flat(u)), flat(f), rtol=0, atol=1e-12 * np.abs(f).max()
    )
    for measure in ("shear_angle", "law_strain", "least_area_ratio"):
        ours, theirs = getattr(space, measure)(flat(u)), getattr(plane, measure)(u)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "formulation", [OnePoint(), Macro()], ids=["one point", "macro"]
)
def test_a_bias_extension_held_in_its_plane_agrees_with_the_plane(formulation):
    scene = bias_extension(size=(2, 4))
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    top = scene.conditions["top"].value
    held = {
        "bottom": Condition("bottom"),
        "top": Condition("top", lambda X, t: np.array([*top(X, t), 0 * X[0]])),
        "plane": Condition(lambda X: X[0] > -np.inf, (None, None, 0.0)),
    }
    results = [
        LoadStepper(ply, conditions, 1, solver="superlu").run()
        for ply, conditions in (
            (Ply(scene.mesh, fabric, formulation), scene.conditions),
            (Ply(scene.mesh, fabric, formulation, dimension=3), held),
        )
    ]
    plane, space = (result.summary() for result in results)
    names = (
        "energy stabilisation_energy max_fibre_strain max_fibre_tension "
        "max_shear_angle_deg min_det_F linear_solves stable"
    )
    for name in names.split():
        assert space[name] == pytest.approx(plane[name], rel=1e-10), name
    assert plane["load_half_width"] > 0
    assert space["load_half_width"] is None
    theirs, ours = (r.states[-1].reactions["top"] for r in results)
    np.testing.assert_allclose(ours, flat(theirs), atol=1e-10 * np.abs(theirs).max())
    np.testing.assert_allclose(results[1].u, flat(results[0].u), rtol=0, atol=1e-10)


def tangent(ply, u, positive, tension=None):
    blocks = ply.stiffness(u, tension=tension, positive=positive)
    return ply.pattern.matrix(blocks).toarray()


@every_formulation
@pytest.mark.parametrize("shear", [0.4, -0.4])
def test_a_projected_tangent_is_positive_semi_definite(formulation, shear):
    """Shear moments alone make it indefinite out of plane, with either sign."""
    fabric = Fabric(100.0, Sin2(0.7), warp=(1, 0.1), weft=(-0.2, 1))
    ply = in_space(fabric, formulation)
    u = curved_state(ply, 7, height=0.1)
    u[::3] += shear * ply.nodes[1]
    tension = ply.arranged(np.zeros((2, *ply.basis.dx.shape)))
    least, *_, most = np.linalg.eigvalsh(tangent(ply, u, False, tension))
    assert least < -1e-4 * most
    least, *_, most = np.linalg.eigvalsh(tangent(ply, u, True, tension))
    assert least > -1e-12 * most


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_projected_matrix_of_an_element_is_the_nearest_one(dimension):
    ply = Ply(one_quad(), FABRICS["even"], Full(), dimension=dimension)
    u = random_u(ply, 8, 0.02)
    u[::dimension] -= 0.2 * ply.nodes[0]
    values, V = np.linalg.eigh(tangent(ply, u, False))
    assert values[0] < -0.01 * values[-1]
    nearest = (V * np.maximum(values, 0.0)) @ V.T
    np.testing.assert_allclose(
        tangent(ply, u, True), nearest, rtol=0, atol=1e-12 * values[-1]
    )


def test_the_regularised_tangent_is_definite_in_space():
    """Without tension nothing else prevents out-of-plane motion of a sheared ply."""
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(100.0, 1.0), OnePoint(), dimension=3)
    constraints = Constraints(ply.basis, {"bottom": Condition("bottom")})
    problem = Problem(ply, constraints, solver_named("superlu"))
    u = ply.basis.zeros()
    u[::3] = 0.3 * ply.nodes[1]
    slack, rest = ply.geometric_tension(u, 0 * u) * 0, ply.parameters_at_rest
    assert not Tangent.at(problem, u, rest, slack).definite
    tangent = definite(problem, u, rest, slack)
    assert tangent.definite
    assert tangent.projected


def test_plies_of_several_blocks_of_elements_have_the_same_stiffness(monkeypatch):
    """The mesh has more elements than a kernel evaluates at once."""
    monkeypatch.setattr(elements, "_BLOCK", 5)
    s, t = np.linspace(0, 4, 5), np.linspace(0, 3, 4)
    ply = Ply(MeshQuad.init_tensor(s, t), Fabric(10.0, 1.0), OnePoint(), dimension=3)
    x, y = ply.nodes
    u = np.stack([0 * x, 0.01 * x, 0.1 * np.sin(x) * np.sin(y)], axis=1).ravel()
    d = np.random.default_rng(1).standard_normal(len(u))
    twice, numerical = ply.tangent(u) @ d, derivative(ply.residual, u, d, 1e-5)
    np.testing.assert_allclose(numerical, twice, atol=1e-6 * np.abs(twice).max())


# Plies in space with a known solution: zero modes, twist, a hanging sheet


def test_a_free_flat_patch_has_known_zero_modes():
    """As counted by another program, for 75 unknowns."""
    lines = np.linspace(0, 10, 5)
    mesh = MeshQuad.init_tensor(lines, lines)
    for formulation in (OnePoint(), OnePoint(3.0)):
        ply = Ply(mesh, Fabric(1e3, 1.0), formulation, dimension=3)
        u = ply.basis.zeros()
        lifting = ply.terms[-1]
        assert lifting.name == "out_of_plane"
        assert zero_modes(ply.tangent(u)) == 12
        p = values_at_rest(lifting)
        assert zero_modes(ply.tangent(u) - lifting.tangent(u, 1.0, p)) == 28
    halves = MeshQuad.init_tensor(lines[::2], lines[::2])
    macro = Ply(halves, Fabric(1e3, 1.0), Macro(), dimension=3)
    assert zero_modes(macro.tangent(macro.basis.zeros())) == 12


def test_an_element_resists_twist_and_no_other_out_of_plane_motion():
    """½ C_s Σ A/4 ‖∇w(ξ_k)‖², of w = xy on a square of side 2: 4 C_s/3."""
    mesh = MeshQuad.init_tensor(np.array([-1.0, 1.0]), np.array([-1.0, 1.0]))
    ply = Ply(mesh, Fabric(10.0, 1.0), OnePoint(3.0), dimension=3)
    x, y = ply.nodes
    for motion, energy in ((x * y, 3.0 * 4 / 3), (x, 0.0), (1 + y, 0.0)):
        computed = ply.energies(lifted(ply, 1e-3 * motion))["out_of_plane"]
        assert computed == pytest.approx(1e-6 * energy, rel=1e-4, abs=1e-16)


def test_closing_fibres_have_stiffness_in_the_plane_only():
    """The factor at a crossing angle of 30 degrees is 1 − cos 30° = 0.134."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 10, 3), np.linspace(0, 10, 3))
    angle, grip = np.radians(60), 1 - np.cos(np.radians(30))
    tension = 1e3 * np.log(1.01) / 2 / (1 + 80 * np.sqrt(1e-3))
    for formulation, added in ((OnePoint(), 0.0), (Macro(), 3.2 * tension)):
        ply = Ply(mesh, Fabric(1e3, 1.0), formulation, dimension=3)
        x, y = ply.nodes
        u = ply.basis.zeros()
        u[0::3] = 0.01 * x + np.sin(angle) * y
        u[1::3] = (np.cos(angle) - 1) * y
        updated = ply.updated(ply.parameters_at_rest, u)
        within, across = (
            updated[name]["C_s"] for name in ("stabilisation", "out_of_plane")
        )
        np.testing.assert_allclose(across, 4.0 + added, rtol=1e-9)
        np.testing.assert_allclose(within, (4.0 + added) / grip**1.5, rtol=1e-9)


def catenary(n):
    """Relative errors of sag and horizontal force of a hanging sheet."""
    length, span, weight = 100.0, 80.0, 1e-3
    lines = np.linspace(0, length, n + 1)
    mesh = MeshQuad.init_tensor(lines, lines[:3]).with_defaults()
    load = BodyForce((0.0, 0.0, -weight), factor=1.0)
    ply = Ply(mesh, Fabric(1e4, 0.1), OnePoint(), [load], dimension=3)
    conditions = {
        "left": Condition("left"),
        "right": Condition("right", (span - length, 0.0, 0.0)),
    }
    result = LoadStepper(ply, conditions, 4, solver="superlu").run()
    c = brentq(lambda c: 2 * c * np.sinh(span / 2 / c) - length, 10, 1e3)
    sag = c * (np.cosh(span / 2 / c) - 1)
    width = ply.nodes[1].max()
    x, y, z = result.states[-1].reactions["right"]
    assert z == pytest.approx(weight * length * width / 2, rel=1e-9)
    assert y == pytest.approx(0.0, abs=1e-9)
    row = result.history()[-1]
    assert row["right_reaction_z"] == z
    assert row["right_displacement_x"] == pytest.approx(span - length)
    lowest = ply.nodal(result.u)[2].min()
    return np.array([-lowest / sag, x / (weight * c * width)]) - 1


def test_a_hanging_sheet_converges_to_a_catenary():
    """From the flat sheet, which has no transverse stiffness."""
    coarse, fine = catenary(8), catenary(16)
    assert (np.abs(fine) < [2.5e-3, 1.2e-3]).all()
    assert (np.abs(coarse / fine) > 3.5).all()


# Creases and folds in space: distinguished from rotations, and rejected


def pair_of_elements():
    return MeshQuad.init_tensor(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0]))


def test_a_crease_and_a_fold_are_distinguished_from_a_rotation():
    ply = Ply(pair_of_elements(), Fabric(10.0, 1.0), OnePoint(), dimension=3)
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))

    def bent(degrees):
        """The right element turned about the edge between both."""
        x, angle = X.copy(), np.radians(degrees)
        right = X[0] > 1.5
        x[0, right], x[2, right] = 1 + np.cos(angle), np.sin(angle)
        return (x - X).T.ravel()

    for degrees, creased in ((80, []), (-80, []), (100, [0, 1]), (-170, [0, 1])):
        assert ply.creased(bent(degrees)).tolist() == creased
        np.testing.assert_allclose(ply.least_area_ratio(bent(degrees)), 1.0)
    u = ply.basis.zeros()
    corner = np.flatnonzero((X[0] == 2) & (X[1] == 1))[0]
    u[3 * corner : 3 * corner + 2] = -0.7  # past the diagonal
    assert ply.least_area_ratio(u).min() < 0
    plane = Ply(pair_of_elements(), Fabric(10.0, 1.0), OnePoint())
    u_plane = u.reshape(-1, 3)[:, :2].ravel()
    np.testing.assert_allclose(
        ply.least_area_ratio(u), plane.least_area_ratio(u_plane), atol=1e-14
    )
    assert plane.creased(u_plane).size == 0


def test_a_creased_state_is_rejected_unless_it_may_warn():
    """The element at the end lies on its neighbour and is fixed there."""
    ply = Ply(pair_of_elements(), Fabric(10.0, 1.0), OnePoint(), dimension=3)

    def rolled(X, t):
        angle = np.pi * t
        right = np.maximum(X[0] - 1, 0.0)
        return np.array([right * (np.cos(angle) - 1), 0 * right, right * np.sin(angle)])

    conditions = {"all": Condition(lambda X: X[0] > -1, rolled)}
    with pytest.raises(RuntimeError, match="a crease that the mesh cannot resolve"):
        LoadStepper(ply, conditions, 3, max_halvings=0).run()
    result = LoadStepper(ply, conditions, 3, warn_only=["crease"]).run()
    assert result.converged


@pytest.mark.parametrize("dimension", [2, 3])
def test_positions_are_those_at_rest_and_the_displacement(dimension):
    ply = Ply(MeshQuad().refined(1), Fabric(1.0), Quadratic(), dimension=dimension)
    u = ply.basis.zeros()
    u[dimension - 1 :: dimension] = 0.25
    x = ply.positions(u)
    assert np.array_equal(x[:2], ply.nodes + 0.25 * np.eye(3)[dimension - 1, :2, None])
    assert np.array_equal(x[2:], np.full((dimension - 2, ply.nodes.shape[1]), 0.25))
