"""PETSc on several processes, and with an iterative method."""

import numpy as np
import pytest
from scipy.sparse import identity

from skfem_textile.solve.linear import Unknowns, solver_named
from skfem_textile.solve.linear.petsc import PREFIX
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


def test_options_apply_to_mumps():
    petsc, lower = pytest.importorskip("petsc4py.PETSc"), identity(4, format="csc")
    nodes = Unknowns(np.zeros((2, 4)), np.zeros((2, 0), int), 1, np.arange(4))
    option = f"{PREFIX}mat_mumps_icntl_14"
    petsc.Options()[option] = 200
    try:
        solver = solver_named("petsc")(lower, nodes)
        assert solver.factorise(lower.data).definite
    finally:
        petsc.Options().delValue(option)
    assert solver.ksp.getPC().getFactorMatrix().getMumpsIcntl(14) == 200
