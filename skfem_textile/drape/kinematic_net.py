"""Kinematic net: inextensible rods, pinned at their crossings, laid on a surface.

Two threads start at a point along geodesics.  Every further crossing is at the distance
of one cell from two known crossings (Mack & Taylor 1956, The fitting of woven cloth to
surfaces, J.  Text.  Inst.  47:T477).  Fibres do not stretch, and forces play no role:
the first two threads determine the whole net.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.user_input import real_numbers
from ..solve.surface import Surface, onto
from ..solve.surface.surface import tangents
from .surfaces import positive_length


@dataclass(frozen=True, eq=False)
class Net:
    """Crossings of a net on a surface.

    Attributes
    ----------
    positions
        Positions of the crossings in mm, shape (3, n_warp + 1, n_weft + 1), with the
        second axis along the warp.  NaN for crossings that were not laid.
    along
        Coordinates of the crossings along warp and weft in the flat ply in mm.
    directions
        Unit vectors of warp and weft in the flat ply, columns of shape (2, 2).
    touch
        Origin of these coordinates in the flat ply, shape (2,).
    """

    positions: ndarray
    along: tuple[ndarray, ndarray]
    directions: ndarray
    touch: ndarray

    def shear_angle(self) -> ndarray:
        """Shear angle Γ of each cell in radians, shape (n_warp, n_weft).

        The sides of a cell are equal, so that its diagonals determine the angle.
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

    def up_to(self, X: ndarray) -> "Net":
        """The part up to points of the flat ply in mm, shape (2, n), NaN elsewhere."""
        cell = self.along[0][1] - self.along[0][0]
        ends = np.linalg.solve(self.directions, X - self.touch[:, None]) / cell
        first, second = (int(np.abs(at).argmin()) for at in self.along)
        mask = _up_to(ends, (first, second), self.positions.shape[1:])
        return replace(self, positions=np.where(mask, self.positions, np.nan))

    def at(self, X: ndarray) -> ndarray:
        """Positions of points of the flat ply, bilinear in each cell, shape (3, n).

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

        Central differences over two cells, linear between the crossings.

        Parameters
        ----------
        X
            Points in mm, shape (2, n), at least one cell inside the net.

        Raises
        ------
        ValueError
            If a point is outside the net.
        """
        along = (np.gradient(self.positions, axis=axis) for axis in (1, 2))
        tangents = np.array([self._between(tangent, X) for tangent in along])
        return tangents / np.linalg.norm(tangents, axis=1, keepdims=True)

    def _between(self, x: ndarray, X: ndarray) -> ndarray:
        """Values at points, bilinear between the crossings, shape (3, n)."""
        coordinates = np.linalg.solve(self.directions, X - self.touch[:, None])
        cell, share = [], []
        for s, at in zip(coordinates, self.along, strict=True):
            spacing = at[1] - at[0]
            index = (s - at[0]) / spacing
            if not ((index > -1e-6) & (index < len(at) - 1 + 1e-6)).all():
                raise ValueError(
                    f"net: the coordinate {s[np.abs(s).argmax()]:g} mm is outside the "
                    f"net, which extends from {at[0]:g} to {at[-1]:g} mm"
                )
            cell.append(np.clip(np.floor(index).astype(int), 0, len(at) - 2))
            share.append(index - cell[-1])
        (i, j), (p, q) = cell, share
        return (
            (1 - p) * (1 - q) * x[:, i, j]
            + p * (1 - q) * x[:, i + 1, j]
            + (1 - p) * q * x[:, i, j + 1]
            + p * q * x[:, i + 1, j + 1]
        )


# Maximum number of Newton iterations for a crossing, and its error relative to the cell
# length.  Chosen: it starts one cell away and converges quadratically.
_MOST, _EXACT = 30, 1e-11

# Sine of the angle between threads below which they have folded.  Chosen: about half a
# degree, at which consecutive crossings become indistinguishable.
_FOLDED = 0.01


class NetError(ValueError):
    """Net that cannot be laid.

    Attributes
    ----------
    position
        Position of its end in mm, shape (3,).
    """

    def __init__(self, what: str, position: ndarray, advice: str = "") -> None:
        super().__init__(f"net: {what} at {np.round(position, 3).tolist()}{advice}")
        self.position = position


class FoldedNetError(NetError):
    """Net whose threads fold onto one another."""


