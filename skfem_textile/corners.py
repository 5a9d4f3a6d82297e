"""What keeps the corners of elements open: an energy of det F where it is near zero.

A bilinear quadrilateral is unfolded if and only if det F is positive at its corners. No
point at which fibres or stabilisation are evaluated lies there, so corners resist:

    κ Σ_corners A/n b(det F),   b(J) = ln³(J₀/J) where J < J₀, and 0 elsewhere,

an energy that is C², and exactly zero while every corner is open.  Below J₁ = J₀/4 its
parabola goes on, so that an iteration may pass through folded states; none of these
counts as an answer.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import BilinearForm, CellBasis, Functional, LinearForm
from skfem.assembly.form.form import FormExtraParams
from skfem.helpers import ddot, grad

from . import kinematics as kin
from .elements import node_positions
from .fabric import Fabric
from .forms import Forms, once
from .terms import LocalTerm

#: J₀, the area ratio det F below which a corner resists: that of fibres at right angles
#: which do not stretch and are sheared by 85.4°.
RESISTING = 0.08

# J₁, below which b goes on as a parabola.
_PARABOLA = RESISTING / 4

# κ as a share of the fibre stiffness, where this is more than the shear stiffness.
_OF_FIBRES = 1e-5

# A corner is flat where det J is less than this share of the largest in its element.
_FLAT = 1e-9


def resistance(J: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """b(J) and its first and second derivative, for area ratios J of any sign."""
    J_in = np.clip(J, _PARABOLA, RESISTING)
    log, past = np.log(RESISTING / J_in), np.minimum(J - _PARABOLA, 0.0)
    b, d, dd = log**3, -3 * log**2 / J_in, (6 * log + 3 * log**2) / J_in**2
    return b + d * past + 0.5 * dd * past**2, d + dd * past, dd


def corner_resistance(stiffness: float) -> Forms:
    """Resistance of corners with the energy κ Σ A/n b(det F).

    The forms go with `CornerBasis`.

    Parameters
    ----------
    stiffness
        κ in N/mm.
    """

    def derivatives(w):
        return resistance(kin.area_ratio(_F(w)))

    @Functional
    def energy(w):
        b, _, _ = derivatives(w)
        return stiffness * b

    @LinearForm
    def residual(v, w):
        _, d, _ = once(w, derivatives)
        return stiffness * d * ddot(kin.cofactor(_F(w)), grad(v))

    @BilinearForm
    def tangent(u, v, w):
        _, d, dd = once(w, derivatives)
        C = kin.cofactor(_F(w))
        square = ddot(C, grad(u)) * ddot(C, grad(v))
        return stiffness * (dd * square + d * ddot(kin.cofactor(grad(u)), grad(v)))

    return Forms(energy, residual, tangent)


@np.errstate(over="ignore")  # a run refuses what is not finite
def corner_stiffness(fabric: Fabric, basis: CellBasis) -> float:
    """κ in N/mm: the shear stiffness at rest, and at least 10⁻⁵ of the fibres'.

    Means over the points of a basis, as laws may differ there.
    """
    rest, warp, weft = np.zeros(basis.dx.shape), *fabric.families
    laws = fabric.shear_law, warp.tension, weft.tension
    G, E_1, E_2 = (float(np.mean(law.tangent(rest))) for law in laws)
    return max(G, _OF_FIBRES * (E_1 + E_2) / 2)


class CornerBasis(CellBasis):
    """Basis of the displacement at some nodes of elements, one to each of its rows.

    Each of the n nodes of an element has the weight A/n, where A is its area.

    Parameters
    ----------
    basis
        Basis of the displacement.
    elements, corners
        Numbers of the elements, which may repeat, and which of their nodes.
    """

    def __init__(self, basis: CellBasis, elements: ndarray, corners: ndarray) -> None:
        points = _local_nodes(basis)
        super().__init__(
            basis.mesh,
            basis.elem,
            mapping=basis.mapping,
            dofs=basis.dofs,
            elements=elements,
            quadrature=(points[:, corners, None], np.ones(1)),
            disable_doflocs=True,
        )
        area = basis.dx[elements].sum(axis=1, keepdims=True)
        self.dx = area / points.shape[1]


class Corners:
    """The nodes of the elements of a basis, at which det F tells whether they fold.

    det F = det(∂x/∂ξ) / det(∂X/∂ξ): at a corner the columns of ∂x/∂ξ are edges of the
    element.  That takes half the time of F itself, and the last answer is kept, because
    every iteration and every state asks.

    Parameters
    ----------
    basis
        Basis of the displacement.
    """

    def __init__(self, basis: CellBasis) -> None:
        scalar: Any = basis.elem
        scalar, points = scalar.elem, _local_nodes(basis)
        dN = [scalar.lbasis(points, i)[1] for i in range(len(scalar.doflocs))]
        tangents = np.array(dN).transpose(2, 1, 0).reshape(-1, len(dN))
        self._edges, which = np.unique(tangents, axis=0, return_inverse=True)
        self._pairs = which.reshape(-1, 2)
        self._nodes = basis.element_dofs[::2] // 2
        self._X = node_positions(basis).T.ravel()
        reference = self._jacobian(basis.zeros())
        own = reference * np.sign(reference.sum(axis=0))
        self._reflex = own <= _FLAT * own.max(axis=0)
        self._per_area = 1 / np.where(self._reflex, np.inf, reference)
        self._kept = np.empty(0), np.empty(0)

    def area_ratio(self, u: ndarray) -> ndarray:
        """Current area per reference area, det F, shape (n_points, n_elements).

        Infinite at a corner that is flat or reflex in the reference configuration,
        where det F tells nothing.
        """
        last, ratio = self._kept
        if np.array_equal(last, u):
            return ratio
        ratio = self._jacobian(u) * self._per_area
        ratio[self._reflex] = np.inf
        self._kept = u.copy(), ratio
        return ratio

    def _jacobian(self, u: ndarray) -> ndarray:
        """det(∂x/∂ξ), shape (n_points, n_elements)."""
        edges = self._edges @ (self._X + u).view(complex)[self._nodes]
        det = np.empty((len(self._pairs), edges.shape[1]))
        for i, (xi, eta) in enumerate(self._pairs):
            det[i] = edges[xi].real * edges[eta].imag
            det[i] -= edges[xi].imag * edges[eta].real
        return det


@dataclass(frozen=True, eq=False)
class CornerTerm(LocalTerm):
    """The term of the corners, which acts where they close and nowhere else."""

    basis: CellBasis = field(kw_only=True)
    corners: Corners = field(kw_only=True)

    def acting(self, u: ndarray) -> CornerBasis | None:
        """Basis of the corners that resist at ``u``; None where all are open."""
        closing, elements = np.nonzero(self.corners.area_ratio(u) < RESISTING)
        return CornerBasis(self.basis, elements, closing) if elements.size else None


def _local_nodes(basis: CellBasis) -> ndarray:
    """Reference coordinates of the nodes of the element, shape (2, n)."""
    element: Any = basis.elem
    return element.elem.doflocs.T


def _F(w: FormExtraParams) -> ndarray:
    return kin.deformation_gradient(grad(w["u"]))
