import numpy as np
import pytest
from skfem.helpers import ddot

from skfem_textile import Ply
from skfem_textile.fabric import kinematics as kin
from studies.inf_sup import study
from studies.inf_sup.constraints import spectrum
from studies.inf_sup.motions import KINKED, SMOOTH, distances, stiffness, unstretched
from studies.inf_sup.study import (
    IRREGULAR,
    LAYOUTS,
    MACRO,
    MACRO_TRIANGLES,
    METHODS,
    ONE_POINT,
    QUADRATIC,
    QUADRATIC_MEAN,
    SHEARED,
    STUDY,
    TWO_BY_TWO,
    Case,
    Layout,
    in_words,
)
from tests.helpers import derivative, random_u

ALONG, ACROSS_MESH = Layout(0), Layout(30)

#: A motion that quadratic triangles represent exactly.
PARABOLA = (((lambda s: s**2), (lambda s: 2 * s)),)

each_method = pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
each_layout = pytest.mark.parametrize("layout", LAYOUTS, ids=str)


def found(method, layout, across, shear=0):
    return spectrum(Case(method, layout, across, shear).constraints(), 2)


def homogeneous(basis, gradient):
    """A motion of constant gradient."""
    u, x = basis.zeros(), basis.doflocs
    u[::2], u[1::2] = (gradient @ x)[0, ::2], (gradient @ x)[1, 1::2]
    return u


@each_method
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


@each_method
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


def test_2x2_points_are_stable_along_fibres_and_lock_across():
    along = [found(TWO_BY_TWO, ALONG, n) for n in (4, 8)]
    assert all(s.inf_sup > 0.9 for s in along)
    assert [s.kernel.shape[1] for s in along] == [2 * 5, 2 * 9]
    for layout in (Layout(15), ACROSS_MESH, Layout(45)):
        coarse, fine = (found(TWO_BY_TWO, layout, n) for n in (4, 8))
        assert 0.85 < np.log2(coarse.inf_sup / fine.inf_sup) < 1.15
        assert coarse.kernel.shape[1] == fine.kernel.shape[1] == 4


def test_quadratic_triangles_lock_twice_as_fast_and_represent_only_polynomials():
    coarse, fine = (found(QUADRATIC, ACROSS_MESH, n) for n in (4, 8))
    assert 1.6 < np.log2(coarse.inf_sup / fine.inf_sup) < 2.2
    assert coarse.kernel.shape[1] == fine.kernel.shape[1] == 6


@each_layout
@pytest.mark.parametrize("method", [MACRO, MACRO_TRIANGLES, QUADRATIC_MEAN])
def test_means_keep_the_inf_sup_constant(method, layout):
    for shear in (0, SHEARED) if layout.regular else (0,):
        assert found(method, layout, 8, shear).inf_sup > 0.8


@pytest.mark.parametrize("method", [TWO_BY_TWO, MACRO, QUADRATIC_MEAN])
def test_no_method_keeps_the_constant_in_the_l2_norm(method):
    """The exception of 2×2 points along the fibres fails as well."""
    coarse, fine = (found(method, ALONG, n).in_l2 for n in (4, 8))
    assert 0.8 < np.log2(coarse / fine) < 1.3


def test_one_point_does_not_keep_the_constant_though_it_does_not_lock():
    coarse, fine = (found(ONE_POINT, ALONG, n) for n in (4, 8))
    assert 0.8 < np.log2(coarse.inf_sup / fine.inf_sup) < 1.1
    constraints = Case(ONE_POINT, ALONG, 8).constraints()
    from_mesh, from_kernel = distances(constraints, fine.kernel, SMOOTH)
    assert from_kernel == pytest.approx(from_mesh, rel=1e-3)


@each_method
@pytest.mark.parametrize("layout", [ACROSS_MESH, IRREGULAR], ids=str)
def test_the_inf_sup_constant_bounds_the_distance_from_the_kernel(method, layout):
    constraints = Case(method, layout, 8).constraints()
    of = spectrum(constraints, 2)
    for profiles in (SMOOTH, KINKED):
        from_mesh, from_kernel = distances(constraints, of.kernel, profiles)
        assert from_mesh <= from_kernel * (1 + 1e-9)
        assert from_kernel <= (1 + 1 / of.inf_sup) * from_mesh


@each_method
def test_shear_changes_the_norm_and_not_the_kernel(method):
    flat, sheared = (found(method, ACROSS_MESH, 4, shear) for shear in (0, SHEARED))
    assert flat.kernel.shape == sheared.kernel.shape
    sine = np.sin(np.radians(SHEARED))
    most = np.sqrt((1 + sine) / (1 - sine))
    assert 1 / most < sheared.inf_sup / flat.inf_sup < most
    assert flat.inf_sup != pytest.approx(sheared.inf_sup, rel=1e-6)


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


def test_plies_that_lock_are_many_times_too_stiff():
    locked, free = (
        stiffness(Case(m, ACROSS_MESH, 8).constraints(), KINKED)
        for m in (TWO_BY_TWO, MACRO)
    )
    assert locked > 20
    assert 1 < free < 1.2


def test_a_study_without_a_clear_smallest_value_fails():
    (row,) = STUDY.examine(Case(MACRO, ALONG, 4))
    row["case"] = "it"
    assert STUDY.complaint([row]) == ""
    doubtful = row | {"largest_zero": 0.5 * row["inf_sup"]}
    assert "1 case(s) without a clear smallest" in STUDY.complaint([row, doubtful])


def test_words_describe_the_finest_meshes_and_the_largest_differences():
    """On equal rows, except for the rows that a result describes."""
    rows = [
        {
            **{"method": c.method.name, "layout": str(c.layout), "shear": c.shear},
            **{"refined": c.refined, "across": c.across, "inf_sup": 0.8, "kernel": 4},
            **dict.fromkeys(("smooth_from_mesh", "kinked_from_mesh"), 0.2),
            **dict.fromkeys(("smooth_from_kernel", "kinked_from_kernel"), 0.2),
        }
        for c in study.all_cases()
    ]
    equal = {"means": "0.80", "means_fall": "0.0 %", "means_distance": "0 %"}
    assert in_words(rows) == equal
    study.of(rows, MACRO, Layout(15))[24] |= {"inf_sup": 0.72}
    study.of(rows, MACRO, IRREGULAR)[24] |= {"kinked_from_kernel": 0.25}
    study.of(rows, ONE_POINT, Layout(15))[24] |= {"inf_sup": 0.1}
    words = in_words(rows)
    assert words["means"] == "0.72 to 0.80"
    assert words["means_fall"] == "10.0 %"
    assert words["means_distance"] == "25 %"
