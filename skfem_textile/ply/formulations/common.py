"""What formulations share."""

from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementTriP1, Mesh

from ... import forms
from ...fabric import Fabric
from ...mesh.bases import (
    CENTRE,
    GAUSS,
    HourglassBasis,
    JumpBasis,
    MeanBasis,
    components,
    quad_basis,
)
from ...mesh.checks import check_mesh
from ...mesh.splitting import split
from ...registration import Option
from ..kernels.kernel import HourglassKernel, MeanTensionKernel, TensionKernel
from ..kernels.out_of_plane import OutOfPlaneKernel
from ..parameters import (
    NO_VALUES,
    HeldDeviation,
    HeldStabilisation,
    TermParameters,
    Values,
)
from ..terms import FormTerm, TensionTerm, Term

# Twist is held with this share of the smaller bending stiffness, where both families
# have one: fibres that bend one by one leave the ply no other motion without stiffness
# than z = xy.  Chosen: it adds 0.1 % to the load under which a square plate buckles.
_TWIST_OVER_BENDING = 0.002


class Pointwise:
    """Every point has the tension of its own fibre strain, and nothing is added."""

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The tension T(ε) at every point."""
        definition, kernel = forms.tension(fabric), TensionKernel(fabric)
        return TensionTerm("tension", definition, basis, kernel)

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """None."""
        return []


class Quadrilaterals(Pointwise):
    """Bilinear quadrilaterals, judged at the 2×2 points."""

    rule: ClassVar[tuple[ndarray, ndarray]]
    centre: ClassVar[ndarray] = CENTRE[0]
    fine_points: ClassVar[ndarray] = GAUSS[0]

    def working_mesh(self, mesh: Mesh) -> Mesh:
        """Quadrilaterals as they are, triangles split."""
        if getattr(mesh, "elem", None) is not ElementTriP1:
            return mesh
        check_mesh(mesh)
        return split(mesh)

    def basis(self, mesh: Mesh, dimension: int = 2) -> CellBasis:
        """Basis of the displacement."""
        check_mesh(mesh)
        return quad_basis(mesh, self.rule, dimension)


def mean_tension_term(
    fabric: Fabric, deviation: float | ndarray, basis: MeanBasis
) -> TensionTerm:
    """The term of fibres that meet their whole stiffness in mean stretches alone."""
    return TensionTerm(
        "tension",
        forms.mean_tension(fabric),
        basis,
        MeanTensionKernel(fabric),
        parameters=HeldDeviation(fabric, deviation, basis),
        of_means=Values({"E_d": np.zeros((2, basis.nelems, 1))}),
    )


def refuse_stiffness(name: str, value: float | str, also: str = "") -> None:
    """Refuse what is no stiffness, nor ``auto`` where that may be."""
    if also and isinstance(value, str) and value == "auto":
        return
    if not isinstance(value, Real) or not (np.isfinite(value) and value >= 0):
        raise ValueError(f"{name} must be a finite number >= 0{also}, got {value}")


@dataclass(frozen=True, eq=False, kw_only=True)
class OutOfPlane(FormTerm):
    """The term of `out_of_plane`, with the numbers of its kernel.

    Parameters
    ----------
    C_s
        Stiffness in N/mm, one for each element, shape (n_elements, 1); with parameters
        an upper limit of their ``C_s``.
    """

    C_s: ndarray

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """See `OutOfPlaneKernel`."""
        return self._numbers.energy(u, self._stiffness(p))

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """See `OutOfPlaneKernel`."""
        return self._numbers.forces(u, self._stiffness(p))

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """See `OutOfPlaneKernel`."""
        return self._numbers.matrices(u, self._stiffness(p))

    def _given(self, t: float, p: Values) -> dict[str, Any]:
        return {**super()._given(t, p), "C_s": self._stiffness(p)}

    def _stiffness(self, p: Values) -> ndarray:
        return np.minimum(p.get("C_s", np.inf), self.C_s)

    @cached_property
    def _numbers(self) -> OutOfPlaneKernel:
        return OutOfPlaneKernel(self.basis)


def hourglass_terms(
    stabilisation: float | str, basis: CellBasis, fabric: Fabric
) -> list[Term]:
    """The terms of a number C_s or ``auto``, none if it is zero.

    The hourglass term, and in space `OutOfPlane`.
    """
    if stabilisation == 0:
        return []
    C_s = None if stabilisation == "auto" else float(stabilisation)
    corners = hourglass_basis(basis)
    definition, kernel = forms.hourglass(fabric, C_s), HourglassKernel(fabric, C_s)
    held = _automatic(basis, fabric) if C_s is None else None
    terms: list[Term] = [stabilising_term(definition, corners, kernel, held)]
    if components(basis) == 3:
        out_of_plane = OutOfPlane(
            "out_of_plane",
            forms.out_of_plane(),
            corners,
            C_s=_most_against_twist(np.inf if C_s is None else C_s, fabric, corners),
            role="stabilisation",
            parameters=_automatic(basis, fabric, across=True) if C_s is None else None,
        )
        terms.append(out_of_plane)
    return terms


def _most_against_twist(C_s: float, fabric: Fabric, basis: HourglassBasis) -> ndarray:
    """The largest C_s out of the plane, shape (n_elements, 1).

    Where fibres resist bending, elements resist twist with a share of that at most.
    A bending stiffness D resists a curvature κ with ½ D κ² per area; C_s resists a
    twist κ of a square of area A with ½ C_s A/6 κ².
    """
    least = np.minimum(*fabric.bending)
    D = np.broadcast_to(least, basis.dx[:, 0].shape)[:, None]
    most = _TWIST_OVER_BENDING * 6 * D / basis.dx.sum(axis=1, keepdims=True)
    return np.where(D > 0, np.minimum(C_s, most), C_s)


def hourglass_basis(basis: CellBasis) -> HourglassBasis:
    """The `HourglassBasis` of the same displacement."""
    d = components(basis)
    return HourglassBasis(basis.mesh, d, mapping=basis.mapping, dofs=basis.dofs)


def _automatic(
    basis: CellBasis, fabric: Fabric, across: bool = False
) -> HeldStabilisation:
    """C_s of each element in the plane, or across it, where grip does not count.

    The tension at a single point is not that of the fabric.
    """
    if isinstance(basis, MeanBasis):
        return HeldStabilisation(fabric, basis, by_tension=True, by_grip=not across)
    points = MeanBasis(
        basis.mesh,
        basis.elem,
        mapping=basis.mapping,
        dofs=basis.dofs,
        quadrature=CENTRE,
    )
    return HeldStabilisation(fabric, points, by_tension=False, by_grip=not across)


def stabilising_term(
    forms: forms.Forms,
    basis: CellBasis | JumpBasis,
    kernel: HourglassKernel | None = None,
    parameters: TermParameters | None = None,
) -> FormTerm:
    """The term of a stabilisation."""
    return FormTerm(
        "stabilisation",
        forms,
        basis,
        kernel,
        role="stabilisation",
        parameters=parameters,
    )


def _read_stabilisation(word: str) -> float | str:
    try:
        return word if word == "auto" else float(word)
    except ValueError:
        raise ValueError(f"{word!r} is no number, nor auto") from None


#: C_s, of every formulation that takes one.
STABILISATION = Option(
    name="cs",
    help="stabilisation C_s in N/mm, or auto: by shear stiffness, tension and angle "
    "of the fibres of each element, 1e-4 E without shear stiffness",
    default="auto",
    read=_read_stabilisation,
)
