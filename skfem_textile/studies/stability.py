"""Stiff and extreme cases: which end right, which are refused, and which wrong.

Every problem of `extremes` is loaded in 1, 2, 5, 20 and 100 steps, and for comparison
in 400.  A run ends as

- *right*: on a stable, unfolded equilibrium with the energy that 400 steps reach, or
  on another one; where the mesh can represent the exact motion, on that motion;
- *refused*: with an error;
- *wrong*: on anything else.

Whether a state is a stable, unfolded equilibrium is found out again here, by dense
algebra and apart from the load stepper.
"""

import csv
import json
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy import ndarray

from ..conditions import Constraints
from ..ply import Ply
from ..result import StepError
from ..scenes import Scene
from ..stepper import LoadStepper
from .extremes import Extreme, extremes
from .quiet import quiet

STEPS = (1, 2, 5, 20, 100)
_REFERENCE, _AGREEING = 400, (20, 100, 400)

#: Written by `write` and by `draw`.
FILES = ("stability.csv", "summary.json", "stability.md")
PICTURES = ("stability.png",)

RIGHT, OTHER = "right", "right, another equilibrium"
REFUSED, WRONG = "refused", "wrong"

_COLOURS = {RIGHT: "#0072B2", OTHER: "#56B4E9", REFUSED: "#E69F00", WRONG: "#D55E00"}

# Energies this close are one, and so are those of fibre strains this small.
_SAME_ENERGY, _NO_STRAIN = 1e-6, 1e-10

# An exact motion is met when no node is off by more, as a share of the ply's size.
_EXACT = 1e-8

Row = dict[str, Any]


def cases() -> list[Extreme]:
    """The problems, in the order of the report."""
    return extremes()


def name(problem: Extreme) -> str:
    """A name that no other problem has."""
    return f"{problem.family}, {problem.name}"


def line(rows: list[Row]) -> str:
    """The outcomes of one problem, on one line."""
    outcomes = " ".join(f"{row['steps']}:{row['outcome']}" for row in rows)
    return f"{rows[0]['family']}, {rows[0]['problem']:40} {outcomes}"


@quiet()
def examined(problem: Extreme) -> list[Row]:
    """The cases of one problem, each with its outcome."""
    runs = {steps: _run(problem, steps) for steps in (*STEPS, _REFERENCE)}
    reference = runs[_REFERENCE]
    scale = _SAME_ENERGY * abs(reference["energy"]) + reference["negligible"]

    def as_many_steps(row: Row) -> bool:
        return bool(abs(row["energy"] - reference["energy"]) <= scale)

    several = [runs[steps] for steps in _AGREEING]
    one_answer = all(r["sound"] and as_many_steps(r) for r in several)
    rows = []
    for steps in STEPS:
        row = runs[steps]
        met = row["sound"] and (not problem.exact or row["exact"])
        if not row["converged"]:
            outcome = REFUSED
        elif not met:
            outcome = WRONG
        else:
            same = reference["sound"] and as_many_steps(row)
            outcome = RIGHT if same else OTHER
        head = {
            "family": problem.family,
            "problem": problem.name,
            "steps": steps,
            "outcome": outcome,
            "one answer": one_answer,
        }
        rows.append(head | {k: v for k, v in row.items() if k not in _INTERNAL})
    return rows


_INTERNAL = ("converged", "sound", "exact", "negligible")


def _run(problem: Extreme, steps: int) -> Row:
    """One case: its figures, and whether its end is sound."""
    scene = problem.scene()
    ply = problem.ply(scene)
    stepper, said = LoadStepper(ply, scene.conditions, steps), ""
    start = perf_counter()
    try:
        result = stepper.run()
    except StepError as error:
        result, said = error.result, str(error)
    seconds = perf_counter() - start
    summary = scene.summary(result)
    size = float(np.ptp(scene.mesh.p, axis=1).max())
    area = float(ply.basis.dx.sum())
    return {
        "energy": summary["energy"],
        "min_det_F": summary["min_det_F"],
        "mesh_fibre_strain": summary["mesh_fibre_strain"],
        "displacement_error_rms": summary["displacement_error_rms"],
        "load_factor": summary["load_factor"],
        "steps_cut": summary["steps_cut"],
        "linear_solves": summary["linear_solves"],
        "factorisations": summary["factorisations"],
        "seconds": seconds,
        "message": said,
        "converged": result.converged,
        "sound": result.converged and is_sound(ply, scene, result.u),
        "exact": scene.errors(result)["displacement_error_max"] <= _EXACT * size,
        "negligible": problem.E * area * _NO_STRAIN**2,
    }


