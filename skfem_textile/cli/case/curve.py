"""The curve that a machine would measure, from the states of a run."""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy import ndarray

from ...scenes import Scene
from ...scenes.shear_test import ShearTest
from ...solve.result import Result
from ..results.curves_of_tests import ANGLE, DISPLACEMENT, FORCE, NORMALISED

#: Columns of a curve by their headings.
Curve: TypeAlias = Mapping[str, ndarray]

#: The file of the curve.
CURVE = "curve.csv"


def curve_of(scene: Scene, result: Result) -> dict[str, ndarray]:
    """Columns of the curve by their headings, a row for each state.

    Of a shear test the displacement and force of its machine, the shear angle in
    degrees that the displacement means if no fibre stretches, and the shear force per
    length.  Of another scene the mean displacement and the force of the driven edge
    along the axis along which it moves further.

    A force is 0 where it is below what nodes in balance may leave of it.
    """
    moved = np.array([scene.driven_displacement(state) for state in result.states])
    force = np.array([scene.reaction(state) for state in result.states])
    left = np.array([state.tolerance for state in result.states])
    force[np.abs(force) <= result.ply.nodes.shape[1] * left[:, None]] = 0.0
    if scene.shear_test is None:
        axis = np.abs(moved).max(axis=0).argmax()
        return {DISPLACEMENT: moved[:, axis], FORCE: force[:, axis]}
    displacement, pull = scene.shear_test.measured(moved, force)
    return completed({DISPLACEMENT: displacement, FORCE: pull}, scene.shear_test)


def completed(curve: Curve, test: ShearTest | None) -> dict[str, ndarray]:
    """A curve with the columns that follow from others, where it lacks them.

    Parameters
    ----------
    curve
        Columns by their headings.
    test
        The test that it is of; None if it is of none.
    """
    curve = dict(curve)
    if test is None:
        return curve
    if ANGLE not in curve and DISPLACEMENT in curve:
        curve[ANGLE] = np.degrees(test.shear_angle(curve[DISPLACEMENT]))
    if NORMALISED not in curve and FORCE in curve:
        angle = np.radians(curve[ANGLE])
        curve[NORMALISED] = test.normalised(angle, curve[FORCE])
    return curve


def write_curve(curve: dict[str, ndarray], path: Path) -> None:
    """Write the columns of a curve as CSV; see `word_of`."""
    from ...io.file_numbers import word_of  # loads meshio

    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(curve)
        for row in zip(*(column.tolist() for column in curve.values()), strict=True):
            writer.writerow(map(word_of, row))
