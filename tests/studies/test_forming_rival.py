import numpy as np
import pytest

from studies.common.rivals import forming
from studies.common.rivals.codes import DolfinxError, interpreter
from studies.common.rivals.forming import Forming
from studies.forming_rival.ours import ours, ply_of

# Half of the depth on a coarse mesh, where each code finds the same branch.
CASE, TRAVELS = Forming(parts=6), np.array([20.0, 40.0])


@pytest.fixture(scope="module")
def of_this_library():
    return ours(CASE, TRAVELS)


def of_dolfinx(*arguments):
    if interpreter() is None:
        pytest.skip("not installed: dolfinx")
    return forming.dolfinx(*arguments)


@pytest.mark.parametrize("method", ["descent", "snes"])
def test_dolfinx_and_this_library_have_the_same_force_curve(method, of_this_library):
    course = of_dolfinx(CASE, TRAVELS, method)
    assert course.failure == of_this_library.failure == ""
    np.testing.assert_allclose(course.travels, TRAVELS)
    np.testing.assert_allclose(course.forces, of_this_library.forces, rtol=1e-6)
    np.testing.assert_allclose(course.draw_in, of_this_library.draw_in, rtol=1e-6)
    for counted in (course.iterations, course.seconds):
        assert (np.diff([0, *counted]) > 0).all()


def test_the_punch_is_balanced_by_die_holder_and_spring(of_this_library):
    """The only other forces across the ply."""
    course = ours(CASE, TRAVELS[:1])
    np.testing.assert_allclose(course.forces, of_this_library.forces[:1], rtol=1e-9)


def test_a_course_ends_where_no_step_finds_a_state(monkeypatch):
    """A method that does not exist fails in one line; a step too long is halved."""
    with pytest.raises(DolfinxError, match=r"^DOLFINx: KeyError: 'bisection'$"):
        of_dolfinx(CASE, TRAVELS, "bisection")


def test_the_derivatives_of_the_die_are_those_of_its_level():
    die = ply_of(CASE).further_terms[3]._tool.surface(0.0)
    x = np.random.default_rng(0).uniform(-3, 3, (3, 200)) + [[85.0], [0.0], [5.0]]
    for i, h in enumerate(1e-5 * np.eye(3)):
        slope = (die.level(x + h[:, None]) - die.level(x - h[:, None])) / 2e-5
        np.testing.assert_allclose(die.gradient(x)[i], slope, atol=1e-6)
