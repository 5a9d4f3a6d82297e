"""The curve that a machine would measure, from the states of a run."""

import csv
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...scenes import Scene
from ...solve.result import Result
from ..test_curves import ANGLE, DISPLACEMENT, FORCE, NORMALISED

#: The file of the curve.
CURVE = "curve.csv"


def curve_of(scene: Scene, result: Result) -> dict[str, ndarray]:
    """Columns of the curve by their headings, a row for each state.

    Of a shear test the displacement and force of its machine, the shear angle in
    degrees that the displacement means if no fibre stretches, and the shear force per
    length.  Of another scene the mean displacement and the force of the driven edge
    along the axis along which it moves further.
    """
    moved = np.array([scene.driven_displacement(state) for state in result.states])
    force = np.array([scene.reaction(state) for state in result.states])
    if scene.shear_test is None:
        axis = np.abs(moved).max(axis=0).argmax()
        return {DISPLACEMENT: moved[:, axis], FORCE: force[:, axis]}
    test = scene.shear_test.measured(moved, force)
    return {
        DISPLACEMENT: test.displacement,
        FORCE: test.force,
        ANGLE: np.degrees(test.angle),
        NORMALISED: test.normalised,
    }


def write_curve(curve: dict[str, ndarray], path: Path) -> None:
    """Write the columns of a curve as CSV; a number that is not finite is left out."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(curve)
        for row in zip(*(column.tolist() for column in curve.values()), strict=True):
            writer.writerow([x if np.isfinite(x) else "" for x in row])
