"""Bending of one fibre family: cantilever tests (Peirce 1930), and measured moments.

A strip with an overhang of length L bends under its weight w per area, so that its
chord is inclined by the angle θ below the horizontal.  For an elastica θ is a function
of w L³/D alone, which is inverted here.  Peirce's formula is D = w L³/8 · cos(θ/2)/tan
θ.  For a bending law, the stiffness of each reading belongs to the elastica with the
same chord angle.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
import scipy  # whose modules are imported on first use
from numpy import ndarray

from ..fabric.law import Law
from ..scenes.elastica import chord_angles, drooping, hanging, peirce
from .measured import FAMILIES, MeasuredTest
from .preparing import Preparation, Prepared, prepare
from .reading import Format, Recording, read_recordings

#: Columns of a test, by the names of `COLUMNS`.
OVERHANG, ANGLE = "overhang", "chord angle"
CURVATURE, MOMENT = "curvature", "bending moment"

# Range of chord angles for which an elastica is computed, in radians: below it a
# straight line is within any measurement error, above it the strip hangs vertically.
_SHALLOW, _STEEP = np.radians([0.5, 85.0])

# Smallest and largest w L³/D, covering these angles.
_LEAST, _MOST = 1e-2, 1e3

# Weight in N/mm² of 1 g/m², and an upper bound for fabrics: of 100 kg/m².
_GRAVITY = 9.80665e-9
_MOST_WEIGHT = 1e5 * _GRAVITY


@dataclass(frozen=True, eq=False)
class CantileverTest(MeasuredTest):
    """Readings of one strip, or of several nominally identical strips.

    Attributes
    ----------
    overhang
        Overhang length in mm, shape (n,).
    angle
        Angle of the chord below the horizontal in radians, shape (n,).
    weight
        Weight per area in N/mm².
    family
        Fibre family along the strips, ``warp`` or ``weft``.

    Raises
    ------
    ValueError
        If the weight is not positive.

    Examples
    --------
    >>> test = CantileverTest("strip", np.array([200.0]), np.radians([41.487]), 6e-6)
    >>> test.by_elastica.round(2), test.by_peirce.round(2)
    (array([6.]), array([6.35]))
    """

    overhang: ndarray
    angle: ndarray
    weight: float
    family: str = "warp"

    def __post_init__(self) -> None:
        if not 0 < self.weight < np.inf:
            raise ValueError(
                f"the weight must be a positive number, got {self.weight:g} N/mm2"
            )

    @property
    def parts(self) -> tuple[str, ...]:
        """See `MeasuredTest.parts`."""
        return (f"bending {self.family}",)

    @cached_property
    def by_elastica(self) -> ndarray:
        """Bending stiffness in N·mm of each reading, (n,)."""
        load = np.array([weight_number(float(one)) for one in self.angle])
        return self.weight * self.overhang**3 / load

    @property
    def curvature(self) -> ndarray:
        """Curvature at the clamp of the elastica of each reading in 1/mm, (n,)."""
        logarithm = np.log(self.weight * self.overhang**3 / self.by_elastica)
        found: ndarray = _unit_elasticas().curvature(logarithm) / self.overhang
        return found

    def apparent(self, law: Law) -> ndarray:
        """Stiffness in N·mm of elasticas with the chord angles of a law, (n,)."""
        elasticas = _unit_elasticas()
        angle = chord_angles(law.tangent, self.overhang, self.weight)
        angle = np.clip(angle, *elasticas.angles)
        load = np.exp(elasticas.logarithm(angle))
        stiffness: ndarray = self.weight * self.overhang**3 / load
        return stiffness

    @property
    def by_peirce(self) -> ndarray:
        """Bending stiffness in N·mm of each reading by Peirce's formula, (n,)."""
        return peirce(self.overhang, self.weight, self.angle)


def read_cantilever(
    path: str | os.PathLike[str],
    weight: float,
    family: str = "warp",
    angle: float | None = None,
    form: Format | None = None,
) -> list[CantileverTest]:
    """Tests of a file or folder with the columns ``overhang`` and ``chord angle``.

    Parameters
    ----------
    path, form
        See `read_recordings`, with its errors.
    weight, family
        See `CantileverTest`.
    angle
        Angle of every chord in radians, for a file without that column, as for an
        instrument with a fixed inclined plane.

    Raises
    ------
    ValueError
        If a reading is not valid, or the weight is above 100 kg/m².
    """
    if weight > _MOST_WEIGHT:
        raise ValueError(
            f"the weight of {weight:g} N/mm2, {weight / _GRAVITY:.3g} g/m2, is too "
            f"large for a fabric: if it is {weight:g} g/m2, give "
            f"{weight * _GRAVITY:.4g} N/mm2"
        )
    return [_test(one, weight, family, angle) for one in read_recordings(path, form)]


