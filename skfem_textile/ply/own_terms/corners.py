"""The term that keeps the corners of elements open."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import CellBasis, asm

from ...fabric import Fabric
from ...forms.corners import RESISTING, corner_resistance
from ...mesh.corners import CornerBasis, Corners
from ..term import NO_VALUES, Term, Values

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


class CornerTerm(Term):
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

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """κ Σ A/n b(det F)."""
        return float(self._asm(self._forms.energy, u, 0.0))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Its derivative."""
        return self._asm(self._forms.residual, u, np.zeros(len(u)))

    def tangent(self, u: ndarray, t: float, p: Values = NO_VALUES) -> csr_matrix | None:
        """Its second derivative; None where all corners are open."""
        return self._asm(self._forms.tangent, u, None)

    def couples(self) -> Sequence[ndarray]:
        """Nothing but the nodes of each element."""
        return ()

    def _asm(self, form: Any, u: ndarray, nothing: Any) -> Any:
        """The form where corners close, and what there is where all are open."""
        closing, elements = np.nonzero(self._corners.area_ratio(u) < RESISTING)
        if not elements.size:
            return nothing
        return asm(form, CornerBasis(self._basis, elements, closing), u=u)
