"""What stabilising terms remember of a state."""

from collections.abc import Callable

import numpy as np
from numpy import ndarray
from skfem import CellBasis, asm
from skfem.assembly.form.form import FormExtraParams

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..fabric.law import Law, mean_slope
from ..forms.form import directions, elements, fibre_tension
from ..forms.held_stiffness import (
    deviation_stiffness,
    further_shear_stiffness,
    shear_stiffness,
    stabilisation_stiffness,
)
from ..forms.hourglass import hourglass_rate, rate_increment
from ..forms.mean_tension import mean, of_elements
from ..mesh.bases import MeanBasis, displacement_gradient
from .term import DependsOn


class HeldStiffness:
    """A stiffness of elements at a state near the one that is sought.

    Parameters
    ----------
    name
        Name of the stiffness among the parameters of the forms.
    fabric
        Fibre directions, tension and shear laws.
    basis
        Elements over which the state is averaged.

    Attributes
    ----------
    parameters
        The stiffness by its name.
    takes_tension
        That `commit` does, which tells it from that of other memories.
    """

    work: float = 0.0
    depends_on: DependsOn = "state"
    takes_tension = True

    def __init__(self, name: str, fabric: Fabric, basis: MeanBasis) -> None:
        self._name, self._fabric, self._basis = name, fabric, basis
        self.begin()

    def begin(self) -> None:
        """Return to the undeformed state."""
        self.parameters = {self._name: self._stiffness(self._basis.zeros())}

    def commit(self, u: ndarray, tension: ndarray | None = None) -> bool:
        """Take the stiffness at ``u``; tell whether it changed.

        Parameters
        ----------
        u
            Displacement.
        tension
            Fibre tensions that take the place of those at ``u``, shape (2, n_elements,
            n_points), as `Ply.geometric_tension` gives them.
        """
        before, after = self.parameters[self._name], self._stiffness(u, tension)
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

    @np.errstate(over="ignore", invalid="ignore")  # runs refuse what is not finite
    def _stiffness(self, u: ndarray, tension: ndarray | None = None) -> ndarray:
        w = FormExtraParams(self._basis.default_parameters())
        if tension is not None:
            w["tension"] = tension
        F = kin.deformation_gradient(displacement_gradient(self._basis, u))
        return self._of_state(w, F, directions(self._fabric, w))

    def _of_state(
        self, w: FormExtraParams, F: ndarray, A: tuple[ndarray, ndarray]
    ) -> ndarray:
        raise NotImplementedError

    def _fibres(
        self, w: FormExtraParams, F: ndarray, A: tuple[ndarray, ndarray]
    ) -> tuple[ndarray, ndarray]:
        """Mean stiffnesses of warp and weft, and tensions of their mean stretches.

        Tensions that are given count in place of these, their means.
        """
        fabric = self._fabric.at(elements(w))
        strain = np.array([kin.fibre_strain(F, a) for a in A])
        laws = (fabric.tensions.of_family(i, strain) for i in range(2))
        pairs = zip(laws, strain, strict=True)
        E = mean(w, np.array([mean_slope(law, own) for law, own in pairs]))
        if "tension" in w:
            return E, mean(w, w["tension"])
        mean_strain = np.log(mean(w, np.array([kin.stretch(F, a) for a in A])))
        return E, fibre_tension(of_elements(self._fabric, elements(w)), mean_strain)

    def _shear(
        self,
        stiffness: Callable[[Law, ndarray], ndarray],
        w: FormExtraParams,
        F: ndarray,
        A: tuple[ndarray, ndarray],
    ) -> ndarray:
        """The mean of a stiffness of the shear law."""
        law = self._fabric.at(elements(w)).shear_law
        return mean(w, stiffness(law, kin.shear_angle(F, *A)))


class HeldStabilisation(HeldStiffness):
    """C_s of `hourglass` and `out_of_plane`: that of warp and weft together.

    It is `stabilisation_stiffness`.

    Parameters
    ----------
    fabric
        Fibre directions, tension and shear laws.
    basis
        Elements over which the state is averaged; all of their parts have one C_s.
    by_tension
        Whether tension counts.
    by_grip
        Whether the angle between the families counts.
    """

    def __init__(
        self, fabric: Fabric, basis: MeanBasis, by_tension: bool, by_grip: bool = True
    ) -> None:
        self._by_tension, self._by_grip = by_tension, by_grip
        super().__init__("C_s", fabric, basis)

    def _of_state(
        self, w: FormExtraParams, F: ndarray, A: tuple[ndarray, ndarray]
    ) -> ndarray:
        G = self._shear(shear_stiffness, w, F, A)
        E, T = self._fibres(w, F, A)
        C_s = stabilisation_stiffness(
            G,
            E.mean(axis=0),
            self._by_tension * np.abs(T).mean(axis=0),
            self._by_grip * mean(w, np.abs(kin.cos_angle(F, *A))),
        )
        return self._basis.to_ply_points(np.broadcast_to(C_s, self._basis.dx.shape))


class HeldDeviation(HeldStiffness):
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
        self, fabric: Fabric, multiple: float | ndarray, basis: MeanBasis
    ) -> None:
        self._multiple = multiple
        super().__init__("E_d", fabric, basis)

    def _of_state(
        self, w: FormExtraParams, F: ndarray, A: tuple[ndarray, ndarray]
    ) -> ndarray:
        G = self._shear(further_shear_stiffness, w, F, A)
        E, T = self._fibres(w, F, A)
        return deviation_stiffness(self._multiple, G, E, T)


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
