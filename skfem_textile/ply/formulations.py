"""Formulations: on which element, at which points, and what stabilises it."""

from dataclasses import dataclass
from functools import partial
from numbers import Real
from typing import Any, ClassVar, Literal, TypeAlias, get_args

import numpy as np
from numpy import ndarray
from skfem import CellBasis, Mesh

from .. import forms
from ..fabric import Fabric
from ..forms.mean_tension import mean_fibre_tension, mean_strain
from ..forms.tension import fibre_tension
from ..mesh.bases import (
    CENTRE,
    GAUSS,
    SIX,
    HourglassBasis,
    MeanBasis,
    quad_basis,
    triangle_basis,
)
from ..mesh.checks import MeshError, check_quads, check_triangles
from ..mesh.interior_edges import JumpBasis
from ..mesh.macro import MacroBasis
from ..splitting import was_split
from .kernels.kernel import HourglassKernel, MeanTensionKernel, TensionKernel
from .memory import AccumulatedMoment, HeldDeviation, HeldStabilisation
from .term import Memory, Term
from .terms import FormTerm, TensionTerm

Kind: TypeAlias = Literal["energy", "rate", "continuity", "isotropic"]


class _Pointwise:
    """Every point has the tension of its own fibre strain, and nothing is added."""

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The tension T(ε) at every point."""
        return TensionTerm(
            "tension",
            forms.tension(fabric),
            basis,
            TensionKernel(fabric),
            law=partial(fibre_tension, fabric.at()),
            seen=lambda strain: strain,
        )

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """None."""
        return []


class _Quadrilaterals(_Pointwise):
    """Bilinear quadrilaterals, judged at the 2×2 points."""

    rule: ClassVar[tuple[ndarray, ndarray]]
    centre: ClassVar[ndarray] = CENTRE[0]
    fine_points: ClassVar[ndarray] = GAUSS[0]

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement."""
        check_quads(mesh)
        return quad_basis(mesh, self.rule)


@dataclass(frozen=True)
class Full(_Quadrilaterals):
    """2×2 points and no stabilisation: locks unless a mesh follows the fibres."""

    name: ClassVar[str] = "full"
    title: ClassVar[str] = "2×2 points"
    rule: ClassVar[tuple[ndarray, ndarray]] = GAUSS


@dataclass(frozen=True)
class OnePoint(_Quadrilaterals):
    """One point at the centre, stabilised on the non-constant shear angle alone.

    Parameters
    ----------
    stabilisation
        Stabilisation stiffness C_s in N/mm (Hamila & Boisse 2013, §3.2), or ``auto``:
        in each element eight times its secant shear stiffness at the last converged
        state, held during a step; 10⁻⁴ of the fibre stiffness where there is none.
    kind
        ``energy``: independent of the path, with an exact tangent.  ``rate``: the
        paper's accumulated rates; a `Ply` then remembers the last converged state.
        For comparison, ``continuity``: against jumps of the shear angle between
        elements; ``isotropic``: against hourglass motions of all directions.

    Raises
    ------
    ValueError
        If the stabilisation is negative or not finite, or ``auto`` with another kind
        than ``energy``, or the kind unknown.
    """

    stabilisation: float | Literal["auto"] = "auto"
    kind: Kind = "energy"

    name: ClassVar[str] = "one-point"
    rule: ClassVar[tuple[ndarray, ndarray]] = CENTRE

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(
                f"kind must be one of {', '.join(get_args(Kind))}, got {self.kind!r}"
            )
        _refuse("stabilisation", self.stabilisation, " or 'auto'")
        if self.stabilisation == "auto" and self.kind != "energy":
            raise ValueError(
                f"stabilisation auto goes with kind energy, not {self.kind}: give a "
                "number"
            )

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        kind = "" if self.kind == "energy" else f", {self.kind}"
        C_s = self.stabilisation
        return f"one point, Cs = {C_s if C_s == 'auto' else f'{C_s:g}'}{kind}"

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """The hourglass term, unless C_s is zero, or jumps are of no edge."""
        C_s = None if self.stabilisation == "auto" else float(self.stabilisation)
        if C_s == 0:
            return []
        if C_s is not None and self.kind == "continuity":
            if basis.mesh.f2t[1].max() < 0:
                return []
            edges = JumpBasis(basis.mesh, mapping=basis.mapping, dofs=basis.dofs)
            return [_stabilisation(forms.shear_continuity(fabric, C_s), edges)]
        corners = HourglassBasis(basis.mesh, mapping=basis.mapping, dofs=basis.dofs)
        if C_s is not None and self.kind == "isotropic":
            return [_stabilisation(forms.isotropic_hourglass(C_s), corners)]
        if C_s is not None and self.kind == "rate":
            moment = AccumulatedMoment(fabric, C_s, corners)
            rate = forms.hourglass_rate(fabric, C_s)
            return [_stabilisation(rate, corners, memory=moment)]
        held = HeldStabilisation(fabric, corners) if C_s is None else None
        kernel = HourglassKernel(fabric, C_s)
        return [_stabilisation(forms.hourglass(fabric, C_s), corners, kernel, held)]


