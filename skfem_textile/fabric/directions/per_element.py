"""Directions of both fibre families in each element, as vectors and as angles."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ...registration import MOST_DEGREES
from ..fabric import Fabric


@dataclass(frozen=True, eq=False)
class FibreDirections:
    """Directions of warp and weft in each of the user's elements.

    Parameters
    ----------
    warp, weft
        Vectors of any length, shape (2, n_elements); kept as they are given.

    Raises
    ------
    ValueError
        If there are not as many of both, one is zero or not finite, or warp and weft
        are parallel.

    Examples
    --------
    >>> directions = FibreDirections.of_angles([0.0, 10.0], [90.0, 100.0])
    >>> directions.angles_deg()[0].round(12)
    array([ 0., 10.])
    """

    warp: ndarray
    weft: ndarray

    def __post_init__(self) -> None:
        for name in ("warp", "weft"):
            given = np.array(getattr(self, name), dtype=float)
            if given.ndim != 2 or len(given) != 2 or not given.size:
                raise ValueError(
                    f"{name} must have the shape (2, n_elements), not {given.shape}"
                )
            object.__setattr__(self, name, given)
        if self.warp.shape != self.weft.shape:
            raise ValueError(
                f"{self.warp.shape[1]} directions of warp and {self.weft.shape[1]} of "
                "weft; give both for each element"
            )
        Fabric(warp=self.warp, weft=self.weft)  # refuses vectors that are none

    @classmethod
    def of_angles(cls, warp_deg: ArrayLike, weft_deg: ArrayLike) -> Self:
        """Directions at angles to the x axis in degrees, each of shape (n_elements,).

        Multiples of 90° are exact.
        """
        return cls(_at_angles(warp_deg), _at_angles(weft_deg))

    def angles_deg(self) -> tuple[ndarray, ndarray]:
        """Angles of warp and weft to the x axis in degrees, in (−180, 180]."""
        pair = self.warp, self.weft
        warp, weft = (np.degrees(np.arctan2(y + 0.0, x)) for x, y in pair)  # no -0.0
        return warp, weft

    def refuse_other(self, cells: Sequence[ndarray]) -> None:
        """Refuse elements, arrays (k, n_k), of which there are more or fewer.

        Raises
        ------
        ValueError
            If there is not one direction for each element.
        """
        n_elements, n = sum(cell.shape[1] for cell in cells), self.warp.shape[1]
        if n != n_elements:
            raise ValueError(f"{n} directions for {n_elements} elements")

    def on(self, fabric: Fabric) -> Fabric:
        """The laws of a fabric, with these directions."""
        return replace(fabric, warp=self.warp, weft=self.weft)


def _at_angles(degrees: ArrayLike) -> ndarray:
    """Unit vectors; quarter turns are taken off first, so that they are exact."""
    given = np.asarray(degrees, dtype=float)
    if given.ndim != 1 or not np.isfinite(given).all():
        raise ValueError("angles must be finite numbers, one for each element")
    if np.abs(given).max(initial=0.0) > MOST_DEGREES:
        raise ValueError(f"angles must be at most {MOST_DEGREES:g}°, a hundred turns")
    turns = np.rint(given / 90.0)
    rest = np.radians(given - 90.0 * turns)
    c, s = np.cos(rest), np.sin(rest)
    quarter = (turns % 4).astype(int)
    x = np.choose(quarter, [c, -s, -c, s])
    y = np.choose(quarter, [s, c, -s, -c])
    return np.stack([x, y])
