"""Acceptance of equilibria, solution methods and their cost."""

from functools import cache

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Newton,
    OnePoint,
    PlainNewton,
    Ply,
    StepError,
    fitted,
)
from skfem_textile.scenes import bias_extension, strip
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve import search
from skfem_textile.solve.linear import SOLVERS, superlu
from tests.helpers import distorted
from tests.helpers.pulled import pulled


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


def test_the_verdict_needs_one_factorisation_per_run():
    """The factorisation at every other state is reused by the next step."""
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=5).run()
    assert result.factorisations == result.linear_solves + 1


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
    ends = [
        LoadStepper(
            Ply(scene.mesh, Fabric(1e4), OnePoint(10.0)),
            scene.conditions,
            steps=5,
            method=method,
        )
        .run()
        .u
        for method in ("newton", "plain", PlainNewton(30))
    ]
    for end in ends[1:]:
        np.testing.assert_allclose(end, ends[0], atol=1e-6)


def test_reactions_are_not_taken_for_unbalanced_forces():
    ply, conditions = pulled(0.5)
    problem = LoadStepper(ply, conditions).problem
    free, fixed = problem.constraints.free, problem.constraints.fixed
    f = problem.unfixed(np.ones(ply.basis.N), ply.basis.zeros())
    assert np.all(f[free] == 1)
    assert np.all(f[fixed] == 0)


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