@dataclass(frozen=True)
class Macro(_Quadrilaterals):
    """One point in every quadrilateral of a mesh that was split, nothing to tune.

    The elements that were split (`split`) are macro-elements, whose fibres meet their
    whole stiffness in the mean strain alone (`mean_tension`); each of the parts is
    stabilised as by `OnePoint`.

    Parameters
    ----------
    stabilisation
        As of `OnePoint`.
    deviation
        Stiffness that meets deviations from the mean strain, as a multiple of that of
        shear (`deviation_stiffness`), in what was a triangle and a quadrilateral.

    Raises
    ------
    ValueError
        If one of them is negative or not finite.
    """

    stabilisation: float | Literal["auto"] = "auto"
    deviation: tuple[float, float] = (5000.0, 18000.0)

    name: ClassVar[str] = "macro"
    rule: ClassVar[tuple[ndarray, ndarray]] = CENTRE

    def __post_init__(self) -> None:
        _refuse("stabilisation", self.stabilisation, " or 'auto'")
        if np.shape(np.asarray(self.deviation, dtype=object)) != (2,):
            raise ValueError(
                "deviation must be a pair (triangles, quadrilaterals), got "
                f"{self.deviation}"
            )
        for deviation in self.deviation:
            _refuse("deviation", deviation)

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        C_s, own = self.stabilisation, self.deviation == Macro.deviation
        return (
            "macro-elements"
            + ("" if C_s == "auto" else f", Cs = {C_s:g}")
            + ("" if own else ", {:g} and {:g}".format(*self.deviation))
        )

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement."""
        if not was_split(mesh):
            raise MeshError(
                "macro-elements need a mesh that was split, and not changed since, nor "
                "renumbered: "
                "split(mesh), or --split"
            )
        return super().basis(mesh)

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The tension of the mean strain of each macro-element."""
        mesh: Any = basis.mesh
        macro = MacroBasis(mesh, mapping=basis.mapping, dofs=basis.dofs)
        of_triangles, of_quadrilaterals = self.deviation
        four = (macro.parts >= 0).sum(axis=1) == 4
        deviation = np.where(four, of_quadrilaterals, of_triangles)
        return _mean_tension_term(fabric, deviation[:, None], macro)

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """The hourglass term, unless C_s is zero, or jumps are of no edge."""
        return OnePoint(self.stabilisation).stabilising_terms(basis, fabric)


@dataclass(frozen=True)
class Quadratic(_Pointwise):
    """Quadratic triangles with three points and no stabilisation.

    The element is `skfem.ElementTriP2` on a `skfem.MeshTri`: nodes at vertices and at
    the middles of edges.  Judged at six points, exact to degree 4.

    Parameters
    ----------
    deviation
        If given, fibres meet their whole stiffness in the mean strain of a triangle
        alone, and deviations from it this multiple of the shear stiffness
        (`deviation_stiffness`).

    Raises
    ------
    ValueError
        If it is negative or not finite.
    """

    deviation: float | None = None

    name: ClassVar[str] = "quadratic"
    centre: ClassVar[ndarray] = np.array([[1 / 3], [1 / 3]])
    fine_points: ClassVar[ndarray] = SIX[0]

    def __post_init__(self) -> None:
        if self.deviation is not None:
            _refuse("deviation", self.deviation)

    @property
    def title(self) -> str:
        """What to call it in a picture."""
        C_d = self.deviation
        return "quadratic triangles" + ("" if C_d is None else f", mean, {C_d:g}")

    def basis(self, mesh: Mesh) -> CellBasis:
        """Basis of the displacement."""
        check_triangles(mesh)
        return triangle_basis(mesh)

    def tension_term(self, basis: CellBasis, fabric: Fabric) -> TensionTerm:
        """The tension at each of the points, or of their mean strain."""
        if self.deviation is None:
            return super().tension_term(basis, fabric)
        means = MeanBasis(
            basis.mesh,
            basis.elem,
            mapping=basis.mapping,
            dofs=basis.dofs,
            quadrature=basis.quadrature,
        )
        return _mean_tension_term(fabric, self.deviation, means)


def _stabilisation(
    forms: forms.Forms,
    basis: CellBasis | JumpBasis,
    kernel: HourglassKernel | None = None,
    memory: Memory | None = None,
) -> FormTerm:
    return FormTerm(
        "stabilisation", forms, basis, kernel, role="stabilisation", memory=memory
    )


def _mean_tension_term(
    fabric: Fabric, deviation: float | ndarray, basis: MeanBasis
) -> TensionTerm:
    held = HeldDeviation(fabric, deviation, basis)

    def law(strain: ndarray, change: ndarray | float = 0.0) -> ndarray:
        E_d = held.parameters["E_d"]
        return mean_fibre_tension(fabric, E_d, basis, strain, change)

    return TensionTerm(
        "tension",
        forms.mean_tension(fabric),
        basis,
        MeanTensionKernel(fabric),
        memory=held,
        law=law,
        seen=partial(mean_strain, basis),
        arrange=basis.from_ply_points,
    )


def _refuse(name: str, value: float | str, also: str = "") -> None:
    """Refuse what is no stiffness, nor ``auto`` where that may be."""
    if also and isinstance(value, str) and value == "auto":
        return
    if not isinstance(value, Real) or not (np.isfinite(value) and value >= 0):
        raise ValueError(f"{name} must be a finite number >= 0{also}, got {value}")
