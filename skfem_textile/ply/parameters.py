"""Parameters of terms: immutable values, held stiffnesses and accumulated moments.

C_s acts on the non-constant shear of an element, and E_d on deviations of the stretches
from their mean.  Neither is a property of the fabric: they are just large enough to
suppress mechanisms of the element.  Both are derived from the local constitutive
response, without an element size, except E_d at singular fibres (`layer_stiffness`).
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, ClassVar, Never, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy import ndarray
from skfem import CellBasis, asm

from ..fabric import Fabric
from ..fabric import kinematics as kin
from ..fabric.law import Law, Resistance, mean_slope, n_slips
from ..forms.hourglass import hourglass_rate, rate_increment
from ..mesh.bases import (
    MeanBasis,
    displacement_gradient,
    element_numbers,
    function_gradients,
    mean,
)
from ..mesh.scikit_fem import FormExtraParams

T = TypeVar("T")

# Coefficients: C_s per shear stiffness and per tension, and exponent of the grip 1 −
# |cos ω|; for E_d, ratio of the tension to the shear contribution; decay of the tension
# weight for soft fibres: `python -m studies angles --part choosing`.
_C_S_OF_SHEAR, _C_S_OF_TENSION, _POWER_OF_GRIP = 4.0, 3.2, 1.5
_TENSION_OVER_SHEAR, _SOFTNESS = 0.7, 80.0

# C_s and E_d relative to the fibre stiffness at zero shear stiffness, from strip and
# trellis: `python -m studies formulations`.
_C_S_OF_FIBRES, _E_D_OF_FIBRES = 1e-4, 0.5

# Minimum grip, a guard against a zero C_s: fibres that cross at 8 degrees have it, an
# angle that fabrics do not reach.
_LEAST_GRIP = 0.01

# Ratio of shear to fibre stiffness at which their weight has decreased to 1/e.  It is a
# guard against a singular tangent: E_d, some hundred times the shear stiffness, is then
# a few thousand times the rounding of the fibre stiffness.
_NO_SHEAR = 1e-14

# Lower bound of the shear stiffness of a softening law, relative to its value at rest.
_LEAST_OF_REST = 0.1

# Shear angle in radians below which the tangent at rest replaces the secant,
# of which round-off would be a large share.
_SMALL_ANGLE = 1e-6


class Frozen(dict[str, T]):
    """Immutable mapping that can be copied and pickled."""

    __slots__ = ()

    def _refuse(self, *args: Any, **kwargs: Any) -> Never:
        raise TypeError(f"{type(self).__name__} does not support item assignment")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self)})"


class Values(Frozen[ndarray]):
    """Named read-only arrays on which the energy of a term depends, besides u and t.

    Parameters
    ----------
    arrays
        The arrays, copied unless read-only.
    """

    __slots__ = ()

    def __init__(self, arrays: Mapping[str, Any] = MappingProxyType({})) -> None:
        copies = {name: np.asarray(array) for name, array in arrays.items()}
        for name, array in copies.items():
            if array.flags.writeable:
                copies[name] = array.copy()
                copies[name].flags.writeable = False
        super().__init__(copies)

    def same_as(self, other: "Values") -> bool:
        """True if other values are equal arrays under the same names."""
        return self is other or (
            list(self) == list(other)
            and all(np.array_equal(self[name], other[name]) for name in self)
        )


#: Parameter values of the terms of a ply, by term name.
PlyParameters: TypeAlias = Mapping[str, Values]

#: Values of a term without parameters.
NO_VALUES = Values()


class TermParameters(Protocol):
    """Declaration of the parameters of a term: value at rest and two update rules.

    Both rules are pure functions that return new values.  A derived class defines
    ``at_rest`` and one or both of the rules.  Values named ``work`` are the energy in
    N·mm that the term has stored so far; `FormTerm` adds it to its energy form.

    Attributes
    ----------
    depends_on_steps
        True if the values depend on the step length, however short, so that results do
        not become independent of the number of steps.
    """

    depends_on_steps: bool = False

    def at_rest(self) -> Values:
        """Values of the undeformed ply."""
        ...

    def updated(
        self, values: Values, u: ndarray, t: float, tension: ndarray | None = None
    ) -> Values:
        """Values updated within an iteration, such as state-dependent stiffnesses.

        Parameters
        ----------
        values
            Previous values.
        u, t
            Displacement and load factor.
        tension
            Predicted fibre tensions, used instead of the tensions at ``u``, shape (2,
            n_elements, n_points), see `Ply.geometric_tension`.
        """
        return values

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Values updated once per step, at its converged displacement ``u``."""
        return values


