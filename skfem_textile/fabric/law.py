"""What a law of tension or shear is, and how one is registered."""

from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np
from numpy import ndarray

from ..registration import Registration


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


#: What a law may be the law of.
Resistance: TypeAlias = Literal["tension", "shear"]


@dataclass(frozen=True, kw_only=True)
class LawRegistration(Registration):
    """A law that can be chosen by name.

    Its options are its parameters, without the word that tells which law they are of:
    the option ``stiffness`` of a shear law is ``--shear-stiffness``.

    Attributes
    ----------
    resists
        What it may be the law of.
    """

    resists: tuple[Resistance, ...] = ("tension", "shear")


def law_at(law: Law, element: ndarray | None) -> Law:
    """A law at points, by the numbers of their elements, if it differs among these."""
    return law.at(element) if hasattr(law, "at") else law


def domain_of(law: Law) -> tuple[Any, Any]:
    """The least and the largest argument for which a law says that it holds."""
    return getattr(law, "domain", (-np.inf, np.inf))
