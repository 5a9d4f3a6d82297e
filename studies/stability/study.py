"""Stiff and extreme cases: counts of right, refused and wrong results.

Each problem of `problems` is loaded in 1, 2, 5, 20 and 100 steps, and for comparison in
400; if that run stops, with another sound run, that with most steps.  The outcome of a
run is

- *right*: a stable equilibrium without inverted elements, whose energy and reactions
  agree with the run in 400 steps to 1 %, and with the exact solution if the mesh can
  represent it;
- *on another equilibrium, and reported*: a stable equilibrium without inverted
  elements, with other energies or reactions, if the run reports an unresolved path;
- *refused*: an error;
- *refused though solvable*: an error, if another run of the same formulation, in other
  steps or by another method, finds a stable equilibrium without inverted elements;
- *wrong*: anything else.

`soundness` verifies states by dense linear algebra, independently of the load stepper.
"""

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile.solve.stepper import LoadStepper

from ..common.figures import File, figure_of
from ..common.running import errors_only, run
from ..common.tables import grouped, having, markdown_table, span
from ..study import Part, Row, Study
from .problems import Extreme, extremes
from .soundness import is_sound

RIGHT, OTHER = "right", "on another equilibrium, and reported"
REFUSED, MISSED = "refused", "refused though solvable"
WRONG = "wrong"

#: The outcomes in report order, with their names in the results for prose.
OUTCOMES = {
    RIGHT: "right",
    OTHER: "other",
    REFUSED: "refused",
    MISSED: "missed",
    WRONG: "wrong",
}

STEPS = (1, 2, 5, 20, 100)
_REFERENCE = 400

# Alternative method for problems refused in any number of steps.
_OTHER = "plain"

# Fibre strains with negligible energy, and due to round-off.
_NO_STRAIN, _ROUND_OFF = 1e-10, 1e-13

# Tolerance of positions against the exact solution, relative to the size of the ply.
_EXACT = 1e-8

# The reported entries of a run's summary.
_FIGURES = (
    *("energy", "corners_energy", "min_det_F", "mesh_fibre_strain"),
    *("displacement_error_rms", "load_factor", "steps_cut"),
    *("linear_solves", "factorisations"),
)

# Relative tolerance of energies and reactions for equal states.
_SAME = 0.01


# Colours of the outcomes: dark to light for sound runs, warm for failures.
_COLOURS = "#0072B2", "#9CCBE8", "#F0C04A", "#CC79A7", "#D55E00"

# Font size in points; figure width and bar height in inches.
_FONT, _WIDTH, _BAR = 9, 6.3, 0.24


@dataclass(frozen=True, eq=False)
class End:
    """Final state of a run.

    Attributes
    ----------
    converged
        True if the run reached full load.
    sound
        True if the final state is a stable equilibrium at full load without inverted
        elements, and agrees with the exact solution if the mesh can represent it.
    path_resolved
        False if the run reports that more steps may lead to another equilibrium.
    energy, reactions
        Energy in N·mm, and all components of the forces on all conditions in N.
    no_energy, no_force
        Round-off of energy and forces.
    """

    converged: bool
    sound: bool
    path_resolved: bool
    energy: float
    reactions: ndarray
    no_energy: float
    no_force: float

    def energy_off(self, other: "End") -> float:
        """Difference of the energies relative to the larger one."""
        return _relative_error([self.energy], [other.energy], other.no_energy)

    def reactions_off(self, other: "End") -> float:
        """Largest difference of reaction components relative to the largest one."""
        return _relative_error(self.reactions, other.reactions, other.no_force)

    def agrees(self, reference: "End") -> bool:
        """Return True if both runs have the same sound final state."""
        return (
            self.sound
            and reference.sound
            and self.energy_off(reference) <= _SAME
            and self.reactions_off(reference) <= _SAME
        )


def outcome(end: End, reference: End, solvable: bool) -> str:
    """Outcome of a case, one of `OUTCOMES`.

    Parameters
    ----------
    end
        End of the run.
    reference
        End of the other run with most steps of those that are sound, if any is.
    solvable
        True if any run of the same problem has a sound final state.
    """
    if not end.converged:
        return MISSED if solvable else REFUSED
    if not end.sound:
        return WRONG
    if end.agrees(reference):
        return RIGHT
    return WRONG if end.path_resolved else OTHER


