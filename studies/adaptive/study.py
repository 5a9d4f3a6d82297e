"""The estimated error against references, and refinement against uniform meshes."""

import argparse
from collections.abc import Sequence
from time import perf_counter

import numpy as np

from skfem_textile import AdaptiveStepper, LoadStepper, Result, StepError, refine
from skfem_textile.scenes import Scene

from ..common.tables import csv_table
from ..study import Row, Study
from .cases import MOST_UNKNOWNS, TOLERANCE, Case, all_cases
from .reference import reference
from .tables import estimates, factor, kinks, tolerances


class Adaptive(Study[Case]):
    """Estimates, tolerances, and position errors at equal unknowns."""

    files = ("adaptive.csv", "estimates.md", "factor.md", "tolerances.md", "kinks.md")

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return list(all_cases())

    def name(self, case: Case) -> str:
        return (
            f"{case.task}, {case.degrees:g}°, sheared {case.gamma:g}°, E {case.E:g}, "
            f"{case.mesh} {case.across}"
        )

    def examine(self, case: Case) -> list[Row]:
        """The rows of a case; of kinks one for each mesh."""
        row: Row = {"case": self.name(case), "task": case.task, "degrees": case.degrees}
        scene = case.scene()
        if case.task == "kinks":
            return [row | found for found in _kinks(case, scene)]
        exact = reference(case.degrees, case.E, case.gamma)
        return [row | _of_load(case, scene, exact)]

    def line(self, rows: list[Row]) -> str:
        row = rows[-1]
        if row["task"] == "kinks":
            return f"{row['case']}: {row['position_error']:.4f} mm"
        estimate = row["estimate"]
        said = "none" if estimate is None else f"{estimate:.4f}"
        return f"{row['case']}: error {row['error']:.4f}, estimate {said}"

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {
            "adaptive.csv": csv_table(rows),
            "estimates.md": estimates(rows),
            "factor.md": factor(rows),
            "tolerances.md": tolerances(rows),
            "kinks.md": kinks(rows),
        }


def _of_load(case: Case, scene: Scene, exact: float) -> Row:
    """Error of the load, and what was estimated."""
    ply, met = case.ply(scene), None
    if case.task == "tolerance":
        stepper = AdaptiveStepper(
            *(ply, scene.conditions, TOLERANCE, 8), most_unknowns=MOST_UNKNOWNS
        )
        result: Result = _best(stepper)
        met = result.summary()["tolerance_met"]
    else:
        result = LoadStepper(ply, scene.conditions).run()
    began = perf_counter()
    estimate = result.estimated_error
    cost = (perf_counter() - began) / result.wall_time_s
    angle = estimate.shear_angle
    return {
        "unknowns": result.ply.basis.N,
        "error": scene.reaction(result.states[-1])[1] / exact - 1,
        "estimate": estimate.load,
        "at": estimate.load_factor,
        "cost": cost,
        "angle_error": scene.errors(result)["shear_angle_error_rms_deg"],
        "angle_estimate": None if angle is None else float(np.degrees(angle)),
        "met": met,
        "seconds": result.wall_time_s,
    }


def _kinks(case: Case, scene: Scene) -> list[Row]:
    """Position errors of uniform meshes, and of one that was refined at kinks."""
    rows, ply = [], case.ply(scene)
    while ply.basis.N <= MOST_UNKNOWNS:
        result = LoadStepper(ply, scene.conditions, 8).run()
        rows.append(_position(scene, result) | {"mesh": "uniform"})
        ply = refine(ply, np.arange(ply.users_mesh.nelements)).ply
    most = max(row["unknowns"] for row in rows)
    stepper = AdaptiveStepper(
        case.ply(scene), scene.conditions, 1e-6, 8, most_unknowns=most
    )
    result = _best(stepper)
    return [*rows, _position(scene, result) | {"mesh": "adaptive"}]


def _best(stepper: AdaptiveStepper) -> Result:
    """The result, be the tolerance met or not."""
    try:
        return stepper.run()
    except StepError as error:
        return error.result


def _position(scene: Scene, result: Result) -> Row:
    error = scene.errors(result)["displacement_error_rms"]
    return {"unknowns": result.ply.basis.N, "position_error": error}


STUDY = Adaptive()
