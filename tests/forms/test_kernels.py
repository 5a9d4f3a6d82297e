"""Kernels agree with the forms that they replace."""

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from skfem import CellBasis, ElementVector, MeshQuad2, asm
from skfem.element import ElementQuad2

from skfem_textile import (
    Fabric,
    FormTerm,
    Full,
    HourglassBasis,
    Macro,
    MeanBasis,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
    hourglass,
    mean_tension,
    tension,
)
from skfem_textile.forms.in_plane import RESISTING
from skfem_textile.forms.kernels.elements import QuadPoints, element_groups
from skfem_textile.forms.kernels.kernel import positive_part
from skfem_textile.mesh import bases as elements
from skfem_textile.mesh.pattern import Pattern, full_matrices
from skfem_textile.mesh.splitting import split_cells
from tests.helpers import (
    TRIANGLE_AND_QUAD,
    Coupled,
    defined,
    derivative,
    distorted,
    distorted_for,
    form_parameters,
    random_u,
    values_at_rest,
)
from tests.helpers.plies import CURVED

FABRICS = {
    "even": Fabric((1e4, 3.0), Sin2(0.7), warp=(2, 1), weft=(-1, 3)),
    "curved": Fabric(1e3, 0.5, **CURVED),
    "one family": Fabric((0.0, 50.0), 0.3),
    "coupled": Fabric(Coupled(1e4, 3e3), 0.5, warp=(2, 1), weft=(-1, 3)),
}
FORMULATIONS = Full(), OnePoint(2.0), OnePoint(), Macro(), Quadratic(), Quadratic(20.0)
DEAR = pytest.mark.dear("every kernel against its forms as scikit-fem evaluates them")
every_fabric = pytest.mark.parametrize(
    "fabric",
    [pytest.param(x, marks=[DEAR] * (name == "even")) for name, x in FABRICS.items()],
    ids=FABRICS,
)


def assert_same(fast, slow):
    if isinstance(slow, csr_matrix):
        fast, slow = fast.toarray(), slow.toarray()
    np.testing.assert_allclose(fast, slow, rtol=0, atol=1e-12 * np.abs(slow).max())


def plies(fabric):
    """In all formulations, and for fabrics besides the even one in some."""
    every = FORMULATIONS if fabric is FABRICS["even"] else FORMULATIONS[1::2]
    for dimension, formulations in ((2, every), (3, every[3::2])):
        for formulation in formulations:
            mesh = distorted_for(formulation, 1)
            yield Ply(mesh, fabric, formulation, dimension=dimension)
        both = split_cells(*TRIANGLE_AND_QUAD)
        yield Ply(both, fabric, Macro(), dimension=dimension)


def form_terms(ply):
    """The terms defined by forms; no corner resists here."""
    assert ply.corners.area_ratio(random_u(ply, 4)).min() >= RESISTING
    return [term for term in ply.terms if isinstance(term, FormTerm)]


@every_fabric
def test_kernels_and_the_ply_equal_the_forms(fabric):
    """The forms one by one, and their sum; tangents also for any given tension."""
    for ply in plies(fabric):
        u = random_u(ply, 4)
        given = np.resize(random_u(ply, 5), (2, *ply.basis.dx.shape))
        total, with_given = [0.0, 0.0, 0.0], 0.0
        for term in form_terms(ply):
            w, slow_forms = form_parameters(term), defined(term.forms)
            parts = [asm(form, term.basis, u=u, **w) for form in slow_forms]
            if term.kernel is not None:
                for form, slow in zip(term.forms, parts, strict=True):
                    assert_same(asm(form, term.basis, u=u, **w), slow)
            total = [x + part for x, part in zip(total, parts, strict=True)]
            if term.name == "tension":
                w = w | {"tension": ply.arranged(given)}
                parts[2] = asm(slow_forms.tangent, term.basis, u=u, **w)
            with_given = with_given + parts[2]
        assert ply.energy(u) == pytest.approx(total[0], rel=1e-12)
        assert_same(ply.residual(u), total[1])
        assert_same(ply.tangent(u), total[2])
        assert_same(ply.tangent(u, tension=given), with_given)


