import numpy as np
import pytest

from skfem_textile.scenes.two_element import systems
from skfem_textile.studies.systems import slips, table

BY_NAME = {system[:4]: system for system in systems()}
HALF_A_DIGIT = 0.5e-8


@pytest.mark.parametrize(("element", "first"), [("A", "4.1"), ("B", "7.1")])
def test_the_papers_equations_along_x_are_reproduced_to_every_digit(element, first):
    system = BY_NAME["unaligned", "2x2", element, "x"]
    assert system.factor == 1.0, first
    assert np.abs(system.difference).max() < HALF_A_DIGIT


def test_the_papers_equations_along_y_are_reproduced_but_for_a_factor():
    system = BY_NAME["unaligned", "2x2", "A", "y"]
    assert system.factor == 0.4
    assert np.abs(system.difference).max() < HALF_A_DIGIT


def test_unaligned_elements_lock():
    assert BY_NAME["unaligned", "2x2", "A", "x"].rank == 1
    np.testing.assert_allclose(BY_NAME["unaligned", "2x2", "A", "y"].solution, 0)
    below = BY_NAME["unaligned", "2x2", "B", "x"]
    assert below.rank == 2
    np.testing.assert_allclose(below.solution, 5 / 3)
    np.testing.assert_allclose(below.rows[:, :2] @ below.solution, below.rows[:, 2])


@pytest.mark.parametrize("mesh", ["aligned", "horizontally aligned"])
def test_elements_along_the_warp_shear_independently(mesh):
    for element in "AB":
        system = BY_NAME[mesh, "2x2", element, "x"]
        assert system.rank == 1
        np.testing.assert_allclose(system.rows[:, 2], 0, atol=1e-14)
        np.testing.assert_allclose(system.rows[:, 0], -system.rows[:, 1])
        assert BY_NAME[mesh, "2x2", element, "y"].rank == 2


@pytest.mark.parametrize("mesh", ["unaligned", "aligned", "horizontally aligned"])
def test_one_point_leaves_one_velocity_free(mesh):
    for element in "AB":
        for direction in "xy":
            assert BY_NAME[mesh, "one point", element, direction].rank == 1


def test_one_point_equations_are_the_papers():
    rows = [BY_NAME["unaligned", "one point", e, "x"].rows[0] for e in "AB"]
    np.testing.assert_allclose(rows, [[0.8, -1.2, 0.0], [-1.2, 0.8, -2 / 3]])
    (vertical,) = BY_NAME["unaligned", "one point", "A", "y"].rows
    assert vertical[0] == pytest.approx(vertical[1])  # v3 = -v4


def test_the_slips_are_slips():
    for slip in slips():
        assert slip.computed == pytest.approx(slip.expected, rel=1e-3, abs=1e-9), slip


def test_the_table_has_a_row_per_equation():
    lines = table().splitlines()
    equations = 3 * 2 * 2 * (4 + 1)
    assert len(lines) == 2 + equations + 1 + 2 + len(slips())
    assert len({line.count("|") for line in lines[: equations + 2]}) == 1