def _relative_error(ours: Any, theirs: Any, nothing: float) -> float:
    """Largest difference relative to the largest magnitude; 0 within ``nothing``."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    difference = float(np.abs(ours - theirs).max())
    if difference <= nothing:
        return 0.0
    return difference / float(np.abs([ours, theirs]).max())


@errors_only()
def examined(problem: Extreme) -> list[Row]:
    """The runs of one problem in `STEPS`, each with its outcome."""
    runs = {steps: _run(problem, steps) for steps in (*STEPS, _REFERENCE)}
    solved_by = _solved_by(problem, runs)
    rows = []
    for steps in STEPS:
        end, figures = runs[steps]
        others = [other for n, (other, _) in runs.items() if n != steps and other.sound]
        reference = others[-1] if others else runs[_REFERENCE][0]
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
    """The first sound run; if there is none, the first by the alternative method."""
    for steps, (end, _) in runs.items():
        if end.sound:
            return f"newton in {steps}"
    for steps in runs:
        end, _ = _run(problem, steps, _OTHER)
        if end.sound:
            return f"{_OTHER} in {steps}"
    return ""


def _run(problem: Extreme, steps: int, method: str = "newton") -> tuple[End, Row]:
    """Final state and results of a run."""
    scene = problem.scene()
    ply = problem.ply(scene)
    stepper = LoadStepper(ply, scene.conditions, steps, method=method)
    start = perf_counter()
    result, message = run(stepper)
    seconds = perf_counter() - start
    summed_up = scene.summary(result)
    size = float(np.ptp(scene.mesh.p, axis=1).max())
    area = float(ply.basis.dx.sum())
    last = result.states[-1]
    accurate = not problem.exact or (
        scene.errors(result)["displacement_error_max"] <= _EXACT * size
    )
    end = End(
        converged=result.converged,
        sound=result.converged
        and accurate
        and is_sound(ply, scene, last.u, last.parameters),
        path_resolved=result.path_resolved,
        energy=float(summed_up["energy"]),
        reactions=np.concatenate(list(last.forces.values())),
        no_energy=problem.E * area * _NO_STRAIN**2,
        no_force=problem.E * size * _ROUND_OFF,
    )
    figures = {key: summed_up[key] for key in _FIGURES}
    return end, figures | {"seconds": seconds, "message": message}


def counts(rows: list[Row]) -> str:
    """A line for each family."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        # Problems that differ only in the seed share a separate line.
        kind = "" if row["seed"] is None else f": {row['kind']}"
        groups.setdefault(row["family"] + kind, []).append(row)
    lines = []
    for family, group in (groups | {"all": rows}).items():
        n = Counter(row["outcome"] for row in group)
        right = having(group, outcome=RIGHT)
        unresolved = sum(not row["path_resolved"] for row in right)
        solves = [_median_solves(group, steps) for steps in (1, 20)]
        numbers = [len(group), *(n[kind] for kind in OUTCOMES), unresolved]
        lines.append([family, *numbers, *solves])
    head = ["family (E, G, C_s in N/mm)", "cases", "right"]
    head += ["on another equilibrium, reported", "refused"]
    head += ["refused though solvable", "wrong", "right, path not resolved"]
    return markdown_table([*head, "solves, 1 step", "20 steps"], lines)


def failures(rows: list[Row]) -> str:
    """A line for each problem with refused or wrong runs."""
    failed = [row for row in rows if row["outcome"] in (REFUSED, MISSED, WRONG)]
    lines = []
    for key, group in grouped(failed, "family", "kind", "outcome").items():
        family, kind, outcome = key
        seeds = dict.fromkeys(row["seed"] for row in group if row["seed"] is not None)
        of_seeds = f", seeds {', '.join(map(str, seeds))}" if seeds else ""
        run_in = {row["steps"] for row in group}
        *_, message = group[-1]["message"].partition("; try")[0].split(": ", 2)
        lines.append(
            [
                f"{family}, {kind}{of_seeds}",
                outcome,
                ", ".join(str(n) for n in STEPS if n in run_in),
                span((row["load_factor"] for row in group), ".3f"),
                message or "-",
            ]
        )
    head = ["problem (E, G, C_s in N/mm)", "outcome", "steps"]
    head += ["last load factor", "reason"]
    return markdown_table(head, lines)


def _median_solves(rows: Iterable[Row], steps: int) -> str:
    solves = [
        row["linear_solves"]
        for row in rows
        if row["steps"] == steps and row["outcome"] in (RIGHT, OTHER)
    ]
    return f"{np.median(solves):g}" if solves else "-"


def in_words(rows: list[Row]) -> dict[str, str]:
    """Counts of runs, problems and outcomes."""
    return {
        "cases": str(len(rows)),
        "problems": str(len(grouped(rows, "family", "problem"))),
        **{name: str(len(having(rows, outcome=x))) for x, name in OUTCOMES.items()},
    }


def draw_outcomes(rows: Sequence[Row], file: File = None) -> Any:
    """Draw a bar for each family of problems, with its numbers of runs."""
    families = {
        family: Counter(row["outcome"] for row in group)
        for family, group in grouped(rows, "family").items()
    }
    totals = sum(families.values(), Counter[str]())
    with figure_of((_WIDTH, _BAR * (len(families) + 5)), file, _FONT) as figure:
        axes = figure.add_subplot()
        for y, counts in enumerate(families.values()):
            start = 0
            for kind, colour in zip(OUTCOMES, _COLOURS, strict=True):
                axes.barh(y, counts[kind], left=start, color=colour, height=0.75)
                start += counts[kind]
        axes.set_yticks(range(len(families)), list(families))
        axes.invert_yaxis()
        axes.set_xlabel("Runs")
        axes.spines["left"].set_visible(False)
        axes.tick_params(axis="y", length=0)
        for kind, colour in zip(OUTCOMES, _COLOURS, strict=True):
            axes.barh(0, 0, color=colour, label=f"{kind}: {totals[kind]}")
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


class Stability(Study[Extreme]):
    """All problems in few and in many steps, with the outcome of each run."""

    parts = (
        Part(
            "stability.csv",
            {"stability.md": lambda rows: f"{counts(rows)}\n{failures(rows)}"},
            {"outcomes.png": draw_outcomes, "outcomes.svg": draw_outcomes},
        ),
    )
    shown = "{steps}:{outcome}"
    sample = "folding, trellis, G = 0, one point, seed 2"

    def cases(self, options: argparse.Namespace) -> list[Extreme]:
        return extremes()

    def examine(self, case: Extreme) -> list[Row]:
        return examined(case)

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)


STUDY = Stability()
