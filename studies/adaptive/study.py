"""The estimated error against references, and refinement against uniform meshes."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy import ndarray

from skfem_textile import (
    AdaptiveStepper,
    LoadStepper,
    Ply,
    Quadratic,
    Result,
    StepError,
    refine,
)
from skfem_textile.scenes import Scene

from ..common.tables import csv_table
from ..study import Row, Study
from .cases import MOST_UNKNOWNS, TOLERANCE, Case, all_cases
from .tables import estimates, factor, in_words, kinks, tolerances

#: Load steps of the runs that are not timed.
STEPS = 8

# Corners are moved to this share of their distance from the middle, so that one on a
# kink is on the side of its element.  Shear angles that differ by more than the other,
# in radians, are of two sides of a kink.  Chosen: far above rounding.
_INSIDE, _JUMP = 0.99, 1e-6


class Adaptive(Study[Case]):
    """Estimates, tolerances, and position errors at equal unknowns."""

    files = ("adaptive.csv", "estimates.md", "factor.md", "tolerances.md", "kinks.md")
    pictures = ("adaptive.png",)
    sample = "judges, 45°, sheared 20°, E 100000, irregular 8"
    volatile = (*Study.volatile, "cost")

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
        return [row | _of_load(case, scene)]

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

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import draw_errors

        draw_errors(rows, folder / "adaptive.png")


def _of_load(case: Case, scene: Scene) -> Row:
    """Error of the load, and what was estimated."""
    ply, met = case.ply(scene), None
    if case.task == "tolerance":
        stepper = AdaptiveStepper(
            *(ply, scene.conditions, TOLERANCE, STEPS), most_unknowns=MOST_UNKNOWNS
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
        "error": scene.reaction(result.states[-1])[1] / case.reference(scene) - 1,
        "estimate": estimate.load,
        "carried": sum(result.states[-1].shares["energy"].values()),
        "cost": cost,
        "angle_error": scene.errors(result)["shear_angle_error_rms_deg"],
        "angle_estimate": None if angle is None else float(np.degrees(angle)),
        "met": met,
        "seconds": result.wall_time_s,
    }


def _kinks(case: Case, scene: Scene) -> list[Row]:
    """Position errors of uniform meshes, and of those that are finer at kinks."""
    rows, ply = [], case.ply(scene)
    while ply.basis.N <= MOST_UNKNOWNS:
        rows.append(_position(scene, ply, _end(scene, ply)) | {"mesh": "uniform"})
        ply = refine(ply, np.arange(ply.users_mesh.nelements)).ply
    most = max(row["unknowns"] for row in rows)
    fine = _best(
        AdaptiveStepper(
            case.ply(scene), scene.conditions, 1e-6, STEPS, most_unknowns=most
        )
    )
    rows.append(_position(scene, fine.ply, fine.u) | {"mesh": "refined"})
    band = _band(case.ply(scene), scene, most)
    rows.append(_position(scene, band, _end(scene, band)) | {"mesh": "known"})
    along = case.scene_along_fibres()
    ply = case.ply(along, Quadratic())
    rows.append(_position(along, ply, _end(along, ply)) | {"mesh": "along"})
    return rows


def _band(ply: Ply, scene: Scene, most: int) -> Ply:
    """A ply that is refined only in elements that kinks of the exact motion cross."""
    while True:
        corners = ply.users_mesh.p[:, ply.users_mesh.t]
        middle = corners.mean(axis=1, keepdims=True)
        inside = middle + _INSIDE * (corners - middle)
        angles = scene.shear_angle(inside.reshape(2, -1), 1.0).reshape(3, -1)
        area = ply.on_users_elements(ply.basis.dx.sum(axis=1))
        crossed = np.ptp(angles, axis=0) > _JUMP
        large = area > area[crossed].max() / 2
        finer = refine(ply, crossed & large).ply
        if most < finer.basis.N:
            return ply
        ply = finer


def _end(scene: Scene, ply: Ply) -> ndarray:
    """The displacement under the whole load."""
    return LoadStepper(ply, scene.conditions, STEPS).run().u


def _best(stepper: AdaptiveStepper) -> Result:
    """The result, be the tolerance met or not."""
    try:
        return stepper.run()
    except StepError as error:
        return error.result


def _position(scene: Scene, ply: Ply, u: ndarray) -> Row:
    """Position errors in mm, over nodes and over the area."""
    off = ply.nodal(u) - scene.displacement(ply.nodes, 1.0)
    square = (off**2).sum(axis=0)
    in_elements = square[ply.mesh.t].mean(axis=0)
    return {
        "unknowns": ply.basis.N,
        "position_error": np.sqrt(square.mean()),
        "over_area": np.sqrt(np.average(in_elements, weights=ply.basis.dx.sum(axis=1))),
    }


STUDY = Adaptive()
