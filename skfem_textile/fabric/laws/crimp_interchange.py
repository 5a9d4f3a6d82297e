"""The tensions of a weave whose families exchange crimp."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ...registration import LawRegistration, Option
from ..law import BiaxialLaw, number, pair
from .crimp_toe import INITIAL_STIFFNESS, TOE, CrimpToe
from .linear import STIFFNESS

# Newton steps are taken until they are this share of the range of the amplitude, which
# leaves an error of round-off, as they converge quadratically.
_STEP = 1e-12

# More iterations than halvings of the range to that share, each of which may cost two.
_MOST_ITERATIONS = 100


# Largest crimp: teeth of a slope of 1, beyond which the second order in slopes is no
# approximation.  It also tells a crimp in percent from a ratio.
_MOST_CRIMP = 0.5


class _Yarns(NamedTuple):
    """Yarns of warp and weft at an amplitude w, arrays of shape (2, ...).

    Attributes
    ----------
    strain, slope
        e, and its derivative r = ∂e/∂w.  Its second derivative is 1.
    tension, stiffness
        T = φ′(e) and S = φ″(e) in N/mm.
    """

    strain: ndarray
    slope: ndarray
    tension: ndarray
    stiffness: ndarray


@dataclass(frozen=True)
class CrimpInterchange(BiaxialLaw):
    """Tensions of a weave in which one family straightens by crimping the other.

    Yarns are saw-teeth that touch where they cross (Kawabata, Niwa & Kawai 1973).  The
    slope of the teeth is η = √(2c) at rest, where c is the crimp.  As the slope of the
    warp falls by w that of the weft grows by w, and the yarns are strained by

        e₁ = ε₁ − η₁ w + ½ w²,   e₂ = ε₂ + η₂ w + ½ w²,

    to second order in the slopes.  The amplitude w is that of least energy (King,
    Jearanaisilawong & Socrate 2005),

        ψ(ε₁, ε₂) = min_w [φ₁(e₁) + φ₂(e₂) + ½ K w²] + ½ k (ε₁² + ε₂²),

    with the energy φ of a `CrimpToe` without initial stiffness: yarns do not push.  The
    energy is convex, and its second derivatives are continuous.  Without crimp the law
    is that of two `CrimpToe`, of the initial stiffness k.

    Parameters
    ----------
    stiffness
        E of the yarns in N/mm: a number, or a pair (warp, weft).
    crimp
        c, length of a yarn over that of the fabric less one: a number, or a pair.  The
        spacings of warp and weft are taken as equal.
    bending
        K in N/mm, the resistance to another shape of the yarns.
    toe
        e₀ of the yarns, the strain within which they take up load.
    initial_stiffness
        k in N/mm, at rest and in compression.

    Raises
    ------
    ValueError
        If E, K or e₀ is not a positive finite number, c or k not one >= 0, or c more
        than 0.5.

    Examples
    --------
    Warp that is pulled by 1 %, with the weft held and with a weft that contracts:

    >>> law = CrimpInterchange(1e4, 0.01, bending=1.0, toe=1e-3, initial_stiffness=1.0)
    >>> law.value(np.array([[0.01, 0.01], [0.0, -0.004]])).round(1).tolist()
    [[53.4, 38.6], [35.1, 20.4]]
    """

    stiffness: float | Sequence[float]
    crimp: float | Sequence[float]
    bending: float
    toe: float
    initial_stiffness: float

    def __post_init__(self) -> None:
        for name, value in (
            ("stiffness", pair("stiffness", self.stiffness, above=0)),
            ("crimp", pair("crimp", self.crimp)),
            ("bending", number("bending", self.bending, above=0)),
            ("toe", number("toe", self.toe, above=0)),
            ("initial_stiffness", number("initial stiffness", self.initial_stiffness)),
        ):
            object.__setattr__(self, name, value)
        if max(self._crimps) > _MOST_CRIMP:
            raise ValueError(
                f"crimp must be a ratio of at most {_MOST_CRIMP}, like 0.01 for 1 %, "
                f"got {self.crimp}"
            )

    @property
    def shown(self) -> tuple[float, float]:
        """From some compression to where the yarns of a free weft are straight."""
        straight = sum(self._crimps) + 4 * self.toe
        return -0.5 * straight, 2 * straight

    def energy(self, strain: ndarray) -> ndarray:
        """The least energy of all amplitudes."""
        w = self._amplitude(strain)
        e = self._yarns(strain, w).strain
        stored = sum(law.energy(x) for law, x in zip(self._laws, e, strict=True))
        held = self.initial_stiffness * np.square(strain).sum(axis=0)
        return stored + 0.5 * self.bending * np.square(w) + 0.5 * held

    def value(self, strain: ndarray) -> ndarray:
        """The tensions of the yarns, and k ε_α."""
        yarns = self._yarns(strain, self._amplitude(strain))
        return yarns.tension + self.initial_stiffness * strain

    def tangent(self, strain: ndarray) -> ndarray:
        """∂T_α/∂ε_β while w follows.

        S₁ (R + S₂ r₂²)/H + k and −S₁ S₂ r₁ r₂/H, where R = K + T₁ + T₂, and
        H = R + S₁ r₁² + S₂ r₂² is the second derivative of the energy by w.
        """
        yarns = self._yarns(strain, self._amplitude(strain))
        S, r = yarns.stiffness, yarns.slope
        R, H = self._resistance(yarns), self._second_derivative(yarns)
        own = S * (R + (S * r**2)[::-1]) / H + self.initial_stiffness
        cross = -S[0] * S[1] * r[0] * r[1] / H
        return np.array([[own[0], cross], [cross, own[1]]])

    def _amplitude(self, strain: ndarray) -> ndarray:
        """The w of least energy: Newton's method, bisection where that is slow."""
        given = strain.reshape(2, -1)
        eta_1, eta_2 = self._slopes_at_rest
        tolerance = _STEP * (eta_1 + eta_2)
        found = np.zeros(given.shape[1])
        w, low, high = found.copy(), found - eta_2, found + eta_1
        last, left = np.full_like(w, np.inf), np.arange(w.size)
        with np.errstate(all="ignore"):  # of strains that are not finite
            for _ in range(_MOST_ITERATIONS):
                yarns = self._yarns(given[:, left], w)
                force = (yarns.tension * yarns.slope).sum(axis=0) + self.bending * w
                low, high = np.where(force < 0, w, low), np.where(force > 0, w, high)
                newton = np.clip(w - force / self._second_derivative(yarns), low, high)
                step = np.abs(newton - w)
                quick = (step <= 0.5 * last) | (step <= tolerance)
                new = np.where(quick, newton, 0.5 * (low + high))
                last, w = np.abs(new - w), new
                found[left] = w
                going = last > tolerance
                if not going.any():
                    break
                left, last, w = left[going], last[going], w[going]
                low, high = low[going], high[going]
        return found.reshape(strain.shape[1:])

    def _yarns(self, strain: ndarray, w: ndarray) -> _Yarns:
        eta_1, eta_2 = self._slopes_at_rest
        e = strain + np.array([w * (0.5 * w - eta_1), w * (0.5 * w + eta_2)])
        slope = np.array([w - eta_1, w + eta_2])
        T = np.array([law.value(x) for law, x in zip(self._laws, e, strict=True)])
        S = np.array([law.tangent(x) for law, x in zip(self._laws, e, strict=True)])
        return _Yarns(e, slope, T, S)

    def _resistance(self, yarns: _Yarns) -> ndarray:
        """R = K + T₁ + T₂."""
        return self.bending + yarns.tension.sum(axis=0)

    def _second_derivative(self, yarns: _Yarns) -> ndarray:
        """H."""
        stretch = yarns.stiffness * yarns.slope**2
        return self._resistance(yarns) + stretch.sum(axis=0)

    @cached_property
    def _laws(self) -> tuple[CrimpToe, CrimpToe]:
        """Those of the yarns."""
        E: Any = self.stiffness
        return CrimpToe(E[0], self.toe, 0.0), CrimpToe(E[1], self.toe, 0.0)

    @property
    def _crimps(self) -> tuple[float, float]:
        both: Any = self.crimp
        return both

    @cached_property
    def _slopes_at_rest(self) -> ndarray:
        """η = √(2c) of warp and weft."""
        return np.sqrt(2 * np.array(self._crimps))


def _build(
    warp_crimp: float, weft_crimp: float, stiffness: float, **others: float
) -> CrimpInterchange:
    return CrimpInterchange(stiffness, (warp_crimp, weft_crimp), **others)


REGISTRATION = LawRegistration(
    name="crimp-interchange",
    description="warp and weft that exchange crimp, a saw-tooth of yarns of crimp-toe",
    build=_build,
    options=(
        STIFFNESS,
        Option(
            name="warp-crimp", help="c of the warp, a ratio", read=float, metavar="C1"
        ),
        Option(
            name="weft-crimp", help="c of the weft, a ratio", read=float, metavar="C2"
        ),
        Option(
            name="bending",
            help="K in N/mm, resistance to an exchange of crimp",
            read=float,
            metavar="K",
            unit="N_per_mm",
        ),
        TOE,
        INITIAL_STIFFNESS,
    ),
    resists=("tension",),
    rank=1,
)
