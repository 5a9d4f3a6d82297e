"""Elements of a basis and their points, as kernels need them; found once."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy import ndarray
from skfem import ElementQuad1

from ...fabric import Fabric
from ...mesh.bases import CENTRE, HourglassBasis, centre_grad, element_numbers
from ...mesh.macro import MacroBasis
from .points import Motion, NodePoints, Points, QuadPoints, between

# Elements at a time: what these need stays in the processor's cache.
_BLOCK = 8192

_ALL = slice(None)

_KNOWN: WeakKeyDictionary[Any, WeakKeyDictionary] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Stencil:
    """Elements of one kind.

    Attributes
    ----------
    nodes
        Numbers of their nodes, shape (n_nodes, n).
    modes
        Their motions per displacement of the nodes, shape (n_motions, n_nodes, n); None
        where the motions are the displacements.
    points
        Their points, those with the same motions together.
    fabrics, fabric
        The fabric with its laws at the points, and at the elements (`Fabric.at`), for
        arguments in the order of the forms.
    whole
        Area of all elements of the basis.
    elements, at
        Their numbers, and those of the points, in the basis.
    """

    nodes: ndarray
    modes: ndarray | None
    points: Sequence[Points]
    fabrics: Sequence[Fabric]
    fabric: Fabric
    whole: float
    elements: Any
    at: Sequence[Any]

    def blocks(self) -> Iterator[slice]:
        """Slices of the elements that keep what is computed in the cache."""
        n = self.nodes.shape[1]
        return (slice(i, min(i + _BLOCK, n)) for i in range(0, n, _BLOCK))

    @property
    def n_motions(self) -> int:
        """How many motions an element has."""
        return len(self.nodes if self.modes is None else self.modes)

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

    def put(self, values: ndarray, own: Sequence[ndarray]) -> None:
        """Put values at these points, as `given` gives them, where they belong."""
        for at, x in zip(self.at, own, strict=True):
            values[..., self.elements, at] = np.moveaxis(x, -1, -2)

    def motions(self, u: ndarray, of: Sequence[Points] | None = None) -> list[Motion]:
        """The motion under a DOF vector ``u`` at all or some of the points."""
        x, y = u.reshape(-1, 2).T.copy()
        local = np.stack([x[self.nodes], y[self.nodes]], axis=1)
        if self.modes is not None:
            local = transformed(self, "ran,ain->rin", local)
        return [_motion(self, p, local) for p in (self.points if of is None else of)]

    def alike(self, other: "Stencil") -> bool:
        """Whether the elements of another have the same nodes and motions."""
        if self.modes is None or other.modes is None:
            return self.modes is other.modes and np.array_equal(self.nodes, other.nodes)
        return np.array_equal(self.modes, other.modes) and np.array_equal(
            self.nodes, other.nodes
        )


def stencils(basis: Any, fabric: Fabric) -> list[Stencil]:
    """The elements of a basis of the displacement by their kinds, found once.

    What a basis holds must not be changed after this.
    The corners of `HourglassBasis` come after its centre, seen by the fibres of the
    corners, which weighs nothing.
    """
    known = _KNOWN.setdefault(basis, WeakKeyDictionary())
    if fabric not in known:
        known[fabric] = list(_found(basis, fabric))
    return known[fabric]


def transformed(at: Stencil, rule: str, x: ndarray) -> ndarray:
    """`numpy.einsum` of the modes and what belongs to nodes or motions, (k, 2, n)."""
    modes: Any = at.modes
    parts = [np.einsum(rule, modes[..., s], x[..., s]) for s in at.blocks()]
    return np.concatenate(parts, axis=-1)


def _motion(at: Stencil, points: Points, u: ndarray) -> Motion:
    P, n = points.dx.shape[0], u.shape[-1]
    squared, angle, v = (np.empty((*k, n)) for k in ((2, P), (P,), (2, P, 2)))
    for some in at.blocks():
        found = points.motion(u[..., some], some)
        v[..., some], squared[..., some], angle[..., some] = found
    return Motion(v, squared, between(points.A) - angle)


def _found(basis: Any, fabric: Fabric) -> Iterator[Stencil]:
    dN = np.array([field.grad[0] for (field,) in basis.basis[::2]])
    w, nodes = basis.default_parameters(), basis.element_dofs[::2] // 2
    x = np.asarray(w["x"])
    numbers = np.asarray(w["element"]) if "element" in w else element_numbers(basis)
    pair = fabric.directions(x, numbers)
    A = np.array([np.broadcast_to(a, x.shape) for a in pair])
    if isinstance(basis, MacroBasis):
        yield from _macro(basis, fabric, nodes, dN, A)
        return
    centre = None
    if isinstance(basis, HourglassBasis):
        centre = np.array([centre_grad(field)[0] for (field,) in basis.basis[::2]])
        dN = dN + centre
    bilinear = (
        isinstance(basis.elem.elem, ElementQuad1)
        and basis.mesh.elem is ElementQuad1
        and np.all(A[..., :1] == A)
    )
    points = _of_quadrilaterals if bilinear else _of_nodes
    modes, found = points(basis, A, dN, centre)
    n, here = len(found), fabric.at(numbers)
    own, whole = fabric.at(numbers[:, :1]), basis.dx.sum()
    yield Stencil(nodes, modes, found, n * [here], own, whole, _ALL, n * [_ALL])


def _of_nodes(
    basis: Any, A: ndarray, dN: ndarray, centre: ndarray | None
) -> tuple[None, list[Points]]:
    """Points of any element, after its centre if that counts."""
    every, dx = np.arange(len(dN)), basis.dx.T
    there = [(dN, dx)] if centre is None else [(centre, 0 * dx), (dN, dx)]
    return None, [
        NodePoints(_directions(A), area, _products(A, gradients), every, len(dN))
        for gradients, area in there
    ]


def _of_quadrilaterals(
    basis: Any, A: ndarray, dN: ndarray, centre: ndarray | None
) -> tuple[ndarray, list[Points]]:
    """Motions of bilinear quadrilaterals, (3, 4, n), and points, after the centre.

    The gradients at a point differ from those at the centre by γ_a ∇h, where γ is the
    hourglass vector (Flanagan & Belytschko 1981).
    """
    scalar, mapping, tind = ElementQuad1(), basis.mapping, basis.tind
    fields = (scalar.gbasis(mapping, CENTRE[0], a, tind)[0] for a in range(4))
    middle = np.array([field.grad for field in fields])
    h = np.array([1.0, -1.0, 1.0, -1.0])
    corners = basis.mesh.p[:, basis.mesh.t[:, _ALL if tind is None else tind]]
    gamma = h[:, None] - np.einsum("b,jbn,ajn->an", h, corners, middle[..., 0])
    slope = np.einsum("an,ajnq->jnq", gamma / (gamma**2).sum(axis=0), dN - middle)
    modes = np.concatenate([_products(A[..., :1], middle)[:, 0], gamma[None]])

    still = _directions(A[..., :1])
    eta, dx = (A * slope).sum(axis=1).swapaxes(1, 2), basis.dx.T
    there = [] if centre is None else [QuadPoints(still, 0 * dx[:1], 0 * eta[:, :1])]
    return modes, [*there, QuadPoints(still, dx, eta)]


def _macro(
    basis: MacroBasis, fabric: Fabric, nodes: ndarray, dN: ndarray, A: ndarray
) -> Iterator[Stencil]:
    """Macro-elements by kind: where the nodes of their parts meet."""
    flat = basis.corners.reshape(-1, basis.nelems)
    patterns, kinds = np.unique(flat, axis=1, return_inverse=True)
    for kind, pattern in enumerate(patterns.T):
        some = np.flatnonzero(kinds.ravel() == kind)
        corners = pattern.reshape(4, -1).T[basis.parts[some[0]] >= 0]
        own = nodes[: corners.max() + 1, some]
        at = [slice(j, j + 1) for j in range(len(corners))]
        points: list[Points] = [
            NodePoints(
                _directions(A[..., some, j]),
                basis.dx[some, j].T,
                _products(A[..., some, j], dN[four][..., some, j]),
                four,
                len(own),
            )
            for j, four in zip(at, corners, strict=True)
        ]
        fabrics = [fabric.at(basis.parts[some, j]) for j in at]
        whole = basis.dx.sum()
        yield Stencil(own, None, points, fabrics, fabrics[0], whole, some, at)


def _products(A: ndarray, dN: ndarray) -> ndarray:
    """A·∇N_a, shape (2, P, k, n)."""
    b = A[:, None, 0] * dN[:, 0] + A[:, None, 1] * dN[:, 1]
    return np.ascontiguousarray(b.transpose(0, 3, 1, 2))


def _directions(A: ndarray) -> ndarray:
    """Directions (2, 2, n, P) in the order of `Points`."""
    return A.transpose(0, 3, 1, 2)