class Together(TermParameters):
    """Parameters of a term that are declared by several objects.

    Parameters
    ----------
    parts
        Declarations of different values.
    """

    def __init__(self, *parts: TermParameters) -> None:
        self._parts = parts
        self.depends_on_steps = any(part.depends_on_steps for part in parts)

    def at_rest(self) -> Values:
        """Values of all parts."""
        return Values({k: x for part in self._parts for k, x in part.at_rest().items()})

    def updated(
        self, values: Values, u: ndarray, t: float, tension: ndarray | None = None
    ) -> Values:
        """Values updated by each part."""
        for part in self._parts:
            values = Values({**values, **part.updated(values, u, t, tension)})
        return values

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Values advanced by each part."""
        for part in self._parts:
            values = Values({**values, **part.advanced(values, u, t)})
        return values


class Slip(TermParameters):
    """Slip of the friction elements of laws, and the energy that it lost.

    The values are ``slip``, see `WithFriction`, and ``work``, the energy lost so far in
    N·mm.  ``slip`` has the shape (n_slips, n_elements, n_points) for shear, and (2,
    n_slips, n_elements, n_points) for tension, with one point where the law is
    evaluated at the mean stretch.

    Parameters
    ----------
    fabric
        Fibre directions and laws.
    basis
        Basis of the forms.
    of
        Quantity of the laws.
    of_means
        True if the tension is evaluated at the mean stretch.
    """

    def __init__(
        self,
        fabric: Fabric,
        basis: CellBasis,
        of: Resistance,
        of_means: bool = False,
    ) -> None:
        self._fabric, self._basis, self._of_means = fabric, basis, of_means
        self._of = of
        element = element_numbers(basis)
        fabric = fabric.at(element[:, :1] if of_means else element)
        self._law: Any = fabric.shear_law if of == "shear" else fabric.tensions

    def at_rest(self) -> Values:
        """No slip, and no energy lost."""
        n_elements, n_points = self._basis.dx.shape
        families = () if self._of == "shear" else (2,)
        points = 1 if self._of_means else n_points
        slip = np.zeros((*families, self._law.n_slips, n_elements, points))
        return Values({"slip": slip, "work": np.zeros(())})

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Slip and energy lost at the end of a monotonic step to ``u``."""
        slip = self._law.slip_after(self._argument(u), values["slip"])
        loss = self._law.loss(slip - values["slip"])
        work = values["work"] + (self._basis.dx * loss).sum()
        return Values({"slip": slip, "work": work})

    def _argument(self, u: ndarray) -> ndarray:
        """Shear angles or fibre strains in the laws."""
        w, basis = self._basis.default_parameters(), self._basis
        A = self._fabric.directions(np.asarray(w["x"]), element_numbers(basis))
        F = kin.deformation_gradient(displacement_gradient(basis, u))
        if self._of == "shear":
            return kin.shear_angle(F, *A)
        if self._of_means:
            return np.log(mean(w, np.array([kin.stretch(F, a) for a in A])))
        return np.array([kin.fibre_strain(F, a) for a in A])


def with_slip_of(
    parameters: TermParameters | None, fabric: Fabric, basis: CellBasis, of: Resistance
) -> TermParameters | None:
    """Parameters of a term, and the slip of its laws if they have friction."""
    law = fabric.shear_law if of == "shear" else fabric.tensions
    if not n_slips(law):
        return parameters
    if parameters is None:
        return Slip(fabric, basis, of)
    return Together(parameters, Slip(fabric, basis, of, of_means=True))


