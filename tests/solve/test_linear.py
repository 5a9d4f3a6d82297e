"""Linear solvers, and the choice of one."""

import gc
import json
import os
import signal
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from threading import current_thread
from weakref import ref

import numpy as np
import pytest
from scipy.sparse import csc_matrix, csr_matrix, diags, identity, kron, tril
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, Ply
from skfem_textile.scenes import strip
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import (
    SOLVERS,
    ChosenSolver,
    SingularMatrixError,
    Unknowns,
    nested_dissection,
    solver_named,
)
from skfem_textile.solve.linear import solver as linear
from skfem_textile.solve.linear.petsc import PREFIX
from skfem_textile.solve.linear.scaling import Scaling, refuse_round_off
from skfem_textile.solve.linear.solver import SolverEntry
from skfem_textile.solve.linear.superlu import SuperLU
from skfem_textile.solve.problem import Problem, reduced
from tests.helpers.pulled import pulled


def natural(matrix):
    """Unknowns of a chain of nodes, in the order of the matrix."""
    n = matrix.shape[0]
    return Unknowns(np.zeros((2, n)), np.zeros((2, 0), int), 1, np.arange(n))


def lower_of(A):
    """Lower triangle with sorted indices."""
    lower = tril(A, format="csc")
    lower.sort_indices()
    return lower


def solver_for(name, A):
    """A solver by name for the pattern of a matrix."""
    lower = lower_of(A)
    return solver_named(name)(lower, natural(lower))


def factorised(name, A):
    """Factors of a matrix by a solver."""
    return solver_for(name, A).factorise(lower_of(A).data)


@pytest.fixture(params=SOLVERS)
def name(request):
    """Name of each installed solver, whose library is loaded."""
    pytest.importorskip(SOLVERS[request.param].package)
    factorised(request.param, identity(3, format="csr"))
    return request.param


def some_matrix(seed, shift):
    rng = np.random.default_rng(seed)
    band = [rng.standard_normal(40 - k) for k in (0, 1, 5)]
    lower = diags(band, [0, -1, -5])
    return csr_matrix(lower + lower.T + shift * diags([np.ones(40)], [0]))


@pytest.mark.parametrize(("cells", "shift"), [(33, -2.0), (40, -0.99)])
def test_indefinite_laplacians_are_solved_or_refused(name, cells, shift):
    """Their pivots within blocks of columns may be too small for any digit."""
    line = diags([-np.ones(cells - 1), 2 * np.ones(cells)], [-1, 0])
    line = line + diags([-np.ones(cells - 1)], [1])
    A = kron(line, identity(cells)) + kron(identity(cells), line)
    A = csr_matrix(A + shift * identity(cells**2))
    of_line = 2 - 2 * np.cos(np.pi * np.arange(1, cells + 1) / (cells + 1))
    eigenvalues = np.add.outer(of_line, of_line) + shift
    factors, b = factorised(name, A), np.ones(cells**2)
    try:
        x, negative = factors.solve(b), factors.negative_pivots
    except SingularMatrixError:
        assert shift == -2.0
    else:
        assert negative in (np.sum(eigenvalues < 0), None)
        assert np.abs(A @ x - b).max() < 1e-9


def test_threads_may_share_a_solver(name):
    shared = solver_for(name, some_matrix(4, 0.0))

    def off(seed):
        A, x = some_matrix(seed, 20.0 * (seed % 2)), np.arange(40.0)
        data = lower_of(A).data
        found = [shared.factorise(data).solve(A @ x) for _ in range(30)]
        return np.abs(np.array(found) - x).max()

    with ThreadPoolExecutor(3) as threads:
        assert max(threads.map(off, range(3, 9))) < 1e-8


@pytest.mark.parametrize("weak", [1e-7, 1e-10])
def test_indefinite_systems_with_a_small_diagonal_are_solved(name, weak):
    rng, n = np.random.default_rng(6), 40
    B = rng.standard_normal((n, n)) + 8 * np.eye(n)
    A = csr_matrix(np.block([[weak * np.eye(n), B], [B.T, weak * np.eye(n)]]))
    x = rng.standard_normal(2 * n)
    np.testing.assert_allclose(factorised(name, A).solve(A @ x), x, atol=1e-9)


