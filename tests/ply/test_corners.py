"""Corner terms keep elements unfolded and have no effect on open corners."""

import numpy as np
import pytest
from skfem import CellBasis, MeshQuad, asm

from skfem_textile import Fabric, Full, LoadStepper, Macro, OnePoint, Ply, Quadratic
from skfem_textile.forms import corner_resistance
from skfem_textile.forms.in_plane import RESISTING, resistance
from skfem_textile.mesh.splitting import split
from skfem_textile.ply import builtin_terms
from skfem_textile.scenes import bias_extension, strip
from tests.helpers import derivative, distorted, distorted_for, one_quad, random_u

FORMULATIONS = [Full(), OnePoint(1.0), Macro(), Quadratic(20.0)]


def closing(ply, seed=0, least=-0.02):
    """A displacement under which some corners resist, and by default one is folded."""
    u, amplitude = random_u(ply, seed, 0.05), 1.0
    while ply.corners.area_ratio(amplitude * u).min() > least:
        amplitude *= 1.01
    return amplitude * u


def at_corners(basis, elements, corners):
    """Basis at one node of each of these elements, with equal weights of the nodes."""
    points = basis.elem.elem.doflocs.T
    rule = points[:, corners, None], np.ones(1)
    one = CellBasis(
        *(basis.mesh, basis.elem, basis.mapping, None, elements, rule, basis.dofs),
        disable_doflocs=True,
    )
    one.dx = basis.dx[elements].sum(axis=1, keepdims=True) / points.shape[1]
    return one


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
def test_open_corners_have_no_force(formulation):
    ply = Ply(distorted_for(formulation, 1), Fabric(10.0, 0.5), formulation)
    u = random_u(ply, 1)
    assert ply.corners.area_ratio(u).min() > RESISTING
    assert ply.energies(u)["corners"] == 0
    assert not ply.residuals(u)["corners"].any()
    (term,) = (term for term in ply.terms if term.name == "corners")
    assert term.matrices(u, 1.0) is None
    assert term.tangent(u, 1.0) is None


@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
def test_forces_and_tangent_are_derivatives_where_corners_close(formulation):
    ply = Ply(distorted_for(formulation, 2), Fabric(10.0, 0.5), formulation)
    u, du = closing(ply), random_u(ply, 3, 1.0)
    assert ply.energies(u)["corners"] > 0
    slope = derivative(ply.energy, u, du, 1e-6)
    assert ply.residual(u) @ du == pytest.approx(slope, rel=1e-5)
    rate, tangent = derivative(ply.residual, u, du, 1e-7), ply.tangent(u)
    np.testing.assert_allclose(tangent @ du, rate, atol=1e-5 * np.abs(rate).max())
    assert abs(tangent - tangent.T).max() == 0


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("formulation", FORMULATIONS, ids=repr)
def test_the_corner_term_is_the_sum_of_its_forms(formulation, dimension):
    mesh, fabric = distorted_for(formulation, 2), Fabric(10.0, 0.5)
    ply = Ply(mesh, fabric, formulation, dimension=dimension)
    least = -0.02 if dimension == 2 else 0.05  # in space the ratio has no sign
    in_plane = closing(Ply(mesh, fabric, formulation), 0, least).reshape(-1, 2)
    x = np.pad(in_plane, ((0, 0), (0, dimension - 2)))
    x[:, 2:] = 1e-3 * np.sin(np.arange(len(x)))[:, None]
    u, (term,) = x.ravel(), (x for x in ply.terms if x.name == "corners")
    corners, elements = np.nonzero(ply.corners.area_ratio(u) < RESISTING)
    energy, residual, tangent = (
        asm(form, at_corners(ply.basis, elements, corners), u=u)
        for form in corner_resistance(0.5)
    )
    assert energy > 0
    assert term.energy(u, 1.0) == pytest.approx(energy, rel=1e-12)
    f, K = term.residual(u, 1.0), term.tangent(u, 1.0).toarray()
    np.testing.assert_allclose(f, residual, atol=1e-10 * np.abs(residual).max())
    tangent = tangent.toarray()
    np.testing.assert_allclose(K, tangent, atol=1e-10 * np.abs(tangent).max())


