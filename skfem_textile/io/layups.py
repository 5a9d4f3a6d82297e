"""Plies on the shells of a structural part: layers, thickness and angles of fibres.

A woven ply is two families of unidirectional fibres, each with half its thickness.  In
two layers, one on the other, stretching would bend the ply.  The four `LAYERS` lie
between ±t/2 and the extrema ±t/√8 and 0 of a Chebyshev polynomial, where families
alternate.  Both have the same zeroth, first and second moment through the thickness t:
stretching does not bend the ply, and its bending stiffness is t²/12 times its
stretching stiffness, as of a homogeneous sheet.  With fewer layers this is impossible.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..nets.sheet import FibresInSpace
from ..surfaces.tool_mesh import unit

WARP, WEFT = "WARP", "WEFT"

# Shares of the thickness of outer and inner layers.
_OUTER, _INNER = 0.5 - 8**-0.5, 8**-0.5

#: Family of each layer, from the side opposite to the normal, and its share of the
#: thickness of the ply.
LAYERS = ((WARP, _OUTER), (WEFT, _INNER), (WARP, _INNER), (WEFT, _OUTER))


class Element(NamedTuple):
    """Shell or membrane of a deck.

    ``nodes`` are node numbers, the first ``n_corners`` of them at corners.  ``scope``
    is the instance, and ``owner`` the part or property.  ``lines`` are the first line
    of a card and the one after the last.
    """

    number: int
    kind: str
    nodes: tuple[int, ...]
    n_corners: int
    scope: str
    owner: str = ""
    lines: tuple[int, int] = (0, 0)

    @property
    def corners(self) -> tuple[int, ...]:
        """Nodes at different corners."""
        return tuple(dict.fromkeys(self.nodes[: self.n_corners]))


@dataclass(frozen=True, eq=False)
class Layup:
    """Fibres and thickness of a ply in the shells of a part, in the order of its mesh.

    ``warp``, ``weft`` and ``normal`` are unit vectors of shape (3, n), normals by the
    order of nodes.  ``thickness`` is in mm, shape (n,), and NaN for elements that the
    ply does not cover.  ``rest`` is the thickness at rest, or the mean of the others.
    ``material`` is a name, or None for the material of the deck.
    """

    elements: Sequence[Element]
    warp: ndarray
    weft: ndarray
    normal: ndarray
    thickness: ndarray
    rest: float
    material: str | None

    @classmethod
    def of(
        cls,
        elements: Sequence[Element],
        fibres: FibresInSpace,
        thickness: ndarray,
        material: str | None,
    ) -> "Layup":
        """Layup of fibres, with the thickness at rest or in each element."""
        sheared = np.broadcast_to(thickness, fibres.covered.shape)
        if thickness.ndim == 0:
            sheared = sheared / np.cos(fibres.shear_angle)
        sheared = np.where(fibres.covered, sheared, np.nan)
        rest = float(np.nanmean(sheared) if thickness.ndim else thickness)
        axes = fibres.warp, fibres.weft, fibres.mesh.normals()
        return cls(elements, *axes, sheared, rest, material)

    @property
    def covered(self) -> ndarray:
        """Mask of the elements with the ply, shape (n,)."""
        return np.isfinite(self.thickness)

    def across(self) -> ndarray:
        """Directions in the elements at 90° to the warp, shape (3, n)."""
        return np.cross(self.normal, self.warp, axis=0)

    def turn_of_weft(self) -> ndarray:
        """Angle from the warp to the weft in degrees about the normal, shape (n,)."""
        return self.angles_deg(self.warp)[1]

    def indices(self) -> list[int]:
        """Indices of the elements with the ply."""
        return np.flatnonzero(self.covered).tolist()

    def angles_deg(self, axis: ndarray) -> tuple[ndarray, ndarray]:
        """Angles of warp and weft in degrees about the normal, shape (n,) each.

        ``axis`` has vectors of shape (3, n), which are projected onto the elements.
        """
        with np.errstate(invalid="ignore"):  # elements without the ply
            x = unit(axis - self.normal * (axis * self.normal).sum(axis=0))
        y = np.cross(self.normal, x, axis=0)
        warp, weft = (
            np.degrees(np.arctan2((y * v).sum(axis=0), (x * v).sum(axis=0))) + 0.0
            for v in (self.warp, self.weft)
        )
        return warp, weft

    def skew_deg(self) -> float:
        """Largest deviation of the families from a right angle in degrees."""
        sine = np.abs((self.warp * self.weft).sum(axis=0))[self.covered]
        return float(np.degrees(np.arcsin(np.clip(sine, 0, 1)).max(initial=0.0)))
