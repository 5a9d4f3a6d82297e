"""What a law of tension or shear is, and the linear one, for which a number stands."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy import ndarray


class Law(Protocol):
    """A scalar elastic law: energy, its derivative and its second derivative.

    For fibres ``x`` is the fibre strain ε and ``value`` the tension T in N/mm;
    for shear ``x`` is the shear angle Γ in radians and ``value`` the shear
    moment M_s in N/mm.  All three take and return arrays.

    A law that differs from element to element has a method ``at``: of numbers of
    elements, shape (n, n_points) or (n, 1), or None for all of them, it makes the law
    at these points, whose parameters broadcast with x.

    A law may have a ``domain``, the least and the largest x for which it holds: no
    state beyond it is an answer.  One that says nothing ends where its energy is not
    finite, such as past a pole; one that holds everywhere, ``(-inf, inf)``, saves the
    load stepper from asking.

    A law may say by ``shown``, two arguments, where it is drawn, and how far it is
    checked on a side on which its domain does not end.
    """

    def energy(self, x: ndarray) -> ndarray:
        """Energy density in N·mm/mm², zero at x = 0."""
        ...

    def value(self, x: ndarray) -> ndarray:
        """Derivative of the energy."""
        ...

    def tangent(self, x: ndarray) -> ndarray:
        """Derivative of the value."""
        ...


@dataclass(frozen=True)
class OneStiffness:
    """A law with one parameter, its initial stiffness; finite everywhere.

    The stiffness is a number, or one for each element, shape (n_elements,).
    """

    stiffness: float | ndarray
    domain: ClassVar[tuple[float, float]] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        stiffness = np.ravel(self.stiffness)
        if (wrong := stiffness[~(np.isfinite(stiffness) & (stiffness >= 0))]).size:
            raise ValueError(f"stiffness must be a finite number >= 0, got {wrong[0]}")

    def at(self, element: ndarray | None = None) -> Self:
        """The law at points, by the numbers of their elements; see `Law`."""
        every = np.asarray(self.stiffness)
        if every.ndim == 0:
            return self
        own = every[:, None] if element is None else every[element]
        return replace(self, stiffness=own)


@dataclass(frozen=True)
class Linear(OneStiffness):
    """The law ``value = stiffness · x``.

    Raises
    ------
    ValueError
        If the stiffness is negative or not finite.
    """

    def energy(self, x: ndarray) -> ndarray:
        """½ stiffness x²."""
        return 0.5 * self.stiffness * x**2

    def value(self, x: ndarray) -> ndarray:
        """Stiffness times x."""
        return self.stiffness * x

    def tangent(self, x: ndarray) -> ndarray:
        """The stiffness."""
        return self.stiffness + np.zeros(np.shape(x))


def is_zero(law: Law) -> bool:
    """Whether a law needs no term at all."""
    return isinstance(law, OneStiffness) and not np.any(law.stiffness)


def law_at(law: Law, element: ndarray | None) -> Law:
    """A law at points, by the numbers of their elements, if it differs among these."""
    return law.at(element) if hasattr(law, "at") else law


def domain_of(law: Law) -> tuple[Any, Any]:
    """The least and the largest argument for which a law says that it holds."""
    return getattr(law, "domain", (-np.inf, np.inf))
