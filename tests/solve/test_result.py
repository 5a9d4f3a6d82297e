"""Results of a run: states, history, messages."""

import logging
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.sparse import identity
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Force,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Result,
    Sin2,
    Term,
    Traction,
    equilibrium_near,
)
from skfem_textile.mesh.splitting import split
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.verdict import CHECKS
from tests.helpers import Pretensioned, arguments_of
from tests.helpers.intervals import without_interval
from tests.helpers.pulled import ShortSteps, load_factors, pulled

PLY, CONDITIONS = pulled(0.5)


@cache
def uniform():
    """Result of a uniform pull."""
    return LoadStepper(PLY, CONDITIONS, steps=4).run()


def test_a_uniform_pull_is_exact():
    result = uniform()
    assert result.converged
    assert load_factors(result) == [0.0, 0.25, 0.5, 0.75, 1.0]
    force = 10.0 * np.log(1.5) / 1.5
    for name, sign in (("pull", 1), ("clamp", -1)):
        np.testing.assert_allclose(
            result.states[-1].reactions[name], [0, sign * force], atol=1e-7
        )
    assert result.summary()["energy"] == pytest.approx(5 * np.log(1.5) ** 2)


def test_reactions_do_the_work_of_the_energy():
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=20).run()
    rows = result.history()
    assert rows[-1]["work"] == pytest.approx(rows[-1]["energy"], rel=1e-3)
    assert rows[10]["work"] == pytest.approx(rows[10]["energy"], rel=1e-2)


def test_history_has_a_row_per_state_with_what_is_needed():
    result = uniform()
    rows = result.history()
    assert len(rows) == 5
    assert rows[0]["energy"] == 0.0
    for row, state in zip(rows[1:], result.states[1:], strict=True):
        assert row["linear_solves"] == len(state.residuals) > 0
        assert row["residual"] <= row["tolerance"]
        assert row["pull_reaction_y"] > 0
        assert row["negative_pivots"] == 0
        assert row["min_det_F"] > 1
        assert row["energy"] == pytest.approx(
            row["tension_energy"] + row["shear_energy"] + row["stabilisation_energy"]
        )
    assert result.linear_solves == sum(row["linear_solves"] for row in rows)


def parts_of(result):
    """Lines of a printed result: the states, and the quantities that come first."""
    table, _, first = str(result).partition("\nResult")
    return table.splitlines(), first.splitlines()


def test_a_printed_result_is_a_table_of_its_states():
    result = LoadStepper(PLY, CONDITIONS, steps=40).run()
    lines, (head, *first) = parts_of(result)
    assert lines[0].split()[:2] == ["load", "factor"]
    factors = [f"{t:.4f}" for t in np.linspace(0, 1, 11)]
    assert [line.split()[0] for line in lines[1:-1]] == factors
    assert all(line.endswith("yes") for line in lines[1:-1])
    assert lines[-1].split()[:3] == ["…", "30", "more"]
    assert "converged at load factor 1, 40 steps" in head
    assert first
    assert "…" not in str(LoadStepper(PLY, CONDITIONS, steps=10).run())


def test_a_result_of_a_displacement_is_that_of_its_state():
    run = uniform()
    of_state = Result.of_state(PLY, CONDITIONS, run.states[-1])
    of_u = Result.of_state(PLY, CONDITIONS, run.u.tolist())
    assert of_u.converged
    assert of_u.warnings == of_state.warnings
    times = {"wall_time_s", "assembly_time_s", "solve_time_s", "linear_solves"}
    expected = of_state.summary()
    for key, value in of_u.summary().items():
        if key not in times and not isinstance(value, str | list):
            assert value == pytest.approx(expected[key]), key


