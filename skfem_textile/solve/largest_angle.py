"""Largest shear angle of a ply in space, recovered between the element centres."""

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from ..mesh.recovery import LEAST, recovered
from ..ply import Ply
from .quantities import IN_SPACE

if TYPE_CHECKING:
    from .interval import ErrorInterval

# Least number of elements of wider patches: they have one more ring than others.
_WIDER = 17

# Half-width over the change of the angle with wider patches.
_OF_WIDER = 2.0


def largest_shear_angle(ply: Ply, u: ndarray, least: int = LEAST) -> float:
    """Largest shear angle in radians, at the nodes or the element centres.

    Parameters
    ----------
    ply, u
        The ply, and a displacement.
    least
        See `recovered`.
    """
    angle = ply.shear_angle(u, ply.centre)[:, 0]
    at_nodes = recovered(ply.mesh, angle, least)
    return float(max(np.abs(at_nodes).max(), np.abs(angle).max()))


def figures_of_shear(
    ply: Ply, u: ndarray, error: "ErrorInterval"
) -> dict[str, float | None]:
    """Recovered largest shear angle in degrees and its half-width, for a summary.

    The half-width of the error interval is increased by twice the change of the
    recovered angle with wider patches; it is None if there is no interval.
    """
    value, half = largest_shear_angle(ply, u), None
    with suppress(ValueError):
        low, high = error.of(largest_shear_angle)
        wider = abs(largest_shear_angle(ply, u, _WIDER) - value)
        half = float(np.degrees((high - low) / 2 + _OF_WIDER * wider))
    key = IN_SPACE.key
    return {key: float(np.degrees(value)), f"{key}_half_width": half}
