"""Crossings of a kinematic net on a surface: shear angles, and places between them."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray


@dataclass(frozen=True, eq=False)
class Net:
    """Crossings of a net on a surface.

    Attributes
    ----------
    positions
        Of the crossings in mm, shape (3, n_warp + 1, n_weft + 1): the second axis goes
        along the warp.  NaN for those that were not laid.
    along
        Coordinates of the crossings along warp and weft in the flat ply in mm.
    directions
        Unit vectors of warp and weft in the flat ply, columns of shape (2, 2).
    touch
        The point of the flat ply from which they are counted, shape (2,).
    """

    positions: ndarray
    along: tuple[ndarray, ndarray]
    directions: ndarray
    touch: ndarray

    def shear_angle(self) -> ndarray:
        """Shear angle Γ of each cell in radians, shape (n_warp, n_weft).

        The sides of a cell are equal: its diagonals tell the angle.
        """
        x = self.positions
        one = np.linalg.norm(x[:, 1:, 1:] - x[:, :-1, :-1], axis=0)
        other = np.linalg.norm(x[:, 1:, :-1] - x[:, :-1, 1:], axis=0)
        a, b = self.directions.T
        at_rest = np.arctan2(np.linalg.det([a, b]), a @ b)
        return np.abs(at_rest) - 2 * np.arctan2(other, one)

    def centres(self) -> ndarray:
        """Centres of the cells in the flat ply in mm, shape (2, n_warp, n_weft)."""
        mid = [0.5 * (s[1:] + s[:-1]) for s in self.along]
        s, t = np.meshgrid(*mid, indexing="ij")
        flat = np.einsum("ij,jab->iab", self.directions, np.array([s, t]))
        return flat + self.touch[:, None, None]

    def at(self, X: ndarray) -> ndarray:
        """Where points of the flat ply are, bilinear in each cell, shape (3, n).

        Parameters
        ----------
        X
            Points in mm, shape (2, n).

        Raises
        ------
        ValueError
            If a point is outside the net.
        """
        return self._between(self.positions, X)

    def tangents(self, X: ndarray) -> ndarray:
        """Unit vectors along warp and weft at points of the flat ply, shape (2, 3, n).

        They are differences over two cells, linear between the crossings.

        Parameters
        ----------
        X
            Points in mm, shape (2, n), a cell or more within the net.

        Raises
        ------
        ValueError
            If a point is outside the net.
        """
        along = (np.gradient(self.positions, axis=axis) for axis in (1, 2))
        found = np.array([self._between(tangent, X) for tangent in along])
        return found / np.linalg.norm(found, axis=1, keepdims=True)

    def _between(self, x: ndarray, X: ndarray) -> ndarray:
        """Values at points, bilinear between those at the crossings, shape (3, n)."""
        coordinates = np.linalg.solve(self.directions, X - self.touch[:, None])
        cell, share = [], []
        for s, at in zip(coordinates, self.along, strict=True):
            spacing = at[1] - at[0]
            place = (s - at[0]) / spacing
            if not ((place > -1e-6) & (place < len(at) - 1 + 1e-6)).all():
                raise ValueError(
                    f"the net reaches from {at[0]:g} to {at[-1]:g} mm, a point lies at "
                    f"{s[np.abs(s).argmax()]:g} mm"
                )
            cell.append(np.clip(np.floor(place).astype(int), 0, len(at) - 2))
            share.append(place - cell[-1])
        (i, j), (p, q) = cell, share
        return (
            (1 - p) * (1 - q) * x[:, i, j]
            + p * (1 - q) * x[:, i + 1, j]
            + (1 - p) * q * x[:, i, j + 1]
            + p * q * x[:, i + 1, j + 1]
        )