@pytest.mark.parametrize("name", ["cholmod", "rslab"])
def test_superlu_replaces_a_wrong_solution_of_rslab(name, monkeypatch):
    pytest.importorskip(SOLVERS[name].package)
    rslab = pytest.importorskip("skfem_textile.solve.linear.rslab").Rslab
    solution = rslab.solution
    monkeypatch.setattr(rslab, "solution", lambda *given: 1.001 * solution(*given))
    A, x = some_matrix(3, 0.0), np.arange(40.0)
    factors = factorised(name, A)
    np.testing.assert_allclose(factors.solve(A @ x), x, atol=1e-9)
    assert factors.negative_pivots == np.sum(np.linalg.eigvalsh(A.toarray()) < 0)


def test_the_options_of_cvxopt_are_restored():
    cholmod = pytest.importorskip("cvxopt.cholmod")
    before = dict(cholmod.options)
    assert factorised("cholmod", some_matrix(3, 0.0)).negative_pivots
    assert cholmod.options == before


def springs(seed, decades, softened=0.0):
    """Stiffness of a net of springs without supports, over this many decades."""
    rng = np.random.default_rng(seed)
    p = np.array([(i, j) for i in range(12) for j in range(12)])
    i, j = np.nonzero(np.triu(np.abs(p[:, None] - p).sum(axis=2) <= 2, 1))
    k = 10 ** rng.uniform(-decades / 2, decades / 2, len(i))
    k *= rng.choice([1.0, -0.1], len(i), p=[1 - softened, softened])
    B = csr_matrix(
        (np.r_[k * 0 + 1, k * 0 - 1], (np.tile(np.arange(len(i)), 2), np.r_[i, j]))
    )
    return B.T @ diags(k) @ B


@pytest.mark.parametrize("decades", [0, 4, 6])
@pytest.mark.parametrize("seed", range(2))
def test_every_solver_recognises_a_net_without_supports(name, seed, decades):
    A = springs(seed, decades)
    with pytest.raises(SingularMatrixError, match="a mechanism is present"):
        _ = factorised(name, A).negative_pivots
    with pytest.raises(SingularMatrixError, match="a mechanism is present"):
        factorised(name, A).solve(np.ones(144))
    assert factorised(name, A + 1e-6 * diags(A.diagonal())).definite


def test_every_solver_recognises_the_mechanisms_of_shear(name):
    """Fibres without shear stiffness in 16 rows of quadrilaterals that slide."""
    ply = Ply(MeshQuad().refined(4), Fabric(1e3), Full())
    conditions = {
        "clamp": Condition(lambda X: X[1] == 0),
        "pull": Condition(lambda X: X[1] == 1, 0.01, (0, 1)),
    }
    constraints = Constraints(ply.basis, conditions)
    system = Problem(ply, constraints, solver_named(name)).system
    data = reduced(system, ply.stiffness(ply.basis.zeros())).upper.data
    with pytest.raises(SingularMatrixError):
        _ = system.solver.factorise(data).negative_pivots
    result = LoadStepper(ply, conditions, 1, solver=name, max_halvings=0).run()
    assert result.states[-1].verdict.negative_pivots == 0


def test_runs_with_the_same_free_unknowns_share_the_analysis():
    ply = Ply(MeshQuad().refined(1), Fabric(1.0, 1.0), Full())

    def stepper(pull, direction=(0, 1), solver="superlu"):
        clamp = Condition(lambda X: X[1] == 0)
        pulled = Condition(lambda X: X[1] == 1, pull, direction)
        return LoadStepper(ply, {"clamp": clamp, "pull": pulled}, 1, solver=solver)

    first = stepper(0.1)
    result, system = first.run(), first.problem.system
    again = stepper(0.2)
    assert again.problem.system is system
    assert again.run().linear_solves > 0
    np.testing.assert_array_equal(stepper(0.1).run().u, result.u)
    assert stepper(0.1, (1, 0)).problem.system is not system
    assert stepper(0.1, solver="rslab").problem.system is not system


