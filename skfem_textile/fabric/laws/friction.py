"""Laws whose unloading differs from loading: an elastic law with friction elements.

A friction element is a spring in series with a slider, which slips at a limit f
(Prandtl, Jenkins).  With the slip s, the strain or angle at which its spring is
unstressed, and the onset y, the strain at which the slider starts to slip, its force is
``f/y`` times x − s, and between −f and f.  Elements in parallel with an elastic law
obey Masing's rules (Iwan 1967): after a reversal the friction part of the law is the
first loading curve, scaled by two in both directions, and a closed loop returns to the
curve from which it branched off.

The slip changes once a step, at the equilibrium.  Within a step the energy of an
element is Huber's function of x − s, which is convex and has a symmetric tangent: the
energy of its spring, and the energy lost by the slip of the step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray

from ..law import (
    Law,
    Linear,
    Resistance,
    ScalarLaw,
    domain_of,
    inner_law,
    keep,
    n_slips,
    number,
    refuse_other_units,
)

# Distance from the onset, relative to it, up to which an element counts as slipping:
# round-off of the strain of a state in which it has just slipped.
_SLIPPING = 1e-9


@dataclass(frozen=True)
class WithFriction(ScalarLaw):
    """Elastic law with friction elements, whose unloading differs from loading.

    Its ``energy``, ``value`` and ``tangent`` apply to the first loading.  A `Ply`
    carries the slip of the elements from step to step; a load that reverses within a
    step is not resolved.

    Parameters
    ----------
    law
        Elastic law of tension, shear or bending.
    limits
        Limit f of each element in N/mm, for bending in N·mm per mm of width.
    onsets
        Strain, shear angle in radians, or curvature in 1/mm, at which each element
        slips when it is loaded for the first time.

    Raises
    ------
    ValueError
        If a limit or an onset is not a positive finite number, there is not one onset
        for each limit, or the law varies by element.

    Examples
    --------
    After a shear of 0.4 rad and back, the slip of the element leaves a moment of
    −0.02 N/mm:

    >>> from skfem_textile import Linear, WithFriction
    >>> law = WithFriction(Linear(0.5), limits=[0.02], onsets=[0.1])
    >>> slip = law.slip_after(np.array([0.4]), np.zeros((1, 1)))
    >>> law.with_slip(slip).value(np.array([0.4, 0.3, 0.0])).round(9)
    array([ 0.22,  0.15, -0.02])
    """

    law: Law
    limits: Sequence[float]
    onsets: Sequence[float]

    def __post_init__(self) -> None:
        inner_law("law", self.law)
        limits = tuple(number("limit", f, above=0) for f in _sequence(self.limits))
        onsets = tuple(number("onset", y, above=0) for y in _sequence(self.onsets))
        if len(limits) != len(onsets) or not limits:
            raise ValueError(
                "friction requires a limit and an onset for each element, got "
                f"{len(limits)} limit(s) and {len(onsets)} onset(s)"
            )
        refuse_other_units("onset", onsets, self.of)
        keep(self, limits=limits, onsets=onsets)

    @property
    def of(self) -> Resistance | None:  # type: ignore[override]
        """Quantity of the elastic law."""
        return getattr(self.law, "of", None)

    @property
    def domain(self) -> tuple[Any, Any]:
        """Domain of the elastic law."""
        return domain_of(self.law)

    @property
    def shown(self) -> tuple[float, float] | None:
        """Shown range of the elastic law."""
        return getattr(self.law, "shown", None)

    @property
    def n_slips(self) -> int:
        """Number of friction elements."""
        return len(self.limits)

    def energy(self, x: ndarray) -> ndarray:
        """Energy of the first loading, the energy lost included."""
        return self.with_slip(self._at_rest(x)).energy(x)

    def value(self, x: ndarray) -> ndarray:
        """Elastic value plus f/y x of each element, at most f."""
        return self.with_slip(self._at_rest(x)).value(x)

    def tangent(self, x: ndarray) -> ndarray:
        """Elastic tangent plus f/y of each element that does not slip."""
        return self.with_slip(self._at_rest(x)).tangent(x)

    def with_slip(self, slip: ndarray) -> "Slipped":
        """The law after slip of its elements.

        Shape (n, ...), of which the first ``n_slips`` belong to this law.
        """
        return Slipped(self, slip[: self.n_slips])

    def slip_after(self, x: ndarray, slip: ndarray) -> ndarray:
        """Slip at the end of a monotonic step to x, shape (n, ...)."""
        onset, own = _column(self.onsets, x), slip[: self.n_slips]
        slipped = x - np.clip(x - own, -onset, onset)
        after = slip.copy()
        after[: self.n_slips] = np.where(np.abs(x - own) > onset, slipped, own)
        return after

    def loss(self, change: ndarray) -> ndarray:
        """Energy density lost by changes of slip, shape (n, ...), in N·mm/mm²."""
        own = np.abs(change[: self.n_slips])
        return (_column(self.limits, change[0]) * own).sum(axis=0)

    def _at_rest(self, x: ndarray) -> ndarray:
        return np.zeros((self.n_slips, *np.shape(x)))


@dataclass(frozen=True, eq=False)
class Slipped(ScalarLaw):
    """A law with friction, with the slip of its elements: of one step.

    Parameters
    ----------
    law
        The law with friction.
    slip
        Slip of its elements, shape (n_slips, ...), which broadcasts with arguments.
    """

    law: WithFriction
    slip: ndarray

    def energy(self, x: ndarray) -> ndarray:
        """Elastic energy, energy of the springs, and energy lost in the step."""
        strain, held, stiffness = self._elements(x)
        huber = stiffness * held * (strain - 0.5 * held)
        return self.law.law.energy(x) + huber.sum(axis=0)

    def value(self, x: ndarray) -> ndarray:
        """Derivative of the energy."""
        _, held, stiffness = self._elements(x)
        return self.law.law.value(x) + (stiffness * held).sum(axis=0)

    def tangent(self, x: ndarray) -> ndarray:
        """Derivative of the value."""
        strain, _, stiffness = self._elements(x)
        sticks = np.abs(strain) < (1 - _SLIPPING) * _column(self.law.onsets, x)
        return self.law.law.tangent(x) + (stiffness * sticks).sum(axis=0)

    def _elements(self, x: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Strain of each element, the part of its spring, and its stiffness."""
        onset = _column(self.law.onsets, x)
        strain = x - self.slip
        held = np.clip(strain, -onset, onset)
        return strain, held, _column(self.law.limits, x) / onset