def test_a_result_of_a_displacement_states_that_it_is_not_an_equilibrium():
    u = uniform().u
    elsewhere = Result.of_state(PLY, CONDITIONS, 0.5 * u)
    assert not elsewhere.converged
    assert repr(elsewhere).startswith("Result: no equilibrium at load factor 1")
    assert "Stopped early" not in repr(elsewhere)
    (line,) = [x for x in elsewhere.warnings if "not an equilibrium" in x]
    assert "nodes do not have their prescribed displacements" in line
    moved, (dof,) = u.copy(), PLY.basis.nodal_dofs[:1, PLY.mesh.interior_nodes()[0]]
    moved[dof] += 0.01
    unbalanced = Result.of_state(PLY, CONDITIONS, moved)
    assert not unbalanced.converged
    force = np.abs(PLY.residual(moved, 1.0, PLY.updated(PLY.parameters_at_rest, moved)))
    (line,) = [x for x in unbalanced.warnings if "not an equilibrium" in x]
    assert f"the largest free nodal force is {force[dof]:.3g} N" in line


def test_a_displacement_of_macro_elements_is_in_equilibrium():
    held = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 0.02))}
    run = LoadStepper(Ply(PLY.mesh, Fabric(1e3, 0.5, (1, 1), (-1, 1))), held, 2).run()
    assert Result.of_state(run.ply, held, run.u).converged
    moved = run.u.copy()
    moved[run.ply.basis.nodal_dofs[0, run.ply.mesh.interior_nodes()[:2]]] += 1e-3
    assert not Result.of_state(run.ply, held, moved).converged


def test_a_result_of_a_displacement_warns_of_what_a_load_stepper_would_refuse():
    scene = bias_extension("irregular", (4, 8), shear_angle=0.2)
    ply = Ply(scene.mesh, Fabric(1e3, 0.1, scene.warp, scene.weft), OnePoint(20.0))
    run = LoadStepper(ply, scene.conditions, 2, warn_only=CHECKS).run()
    of_u = Result.of_state(ply, scene.conditions, run.u)
    assert of_u.converged
    assert [*of_u.states[0].warnings] == [*run.states[-1].warnings] == ["stabilisation"]


class Grip(Term):
    """A user-defined term that pulls all nodes to a point that moves with t."""

    def __init__(self, name, role):
        self.name, self.role = name, role

    def energy(self, u, t, p):
        return 0.5e-3 * float(((u - 0.01 * t) ** 2).sum())

    def residual(self, u, t, p):
        return 1e-3 * (u - 0.01 * t)

    def tangent(self, u, t, p):
        return 1e-3 * identity(len(u), format="csr")


def sheet(top, fabric=None, terms=()):
    """Result of a square whose bottom is clamped."""
    ply = Ply(PLY.mesh, fabric or PLY.fabric, Full(), terms)
    return LoadStepper(ply, {"bottom": Condition("bottom"), "top": top}, 2).run()


@pytest.mark.parametrize("top", [(0.0, 0.0), lambda X, t: 0 * X])
def test_a_run_without_motion_is_reported_once(caplog, top):
    result = sheet(Condition("top", top))
    assert not np.any(result.u)
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert record.message.startswith(
        "nothing changes with the load factor: no condition"
    )
    assert result.warnings == [record.message]


def test_a_driven_run_is_not_reported_as_motionless(caplog):
    """Motions there and back, loads, tension at rest, a user-defined term."""
    clamp = Condition("top")
    there_and_back = Condition("top", lambda X, t: 0.04 * t * (1 - t) + 0 * X)
    sheet(there_and_back)
    sheet(clamp, terms=[BodyForce((0.0, 1e-3))])
    sheet(clamp, terms=[Force("top", (0.0, 1e-3))])  # the reaction shows it
    sheet(clamp, Fabric(Pretensioned(10.0, 0.1), 1.0))
    sheet(clamp, terms=[Grip("grip", "internal")])
    assert "nothing changes" not in caplog.text


def test_a_result_shows_its_load_with_unit_and_interval():
    scene = bias_extension(size=(2, 4))
    ply = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))
    ends = {"<clamp>": Condition("bottom"), "<pull>": scene.conditions["top"]}
    result = LoadStepper(ply, ends, steps=1).run()
    load, half = result.states[-1].reactions["<pull>"][1], result.error.load
    shown = f"{load:.4g} ± {half * load:.2g} N"
    assert f"Load (&lt;pull&gt;)</th><td>{shown}</td>" in result._repr_html_()
    head, *rows = repr(result).splitlines()
    assert head.startswith("Result: converged at load factor 1, 1 step, ")
    *warnings, load_row = rows[: 1 + len(result.warnings)]
    assert load_row.split("  ")[1:] == ["Load (<pull>)", *[""] * 4, f" {shown}"]
    assert len(rows) <= 14
    assert warnings
    assert all(row.startswith("  Warning ") for row in warnings)