def is_sound(ply: Ply, scene: Scene, u: ndarray) -> bool:
    """Whether a state is a stable, unfolded equilibrium under the whole load.

    By the smallest det F, by Cholesky's factors of the dense tangent, scaled to a unit
    diagonal, and by the Newton step that is left to take.
    """
    constraints = Constraints(ply.basis, scene.conditions)
    if constraints.turn is not None:
        raise ValueError("the dense check knows conditions along the axes only")
    off = np.abs(u[constraints.fixed] - constraints.fixed_values(1.0)).max()
    if not ply.area_ratio(u, ply.fine_points).min() > 0 or off > 1e-9 * np.abs(u).max():
        return False
    free = constraints.free
    K = ply.tangent(u).toarray()[np.ix_(free, free)]
    if not np.all(K.diagonal() > 0):
        return False
    D = 1 / np.sqrt(K.diagonal())
    try:
        L = np.linalg.cholesky(D[:, None] * K * D)
    except np.linalg.LinAlgError:
        return False
    left = D * np.linalg.solve(L.T, np.linalg.solve(L, D * ply.residual(u)[free]))
    return bool(np.abs(left).max(initial=0.0) <= 1e-6 * np.ptp(ply.mesh.p))


def write(rows: list[Row], folder: Path) -> None:
    """Write every case as CSV, the counts as JSON, and both as a table."""
    with open(folder / "stability.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    (folder / "summary.json").write_text(json.dumps(summary(rows), indent=2) + "\n")
    (folder / "stability.md").write_text(markdown(rows))


def summary(rows: list[Row]) -> dict[str, Any]:
    """How many cases ended how."""
    outcomes = Counter(row["outcome"] for row in rows)
    one = [row for row in rows if row["one answer"]]
    right = sum(row["outcome"] == RIGHT for row in one)
    return {
        "cases": len(rows),
        "right": outcomes[RIGHT] + outcomes[OTHER],
        "right_on_another_stable_equilibrium": outcomes[OTHER],
        "refused": outcomes[REFUSED],
        "wrong": outcomes[WRONG],
        "cases_with_one_answer": len(one),
        "right_with_one_answer": right,
        "share_right_with_one_answer": right / max(len(one), 1),
    }


def markdown(rows: list[Row]) -> str:
    """A line per family, and a line per problem that was refused or wrong."""
    text = ["| family | cases | right | another | refused | wrong | solves, 1 step "]
    text += ["| 20 steps |\n", "|---" * 8, "|\n"]
    for family in dict.fromkeys(row["family"] for row in rows):
        some = [row for row in rows if row["family"] == family]
        n = Counter(row["outcome"] for row in some)
        counts = [len(some), n[RIGHT], n[OTHER], n[REFUSED], n[WRONG]]
        solves = [_median_solves(some, steps) for steps in (1, 20)]
        text.append(f"| {' | '.join(map(str, [family, *counts, *solves]))} |\n")
    text += ["\n| refused or wrong | in steps | up to load factor | because |\n"]
    text += ["|---" * 4, "|\n"]
    bad = [row for row in rows if row["outcome"] in (REFUSED, WRONG)]
    for name in dict.fromkeys((row["family"], row["problem"]) for row in bad):
        some = [row for row in bad if (row["family"], row["problem"]) == name]
        steps = ", ".join(str(row["steps"]) for row in some)
        reached = [row["load_factor"] for row in some]
        *_, message = some[-1]["message"].partition("; try")[0].split(": ", 2)
        text.append(
            f"| {', '.join(name)} | {steps} | {min(reached):.3f} to "
            f"{max(reached):.3f} | {message or WRONG} |\n"
        )
    return "".join(text)


def _median_solves(rows: Iterable[Row], steps: int) -> str:
    solves = [
        row["linear_solves"]
        for row in rows
        if row["steps"] == steps and row["outcome"] != REFUSED
    ]
    return f"{np.median(solves):g}" if solves else "-"


def draw(rows: list[Row], folder: Path) -> None:
    """Draw `PICTURES`: every case in the colour of its outcome, with its solves."""
    from ..cells import cells

    groups: dict[str, dict[str, list[tuple[str, str]]]] = {}
    for row in rows:
        lines = groups.setdefault(row["family"], {})
        solves = "" if row["outcome"] == REFUSED else str(row["linear_solves"])
        lines.setdefault(row["problem"], []).append((row["outcome"], solves))
    cells(
        groups,
        [str(steps) for steps in STEPS],
        _COLOURS,
        "Linear solves, by number of load steps",
        folder / "stability.png",
    )
