"""Weighted mean of quadrics at points of a surface.

A quadric q_i(x) = w − (c₀ + c₁u + … + c₅v²) belongs to each vertex x_i, with the
coordinates u and v in its tangent plane and w along its normal.  φ is their mean with
smooth weights of finite support (Ohtake, Belyaev, Alexa, Turk & Seidel 2003,
Multi-level partition of unity implicits, ACM Trans.  Graph.  22:463).
"""

from copy import copy

import numpy as np
from numpy import ndarray

from .tool_mesh import pairs_of

# Number of points to which the six coefficients of a quadric are fitted: two rings of
# neighbours and more on a regular mesh.
FITTED = 18

# Eigenvalue of the normal equations of a fit, relative to the largest, below which a
# combination of coefficients is not determined by the neighbours and is zero: all of
# them are on a conic, such as the edge of a hole.  It is above 1e-3 for nearly
# equilateral triangles; 1e-10 on a circle, which amplifies scatter of 1e-4 mm to 1 mm
# in a hole.
_DETERMINED = 1e-6

# Cosine of the angle between normals below which a point belongs to the other side of a
# thin part and is not a neighbour.
_OTHER_SIDE = 0.0

# Smallest support radius, relative to the distance of the nearest point.
_FAR = 1.5

# Distance beyond which a quadric straightens to its tangent plane: in reaches, and by
# the angle in radians through which it has turned.  The error of a curvature grows with
# the square of the distance, and the curvature of a fillet at an edge would roll up.
# Holes of up to 16 edges are spanned by the curvature of their edges.
_BENDS, _TURNS = 4.0, 0.5

# Maximum number of vertices listed as neighbours of a vertex: sixty times the mean of
# equal triangles.  Maximum number of pairs of position and vertex per block.
_NEIGHBOURS, _PAIRS = 2500, 16384

# Distances from the nearest vertex, relative to the reach, for which neighbours are
# counted in advance.  Beyond them the reach grows with the distance.
_LEVELS = np.linspace(0.0, 1 / _FAR, 9)


# Side of the cubes of which one point each represents a surface for points far away, in
# reaches, smallest distance from it relative to the diagonal of a cube, and smallest
# height over it relative to the distance.  At five diagonals the nearest of these
# points is at most 1.25 times as far away as the surface.  Its direction deviates from
# the direction of the nearest point by 37° at most, so that a face on which the nearest
# point does not lie is lower than 0.6 of the distance.
_CUBE, _FAR_OFF, _HIGH = 1.0, 5.0, 0.7


