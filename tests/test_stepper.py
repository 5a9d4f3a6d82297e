import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    OnePoint,
    Ply,
    StepError,
    stepper,
)
from skfem_textile.newton import (
    NoEquilibriumError,
    Problem,
    balanced,
    descent,
    mixed_newton,
)
from skfem_textile.scenes import strip

CLAMP = {"clamp": Condition("bottom")}


def pulled(value, **fabric):
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(**{"tension": 10.0, "shear": 1.0, **fabric}), Full())
    return ply, CLAMP | {"pull": Condition("top", value, direction=(0, 1))}


def refuse_long_steps(problem, u, fixed_values):
    if fixed_values.max() - np.abs(u).max() > 0.2:
        raise NoEquilibriumError("too long")
    return mixed_newton(problem, u, fixed_values)


def test_a_uniform_pull_is_exact():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, steps=4).run()
    assert result.converged
    assert [s.load_factor for s in result.states] == [0.0, 0.25, 0.5, 0.75, 1.0]
    force = 10.0 * np.log(1.5) / 1.5
    for name, sign in (("pull", 1), ("clamp", -1)):
        np.testing.assert_allclose(
            result.states[-1].reactions[name], [0, sign * force], atol=1e-7
        )
    assert result.summary()["energy"] == pytest.approx(5 * np.log(1.5) ** 2)


def test_reactions_do_the_work_of_the_energy():
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=40).run()
    top = result.ply.mesh.p[1] == 1
    forces = [ply.nodal(ply.residual(s.u))[:, top] for s in result.states]
    moves = [ply.nodal(s.u)[:, top] for s in result.states]
    work = sum(
        np.sum(0.5 * (forces[i] + forces[i + 1]) * (moves[i + 1] - moves[i]))
        for i in range(40)
    )
    assert work == pytest.approx(
        result.states[-1].energies["tension"] + result.states[-1].energies["shear"],
        rel=1e-3,
    )


def test_history_has_a_row_per_state_with_what_is_needed():
    ply, conditions = pulled(0.5)
    result = LoadStepper(ply, conditions, steps=3).run()
    rows = result.history()
    assert len(rows) == 4
    assert rows[0]["energy"] == 0.0
    for row, state in zip(rows[1:], result.states[1:], strict=True):
        assert row["iterations"] == len(state.residuals) > 0
        assert row["residual"] <= row["tolerance"]
        assert row["pull_reaction_y"] > 0
        assert row["energy"] == pytest.approx(
            row["tension_energy"] + row["shear_energy"] + row["stabilisation_energy"]
        )
    assert result.newton_iterations == sum(row["iterations"] for row in rows)


def test_a_failed_step_is_halved(monkeypatch):
    ply, conditions = pulled(0.5)
    monkeypatch.setattr(stepper, "STRATEGIES", [(refuse_long_steps, 25)])
    result = LoadStepper(ply, conditions, steps=1).run()
    assert [s.load_factor for s in result.states] == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_it_says_plainly_when_it_cannot_and_keeps_what_it_has():
    """A ply squeezed to nothing folds: no state can be accepted past that."""
    ply, conditions = pulled(-1.5)
    with pytest.raises(
        StepError, match=r"stopped at load factor 0\.\d+: the step"
    ) as e:
        LoadStepper(ply, conditions, steps=4, max_halvings=3).run()
    result = e.value.result
    assert not result.converged
    assert result.states[-1].load_factor >= 0.5
    assert result.newton_iterations > sum(s.iterations for s in result.states)
    assert ply.area_ratio(result.u).min() > 0


def test_a_value_that_goes_wrong_on_the_way_keeps_what_was_computed(monkeypatch):
    ply, conditions = pulled(
        lambda X, t: 0.5 * t + (np.nan if t == 0.75 else 0.0) * X[0]
    )
    stepper_ = LoadStepper(ply, conditions, steps=2)
    monkeypatch.setattr(stepper, "STRATEGIES", [(refuse_long_steps, 25)])
    with pytest.raises(StepError, match=r"not finite at load factor 0\.75") as error:
        stepper_.run()
    assert error.value.result.states[-1].load_factor == 0.5


def test_iterations_include_abandoned_attempts(monkeypatch):
    monkeypatch.setattr(stepper, "STRATEGIES", [(mixed_newton, 1), (mixed_newton, 25)])
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=2).run()
    iterations = [state.iterations for state in result.states]
    assert iterations[1] == len(result.states[1].residuals) + 1
    assert sum(iterations) == result.newton_iterations


def test_a_mechanism_is_refused():
    mesh = MeshQuad().refined(2).with_defaults()
    ply = Ply(mesh, Fabric(10.0), Full())  # no shear stiffness, only one side held
    with pytest.raises(StepError, match="some motion meets no stiffness"):
        LoadStepper(
            ply, {"pull": Condition("top", 0.1, direction=(0, 1))}, steps=1
        ).run()


def test_a_folded_equilibrium_is_a_failed_step(monkeypatch):
    monkeypatch.setattr(Problem, "smallest_area_ratio", lambda self, u: 0.0)
    ply, conditions = pulled(0.5)
    with pytest.raises(StepError, match="det F"):
        LoadStepper(ply, conditions, steps=1, max_halvings=0).run()


@pytest.mark.parametrize("steps", [0, -3, 2.5])
def test_less_than_one_step_is_refused(steps):
    ply, conditions = pulled(0.5)
    with pytest.raises(ValueError, match="steps must be at least 1"):
        LoadStepper(ply, conditions, steps=steps)


@pytest.mark.parametrize("E", [1e2, 1e6, 1e10])
def test_the_tolerance_can_be_met_at_any_stiffness(E):
    """On an aligned mesh the reactions vanish with the residual."""
    scene = strip("aligned", size=(4, 6))
    ply = Ply(scene.mesh, Fabric(E), Full())
    result = LoadStepper(ply, scene.conditions, steps=5).run()
    assert result.summary()["max_fibre_strain"] < 1e-9
    assert result.newton_iterations < 40


def test_descent_and_mixed_newton_find_the_same_equilibrium():
    scene = strip(size=(4, 6))
    problem = LoadStepper(
        Ply(scene.mesh, Fabric(1e4), OnePoint(10.0)), scene.conditions
    ).problem
    fixed_values = problem.constraints.fixed_values(0.2)
    rest = problem.ply.basis.zeros()
    ends = [
        balanced(problem, way(problem, rest, fixed_values), 100).u
        for way in (mixed_newton, descent)
    ]
    np.testing.assert_allclose(*ends, atol=1e-6)


def test_progress_is_told_every_state():
    ply, conditions = pulled(0.5)
    seen = []
    LoadStepper(
        ply, conditions, steps=2, progress=lambda s: seen.append(s.load_factor)
    ).run()
    assert seen == [0.5, 1.0]
