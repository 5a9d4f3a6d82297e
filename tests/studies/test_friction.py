"""Problems with friction drawn at random, and the oracle that judges them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from skfem_textile import LoadStepper, io
from skfem_textile.solve.conditions import Constraints
from studies.friction.drawn import (
    DRUM,
    HEMISPHERE,
    JUDGED,
    MENDED,
    PHASES,
    PLATE,
    Drawn,
    stl,
)
from studies.friction.extremes import RIGHT, causes, outcomes
from studies.friction.in_phases import DrawnPhase, Plan
from studies.friction.oracle import Oracle
from studies.friction.problems import Wedge

# A plate that is moved back and forth under a ply, at which it slides.
GIVEN = replace(
    Drawn.of(JUDGED, 0, 0),
    **{"tools": PLATE, "motion": "shaken", "holder": "pressure", "whole": True},
    **{"parts": 3, "element": "squares", "steps": 4, "friction": (0.3, 0.0, 0.1)},
    **{"growth": 0.5, "slip": 0.05, "shift": 2.0, "tension": 0.1, "load": 1e-3},
    **{"E": 1e4, "G": 0.5, "plan": None},
)


# The same plate in phases, in which friction and pressure change.
IN_PHASES = replace(
    GIVEN,
    motion=PHASES,
    plan=Plan(
        (
            DrawnPhase("close", 2, 0, 0, 1, 1.5, False, (1.0, 1.0)),
            DrawnPhase("pull", 2, 1, 0.2, 1, None, False, (0.5, 1.0)),
            DrawnPhase("hold", 1, 1, 0.2, 0.5, None, False, (1.0, 1.0)),
        )
    ),
)


@cache
def formed(given=GIVEN):
    problem = given.problem()
    steps = problem.process.steps if problem.process else given.steps
    run = LoadStepper(problem.ply, problem.conditions, steps=steps).run()
    return problem, run.states


def broken(states, slip=GIVEN.slip, share=1.0, ahead=0.0, given=GIVEN, more=1.0):
    """Limits that states break if the oracle has another slip, friction or motion.

    ``more`` is a factor of the gap, pressure or force of holders.
    """
    problem, _ = formed(given)
    fixed = Constraints(problem.ply.basis, problem.conditions).fixed
    mu = {k: lambda t, of=of: share * of(t) for k, of in given.coefficients().items()}
    motions = {k: lambda t, of=of: of(t + ahead) for k, of in problem.motions.items()}
    amounts = {k: lambda t, of=of: more * of(t) for k, of in problem.amounts.items()}
    oracle = Oracle(problem.ply, motions, mu, amounts, slip, fixed, given.whole)
    for state in states:
        oracle.judge(state)
    return set(oracle.broken())


def test_states_of_a_shaken_plate_follow_coulombs_law():
    _, states = formed()
    assert broken(states) == set()
    assert states[-1].energy_lost["plate"] > 10


@pytest.mark.parametrize(
    ("other", "found"),
    [
        ({"share": 1.01}, {"unbalanced", "friction force", "tool force"}),
        ({"share": 0.99}, {"unbalanced", "beyond the cone", "work of sliding"}),
        ({"slip": 0.06}, {"unbalanced", "friction force", "work of sliding"}),
        ({"ahead": 0.01}, {"unbalanced", "friction force"}),
    ],
)
def test_the_oracle_finds_other_friction_slip_and_motion(other, found):
    _, states = formed()
    assert found <= broken(states, **other)


def test_states_of_a_process_in_phases_follow_coulombs_law():
    problem, states = formed(IN_PHASES)
    assert broken(states, given=IN_PHASES) == set()
    assert {1 / 3, 2 / 3, 1.0} <= {state.load_factor for state in states}
    assert states[-1].energy_lost["plate"] > 1
    assert problem.process.names == ["close", "pull", "hold"]


@pytest.mark.parametrize(
    ("other", "found"),
    [
        ({"share": 1.01}, {"unbalanced", "friction force"}),
        ({"more": 1.01}, {"holder force"}),
        ({"ahead": 0.01}, {"unbalanced", "friction force"}),
    ],
)
def test_the_oracle_finds_other_amounts_of_phases(other, found):
    _, states = formed(IN_PHASES)
    assert found <= broken(states, given=IN_PHASES, **other)


@pytest.mark.parametrize("tools", [HEMISPHERE, DRUM, PLATE])
def test_a_plan_states_what_its_process_does(tools):
    """Motions, friction, and gaps, pressures and forces, at all load factors."""
    seen = set()
    for number in range(40):
        drawn = Drawn.of(MENDED, number, 3)
        if not (drawn.plan and drawn.tools == tools):
            continue
        problem, mu = drawn.problem(), drawn.coefficients()
        for tool in problem.process.tools:
            seen |= {"friction"}
            amounts = ("gap", "pressure", "force")
            what = [x for x in amounts if callable(getattr(tool, x, None))]
            for t in np.linspace(0, 1, 61):
                assert tool.friction(t) == pytest.approx(mu[tool.name](t), abs=1e-12)
                for x in what:
                    expected = pytest.approx(problem.amounts[tool.name](t), rel=1e-9)
                    assert getattr(tool, x)(t) == expected
                    seen |= {x}
                if tool.name in problem.motions:
                    R, c = problem.motions[tool.name](t)
                    moved = tool.motion(t)
                    turned = moved[0] if isinstance(moved, tuple) else np.eye(3)
                    moved = moved[1] if isinstance(moved, tuple) else moved
                    assert turned == pytest.approx(R, abs=1e-12)
                    assert moved == pytest.approx(c, abs=1e-9)
                    seen |= {"turn"} if np.ptp(R - np.eye(3)) else set()
    expected = {DRUM: {"turn"}, PLATE: {"pressure", "turn"}}
    assert seen >= {"friction"} | expected.get(tools, {"gap", "force", "pressure"})


def test_the_oracle_finds_a_missing_state_and_a_wrong_one():
    _, states = formed()
    assert "friction force" in broken([*states[:2], *states[3:]])
    moved = states[2].u.copy()
    moved[2::3] -= 1e-3
    wrong = replace(states[2], u=moved)
    assert {"penetration", "open contact"} <= broken([*states[:2], wrong])


def test_draws_depend_on_kind_number_and_seed_alone():
    assert Drawn.of(JUDGED, 3, 1) == Drawn.of(JUDGED, 3, 1)
    draws = [
        *(Drawn.of(JUDGED, 3, 1), Drawn.of(MENDED, 3, 1)),
        *(Drawn.of(JUDGED, 4, 1), Drawn.of(JUDGED, 3, 2)),
    ]
    assert len({drawn.E for drawn in draws}) == 4


@pytest.mark.slow
def test_a_jammed_wedge_takes_few_solves():
    """With bounds that follow contact forces in all iterations it takes 454."""
    (row,) = Wedge(0.1).rows()
    assert abs(row["off"]) < 1e-6
    assert row["solves"] < 200


def test_triangles_of_a_tool_pass_through_a_file(tmp_path):
    i, j = (x.ravel() for x in np.meshgrid(range(4), range(4)))
    place = np.array([i, j, 0 * i], dtype=float)
    right, up = np.array([1.0, 0, 0]), np.array([0.0, 1, 0])
    lower = [place.T, place.T + right, place.T + right + up]
    upper = [place.T, place.T + right + up, place.T + up]
    corners = np.swapaxes(np.hstack([lower, upper]), 0, 1)
    file = tmp_path / "tool.stl"
    file.write_bytes(stl(corners))
    facets = io.read_surface(file).facets
    assert facets.points.shape == (3, 25)
    assert facets.triangles().shape == (3, 32)


def test_tables_count_outcomes_and_list_causes():
    rows = [
        {"case": f"judged, {i}", "tools": "plate", "motion": "up", "holder": "none"}
        | {"steps": 2, "outcome": outcome, "cause": cause, "resolved": False}
        for i, (outcome, cause) in enumerate([(RIGHT, ""), ("refused", "too far")])
    ]
    assert "| plate | 2 | 1 | 1 | 0 | 1 |" in outcomes(rows)
    assert causes(rows).count("judged") == 1
    assert "too far" in causes(rows)
