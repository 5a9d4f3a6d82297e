"""What stabilising terms remember of the last converged state."""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis, asm
from skfem.assembly.form.form import FormExtraParams

from .. import kinematics as kin
from ..fabric import Fabric, is_zero
from ..forms.hourglass import hourglass, hourglass_rate, rate_increment
from ..forms.stabilisation import default_stabilisation
from ..mesh.bases import CENTRE, centre_grad
from .kernels.kernel import HourglassKernel
from .kernels.kernel_forms import with_kernel


class HeldStabilisation:
    """C_s of `hourglass` in each element, from its shear at the last converged state.

    That is `default_stabilisation` of the shear angle at the centre.  It is held during
    a step, so that the tangent is exact.

    Parameters
    ----------
    fabric
        Gives fibre directions, tension and shear laws.
    basis
        The `HourglassBasis` of the forms.

    Attributes
    ----------
    parameters
        Parameter ``C_s`` of the forms.
    work
        Work of the stabilisation so far in N·mm beyond its energy at this C_s.
    drift, held
        By how much its energy changed with C_s when that last did, and what it was
        before, in N·mm.
    """

    def __init__(self, fabric: Fabric, basis: CellBasis) -> None:
        self._fabric, self._basis = fabric, basis
        self._energy = with_kernel(hourglass(fabric), HourglassKernel(fabric)).energy
        self.begin()

    def begin(self) -> None:
        """Return to the undeformed state."""
        self.parameters = {"C_s": self._stabilisation(self._basis.zeros())}
        self.work = self.drift = self.held = 0.0

    def commit(self, u: ndarray) -> bool:
        """Make ``u`` the last converged displacement; tell whether C_s changed."""
        basis, before = self._basis, self.parameters["C_s"]
        C_s = self._stabilisation(u)
        if np.array_equal(C_s, before):
            self.drift = 0.0
            return False
        # What is stored stays stored, however stiff the element is from now on.
        self.work += asm(self._energy, basis, u=u, C_s=before - C_s)
        self.drift = asm(self._energy, basis, u=u, C_s=np.abs(before - C_s))
        self.held = asm(self._energy, basis, u=u, C_s=before)
        self.parameters = {"C_s": C_s}
        return True

    def restore(self, parameters: dict[str, ndarray], work: float) -> None:
        """Hold the C_s of another run."""
        self.parameters, self.work = parameters, work

    @np.errstate(over="ignore")  # a run refuses what is not finite
    def _stabilisation(self, u: ndarray) -> ndarray:
        fabric = self._fabric.at()
        if is_zero(fabric.shear_law):  # whatever the angle
            rest = default_stabilisation(fabric)
            return np.broadcast_to(rest, (self._basis.nelems, 1)).copy()
        # The centre's gradient is the same at the four points of an element.
        field: Any = self._basis.interpolate(u)
        F = kin.deformation_gradient(centre_grad(field)[..., :1])
        centre, _ = CENTRE
        x = self._basis.mapping.F(centre, self._basis.tind)
        angle = kin.shear_angle(F, *self._fabric.directions(x))
        return default_stabilisation(fabric, angle)


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
