"""PETSc on several processes, and with an iterative method."""

import pytest

from studies.speed.processes import difference, missing, run

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"needs {missing()}")

ELEMENTS = 150


@pytest.fixture(scope="module")
def expected():
    """The results of SuperLU."""
    return run("superlu", ELEMENTS)[0]


def test_two_processes_agree_with_superlu(expected):
    ranks = run("petsc", ELEMENTS, 2)
    assert len(ranks) == 2
    assert max(difference(rank, expected) for rank in ranks) < 1e-8


def test_multigrid_agrees_with_superlu(expected):
    (found,) = run("petsc", ELEMENTS, options="-skfem_textile_pc_type gamg")
    assert difference(found, expected) < 1e-8
