"""Every formulation on every scene: strains, load, position and shear angle.

The cases of `comparison`, each with its distance from the exact answer of fibres that
do not stretch, and tables and a figure of their medians.
"""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..ply import Ply
from ..scenes import Scene
from ..solve.result import Result, StepError
from ..solve.stepper import LoadStepper
from . import comparison, findings, tables
from .comparison import ANGLES, Case
from .quiet import quiet

#: Written by `write` and by `draw`.
FILES = ("formulations.csv", "summary.json", *(f"{name}.md" for name in tables.TABLES))
PICTURES = ("formulations.png",)

Row = dict[str, Any]


def cases() -> list[Case]:
    """The cases, in the order of the report."""
    return list(comparison.cases())


def name(case: Case) -> str:
    """A name that no other case has."""
    names = f"{case.group}: {case.problem.name}, {case.method.name}"
    return f"{names}, {case.across} across, {case.seed}"


def line(rows: list[Row]) -> str:
    """One result, on one line."""
    (row,) = rows
    case = f"{row['problem']}, {row['method']}, {row['across']} across, {row['seed']}"
    off = f"load {row['load']:.4g}, {row['position']:.3g} mm, {row['angle']:.3g}°"
    return f"{case}: {off}" + (f"; {row['refused']}" if row["refused"] else "")


@quiet()
def examined(case: Case) -> list[Row]:
    """One case with its result, a row; numbers that it does not reach are nan."""
    problem, scene, refused = case.problem, case.scene(), ""
    formulation = case.method.formulation(problem.stabilisation)
    ply = Ply(scene.mesh, problem.fabric(scene), formulation)
    try:
        result = LoadStepper(ply, scene.conditions, problem.steps).run()
    except StepError as error:
        result, refused = error.result, str(error)
    row = {
        "group": case.group,
        "problem": problem.name,
        "method": case.method.name,
        "across": case.across,
        "seed": case.seed,
        "elements": ply.mesh.nelements,
        "unknowns": ply.basis.N,
        **_figures(scene, result, problem.last / problem.steps),
        **_loads(scene, result, problem.steps),
        "seconds": result.wall_time_s,
        "refused": refused,
    }
    return [row]


_FIGURES = (
    *("load", "position", "angle", "strain", "mesh_fibre_strain", "min_det_F"),
    *("negative_pivots", "stabilisation_share", "linear_solves"),
)


def _figures(scene: Scene, result: Result, t: float) -> Row:
    """Figures of the state at the load factor t."""
    reached = [s for s in result.states if s.load_factor <= t + 1e-9]
    if reached[-1].load_factor < t - 1e-9:
        return dict.fromkeys(_FIGURES, np.nan)
    found: Row = scene.summary(replace(result, states=reached))
    led = scene.conditions[scene.driven].direction  # whole where there is none
    force = np.array([found["reaction_x"], found["reaction_y"]])
    values = (
        float(np.linalg.norm(force if led is None else force @ np.asarray(led)))
        if scene.load is None
        else found["load_over_exact"],
        found["displacement_error_rms"],
        found["shear_angle_error_rms_deg"],
        found["max_fibre_strain"],
        found["mesh_fibre_strain"],
        found["min_det_F"],
        found["negative_pivots"],
        found["stabilisation_energy"] / found["energy"],
        sum(state.linear_solves for state in reached),
    )
    return dict(zip(_FIGURES, values, strict=True))


def _loads(scene: Scene, result: Result, steps: int) -> dict[str, float]:
    """The load over the exact one at each of the shear angles, where it is known."""
    at = {f"load_{angle}": np.nan for angle in ANGLES}
    if scene.load is None:
        return at
    for state in result.states[1:]:
        step = state.load_factor * steps
        if abs(step - round(step)) < 1e-9:
            exact = scene.load(result.ply.fabric.shear_law, state.load_factor)
            at[f"load_{ANGLES[round(step) - 1]}"] = scene.reaction(state)[1] / exact
    return at


def write(rows: list[Row], folder: Path) -> None:
    """Write every case as CSV, counts as JSON, and the tables."""
    with open(folder / "formulations.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    found = json.dumps(findings.findings(rows), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(found + "\n")
    for name, table in tables.TABLES.items():
        (folder / f"{name}.md").write_text(table(rows))


def draw(rows: list[Row], folder: Path) -> None:
    """Draw `PICTURES`: errors against unknowns."""
    from ..plot.convergence import convergence

    convergence(findings.errors(rows), folder / "formulations.png")
