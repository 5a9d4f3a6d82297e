"""Bending stiffness of one fibre family from cantilever tests (Peirce 1930).

A strip with an overhang of length L bends under its weight w per area, so that its
chord is inclined by the angle θ below the horizontal.  For an elastica θ is a function
of w L³/D alone, which is inverted here.  Peirce's formula is D = w L³/8 · cos(θ/2)/tan
θ.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from scipy import special

from ..scenes.elastica import hanging, peirce
from .reading import Format, Recording, read_recordings
from .regression import CONFIDENCE

#: Columns of a test, by the names of `COLUMNS`.
OVERHANG, ANGLE = "overhang", "chord angle"

# Range of chord angles for which an elastica is computed, in radians: below it a
# straight line is within any measurement error, above it the strip hangs vertically.
_SHALLOW, _STEEP = np.radians([0.5, 85.0])

# Smallest and largest w L³/D, covering these angles.
_LEAST, _MOST = 1e-2, 1e3


@dataclass(frozen=True, eq=False)
class CantileverTest:
    """Readings of one strip, or of several nominally identical strips.

    Attributes
    ----------
    name
        Name of the test.
    overhang
        Overhang length in mm, shape (n,).
    angle
        Angle of the chord below the horizontal in radians, shape (n,).
    statements
        Description of the reading.
    """

    name: str
    overhang: ndarray
    angle: ndarray
    statements: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class BendingFit:
    """Bending stiffnesses from cantilever tests.

    Attributes
    ----------
    tests
        The tests.
    weight
        Weight per area in N/mm².
    by_elastica, by_peirce
        Bending stiffness in N·mm of each reading of all tests, shape (n,).
    """

    tests: tuple[CantileverTest, ...]
    weight: float
    by_elastica: ndarray
    by_peirce: ndarray

    @property
    def stiffness(self) -> float:
        """Mean of the elastica values in N·mm."""
        return float(self.by_elastica.mean())

    @property
    def interval(self) -> tuple[float, float]:
        """Confidence interval of the mean (Student's t); infinite for one reading."""
        n = self.by_elastica.size
        if n == 1:
            return -np.inf, np.inf
        deviation = self.by_elastica.std(ddof=1) / np.sqrt(n)
        half = float(special.stdtrit(n - 1, 0.5 + 0.5 * CONFIDENCE) * deviation)
        return self.stiffness - half, self.stiffness + half


def read_cantilever(
    path: str | os.PathLike[str],
    angle: float | None = None,
    form: Format | None = None,
) -> list[CantileverTest]:
    """Tests of a file or folder with the columns ``overhang`` and ``chord angle``.

    Parameters
    ----------
    path
        The file or folder, see `read_recordings`.
    angle
        Angle of every chord in radians, for a file without that column, as for an
        instrument with a fixed inclined plane.
    form
        Properties of the file that take precedence over its content.

    Raises
    ------
    ValueError
        If the file or a reading is not valid.
    OSError
        If it cannot be read.
    """
    return [_test(one, angle) for one in read_recordings(path, form)]


def _test(recording: Recording, angle: float | None) -> CantileverTest:
    name, needed = recording.name, {OVERHANG} | {ANGLE} & set(recording.columns)
    read = recording.complete(*needed)
    columns = read.columns
    if (ANGLE in columns) == (angle is not None):
        raise ValueError(
            f"{name}: chord angles must be given either in the column {ANGLE!r} or as "
            "one angle for all readings"
        )
    overhang = columns[OVERHANG]
    angles = columns[ANGLE] if angle is None else np.full(overhang.shape, angle)
    if not (overhang > 0).all():
        raise ValueError(
            f"{name}: every overhang must be positive, got {overhang.min():g} mm"
        )
    if not ((angles >= _SHALLOW) & (angles <= _STEEP)).all():
        low, high = np.degrees([_SHALLOW, _STEEP])
        raise ValueError(
            f"{name}: every chord angle must be between {low:g} and {high:g} degrees, "
            f"got angles from {np.degrees(angles.min()):g} to "
            f"{np.degrees(angles.max()):g} degrees"
        )
    return CantileverTest(name, overhang, angles, read.statements)


def fit_bending(tests: Sequence[CantileverTest], weight: float) -> BendingFit:
    """Bending stiffness of strips, by the elastica and by Peirce's formula.

    Parameters
    ----------
    tests
        The tests.
    weight
        Weight per area in N/mm².

    Raises
    ------
    ValueError
        If there is no test, or the weight is not positive.

    Examples
    --------
    >>> test = CantileverTest("strip", np.array([200.0]), np.radians([41.487]))
    >>> found = fit_bending([test], 6e-6)
    >>> round(found.stiffness, 2), round(float(found.by_peirce[0]), 2)
    (6.0, 6.35)
    """
    if not tests:
        raise ValueError("no cantilever test is given")
    if not 0 < weight < np.inf:
        raise ValueError(f"the weight must be a positive number, got {weight:g} N/mm2")
    overhang = np.concatenate([test.overhang for test in tests])
    angle = np.concatenate([test.angle for test in tests])
    load = np.array([weight_number(float(one)) for one in angle])
    by_peirce = peirce(overhang, weight, angle)
    return BendingFit(tuple(tests), weight, weight * overhang**3 / load, by_peirce)


def weight_number(angle: float) -> float:
    """Load parameter w L³/D of an elastica with a given chord angle in radians."""
    from scipy.optimize import brentq

    def off(logarithm: float) -> float:
        return hanging(float(np.exp(logarithm))).chord_angle - angle

    return float(np.exp(brentq(off, np.log(_LEAST), np.log(_MOST), xtol=1e-9)))
