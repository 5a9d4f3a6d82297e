"""The term that keeps the corners of elements open."""

from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis, asm

from ...fabric import Fabric
from ...forms.corners import RESISTING, corner_resistance
from ...mesh.bases import CornerBasis, Corners, components
from ..kernels.kernel import node_pair_blocks
from ..parameters import NO_VALUES, Values
from ..terms import ElementTerm

# κ as a share of the fibre stiffness, where this is more than the shear stiffness.
# A larger one adds more energy where corners close; a smaller one lets them come closer
# to folding.  A tenth and ten times as much keep corners open as well:
# pytest tests/ply/test_corners.py -k how_stiff
_SHARE_OF_FIBRES = 1e-5


@np.errstate(over="ignore")  # a run refuses what is not finite
def corner_stiffness(fabric: Fabric, basis: CellBasis) -> float:
    """κ in N/mm: the shear stiffness at rest, and at least 10⁻⁵ of the fibres'.

    Means over the points of a basis, as laws may differ there.
    """
    unstrained = np.zeros(basis.dx.shape)
    E_1, E_2, G = (float(np.mean(law.tangent(unstrained))) for law in fabric.at().laws)
    return max(G, _SHARE_OF_FIBRES * (E_1 + E_2) / 2)


class CornerTerm(ElementTerm):
    """The term of the corners, which acts where they close and nowhere else.

    Parameters
    ----------
    stiffness
        κ in N/mm.
    basis
        Basis of the displacement.
    corners
        Its corners.
    """

    name, role = "corners", "internal"

    def __init__(self, stiffness: float, basis: CellBasis, corners: Corners) -> None:
        self._forms = corner_resistance(stiffness)
        self._basis, self._corners = basis, corners
        self._d = d = components(basis)
        self.nodes = basis.element_dofs[::d] // d

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """κ Σ A/n b(det F)."""
        basis = self._closing(u)
        return 0.0 if basis is None else float(asm(self._forms.energy, basis, u=u))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Its derivative."""
        basis, form = self._closing(u), self._forms.residual
        return np.zeros(len(u)) if basis is None else asm(form, basis, u=u)

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix | None:
        """Its second derivative; None where all corners are open."""
        basis = self._closing(u)
        return None if basis is None else asm(self._forms.tangent, basis, u=u)

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray | None:
        """See `ElementTerm`; None where all corners are open."""
        if (basis := self._closing(u)) is None:
            return None
        size: Any = basis.Nbfun
        K = self._forms.tangent.elemental(basis, u=u).data.reshape(size, size, -1)
        elements: Any = basis.tind
        own = node_pair_blocks(K, self.nodes[:, elements], self._d)
        every = np.zeros((self.nodes.shape[1], *own.shape[:-1]))
        np.add.at(every, elements, np.moveaxis(own, -1, 0))
        return np.moveaxis(every, 0, -1)

    def _closing(self, u: ndarray) -> CornerBasis | None:
        """Basis of the corners that close; None where all are open."""
        closing, elements = np.nonzero(self._corners.area_ratio(u) < RESISTING)
        if not elements.size:
            return None
        return CornerBasis(self._basis, elements, closing)
