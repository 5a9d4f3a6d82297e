"""Acceptance of equilibria, solution methods and their cost."""

from functools import cache
from types import SimpleNamespace
from weakref import WeakSet

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    Linear,
    LoadStepper,
    Macro,
    Newton,
    OnePoint,
    PlainNewton,
    Ply,
    Pretensioned,
    Quadratic,
    StepError,
    TensionOnly,
    Term,
    equilibrium_near,
    fitted,
)
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes import Case, bias_extension, strip
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve import newton, search
from skfem_textile.solve.direction import Definite
from skfem_textile.solve.linear import SOLVERS, superlu
from skfem_textile.solve.problem import Evaluation, Tangent
from skfem_textile.solve.search import EquilibriumSearch, Target
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.verdict import Trial
from tests.helpers import distorted
from tests.helpers.pulled import pulled
from tests.helpers.tools import problem_of


def test_linear_solves_include_abandoned_attempts():
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    vain = iter([PlainNewton(most=1)])

    class VainAtFirst(Newton):
        def solve(self, *arguments):
            return next(vain, super()).solve(*arguments)

    result = LoadStepper(ply, conditions, 2, method=VainAtFirst()).run()
    assert result.steps_cut == 1
    linear_solves = [state.linear_solves for state in result.states]
    assert linear_solves[1] == len(result.states[1].residuals) + 1
    assert sum(linear_solves) == result.linear_solves


@pytest.mark.parametrize("formulation", [Full(), Macro(), OnePoint(), Quadratic(80.0)])
def test_an_increment_hardly_stretches_fibres_that_are_slack_before(formulation):
    """All fibres are slack, as after the release of a pretension.

    The increment with their stiffness would stretch them by 4 to 10 %.
    """
    scene = strip(size=(2, 3))
    fabric = Fabric(Pretensioned(TensionOnly(Linear(1e5)), 100.0), 0.5)
    ply = Ply(scene.mesh, fabric, formulation)
    problem = problem_of(ply, scene.conditions).at(0.1)
    u = (-0.00109 * ply.nodes).T.ravel()
    u[problem.constraints.fixed] = 0.0
    assert ply.is_slack(u)
    first = Definite(problem).first(problem.evaluation(u, ply.parameters_at_rest, None))
    values = problem.constraints.fixed_values(0.1)
    after = u + Definite(problem).increment(first, values).du
    assert problem.is_fixed(after, values)
    assert np.abs(ply.law_strain(after)).max() < 0.01


def test_the_verdict_needs_one_factorisation_per_run():
    """The factorisation at every other state is reused by the next step."""
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=5).run()
    assert result.factorisations == result.linear_solves + 1


def test_only_the_tangent_of_the_last_state_is_kept_besides_a_new_one(monkeypatch):
    """Matrices and factors of more tangents would be most of the memory of a run."""
    known, numbers, initialise = WeakSet(), [], Tangent.__init__

    def counted(tangent, *arguments):
        numbers.append(len(known))  # while the new one is assembled and factorised
        initialise(tangent, *arguments)
        known.add(tangent)

    monkeypatch.setattr(Tangent, "__init__", counted)
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    LoadStepper(ply, conditions, steps=3).run()
    assert max(numbers) == 1


@pytest.mark.parametrize(
    ("G", "cause"),
    [
        (0.0, "a mechanism is present; try more supports"),
        (1e-9, "round-off, because the largest .* smallest; try softer fibres"),
    ],
)
def test_round_off_is_no_mechanism(G, cause):
    mesh = MeshQuad.init_tensor(np.linspace(0, 30, 5), np.linspace(0, 60, 9))
    ply = Ply(mesh.with_defaults(), Fabric(1e4, G), Full())
    ends = {"clamp": Condition("bottom"), "shear": Condition("top", (5.0, None))}
    with pytest.raises(StepError, match=f"singular tangent.*: {cause}"):
        LoadStepper(ply, ends, 1, max_halvings=0).run()


@pytest.mark.parametrize("fits", [False, True])
def test_stiffness_ratios_up_to_1e12_have_the_same_load_in_as_many_solves(fits):
    """They have an interval; beyond, round-off is named."""
    scene = bias_extension(size=(4, 10), warp=np.radians(50), weft=np.radians(130))
    loads, solves = {}, {}
    for ratio in (1e8, 1e10, 1e12):
        plain = Fabric(0.5 * ratio, 0.5, scene.warp, scene.weft)
        fit = fitted(scene.mesh, plain, scene.conditions)
        ply = Ply(fit.mesh, plain, fit.formulation) if fits else Ply(scene.mesh, plain)
        result = LoadStepper(ply, scene.conditions, 1).run()
        loads[ratio] = result.states[-1].reactions["top"][1]
        solves[ratio] = result.linear_solves
        assert result.error.load < 0.2
    assert list(loads.values()) == pytest.approx([loads[1e8]] * 3, rel=2e-3)
    assert max(solves.values()) <= min(solves.values()) + 3


