"""Points of elements, and what a fibre there needs of the reference configuration.

A fibre a = F·A written as a complex number z = a_x + i a_y has the logarithm ε + iθ,
its strain and its inclination.  It is linear in the motions u_a of an element,

    z = A + Σ_a b_a u_a,

so that one number per motion, fibre and point holds all that a kernel needs of a mesh.
The motions are displacements of nodes, with b_a = A·∇N_a, or combinations of these.
Element matrices are symmetric and hold the 2×2 blocks of the pairs of motions (a, c)
with a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, 2, 2, n).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy import ndarray


@dataclass(frozen=True, eq=False)
class Motion:
    """What becomes of the fibres at P points of n elements.

    Attributes
    ----------
    v
        z/|z|² of warp and weft, shape (2, P, 2, n): ∂ε/∂u_a = b_a v, ∂θ/∂u_a = b_a Jv.
    squared
        |z|² = λ² of both, shape (2, P, n).
    angle
        Shear angle Γ, shape (P, n).
    """

    v: ndarray
    squared: ndarray
    angle: ndarray

    @cached_property
    def strain(self) -> ndarray:
        """Fibre strain ε of warp and weft, shape (2, P, n)."""
        return 0.5 * np.log(self.squared)


class Points(Protocol):
    """P points in each of n elements, and sums over them.

    ``A`` are the directions of warp and weft, shape (2, P, 2, n), ``dx`` the areas of
    the points, shape (P, n).  ``some`` are elements; what is given and returned has
    values for these only.
    """

    @property
    def A(self) -> ndarray: ...  # noqa: D102

    @property
    def dx(self) -> ndarray: ...  # noqa: D102

    def fibres(self, u: ndarray, some: slice) -> ndarray:
        """Σ_a b_a u_a of warp and weft, (2, P, 2, n), of motions (n_motions, 2, n)."""
        ...

    def forces(self, r: ndarray, some: slice) -> ndarray:
        """Σ b_a r over fibres and points, (n_motions, 2, n), of r (2, P, 2, n)."""
        ...

    def add_products(self, K: ndarray, m: ndarray, some: slice) -> None:
        """Add Σ b_a b_c m over fibres and points, m as (xx, xy, yy), (2, P, 3, n)."""
        ...

    def stretching(self, v: ndarray, some: slice) -> ndarray:
        """Σ b_a v over points for warp and weft, shape (2, n_motions, 2, n)."""
        ...

    def turning(self, v: ndarray, some: slice) -> ndarray:
        """∂Γ/∂u_a = b_a Jv of the warp less that of the weft, (P, n_motions, 2, n)."""
        ...


@dataclass(frozen=True, eq=False)
class NodePoints:
    """Points at which displacements of the same nodes of their elements meet.

    Attributes
    ----------
    A, dx
        See `Points`.
    b
        b_a of warp and weft, shape (2, P, k, n).
    nodes
        Which of the nodes of an element these are, shape (k,).
    n_nodes
        How many there are.
    """

    A: ndarray
    dx: ndarray
    b: ndarray
    nodes: ndarray
    n_nodes: int

    def fibres(self, u: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        return np.einsum("fpan,ain->fpin", self.b[..., some], u[self.nodes])

    def forces(self, r: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        f = np.zeros((self.n_nodes, *r.shape[2:]))
        f[self.nodes] = np.einsum("fpan,fpin->ain", self.b[..., some], r)
        return f

    def add_products(self, K: ndarray, m: ndarray, some: slice) -> None:
        """See `Points`."""
        b = self.b[..., some]
        for pair, a, c in self._pairs:
            _add(K[pair], np.einsum("fpn,fpcn->cn", b[:, :, a] * b[:, :, c], m))

    def stretching(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        g = np.zeros((2, self.n_nodes, *v.shape[2:]))
        g[:, self.nodes] = np.einsum("fpan,fpin->fain", self.b[..., some], v)
        return g

    def turning(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        (b1, b2), (v1, v2) = self.b[..., some, None].swapaxes(-1, -2), v[:, :, None]
        g = np.zeros((len(self.dx), self.n_nodes, *v.shape[2:]))
        g[:, self.nodes] = b1 * _turned(v1) - b2 * _turned(v2)
        return g

    @cached_property
    def _pairs(self) -> list[tuple[int, int, int]]:
        """Pairs of the k nodes, each after its number among those of the element."""
        number = np.zeros((self.n_nodes, self.n_nodes), dtype=int)
        first, second = np.triu_indices(self.n_nodes)
        number[first, second] = number[second, first] = np.arange(len(first))
        pairs = np.transpose(np.triu_indices(len(self.nodes)))
        return [(number[self.nodes[a], self.nodes[c]], a, c) for a, c in pairs]


@dataclass(frozen=True, eq=False)
class QuadPoints:
    """Points of bilinear quadrilaterals, whose fibres do not turn inside an element.

    There are three motions: of warp and weft at the centre, and of the hourglass, which
    moves fibres at a point by η.

    Attributes
    ----------
    A, dx
        See `Points`.
    eta
        η of warp and weft, shape (2, P, n).
    """

    A: ndarray
    dx: ndarray
    eta: ndarray

    def fibres(self, u: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        return u[:2, None] + self.eta[:, :, None, some] * u[2]

    def forces(self, r: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        hourglass = np.einsum("fpn,fpin->in", self.eta[..., some], r)
        return np.concatenate([r.sum(axis=1), hourglass[None]])

    def add_products(self, K: ndarray, m: ndarray, some: slice) -> None:
        """See `Points`."""
        eta = self.eta[..., some]
        mixed = eta[:, :, None] * m
        for own, beside, fibre, both in zip((0, 3), (2, 4), m, mixed, strict=True):
            _add(K[own], fibre.sum(axis=0))
            _add(K[beside], both.sum(axis=0))
        _add(K[5], np.einsum("fpn,fpcn->cn", eta, mixed))

    def stretching(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        g = np.zeros((2, 3, *v.shape[2:]))
        g[0, 0], g[1, 1] = v.sum(axis=1)
        g[:, 2] = np.einsum("fpn,fpin->fin", self.eta[..., some], v)
        return g

    def turning(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        eta = self.eta[..., some]
        g = np.empty((v.shape[1], 3, *v.shape[2:]))
        g[:, 0], g[:, 1] = _turned(v[0]), -_turned(v[1])
        g[:, 2] = eta[0][:, None] * g[:, 0] + eta[1][:, None] * g[:, 1]
        return g


def alike(one: Points, other: Points) -> bool:
    """Whether fibres at points of either, in elements with the same motions, agree."""
    if isinstance(one, QuadPoints) and isinstance(other, QuadPoints):
        moved = one.eta, other.eta
    elif isinstance(one, NodePoints) and isinstance(other, NodePoints):
        moved = one.b, other.b
    else:
        return False
    return np.array_equal(*moved) and np.array_equal(one.A, other.A)


def _add(K: ndarray, m: ndarray) -> None:
    """Add a symmetric 2×2 matrix, given as (xx, xy, yy)."""
    K[0, 0] += m[0]
    K[0, 1] += m[1]
    K[1, 0] += m[1]
    K[1, 1] += m[2]


def _turned(v: ndarray) -> ndarray:
    """Jv, of components on the last axis but one."""
    return np.stack([-v[..., 1, :], v[..., 0, :]], axis=-2)
