"""Small forming problems with friction drawn at random, and their outcomes."""

from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from skfem_textile import LoadStepper, Result
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.states import Iteration

from ..common.running import errors_only, run
from ..common.tables import markdown_table
from ..study import Row
from .drawn import JUDGED, MONOTONE, PHASES, TOOLS, Drawn, Problem
from .oracle import LIMITS, Oracle

#: Seed of all cases, and number of stored ones, which judge the library.
SEED, NUMBER = 5, 160

#: Outcomes of a case.
RIGHT, REFUSED, WRONG = OUTCOMES = "right", "refused", "wrong"

# Iterations after which a run counts as refused, and most steps of runs that are
# compared with twice as many.
_MOST, _COMPARED = 3000, 8


class _TooLongError(Exception):
    """Raised after `_MOST` iterations."""


@dataclass(frozen=True)
class Extreme:
    """Problem drawn at random; see `Drawn` and `Oracle`."""

    kind: str
    number: int
    seed: int = SEED

    def __str__(self) -> str:
        return f"{self.kind}, {self.number}"

    def rows(self) -> list[Row]:
        """One row with the input, the outcome and the deviations."""
        drawn = Drawn.of(self.kind, self.number, self.seed)
        row: Row = {"case": str(self), **asdict(drawn)}
        row["friction"] = " ".join(f"{mu:.2g}" for mu in drawn.friction)
        row["plan"] = str(drawn.plan or "")
        with errors_only():
            problem, result, refused = _run(drawn, drawn.steps)
            row |= {"outcome": REFUSED if refused else RIGHT, "cause": refused}
            if problem is None or result is None:
                return [row]
            oracle = _judged(drawn, problem, result)
            row |= {
                "load_factor": result.states[-1].load_factor,
                "resolved": result.path_resolved,
                "solves": result.linear_solves,
                "balance": oracle.missed / max(oracle.moved, 1e-300),
                **oracle.worst,
            }
            broken = oracle.broken()
            if not refused and not _ends_with_phases(drawn, problem, result):
                broken.append("end of a phase")
            if broken:
                row |= {"outcome": WRONG, "cause": ", ".join(broken)}
            if not refused and drawn.motion in MONOTONE and drawn.steps <= _COMPARED:
                row |= _compared(drawn, result)
        return [row]


def _run(drawn: Drawn, steps: int) -> tuple[Problem | None, Result | None, str]:
    """Problem, result and the reason of a refusal."""
    iterations = 0

    def count(iteration: Iteration) -> None:
        nonlocal iterations
        iterations += 1
        if iterations > _MOST:
            raise _TooLongError

    try:
        problem = drawn.problem()
        stepper = LoadStepper(
            *(problem.ply, problem.conditions),
            steps=problem.process.steps if problem.process else steps,
            on_iteration=count,
        )
        return problem, *run(stepper)
    except _TooLongError:
        return None, None, f"more than {_MOST} iterations"
    except ValueError as error:
        return None, None, str(error)


def _judged(drawn: Drawn, problem: Problem, result: Result) -> Oracle:
    """The oracle after all states of a run."""
    ply = problem.ply
    fixed = Constraints(ply.basis, problem.conditions).fixed
    oracle = Oracle(
        *(ply, problem.motions, drawn.coefficients(), problem.amounts),
        *(drawn.slip, fixed, drawn.whole),
    )
    for state in result.states:
        oracle.judge(state)
    return oracle


def _ends_with_phases(drawn: Drawn, problem: Problem, result: Result) -> bool:
    """True if the states at the ends of phases have the load factors of the plan."""
    if drawn.plan is None or problem.process is None:
        return True
    found = [result.states[i].load_factor for i in problem.process.at_ends(result)]
    return np.array_equal(found, drawn.plan.ends[1:])


def _compared(drawn: Drawn, result: Result) -> Row:
    """Differences from a run with twice as many steps.

    The largest one of a position, relative to the largest displacement, and the one of
    the largest force of a tool.
    """
    _, finer, refused = _run(drawn, 2 * drawn.steps)
    if refused or finer is None:
        return {"refused_in_more_steps": refused}
    u, v = result.u, finer.u
    one, other = (_force(run) for run in (result, finer))
    return {
        "moved_in_more_steps": float(np.abs(u - v).max() / np.abs(v).max()),
        "force_in_more_steps": one / other - 1 if other else 0.0,
        "finer_resolved": finer.path_resolved,
    }


def _force(result: Result) -> float:
    """Force of the first tool in N."""
    return float(np.linalg.norm(next(iter(_of_tools(result).values()))))


def _of_tools(result: Result) -> dict[str, Any]:
    of_tools = ("punch", "drum", "plate")
    reactions = result.states[-1].reactions
    return {name: f for name, f in reactions.items() if name in of_tools}


def extremes() -> list[Extreme]:
    """All stored cases."""
    return [Extreme(JUDGED, i) for i in range(NUMBER)]


def outcomes(rows: list[Row]) -> str:
    """Number of cases by tools and outcome, and of accepted ones with a warning."""
    lines = []
    kinds = {tools: [row for row in rows if row["tools"] == tools] for tools in TOOLS}
    kinds["all"] = rows
    kinds["of all, in phases"] = [row for row in rows if row["motion"] == PHASES]
    for kind, of in kinds.items():
        counts = Counter(row["outcome"] for row in of)
        warned = sum(row["outcome"] == RIGHT and not row["resolved"] for row in of)
        found = [counts[outcome] for outcome in OUTCOMES]
        lines.append([kind, len(of), *found, warned])
    heads = [
        "tools",
        "drawn",
        *OUTCOMES,
        "right with the warning of an unresolved path",
    ]
    return markdown_table(heads, lines)


def causes(rows: list[Row]) -> str:
    """Reasons of refusals, and violated limits."""
    lines = [
        [
            *(row["case"], f"{row['tools']}, {row['motion']}", row["holder"]),
            *(row["steps"], row["outcome"], row["cause"]),
        ]
        for row in rows
        if row["outcome"] != RIGHT
    ]
    heads = ["case", "tools", "holder", "steps", "outcome", "cause"]
    return markdown_table(heads, lines)


def deviations(rows: list[Row]) -> str:
    """Largest deviation of any accepted state from the oracle."""
    judged = [row for row in rows if row.get("energy") is not None]
    lines = [
        [name, f"{limit:.0e}", f"{abs(max(row[name] for row in judged)):.1e}"]
        for name, limit in LIMITS.items()
    ]
    return markdown_table(["deviation", "limit", "largest"], lines)


def more_steps(rows: list[Row]) -> str:
    """Changes in twice as many steps of resolved runs that only advance, by steps."""
    known = [row for row in rows if row["resolved"] and row.get("finer_resolved")]
    lines = []
    for steps in sorted({row["steps"] for row in known}):
        of_steps = [row for row in known if row["steps"] == steps]
        columns = [
            np.array([abs(row[f"{name}_in_more_steps"]) for row in of_steps])
            for name in ("moved", "force")
        ]
        lines.append(
            [
                *(steps, len(of_steps)),
                *(
                    f"{100 * at(column):.2g} %"
                    for column in columns
                    for at in (np.median, np.max)
                ),
            ]
        )
    heads = ["steps", "cases", "change of the position, median", "largest"]
    return markdown_table([*heads, "of the force, median", "largest"], lines)