def test_a_ply_with_every_node_prescribed_has_no_unknowns():
    mesh = MeshQuad()
    held = {"all": Condition(np.arange(4), lambda X, t: 0.1 * t * X)}
    for formulation in (Full(), OnePoint(1.0)):
        result = LoadStepper(Ply(mesh, Fabric(10.0, 1.0), formulation), held, 2).run()
        np.testing.assert_allclose(result.ply.nodal(result.u), 0.1 * mesh.p)
        assert result.states[-1].verdict.stable


@pytest.mark.parametrize(("seed", "direction"), [(1, None), (3, (0.5, 1.0))])
def test_a_mechanism_on_an_irregular_mesh_is_not_stable(seed, direction):
    """Round-off gives free motions a little stiffness, of either sign."""
    mesh = distorted(seed).with_defaults()
    held = {"hinge": Condition([0], 0.0 * mesh.p[:, :1])}
    if direction:
        held = {"slide": Condition("bottom", 0.0, direction)}
    for formulation in (Full(), OnePoint(1.0)):
        ply = Ply(mesh, Fabric(1e4, 1.0, (1.0, 0.3), (0.0, 1.0)), formulation)
        with pytest.raises(StepError, match="a mechanism is present"):
            LoadStepper(ply, held, steps=1, max_halvings=0).run()


@pytest.mark.parametrize("E", [1e2, 1e6, 1e10])
def test_the_tolerance_can_be_met_at_any_stiffness(E):
    """The reactions vanish with the residual on an aligned mesh."""
    scene = strip("aligned", size=(4, 6))
    ply = Ply(scene.mesh, Fabric(E), Full())
    result = LoadStepper(ply, scene.conditions, steps=5).run()
    assert result.states[-1].verdict.max_fibre_strain < 1e-9
    assert result.linear_solves < 40


def test_every_method_gives_the_same_equilibrium():
    scene = strip(size=(4, 6))
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(10.0))
    newton, plain = (
        LoadStepper(ply, scene.conditions, 5, method=method).run().u
        for method in ("newton", PlainNewton(30))
    )
    np.testing.assert_allclose(plain, newton, atol=1e-6)


def test_every_solve_and_factorisation_is_counted(monkeypatch):
    counts = {"factorisations": 0, "solves": 0}
    factorised = superlu._decomposed

    class Counted:
        def __init__(self, lu):
            self._lu = lu

        def __getattr__(self, name):
            return getattr(self._lu, name)

        def solve(self, b):
            counts["solves"] += 1
            return self._lu.solve(b)

    def counted(*arguments, **options):
        counts["factorisations"] += 1
        return Counted(factorised(*arguments, **options))

    monkeypatch.setattr(superlu, "_decomposed", counted)
    ply, conditions = pulled(-0.15)
    result = LoadStepper(ply, conditions, 1, max_halvings=1, solver="superlu").run()
    assert result.linear_solves == counts["solves"]
    assert result.factorisations == counts["factorisations"]
    assert counts["solves"] > sum(len(state.residuals) for state in result.states)


@cache
def pushed_by(solver):
    """A ply that is indefinite at intermediate states."""
    result = LoadStepper(*pulled(-0.15), 1, max_halvings=1, solver=solver).run()
    assert result.states[-1].verdict.negative_pivots == 0
    return result.u


@pytest.mark.parametrize("solver", ["cholmod", "pardiso"])
def test_every_solver_gives_the_same_final_state(solver):
    pytest.importorskip(SOLVERS[solver].package)
    np.testing.assert_allclose(pushed_by(solver), pushed_by("superlu"), atol=1e-9)


@pytest.mark.parametrize(
    ("n", "E", "size"),
    [
        (2, 1e4, 1.0),
        *(
            pytest.param(*given, marks=pytest.mark.slow)
            for given in [(8, 1e4, 1.0), (8, 1e7, 50.0), (16, 1e7, 1.0)]
        ),
    ],
)
def test_the_residual_of_round_off_is_within_the_tolerance(n, E, size, monkeypatch):
    """The load is a few thousand times the round-off; below, it is named."""

    def run(weight, **options):
        ply = Ply(rectangle(size, size, (n, n), "irregular", 0.2), Fabric(E, 0.5))
        heavy = ply.with_terms(BodyForce((0.0, -weight), factor=1.0))
        clamp = {"clamp": Condition("bottom")}
        return LoadStepper(heavy, clamp, 1, max_halvings=0, **options).run()

    weight = 1e4 * 2.0**-53 * E / size
    assert run(weight).linear_solves <= 2
    monkeypatch.setattr(search, "_SHORTEST_AT_REST", (0.5, 0.5))
    with pytest.raises(StepError, match="due to round-off"):
        run(1e-4 * weight, method=Newton(most=1))