@pytest.mark.parametrize("entry", [0, 1])  # on the diagonal, and off it
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_matrix_that_is_not_finite_is_refused(name, entry, value):
    A = some_matrix(5, 20.0).tolil()
    A[entry, 0] = value
    with pytest.raises(ValueError, match="matrix of a linear system is not finite"):
        factorised(name, csr_matrix(A))


def test_a_matrix_without_diagonal_entries_is_solved(name):
    lower = csc_matrix(([0.0, 3.0, 0.0], [0, 1, 1], [0, 2, 3]), (2, 2))
    factors = solver_named(name)(lower, natural(lower)).factorise(lower.data)
    assert factors.negative_pivots in (1, None)
    assert not factors.definite
    np.testing.assert_allclose(factors.solve(np.array([3.0, 6.0])), [2.0, 1.0])


@pytest.mark.parametrize("seed", range(3))
def test_scaling_is_exact_and_leaves_entries_of_a_similar_size(seed):
    lower = lower_of(springs(seed, 8) + identity(144))
    data, scale = Scaling(lower)(lower.data)
    scaled = csc_matrix((data, lower.indices, lower.indptr), lower.shape)
    np.testing.assert_array_equal(np.log2(scale) % 1, 0)
    unscaled = diags(1 / scale) @ scaled @ diags(1 / scale)
    np.testing.assert_array_equal(unscaled.toarray(), lower.toarray())
    assert np.abs(data).max() <= 2


def test_a_solver_is_freed_with_its_factors_without_garbage_collection(name):
    lower = lower_of(some_matrix(5, 20.0))
    solver = SOLVERS[name].build(lower, natural(lower))
    reference, factors = ref(solver), solver.factorise(lower.data)
    gc.disable()
    try:
        del solver, factors
        assert reference() is None
    finally:
        gc.enable()


@pytest.mark.parametrize("shift", [0.0, 20.0])
def test_factors_remain_valid_after_another_matrix_of_the_same_pattern(name, shift):
    A, x = some_matrix(5, shift), np.arange(40.0)
    solver, data = solver_for(name, A), lower_of(A).data
    first, second = solver.factorise(data), solver.factorise(2 * data)
    np.testing.assert_allclose(second.solve(A @ x), x / 2, atol=1e-9)
    np.testing.assert_allclose(first.solve(A @ x), x, atol=1e-9)


def test_inertia_belongs_to_the_latest_matrix(name):
    A = some_matrix(5, 20.0)
    solver, data = solver_for(name, A), lower_of(A).data
    for sign in (1, -1, 1):
        factors = solver.factorise(sign * data)
        assert factors.definite == (sign == 1)
        assert factors.negative_pivots == (0 if sign == 1 else 40)


def test_dissection_orders_every_node_and_ends_with_a_separator():
    mesh = strip(size=(16, 24)).mesh
    pairs = np.concatenate(
        [mesh.t[[i, j]] for i, j in ((0, 1), (1, 2), (0, 2), (1, 3))], 1
    )
    order = nested_dissection(mesh.p, pairs)
    np.testing.assert_array_equal(np.sort(order), np.arange(mesh.p.shape[1]))
    # The last 17 nodes cross the strip once; without them it falls apart.
    last = mesh.p[1, order[-17:]]
    assert np.ptp(last) < 60 / 24 * 2
    remaining = np.isin(pairs, order[-17:], invert=True).all(axis=0)
    below = mesh.p[1] < last.mean()
    assert not np.any(below[pairs[0, remaining]] != below[pairs[1, remaining]])


LARGE, LARGEST = 100, 200


