"""Bending of fibres by a law M(κ), one family at a time: energy and derivatives.

The curvature vector m of `curvature_of` is linear in the displacement.  A symmetric law
with the energy φ has the energy φ(|m|) per area.  For another law the sign of the
curvature is defined by a unit normal n: in the plane the left of the fibre in the
direction of its reference direction, in space the normal of the ply, +z at rest.  The
curvature is positive where the fibre bends towards n.  With the even part φ_e and the
odd part φ_o of φ, the energy per area is

    φ_e(|m|) + φ_o(m·n),

φ(κ) for m = κ n, and φ_e for bending in the tangent plane of the ply, for which no side
is the positive one.

Friction elements act on the signed curvature m·n: bending in the tangent plane of a ply
in space has no friction.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import bsr_matrix, csr_matrix, vstack
from skfem import AbstractBasis

from ..fabric.law import Law, domain_of, law_at, loss, n_slips, slip_after, with_slip
from ..mesh.bases import components
from .curvature import Curvature, gradient_along

# Curvature in 1/mm below which M(κ)/κ is the tangent at 0: a radius of 1000 km.
_STRAIGHT = 1e-12

# Arguments at which the two sides of a law are compared, relative to the largest one,
# and the relative difference of equal values: round-off.
_COMPARED, _SAME = np.linspace(0.0, 1.0, 65)[1:], 1e-12


class Frame(NamedTuple):
    """Fibre directions from which the normal is computed, linear in v.

    a = a₀ + G v is the direction of the family in the plane, and in space the
    directions of warp and weft, each a column of d components.  The normal is ``sign``
    times the direction of the first one turned to the left, or of their cross product.
    """

    operator: csr_matrix
    at_rest: ndarray
    sign: ndarray


class Moments(NamedTuple):
    """Energy per area, and its derivatives by |m| or m·n, at the sites, (n_sites,)."""

    energy: ndarray
    value: ndarray
    tangent: ndarray


@dataclass(frozen=True, eq=False)
class BentFibres:
    """Fibres of one family with a bending law.

    Attributes
    ----------
    name
        Name of the family.
    law
        The law, without friction.
    curvature
        Curvature vectors.
    frame
        Directions that define the sign of the curvature; None for a symmetric law
        without friction.
    d
        Number of components.
    symmetric
        True if the law is symmetric.
    friction
        Friction elements of the law; None if there are none.
    """

    name: str
    law: Law
    curvature: Curvature
    frame: Frame | None
    d: int
    symmetric: bool
    friction: Any = None

    def energy(self, v: ndarray, slip: ndarray | None = None) -> float:
        """Energy in N·mm; not a number beyond the domain of the law.

        ``slip`` is the slip of the friction elements at the points, shape (n_slips,
        n_elements, n_points); by default there is none.
        """
        m = self._vectors(v)
        size = np.linalg.norm(m, axis=1)
        lost = 0.0
        if self.friction is not None:
            q = self._signed(m, v).value
            lost = float(self._moments(q, self._slipped(slip)).energy.sum())
        if self.symmetric:
            return float(self._moments(size).energy.sum()) + lost
        q = self._signed(m, v).value
        even, odd = self._parts(size, q)
        return float(even.energy.sum() + odd.energy.sum()) + lost

    def forces(self, v: ndarray, slip: ndarray | None = None) -> ndarray:
        """Derivative of the energy by v."""
        m = self._vectors(v)
        if self.friction is None:
            return self._elastic_forces(m, v)
        q = self._signed(m, v)
        moment = self._moments(q.value, self._slipped(slip)).value
        of_friction = self._every.T @ (moment[:, None] * q.gradient).ravel()
        return self._elastic_forces(m, v) + of_friction

    def _elastic_forces(self, m: ndarray, v: ndarray) -> ndarray:
        size = np.linalg.norm(m, axis=1)
        C = self.curvature.operator
        if self.symmetric:
            return C.T @ (_ratio(self._moments(size), size)[:, None] * m).ravel()
        q = self._signed(m, v)
        even, odd = self._parts(size, q.value)
        by_y = odd.value[:, None] * q.gradient
        by_y[:, : self.d] += _ratio(even, size)[:, None] * m
        return self._every.T @ by_y.ravel()

    def stiffness(self, v: ndarray, slip: ndarray | None = None) -> csr_matrix:
        """Second derivative of the energy by v, symmetric."""
        m = self._vectors(v)
        if self.friction is None:
            return self._elastic_stiffness(m, v)
        q = self._signed(m, v)
        H = _of_signed(self._moments(q.value, self._slipped(slip)), q)
        return self._elastic_stiffness(m, v) + _assembled(self._every, H)

    def _elastic_stiffness(self, m: ndarray, v: ndarray) -> csr_matrix:
        size = np.linalg.norm(m, axis=1)
        if self.symmetric:
            H = _of_magnitude(self._moments(size), m, size)
            return _assembled(self.curvature.operator, H)
        q = self._signed(m, v)
        even, odd = self._parts(size, q.value)
        H = _of_signed(odd, q)
        H[:, : self.d, : self.d] += _of_magnitude(even, m, size)
        return _assembled(self._every, H)

    def slip_at_rest(self) -> ndarray:
        """No slip of the friction elements, shape (n_slips, n_elements, n_points)."""
        return np.zeros((n_slips(self.friction), *self.curvature.site.shape))

    def slip_after(self, v: ndarray, slip: ndarray) -> tuple[ndarray, float]:
        """Slip at the end of a step to v, and the energy lost in N·mm."""
        q = self._signed(self._vectors(v), v).value
        law = law_at(self.friction, self._elements)
        after = slip_after(law, q[self.curvature.site], slip)
        lost = self.curvature.area * loss(law, after - slip)
        return after, float(lost.sum())

    def couples(self) -> ndarray:
        """Pairs of nodes coupled by the stiffness, shape (2, n)."""
        every = self.curvature.operator if self.frame is None else self._every
        stencil = abs(every)
        pairs = np.array((stencil.T @ stencil).nonzero()) // self.d
        return np.unique(pairs, axis=1)

    def curvatures(self, v: ndarray) -> ndarray:
        """Curvature at the points in 1/mm, positive for a symmetric law.

        Shape (n_elements, n_points); zero where the moment is zero.
        """
        m = self._vectors(v)
        size = np.linalg.norm(m, axis=1)
        if not self.symmetric:
            size = np.copysign(size, self._signed(m, v).value)
        acts = self.curvature.area > 0
        at_points: ndarray = size[self.curvature.site] * acts
        return at_points

    @property
    def ends(self) -> tuple[Any, Any]:
        """Smallest and largest curvature, opposite numbers: both signs are evaluated.

        Numbers, or one per element, shape (n_elements, 1).
        """
        low, high = domain_of(self._at_points)
        most = np.minimum(-np.asarray(low), high)
        return -most, most

    @cached_property
    def _at_points(self) -> Law:
        return law_at(self.law, self._elements)

    @property
    def _elements(self) -> ndarray:
        return np.arange(len(self.curvature.site))[:, None]

    def _slipped(self, slip: ndarray | None) -> Law:
        """Friction elements at the points, after slip."""
        at_points: Law = law_at(self.friction, self._elements)
        return with_slip(at_points, self.slip_at_rest() if slip is None else slip)

    @cached_property
    def _every(self) -> csr_matrix:
        """Operator of m and the directions, site by site."""
        assert self.frame is not None
        parts = self.curvature.operator, self.frame.operator
        return _by_site(parts, len(self.frame.sign))

    def _vectors(self, v: ndarray) -> ndarray:
        """Curvature vectors m at the sites, shape (n_sites, d)."""
        return (self.curvature.operator @ v).reshape(-1, self.d)

    def _moments(self, x: ndarray, law: Law | None = None) -> Moments:
        """A law at curvatures of the sites, summed over the areas of their points.

        By default the law without friction.
        """
        site, area = self.curvature.site, self.curvature.area
        law, at = law or self._at_points, np.where(area > 0, x[site], 0.0)
        low, high = domain_of(law)
        area = np.where((at < low) | (at > high), np.nan, area)

        def summed(function: Callable[[ndarray], Any]) -> ndarray:
            with np.errstate(all="ignore"):  # beyond the law: not a number
                values = area * function(at)
            return np.bincount(site.ravel(), values.ravel(), len(x))

        return Moments(*map(summed, (law.energy, law.value, law.tangent)))

    def _parts(self, size: ndarray, q: ndarray) -> tuple[Moments, Moments]:
        """Even part at |m|, and odd part at m·n."""
        plus, minus = self._moments(size), self._moments(-size)
        signs = 1, -1, 1
        triples = zip(plus, minus, signs, strict=True)
        even = Moments(*(0.5 * (a + s * b) for a, b, s in triples))
        plus, minus = self._moments(q), self._moments(-q)
        triples = zip(plus, minus, signs, strict=True)
        return even, Moments(*(0.5 * (a - s * b) for a, b, s in triples))

    def _signed(self, m: ndarray, v: ndarray) -> "_Signed":
        assert self.frame is not None
        moved = self.frame.at_rest.ravel() + self.frame.operator @ v
        a = moved.reshape(len(m), -1)
        return _signed(m, a, self.frame.sign)


def frame_of(
    basis: AbstractBasis, directions: Sequence[ndarray], sites: Curvature, x: ndarray
) -> Frame:
    """Frame at the sites of a curvature.

    Parameters
    ----------
    basis
        Basis of the displacement.
    directions
        Unit directions of the family, and in space of warp and weft, in each element,
        each of shape (2, n_elements).
    sites
        Curvature of the family.
    x
        Positions at rest as a displacement, shape (n_unknowns,).
    """
    d = components(basis)
    each = [gradient_along(basis, A, sites) for A in directions]
    n = each[0].shape[0] // d
    G = _by_site(each, n)
    at_rest = (G[:, : len(x)] @ x).reshape(n, -1)
    sign = np.ones(n)
    if d == 3:
        sign = np.sign(np.cross(at_rest[:, :3], at_rest[:, 3:])[:, 2])
    return Frame(G, at_rest, sign)


def _by_site(parts: Sequence[csr_matrix], n_sites: int) -> csr_matrix:
    """Operators one below the other, with their rows sorted by site."""
    ends = np.cumsum([0, *(x.shape[0] for x in parts)])
    rows = [np.arange(*of).reshape(n_sites, -1) for of in pairwise(ends)]
    return csr_matrix(vstack(parts, format="csr")[np.hstack(rows).ravel()])


class _Signed(NamedTuple):
    """m·n at the sites, and its derivatives by m and the directions."""

    value: ndarray
    gradient: ndarray
    hessian: ndarray


# Rotation to the left.
_LEFT = np.array([[0.0, -1.0], [1.0, 0.0]])


def _signed(m: ndarray, a: ndarray, sign: ndarray) -> _Signed:
    """m·c/|c| times a sign, where c is a turned to the left, or a₁ × a₂."""
    n_sites, d = m.shape
    if d == 2:
        c, J = a @ _LEFT.T, np.broadcast_to(_LEFT, (n_sites, 2, 2))
    else:
        a_1, a_2 = a[:, :3], a[:, 3:]
        c = np.cross(a_1, a_2)
        J = np.concatenate([_skew(-a_2), _skew(a_1)], axis=2)  # ∂c/∂a
    s = np.linalg.norm(c, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):  # folded: not a number
        n = c / s[:, None]
        q = (m * n).sum(axis=1)
        g = (m - q[:, None] * n) / s[:, None]  # ∂q/∂c
        P = np.eye(d) - n[:, :, None] * n[:, None]
        by_c = n[:, :, None] * g[:, None] / s[:, None, None]
        by_c = -(by_c + by_c.swapaxes(1, 2) + (q / s**2)[:, None, None] * P)
        mixed = (P / s[:, None, None]) @ J
    gradient = np.hstack([n, (g[:, None] @ J)[:, 0]])
    hessian = np.zeros((n_sites, gradient.shape[1], gradient.shape[1]))
    hessian[:, :d, d:], hessian[:, d:, :d] = mixed, mixed.swapaxes(1, 2)
    hessian[:, d:, d:] = J.swapaxes(1, 2) @ by_c @ J
    if d == 3:
        bilinear = -_skew(g)  # g·(da₁ × da₂) = da₁·(da₂ × g)
        hessian[:, 3:6, 6:] += bilinear
        hessian[:, 6:, 3:6] += bilinear.swapaxes(1, 2)
    each = sign[:, None]
    return _Signed(sign * q, each * gradient, each[..., None] * hessian)


def _skew(a: ndarray) -> ndarray:
    """Matrices of a × x, shape (n, 3, 3)."""
    return np.cross(a[:, None], np.eye(3)).swapaxes(1, 2)


def _ratio(of: Moments, size: ndarray) -> ndarray:
    """M(κ)/κ; the tangent at 0."""
    bent = size > _STRAIGHT
    return np.where(bent, of.value / np.where(bent, size, 1.0), of.tangent)


def _of_magnitude(of: Moments, m: ndarray, size: ndarray) -> ndarray:
    """Second derivatives of φ(|m|) by m, shape (n_sites, d, d)."""
    ratio = _ratio(of, size)[:, None, None]
    e = m / np.maximum(size, _STRAIGHT)[:, None]
    along = e[:, :, None] * e[:, None]
    return ratio * np.eye(m.shape[1]) + (of.tangent[:, None, None] - ratio) * along


def _of_signed(of: Moments, q: _Signed) -> ndarray:
    """Second derivatives of φ(m·n) by m and the directions, shape (n_sites, k, k)."""
    g = q.gradient
    H: ndarray = of.tangent[:, None, None] * g[:, :, None] * g[:, None]
    return H + of.value[:, None, None] * q.hessian


def _assembled(operator: csr_matrix, blocks: ndarray) -> csr_matrix:
    """Sum of operatorᵀ H operator over the sites."""
    n = len(blocks)
    H = bsr_matrix((blocks, np.arange(n), np.arange(n + 1)))
    K = operator.T @ (H.tocsr() @ operator)
    return csr_matrix((K + K.T) / 2)


def is_symmetric(law: Any, reach: float) -> bool:
    """True if the moment of a law at −κ is the negative of the one at κ.

    They are compared up to the end of its domain, at most ``reach``.
    """
    low, high = domain_of(law)
    most = np.minimum(np.minimum(-np.asarray(low), high), reach)
    x = _COMPARED * most
    with np.errstate(all="ignore"):
        one, other = law.value(x), law.value(-x)
        return bool(np.all(np.abs(one + other) <= _SAME * np.abs(one)))
