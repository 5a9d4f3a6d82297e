"""Parameters of stabilising terms: stiffnesses at a state, accumulated moments."""

from collections.abc import Callable
from functools import cached_property

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
from .term import TermParameters, Values


class HeldStiffness(TermParameters):
    """A stiffness of elements, held fixed between updates within an iteration.

    Parameters
    ----------
    name
        Name of the stiffness among the parameters of the forms.
    fabric
        Fibre directions, tension and shear laws.
    basis
        Elements over which the state is averaged.
    """

    def __init__(self, name: str, fabric: Fabric, basis: MeanBasis) -> None:
        self._name, self._fabric, self._basis = name, fabric, basis

    def at_rest(self) -> Values:
        """The stiffness of the undeformed ply."""
        return self._at_rest

    @cached_property
    def _at_rest(self) -> Values:
        return self._values(self._basis.zeros())

    def updated(
        self, values: Values, u: ndarray, t: float, tension: ndarray | None = None
    ) -> Values:
        """The stiffness at ``u``, with tensions that replace those there if given."""
        return self._values(u, tension)

    @np.errstate(over="ignore", invalid="ignore")  # runs refuse what is not finite
    def _values(self, u: ndarray, tension: ndarray | None = None) -> Values:
        w = FormExtraParams(self._basis.default_parameters())
        if tension is not None:
            w["tension"] = tension
        F = kin.deformation_gradient(displacement_gradient(self._basis, u))
        stiffness = self._of_state(w, F, directions(self._fabric, w))
        return Values({self._name: stiffness})

    def _of_state(
        self, w: FormExtraParams, F: ndarray, A: tuple[ndarray, ndarray]
    ) -> ndarray:
        raise NotImplementedError

    def _fibres(
        self, w: FormExtraParams, F: ndarray, A: tuple[ndarray, ndarray]
    ) -> tuple[ndarray, ndarray]:
        """Mean stiffnesses of warp and weft, and tensions of their mean stretches.

        Predicted tensions count in place of these.  They are averaged as forces on the
        stretch, T/λ, whose mean is that of the law: deviations from it cancel.
        """
        fabric = self._fabric.at(elements(w))
        strain = np.array([kin.fibre_strain(F, a) for a in A])
        laws = (fabric.tensions.of_family(i, strain) for i in range(2))
        pairs = zip(laws, strain, strict=True)
        E = mean(w, np.array([mean_slope(law, own) for law, own in pairs]))
        stretch = np.array([kin.stretch(F, a) for a in A])
        mean_stretch = mean(w, stretch)
        if "tension" in w:
            return E, mean_stretch * mean(w, w["tension"] / stretch)
        of_means = of_elements(self._fabric, elements(w))
        return E, fibre_tension(of_means, np.log(mean_stretch))

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


class AccumulatedMoment(TermParameters):
    """Moments M̃ and work of `hourglass_rate`, advanced once a step.

    The values are ``last``, the displacement of the last step, ``moment``, and
    ``work``, the work of the stabilisation so far in N·mm.  They depend on the steps:
    the rates of a long step are those at its end.

    Parameters
    ----------
    fabric, C_s
        As for `hourglass_rate`.
    basis
        The `HourglassBasis` of the forms.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import AccumulatedMoment, Fabric, HourglassBasis
    >>> basis = HourglassBasis(MeshQuad())
    >>> moment = AccumulatedMoment(Fabric(1e4), 5.0, basis)
    >>> values = moment.advanced(moment.at_rest(), basis.zeros(), 1.0)
    >>> float(values["work"])
    0.0
    """

    depends_on_steps = True

    def __init__(self, fabric: Fabric, C_s: float, basis: CellBasis) -> None:
        self._fabric, self._C_s, self._basis = fabric, C_s, basis
        self._work = hourglass_rate(fabric, C_s).energy

    def at_rest(self) -> Values:
        """No moments and no work."""
        basis = self._basis
        return Values(
            {"last": basis.zeros(), "moment": basis.zero_w(), "work": np.zeros(())}
        )

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Moments and work at the end of a step to ``u``."""
        basis, last, moment = self._basis, values["last"], values["moment"]
        work = values["work"] + asm(self._work, basis, u=u, last=last, moment=moment)
        w = FormExtraParams(
            x=basis.global_coordinates(),
            u=basis.interpolate(u),
            last=basis.interpolate(last),
        )
        increment = rate_increment(self._fabric, w)
        return Values(
            {"last": u, "moment": moment + self._C_s * increment, "work": work}
        )
