from dataclasses import replace

import numpy as np
import pytest

from studies.common.rivals import course
from studies.common.rivals.forming import Forming
from studies.forming_rival.of_felupe import OF_FELUPE, Membrane, Penalty
from studies.forming_rival.ours import ours, ply_of
from studies.forming_rival.study import CODES, DESCENT, FELUPE, SNES, missing

# Half of the depth on a coarse mesh, where each code finds the same branch.
CASE, STEPS = Forming(parts=6, depth=40.0), 2


@pytest.fixture(scope="module")
def of_this_library():
    return ours(CASE, STEPS)


@pytest.fixture(scope="module")
def of_dolfinx():
    return code(DESCENT)(CASE, STEPS)


def code(name):
    if name in missing():
        pytest.skip(f"not installed: {name}")
    return CODES[name]


def differences(course, other):
    """Relative differences of forces and draw-in."""
    pairs = (course.forces, other.forces), (course.draw_in, other.draw_in)
    return np.concatenate([(a / b - 1).ravel() for a, b in pairs])


def test_this_library_forms_the_ply_in_the_requested_steps(of_this_library):
    assert of_this_library.failure == ""
    np.testing.assert_allclose(of_this_library.travels, [20.0, 40.0])
    for counted in (of_this_library.solves, of_this_library.seconds):
        assert (np.diff([0, *counted]) > 0).all()


@pytest.mark.parametrize("name", [name for name in CODES if name != DESCENT])
def test_other_codes_have_the_same_curve_with_the_same_penalty(name, of_dolfinx):
    found = code(name)(CASE, STEPS)
    assert found.failure == of_dolfinx.failure == ""
    np.testing.assert_allclose(found.travels, [20.0, 40.0])
    assert np.abs(differences(found, of_dolfinx)).max() < 1e-6
    for counted in (found.solves, found.seconds):
        assert (np.diff([0, *counted]) > 0).all()


def test_penalties_converge_to_the_constraint_of_this_library(of_this_library):
    """Depths, and all differences, are inversely proportional to the penalty."""
    stiff, stiffer = (
        differences(code(DESCENT)(replace(CASE, penalty=k), STEPS), of_this_library)
        for k in (50.0, 500.0)
    )
    assert 0 < np.abs(stiff).max() < 1e-4
    np.testing.assert_allclose(stiff / stiffer, 10.0, rtol=0.02)


def test_dolfinx_has_the_same_forces_with_friction():
    """A penalty of 5 N/mm³ is within 0.1 % of the constraint."""
    case = replace(CASE, depth=20.0, friction=0.2, penalty=5.0)
    found, with_constraint = code(SNES)(case, 2), ours(case, 2)
    without = ours(replace(case, friction=0.0), 2)
    assert found.failure == ""
    np.testing.assert_allclose(found.forces, with_constraint.forces, rtol=1e-3)
    assert with_constraint.forces[-1] > 1.02 * without.forces[-1]


def test_forces_and_tangent_of_felupe_are_those_of_this_library():
    code(FELUPE)
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


def test_forces_of_a_penalty_are_the_derivative_of_its_energy():
    ply, k = ply_of(CASE), 2.0
    tools = {term.name: term for term in ply.terms}
    rng = np.random.default_rng(0)
    free, X = np.ones((ply.basis.N // 3, 3)), ply.nodes
    for axis in range(2):  # nodes in planes of symmetry remain there
        free[X[axis] < 1e-9, axis] = 0.0
    u = rng.uniform(-1, 1, ply.basis.N) * free.ravel()
    u[2::3] += rng.uniform(-30, 40, ply.basis.N // 3)

    def energy(tool, u):
        depth = np.maximum(-tool.gaps(u, 1.0), 0.0)
        return 0.5 * k * tool.areas @ depth**2

    for name in ("punch", "die", "holder"):
        penalty, v = Penalty(tools[name], k), rng.standard_normal(u.size) * free.ravel()
        f, K = penalty.residual(u, 1.0), penalty.tangent(u, 1.0)
        a, b = (u + h * v for h in (1e-5, -1e-5))
        slope = (energy(tools[name], a) - energy(tools[name], b)) / 2e-5
        change = (penalty.residual(a, 1.0) - penalty.residual(b, 1.0)) / 2e-5
        assert np.abs(f).max() > 1
        assert slope == pytest.approx(f @ v, rel=1e-6)
        off = (K @ v - change) * free.ravel()
        assert np.abs(off).max() <= 1e-6 * np.abs(change).max()


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