@pytest.mark.parametrize(
    ("n", "weight"),
    [pytest.param(4, 1e-10, marks=pytest.mark.slow), (2, 1e-8)],
)
def test_a_weight_near_round_off_is_no_obstacle_to_a_motion(n, weight):
    terms = [BodyForce((0.0, 0.0, -weight), factor=1.0)]
    mesh = rectangle(100.0, 100.0, (n, n // 2))
    fabric = Fabric(1e6, 0.3, bending=(5.0, 5.0))
    ply = Ply(mesh, fabric, terms=terms, dimension=3)
    ends = {"clamp": Condition("left"), "pull": Condition("right", (5.0, 0.0, 0.0))}
    last = LoadStepper(ply, ends, 1).run().states[-1]
    assert last.residuals[-1] < 1e-9 * last.reactions["pull"][0]


@pytest.mark.parametrize(
    "E", [1e8, *(pytest.param(E, marks=pytest.mark.slow) for E in (1e4, 1e5))]
)
@pytest.mark.parametrize(
    ("formulation", "size", "made"),
    [
        (Macro(), (4, 8), split),
        (Macro(), (4, 8), lambda mesh: split(cut(mesh))),
        (Quadratic(80.0), (8, 16), cut),
    ],
    ids=["macro", "macro triangles", "mean"],
)
def test_a_step_with_kinks_needs_4_iterations(formulation, size, made, E, monkeypatch):
    """Five if the tension is predicted, and not the force over the stretch.

    Further iterations update the stabilisation stiffnesses.
    """
    monkeypatch.setattr(Ply, "updated", lambda _, parameters, *others: parameters)
    scene = bias_extension(made(bias_extension(size=size).mesh))
    fabric = Fabric(E, 0.5, scene.warp, scene.weft)
    case = Case(scene=scene, fabric=fabric, formulation=formulation, steps=4)
    assert case.run().linear_solves <= 18


def test_an_updated_state_keeps_its_difficulty(monkeypatch):
    ply = SimpleNamespace(updated=lambda p, u, t: {}, terms=())
    start = Evaluation(1.0, *np.zeros((3, 1)), {}, {})
    problem = SimpleNamespace(
        ply=ply,
        evaluation=lambda *_: start,
        contacts=(),
        balancing=(),
        nodes=np.zeros((2, 1)),
    )
    values = {"problem": problem, "start": None, "energies": {}, "potentials": {}}
    trials = (Trial(*"ufp", (), 0.0, n, **values) for n in (9, 0))
    changes = iter([1.0, 0.0])
    monkeypatch.setattr(EquilibriumSearch, "_first", lambda *_: next(trials))
    monkeypatch.setattr(search, "_change", lambda *_: next(changes))
    equilibria = EquilibriumSearch(problem, None, (), None)
    again = equilibria(Target(1.0, 1.0, None, None, None))
    assert again.projected == 9
    assert again.converged


class Towards(Term):
    """A force that grows with the distance to a point and saturates soon."""

    name, role, line_search = "towards", "internal", True

    def __init__(self, basis, x, force, reach):
        self.x, self.force, self.reach, self.n = x, force, reach, basis.N

    def _over_reach(self, u):
        return (u[-1] - self.x) / self.reach

    def energy(self, u, t, p):
        return self.force * self.reach * np.hypot(1, self._over_reach(u))

    def residual(self, u, t, p):
        y = self._over_reach(u)
        return np.append(np.zeros(self.n - 1), self.force * y / np.hypot(1, y))

    def tangent(self, u, t, p):
        slope = self.force / self.reach / np.hypot(1, self._over_reach(u)) ** 3
        return csr_matrix(([slope], ([self.n - 1], [self.n - 1])), (self.n, self.n))


def test_a_line_search_prevents_overshooting():
    """Far from the point the tangent is small: whole increments pass it by more."""
    ply = Ply(MeshQuad().refined(1).with_defaults(), Fabric(10.0, 3.0), Full())
    term = Towards(ply.basis, 0.02, 3.0, 0.01)
    ply = Ply(ply.mesh, ply.fabric, Full(), [term])
    arguments = ply, {"clamp": Condition("bottom")}, ply.basis.zeros()
    method = Newton(longest=np.inf)
    u = equilibrium_near(*arguments, method=method).u
    assert u[-1] == pytest.approx(0.0193, 1e-2)
    term.line_search = False
    with pytest.raises(NoEquilibriumError):
        equilibrium_near(*arguments, method=method)


def test_an_unconverged_iteration_continues_downhill(monkeypatch):
    scene = bias_extension(size=(8, 16))
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, Macro())

    def run():
        method = Newton(most=5)
        return LoadStepper(ply, scene.conditions, 1, method=method, max_halvings=0)

    energies, applied = [], newton.Descent.__call__

    def recorded(descent, *others):
        at, increment = applied(descent, *others)
        reached = at.u, at.u + increment.du
        energies.append([descent.problem.energy(u, at.parameters) for u in reached])
        return at, increment

    monkeypatch.setattr(newton.Descent, "__call__", recorded)
    assert run().run().converged
    assert energies
    assert all(after <= before for before, after in energies)
    monkeypatch.setattr(newton, "_DESCENT", 0)
    with pytest.raises(StepError):
        run().run()
