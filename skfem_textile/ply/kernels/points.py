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
from typing import Protocol, TypeAlias

import numpy as np
from numpy import ndarray

#: Stresses at points, or none.
Some: TypeAlias = ndarray | None

#: Tensions T, shear moments M and slopes E of the tensions.
Stresses: TypeAlias = tuple[Some, Some, Some]


@dataclass(frozen=True, eq=False)
class Motion:
    """What becomes of the fibres at P points of n elements.

    Attributes
    ----------
    v
        z/λ² of warp and weft, shape (2, P, 2, n): ∂ε/∂u_a = b_a v, ∂θ/∂u_a = b_a Jv.
    squared
        Squared stretch λ² of both, shape (2, P, n).
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

    def change(self, after: "Motion") -> ndarray:
        """Change of the strain to another motion, to first order, shape (2, P, n).

        ∂ε·Δz = v·Δz, and v·z = 1.
        """
        return (self.v * after.v).sum(axis=2) * after.squared - 1.0


class Points(Protocol):
    """P points in each of n elements, and sums over them.

    ``A`` are the directions of warp and weft, shape (2, P, 2, n), ``dx`` the areas of
    the points, shape (P, n).  ``some`` are elements; what is given and returned has
    values for these only: v, tensions T and their slopes E of warp and weft, shear
    moments M, or None where there are none.
    """

    @property
    def A(self) -> ndarray: ...  # noqa: D102

    @property
    def dx(self) -> ndarray: ...  # noqa: D102

    def motion(self, u: ndarray, some: slice) -> tuple[ndarray, ndarray, ndarray]:
        """z/λ² and λ² of the fibres, and the angle between them, for motions u."""
        ...

    def forces(self, v: ndarray, T: Some, M: Some, some: slice) -> ndarray:
        """Σ b_a (T v ± M Jv) over fibres and points, shape (n_motions, 2, n)."""
        ...

    def add_stiffness(
        self, K: ndarray, v: ndarray, stress: Stresses, some: slice
    ) -> None:
        """Add Σ b_a b_c (E v vᵀ + T ∂²ε ± M ∂²θ) over fibres and points."""
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

    def motion(self, u: ndarray, some: slice) -> tuple[ndarray, ndarray, ndarray]:
        """See `Points`."""
        A = np.broadcast_to(self.A, (*self.A.shape[:3], self.b.shape[-1]))[..., some]
        z = A + np.einsum("fpan,ain->fpin", self.b[..., some], u[self.nodes])
        squared = z[:, :, 0] ** 2 + z[:, :, 1] ** 2
        return z / squared[:, :, None], squared, between(z)

    def forces(self, v: ndarray, T: Some, M: Some, some: slice) -> ndarray:
        """See `Points`."""
        r = pulls(v, T, M)
        f = np.zeros((self.n_nodes, *r.shape[2:]))
        f[self.nodes] = np.einsum("fpan,fpin->ain", self.b[..., some], r)
        return f

    def add_stiffness(
        self, K: ndarray, v: ndarray, stress: Stresses, some: slice
    ) -> None:
        """See `Points`."""
        b, m = self.b[..., some], curvature(v, *stress)
        for pair, a, c in self._pairs:
            add(K[pair], np.einsum("fpn,fpcn->cn", b[:, :, a] * b[:, :, c], m))

    def stretching(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        g = np.zeros((2, self.n_nodes, *v.shape[2:]))
        g[:, self.nodes] = np.einsum("fpan,fpin->fain", self.b[..., some], v)
        return g

    def turning(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        (b1, b2), (v1, v2) = self.b[..., some, None].swapaxes(-1, -2), v[:, :, None]
        g = np.zeros((len(self.dx), self.n_nodes, *v.shape[2:]))
        g[:, self.nodes] = b1 * turned(v1) - b2 * turned(v2)
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
        See `Points`; A is the same for all points.
    eta
        η of warp and weft, shape (2, P, n).
    """

    A: ndarray
    dx: ndarray
    eta: ndarray

    def motion(self, u: ndarray, some: slice) -> tuple[ndarray, ndarray, ndarray]:
        """See `Points`."""
        A = np.broadcast_to(self.A, (2, 1, 2, self.eta.shape[-1]))
        z = A[..., some] + u[:2, None] + self.eta[..., some][:, :, None] * u[2]
        squared = z[:, :, 0] ** 2 + z[:, :, 1] ** 2
        return z / squared[:, :, None], squared, between(z)

    def forces(self, v: ndarray, T: Some, M: Some, some: slice) -> ndarray:
        """See `Points`."""
        r = pulls(v, T, M)
        hourglass = np.einsum("fpn,fpin->in", self.eta[..., some], r)
        return np.concatenate([r.sum(axis=1), hourglass[None]])

    def add_stiffness(
        self, K: ndarray, v: ndarray, stress: Stresses, some: slice
    ) -> None:
        """See `Points`."""
        eta, m = self.eta[..., some], curvature(v, *stress)
        mixed = eta[:, :, None] * m
        for own, beside, fibre, both in zip((0, 3), (2, 4), m, mixed, strict=True):
            add(K[own], fibre.sum(axis=0))
            add(K[beside], both.sum(axis=0))
        add(K[5], np.einsum("fpn,fpcn->cn", eta, mixed))

    def stretching(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        g = np.zeros((2, 3, *v.shape[2:]))
        g[0, 0], g[1, 1] = v.sum(axis=1)
        g[:, 2] = np.einsum("fpn,fpin->fin", self.eta[..., some], v)
        return g

    def turning(self, v: ndarray, some: slice) -> ndarray:
        """See `Points`."""
        eta, g = self.eta[..., some], np.empty((v.shape[1], 3, *v.shape[2:]))
        g[:, 0], g[:, 1] = turned(v[0]), -turned(v[1])
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


def pulls(v: ndarray, T: Some, M: Some) -> ndarray:
    """T v + M Jv of the warp, T v − M Jv of the weft: shape (2, P, 2, n)."""
    r = np.zeros(v.shape) if T is None else T[:, :, None] * v
    if M is not None:
        both = np.array([M, -M])
        r[:, :, 0] -= both * v[:, :, 1]
        r[:, :, 1] += both * v[:, :, 0]
    return r


def curvature(v: ndarray, T: Some, M: Some, E: Some) -> ndarray:
    """E v vᵀ + T ∂²ε + M ∂²θ per b_a b_c as (xx, xy, yy), shape (2, P, 3, n)."""
    x, y = v[:, :, 0], v[:, :, 1]
    xx, xy, yy = x * x, x * y, y * y
    turned, along = 2 * xy, xx - yy  # −∂²θ and −∂²ε of what is displaced along x
    first = second = np.zeros(1)
    if T is not None:
        first, second = T * along, T * turned
    if M is not None:
        both = np.array([M, -M])
        first, second = first - both * turned, second + both * along
    m = np.empty((*v.shape[:2], 3, v.shape[-1]))
    m[:, :, 0], m[:, :, 1], m[:, :, 2] = -first, -second, first
    if E is not None:
        m[:, :, 0] += E * xx
        m[:, :, 1] += E * xy
        m[:, :, 2] += E * yy
    return m


def between(z: ndarray) -> ndarray:
    """Angle from the first to the second fibre in (−π, π]."""
    (x1, y1), (x2, y2) = z.transpose(0, 2, 1, 3)
    return np.arctan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)


def turned(v: ndarray) -> ndarray:
    """Jv, of components on the last axis but one."""
    return np.stack([-v[..., 1, :], v[..., 0, :]], axis=-2)


def add(K: ndarray, m: ndarray) -> None:
    """Add a symmetric 2×2 matrix, given as (xx, xy, yy)."""
    K[0, 0] += m[0]
    K[0, 1] += m[1]
    K[1, 0] += m[1]
    K[1, 1] += m[2]