class Quadrics:
    """Quadrics q_i = a_i + b_i·d + ½ d·H_i d of the vector d from their points.

    Points and unit normals have the shape (n, 3).  Weights vanish at the distance
    ``reach`` in mm.  Beyond a distance, not smaller than this, a quadric straightens.
    """

    def __init__(self, points: ndarray, normals: ndarray, reach: float) -> None:
        from scipy.spatial import KDTree  # not imported for other drapes

        self._tree, self._reach = KDTree(points), reach
        _, near = self._tree.query(points, FITTED)
        u, v, c = _fitted(points, normals, near)
        c_uu, c_uv, c_vv = c[:, 3:].T[:, :, None, None]
        uv = u[:, :, None] * v[:, None]
        H = -(
            2 * c_uu * u[:, :, None] * u[:, None]
            + c_uv * (uv + uv.swapaxes(1, 2))
            + 2 * c_vv * v[:, :, None] * v[:, None]
        )
        b = normals - c[:, 1, None] * u - c[:, 2, None] * v
        self._set(points, -c[:, 0], b, H)
        turns = np.linalg.norm(H, axis=(1, 2))
        self._straight = reach * np.clip(
            _TURNS / np.maximum(reach * turns, 1e-9), 1.0, _BENDS
        )
        # Vertices near each vertex, nearest first, and how many of them can be within
        # the reach of a position at most so far away: see `_LEVELS`.
        n, within = len(points), reach * (1 + _LEVELS)
        count = self._tree.query_ball_point(points, within[-1], return_length=True)
        self._listed = count <= _NEIGHBOURS
        listed = np.flatnonzero(self._listed)
        pairs = KDTree(points[listed]).sparse_distance_matrix(
            self._tree, within[-1], output_type="ndarray"
        )
        at, away = listed[pairs["i"]], pairs["v"]
        self._near = pairs["j"][np.argsort(at + away / (2 * within[-1]))]
        count = np.bincount(at, minlength=n)
        self._start = np.cumsum(count) - count
        level = np.searchsorted(within, away)
        counts = np.bincount(level * n + at, minlength=(1 + len(within)) * n)
        self._counts = counts.reshape(-1, n)[:-1].cumsum(axis=0)

    def _set(self, points: ndarray, a: ndarray, b: ndarray, H: ndarray) -> None:
        """Store quadrics of shapes (n, 3), (n,), (n, 3) and (n, 3, 3) as columns."""
        from scipy.spatial import KDTree

        self._quadrics = points, a, b, H
        self._c = np.column_stack([a, b, H[:, *_UPPER]]).T.copy()
        self._x = points.T.copy()
        cubes = np.floor(points / (_CUBE * self._reach)).astype(np.int64)
        _, self._few = np.unique(cubes, axis=0, return_index=True)
        self._few_tree = KDTree(points[self._few])

    def moved(self, origin: ndarray, turn: ndarray) -> "Quadrics":
        """Quadrics in new axes with an origin, (3,), and directions, (3, 3)."""
        from scipy.spatial import KDTree

        points, a, b, H = self._quadrics
        moved = copy(self)
        points = (points - origin) @ turn
        moved._tree = KDTree(points)
        moved._set(points, a, b @ turn, turn.T @ H @ turn)
        return moved

    def offsets(self) -> ndarray:
        """Distances of the points above their quadrics in mm, shape (n,)."""
        return self._quadrics[1]

    def heights(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Heights over the tangent plane at the nearest point, and its normal.

        For positions of the shape (3, n), shapes (n,) and (3, n).  Far away, where a
        search for the nearest point visits most points, at the nearest one of a few.
        """
        distance, few = self._few_tree.query(x.T)
        heights, normals = self._heights(x, self._few[few])
        far = distance > _FAR_OFF * np.sqrt(3) * _CUBE * self._reach
        near = np.flatnonzero(~(far & (np.abs(heights) > _HIGH * distance)))
        nearest = self._tree.query(x[:, near].T)[1]
        heights[near], normals[:, near] = self._heights(x[:, near], nearest)
        return heights, normals

    def _heights(self, x: ndarray, at: ndarray) -> tuple[ndarray, ndarray]:
        """Heights over the tangent planes at some of the points, and their normals."""
        points, _, b, _ = self._quadrics
        normals = b[at] / np.linalg.norm(b[at], axis=1)[:, None]
        return ((x.T - points[at]) * normals).sum(axis=1), normals.T

    def mean(self, x: ndarray, order: int = 2) -> tuple[ndarray, ...]:
        """φ = Σ w q / Σ w and its derivatives at positions, shape (3, n).

        The order of the last derivative is 1 or 2.
        """
        mean = [np.full((*[3] * i, x.shape[1]), np.nan) for i in range(order + 1)]
        distance, nearest = self._tree.query(x.T)
        # Squares of infinite distances overflow: these values remain NaN.
        finite = np.isfinite(distance)
        nearest = np.where(finite, nearest, 0)
        # Far away only the nearest points contribute: the reach slightly exceeds
        # their distance.
        reach, levels = np.maximum(self._reach, _FAR * distance), self._reach * _LEVELS
        listed = (distance <= levels[-1]) & self._listed[nearest]
        level = np.searchsorted(levels, np.where(listed, distance, 0.0))
        count = self._counts[level, nearest]
        far = np.flatnonzero(finite & ~listed)
        if far.size:
            count[far] = self._tree.query_ball_point(
                x[:, far].T, reach[far], return_length=True
            )
        for numbers in np.flatnonzero(listed), far:
            for some in _blocks(numbers, count):
                n, first, at = count[some], nearest[some], x[:, some]
                if numbers is far:
                    _, near = pairs_of(self._tree.query_ball_point(at.T, reach[some]))
                else:
                    shift = self._start[first] - (np.cumsum(n) - n)
                    near = self._near[np.arange(n.sum()) + np.repeat(shift, n)]
                block = self._mean(at, near, n, first, reach[some], order)
                for values, part in zip(mean, block, strict=True):
                    values[..., some] = part
        for values in mean:
            values.setflags(write=False)
        return tuple(mean)

    def _mean(
        self,
        x: ndarray,
        near: ndarray,
        count: ndarray,
        nearest: ndarray,
        reach: ndarray,
        order: int,
    ) -> tuple[ndarray, ...]:
        """Derivatives at n positions.

        ``near`` contains all vertices within the reach of the positions, and possibly
        others, ``count`` for each position.
        """
        at = np.repeat(np.arange(len(count)), count)
        d = np.repeat(x, count, axis=1) - self._x.take(near, axis=1)
        square = np.einsum("ip,ip->p", d, d)
        inside = np.flatnonzero(square < (reach * reach).take(at))
        at, near, d = at.take(inside), near.take(inside), d.take(inside, axis=1)
        starts = np.searchsorted(at, np.arange(len(count)))

        def total(values: ndarray) -> ndarray:
            return np.add.reduceat(values, starts, axis=-1)

        square = square.take(inside)
        a, b, H = np.split(self._c.take(near, axis=1), [1, 4])
        slope_of = [H[i] * d[0] + H[j] * d[1] + H[k] * d[2] for i, j, k in _SYMMETRIC]
        e = 0.5 * np.einsum("ip,ip->p", slope_of, d)
        bend = (e, np.array(slope_of), H)[: order + 1]
        if (beyond := square > self._straight.take(near) ** 2).any():
            bend = _straightened(bend, d, beyond, self._straight.take(near))
        q = a[0] + np.einsum("ip,ip->p", b, d) + bend[0]
        dq = b + bend[1]
        # Wendland's C⁴ function w = (1 − s)⁶ (35 s² + 18 s + 3), slope = w′/s and bend
        # = slope′/s. With m = s ∇s: ∇w = slope m, ∇²w = bend m m + slope ∇m, ∇m = I (1
        # − s²R²/r₁²)/R² − 2 (m ρ + ρ m), r₁ to the nearest point.
        over = (1 / reach).take(at)
        s = np.sqrt(square) * over
        rest = 1 - s
        fourth = np.square(rest * rest)
        w = fourth * rest * rest * ((35 * s + 18) * s + 3)
        slope = fourth * rest * (-280 * s - 56)
        m, weight = d * (over * over), total(w)
        level = total(w * q) / weight
        # Derivatives of Σ w (q − φ) = 0, whose terms in the derivatives of Σ w vanish.
        off = q - level.take(at)
        of_w = grown = slope * off
        # If the reach depends on the nearest point: the gradient ρ of its logarithm.
        follows = reach > self._reach
        if far := bool(follows.any()):
            rho = follows * (x - self._x[:, nearest]) * (_FAR / reach) ** 2
            m -= s * s * rho.take(at, axis=1)
            grown = of_w * (1 - follows.take(at) * (_FAR * s) ** 2)
        gradient = total(of_w * m + w * dq) / weight
        if order == 1:
            return level, gradient
        turned = (840 * fourth * off) * m + slope * (dq - gradient.take(at, axis=1))
        if far:
            turned -= (2 * of_w) * rho.take(at, axis=1)
        hessian = np.array(
            [
                total(m[i] * turned[j] + m[j] * turned[i] + w * h)
                for i, j, h in zip(*_UPPER, bend[2], strict=True)
            ]
        )
        hessian[:3] += total(grown) / (reach * reach)
        return level, gradient, (hessian / weight)[_SYMMETRIC]


# Second derivatives xx, yy, zz, yz, xz, xy in a matrix, and their numbers in it.
_UPPER = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
_SYMMETRIC = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def _blocks(numbers: ndarray, count: ndarray) -> list[ndarray]:
    """Blocks of positions with about `_PAIRS` pairs."""
    ends = np.cumsum(count[numbers])
    if not numbers.size or ends[-1] <= _PAIRS:
        return [numbers] if numbers.size else []
    cuts = np.searchsorted(ends, np.arange(_PAIRS, ends[-1], _PAIRS))
    return [block for block in np.split(numbers, np.unique(cuts)) if block.size]


def _fitted(
    points: ndarray, normals: ndarray, near: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Unit vectors u and v at points, (n, 3), and coefficients of quadrics, (n, 6)."""
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, axis)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normals, u)
    frames = np.stack([u, v, normals], axis=1)
    local = np.einsum("nij,nkj->nki", frames, points[near] - points[:, None])
    size = np.linalg.norm(local, axis=2).max(axis=1)
    a, b, h = (local / size[:, None, None]).transpose(2, 0, 1)
    rows = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=2)
    facing = np.einsum("nkj,nj->nk", normals[near], normals) > _OTHER_SIDE
    weight = facing * np.exp(-2 * (a * a + b * b))
    weighted = weight[:, None] * rows.swapaxes(1, 2)
    normal, right = weighted @ rows, (weighted @ h[:, :, None])[..., 0]
    values, vectors = np.linalg.eigh(normal)
    known = values > _DETERMINED * values[:, -1:]
    shares = np.einsum("nij,ni->nj", vectors, right)
    shares = np.divide(shares, values, out=np.zeros_like(shares), where=known)
    c = np.einsum("nij,nj->ni", vectors, shares)
    degrees = np.array([0, 1, 1, 2, 2, 2])
    return u, v, c * size[:, None] ** (1 - degrees)