def _test(
    recording: Recording, weight: float, family: str, angle: float | None
) -> CantileverTest:
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
    prepared = Prepared(read, recording, ANGLE, (OVERHANG,))
    return CantileverTest(name, overhang, angles, weight, family, prepared=prepared)


class _Elasticas(NamedTuple):
    """Elasticas of unit length and stiffness under their weight.

    The logarithm of w as a function of the chord angle, the curvature at the clamp as a
    function of the logarithm, and the range of angles.
    """

    logarithm: Callable[[ndarray], ndarray]
    curvature: Callable[[ndarray], ndarray]
    angles: tuple[float, float]


# Number of elasticas between which is interpolated: relative errors below 10⁻⁶.
_N_ELASTICAS = 200


@cache
def _unit_elasticas() -> _Elasticas:
    logarithm = np.log(np.geomspace(_LEAST, _MOST, _N_ELASTICAS))
    lengths = np.exp(logarithm / 3)  # of weight 1
    tips = drooping(np.ones_like, lengths, 1.0, 400)
    spline = scipy.interpolate.CubicSpline
    angle, end = tips.chord_angle, slice(None, None, _N_ELASTICAS - 1)
    low, high = angle[end].tolist()
    return _Elasticas(
        spline(angle, logarithm),
        spline(logarithm, tips.curvature * lengths),
        (low, high),
    )


@dataclass(frozen=True, eq=False)
class BendingCurve(MeasuredTest):
    """Moment over curvature of a strip in pure bending.

    Both branches of the test are in ``prepared.read``, and their rows in
    ``prepared.branches``.

    Attributes
    ----------
    curvature
        Curvature in 1/mm, shape (n,).
    moment
        Moment per width in N·mm/mm, shape (n,).
    family
        Fibre family along the strip, ``warp`` or ``weft``.

    Raises
    ------
    ValueError
        If the family is unknown.
    """

    curvature: ndarray
    moment: ndarray
    family: str = "warp"

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise ValueError(
                f"{self.name}: the family must be warp or weft, got {self.family!r}"
            )

    @property
    def parts(self) -> tuple[str, ...]:
        """See `MeasuredTest.parts`."""
        return (f"bending {self.family}",)


def read_bending(
    path: str | os.PathLike[str],
    family: str = "warp",
    form: Format | None = None,
    choices: Preparation | None = None,
) -> list[BendingCurve]:
    """Tests of a file or folder with the columns ``curvature`` and ``bending moment``.

    Parameters
    ----------
    path, form
        See `read_recordings`, with its errors.
    family
        See `BendingCurve`.
    choices
        See `prepare`, with its errors.  The loading is used by default; ``both`` gives
        the mean of loading and unloading.

    Raises
    ------
    ValueError
        If no curvature is positive, the moments do not increase, or a slack is given.
    """
    choices, curves = choices or Preparation(), []
    for recording in read_recordings(path, form):
        choices.refuse_slack(recording.name, "curvatures")
        prepared = prepare(recording, CURVATURE, [MOMENT], choices)
        read = prepared.recording
        curvature, moment = (read.column(name) for name in (CURVATURE, MOMENT))
        if not float(curvature @ moment) > 0:
            raise ValueError(
                f"{read.name}: the moment must have the sign of the curvature: reverse "
                "the sign of a column"
            )
        curves.append(
            BendingCurve(
                *(read.name, curvature, moment, family),
                prepared=prepared,
                cyclic=choices.cycles,
            )
        )
    return curves


@cache
def weight_number(angle: float) -> float:
    """Load parameter w L³/D of an elastica with a given chord angle in radians."""

    def off(logarithm: float) -> float:
        return hanging(float(np.exp(logarithm))).chord_angle - angle

    low, high = np.log([_LEAST, _MOST])
    return float(np.exp(scipy.optimize.brentq(off, low, high, xtol=1e-9)))
