"""One stabilised point in every quadrilateral."""

from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias, get_args

from numpy import ndarray
from skfem import CellBasis

from ... import forms
from ...fabric import Fabric
from ...mesh.bases import CENTRE, JumpBasis, components
from ...registration import FormulationRegistration, Option
from ..parameters import AccumulatedMoment
from ..terms import Term
from .common import (
    STABILISATION,
    Quadrilaterals,
    hourglass_basis,
    hourglass_terms,
    refuse_stiffness,
    stabilising_term,
)

Kind: TypeAlias = Literal["energy", "rate", "continuity", "isotropic"]


@dataclass(frozen=True)
class OnePoint(Quadrilaterals):
    """One point at the centre, stabilised on the non-constant shear angle alone.

    Parameters
    ----------
    stabilisation
        Stabilisation stiffness C_s in N/mm (Hamila & Boisse 2013, §3.2), or ``auto``:
        in each element by its shear stiffness and the angle between its fibres
        (`stabilisation_stiffness`, without tension).
    kind
        ``energy``: independent of the path, with an exact tangent.  ``rate``: the
        paper's accumulated rates, parameters that are advanced once a step.
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
        refuse_stiffness("stabilisation", self.stabilisation, " or 'auto'")
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
        if self.kind == "energy":
            return hourglass_terms(self.stabilisation, basis, fabric)
        if components(basis) == 3 and self.kind != "isotropic":
            raise ValueError(
                f"stabilisation of kind {self.kind} is of a ply in the plane: take "
                "energy or isotropic in space"
            )
        if (C_s := float(self.stabilisation)) == 0:
            return []
        if self.kind == "continuity":
            if basis.mesh.f2t[1].max() < 0:
                return []
            edges = JumpBasis(basis.mesh, mapping=basis.mapping, dofs=basis.dofs)
            return [stabilising_term(forms.shear_continuity(fabric, C_s), edges)]
        corners = hourglass_basis(basis)
        if self.kind == "isotropic":
            return [stabilising_term(forms.isotropic_hourglass(C_s), corners)]
        moment = AccumulatedMoment(fabric, C_s, corners)
        rate = forms.hourglass_rate(fabric, C_s)
        return [stabilising_term(rate, corners, parameters=moment)]


REGISTRATION = FormulationRegistration(
    name=OnePoint.name,
    description="the paper's element, one stabilised point in every quadrilateral",
    build=lambda stabilisation, cs: OnePoint(cs, stabilisation),
    options=(
        Option(
            name="stabilisation",
            help="independent of the path, the paper's rates, by jumps between "
            "elements, or isotropic; the last three need `--cs`",
            default="energy",
            choices=get_args(Kind),
        ),
        STABILISATION,
    ),
    rank=1,
)