def test_the_kernel_out_of_plane_agrees_with_its_forms():
    for fabric, formulation in (
        *((FABRICS["even"], OnePoint(2.0)), (FABRICS["curved"], OnePoint())),
        (FABRICS["coupled"], Macro()),
    ):
        ply = Ply(distorted(1), fabric, formulation, dimension=3)
        u, term = random_u(ply, 3), ply.terms[-1]
        w, p = form_parameters(term), values_at_rest(term)
        energy, f, K = (asm(form, term.basis, u=u, **w) for form in term.forms)
        assert energy > 0
        assert term.energy(u, 1.0, p) == pytest.approx(energy, rel=1e-12)
        assert_same(term.residual(u, 1.0, p), f)
        pattern = Pattern(3, ply.nodes.shape[1], [term.nodes])
        assert_same(pattern.matrix(pattern.sum([term.matrices(u, 1.0, p)])), K)


def curved_mesh():
    mesh = MeshQuad2.from_mesh(distorted(2))
    x = np.sin(mesh.doflocs)
    return replace(mesh, doflocs=mesh.doflocs + 0.05 * x[::-1])


EVEN, DISTORTED, CURVED = FABRICS["even"], distorted(2), curved_mesh()
BILINEAR = ElementVector(elements.ElementQuad1())
FLUCTUATING = ElementVector(elements.ElementQuad1Fluctuation())
SOME = HourglassBasis(DISTORTED, elements=[1, 4])
E_D = {"E_d": np.linspace(1.0, 9.0, 12).reshape(2, -1, 1)}
UNUSUAL = {
    "subset": (hourglass(EVEN, 3.0), SOME, {}),
    "subset, by element": (hourglass(EVEN), SOME, {"C_s": np.array([[2.0], [5.0]])}),
    "by point": (
        *(hourglass(EVEN), HourglassBasis(DISTORTED)),
        {"C_s": np.arange(1.0, 25.0).reshape(6, 4)},
    ),
    "one number": (hourglass(EVEN), HourglassBasis(DISTORTED), {"C_s": 2.0}),
    "biquadratic": (
        *(
            tension(EVEN),
            CellBasis(DISTORTED, ElementVector(ElementQuad2()), intorder=4),
        ),
        {},
    ),
    "means": (mean_tension(EVEN), MeanBasis(DISTORTED, BILINEAR, intorder=3), E_D),
    "curved": (tension(EVEN), CellBasis(CURVED, BILINEAR, intorder=3), {}),
    "curved, corners": (hourglass(EVEN, 2.0), HourglassBasis(CURVED), {}),
    "curved, means": (mean_tension(EVEN), MeanBasis(CURVED, BILINEAR, intorder=3), E_D),
    "fluctuation": (
        *(hourglass(EVEN, 2.0), CellBasis(DISTORTED, FLUCTUATING, intorder=3)),
        {},
    ),
}


@pytest.mark.parametrize(("forms", "basis", "w"), UNUSUAL.values(), ids=UNUSUAL)
def test_unusual_bases_and_parameters_agree_with_the_forms(forms, basis, w):
    """Displacements may also be given as fields."""
    u = np.random.default_rng(4).standard_normal(basis.N) * 0.05
    for form, readable in zip(forms, defined(forms), strict=True):
        slow = asm(readable, basis, u=u, **w)
        for given in (u, basis.interpolate(u)):
            assert_same(asm(form, basis, u=given, **w), slow)


def test_terms_that_share_points_keep_separate_weights():
    """Tension at the 2×2 points has the weight J, the hourglass term A/4."""

    class Both(Full):
        def stabilising_terms(self, basis, fabric):
            return OnePoint(50.0).stabilising_terms(basis, fabric)

    ply = Ply(distorted(1), FABRICS["even"], Both())
    u = random_u(ply, 2)
    for term in form_terms(ply):
        expected = asm(term.forms.energy, term.basis, u=u)
        assert ply.energies(u)[term.name] == pytest.approx(expected, rel=1e-12)


def test_threads_may_evaluate_one_ply_at_several_states():
    ply = next(plies(FABRICS["even"]))
    states = [random_u(ply, seed) for seed in range(4)]
    alone = [ply.residual(u) for u in states]
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as executor:
            together = list(executor.map(ply.residual, 50 * states))
    finally:
        sys.setswitchinterval(before)
    for f, expected in zip(together, 50 * alone, strict=True):
        np.testing.assert_array_equal(f, expected)


def test_the_reference_data_of_a_basis_are_computed_once():
    ply = next(plies(FABRICS["even"]))
    groups = element_groups(ply.basis, ply.fabric)
    assert element_groups(ply.basis, ply.fabric) is groups


