"""Every formulation on every scene: strains, load, position and shear angle.

Each case has its distance from the exact answer of fibres that do not stretch; tables
and a figure show medians.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from skfem_textile import Condition
from skfem_textile.ply import Ply
from skfem_textile.scenes import Scene
from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.stepper import LoadStepper

from ..common.log import errors_only
from ..common.tables import csv_table
from ..study import Row, Study
from . import medians
from .cases import ANGLES, Case, all_cases
from .in_words import in_words
from .tables import TABLES


class Formulations(Study[Case]):
    """Every method on every problem, on finer and finer meshes."""

    files = ("formulations.csv", *(f"{name}.md" for name in TABLES))
    pictures = ("formulations.png",)
    sample = "methods: bias extension, linear, E/G = 2e5, macro, quads, 8 across, 1"

    def cases(self, options: argparse.Namespace) -> list[Case]:
        return list(all_cases())

    def name(self, case: Case) -> str:
        names = f"{case.group}: {case.problem.name}, {case.method.name}"
        return f"{names}, {case.across} across, {case.seed}"

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        case = f"{row['problem']}, {row['method']}, {row['across']} across"
        off = f"load {row['load']:.4g}, {row['position']:.3g} mm, {row['angle']:.3g}°"
        refused = f"; {row['refused']}" if row["refused"] else ""
        return f"{case}, {row['seed']}: {off}{refused}"

    @errors_only()
    def examine(self, case: Case) -> list[Row]:
        """Run one case; its row has nan for numbers that it does not reach."""
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

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {
            "formulations.csv": csv_table(rows),
            **{f"{name}.md": table(rows) for name, table in TABLES.items()},
        }

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import convergence

        convergence(medians.errors(rows), folder / "formulations.png")


STUDY = Formulations()

_FIGURES = (
    *("load", "position", "angle", "strain", "mesh_fibre_strain", "min_det_F"),
    *("negative_pivots", "stabilisation_share", "linear_solves"),
)


def _figures(scene: Scene, result: Result, t: float) -> Row:
    """Figures of the state at the load factor t."""
    reached = [s for s in result.states if s.load_factor <= t + 1e-9]
    if reached[-1].load_factor < t - 1e-9:
        return dict.fromkeys(_FIGURES, np.nan)
    summary: Row = scene.summary(replace(result, states=reached))
    driven = scene.conditions[scene.driven]
    assert isinstance(driven, Condition)
    led = driven.direction  # the force is whole where there is none
    force = np.array([summary["reaction_x"], summary["reaction_y"]])
    values = (
        float(np.linalg.norm(force if led is None else force @ np.asarray(led)))
        if scene.load is None
        else summary["load_over_exact"],
        summary["displacement_error_rms"],
        summary["shear_angle_error_rms_deg"],
        summary["max_fibre_strain"],
        summary["mesh_fibre_strain"],
        summary["min_det_F"],
        summary["negative_pivots"],
        summary["stabilisation_energy"] / summary["energy"],
        sum(state.linear_solves for state in reached),
    )
    return dict(zip(_FIGURES, values, strict=True))


def _loads(scene: Scene, result: Result, steps: int) -> dict[str, float]:
    """The load over the exact one at each of the shear angles, where it is known."""
    ratios = {f"load_{angle}": np.nan for angle in ANGLES}
    if scene.load is None:
        return ratios
    for state in result.states[1:]:
        step = state.load_factor * steps
        if abs(step - round(step)) < 1e-9:
            exact = scene.load(result.ply.fabric.shear_law, state.load_factor)
            angle = ANGLES[round(step) - 1]
            ratios[f"load_{angle}"] = scene.reaction(state)[1] / exact
    return ratios
