"""The law of fibres that are in tension at rest."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy import ndarray

from ...registration import Option, Resistance
from ..law import Law, ScalarLaw, domain_of, inner_law, number

# Largest strain at which the tension is looked for, and the first.
_LARGEST, _FIRST = 10.0, 1e-6


@dataclass(frozen=True)
class Pretensioned(ScalarLaw):
    """A law of fibres that were stretched before, up to a tension.

    The tension is T(ε + ε₀), where T(ε₀) is the given one.  Fibres with crimp have
    less of it then, and those of `TensionOnly` go slack where they have shortened by
    ε₀.  Of a linear law that is T₀ + E ε.

    Parameters
    ----------
    law
        The law of the fibres without pretension; it rises.
    tension
        T₀ in N/mm.

    Raises
    ------
    ValueError
        If the tension is not a finite number >= 0, or the law does not reach it or
        differs from element to element.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> Pretensioned(Linear(1e3), 5.0).value(np.array([-0.005, 0.0, 0.001])).round(9)
    array([0., 5., 6.])
    """

    law: Law
    tension: float
    of: ClassVar[Resistance] = "tension"

    def __post_init__(self) -> None:
        object.__setattr__(self, "tension", number("pretension", self.tension))
        inner_law("law", self.law)
        _ = self.strain_before

    @cached_property
    def strain_before(self) -> float:
        """ε₀, by bisection down to neighbouring numbers."""
        low, high = 0.0, _FIRST
        if (at_rest := self._at(low)) > self.tension:
            raise ValueError(
                f"the law has {at_rest:.4g} N/mm at rest, more than the pretension "
                f"{self.tension:g}"
            )
        if at_rest == self.tension:
            return low
        end = min(float(domain_of(self.law)[1]), _LARGEST)
        while self._at(min(high, end)) < self.tension:
            if high >= end:
                raise ValueError(
                    f"the law has only {self._at(end):.4g} N/mm at a strain of "
                    f"{end:.4g}, less than the pretension {self.tension:g}"
                )
            low, high = high, 2 * high
        high = min(high, end)
        while low < (middle := 0.5 * (low + high)) < high:
            if self._at(middle) < self.tension:
                low = middle
            else:
                high = middle
        return high

    @property
    def domain(self) -> tuple[float, float]:
        """That of the law, from the strain before."""
        low, high = domain_of(self.law)
        return low - self.strain_before, high - self.strain_before

    @property
    def shown(self) -> tuple[float, float] | None:
        """What the law shows."""
        shown = getattr(self.law, "shown", None)
        if shown is None:
            return None
        return shown[0] - self.strain_before, shown[1] - self.strain_before

    def energy(self, x: ndarray) -> ndarray:
        """The law's energy, less that at rest."""
        at_rest = self.law.energy(np.array([self.strain_before]))[0]
        return self.law.energy(x + self.strain_before) - at_rest

    def value(self, x: ndarray) -> ndarray:
        """T(ε + ε₀)."""
        return self.law.value(x + self.strain_before)

    def tangent(self, x: ndarray) -> ndarray:
        """T′(ε + ε₀)."""
        return self.law.tangent(x + self.strain_before)

    def _at(self, strain: float) -> float:
        return float(self.law.value(np.array([strain]))[0])


#: The tension of fibres at rest.
PRETENSION = Option(
    name="pretension",
    help="tension of the fibres at rest, by a stretch before",
    default=0.0,
    read=float,
    metavar="T",
    unit="N_per_mm",
)


def with_pretension(law: Law, tension: float) -> Law:
    """The law as it is, or of fibres in tension at rest."""
    return Pretensioned(law, tension) if tension else law
