"""Integration points of elements, and the fibres there.

A fibre a = F·A is linear in the modes u_a of an element,

    a = A + Σ_a b_a u_a,

so that one number per mode, fibre and point is all that a kernel needs of a mesh.
The modes are displacements of nodes, with b_a = A·∇N_a, or combinations of these.
Element matrices are symmetric and hold the d×d blocks of the pairs of modes (a, c)
with a ≤ c, in the order of `numpy.triu_indices`: shape (n_pairs, d, d, n).

In the plane a fibre written as a complex number z = a_x + i a_y has the logarithm
ε + iθ, its strain and its inclination.  `in_space` has what takes the place of that.
Symmetric d×d matrices are given by their entries at and above the diagonal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy import ndarray

#: Values at points; None for zero.
Values: TypeAlias = ndarray | None


@dataclass(frozen=True, eq=False)
class FibreDeformation:
    """Deformation of the fibres at P points of n elements, in the plane.

    Attributes
    ----------
    v
        a/λ² of warp and weft, shape (2, P, d, n): ∂ε/∂u_a = b_a v, and in the plane
        ∂θ/∂u_a = b_a Jv.
    squared_stretch
        Squared stretch λ² of both, shape (2, P, n).
    shear_angle
        Shear angle Γ, shape (P, n).
    """

    v: ndarray
    squared_stretch: ndarray
    shear_angle: ndarray

    @cached_property
    def strain(self) -> ndarray:
        """Fibre strain ε of warp and weft, shape (2, P, n)."""
        return 0.5 * np.log(self.squared_stretch)

    def change(self, after: "FibreDeformation") -> ndarray:
        """Change of the strain to another deformation, to first order, shape (2, P, n).

        ∂ε·Δz = v·Δz, and v·z = 1.
        """
        return (self.v * after.v).sum(axis=2) * after.squared_stretch - 1.0

    def forces(self, T: Values, M: Values, block: slice) -> ndarray:
        """T v + M ∂Γ of warp and weft, T and M those of a block, shape (2, P, d, n)."""
        v = self.v[..., block]
        forces = np.zeros(v.shape) if T is None else T[:, :, None] * v
        if M is not None:
            signed = np.array([M, -M])
            forces[:, :, 0] -= signed * v[:, :, 1]
            forces[:, :, 1] += signed * v[:, :, 0]
        return forces

    def stiffness(
        self, stress: "Stress", block: slice
    ) -> tuple[ndarray, ndarray | None]:
        """E v vᵀ + T ∂²ε + M ∂²Γ with the stress of a block.

        Parameters
        ----------
        stress
            That of the block.
        block
            Elements.

        Returns
        -------
        tuple
            Of each fibre with itself, per b_a b_c, shape (2, P, d (d + 1)/2, n); and of
            warp with weft, (P, d (d + 1)/2, n), None where they do not couple.
        """
        T, M, E = stress
        x, y = self.v[:, :, 0, block], self.v[:, :, 1, block]
        xx, xy, yy = x * x, x * y, y * y
        minus_theta, minus_eps = 2 * xy, xx - yy  # the xx entries of −∂²θ and −∂²ε
        first = second = np.zeros(1)
        if T is not None:
            first, second = T * minus_eps, T * minus_theta
        if M is not None:
            signed = np.array([M, -M])
            first, second = first - signed * minus_theta, second + signed * minus_eps
        own = np.empty((*x.shape[:2], 3, x.shape[-1]))
        own[:, :, 0], own[:, :, 1], own[:, :, 2] = -first, -second, first
        if E is not None:
            own[:, :, 0] += E * xx
            own[:, :, 1] += E * xy
            own[:, :, 2] += E * yy
        return own, None

    def angle_derivatives(self, block: slice) -> tuple[ndarray, ndarray]:
        """∂Γ by warp and weft, shape (P, d, n) each."""
        v = self.v[..., block]
        warp, weft = np.stack([-v[:, :, 1], v[:, :, 0]], axis=2)
        return warp, -weft


class Stress(NamedTuple):
    """Tension and its slope, (2, P, n), and shear moment, (P, n), times area.

    None stands for zero.
    """

    tension: ndarray | None = None
    moment: ndarray | None = None
    slope: ndarray | None = None

    def plus(self, other: "Stress") -> "Stress":
        """The sum of both."""
        pairs = zip(self, other, strict=True)
        return Stress(
            *(y if x is None else x if y is None else x + y for x, y in pairs)
        )

    def of(self, block: slice) -> "Stress":
        """The stresses of a block of elements."""
        return Stress(*(None if x is None else x[..., block] for x in self))


class RankOneStiffness(NamedTuple):
    """Stiffness s of P strains of each element, shape (P, n), and their gradients g.

    ``gradients`` takes a block of elements and returns shape (P, n_modes, d, n_block).
    """

    stiffness: ndarray
    gradients: Callable[[slice], ndarray]


class IntegrationPoints(Protocol):
    """P integration points in each of n elements, and sums over them.

    ``A`` are the directions of warp and weft, shape (2, P, d, n), ``dx`` the areas of
    the points, shape (P, n).  ``block`` selects elements.  Arguments and results
    have values for these only.
    """

    @property
    def A(self) -> ndarray: ...  # noqa: D102

    @property
    def dx(self) -> ndarray: ...  # noqa: D102

    def fibres(self, u: ndarray, block: slice) -> ndarray:
        """Fibre vectors a of warp and weft, shape (2, P, d, n), for modes u."""
        ...

    def forces(self, forces: ndarray, block: slice) -> ndarray:
        """Σ b_a f over fibres and points, shape (n_modes, d, n)."""
        ...

    def add_stiffness(
        self, K: ndarray, own: ndarray, across: ndarray | None, block: slice
    ) -> None:
        """Add Σ b_a b_c k over fibres and points, as of `FibreDeformation.stiffness`.

        The coupling of warp and weft goes with b¹_a b²_c + b²_a b¹_c.
        """
        ...

    def strain_gradients(self, v: ndarray, block: slice) -> ndarray:
        """Σ b_a v over points for warp and weft, shape (2, n_modes, d, n)."""
        ...

    def gradients(self, warp: ndarray, weft: ndarray, block: slice) -> ndarray:
        """Σ b_a x over the fibres of each point, shape (P, n_modes, d, n).

        x of warp and weft has the shape (P, d, n): v for ε₁ + ε₂, ∂Γ for Γ.
        """
        ...


@dataclass(frozen=True, eq=False)
class GeneralPoints:
    """Integration points of any element, whose modes are displacements of its nodes.

    Attributes
    ----------
    A, dx
        See `IntegrationPoints`.
    b
        b_a of warp and weft, shape (2, P, k, n).
    nodes
        Nodes of the element that move the fibres there, shape (k,).
    n_nodes
        Number of nodes of the element.
    """

    A: ndarray
    dx: ndarray
    b: ndarray
    nodes: ndarray
    n_nodes: int

    def fibres(self, u: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        A = np.broadcast_to(self.A, (*self.A.shape[:3], self.b.shape[-1]))[..., block]
        return A + np.einsum("fpan,ain->fpin", self.b[..., block], u[self.nodes])

    def forces(self, forces: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        f = np.zeros((self.n_nodes, *forces.shape[2:]))
        f[self.nodes] = np.einsum("fpan,fpin->ain", self.b[..., block], forces)
        return f

    def add_stiffness(
        self, K: ndarray, own: ndarray, across: ndarray | None, block: slice
    ) -> None:
        """See `IntegrationPoints`."""
        b = self.b[..., block]
        for pair, a, c in self._pairs:
            add_symmetric(
                K[pair], np.einsum("fpn,fpcn->cn", b[:, :, a] * b[:, :, c], own)
            )
            if across is not None:
                both = b[0, :, a] * b[1, :, c] + b[1, :, a] * b[0, :, c]
                add_symmetric(K[pair], np.einsum("pn,pcn->cn", both, across))

    def strain_gradients(self, v: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        g = np.zeros((2, self.n_nodes, *v.shape[2:]))
        g[:, self.nodes] = np.einsum("fpan,fpin->fain", self.b[..., block], v)
        return g

    def gradients(self, warp: ndarray, weft: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        b_1, b_2 = self.b[..., block, None].swapaxes(-1, -2)
        g = np.zeros((len(self.dx), self.n_nodes, *warp.shape[1:]))
        g[:, self.nodes] = b_1 * warp[:, None] + b_2 * weft[:, None]
        return g

    @cached_property
    def _pairs(self) -> list[tuple[int, int, int]]:
        """Pairs of the k nodes, after their numbers among all pairs of the element."""
        number = np.zeros((self.n_nodes, self.n_nodes), dtype=int)
        first, second = np.triu_indices(self.n_nodes)
        number[first, second] = number[second, first] = np.arange(len(first))
        pairs = np.transpose(np.triu_indices(len(self.nodes)))
        return [(number[self.nodes[a], self.nodes[c]], a, c) for a, c in pairs]


@dataclass(frozen=True, eq=False)
class QuadPoints:
    """Integration points of bilinear quadrilaterals with constant fibre directions.

    There are three modes: the changes of warp and weft at the centre, and the hourglass
    mode, which changes fibres at a point by η.

    Attributes
    ----------
    A, dx
        See `IntegrationPoints`; A is the same for all points.
    eta
        η of warp and weft, shape (2, P, n).
    """

    A: ndarray
    dx: ndarray
    eta: ndarray

    def fibres(self, u: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        A = np.broadcast_to(self.A, (*self.A.shape[:3], self.eta.shape[-1]))
        return A[..., block] + u[:2, None] + self.eta[..., block][:, :, None] * u[2]

    def forces(self, forces: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        hourglass = np.einsum("fpn,fpin->in", self.eta[..., block], forces)
        return np.concatenate([forces.sum(axis=1), hourglass[None]])

    def add_stiffness(
        self, K: ndarray, own: ndarray, across: ndarray | None, block: slice
    ) -> None:
        """See `IntegrationPoints`."""
        eta = self.eta[..., block]
        mixed = eta[:, :, None] * own
        # pairs of modes: 0, 3, 5 of one with itself, 2, 4 with the hourglass mode
        for diagonal, coupled, fibre, product in zip(
            (0, 3), (2, 4), own, mixed, strict=True
        ):
            add_symmetric(K[diagonal], fibre.sum(axis=0))
            add_symmetric(K[coupled], product.sum(axis=0))
        add_symmetric(K[5], np.einsum("fpn,fpcn->cn", eta, mixed))
        if across is not None:  # pair 1 is that of warp and weft
            by_warp, by_weft = eta[:, :, None] * across
            add_symmetric(K[1], across.sum(axis=0))
            add_symmetric(K[2], by_weft.sum(axis=0))
            add_symmetric(K[4], by_warp.sum(axis=0))
            add_symmetric(K[5], 2 * np.einsum("pn,pcn->cn", eta[0], by_weft))

    def strain_gradients(self, v: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        g = np.zeros((2, 3, *v.shape[2:]))
        g[0, 0], g[1, 1] = v.sum(axis=1)
        g[:, 2] = np.einsum("fpn,fpin->fin", self.eta[..., block], v)
        return g

    def gradients(self, warp: ndarray, weft: ndarray, block: slice) -> ndarray:
        """See `IntegrationPoints`."""
        eta, g = self.eta[..., block], np.empty((len(warp), 3, *warp.shape[1:]))
        g[:, 0], g[:, 1] = warp, weft
        g[:, 2] = eta[0][:, None] * g[:, 0] + eta[1][:, None] * g[:, 1]
        return g


def same_deformation(one: IntegrationPoints, other: IntegrationPoints) -> bool:
    """Whether equal modes deform the fibres at both sets of points equally."""
    if isinstance(one, QuadPoints) and isinstance(other, QuadPoints):
        factors = one.eta, other.eta
    elif isinstance(one, GeneralPoints) and isinstance(other, GeneralPoints):
        factors = one.b, other.b
    else:
        return False
    return np.array_equal(*factors) and np.array_equal(one.A, other.A)


def angle_between(z: ndarray) -> ndarray:
    """Angle from the first to the second fibre in (−π, π]."""
    (x1, y1), (x2, y2) = z.transpose(0, 2, 1, 3)
    return np.arctan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)


def add_symmetric(K: ndarray, stiffness: ndarray) -> None:
    """Add a symmetric matrix, given by its entries at and above the diagonal."""
    places = combinations_with_replacement(range(len(K)), 2)
    for (i, j), entry in zip(places, stiffness, strict=True):
        K[i, j] += entry
        if i != j:
            K[j, i] += entry