def test_the_load_of_a_result_is_on_the_condition_that_does_work():
    """A roller moves farther along its free axis, without a force."""
    result = without_interval(uniform())
    last = result.states[-1]
    far, across = np.array([0.0, 9.0]), np.array([5.0, 1e-15])
    roller = replace(
        last,
        displacements={"roller": far, **last.displacements},
        reactions={"roller": across, **last.reactions},
    )
    summary = replace(result, states=[roller]).summary()
    names = [one["name"] for one in summary["first"]]
    assert names[:2] == ["Load (pull)", "Displacement (pull)"]


def test_a_ply_under_loads_alone_shows_its_largest_displacement():
    mesh, load = MeshQuad().refined(1).with_defaults(), Force("right", (0.01, 0.0))
    ply = Ply(mesh, Fabric(10.0, 1.0), terms=[load])
    result = LoadStepper(ply, {"clamp": Condition("left")}, 2).run()
    summary = without_interval(result).summary()
    largest = np.linalg.norm(ply.nodal(result.u), axis=0).max()
    assert summary["max_displacement_mm"] == pytest.approx(largest)
    assert f"Largest displacement    {largest:.4g} mm" in repr(result)
    assert "load_N" not in summary


def test_the_strain_in_the_table_enters_the_law():
    scene = bias_extension(split(rectangle(50, 100, (2, 4), "irregular", 0.2)))
    ply = Ply(scene.mesh, Fabric(1e4, 0.5, scene.warp, scene.weft), Macro())
    result = LoadStepper(ply, scene.conditions, 2).run()
    (head, *_, last), _ = parts_of(result)
    assert "fibre strain" in head
    assert head.count("strain") == 1
    strain = np.abs(ply.law_strain(result.u)).max()
    assert float(last.split()[3]) == pytest.approx(strain, rel=1e-2)
    row, summary = result.history()[-1], result.summary()
    assert row["max_fibre_strain"] == summary["max_fibre_strain"] == strain
    assert row["mesh_fibre_strain"] == summary["mesh_fibre_strain"] > 2 * strain
    assert result.history()[1]["max_fibre_strain"] < strain


def test_the_history_contains_the_displacement_of_a_condition():
    ply, conditions = pulled(lambda X, t: 0.3 * t * X[0])
    result = LoadStepper(ply, conditions, steps=2).run()
    top = ply.nodes[1] == 1.0
    for row, state in zip(result.history(), result.states, strict=True):
        assert row["clamp_displacement_x"] == row["clamp_displacement_y"] == 0.0
        assert row["pull_displacement_y"] == pytest.approx(0.15 * state.load_factor)
        free = ply.nodal(state.u)[0, top].mean()
        assert row["pull_displacement_x"] == pytest.approx(free)
    assert free != 0


def test_callbacks_receive_every_iteration_and_every_state():
    states, iterations = [], []
    callbacks = {"on_step": states.append, "on_iteration": iterations.append}
    result = LoadStepper(PLY, CONDITIONS, 2, **callbacks).run()
    assert states == result.states[1:]
    assert len(iterations) == result.linear_solves
    assert iterations[0].load_factor == iterations[0].step == 0.5
    assert iterations[0].method == "newton"
    assert iterations[-1].residual <= iterations[-1].tolerance


def test_the_log_contains_iterations_and_steps(caplog):
    with caplog.at_level(logging.DEBUG, logger="skfem_textile"):
        result = LoadStepper(PLY, CONDITIONS, 1, method=ShortSteps()).run()
    levels = [record.levelno for record in caplog.records]
    assert levels.count(logging.DEBUG) == result.linear_solves
    assert "no acceptable state at load factor 1: too long" in caplog.text
    assert "load factor 0.25" in caplog.text


# States determine their energies and forces