def _straightened(
    bend: tuple[ndarray, ...], d: ndarray, beyond: ndarray, limit: ndarray
) -> tuple[ndarray, ...]:
    """Quadratic parts, continued linearly beyond a distance.

    e = ½ d·H d is multiplied by ψ(t) = 2 f(t)/t² of t = |d|/L, where f″ falls from 1 at
    t = 1 to 0 at t = 2, so that second derivatives are continuous.

    Parameters
    ----------
    bend
        e, shape (n,), its gradient, (3, n), and, if needed, its Hessian, (6, n).
    d
        Vectors from the points, shape (3, n).
    beyond
        Which of them are beyond the distance, shape (n,).
    limit
        The distance L, shape (n,).
    """
    d, limit = d[:, beyond], limit[beyond]
    e, slope = bend[0][beyond], bend[1][:, beyond]
    square = np.einsum("ip,ip->p", d, d)
    t = np.sqrt(square) / limit
    part = np.minimum(t - 1, 1.0)
    part_2 = part * part
    f_t = 1 + part - part_2 * part * (1 - part / 2)
    f = 0.5 + part + part_2 * (0.5 - part_2 * (1 / 4 - part / 10))
    f += 1.5 * np.maximum(t - 2, 0.0)
    t_2, limit_2 = t * t, limit * limit
    psi = 2 * f / t_2
    one = 2 * (f_t - psi * t) / (t_2 * t)  # ψ′/t
    values = tuple(np.array(part, copy=True) for part in bend)
    values[0][beyond] = psi * e
    values[1][:, beyond] = psi * slope + e * (one / limit_2) * d
    if len(values) > 2:
        f_tt = 1 - part_2 * (3 - 2 * part)
        two = (2 * (f_tt - psi) / t_2 - 5 * one) / t_2  # (ψ″ − ψ′/t)/t²
        one, two = one / limit_2, two / (limit_2 * limit_2)
        values[2][:, beyond] = psi * bend[2][:, beyond] + [
            one * (d[i] * slope[j] + d[j] * slope[i] + (i == j) * e)
            + e * two * d[i] * d[j]
            for i, j in zip(*_UPPER, strict=True)
        ]
    return values
