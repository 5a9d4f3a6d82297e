"""The bias extension with five laws: how far the load is from a converged one.

The references are quadratic triangles along the fibres, as in the study of angles.  The
default formulation is judged on irregular quadrilaterals and on Delaunay's triangles.
"""

import argparse
from pathlib import Path

import numpy as np

from skfem_textile.ply import Ply
from skfem_textile.solve.result import StepError
from skfem_textile.solve.stepper import LoadStepper

from ..common.log import warnings_collected
from ..common.tables import csv_table
from ..study import Row, Study
from .cases import Case, all_cases
from .tables import in_words, judged, references


class Laws(Study[Case]):
    """Every material with every method."""

    files = ("laws.csv", "references.md", "judged.md")
    pictures = ("laws.png",)
    sample = "linear: default, quads, 16 across, 1"

    def cases(self, options: argparse.Namespace) -> list[Case]:
        return list(all_cases())

    def name(self, case: Case) -> str:
        seed = f", {case.seed}" if case.seed else ""
        return f"{case.material.name}: {case.method.name}, {case.across} across{seed}"

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        case = f"{row['material']}: {row['method']}, {row['across']} across"
        end = row["refused"] or f"{row['load']:.3f} N, {row['linear_solves']} solves"
        return f"{case}, {row['seed']}: {end}, {row['seconds']:.1f} s"

    def examine(self, case: Case) -> list[Row]:
        """Run one case; the load of a run that is refused is nan."""
        scene, refused = case.scene(), ""
        ply = Ply(scene.mesh, case.material.fabric(scene), case.method.formulation)
        with warnings_collected() as warnings:
            try:
                result = LoadStepper(ply, scene.conditions, case.method.steps).run()
                load = float(scene.reaction(result.states[-1])[1])
            except StepError as error:
                result, refused, load = error.result, str(error), np.nan
        row = {
            "group": case.group,
            "material": case.material.name,
            "method": case.method.name,
            "across": case.across,
            "seed": case.seed,
            "steps": case.method.steps,
            "unknowns": ply.basis.N,
            "load": load,
            "linear_solves": result.linear_solves,
            "seconds": result.wall_time_s,
            "warnings": " | ".join(warnings),
            "refused": refused,
        }
        return [row]

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {
            "laws.csv": csv_table(rows),
            "references.md": references(rows),
            "judged.md": judged(rows),
        }

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import draw_errors

        draw_errors(rows, folder / "laws.png")


STUDY = Laws()
