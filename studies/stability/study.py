"""Stiff and extreme cases: which end right, which are refused, and which wrong.

Every problem of `problems` is loaded in 1, 2, 5, 20 and 100 steps, and for comparison
in 400.  A run ends as

- *right*: on a stable, unfolded equilibrium, with the energy and the reactions that 400
  steps reach, to 1 %; if the mesh can represent the exact motion, on that motion;
- *on another equilibrium, and reported*: on a stable, unfolded equilibrium with other
  energies or reactions, if the run itself says that its path was not resolved;
- *refused*: with an error;
- *refused though solvable*: with an error, if another run of the same formulation,
  in other steps or by another method, finds a stable, unfolded equilibrium;
- *wrong*: on anything else.

`soundness` judges by dense algebra, independently of the load stepper, whether a state
is a stable, unfolded equilibrium.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter

import numpy as np

from skfem_textile.solve.result import StepError
from skfem_textile.solve.stepper import LoadStepper

from ..common.log import errors_only
from ..common.tables import csv_table
from ..study import Row, Study
from .outcomes import End, outcome
from .problems import Extreme, extremes
from .soundness import is_sound
from .tables import in_words, markdown

STEPS = (1, 2, 5, 20, 100)
_REFERENCE = 400

# Another method, for a problem that is refused in any number of steps.
_OTHER = "plain"

# Fibre strains of which energies are nothing, and such that round-off makes.
_NO_STRAIN, _ROUND_OFF = 1e-10, 1e-13

# Share of the size of the ply by which nodes may be off an exact motion.
_EXACT = 1e-8

# The reported entries of a run's summary.
_FIGURES = (
    *("energy", "corners_energy", "min_det_F", "mesh_fibre_strain"),
    *("displacement_error_rms", "load_factor", "steps_cut"),
    *("linear_solves", "factorisations"),
)


class Stability(Study[Extreme]):
    """Every problem in few and in many steps, each run with its outcome."""

    files = ("stability.csv", "stability.md")
    pictures = ("outcomes.png", "outcomes.svg")
    sample = "folding, trellis, G = 0, one point, seed 2"

    def cases(self, options: argparse.Namespace) -> list[Extreme]:
        return extremes()

    def name(self, case: Extreme) -> str:
        return f"{case.family}, {case.name}"

    def line(self, rows: list[Row]) -> str:
        outcomes = " ".join(f"{row['steps']}:{row['outcome']}" for row in rows)
        return f"{rows[0]['family']}, {rows[0]['problem']:40} {outcomes}"

    @errors_only()
    def examine(self, case: Extreme) -> list[Row]:
        """The runs of one problem in `STEPS`, each with its outcome."""
        runs = {steps: _run(case, steps) for steps in (*STEPS, _REFERENCE)}
        reference, _ = runs[_REFERENCE]
        solved_by = _solved_by(case, runs)
        rows = []
        for steps in STEPS:
            end, figures = runs[steps]
            both = end.converged and reference.converged
            head = {
                "family": case.family,
                "problem": case.name,
                "kind": case.kind,
                "seed": case.seed,
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

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {
            "stability.csv": csv_table(rows),
            "stability.md": markdown(rows, STEPS),
        }

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import draw_outcomes

        for name in self.pictures:
            draw_outcomes(rows, folder / name)


STUDY = Stability()


def _solved_by(problem: Extreme, runs: Mapping[int, tuple[End, Row]]) -> str:
    """The first run that ends soundly; if none does, the first by another method."""
    for steps, (end, _) in runs.items():
        if end.sound:
            return f"newton in {steps}"
    for steps in runs:
        end, _ = _run(problem, steps, _OTHER)
        if end.sound:
            return f"{_OTHER} in {steps}"
    return ""


def _run(problem: Extreme, steps: int, method: str = "newton") -> tuple[End, Row]:
    """One run: how it ended, and its figures."""
    scene = problem.scene()
    ply = problem.ply(scene)
    stepper = LoadStepper(ply, scene.conditions, steps, method=method)
    message, start = "", perf_counter()
    try:
        result = stepper.run()
    except StepError as error:
        result, message = error.result, str(error)
    seconds = perf_counter() - start
    summed_up = scene.summary(result)
    size = float(np.ptp(scene.mesh.p, axis=1).max())
    area = float(ply.basis.dx.sum())
    last = result.states[-1]
    met = not problem.exact or (
        scene.errors(result)["displacement_error_max"] <= _EXACT * size
    )
    end = End(
        converged=result.converged,
        sound=result.converged
        and met
        and is_sound(ply, scene, last.u, last.parameters),
        path_resolved=result.path_resolved,
        energy=float(summed_up["energy"]),
        reactions=np.concatenate(list(last.reactions.values())),
        no_energy=problem.E * area * _NO_STRAIN**2,
        no_force=problem.E * size * _ROUND_OFF,
    )
    figures = {key: summed_up[key] for key in _FIGURES}
    return end, figures | {"seconds": seconds, "message": message}