class Fakes:
    """Solvers whose speed is set by a simulated clock."""

    def __init__(self, monkeypatch):
        self._monkeypatch, self.time, self.factorised = monkeypatch, 0.0, []
        monkeypatch.setattr(linear, "SOLVERS", {"superlu": SOLVERS["superlu"]})
        monkeypatch.setattr(linear, "_MEASURED", {})
        monkeypatch.setattr(linear, "MEASURED_FROM", LARGE)
        monkeypatch.setattr(linear, "_MOST_MEASURED", LARGEST)
        monkeypatch.setattr(linear, "perf_counter", lambda: self.time)

    @property
    def used(self):
        """Names of the solvers, in the order of factorisations."""
        return [name for name, _ in self.factorised]

    def add(self, name, *seconds, fails=None):
        """A solver that takes so long the first, second, ... time, or fails."""

        fakes = self

        class Fake(SuperLU):
            def factorise(self, data):
                if fails:
                    raise fails
                fakes.factorised.append((name, len(data)))
                times = [one for one, _ in fakes.factorised].count(name)
                fakes.time += seconds[min(times, len(seconds)) - 1]
                return super().factorise(data)

        class FakeEntry(SolverEntry):
            build = Fake

        first = {name: FakeEntry("", "scipy", 0, True)}
        others = {k: o for k, o in linear.SOLVERS.items() if k != "superlu"}
        offers = others | first | {"superlu": SOLVERS["superlu"]}
        self._monkeypatch.setattr(linear, "SOLVERS", offers)


@pytest.fixture
def fakes(monkeypatch):
    return Fakes(monkeypatch)


@pytest.fixture
def two(fakes):
    """A slow solver, the first known, and a fast one."""
    fakes.add("slow", 0.2)
    fakes.add("fast", 0.1)
    return fakes


def unfactorised(n, name="auto"):
    """Solver of a system of so many unknowns, and its matrix."""
    lower = identity(n, format="csc")
    return ChosenSolver(name, lower, natural(lower)), lower


def chosen(n=LARGE, name="auto", times=1):
    """The choice for a system of so many unknowns, factorised so often."""
    solver, lower = unfactorised(n, name)
    for _ in range(times):
        solver.factorise(lower.data)
    return solver.choice


@pytest.mark.parametrize(
    ("seconds", "name"),
    [
        ({"slow": [0.21], "fast": [0.16]}, "fast"),
        ({"fast": [0.16], "slow": [0.21]}, "fast"),
        ({"steady": [0.2], "warm": [9.0, 0.1]}, "warm"),
    ],
)
def test_the_faster_solver_is_chosen_after_a_warm_up(fakes, seconds, name):
    for solver, times in seconds.items():
        fakes.add(solver, *times)
    chosen_name, reason = chosen()
    assert chosen_name == name
    for solver, times in seconds.items():
        assert f"{solver} {times[-1]:.2f} s" in reason
    assert reason.endswith("measured on this machine")


def test_a_process_measures_once_and_logs_its_choice_once(two, caplog):
    with caplog.at_level("INFO", logger="skfem_textile"):
        first = chosen(times=3)
    assert caplog.messages == [f"linear solver fast: {first.reason}"]
    two.factorised.clear()
    assert chosen(2 * LARGE, times=3) == first
    assert two.used == ["fast"] * 3


def test_small_systems_requested_and_single_solvers_are_not_measured(fakes):
    fakes.add("slow", 0.2)
    assert chosen() == ("slow", "fastest known of the installed ones")
    fakes.add("fast", 0.1)
    reason = f"fastest known, not measured below {LARGE} unknowns"
    assert chosen(LARGE - 1) == ("slow", reason)
    assert chosen(name="slow") == ("slow", "requested")
    assert fakes.used == ["slow"] * 3


@pytest.mark.parametrize("fails", [ImportError(), MemoryError(), SingularMatrixError()])
def test_a_failing_solver_is_not_chosen(fakes, fails):
    fakes.add("broken", fails=fails)
    fakes.add("whole", 0.1)
    name, reason = chosen()
    assert name == "whole"
    assert "broken failed" in reason


