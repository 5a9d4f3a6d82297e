"""Vectorised evaluation of `out_of_plane`.

With γ and ∇h of `hourglass_mode` the energy of an element is ½ k v², where ``k = C_s
Σ_k A/4 |∇h(ξ_k)|²`` and v = (y₁ × y₂)·y₃: y₁ and y₂ are the columns of the deformation
gradient at the centre, y₃ = Σ γ_a u_a.  Each y_s = Σ_a B_sa x_a is linear in the nodal
positions x_a, because γ maps reference positions to zero.
"""

from typing import Any

import numpy as np
from numpy import ndarray

from ...mesh.bases import cross
from .elements import hourglass_mode

# ε_ijk, of the cross product
_EPSILON = np.zeros((3, 3, 3))
_EPSILON[[0, 1, 2], [1, 2, 0], [2, 0, 1]] = 1.0
_EPSILON[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = -1.0

# Cyclic pairs of the vectors y, and the third.
_CYCLE = (0, 1, 2), (1, 2, 0), (2, 0, 1)


class OutOfPlaneKernel:
    """Kernel of `out_of_plane`.

    ``u`` is a displacement in space, shape (n_unknowns,), ``C_s`` a number or an array
    that broadcasts to (n_elements, 4).

    Parameters
    ----------
    basis
        The `HourglassBasis` of the forms.
    """

    def __init__(self, basis: Any) -> None:
        dN, _ = basis.gradients()
        at_centre, gamma, slope = hourglass_mode(basis, dN)
        self._B = np.array([*at_centre[..., 0].swapaxes(0, 1), gamma])
        self._weight = basis.dx * (slope**2).sum(axis=0)
        self._nodes = basis.element_dofs[::3] // 3
        self._X = np.pad(basis.mesh.p, ((0, 1), (0, 0)))

    def energy(self, u: ndarray, C_s: Any) -> float:
        """Energy in N·mm."""
        _, _, v = self._vectors(u)
        return 0.5 * float((self._stiffness(C_s) * v**2).sum())

    def forces(self, u: ndarray, C_s: Any) -> ndarray:
        """Nodal forces in N, shape (n_unknowns,)."""
        _, gradients, v = self._vectors(u)
        f, nodes = np.empty((3, len(u) // 3)), self._nodes.ravel()
        local = self._stiffness(C_s) * v * gradients
        for i in range(3):
            f[i] = np.bincount(nodes, local[:, i].ravel(), f.shape[1])
        return f.T.ravel()

    def matrices(self, u: ndarray, C_s: Any) -> ndarray:
        """Blocks of the pairs of nodes of the elements, shape (10, 3, 3, n)."""
        y, gradients, v = self._vectors(u)
        (a, c), B, k = np.triu_indices(4), self._B, self._stiffness(C_s)
        K = np.einsum("n,pin,pjn->pijn", k, gradients[a], gradients[c])
        across = sum(
            (B[s, a] * B[t, c] - B[t, a] * B[s, c])[:, None] * y[third]
            for s, t, third in _CYCLE
        )
        K += np.einsum("n,ijk,pkn->pijn", k * v, _EPSILON, across)
        return K

    def _stiffness(self, C_s: Any) -> ndarray:
        return (np.asarray(C_s) * self._weight).sum(axis=1)

    def _vectors(self, u: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """The y_s, (3, 3, n), ∂v/∂x_a, (4, 3, n), and v, (n,)."""
        x = (self._X + u.reshape(-1, 3).T)[:, self._nodes]
        y = np.einsum("san,ian->sin", self._B, x)
        d = np.array([cross(y[s], y[t]) for s, t, _ in _CYCLE])
        gradients = np.einsum("san,sin->ain", self._B[[2, 0, 1]], d)
        return y, gradients, (y[2] * d[0]).sum(axis=0)
