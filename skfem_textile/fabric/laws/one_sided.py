"""Laws of tension that are other laws in compression."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy import ndarray

from ...registration import Option, Resistance
from ..law import Law, ScalarLaw, domain_of, inner_law, number, refuse_force_at_rest

# Strain from 0 within which a law goes over into the other.  A wider switch leaves more
# of the small strains softer than the law.  A narrower one changes the tangent faster,
# so that an iteration is more likely to step across it.
_WIDTH = 1e-4


@dataclass(frozen=True)
class TensionOnly(ScalarLaw):
    """A law that vanishes in compression, with a smooth switch.

    The tension is T(r) r′ of a strain r(ε): r = 0 below −width, r = ε above width, and
    between them r′ is a polynomial of degree five.  The tension is the given one above
    the width and exactly zero below −width.  Value and tangent are continuous, and
    so is the second derivative of the value if that of the given law is.  The value
    rises if the given one does.  The tangent at rest is 0.40 of the given one's.

    Parameters
    ----------
    law
        The law of tension, zero at rest.  It is asked for r >= 0 only.
    width
        Strain at which the switch ends.

    Raises
    ------
    ValueError
        If the law does not vanish at rest, ends before the width, or differs from
        element to element; or the width is not a positive finite number.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> TensionOnly(Linear(1e4)).value(np.array([-0.01, 0.01]))
    array([  0., 100.])
    """

    law: Law
    width: float = _WIDTH
    of: ClassVar[Resistance] = "tension"

    def __post_init__(self) -> None:
        object.__setattr__(self, "width", number("width", self.width, above=0))
        refuse_force_at_rest("law", inner_law("law", self.law), self.width)

    @property
    def domain(self) -> tuple[float, float]:
        """As far as the law's, and all of compression."""
        return -np.inf, domain_of(self.law)[1]

    @property
    def shown(self) -> tuple[float, float] | None:
        """What the law shows of tension, and a tenth of that of compression."""
        shown = getattr(self.law, "shown", None)
        return None if shown is None else (-0.1 * shown[1], shown[1])

    def energy(self, x: ndarray) -> ndarray:
        """The energy of r, less that at rest."""
        ramp, rest = _ramp(x, self.width), _ramp(np.zeros(1), self.width)
        return self.law.energy(ramp.strain) - self.law.energy(rest.strain)[0]

    def value(self, x: ndarray) -> ndarray:
        """T(r) r′."""
        ramp = _ramp(x, self.width)
        return self.law.value(ramp.strain) * ramp.slope

    def tangent(self, x: ndarray) -> ndarray:
        """T′(r) r′² + T(r) r″."""
        return _tangent(self.law, _ramp(x, self.width), 1.0)


@dataclass(frozen=True)
class Asymmetric(ScalarLaw):
    """One law in tension and another in compression, with a smooth switch.

    Each is switched as in `TensionOnly`, and their tensions are added.  Above the width
    the tension is exactly the one, below −width the other.  Of two laws of the same
    stiffness the tangent at rest is 0.79 of that.

    Parameters
    ----------
    tension, compression
        The laws for positive and for negative strain, each zero at rest.
    width
        Strain at which the switch ends on either side.

    Raises
    ------
    ValueError
        As of `TensionOnly`, of either law.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> Asymmetric(Linear(1e4), Linear(10.0)).value(np.array([-0.01, 0.01]))
    array([ -0.1, 100. ])
    """

    tension: Law
    compression: Law
    width: float = _WIDTH
    of: ClassVar[Resistance] = "tension"

    def __post_init__(self) -> None:
        object.__setattr__(self, "width", number("width", self.width, above=0))
        for name, sign in (("tension", 1), ("compression", -1)):
            law = inner_law(name, getattr(self, name))
            refuse_force_at_rest(name, law, sign * self.width)

    @property
    def domain(self) -> tuple[float, float]:
        """From the end of the law in compression to that in tension."""
        return domain_of(self.compression)[0], domain_of(self.tension)[1]

    @property
    def shown(self) -> tuple[float, float] | None:
        """What each law shows on its side, if both tell."""
        below, above = (
            getattr(law, "shown", None) for law in (self.compression, self.tension)
        )
        if below is None or above is None:
            return None
        return below[0], above[1]

    def energy(self, x: ndarray) -> ndarray:
        """The sum of both, each of its own r, less that at rest."""
        return self._energy(x) - self._energy(np.zeros(1))[0]

    def _energy(self, x: ndarray) -> ndarray:
        ramp, other = self._ramps(x)
        return self.tension.energy(ramp.strain) + self.compression.energy(-other.strain)

    def value(self, x: ndarray) -> ndarray:
        """The sum of both."""
        ramp, other = self._ramps(x)
        above = self.tension.value(ramp.strain) * ramp.slope
        return above + self.compression.value(-other.strain) * other.slope

    def tangent(self, x: ndarray) -> ndarray:
        """The sum of both."""
        ramp, other = self._ramps(x)
        above = _tangent(self.tension, ramp, 1.0)
        return above + _tangent(self.compression, other, -1.0)

    def _ramps(self, x: ndarray) -> tuple["_Ramp", "_Ramp"]:
        return _ramp(x, self.width), _ramp(-x, self.width)


class _Ramp(NamedTuple):
    """A strain that is 0 in compression, and its first two derivatives."""

    strain: ndarray
    slope: ndarray
    bend: ndarray


def _ramp(x: ndarray, width: float) -> _Ramp:
    s = np.clip((x + width) / (2 * width), 0.0, 1.0)
    curved = 2 * width * s**4 * (s * (s - 3) + 2.5)
    slope = s**3 * (s * (6 * s - 15) + 10)
    bend = 15 / width * (s * (1 - s)) ** 2
    return _Ramp(np.where(x >= width, x, curved), slope, bend)


def _tangent(law: Law, ramp: _Ramp, sign: float) -> ndarray:
    """The derivative of a law's value, switched on one side."""
    x = sign * ramp.strain
    return law.tangent(x) * ramp.slope**2 + sign * law.value(x) * ramp.bend


#: What fibres of a law do in compression.
COMPRESSION = Option(
    name="compression",
    help="what fibres do in compression: what the law says, or nothing at all",
    default="law",
    choices=("law", "none"),
)


def with_compression(law: Law, compression: str) -> Law:
    """The law as it is, or without compression, by the words of `COMPRESSION`."""
    return TensionOnly(law) if compression == "none" else law
