from pathlib import Path

import numpy as np
import pytest
from skfem.helpers import ddot

from skfem_textile import Ply
from skfem_textile.fabric import kinematics as kin
from studies.inf_sup.constraints import spectrum
from studies.inf_sup.motions import SMOOTH, distances, stiffness, unstretched
from studies.inf_sup.study import (
    IRREGULAR,
    MACRO,
    METHODS,
    QUADRATIC,
    QUADRATIC_MEAN,
    SHEARED,
    STUDY,
    Case,
    Layout,
)
from tests.helpers import derivative, random_u

ALONG, ACROSS_MESH = Layout(0), Layout(30)
STORED = STUDY.stored(Path(__file__).parents[2] / "docs" / "inf_sup")

#: A motion that quadratic triangles represent exactly.
PARABOLA = (((lambda s: s**2), (lambda s: 2 * s)),)


def homogeneous(basis, gradient):
    """A motion of constant gradient."""
    u, x = basis.zeros(), basis.doflocs
    u[::2], u[1::2] = (gradient @ x)[0, ::2], (gradient @ x)[1, 1::2]
    return u


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_constraints_are_the_derivative_of_the_strain_in_the_law(method):
    constraints = Case(method, IRREGULAR, 4, SHEARED).constraints()
    ply = Ply(constraints.mesh, constraints.fabric, method.formulation)
    sheared, du = (homogeneous(ply.basis, constraints.F - np.eye(2)), random_u(ply, 1))
    strains = derivative(ply.law_strain, sheared, du)
    rows = (constraints.matrix @ du / constraints.areas).reshape(2, -1)
    if rows.shape[1] < strains[0].size:  # means, which all parts of an element share
        rows = rows[:, constraints._elements_of_law(), None]
        rows = np.broadcast_to(rows, strains.shape)
    else:
        rows = rows.reshape(strains.shape)
    np.testing.assert_allclose(rows, strains, rtol=0, atol=1e-7 * np.abs(strains).max())


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_the_same_tensions_do_the_same_work_on_a_finer_mesh(method):
    """On homogeneous strain; and the finer mesh has every motion of the coarse one."""
    constraints = Case(method, IRREGULAR, 4, SHEARED).constraints()
    fine, matrix = constraints.on_finer_mesh(1)
    gradient = np.array([[0.3, -0.2], [0.5, 0.7]])
    work = [
        B @ homogeneous(basis, gradient)
        for B, basis in ((constraints.matrix, constraints.basis), (matrix, fine))
    ]
    np.testing.assert_allclose(*work, atol=1e-12)
    assert np.abs(work[0]).max() > 1e-3
    assert 0.9 < spectrum(constraints, 1).values[-1] < 1 + 1e-4


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_stored_rows_of_coarse_meshes_are_reproducible(method):
    cases = [Case(method, layout, 4) for layout in (ALONG, ACROSS_MESH, IRREGULAR)]
    for case in (*cases, Case(method, ACROSS_MESH, 4, SHEARED)):
        (stored,) = (row for row in STORED if row["case"] == str(case))
        (row,) = case.rows()
        keys = [x for x in row if isinstance(row[x], float) and x != "largest_zero"]
        assert [row[x] for x in keys] == pytest.approx(
            [stored[x] for x in keys], rel=1e-4, abs=1e-7
        )
        assert row["kernel"] == stored["kernel"]


def test_the_inf_sup_constant_bounds_the_distance_from_the_kernel():
    for row in STORED:
        for kind in ("smooth", "kinked"):
            from_mesh, from_kernel = (
                row[f"{kind}_from_{space}"] for space in ("mesh", "kernel")
            )
            assert from_mesh <= from_kernel * (1 + 1e-9)
            assert from_kernel <= (1 + 1 / row["inf_sup"]) * from_mesh


@pytest.mark.parametrize("shear", [0, SHEARED])
def test_motions_stretch_no_fibre(shear):
    case = Case(MACRO, ACROSS_MESH, 4, shear)
    x, constraints = np.random.default_rng(1).random((2, 1, 20)), case.constraints()
    u = unstretched(SMOOTH[0], x, case.directions(), constraints.F)
    for A in case.directions().T:
        A, F = A[:, None, None], constraints.F[:, :, None, None]
        assert kin.fibre_strain(F, A) == pytest.approx(0, abs=1e-15)
        np.testing.assert_allclose(
            ddot(kin.fibre_strain_d(F, A), u.grad), 0, atol=1e-13
        )
    assert np.abs(u.grad).max() > 1
    step = 1e-6 * np.array([0.6, 0.8])[:, None, None]
    ahead, behind = (
        unstretched(SMOOTH[0], y, case.directions(), constraints.F).value
        for y in (x + step, x - step)
    )
    slope = np.einsum("iJ...,J...->i...", u.grad, 2 * step)
    np.testing.assert_allclose(ahead - behind, slope, atol=1e-12)


def test_a_motion_represented_by_the_mesh_has_its_exact_stiffness():
    for method in (QUADRATIC, QUADRATIC_MEAN):
        matrix = Case(method, ACROSS_MESH, 4).constraints()
        kernel = spectrum(matrix, 2).kernel
        assert distances(matrix, kernel, PARABOLA) == pytest.approx((0, 0), abs=1e-5)
    matrix = Case(QUADRATIC, ACROSS_MESH, 4).constraints()
    assert stiffness(matrix, PARABOLA) == pytest.approx(1, abs=1e-6)
    assert stiffness(matrix, SMOOTH) > 10


def test_a_study_without_a_clear_smallest_value_fails():
    (row,) = STUDY.examine(Case(MACRO, ALONG, 4))
    row["case"] = "it"
    assert STUDY.complaint([row]) == ""
    doubtful = row | {"largest_zero": 0.5 * row["inf_sup"]}
    assert "1 case(s) without a clear smallest" in STUDY.complaint([row, doubtful])