def stabilisation_stiffness(
    G: ndarray, E: ndarray, T: ndarray, cos_angle: ndarray
) -> ndarray:
    """C_s in N/mm; it increases with G and tension, and as fibre angles close.

    ``C_s = (4 G + 3.2 τ)/(1 − |cos ω|)^1.5`` with τ of `effective_tension` and the
    angle ω between the families, and 10⁻⁴ E without shear stiffness.  For nearly
    parallel families the shear angle is insensitive to motions across both: ``1 − |cos
    ω|`` is the smallest sum of squared components of a unit displacement normal to the
    families.

    Parameters
    ----------
    G, E, T
        Shear stiffness, fibre stiffness and fibre tension of the element, in N/mm.
    cos_angle
        ``|cos ω|``.
    """
    grip = np.maximum(1.0 - cos_angle, _LEAST_GRIP) ** _POWER_OF_GRIP
    without_shear = _without_shear(G, E)
    resistance = _C_S_OF_SHEAR * G + _C_S_OF_TENSION * effective_tension(G, E, T)
    of_fibres = _C_S_OF_FIBRES * E
    return (1.0 - without_shear) * resistance / grip + without_shear * of_fibres


def deviation_stiffness(
    multiple: float | ndarray, G: ndarray, E: ndarray, T: ndarray
) -> ndarray:
    """E_d in N/mm: a multiple of G + 0.7 τ, in series with E.

    It is ½ E without shear stiffness.  A jump of the shear angle lies along fibres that
    carry a concentrated force.  Their tension T increases as the elements become
    smaller, and with a constant E_d an increasing part of the force would be lost to
    deviations of the stretch.  Elsewhere E_d is of the order of G, and elements do not
    lock.

    Parameters
    ----------
    multiple
        Calibrated, see `Macro` and `Quadratic`.
    G, E, T
        See `stabilisation_stiffness`; G is the `further_shear_stiffness`.
    """
    without_shear = _without_shear(G, E)
    resistance = multiple * (G + _TENSION_OVER_SHEAR * effective_tension(G, E, T))
    both = _in_series(resistance, E)
    return (1.0 - without_shear) * both + without_shear * _E_D_OF_FIBRES * E


def _in_series(stiffness: ndarray, other: ndarray) -> ndarray:
    """Stiffness of two springs in series; zero if both are zero."""
    both = stiffness + other
    return stiffness / np.where(both > 0, both, 1.0) * other


# E_d of a resolved layer over G at most, a guard against round-off: with E/G = 1e12
# runs take three times as many solves without it, and with 1e6 it changes E_d by 1 %.
_MOST_OF_SHEAR = 1e8


def layer_stiffness(length: ndarray, G: ndarray, E: ndarray) -> ndarray:
    """E_d in N/mm of elements in the layer of a singular fibre, in series with E.

    ``√(G E)`` times a length relative to the size of the element.  The force N of the
    fibre spreads over a layer of the width ``L √(G/E)`` along a length L, and stretches
    it by ``N/√(G E)``.  In elements of the size h, which are wider, it stretches them
    by ``N L/(E_d h)``.  Elements that resolve the layer have E, in series with 10⁸ G:
    the stretch varies across the fibre.

    Parameters
    ----------
    length
        L/h, times a calibrated factor; infinite for elements that resolve the layer.
    G, E
        See `deviation_stiffness`.
    """
    resolved = np.isinf(length)
    unresolved = _in_series(np.where(resolved, 0.0, length) * np.sqrt(G * E), E)
    of_layer = np.where(G > 0, _in_series(_MOST_OF_SHEAR * G, E), E)
    return np.where(resolved, of_layer, unresolved)


def effective_tension(G: ndarray, E: ndarray, T: ndarray) -> ndarray:
    """``τ = |T|/(1 + 80 √(G/E))`` in N/mm.

    The force of a fibre at a jump spreads over a layer whose width is proportional to
    √(G/E).  Elements resolve more of a wide layer.  Fibres in compression are treated
    like fibres in tension, because elements at a free edge would otherwise fold along
    them.

    Parameters
    ----------
    G, E, T
        See `stabilisation_stiffness`.
    """
    softness = np.sqrt(G / np.where(E > 0, E, 1.0))
    return np.abs(T) / (1.0 + _SOFTNESS * softness)


