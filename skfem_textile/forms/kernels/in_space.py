"""Fibre kinematics in three dimensions.

At a point, with e = a/λ, v = e/λ, c = e₁·e₂, s = ``|e₁×e₂|``, n = e₁×e₂/s and, where
the weft lies anticlockwise of the warp at rest, g = ∂Γ/∂a = (e_β − c e_α)/(s λ_α),

    ∂²Γ/∂a_α²   = −(g ⊗ v + v ⊗ g) − (c/s) n ⊗ n/λ_α²,
    ∂²Γ/∂a₁∂a₂  = n ⊗ n/(s λ₁λ₂).

Both are signed sums of squares: −(g ⊗ v + v ⊗ g) is ½ times (v − g)² − (v + g)², and
with m_α = n/λ_α the rest is (1 − c)/2s times (m₁ + m₂)² minus (1 + c)/2s times (m₁ −
m₂)².
"""

from functools import cached_property
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import ndarray

from ...mesh.bases import cross

if TYPE_CHECKING:
    from .elements import Stress

_PAIRS = tuple(combinations_with_replacement(range(3), 2))


class _Crossing(NamedTuple):
    """∂Γ/∂a of warp and weft, (2, P, 3, n), n, (P, 3, n), c and s, (P, n)."""

    derivatives: ndarray
    normal: ndarray
    c: ndarray
    s: ndarray


class InSpace:
    """Counterpart in space of the deformation of fibres in the plane.

    Attributes
    ----------
    v, squared_stretch
        See `FibreDeformation`.
    side
        1 if the weft lies anticlockwise of the warp at rest, −1 if clockwise: the sign
        of the angle between them.  Broadcasts to (P, n).
    """

    v: ndarray
    squared_stretch: ndarray
    side: ndarray

    @cached_property
    def _crossing(self) -> _Crossing:
        stretch = np.sqrt(self.squared_stretch)[:, :, None]
        e = self.v * stretch
        normal, c = _cross(*e), (e[0] * e[1]).sum(axis=1)
        s = np.sqrt((normal**2).sum(axis=1))
        g = (e[::-1] - c[:, None] * e) / (s[:, None] * stretch)
        return _Crossing(self.side[:, None] * g, normal / s[:, None], c, s)

    def forces(self, stress: "Stress", block: slice) -> ndarray:
        """See `FibreDeformation`."""
        T, M, _ = stress
        v = self.v[..., block]
        forces = np.zeros(v.shape) if T is None else T[:, :, None] * v
        if M is not None:
            forces += M[:, None] * self._crossing.derivatives[..., block]
        return forces

    def stiffness(
        self, stress: "Stress", block: slice
    ) -> tuple[ndarray, ndarray | None]:
        """See `FibreDeformation`."""
        T, M, E = stress
        v, squared = self.v[..., block], self.squared_stretch[..., block]
        direct = np.zeros((*v.shape[:2], len(_PAIRS), v.shape[-1]))
        along = 0.0 if E is None else E
        if T is not None:
            along = along - 2 * T
            for k, (i, j) in enumerate(_PAIRS):
                if i == j:
                    direct[:, :, k] += T / squared
        _add_square(direct, along, v)
        return direct, None if M is None else self._add_shear(direct, M, block)

    def _add_shear(self, direct: ndarray, M: ndarray, block: slice) -> ndarray:
        """Add M ∂²Γ/∂a_α², and return M ∂²Γ/∂a₁∂a₂."""
        g, n, c, s = (x[..., block] for x in self._crossing)
        v, squared = self.v[..., block], self.squared_stretch[..., block]
        side = np.broadcast_to(self.side, self.squared_stretch.shape[1:])[..., block]
        half, lifted = 0.5 * M, 0.5 * M * side / s
        together, apart = lifted * (1 - c), -lifted * (1 + c)
        _add_square(direct, half, v - g)
        _add_square(direct, -half, v + g)
        normal = np.zeros((len(M), len(_PAIRS), M.shape[-1]))
        _add_square(normal[None], 1.0, n[None])
        direct += ((together + apart) / squared)[:, :, None] * normal
        root = np.sqrt(squared[0] * squared[1])
        return ((together - apart) / root)[:, None] * normal

    def angle_derivatives(self, block: slice) -> tuple[ndarray, ndarray]:
        """See `FibreDeformation`."""
        warp, weft = self._crossing.derivatives[..., block]
        return warp, weft


def angle_in_space(a: ndarray) -> ndarray:
    """Angle between the fibres, (P, n), from both fibre vectors, (2, P, 3, n)."""
    n = _cross(*a)
    return np.arctan2(np.sqrt((n**2).sum(axis=1)), (a[0] * a[1]).sum(axis=1))


def _cross(a: ndarray, b: ndarray) -> ndarray:
    """Cross product a × b of components on the second axis."""
    return cross(a.swapaxes(0, 1), b.swapaxes(0, 1)).swapaxes(0, 1)


def _add_square(total: ndarray, factor: ndarray | float, x: ndarray) -> None:
    """Add factor · x xᵀ of vectors x, shape (f, P, 3, n), by entries of `_PAIRS`."""
    for k, (i, j) in enumerate(_PAIRS):
        total[:, :, k] += factor * x[:, :, i] * x[:, :, j]