def net(
    surface: Surface,
    cell: float,
    warp: tuple[int, int],
    weft: tuple[int, int],
    *,
    angles: tuple[float, float] = (0.0, np.pi / 2),
    touch: tuple[float, float] = (0.0, 0.0),
    point: ArrayLike | None = None,
    first: ArrayLike = (1.0, 0.0, 0.0),
    over: ndarray | None = None,
) -> Net:
    """Lay a net on a surface.

    Parameters
    ----------
    surface
        The surface.
    cell
        Length of the rods in mm.
    warp, weft
        Numbers of cells against and along the direction of each family, from the start
        of the net.
    angles
        Inclination of warp and weft in the flat ply in radians.
    touch
        Start of the net in the flat ply.
    point
        Its position in space; by default (x, y, 0) of ``touch``.
    first
        Direction in space of the x axis of the ply there.
    over
        Points of the flat ply in mm, shape (2, n), up to which the net is laid;
        crossings beyond all of them are omitted.  By default all are laid.

    Raises
    ------
    NetError
        If the net folds (`FoldedNetError`), or leaves the surface before it is
        complete.
    ValueError
        If an argument is not valid.

    Examples
    --------
    A quarter of a sphere, with sides equal to its radius: the shear angle of the last
    cell, 53.6° in theory:

    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> sphere = drape.Sphere(100.0, (0, 0, -100))
    >>> angle = drape.net(sphere, 100 / 64, (0, 64), (0, 64)).shear_angle()
    >>> round(float(np.degrees(angle[-1, -1])), 1)
    53.6
    """
    cell = positive_length("net: cell", cell)
    counts = [_counts(name, n) for name, n in (("warp", warp), ("weft", weft))]
    flat = np.array([np.cos(angles), np.sin(angles)])
    if not abs(np.linalg.det(flat)) > _FOLDED:
        raise ValueError("net: warp and weft must not be parallel")
    guess = np.array([*touch, 0.0]) if point is None else np.asarray(point, dtype=float)
    start = onto(surface, guess[:, None])[:, 0]
    families = tangents(surface, start, np.asarray(first)) @ flat
    x = np.full((3, *(sum(n) + 1 for n in counts)), np.nan)
    sides = [(slice(n[0], None, -1), slice(n[0], None)) for n in counts]
    directions = np.hstack([-families, families])
    threads = _threads(surface, start, directions, cell, np.transpose(counts).ravel())
    for side in (0, 1):
        x[:, sides[0][side], counts[1][0]] = threads[2 * side]
        x[:, counts[0][0], sides[1][side]] = threads[2 * side + 1]
    mask = np.ones(x.shape[1:], dtype=bool)
    if over is not None:
        ends = np.linalg.solve(flat, over - np.array(touch)[:, None]) / cell
        mask = _up_to(ends, (counts[0][0], counts[1][0]), mask.shape)
    _fill(surface, [(x[:, i, j], mask[i, j]) for i in sides[0] for j in sides[1]], cell)
    along = [cell * np.arange(-n[0], n[1] + 1) for n in counts]
    return Net(x, (along[0], along[1]), flat, np.array(touch, dtype=float))


def _counts(name: str, n: Any) -> tuple[int, int]:
    """Validated numbers of cells against and along a direction, not both zero."""
    counts = real_numbers(f"net: {name}", n)
    integral = counts.shape == (2,) and (counts == np.round(counts)).all()
    if not integral or counts.min() < 0 or counts.sum() < 1:
        raise ValueError(
            f"net: {name} must be two whole numbers of cells, against and along its "
            f"direction, not both zero; got {n!r}"
        )
    return int(counts[0]), int(counts[1])


def _threads(
    surface: Surface, start: ndarray, along: ndarray, cell: float, counts: ndarray
) -> list[ndarray]:
    """Crossings of discrete geodesics, each of shape (3, count + 1).

    The change of direction between rods is along the normal at their pin.
    """
    x, step = [np.tile(start[:, None], len(counts))], along * cell
    for k in range(counts.max()):
        left, end = counts > k, np.full_like(step, np.nan)
        end[:, left] = _pinned(surface, x[-1][:, left], step[:, left], cell)
        x.append(end)
        step = x[-1] - x[-2]
    return [np.array(x)[: n + 1, :, i].T for i, n in enumerate(counts)]