def test_a_matrix_singular_for_all_solvers_leads_to_no_choice(fakes):
    fakes.add("one", fails=SingularMatrixError())
    fakes.add("other", fails=SingularMatrixError())
    with pytest.raises(SingularMatrixError):
        chosen()
    fakes.add("one", 0.2)
    fakes.add("other", 0.1)
    assert chosen().name == "other"


def test_an_indefinite_matrix_is_not_measured_and_the_next_one_is(two):
    solver, lower = unfactorised(LARGE)
    assert not solver.factorise(-lower.data).definite
    assert solver.choice == ("slow", "fastest known of the installed ones")
    factors, b = solver.factorise(lower.data), np.arange(LARGE)
    assert factors.definite
    np.testing.assert_array_equal(factors.solve(b), b)
    assert solver.choice.name == "fast"


def test_large_systems_are_measured_on_the_first_eliminated_part(two):
    chosen(LARGEST + 1)
    assert [size for _, size in two.factorised] == [LARGEST] * 4 + [LARGEST + 1]


def run(folder=None, resume=False):
    return LoadStepper(*pulled(0.05), 2, checkpoint=folder).run(resume)


def test_a_measurement_is_timed_but_not_counted_as_a_factorisation(two, monkeypatch):
    plain = run()
    monkeypatch.setattr(linear, "MEASURED_FROM", 10)
    two.factorised.clear()
    result = run()
    slow, fast = two.used.count("slow"), two.used.count("fast")
    summary = result.summary()
    assert summary["solver"] == "fast"
    assert summary["solver_reason"].startswith("fastest of slow 0.20 s, fast 0.10 s")
    assert summary["factorisations"] == plain.factorisations
    assert (slow, fast) == (2, 2 + plain.factorisations)
    assert summary["solve_time_s"] == pytest.approx(0.2 * slow + 0.1 * fast)
    json.dumps(summary)


def test_a_run_is_resumed_with_any_chosen_solver(two, monkeypatch, tmp_path):
    whole = run(folder=tmp_path)
    (tmp_path / "state_000002.npz").unlink()
    monkeypatch.setattr(linear, "MEASURED_FROM", 10)
    resumed = run(folder=tmp_path, resume=True)
    assert (whole.solver.name, resumed.solver.name) == ("slow", "fast")
    np.testing.assert_allclose(resumed.u, whole.u, atol=1e-12)


def test_auto_ignores_a_broken_package(monkeypatch, caplog):
    def broken(name, package=None):
        if name == "scipy" or package:
            return import_module(name, package)
        raise ImportError(f"no {name}")

    monkeypatch.setattr(linear, "import_module", broken)
    assert chosen(linear.MEASURED_FROM - 1).name == "superlu"
    assert "solver cholmod: ImportError: no cvxopt.cholmod" in caplog.text


def test_auto_selects_the_fastest_known_solver_that_repays_its_import():
    assert chosen(100).name == "rslab"
    installed = (k for k, o in SOLVERS.items() if find_spec(o.package))
    assert chosen(linear.MEASURED_FROM - 1).name == next(installed)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (ModuleNotFoundError(name="rslab"), "is not installed (pip install rslab)"),
        (ModuleNotFoundError("no cffi", name="cffi"), "ModuleNotFoundError: no cffi"),
        (ImportError("for another processor"), "ImportError: for another processor"),
        (ValueError("numpy.dtype size changed"), "ValueError: numpy.dtype size"),
    ],
)
def test_superlu_replaces_rslab_with_one_warning(monkeypatch, caplog, error, reason):
    def failing(name):
        raise error

    linear._warn_once.cache_clear()
    monkeypatch.setattr(linear, "import_module", failing)
    for _ in range(2):
        assert linear._first_importable(["rslab"]) == "superlu"
    (warning,) = caplog.messages
    assert reason in warning
    assert warning.endswith(": superlu takes over, which is slower")


def test_without_rslab_superlu_solves(monkeypatch):
    monkeypatch.setitem(sys.modules, "rslab", None)
    assert chosen(100).name == "superlu"
    result = run()
    assert result.converged
    assert result.solver.name == "superlu"