def shear_stiffness(law: Law, angle: ndarray) -> ndarray:
    """Secant M_s/Γ in N/mm, at least a tenth of its value at rest."""
    at_rest = law.tangent(np.zeros_like(angle))
    sheared = np.abs(angle) > _SMALL_ANGLE
    divisor = np.where(sheared, angle, 1.0)
    secant = np.where(sheared, law.value(angle) / divisor, at_rest)
    return np.maximum(secant, _LEAST_OF_REST * at_rest)


def further_shear_stiffness(law: Law, angle: ndarray) -> ndarray:
    """Tangent in N/mm for a stiffening law, secant for a softening one."""
    return np.maximum(shear_stiffness(law, angle), law.tangent(angle))


def _without_shear(G: ndarray, E: ndarray) -> ndarray:
    """Weight that falls smoothly from 1 at zero shear stiffness to 0."""
    return np.exp(-G / np.where(E > 0, _NO_SHEAR * E, 1.0))


class HeldStiffness(TermParameters):
    """Element stiffness, held fixed between updates within an iteration.

    Parameters
    ----------
    fabric
        Fibre directions, tension and shear laws.
    basis
        Elements over which the state is averaged.
    """

    #: Name of the stiffness among the parameters of the forms.
    name: ClassVar[str]
    #: Stiffness of the shear law at shear angles.
    of_shear: ClassVar[Callable[[Law, ndarray], ndarray]]

    def __init__(self, fabric: Fabric, basis: MeanBasis) -> None:
        self._fabric, self._basis = fabric, basis

    def at_rest(self) -> Values:
        """Stiffness of the undeformed ply."""
        return self.updated(NO_VALUES, self._basis.zeros(), 0.0)

    @np.errstate(over="ignore", invalid="ignore")  # runs reject non-finite values
    def updated(
        self, values: Values, u: ndarray, t: float, tension: ndarray | None = None
    ) -> Values:
        """Stiffness at ``u``, optionally with other tensions.

        The tensions are averaged as T/λ, the force conjugate to the stretch: its mean
        equals the value of the law, because deviations cancel.
        """
        w, A, fabric, of_means, dN = self._undeformed
        F = kin.deformation_gradient(displacement_gradient(self._basis, u, dN))
        strain, stretch, angle, cos_angle = kin.both_fibres(F, *A)
        G, law = mean(w, type(self).of_shear(fabric.shear_law, angle)), fabric.tensions
        slopes = [mean_slope(law.of_family(i, strain), strain[i]) for i in range(2)]
        mean_stretch = mean(w, stretch)
        if tension is None:
            T = np.array(of_means.tensions.value(np.log(mean_stretch)))
        else:
            T = mean_stretch * mean(w, tension / stretch)
        E = mean(w, np.array(slopes))
        return Values({self.name: self._of(G, E, T, mean(w, np.abs(cos_angle)))})

    @cached_property
    def _undeformed(
        self,
    ) -> tuple[dict[str, Any], tuple[ndarray, ndarray], Fabric, Fabric, ndarray]:
        """Parameters of forms, fibre directions, laws at points and at elements.

        And the `function_gradients`.
        """
        w, element = self._basis.default_parameters(), element_numbers(self._basis)
        A = self._fabric.directions(np.asarray(w["x"]), element)
        laws = self._fabric.at(element), self._fabric.at(element[:, :1])
        return w, A, *laws, function_gradients(self._basis)

    def _of(self, G: ndarray, E: ndarray, T: ndarray, cos_angle: ndarray) -> ndarray:
        """Stiffness from means over elements.

        These are the stiffness of the shear law and ``|cos ω|``, shape (n_elements, 1),
        and stiffnesses and tensions of warp and weft, shape (2, n_elements, 1).
        """
        raise NotImplementedError


