"""An elastic foundation, as a term of a user."""

from dataclasses import dataclass

from skfem import BilinearForm, CellBasis, Functional, LinearForm
from skfem.helpers import dot

from skfem_textile import Forms, FormTerm


@dataclass(frozen=True)
class Foundation:
    """Foundation of a stiffness in N/mm per mm²."""

    stiffness: float

    def on(self, basis: CellBasis) -> FormTerm:
        """Term on a basis."""
        k = self.stiffness
        forms = Forms(
            Functional(lambda w: 0.5 * k * dot(w["u"], w["u"])),
            LinearForm(lambda v, w: k * dot(w["u"], v)),
            BilinearForm(lambda u, v, w: k * dot(u, v)),
        )
        return FormTerm("foundation", forms, basis)
