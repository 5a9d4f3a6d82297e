"""Largest shear angle of a ply in space, recovered between the element centres."""

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from ..ply import Ply
from .quantities import IN_SPACE

if TYPE_CHECKING:
    from .interval import ErrorInterval


def largest_shear_angle(ply: Ply, u: ndarray) -> float:
    """Largest shear angle in radians, recovered at the nodes or at the centres."""
    angle = ply.shear_angle(u, ply.centre)[:, 0]
    at_nodes = ply.recovery @ angle
    return float(max(np.abs(at_nodes).max(), np.abs(angle).max()))


def figures_of_shear(
    ply: Ply, u: ndarray, error: "ErrorInterval"
) -> dict[str, float | None]:
    """Recovered largest shear angle in degrees and its half-width, for a summary.

    The half-width of the error interval is increased by the difference between the
    recovered and the computed angle around the peak (Zienkiewicz & Zhu 1992); it is
    None if there is no interval.
    """
    value, half = largest_shear_angle(ply, u), None
    with suppress(ValueError):
        low, high = error.of(largest_shear_angle)
        half = float(np.degrees((high - low) / 2 + _difference_at_peak(ply, u)))
    key = IN_SPACE.key
    return {key: float(np.degrees(value)), f"{key}_half_width": half}


def _difference_at_peak(ply: Ply, u: ndarray) -> float:
    """Root mean square difference of the angles in the elements at the peak."""
    angle, t = ply.shear_angle(u, ply.centre)[:, 0], ply.mesh.t
    near = np.isin(t, t[:, np.abs(angle).argmax()]).any(axis=0)
    off = (ply.recovery @ angle)[t].mean(axis=0) - angle
    return float(np.sqrt(np.mean(off[near] ** 2)))
