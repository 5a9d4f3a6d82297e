"""Stiff and extreme cases: which end right, which are refused, and which wrong.

Every problem of `extremes` is loaded in 1, 2, 5, 20 and 100 steps, and for comparison
in 400.  A run ends as

- *right*: on a stable, unfolded equilibrium, with the energy and the reactions that 400
  steps reach, to 1 %; where the mesh can represent the exact motion, on that motion;
- *right, another equilibrium*: on a stable, unfolded one with other energies or
  reactions, of a path that the run itself says was not resolved;
- *refused*: with an error;
- *refused though solvable*: with an error, where another run of the same formulation,
  in other steps or by another strategy, finds a stable, unfolded equilibrium;
- *wrong*: on anything else.

Whether a state is a stable, unfolded equilibrium is found out again in `soundness`, by
dense algebra and apart from the load stepper.
"""

import csv
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from ..solve.result import StepError
from ..solve.stepper import DEFAULT_STRATEGIES, LoadStepper
from .extremes import Extreme, extremes
from .outcomes import (
    MISSED,
    OTHER,
    OUTCOMES,
    REFUSED,
    RIGHT,
    WRONG,
    End,
    outcome,
    summary,
)
from .quiet import quiet
from .soundness import is_sound

STEPS = (1, 2, 5, 20, 100)
_REFERENCE = 400

# What else may solve a problem that is refused in any number of steps.
_OTHER_STRATEGIES = ("descent",), ("newton",)

#: Written by `write` and by `draw`.
FILES = ("stability.csv", "summary.json", "stability.md")
PICTURES = ("stability.png",)

# Titles of the columns of the outcomes.
_TITLES = "right", "another", "refused", "though solvable", "wrong"

_COLOURS = dict(
    zip(OUTCOMES, ("#0072B2", "#56B4E9", "#E69F00", "#CC79A7", "#D55E00"), strict=True)
)

# Fibre strains of which energies are nothing, and such that round-off makes.
_NO_STRAIN, _ROUND_OFF = 1e-10, 1e-13

# An exact motion is met when no node is off by more, as a share of the ply's size.
_EXACT = 1e-8

# What is reported of a run's summary.
_FIGURES = (
    *("energy", "corners_energy", "min_det_F", "mesh_fibre_strain"),
    *("displacement_error_rms", "load_factor", "steps_cut"),
    *("linear_solves", "factorisations"),
)

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
    reference, _ = runs[_REFERENCE]
    solved_by = _solved_by(problem, runs)
    rows = []
    for steps in STEPS:
        end, figures = runs[steps]
        both = end.converged and reference.converged
        head = {
            "family": problem.family,
            "problem": problem.name,
            "kind": problem.kind,
            "seed": problem.seed,
            "steps": steps,
            "outcome": outcome(end, reference, bool(solved_by)),
            "solvable": bool(solved_by),
            "solved_by": solved_by,
            "reference_sound": reference.sound,
            "agrees": end.agrees(reference),
            "path_resolved": end.path_resolved,
            "energy_off": end.energy_off(reference) if both else None,
            "reactions_off": end.reactions_off(reference) if both else None,
        }
        rows.append(head | figures)
    return rows


def _solved_by(problem: Extreme, runs: Mapping[int, tuple[End, Row]]) -> str:
    """The first run that ends soundly; if none does, the first by another strategy."""
    for steps, (end, _) in runs.items():
        if end.sound:
            return f"{', '.join(DEFAULT_STRATEGIES)} in {steps}"
    for steps, strategies in product(runs, _OTHER_STRATEGIES):
        end, _ = _run(problem, steps, strategies)
        if end.sound:
            return f"{', '.join(strategies)} in {steps}"
    return ""


def _run(
    problem: Extreme, steps: int, strategies: Sequence[str] = DEFAULT_STRATEGIES
) -> tuple[End, Row]:
    """One run: how it ended, and its figures."""
    scene = problem.scene()
    ply = problem.ply(scene)
    stepper = LoadStepper(ply, scene.conditions, steps, strategies=strategies)
    said, start = "", perf_counter()
    try:
        result = stepper.run()
    except StepError as error:
        result, said = error.result, str(error)
    seconds = perf_counter() - start
    told = scene.summary(result)
    size = float(np.ptp(scene.mesh.p, axis=1).max())
    area = float(ply.basis.dx.sum())
    met = not problem.exact or (
        scene.errors(result)["displacement_error_max"] <= _EXACT * size
    )
    end = End(
        converged=result.converged,
        sound=result.converged and met and is_sound(ply, scene, result.u),
        path_resolved=result.path_resolved,
        energy=float(told["energy"]),
        reactions=np.concatenate(list(result.states[-1].reactions.values())),
        no_energy=problem.E * area * _NO_STRAIN**2,
        no_force=problem.E * size * _ROUND_OFF,
    )
    figures = {key: told[key] for key in _FIGURES}
    return end, figures | {"seconds": seconds, "message": said}


