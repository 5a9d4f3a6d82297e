"""Machine curve (force against displacement) of a run."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy import ndarray

from ..mesh.user_input import printable
from ..scenes import Scene
from ..scenes.shear_test import ShearTest
from ..solve.result import Result
from ..solve.states import State

#: Headings of the columns.
DISPLACEMENT, FORCE = "displacement (mm)", "force (N)"
HALF_WIDTH = "half-width of the force (N)"
LOW, HIGH = "lowest force of the samples (N)", "highest force of the samples (N)"
ANGLE, NORMALISED = "angle (deg)", "normalised shear force (N/mm)"

# Headings of the columns of a recording, and factors from their units.
_HEADINGS = {
    "displacement": (DISPLACEMENT, 1.0),
    "shear angle": (ANGLE, 180 / np.pi),
    "force": (FORCE, 1.0),
    "half-width of the force": (HALF_WIDTH, 1.0),
    "normalised shear force": (NORMALISED, 1.0),
    "lowest force of the samples": (LOW, 1.0),
    "highest force of the samples": (HIGH, 1.0),
}


def read_test_curve(path: str | os.PathLike[str]) -> dict[str, ndarray]:
    """Read the columns of a test curve by heading.

    The file contains one test, see `calibration.read_recordings`, with at least one
    displacement or angle, and at least one force.  Cells may be empty.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    dict
        Numbers of each column in the file, shape (n,); NaN for empty cells.

    Raises
    ------
    ValueError
        If the file is invalid; one line names the file and the row.
    OSError
        If it cannot be read.
    """
    from ..calibration.reading import Format, read_recordings

    form = Format(signs=dict.fromkeys(_HEADINGS, 1))  # as recorded, like a run
    columns, *others = [one.columns for one in read_recordings(path, form)]
    if others:
        raise ValueError(
            f"{printable(path)}: the file contains {1 + len(others)} tests: keep one"
        )
    curve = {
        heading: columns[name] * factor
        for name, (heading, factor) in _HEADINGS.items()
        if name in columns
    }
    if not ({DISPLACEMENT, ANGLE} & set(curve) and {FORCE, NORMALISED} & set(curve)):
        raise ValueError(
            f"{printable(path)}: the headings must name a displacement or an angle, "
            "and a force, such as "
            f"{' and '.join(map(repr, (DISPLACEMENT, FORCE)))}"
        )
    if len(next(iter(curve.values()))) < 2:
        raise ValueError(
            f"{printable(path)}: a curve requires at least two rows of numbers"
        )
    return curve


#: Columns of a curve by heading.
Curve: TypeAlias = Mapping[str, ndarray]

#: File of the curve.
CURVE = "curve.csv"


def curve_of(scene: Scene, result: Result) -> dict[str, ndarray]:
    """Columns of the curve by heading, one row per state.

    Displacement and force (`Scene.driven_curve`); for a shear test also the theoretical
    shear angle in degrees (inextensible fibres), and the normalised shear force.  The
    half-width of the force follows from the error interval of each state and is nan
    where there is none; there is no such column if no state has one.
    """
    half = np.array([_relative_half_width(result, state) for state in result.states])
    displacement, pull = scene.driven_curve(result)
    curve = {DISPLACEMENT: displacement, FORCE: pull}
    if not np.isnan(half[1:]).all():
        curve[HALF_WIDTH] = half * np.abs(pull)
    return completed(curve, scene.shear_test)


def _relative_half_width(result: Result, state: State) -> float:
    """Half-width of the load of a state; zero for the ply at rest."""
    last = state is result.states[-1]
    half = (result.error if last else result.interval(state)).load
    return 0.0 if state.load_factor == 0 else np.nan if half is None else half


def completed(curve: Curve, test: ShearTest | None) -> dict[str, ndarray]:
    """Add missing columns that follow from others.

    Parameters
    ----------
    curve
        Columns by heading.
    test
        The shear test; None for another scene.
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


def write_curve(curve: Curve, path: Path) -> None:
    """Write the columns of a curve as CSV; see `word_of`."""
    from ..io.file_numbers import word_of, write_table

    rows = zip(*(column.tolist() for column in curve.values()), strict=True)
    write_table(path, curve, (map(word_of, row) for row in rows))