def _pinned(surface: Surface, x: ndarray, step: ndarray, cell: float) -> ndarray:
    """Ends of rods on the surface in the planes of directions and normals, (3, n)."""
    plane = np.array([step, surface.gradient(x)])
    plane /= np.linalg.norm(plane, axis=1, keepdims=True)
    s = np.array([np.full(x.shape[1], cell), np.zeros(x.shape[1])])
    for _ in range(_MOST):
        away = (plane * s[:, None]).sum(axis=0)
        gradient, level = surface.gradient(x + away), surface.level(x + away)
        slope = np.linalg.norm(gradient, axis=0)
        off = [level / slope, ((away * away).sum(axis=0) - cell**2) / (2 * cell)]
        missing = ~(np.abs(off).max(axis=0) <= _EXACT * cell)
        if not missing.any():
            return x + away
        rows = np.einsum("rin,cin->nrc", [gradient / slope, away / cell], plane)
        with np.errstate(all="ignore"):  # non-finite values are detected
            crossed = np.abs(np.linalg.det(rows)) >= _FOLDED
        if not crossed[missing].all():
            break
        step = np.linalg.solve(rows, np.transpose(off)[:, :, None])[:, :, 0].T
        s = s - np.where(missing, step, 0.0)
    raise NetError("the first thread leaves the surface", x[:, missing.argmax()])


def _up_to(ends: ndarray, zero: tuple[int, int], shape: tuple[int, ...]) -> ndarray:
    """Mask of crossings up to the cell of any given point, in each quadrant.

    ``ends`` are the points in cells, shape (2, n), from the crossing ``zero``.
    """
    mask = np.zeros(shape, dtype=bool)
    for signs in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        part = mask[tuple(slice(z, None, s) for z, s in zip(zero, signs, strict=True))]
        last = np.floor(ends * np.array(signs)[:, None] + _EXACT).astype(int) + 1
        last = last[:, (last > 0).all(axis=0)]
        own = np.zeros(part.shape, dtype=bool)
        own[tuple(np.minimum(last, np.array(part.shape)[:, None] - 1))] = True
        for axis in (0, 1):
            own = np.flip(np.logical_or.accumulate(np.flip(own, axis), axis), axis)
        part |= own
    return mask


def _fill(
    surface: Surface, quadrants: list[tuple[ndarray, ndarray]], cell: float
) -> None:
    """Lay crossings from the first two threads of quadrants, diagonal by diagonal.

    Quadrants are positions, (3, m, n), and a mask of the crossings to lay, (m, n).
    """
    for diagonal in range(2, max(sum(mask.shape) for _, mask in quadrants) - 1):
        indices, known = [], []
        for x, mask in quadrants:
            m, n = mask.shape
            i = np.arange(max(1, diagonal - n + 1), min(m, diagonal))
            i = i[mask[i, diagonal - i]]
            j = diagonal - i
            indices.append((i, j))
            a, b, corner = x[:, i - 1, j], x[:, i, j - 1], x[:, i - 1, j - 1]
            known.append([a, b, corner])
        a, b, corner = np.concatenate(known, axis=2)
        if a.size:
            laid, first = _crossings(surface, a, b, corner, cell), 0
            for (x, _), (i, j) in zip(quadrants, indices, strict=True):
                x[:, i, j] = laid[:, first : first + len(i)]
                first += len(i)


def _crossings(
    surface: Surface, a: ndarray, b: ndarray, corner: ndarray, cell: float
) -> ndarray:
    """Points on a surface at one cell length from two points, shape (3, n).

    The solution opposite to ``corner`` is chosen.
    """
    x = a + b - corner
    for _ in range(_MOST):
        gradient, p, q = surface.gradient(x), x - a, x - b
        slope = np.linalg.norm(gradient, axis=0)
        off = np.array(
            [
                surface.level(x) / slope,
                ((p * p).sum(axis=0) - cell**2) / (2 * cell),
                ((q * q).sum(axis=0) - cell**2) / (2 * cell),
            ]
        )
        if np.abs(off).max() <= _EXACT * cell:
            break
        rows = np.array([gradient / slope, p / cell, q / cell]).transpose(2, 0, 1)
        with np.errstate(all="ignore"):  # non-finite values are detected
            crossed = np.abs(np.linalg.det(rows)) > _FOLDED**2
            if not crossed.all():
                break
            x = x - np.linalg.solve(rows, off.T[:, :, None])[:, :, 0].T
    sine = np.linalg.norm(np.cross(x - a, x - b, axis=0), axis=0) / cell**2
    across = (x - corner) * (a + b - 2 * corner)
    crosses = (np.abs(off) <= _EXACT * cell).all(axis=0) & (sine > _FOLDED)
    crosses &= across.sum(axis=0) > 0
    if not crosses.all():
        raise FoldedNetError(
            "the threads fold onto one another or leave the surface",
            corner[:, np.flatnonzero(~crosses)[0]],
            ": use fewer cells, or start elsewhere",
        )
    return x