def test_the_area_ratio_at_corners_is_the_determinant_of_the_gradient():
    for formulation in FORMULATIONS:
        ply = Ply(distorted_for(formulation, 4), Fabric(1.0), formulation)
        u = random_u(ply, 4, 0.1)
        nodes = ply.basis.elem.elem.doflocs.T
        np.testing.assert_allclose(
            ply.corners.area_ratio(u).T, ply.area_ratio(u, nodes), rtol=1e-12
        )


@pytest.mark.parametrize("corner", [0.9, 1.0])
def test_a_corner_reflex_or_flat_at_rest_is_ignored(corner):
    """Its det F is negative where the element becomes convex."""
    mesh = one_quad([[0, 2, corner, 0], [0, 0, corner, 2]])
    ply = Ply(mesh, Fabric(1.0), Full())
    assert np.isinf(ply.corners.area_ratio(ply.basis.zeros())).sum() == 1
    assert ply.energies(random_u(ply, 1, 0.3))["corners"] >= 0


def test_both_senses_of_rotation_are_treated_alike():
    mesh = distorted(3)
    for t in (mesh.t, mesh.t[::-1].copy()):
        ply = Ply(MeshQuad(mesh.p, t), Fabric(1.0), Full())
        assert ply.corners.area_ratio(ply.basis.zeros()) == pytest.approx(1.0)


def ends_unfolded(ply, conditions, steps):
    result = LoadStepper(ply, conditions, steps).run()
    verdict = result.states[-1].verdict
    assert result.converged
    assert verdict.stable
    nodes = ply.basis.elem.elem.doflocs.T
    smallest = ply.area_ratio(result.u, nodes).min()
    assert smallest > 0
    assert verdict.min_det_F == pytest.approx(smallest)


@pytest.mark.parametrize(
    "seed", [3, *(pytest.param(s, marks=pytest.mark.slow) for s in (0, 7, 21))]
)
def test_strips_with_little_stabilisation_end_unfolded(seed):
    """Without resistance these end with a corner at det F < 0, or not at all."""
    scene = strip(size=(6, 9), seed=seed)
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(1.0))
    ends_unfolded(ply, scene.conditions, 3)


def test_corners_are_as_stiff_as_shear_or_a_small_share_of_the_fibres():
    for fabric, stiffness in (
        (Fabric((1e5, 3e5), 0.5), 2.0),
        (Fabric(1e4, 0.5), 0.5),
        (Fabric(1e4), 0.1),
    ):
        ply = Ply(one_quad([[0, 2, 2, 0], [0, 0, 2, 2]]), fabric, Full())
        u = ply.basis.zeros()
        u[ply.basis.nodal_dofs[:, 2]] = -0.99
        b, *_ = resistance(ply.corners.area_ratio(u))
        assert b.sum() > 0
        expected = stiffness * b.sum() * 4.0 / 4
        assert ply.energies(u)["corners"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "seed"), [(10.0, 3), (0.1, 0)])
def test_the_stiffness_of_corners_has_little_effect(scale, seed, monkeypatch):
    monkeypatch.setattr(
        builtin_terms, "_SHARE_OF_FIBRES", scale * builtin_terms._SHARE_OF_FIBRES
    )
    scene = strip(size=(6, 9), seed=seed)
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(1.0))
    ends_unfolded(ply, scene.conditions, 3)


@pytest.mark.parametrize("seed", [0, pytest.param(16, marks=pytest.mark.slow)])
def test_macro_elements_sheared_by_60_degrees_end_unfolded(seed):
    angle = np.radians(60)
    mesh = split(bias_extension("delaunay", (4, 8), seed=seed, shear_angle=angle).mesh)
    scene = bias_extension(mesh, shear_angle=angle)
    ply = Ply(mesh, Fabric(1e4, 0.1, scene.warp, scene.weft), Macro())
    ends_unfolded(ply, scene.conditions, 2)