def test_the_pattern_keeps_entries_that_happen_to_be_zero():
    ply = Ply(distorted(1, jitter=0.0), Fabric(1e4), Full())
    at_rest, moved = (ply.tangent(ply.basis.zeros()), ply.tangent(random_u(ply, 8)))
    assert np.any(at_rest.data == 0)
    np.testing.assert_array_equal(at_rest.indices, moved.indices)
    np.testing.assert_array_equal(at_rest.indptr, moved.indptr)


def test_strains_of_a_state_are_computed_once_for_forces_and_tangent(monkeypatch):
    ply, calls = Ply(distorted(1), Fabric(1e4, 0.5), OnePoint(1.0)), []
    fibres = QuadPoints.fibres

    def counted(points, u, block):
        calls.append(len(points.dx))
        return fibres(points, u, block)

    monkeypatch.setattr(QuadPoints, "fibres", counted)
    u = random_u(ply, 9)
    ply.residual(u), ply.tangent(u), ply.energy(u)
    assert sorted(calls) == [1, 4]  # the centre once for three terms, and the corners
    u[0] += 1e-3
    ply.residual(u)
    assert len(calls) == 4


def test_blocks_of_a_pair_of_nodes_are_kept_below_the_diagonal():
    pattern = Pattern(2, 3, [np.array([[0], [2]])])
    blocks = np.arange(12.0).reshape(3, 2, 2, 1)
    blocks[0, 1, 0], blocks[2, 1, 0] = blocks[0, 0, 1], blocks[2, 0, 1]
    K = pattern.matrix(pattern.sum([blocks])).toarray()
    np.testing.assert_array_equal(K, K.T)
    np.testing.assert_array_equal(K[:2, 4:], blocks[1, ..., 0])
    assert not K[2:4].any()


def test_only_element_matrices_with_a_negative_eigenvalue_are_projected():
    """One of two elements has one, of −1; semi-definite matrices stay as they are."""
    random = np.random.default_rng(4)
    Q = np.linalg.qr(random.standard_normal((2, 6, 6)))[0]
    values = np.array([[0, 0, 0, 1, 2, 3.0], [-1, 0, 0, 1, 2, 3.0]])
    full = np.einsum("nij,nj,nkj->ikn", Q, values, Q)
    first, second = np.triu_indices(3)
    blocks = full.reshape(3, 2, 3, 2, 2)[first, :, second]
    definite = blocks[..., :1]
    assert positive_part(definite) is definite
    projected = full_matrices(positive_part(blocks)).transpose(2, 0, 1)
    found = np.linalg.eigvalsh(projected)
    np.testing.assert_allclose(found, np.maximum(values, 0.0), atol=1e-12)
    np.testing.assert_allclose(projected[0], full[..., 0], atol=1e-12)
    for share, is_kept in ((3e-13, True), (3e-12, False)):  # of the trace: round-off
        full = np.diag([-6 * share, 0, 0, 1, 2, 3]).reshape(3, 2, 3, 2)
        blocks = full[first, :, second][..., None]
        assert (positive_part(blocks) is blocks) == is_kept


@pytest.mark.parametrize("name", ["even", "coupled"])
@pytest.mark.parametrize("formulation", [Full(), Macro(), Quadratic(20.0)], ids=repr)
def test_predicted_tensions_are_the_first_order_of_those_that_act(formulation, name):
    """At finite increments, of mean stretches, the force T/λ is the linear one."""
    fabric = replace(FABRICS[name], warp=(1.0, 0.0), weft=(0.0, 1.0))
    ply = Ply(distorted_for(formulation, 1), fabric, formulation)
    u, du, n = random_u(ply, 1), random_u(ply, 2), ply.basis.zeros()
    means = not isinstance(formulation, Full)

    def predicted(x):
        T = ply.geometric_tension(u, x)
        gradient = np.asarray(ply._tension.basis.interpolate(u + x).grad)
        stretch = [np.hypot(1 + gradient[0, 0], gradient[1, 0])]
        stretch += [np.hypot(gradient[0, 1], 1 + gradient[1, 1])]
        return T / np.array(stretch) if means else T

    curvature = predicted(3 * du) - 3 * predicted(du) + 2 * predicted(n)
    assert np.abs(curvature).max() < 1e-9 * np.abs(predicted(du)).max()
    slopes = (
        derivative(lambda x: ply.geometric_tension(u, x), n, du),
        derivative(lambda x: ply.geometric_tension(u + x, n), n, du),
    )
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-5, abs=1e-4)