class HeldStabilisation(HeldStiffness):
    """C_s of `hourglass` and `out_of_plane`, from warp and weft together.

    It is computed by `stabilisation_stiffness`.  Of the parameters ``p`` of a ply, such
    as `Ply.parameters_at_rest`, it is ``p["stabilisation"]["C_s"]`` in N/mm, of shape
    (elements after the split, 1).

    Parameters
    ----------
    fabric
        Fibre directions, tension and shear laws.
    basis
        Elements over which the state is averaged; all of their parts have the same C_s.
    by_tension
        True if tension contributes.
    by_grip
        True if the angle between the families contributes.
    """

    name, of_shear = "C_s", shear_stiffness

    def __init__(
        self, fabric: Fabric, basis: MeanBasis, by_tension: bool, by_grip: bool = True
    ) -> None:
        self._by_tension, self._by_grip = by_tension, by_grip
        super().__init__(fabric, basis)

    def _of(self, G: ndarray, E: ndarray, T: ndarray, cos_angle: ndarray) -> ndarray:
        T = self._by_tension * np.abs(T).mean(axis=0)
        cos_angle = self._by_grip * cos_angle
        C_s = stabilisation_stiffness(G, E.mean(axis=0), T, cos_angle)
        return self._basis.to_ply_points(np.broadcast_to(C_s, self._basis.dx.shape))


class HeldDeviation(HeldStiffness):
    """E_d of `mean_tension`: `deviation_stiffness` of warp and weft in each element.

    E_d resists deviations of the stretch of the parts of a macro-element from their
    mean.  Of the parameters ``p`` of a ply of macro-elements, such as
    `Ply.parameters_at_rest`, it is ``p["tension"]["E_d"]`` in N/mm, of shape (2,
    elements before the split, 1), for warp and weft.

    Parameters
    ----------
    fabric
        Fibre directions, tension and shear laws.
    multiple
        Multiple in `deviation_stiffness`: a number, or one value per element, shape
        (n_elements, 1).
    basis
        The `MeanBasis` of the forms.
    layer
        ``length`` of `layer_stiffness` for warp and weft, shape (2, n_elements, 1);
        zero outside of the layers of singular fibres.
    """

    name, of_shear = "E_d", further_shear_stiffness

    def __init__(
        self,
        fabric: Fabric,
        multiple: float | ndarray,
        basis: MeanBasis,
        layer: ndarray,
    ) -> None:
        self._multiple, self.layer = multiple, layer
        super().__init__(fabric, basis)

    def _of(self, G: ndarray, E: ndarray, T: ndarray, cos_angle: ndarray) -> ndarray:
        elsewhere = deviation_stiffness(self._multiple, G, E, T)
        if not self.layer.any():
            return elsewhere
        on = layer_stiffness(self.layer, G, E)
        return np.where(self.layer > 0, on, elsewhere)


class AccumulatedMoment(TermParameters):
    """Moments M̃ and work of `hourglass_rate`, updated once per step.

    The values are ``last``, the displacement of the last step, ``moment``, and
    ``work``, the accumulated work of the stabilisation in N·mm.  They depend on the
    step length, because the rates of a step are evaluated at its end.

    Parameters
    ----------
    fabric, C_s
        See `hourglass_rate`.
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
        self._forms = hourglass_rate(fabric, C_s)

    def at_rest(self) -> Values:
        """Zero moments and zero work."""
        basis = self._basis
        return Values(
            {"last": basis.zeros(), "moment": basis.zero_w(), "work": np.zeros(())}
        )

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Moments and work at the end of a step to ``u``."""
        basis, last, moment = self._basis, values["last"], values["moment"]
        work = values["work"] + asm(
            self._forms.energy, basis, u=u, last=last, moment=moment
        )
        w = FormExtraParams(
            x=basis.global_coordinates(),
            u=basis.interpolate(u),
            last=basis.interpolate(last),
        )
        increment = rate_increment(self._fabric, w)
        return Values(
            {"last": u, "moment": moment + self._C_s * increment, "work": work}
        )
