import numpy as np
import pytest

from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply, Quadratic
from skfem_textile.scenes import bias_extension, strip
from studies.common.rivals import linear, newton
from studies.common.rivals.codes import RIVALS, Dolfinx, DolfinxError, FElupe, Plain
from studies.common.rivals.linear import SolverOfThisLibrary, solver_of
from studies.common.rivals.newton import NotConvergedError
from studies.common.rivals.rival import (
    QUAD4,
    QUAD4_CENTRE,
    QUAD9,
    TRIANGLE6,
    Task,
)

KINDS = {"quads": "irregular", "triangles": "delaunay"}
FORMULATIONS = {
    QUAD4: lambda C: Full(),
    QUAD4_CENTRE: OnePoint,
    TRIANGLE6: lambda C: Quadratic(),
}
SAME_AS_OURS = [rival for rival in RIVALS if rival.shape in FORMULATIONS]


def name(rival):
    return f"{rival.code}, {rival.shape.name}, {rival.solver}"


def task_of(shape, make=bias_extension, E=1e3, G=0.5, size=(3, 6)):
    scene = make(KINDS[shape.mesh], size, 0.2, 1)
    return Task(scene, shape.element, shape.rule, E, G)


def ply_of(task, shape):
    scene = task.scene
    fabric = Fabric(task.E, task.G, scene.warp, scene.weft)
    return Ply(scene.mesh, fabric, FORMULATIONS[shape](8 * task.G))


def available(rival):
    if missing := rival.missing():
        pytest.skip(f"not installed: {missing}")
    return rival


@pytest.mark.parametrize("rival", SAME_AS_OURS, ids=name)
def test_a_rival_and_this_library_have_the_same_final_state(rival):
    task = task_of(rival.shape)
    ply = ply_of(task, rival.shape)
    result = LoadStepper(ply, task.scene.conditions, 5).run()
    run = available(rival).run(task, 5, repeats=2)
    np.testing.assert_allclose(run.u, result.u, rtol=0, atol=1e-6)
    reaction = task.scene.reaction(result.states[-1])
    np.testing.assert_allclose(task.reaction(run.f), reaction, rtol=1e-6, atol=1e-6)
    assert run.linear_solves >= 5
    assert len(run.seconds) == 2


@pytest.mark.parametrize(
    "rival", [r for r in SAME_AS_OURS if not isinstance(r, Dolfinx)], ids=name
)
@pytest.mark.parametrize("G", [0.0, 0.5])
def test_forces_and_tangent_agree_with_this_library(rival, G):
    task = task_of(rival.shape, strip, G=G, size=(3, 4))
    system = available(rival).system(task)
    scene, C = task.scene, 8 * G or 1e-4 * task.E
    fabric = Fabric(task.E, G, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, FORMULATIONS[rival.shape](C))
    u = 0.1 * np.random.default_rng(1).standard_normal(ply.basis.N)
    f, K = system.forces(u), system.tangent(u)
    np.testing.assert_allclose(f, ply.residual(u), atol=1e-9 * np.abs(f).max())
    expected = ply.tangent(u)
    assert abs(K - expected).max() < 1e-9 * abs(expected).max()


def test_biquadratic_quadrilaterals_agree_with_felupe():
    task = task_of(QUAD9, strip, size=(2, 3))
    felupe = available(FElupe(QUAD9)).run(task, 10, repeats=0)
    plain = Plain(QUAD9).run(task, 10, repeats=0)
    np.testing.assert_allclose(plain.u, felupe.u, rtol=0, atol=1e-6)
    assert len(task.nodes.T) == 5 * 7


@pytest.mark.parametrize("rival", RIVALS, ids=name)
def test_an_iteration_is_timed_in_two_parts(rival):
    task = task_of(rival.shape)
    for seconds in available(rival).iterations(task, np.zeros(task.nodes.size), 2):
        assert len(seconds) == 2
        assert min(seconds) > 0


def system_of(task, u):
    """The tangent between free unknowns at a displacement, and a right-hand side."""
    free = np.setdiff1d(np.arange(task.nodes.size), task.fixed)
    K = Plain(QUAD4).system(task).tangent(u)[free][:, free]
    return K, np.random.default_rng(2).standard_normal(len(free))


@pytest.mark.parametrize("across", [4, 20])  # superlu for few unknowns
@pytest.mark.parametrize("name", ["required", "fastest", "pypardiso"])
def test_linear_solvers_solve_tangents_that_are_definite_or_not(name, across):
    if name == "pypardiso":
        pytest.importorskip("pypardiso")
    task = task_of(QUAD4, size=(across, 2 * across))
    solve = solver_of(task, name)
    rest = np.zeros(task.nodes.size)
    pushed = -0.2 * task.nodes.T.ravel()
    for u, definite in ((rest, True), (pushed, False), (rest, True)):
        A, b = system_of(task, u)
        if across == 4:
            assert (np.linalg.eigvalsh(A.toarray()).min() > 0) == definite
        np.testing.assert_allclose(A @ solve(A, b), b, atol=1e-8)


def test_a_pattern_is_analysed_once(monkeypatch):
    analysed = []

    class Counted(linear.ChosenSolver):
        def __init__(self, name, lower, unknowns):
            analysed.append(name)
            super().__init__(name, lower, unknowns)

    monkeypatch.setattr(linear, "ChosenSolver", Counted)
    task = task_of(QUAD4)
    solve = SolverOfThisLibrary(task)
    A, b = system_of(task, np.zeros(task.nodes.size))
    first = solve(A, b)
    np.testing.assert_allclose(solve(2 * A, b), first / 2)
    assert analysed == ["auto"]
    other = A.copy()
    other[1, 0] = 0.0
    other.eliminate_zeros()
    solve(other, b)
    assert analysed == ["auto"] * 2


def test_too_long_a_step_is_an_error_and_not_a_warning(monkeypatch):
    """Five plain Newton iterations solve this strip not in one step, but in ten."""
    monkeypatch.setattr(newton, "_MOST", 5)
    task = task_of(QUAD4, strip, 1e3, 0.0, (2, 3))
    with pytest.raises(NotConvergedError, match="no convergence"):
        Plain(QUAD4).run(task, 1, repeats=0)
    Plain(QUAD4).run(task, 10, repeats=0)


def test_a_singular_tangent_is_an_error_and_not_a_warning():
    task = task_of(QUAD4, strip, 1e4, 0.0, (1, 1))
    system = Plain(QUAD4).system(task)
    system.tangent = lambda u: 0.0 * type(system).tangent(system, u)
    with pytest.raises(NotConvergedError, match="not finite"):
        newton.timed(lambda: system, task.values(1), repeats=0)


def test_errors_in_the_process_of_dolfinx_are_one_line():
    rival = available(Dolfinx(QUAD9))
    with pytest.raises(DolfinxError, match=r"^DOLFINx: KeyError: 9$"):
        rival.run(task_of(QUAD9, size=(2, 4)), 1, repeats=0)


def test_the_clock_counts_every_repeat_but_not_the_first_run():
    begun = []

    class Spring:
        fixed, stiffness, size = np.array([0]), 1.0, 2

        def __init__(self):
            begun.append(self)

        def forces(self, u):
            return np.array([u[0] - u[1], u[1] - u[0]])

        def tangent(self, u):
            return None

        def increment(self, K, f, du):
            return np.array([du[0], du[0]])

    run = newton.timed(Spring, np.array([[1.0], [2.0]]), repeats=3)
    assert len(begun) == 4
    assert len(run.seconds) == 3
    assert run.u.tolist() == [2.0, 2.0]
    assert run.linear_solves == 2
