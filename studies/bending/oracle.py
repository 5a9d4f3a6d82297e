"""Independent evaluation of bending laws on a regular strip, without the package.

The nodes form a grid, the fibres are parallel to x and clamped at the left.  Curvatures
and directions at the nodes are Kronecker products of matrices of one dimension.  All
functions accept complex numbers, whose imaginary parts give exact derivatives.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy import ndarray


@dataclass(frozen=True)
class Strip:
    """Energy of a strip of nx × ny square elements of size h in space.

    The law gives the energy per area of a signed curvature.
    """

    nx: int
    ny: int
    h: float
    law: Callable[[ndarray], ndarray]

    def energy(self, u: ndarray) -> complex:
        """Energy for displacements of the nodes, shape (ny + 1, nx + 1, 3)."""
        M_x, M_y = _lumped(self.nx, self.h), _lumped(self.ny, self.h)
        mass, K = _mass(self.ny, self.h), _stiffness(self.nx, self.h)
        area = np.outer(M_y, M_x)
        m = -np.einsum("ab,ij,bjk->aik", mass, K, u) / area[..., None]
        X = np.zeros(u.shape)
        X[..., 0] = self.h * np.arange(self.nx + 1)
        X[..., 1] = self.h * np.arange(self.ny + 1)[:, None]
        x = X + u
        along_x, along_y = _slope(self.nx), _slope(self.ny)
        masses = mass, _mass(self.nx, self.h)
        a_1 = np.einsum("ab,ij,bjk->aik", masses[0], along_x, x) / area[..., None]
        a_2 = np.einsum("ab,ij,bjk->aik", along_y, masses[1], x) / area[..., None]
        n = np.cross(a_1, a_2)
        n = n / np.sqrt((n * n).sum(axis=-1))[..., None]
        size, q = np.sqrt((m * m).sum(axis=-1)), (m * n).sum(axis=-1)
        even = 0.5 * (self.law(size) + self.law(-size))
        odd = 0.5 * (self.law(q) - self.law(-q))
        energy: complex = (self._areas() * (even + odd)).sum()
        return energy

    def _areas(self) -> ndarray:
        """Areas of the nodes; the last ones give theirs to nodes of their elements."""
        area = np.outer(_lumped(self.ny, self.h), _lumped(self.nx, self.h))
        for j in range(self.ny + 1):
            near = [k for k in (j - 1, j, j + 1) if 0 <= k <= self.ny]
            area[near, -2] += area[j, -1] / len(near)
        area[:, -1] = 0.0
        return area

    def gradient(self, u: ndarray, d: ndarray) -> float:
        """Derivative of the energy along d, by a complex step."""
        return float(np.imag(self.energy(u + 1e-30j * d)) / 1e-30)

    def second(self, u: ndarray, d: ndarray, e: ndarray, step: float) -> float:
        """Second derivative along d and e, by differences of sixth order."""
        weights = (1, -9, 45)
        return sum(
            w
            * (self.gradient(u + k * step * e, d) - self.gradient(u - k * step * e, d))
            for w, k in zip(weights, (3, 2, 1), strict=True)
        ) / (60 * step)


def _lumped(n: int, h: float) -> ndarray:
    mass = np.full(n + 1, h)
    mass[[0, -1]] = h / 2
    return mass


def _mass(n: int, h: float) -> ndarray:
    return h / 6 * (4 * np.eye(n + 1) + np.eye(n + 1, k=1) + np.eye(n + 1, k=-1)) - (
        np.diag(np.eye(n + 1)[0] + np.eye(n + 1)[-1]) * h / 3
    )


def _stiffness(n: int, h: float) -> ndarray:
    K = 2 * np.eye(n + 1) - np.eye(n + 1, k=1) - np.eye(n + 1, k=-1)
    K[0, 0] = K[-1, -1] = 1.0
    return K / h


def _slope(n: int) -> ndarray:
    """∫ φ_i φ_j′."""
    G = 0.5 * (np.eye(n + 1, k=1) - np.eye(n + 1, k=-1))
    G[0, 0], G[-1, -1] = -0.5, 0.5
    return G


def polynomial(c: tuple[float, ...]) -> Callable[[ndarray], ndarray]:
    """Energy of the moment Σ cₖ κᵏ."""

    def of(x: ndarray) -> ndarray:
        terms = (ck * x ** (k + 1) / (k + 1) for k, ck in enumerate(c, 1))
        return sum(terms, 0 * x)

    return of


def bilinear(
    D: float, knee: float, D_1: float, r: float
) -> Callable[[ndarray], ndarray]:
    """Energy of a moment whose slope changes linearly around the knee."""
    low, high = (1 - r) * knee, (1 + r) * knee

    def of(x: ndarray) -> ndarray:
        s = np.where(x.real < 0, -x, x)
        z = (D_1 - D) / (high - low)
        turn = z * (s - low) ** 3 / 6
        end = z * (high - low) ** 3 / 6
        past = end + (D_1 - D) * ((s - high) * (high - low) / 2 + (s - high) ** 2 / 2)
        bend = np.where(s.real < low, 0 * s, np.where(s.real < high, turn, past))
        return D * s**2 / 2 + bend

    return of


def tabulated(x: ndarray, y: ndarray) -> Callable[[ndarray], ndarray]:
    """Energy of a cubic through points, by the slopes of Fritsch and Butland (1984)."""
    h, s = np.diff(x), np.diff(y) / np.diff(x)
    slopes = np.zeros(x.size)
    for i in range(1, x.size - 1):
        if s[i - 1] * s[i] > 0:
            w_1, w_2 = 2 * h[i] + h[i - 1], h[i] + 2 * h[i - 1]
            slopes[i] = (w_1 + w_2) / (w_1 / s[i - 1] + w_2 / s[i])
    for i, (a, b, p, q) in (
        (0, (h[0], h[1], s[0], s[1])),
        (-1, (h[-1], h[-2], s[-1], s[-2])),
    ):
        slope = ((2 * a + b) * p - a * q) / (a + b)
        if slope * p <= 0:
            slope = 0.0
        elif p * q <= 0 and abs(slope) > 3 * abs(p):
            slope = 3 * p
        slopes[i] = slope

    def piece(i: int, t: ndarray) -> ndarray:
        """Integral of the cubic i over t from 0."""
        c = y[i], slopes[i] * h[i]
        c_2 = 3 * (y[i + 1] - y[i]) - (2 * slopes[i] + slopes[i + 1]) * h[i]
        c_3 = 2 * (y[i] - y[i + 1]) + (slopes[i] + slopes[i + 1]) * h[i]
        return h[i] * (c[0] * t + c[1] * t**2 / 2 + c_2 * t**3 / 3 + c_3 * t**4 / 4)

    whole = np.cumsum([0.0, *(piece(i, np.ones(())) for i in range(h.size))])

    def integral(at: ndarray) -> ndarray:
        i = np.clip(np.searchsorted(x, at.real, side="right") - 1, 0, h.size - 1)
        found = np.zeros(at.shape, dtype=complex)
        for k in range(h.size):
            found = np.where(i == k, whole[k] + piece(k, (at - x[k]) / h[k]), found)
        return found

    at_rest = integral(np.zeros(1))[0]
    return lambda at: integral(np.asarray(at)) - at_rest
