"""What stabilising terms remember of a state."""

import numpy as np
from numpy import ndarray
from skfem import CellBasis, asm
from skfem.assembly.form.form import FormExtraParams

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..fabric.law import mean_slope
from ..forms.form import directions, elements, fibre_tension
from ..forms.held_stiffness import (
    deviation_stiffness,
    further_shear_stiffness,
    shear_stiffness,
    stabilisation_stiffness,
)
from ..forms.hourglass import hourglass_rate, rate_increment
from ..forms.mean_tension import mean, of_elements
from ..mesh.bases import CENTRE, displacement_gradient
from .term import DependsOn


class _HeldStiffness:
    """A stiffness of elements at a state near the one that is sought.

    Parameters
    ----------
    name
        Name of the stiffness among the parameters of the forms.
    basis
        Basis of the forms.

    Attributes
    ----------
    parameters
        The stiffness by its name.
    """

    work: float = 0.0
    depends_on: DependsOn = "state"

    def __init__(self, name: str, basis: CellBasis) -> None:
        self._name, self._basis = name, basis
        self.begin()

    def begin(self) -> None:
        """Return to the undeformed state."""
        self.parameters = {self._name: self._stiffness(self._basis.zeros())}

    def commit(self, u: ndarray) -> bool:
        """Take the stiffness at ``u``; tell whether it changed."""
        before, after = self.parameters[self._name], self._stiffness(u)
        self.parameters = {self._name: after}
        return not np.array_equal(after, before)

    def restore(self, parameters: dict[str, ndarray], work: float) -> None:
        """Hold the stiffness of another state.

        Raises
        ------
        ValueError
            If there is work: a stiffness that is held stores none.
        """
        if work != 0.0:
            raise ValueError(f"{self._name} stores no work, but {work} is given")
        self.parameters = parameters

    def _stiffness(self, u: ndarray) -> ndarray:
        raise NotImplementedError


class HeldStabilisation(_HeldStiffness):
    """C_s of `hourglass`: `stabilisation_stiffness` at the centre of each element.

    Parameters
    ----------
    fabric
        Fibre directions, tension and shear laws.
    basis
        The `HourglassBasis` of the forms.
    """

    def __init__(self, fabric: Fabric, basis: CellBasis) -> None:
        self._fabric = fabric
        super().__init__("C_s", basis)

    @np.errstate(over="ignore")  # a run refuses what is not finite
    def _stiffness(self, u: ndarray) -> ndarray:
        gradient = displacement_gradient(self._basis, u, at_centre=True)
        F = kin.deformation_gradient(gradient)
        centre, _ = CENTRE
        x = self._basis.mapping.F(centre, self._basis.tind)
        fabric, A = self._fabric.at(), self._fabric.directions(x)
        G = shear_stiffness(fabric.shear_law, kin.shear_angle(F, *A))
        return stabilisation_stiffness(G, _fibre_stiffness(fabric, F, A).mean(axis=0))


class HeldDeviation(_HeldStiffness):
    """E_d of `mean_tension`: `deviation_stiffness` of warp and weft in each element.

    Parameters
    ----------
    fabric
        Fibre directions, tension and shear laws.
    multiple
        That of `deviation_stiffness`: one, or one per element, shape (n_elements, 1).
    basis
        The `MeanBasis` of the forms.
    """

    def __init__(
        self, fabric: Fabric, multiple: float | ndarray, basis: CellBasis
    ) -> None:
        self._fabric, self._multiple = fabric, multiple
        super().__init__("E_d", basis)

    @np.errstate(over="ignore")  # a run refuses what is not finite
    def _stiffness(self, u: ndarray) -> ndarray:
        w = FormExtraParams(self._basis.default_parameters())
        F = kin.deformation_gradient(displacement_gradient(self._basis, u))
        A = directions(self._fabric, w)
        fabric = self._fabric.at(elements(w))
        G = further_shear_stiffness(fabric.shear_law, kin.shear_angle(F, *A))
        E = _fibre_stiffness(fabric, F, A)
        mean_stretch = mean(w, np.array([kin.stretch(F, a) for a in A]))
        T = fibre_tension(of_elements(self._fabric, elements(w)), np.log(mean_stretch))
        return deviation_stiffness(self._multiple, mean(w, G), mean(w, E), T)


def _fibre_stiffness(fabric: Fabric, F: ndarray, A: tuple[ndarray, ndarray]) -> ndarray:
    """Stiffness of warp and weft at points."""
    strain = np.array([kin.fibre_strain(F, a) for a in A])
    laws = (fabric.tensions.of_family(i, strain) for i in range(2))
    pairs = zip(laws, strain, strict=True)
    return np.array([mean_slope(law, own) for law, own in pairs])


class AccumulatedMoment:
    """Moments M̃ and work of `hourglass_rate` at the last converged state.

    Parameters
    ----------
    fabric, C_s
        As for `hourglass_rate`.
    basis
        The `HourglassBasis` of the forms.

    Attributes
    ----------
    parameters
        Parameters ``last`` and ``moment`` of the forms.
    work
        Work of the stabilisation so far in N·mm.
    depends_on
        The steps: the rates of a long step are those of its end.
    """

    depends_on: DependsOn = "steps"

    def __init__(self, fabric: Fabric, C_s: float, basis: CellBasis) -> None:
        self._fabric, self._C_s, self._basis = fabric, C_s, basis
        self._work = hourglass_rate(fabric, C_s).energy
        self.begin()

    def begin(self) -> None:
        """Forget everything: the undeformed state."""
        self.parameters = {
            "last": self._basis.zeros(),
            "moment": self._basis.zero_w(),
        }
        self.work = 0.0

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged displacement; the forces stay what they are."""
        basis, parameters = self._basis, self.parameters
        self.work += asm(self._work, basis, u=u, **parameters)
        w = FormExtraParams(
            x=basis.global_coordinates(),
            u=basis.interpolate(u),
            last=basis.interpolate(parameters["last"]),
        )
        increment = rate_increment(self._fabric, w)
        moment = parameters["moment"] + self._C_s * increment
        self.parameters = {"last": u.copy(), "moment": moment}
        return False

    def restore(self, parameters: dict[str, ndarray], work: float) -> None:
        """Remember the moments of another run."""
        self.parameters, self.work = parameters, work
