import numpy as np
import pytest

from skfem_textile.solve.search import equilibrium_near
from studies.common.rivals import course, forming
from studies.common.rivals.codes import DolfinxError
from studies.common.rivals.forming import Forming
from studies.forming_rival.of_felupe import OF_FELUPE, Membrane
from studies.forming_rival.ours import held, ours, ply_of
from studies.forming_rival.penalty import Die, PenaltyTerm
from studies.forming_rival.study import CODES, OURS, missing

# Half of the depth on a coarse mesh, where each code finds the same branch.
CASE, TRAVELS = Forming(parts=6), np.array([20.0, 40.0])


@pytest.fixture(scope="module")
def of_this_library():
    return ours(CASE, TRAVELS)


def code(name):
    if name in missing():
        pytest.skip(f"not installed: {name}")
    return CODES[name]


@pytest.mark.parametrize("name", [name for name in CODES if name != OURS])
def test_another_code_and_this_library_have_the_same_force_curve(name, of_this_library):
    found = code(name)(CASE, TRAVELS)
    assert found.failure == of_this_library.failure == ""
    np.testing.assert_allclose(found.travels, TRAVELS)
    np.testing.assert_allclose(found.forces, of_this_library.forces, rtol=1e-6)
    np.testing.assert_allclose(found.draw_in, of_this_library.draw_in, rtol=1e-6)
    for counted in (found.solves, found.seconds):
        assert (np.diff([0, *counted]) > 0).all()


def test_forces_and_tangent_of_felupe_are_those_of_this_library():
    code("FElupe")
    ply = ply_of(CASE)
    membrane = Membrane(CASE, ply)
    u = 0.1 * np.random.default_rng(0).standard_normal(ply.basis.N)
    membrane.field[0].values[:] = u.reshape(-1, 3)
    terms = [term for term in ply.terms if term.name in OF_FELUPE]
    f = sum(term.residual(u, 0.0, {}) for term in terms)
    K = sum(term.tangent(u, 0.0, {}) for term in terms)
    found = membrane.assemble.vector().toarray()[:, 0], membrane.assemble.matrix()
    np.testing.assert_allclose(found[0], f, atol=1e-12 * np.abs(f).max())
    assert abs(found[1] - K).max() < 1e-12 * abs(K).max()


def test_the_tools_and_the_spring_balance_across_the_ply():
    ply = ply_of(CASE)
    u = equilibrium_near(ply, held(), ply.basis.zeros(), 20.0).u
    tools = [term for term in ply.terms if isinstance(term, PenaltyTerm)]
    forces = [term.forces(u, 20.0)[2].sum() for term in tools]
    spring = next(term for term in ply.terms if term.name == "spring")
    pulled = ply.nodal(spring.residual(u, 20.0))[2].sum()
    assert len(tools) == 3
    assert forces[0] > 1
    assert abs(sum(forces) - pulled) < 1e-8 * forces[0]


def test_the_derivatives_of_the_die_are_those_of_its_level():
    die = Die(height=0.15, radius=90.0, fillet=10.0)
    # Points of the plane, the fillet and the wall.
    middle = np.array([[90.0], [0.0], [8.0]])
    x = middle + np.random.default_rng(0).uniform(-9, 9, (3, 300))
    for i, h in enumerate(1e-5 * np.eye(3)[:, :, None]):
        slope = (die.level(x + h) - die.level(x - h)) / 2e-5
        curved = (die.gradient(x + h) - die.gradient(x - h)) / 2e-5
        smooth = np.abs(curved - die.hessian(x)[i]).max(axis=0) < 1e-6
        np.testing.assert_allclose(die.gradient(x)[i], slope, atol=1e-6)
        assert smooth.mean() > 0.98  # but where the curvature jumps


def test_an_unknown_method_of_dolfinx_is_an_error_of_one_line():
    code("DOLFINx, SNES")
    with pytest.raises(DolfinxError, match=r"^DOLFINx: KeyError: 'bisection'$"):
        forming.dolfinx(CASE, TRAVELS, "bisection")


def test_a_step_that_fails_is_halved_and_a_course_may_end_early():
    """The search finds states in steps of at most 1 mm, and none above 5 mm."""
    nodes, at = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0]]), [0.0]

    def search(u, travel):
        if travel - at[0] > 1 or travel > 5:
            return None, 10
        at[0] = travel
        return u + 1, 1

    rows, failure = course.formed(nodes, search, lambda u, t: t, np.arange(4.0, 13, 4))
    found = course.Course.of(rows, failure)
    assert found.travels.tolist() == found.forces.tolist() == [4.0]
    np.testing.assert_allclose(found.draw_in, 4 * 2**0.5)
    assert found.solves.tolist() == [2 * 10 + 4]  # after 4 mm and 2 mm failed
    assert failure == "no state at a travel of 5.062 mm"