FORMULATIONS = {
    "macro": Macro(),
    "one point": OnePoint(),
    "one point, C_s": OnePoint(4.0),
    "rate": OnePoint(1.0, "rate"),
    "quadratic": Quadratic(),
    "quadratic, mean": Quadratic(80.0),
    "full": Full(),
}


@cache
def extended(formulation):
    """Bias extension, its sides under a traction: ply, conditions and states."""
    scene = bias_extension(size=(4, 8))
    fabric = Fabric(1e4, Sin2(0.5), scene.warp, scene.weft)
    loads = [Traction(side, (0.0, 0.002)) for side in ("left", "right")]
    ply = Ply(scene.mesh, fabric, formulation, loads)
    return ply, scene.conditions, LoadStepper(ply, scene.conditions, 2).run().states


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_the_parameters_of_a_state_give_its_energies_and_forces(formulation):
    ply, conditions, states = extended(formulation)
    free = Constraints(ply.basis, conditions).free
    assert len(states) > 2
    for state in states:
        assert state.parameters.keys() == ply.parameters_at_rest.keys()
        energies = ply.energies(*arguments_of(state))
        assert energies == state.energies | state.potentials
        f = ply.residual(*arguments_of(state))
        assert np.abs(f[free]).max() <= state.tolerance
        for name, reaction in state.reactions.items():
            nodes = conditions[name].nodes(name, ply.basis)
            np.testing.assert_array_equal(ply.nodal(f)[:, nodes].sum(axis=1), reaction)


@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic(80.0)])
def test_other_parameters_do_not_balance_a_state(formulation):
    ply, conditions, (*_, last) = extended(formulation)
    free = Constraints(ply.basis, conditions).free
    f = ply.residual(last.u, last.load_factor)
    assert np.abs(f[free]).max() > 1e3 * last.tolerance
    assert ply.energies(last.u) != last.energies | last.potentials


@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic(80.0)])
def test_a_state_is_recomputed_from_its_displacement_and_parameters(formulation):
    ply, conditions, (*_, last) = extended(formulation)
    arguments, warn_only = (ply, conditions, last.u), ("stabilisation", "deviation")
    near, far = (
        equilibrium_near(*arguments, parameters=parameters, warn_only=warn_only)
        for parameters in (last.parameters, None)
    )
    assert near.linear_solves < far.linear_solves
    energy, recomputed = (sum(state.energies.values()) for state in (last, near))
    assert recomputed == pytest.approx(energy, rel=1e-2)
    np.testing.assert_allclose(near.u, last.u, atol=1e-2)


def test_failed_checks_that_only_warn_are_in_the_result():
    result = without_interval(uniform())
    assert result.warnings == []
    assert "warnings" not in result.summary()
    first, *failed = result.states
    failed = [replace(state, warnings={"work": "it jumped"}) for state in failed]
    summary = replace(result, states=[first, *failed]).summary()
    line = "load factor 0.25: it jumped (and in 3 more states)"
    assert summary["warnings"] == [line]
    (line,) = replace(result, unresolved=(0.5,)).summary()["warnings"]
    assert line.startswith("the path was not resolved at load factor 0.5: another")


def test_the_printed_load_has_the_interval_of_its_condition():
    """Not of the work of all conditions, which move."""
    mesh = rectangle(50, 100, (2, 4), "irregular", 0.25, 1)
    moves = {
        "held": Condition("bottom"),
        "pull": Condition("top", (0.0, 8.0)),
        "push": Condition(lambda X: (X[0] > 49.9) & (abs(X[1] - 50) < 15), (-1.0, 0.0)),
    }
    ply = Ply(mesh, Fabric(1e4, 0.5, (1, 1.2), (-1, 1.2)))
    result = LoadStepper(ply, moves, 2).run()
    summary, error = result.summary(), result.error
    assert summary["first"][0]["name"] == "Load (pull)"
    half = error.reactions["pull"][1]
    assert summary["load_N_half_width"] == half
    assert half != pytest.approx(error.load * summary["load_N"], rel=1e-3)
    assert f" ± {float(f'{half:.2g}'):g} N" in repr(result)