def parted(law: Any) -> tuple[Any, Any]:
    """Elastic law and friction elements of a law, also if it varies by region.

    The elements are None for a law without friction.
    """
    if not n_slips(law):
        return law, None
    if isinstance(law, WithFriction):
        return law.law, replace(law, law=Linear(0.0))
    elastic, friction = zip(*map(parted, law.laws), strict=True)
    elements = [Linear(0.0) if one is None else one for one in friction]
    return replace(law, laws=elastic), replace(law, laws=elements)


def along(law: WithFriction, x: ndarray) -> tuple[ndarray, float]:
    """Values of a law over a history of arguments, and the energy density lost.

    Parameters
    ----------
    law
        The law.
    x
        Arguments in the order of loading, from rest: a straight path leads from each to
        the next, shape (n,).

    Examples
    --------
    >>> from skfem_textile import Linear, WithFriction
    >>> law = WithFriction(Linear(1.0), [0.1], [0.1])
    >>> values, lost = along(law, np.array([0.5, -0.5, 0.5]))
    >>> values.round(3).tolist(), round(lost, 3)
    ([0.6, -0.6, 0.6], 0.2)
    """
    slip, values, lost = np.zeros((law.n_slips, 1)), [], 0.0
    for one in np.asarray(x, dtype=float).reshape(-1, 1):
        values.append(law.with_slip(slip).value(one)[0])
        after = law.slip_after(one, slip)
        lost, slip = lost + float(law.loss(after - slip)[0]), after
    return np.array(values), lost


def _sequence(values: Any) -> tuple[Any, ...]:
    """A sequence of numbers, or one number."""
    return tuple(values) if np.ndim(values) else (values,)


def _column(values: Any, x: ndarray) -> ndarray:
    """One value for each element, for arguments of any shape."""
    return np.reshape(values, (-1, *(1,) * np.ndim(x)))