@pytest.mark.parametrize(
    ("text", "number"),
    [
        *[("3", 3), ("2,1", 2), ("1" + 23 * "0", 4)],
        *[("", None), ("0", None), ("-1", None), ("²", None)],
    ],
)
def test_rslab_takes_the_number_of_threads_from_the_environment(
    monkeypatch, text, number
):
    monkeypatch.setenv("OMP_NUM_THREADS", text)
    monkeypatch.setattr(os, "cpu_count", lambda: 4)
    lower = identity(2, format="csc")
    solver = SOLVERS["rslab"].build(lower, natural(lower))
    assert solver.n_threads == number


def test_only_threads_that_last_call_rslab(monkeypatch):
    """RSLAB crashes the process when it is called after a thread that called it."""
    rslab = pytest.importorskip("rslab")
    analyze, callers = rslab.analyze, []

    def recorded(*given, **options):
        callers.append(current_thread())
        return analyze(*given, **options)

    def solved():
        solver, lower = unfactorised(100, "rslab")
        factors = solver.factorise(lower.data)
        assert factors.solve(np.ones(100)) == pytest.approx(np.ones(100))

    monkeypatch.setattr(rslab, "analyze", recorded)
    for _ in range(2):
        with ThreadPoolExecutor(1) as executor:
            executor.submit(solved).result()
    assert callers[0] is callers[1]
    assert callers[0].is_alive()
    solved()
    assert callers[2] is current_thread()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="it forks")
def test_a_forked_process_uses_superlu():
    """RSLAB would wait forever for threads that do not survive the fork."""
    solver, lower = unfactorised(100, "rslab")
    factors = solver.factorise(lower.data)
    if not (child := os.fork()):
        signal.alarm(20)
        with pytest.raises(RuntimeError, match="cannot be used in a forked process"):
            factors.solve(np.ones(100))
        with pytest.raises(ValueError, match="cannot be used in a forked process"):
            chosen(100, "rslab")
        os._exit(chosen(100).name != "superlu")
    _, status = os.waitpid(child, 0)
    assert status == 0


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("seed", range(3))
def test_inertia_and_solution_do_not_depend_on_the_unit_of_force(name, seed, unit):
    """A net of random stiffnesses from 1e-5 to 1e5, softened below zero in places."""
    A = unit * (springs(seed, 10, softened=0.1) + 1e-3 * identity(144))
    d = np.abs(A.diagonal()) ** -0.5
    scaled = diags(d) @ A @ diags(d)
    factors, x = factorised(name, A), np.random.default_rng(seed).standard_normal(144)
    assert factors.negative_pivots == np.sum(np.linalg.eigvalsh(scaled.toarray()) < 0)
    b = A @ x
    assert np.abs(A @ factors.solve(b) - b).max() <= 1e-9 * np.abs(b).max()


@contextmanager
def petsc_option(name, value):
    """Set an option in PETSc's database."""
    petsc = pytest.importorskip("petsc4py.PETSc")
    petsc.Options()[PREFIX + name] = value
    try:
        yield
    finally:
        petsc.Options().delValue(PREFIX + name)


def test_options_apply_to_mumps():
    with petsc_option("mat_mumps_icntl_14", 200):
        lower = identity(4, format="csc")
        solver = solver_for("petsc", lower)
        assert solver.factorise(lower.data).definite
    assert solver._analysed.ksp.getPC().getFactorMatrix().getMumpsIcntl(14) == 200


def test_an_iterative_method_leads_to_the_same_state():
    with petsc_option("pc_type", "gamg"):
        stepper = LoadStepper(*pulled(0.3), 1, solver="petsc")
        u = stepper.run().u
    assert stepper.problem.system.solver._analysed.iterative
    np.testing.assert_allclose(u, LoadStepper(*pulled(0.3), 1).run().u, atol=1e-9)


def test_pivots_of_rounding_are_refused():
    refuse_round_off(np.array([1.0, 3e-12]))
    with pytest.raises(SingularMatrixError):
        refuse_round_off(np.array([1.0, 3e-13]))
