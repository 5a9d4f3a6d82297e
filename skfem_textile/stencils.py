"""Points of elements, and what a fibre there needs of the reference configuration.

A fibre a = F·A written as a complex number z = a_x + i a_y has the logarithm ε + iθ,
its strain and its inclination.  It is linear in the displacements u_a of the nodes,

    z = A + Σ_a b_a u_a,    b_a = A·∇N_a,

so that one number per node, fibre and point holds all that a kernel needs of a mesh.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy import ndarray

from .elements import HourglassBasis, centre_grad
from .fabric import Fabric
from .macro import MacroBasis

# Elements at a time: what these need stays in the processor's cache.
_BLOCK = 4096

_ALL = slice(None)

_KNOWN: WeakKeyDictionary[Any, WeakKeyDictionary] = WeakKeyDictionary()


class Motion(NamedTuple):
    """What becomes of the fibres at P points of n elements.

    Attributes
    ----------
    v
        z/|z|² of warp and weft, shape (2, P, 2, n): ∂ε/∂u_a = b_a v, ∂θ/∂u_a = b_a Jv.
    strain
        Fibre strain ε of both, shape (2, P, n).
    angle
        Shear angle Γ, shape (P, n).
    """

    v: ndarray
    strain: ndarray
    angle: ndarray


@dataclass(frozen=True, eq=False)
class Points:
    """Points of some elements at which the same of their nodes meet.

    Attributes
    ----------
    nodes
        Which of the nodes of an element these are, shape (k,).
    b
        b_a of warp and weft, shape (2, P, k, n).
    A
        Reference directions of both, shape (2, P, 2, n), or 1 in place of P and n.
    dx
        Area of the points, shape (P, n).
    """

    nodes: ndarray
    b: ndarray
    A: ndarray
    dx: ndarray

    def motion(self, u: ndarray) -> Motion:
        """The motion under displacements of the elements' nodes, (n_nodes, 2, n)."""
        u, (_, P, _, n) = u[self.nodes], self.b.shape
        z = np.empty((2, P, 2, n))
        for some in blocks(n):
            np.einsum(
                "fpan,ain->fpin", self.b[..., some], u[..., some], out=z[..., some]
            )
        z += self.A
        squared = z[:, :, 0] ** 2 + z[:, :, 1] ** 2
        angle = self._rest - _between(z)
        z /= squared[:, :, None]
        return Motion(z, 0.5 * np.log(squared), angle)

    def same(self, other: "Points") -> bool:
        """Whether fibres move alike at other points."""
        return all(
            np.array_equal(one, two)
            for one, two in ((self.nodes, other.nodes), (self.b, other.b))
        ) and np.array_equal(self._rest, other._rest)

    @cached_property
    def _rest(self) -> ndarray:
        return _between(self.A)


@dataclass(frozen=True, eq=False)
class Stencil:
    """Elements of one kind.

    Attributes
    ----------
    nodes
        Numbers of their nodes, shape (n_nodes, n).
    points
        Their points, by the nodes that meet there.
    whole
        Area of all elements of the basis.
    elements, at
        Their numbers, and those of the points, in the basis.
    """

    nodes: ndarray
    points: Sequence[Points]
    whole: float
    elements: Any
    at: Sequence[Any]

    @cached_property
    def area(self) -> ndarray:
        """Area of each element, shape (n,)."""
        return sum(points.dx.sum(axis=0) for points in self.points)

    def given(self, values: ndarray) -> list[ndarray]:
        """Values at the points of the basis, (..., n_elements, n_points), at these.

        Shape (..., P, n) each.
        """
        some = np.asarray(values)[..., self.elements, :]
        return [np.moveaxis(some[..., at], -1, -2) for at in self.at]

    def motions(self, u: ndarray, of: Sequence[Points] | None = None) -> list[Motion]:
        """The motion under a DOF vector ``u`` at all or some of the points."""
        x, y = u.reshape(-1, 2).T.copy()
        local = np.stack([x[self.nodes], y[self.nodes]], axis=1)
        return [p.motion(local) for p in (self.points if of is None else of)]


def stencils(basis: Any, fabric: Fabric) -> list[Stencil]:
    """The elements of a basis of the displacement by their kinds, found once.

    The corners of `HourglassBasis` come after its centre, seen by the fibres of the
    corners, which weighs nothing.
    """
    known = _KNOWN.setdefault(basis, WeakKeyDictionary())
    if fabric not in known:
        known[fabric] = list(_found(basis, fabric))
    return known[fabric]


def _found(basis: Any, fabric: Fabric) -> Iterator[Stencil]:
    dN = np.array([field.grad[0] for (field,) in basis.basis[::2]])
    w, nodes = basis.default_parameters(), basis.element_dofs[::2] // 2
    x = np.asarray(w["x"])
    pair = fabric.directions(x, w.get("element"))
    A = np.array([np.broadcast_to(a, x.shape) for a in pair])
    if isinstance(basis, MacroBasis):
        yield from _macro(basis, nodes, dN, A)
        return
    every = np.arange(len(nodes))
    if not isinstance(basis, HourglassBasis):
        points = [_points(every, dN, A, basis.dx)]
        yield Stencil(nodes, points, basis.dx.sum(), _ALL, [_ALL])
        return
    centre = np.array([centre_grad(field)[0] for (field,) in basis.basis[::2]])
    corners = _points(every, dN + centre, A, basis.dx)
    # Once for all corners of an element in which the directions do not vary.
    some = slice(1 if np.all(A[..., :1] == A) else None)
    middle = _points(every, centre[..., some], A[..., some], 0 * basis.dx[:, some])
    yield Stencil(nodes, [middle, corners], basis.dx.sum(), _ALL, [_ALL, _ALL])


def blocks(n: int) -> Iterator[slice]:
    """Slices of the elements that keep what is computed in the cache."""
    return (slice(i, i + _BLOCK) for i in range(0, n, _BLOCK))


def _macro(
    basis: MacroBasis, nodes: ndarray, dN: ndarray, A: ndarray
) -> Iterator[Stencil]:
    """Macro-elements by kind: where the nodes of their parts meet."""
    flat = basis.corners.reshape(-1, basis.nelems)
    patterns, kinds = np.unique(flat, axis=1, return_inverse=True)
    for kind, pattern in enumerate(patterns.T):
        some = np.flatnonzero(kinds.ravel() == kind)
        corners = pattern.reshape(4, -1).T[basis.parts[some[0]] >= 0]
        points = [
            _points(
                own,
                dN[own][..., some, j : j + 1],
                A[..., some, j : j + 1],
                basis.dx[some, j : j + 1],
            )
            for j, own in enumerate(corners)
        ]
        at = [slice(j, j + 1) for j in range(len(points))]
        own = nodes[: corners.max() + 1, some]
        yield Stencil(own, points, basis.dx.sum(), some, at)


def _points(nodes: ndarray, dN: ndarray, A: ndarray, dx: ndarray) -> Points:
    """Points from gradients (k, 2, n, P) and directions (2, 2, n, P)."""
    b = sum(A[:, None, J] * dN[:, J] for J in range(2))
    return Points(
        nodes,
        np.ascontiguousarray(b.transpose(0, 3, 1, 2)),
        A.transpose(0, 3, 1, 2),
        np.ascontiguousarray(dx.T),
    )


def _between(z: ndarray) -> ndarray:
    """Angle from the first to the second fibre in (−π, π]."""
    (x1, y1), (x2, y2) = z.transpose(0, 2, 1, 3)
    return np.arctan2(x1 * y2 - y1 * x2, x1 * x2 + y1 * y2)