def write(rows: list[Row], folder: Path) -> None:
    """Write every case as CSV, the counts as JSON, and both as a table."""
    with open(folder / "stability.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    (folder / "summary.json").write_text(json.dumps(summary(rows), indent=2) + "\n")
    (folder / "stability.md").write_text(markdown(rows))


def markdown(rows: list[Row]) -> str:
    """A line per family, and a line per problem that was refused or wrong."""
    return f"{_counts(rows)}\n{_failures(rows)}"


def _counts(rows: list[Row]) -> str:
    columns = "cases", *_TITLES, "as 400 steps", "of these not resolved"
    text = [f"| family | {' | '.join(columns)} | solves, 1 step | 20 steps |\n"]
    text += ["|---" * 11, "|\n"]
    families = dict.fromkeys(map(_family, rows))
    some = {family: [r for r in rows if _family(r) == family] for family in families}
    for family, group in (some | {"all": rows}).items():
        n = Counter(row["outcome"] for row in group)
        agreeing = [row for row in group if row["agrees"]]
        counts = [len(group), *(n[kind] for kind in OUTCOMES), len(agreeing)]
        counts.append(sum(not row["path_resolved"] for row in agreeing))
        solves = [_median_solves(group, steps) for steps in (1, 20)]
        text.append(f"| {' | '.join(map(str, [family, *counts, *solves]))} |\n")
    return "".join(text)


def _failures(rows: list[Row]) -> str:
    text = ["| problem | outcome | in steps | up to load factor | because |\n"]
    text += ["|---" * 5, "|\n"]
    bad = [row for row in rows if row["outcome"] in (REFUSED, MISSED, WRONG)]
    for kind in dict.fromkeys(map(_ended, bad)):
        some = [row for row in bad if _ended(row) == kind]
        steps = ", ".join(str(n) for n in STEPS if n in {row["steps"] for row in some})
        reached = [row["load_factor"] for row in some]
        *_, message = some[-1]["message"].partition("; try")[0].split(": ", 2)
        text.append(
            f"| {kind[0]}, {kind[1]}{_seeds(some)} | {kind[2]} | {steps} | "
            f"{min(reached):.3f} to {max(reached):.3f} | {message or '-'} |\n"
        )
    return "".join(text)


def _family(row: Row) -> str:
    """The family; where problems differ in the seed alone, with their kind."""
    family = row["family"]
    return family if row["seed"] is None else f"{family}: {row['kind']}"


def _ended(row: Row) -> tuple[str, str, str]:
    return row["family"], row["kind"], row["outcome"]


def _seeds(rows: list[Row]) -> str:
    seeds = dict.fromkeys(row["seed"] for row in rows if row["seed"] is not None)
    return f", seeds {', '.join(map(str, seeds))}" if seeds else ""


def _median_solves(rows: Iterable[Row], steps: int) -> str:
    solves = [
        row["linear_solves"]
        for row in rows
        if row["steps"] == steps and row["outcome"] in (RIGHT, OTHER)
    ]
    return f"{np.median(solves):g}" if solves else "-"


def draw(rows: list[Row], folder: Path) -> None:
    """Draw `PICTURES`: every case in the colour of its outcome, with its solves.

    Problems that differ in their seed alone share a line: the shares of the outcomes,
    and how many of them are right.
    """
    from ..plot.outcome_table import Cell, outcome_table

    groups: dict[str, dict[str, list[Cell]]] = {}
    for family, kind in dict.fromkeys((row["family"], row["kind"]) for row in rows):
        some = [r for r in rows if (r["family"], r["kind"]) == (family, kind)]
        groups.setdefault(family, {})[kind] = [
            _cell([row for row in some if row["steps"] == steps]) for steps in STEPS
        ]
    outcome_table(
        groups,
        [str(steps) for steps in STEPS],
        _COLOURS,
        "Linear solves, or on how many meshes it is right, by number of load steps",
        folder / "stability.png",
    )


def _cell(rows: list[Row]) -> tuple[dict[str, int], str]:
    """Counts of the outcomes in their order, and what to say of them."""
    n = Counter(row["outcome"] for row in rows)
    if len(rows) > 1:
        said = f"{n[RIGHT] + n[OTHER]}/{len(rows)}"
    else:
        said = "".join(str(row["linear_solves"]) for row in rows if not row["message"])
    return {kind: n[kind] for kind in OUTCOMES if n[kind]}, said
