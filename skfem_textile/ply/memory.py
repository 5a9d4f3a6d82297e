"""What stabilising terms remember of the last converged state."""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis, Functional, asm
from skfem.assembly.form.form import FormExtraParams

from .. import kinematics as kin
from ..fabric import Fabric
from ..fabric.law import mean_slope
from ..forms.form import directions, elements, fibre_tension
from ..forms.held_stiffness import (
    deviation_stiffness,
    shear_stiffness,
    stabilisation_stiffness,
)
from ..forms.hourglass import hourglass, hourglass_rate, rate_increment
from ..forms.mean_tension import deviation_energy, mean, of_elements
from ..mesh.bases import CENTRE, centre_grad
from .kernels.kernel import HourglassKernel
from .kernels.kernel_forms import with_kernel


class _HeldStiffness:
    """A stiffness of elements, from their last converged state, held during a step.

    Parameters
    ----------
    name
        Name of the stiffness among the parameters of the forms.
    energy
        The energy that it scales.
    basis
        Basis of the forms.

    Attributes
    ----------
    parameters
        The stiffness by its name.
    work
        Work so far in N·mm beyond the energy at this stiffness.
    drift, held
        By how much the energy changed with the stiffness when that last did, and what
        it was before, in N·mm.
    """

    def __init__(self, name: str, energy: Functional, basis: CellBasis) -> None:
        self._name, self._energy, self._basis = name, energy, basis
        self.begin()

    def begin(self) -> None:
        """Return to the undeformed state."""
        self.parameters = {self._name: self._stiffness(self._basis.zeros())}
        self.work = self.drift = self.held = 0.0

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged state; tell whether the stiffness changed."""
        before, after = self.parameters[self._name], self._stiffness(u)
        if np.array_equal(after, before):
            self.drift = 0.0
            return False
        # What is stored stays stored, however stiff the element is from now on.
        self.work += self._energy_at(u, before - after)
        self.drift = self._energy_at(u, np.abs(before - after))
        self.held = self._energy_at(u, before)
        self.parameters = {self._name: after}
        return True

    def restore(self, parameters: dict[str, ndarray], work: float) -> None:
        """Hold the stiffness of another run."""
        self.parameters, self.work = parameters, work

    def _energy_at(self, u: ndarray, stiffness: ndarray) -> float:
        return float(asm(self._energy, self._basis, u=u, **{self._name: stiffness}))

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
        forms = with_kernel(hourglass(fabric), HourglassKernel(fabric))
        super().__init__("C_s", forms.energy, basis)

    @np.errstate(over="ignore")  # a run refuses what is not finite
    def _stiffness(self, u: ndarray) -> ndarray:
        # The centre's gradient is the same at the four points of an element.
        field: Any = self._basis.interpolate(u)
        F = kin.deformation_gradient(centre_grad(field)[..., :1])
        centre, _ = CENTRE
        x = self._basis.mapping.F(centre, self._basis.tind)
        G, E = _stiffnesses(self._fabric.at(), F, self._fabric.directions(x))
        return stabilisation_stiffness(G, E.mean(axis=0))


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
        super().__init__("E_d", deviation_energy(fabric), basis)

    @np.errstate(over="ignore")  # a run refuses what is not finite
    def _stiffness(self, u: ndarray) -> ndarray:
        w = FormExtraParams(self._basis.default_parameters())
        field: Any = self._basis.interpolate(u)
        F, A = kin.deformation_gradient(field.grad), directions(self._fabric, w)
        G, E = _stiffnesses(self._fabric.at(elements(w)), F, A)
        mean_stretch = mean(w, np.array([kin.stretch(F, a) for a in A]))
        T = fibre_tension(of_elements(self._fabric, elements(w)), np.log(mean_stretch))
        return deviation_stiffness(self._multiple, mean(w, G), mean(w, E), T)


def _stiffnesses(
    fabric: Fabric, F: ndarray, A: tuple[ndarray, ndarray]
) -> tuple[ndarray, ndarray]:
    """Stiffness of shear at points, and of warp and weft."""
    strain = np.array([kin.fibre_strain(F, a) for a in A])
    laws = (fabric.tensions.of_family(i, strain) for i in range(2))
    pairs = zip(laws, strain, strict=True)
    E = np.array([mean_slope(law, own) for law, own in pairs])
    return shear_stiffness(fabric.shear_law, kin.shear_angle(F, *A)), E


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
    drift, held
        Infinite and zero: the rates of a long step are those of its end.
    """

    drift, held = np.inf, 0.0

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
