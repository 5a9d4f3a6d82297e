"""Values and motions that depend on the load factor by rows of a table."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation


class Rows:
    """Piecewise linear function of the load factor, constant beyond its rows.

    Parameters
    ----------
    what
        Its name in messages.
    rows
        Load factor and values of each row.

    Raises
    ------
    ValueError
        If the load factors do not increase from 0 to 1.
    """

    def __init__(self, what: str, rows: Any) -> None:
        self._t, *self._values = np.array(rows, dtype=float).T
        if (np.diff(self._t) <= 0).any() or self._t[0] != 0 or self._t[-1] != 1:
            raise ValueError(
                f"{what}: the load factors of the rows must increase from 0 to 1, got "
                f"{', '.join(f'{t:g}' for t in self._t)}"
            )

    def __call__(self, t: float) -> Any:
        """Value, or vector of values, at a load factor."""
        at = [float(np.interp(t, self._t, value)) for value in self._values]
        return np.array(at) if len(at) > 1 else at[0]


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Rotation about an axis and then a translation, as a function of the load factor.

    Parameters
    ----------
    translation
        Final translation in mm, shape (3,), or `Rows`.
    degrees
        Final angle, or `Rows`.
    axis, point
        Direction of the axis, and one of its points in mm, each (3,).
    """

    translation: Any
    degrees: Any
    axis: Sequence[float]
    point: ndarray

    def __call__(self, t: float) -> tuple[ndarray, ndarray]:
        """Rotation matrix and translation at a load factor."""
        moved, degrees = (
            rows(t) if callable(rows) else t * np.array(rows)
            for rows in (self.translation, self.degrees)
        )
        turn = rotation(self.axis, float(degrees))
        return turn, self.point - turn @ self.point + moved


def rotation(axis: Sequence[float], degrees: float) -> ndarray:
    """Matrix of a rotation about an axis of any length, shape (3, 3)."""
    unit = np.array(axis) / np.abs(axis).max()
    unit /= np.linalg.norm(unit)
    return np.asarray(Rotation.from_rotvec(degrees * unit, degrees=True).as_matrix())
