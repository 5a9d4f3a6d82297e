"""Biaxial laws with crimp interchange.

`CrimpInterchange` has the energy of a saw-tooth geometry.  `CrimpedYarns` is a cell of
two yarns in contact at their crossing, the model of OpenRadioss's ``/MAT/LAW58`` and
``/MAT/LAW158`` (``sigeps58c.F``, ``sigeps158c.F``), without damping.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..law import (
    BiaxialLaw,
    Law,
    ScalarLaw,
    TwoLaws,
    inner_law,
    keep,
    number,
    pair,
)
from .tension import CrimpToe

# Newton step, relative to the range of the amplitude, below which the iteration ends;
# as it converges quadratically, the remaining error is round-off.
_STEP = 1e-12

# Maximum number of iterations: more than two for each bisection needed for this step.
# Of a cell, the steepest table takes 30.
_MOST_ITERATIONS = 100


# Largest crimp: a slope of 1, beyond which the second-order approximation in the slopes
# is invalid.  It also detects a crimp in percent.
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

    The yarns form saw-teeth in contact at their crossings (Kawabata, Niwa & Kawai
    1973).  The slope of the teeth is η = √(2c) at rest, where c is the crimp.  If the
    slope of the warp decreases by w, the slope of the weft increases by w, and the yarn
    strains are

        e₁ = ε₁ − η₁ w + ½ w²,   e₂ = ε₂ + η₂ w + ½ w²,

    to second order in the slopes.  The amplitude w minimises the energy (King,
    Jearanaisilawong & Socrate 2005),

        ψ(ε₁, ε₂) = min_w [φ₁(e₁) + φ₂(e₂) + ½ K w²] + ½ k (ε₁² + ε₂²),

    with the energy φ of a `CrimpToe` without initial stiffness: yarns do not carry
    compression.  The energy is convex, and its second derivatives are continuous.
    Without crimp the law reduces to two `CrimpToe` with the initial stiffness k.

    Parameters
    ----------
    stiffness
        E of the yarns in N/mm: a number, or a pair (warp, weft).
    crimp
        c, length of a yarn relative to the fabric, less one: a number, or a pair.  The
        spacings of warp and weft are assumed equal.
    bending
        K in N/mm, the resistance to a change of the yarn shape.
    toe
        e₀ of the yarns, the strain over which their stiffness develops.
    initial_stiffness
        k in N/mm, at rest and in compression.

    Raises
    ------
    ValueError
        If E, K or e₀ is not a positive finite number, c or k is not a finite number >=
        0, or c exceeds 0.5.

    Examples
    --------
    Warp stretched by 1 %, with a fixed weft and with a contracting weft:

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
        keep(
            self,
            stiffness=pair("stiffness", self.stiffness, above=0),
            crimp=pair("crimp", self.crimp),
            bending=number("bending", self.bending, above=0),
            toe=number("toe", self.toe, above=0),
            initial_stiffness=number("initial stiffness", self.initial_stiffness),
        )
        _refuse_percent(self._crimps, _MOST_CRIMP)

    @property
    def shown(self) -> tuple[float, float]:
        """From moderate compression to straight yarns with a free weft."""
        straight = sum(self._crimps) + 4 * self.toe
        return -0.5 * straight, 2 * straight

    def energy(self, strain: ndarray) -> ndarray:
        """Minimum of the energy over the amplitude."""
        w = self._amplitude(strain)
        stored = self._laws.energy(self._yarns(strain, w).strain)
        linear = self.initial_stiffness * np.square(strain).sum(axis=0)
        return stored + 0.5 * self.bending * np.square(w) + 0.5 * linear

    def value(self, strain: ndarray) -> ndarray:
        """Tensions of the yarns, plus k ε_α."""
        yarns = self._yarns(strain, self._amplitude(strain))
        return yarns.tension + self.initial_stiffness * strain

    def tangent(self, strain: ndarray) -> ndarray:
        """∂T_α/∂ε_β with the dependence of w.

        S₁ (R + S₂ r₂²)/H + k and −S₁ S₂ r₁ r₂/H, where R = K + T₁ + T₂, and H = R + S₁
        r₁² + S₂ r₂² is the second derivative of the energy with respect to w.
        """
        yarns = self._yarns(strain, self._amplitude(strain))
        S, r = yarns.stiffness, yarns.slope
        R, H = self._resistance(yarns), self._second_derivative(yarns)
        diagonal = S * (R + (S * r**2)[::-1]) / H + self.initial_stiffness
        cross = -S[0] * S[1] * r[0] * r[1] / H
        return np.array([[diagonal[0], cross], [cross, diagonal[1]]])

    def _amplitude(self, strain: ndarray) -> ndarray:
        """Amplitude w of minimum energy: Newton's method with bisection."""
        strains = strain.reshape(2, -1)
        eta_1, eta_2 = self._slopes_at_rest
        tolerance = _STEP * (eta_1 + eta_2)
        amplitude = np.zeros(strains.shape[1])
        w, low, high = amplitude.copy(), amplitude - eta_2, amplitude + eta_1
        last, left = np.full_like(w, np.inf), np.arange(w.size)
        with np.errstate(all="ignore"):  # for strains that are not finite
            for _ in range(_MOST_ITERATIONS):
                yarns = self._yarns(strains[:, left], w)
                force = (yarns.tension * yarns.slope).sum(axis=0) + self.bending * w
                low, high = np.where(force < 0, w, low), np.where(force > 0, w, high)
                newton = np.clip(w - force / self._second_derivative(yarns), low, high)
                step = np.abs(newton - w)
                quick = (step <= 0.5 * last) | (step <= tolerance)
                new = np.where(quick, newton, 0.5 * (low + high))
                last, w = np.abs(new - w), new
                amplitude[left] = w
                going = last > tolerance
                if not going.any():
                    break
                left, last, w = left[going], last[going], w[going]
                low, high = low[going], high[going]
        return amplitude.reshape(strain.shape[1:])

    def _yarns(self, strain: ndarray, w: ndarray) -> _Yarns:
        eta_1, eta_2 = self._slopes_at_rest
        e = strain + np.array([w * (0.5 * w - eta_1), w * (0.5 * w + eta_2)])
        slope = np.array([w - eta_1, w + eta_2])
        T, S = self._laws.value(e), self._laws.slopes(e).own
        return _Yarns(e, slope, np.array(T), np.array(S))

    def _resistance(self, yarns: _Yarns) -> ndarray:
        """R = K + T₁ + T₂."""
        return self.bending + yarns.tension.sum(axis=0)

    def _second_derivative(self, yarns: _Yarns) -> ndarray:
        """H."""
        stretch = yarns.stiffness * yarns.slope**2
        return self._resistance(yarns) + stretch.sum(axis=0)

    @cached_property
    def _laws(self) -> TwoLaws:
        """Laws of the yarns."""
        both: Any = self.stiffness
        return TwoLaws(*(CrimpToe(E, self.toe, 0.0) for E in both))

    @property
    def _crimps(self) -> tuple[float, float]:
        both: Any = self.crimp
        return both

    @cached_property
    def _slopes_at_rest(self) -> ndarray:
        """η = √(2c) of warp and weft."""
        return np.sqrt(2 * np.array(self._crimps))


def _refuse_percent(crimps: Sequence[float], most: float) -> None:
    """Refuse crimps of warp and weft beyond the largest ratio."""
    if max(crimps) > most:
        raise ValueError(
            f"crimp must be a ratio of at most {most:g}, such as 0.01 for 1 %, got "
            f"{crimps}"
        )


# Newton step, relative to the heights of the crimp, below which the iteration ends.
_CELL_STEP = 1e-13

# Relative rounding of an energy.
_ROUNDING = 1e-15

# Step length, relative to the heights, below which a step is accepted although rounding
# hides the decrease of the energy.  Chosen: Newton's method converges quadratically
# there.
_NEAR = 1e-6

# Largest crimp.  It detects a crimp in percent.
_CELL_CRIMP = 1.0

# Smallest height of a crimp, relative to that at rest, with a logarithmic spring.
_SHORTEST = 1e-9


@dataclass(frozen=True)
class Softening(ScalarLaw):
    """Yarn with the force (K − ½ B d) d at the elongation d, constant beyond d = K/B.

    Parameters
    ----------
    stiffness
        K in N/mm.
    softening
        B in N/mm; by default the yarn is linear.

    Raises
    ------
    ValueError
        If K is not a positive finite number, or B is not a finite number >= 0.
    """

    stiffness: float
    softening: float = 0.0

    def __post_init__(self) -> None:
        K = number("stiffness", self.stiffness, above=0)
        keep(self, stiffness=K, softening=number("softening", self.softening))

    def energy(self, x: ndarray) -> ndarray:
        """Integral of the force from 0."""
        d, past = self._split(x)
        return (0.5 * self.stiffness - self.softening * d / 6) * d**2 + past * (
            self.stiffness - 0.5 * self.softening * d
        ) * d

    def value(self, x: ndarray) -> ndarray:
        """Force."""
        d, _ = self._split(x)
        return (self.stiffness - 0.5 * self.softening * d) * d

    def tangent(self, x: ndarray) -> ndarray:
        """Slope of the force."""
        d, _ = self._split(x)
        return self.stiffness - self.softening * d

    def _split(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Elongation in the range of increasing force, and the excess."""
        x = np.asarray(x, dtype=float)
        end = self.stiffness / self.softening if self.softening else np.inf
        d = np.minimum(x, end)
        return d, x - d


class _Cell(NamedTuple):
    """The yarns at elongations y of the springs, arrays of shape (2, ...).

    Attributes
    ----------
    pull, slope
        ∂W/∂L and ∂²W/∂L² at constant y.
    push, stiffness
        ∂W/∂y and ∂²W/∂y² of yarn and spring.
    cross
        ∂²W/∂L∂y.
    """

    pull: ndarray
    slope: ndarray
    push: ndarray
    stiffness: ndarray
    cross: ndarray


@dataclass(frozen=True)
class CrimpedYarns(BiaxialLaw):
    """Tensions of two yarns in a unit cell, each the hypotenuse of its crimp triangle.

    A yarn that spans a side L = exp ε of the cell has the length D = √(L² + (H + y)²),
    where H = √((1 + s)² − 1) is the height of its crimp at rest, and carries the force
    F(D − D₀).  A spring resists y.  Without a ``coupling`` the yarns are in contact, y₁
    + y₂ >= 0. With one, ½ C (y₁ + y₂)²/(H₁ + H₂) is added to the energy and springs are
    logarithmic.  The elongations y minimise the energy, and the tensions are T = L
    ∂W/∂L.

    Parameters
    ----------
    yarns
        Laws F(d) in N/mm of warp and weft, by the elongation d of a yarn in a unit
        cell.
    crimp
        s, length of a yarn relative to the cell, less one: a number, or a pair.
    springs
        Spring stiffness in N/mm: a number, or a pair.
    coupling
        C in N/mm; None for yarns in contact.

    Raises
    ------
    ValueError
        If a stiffness or a crimp is not a positive finite number, a crimp exceeds 1, or
        a yarn is not a law.

    Examples
    --------
    >>> law = CrimpedYarns((Softening(100.0), Softening(100.0)), 0.05, 0.1)
    >>> law.value(np.array([[0.03, 0.03], [0.0, -0.03]])).round(2).tolist()
    [[1.75, 0.62], [1.25, 0.27]]
    """

    yarns: tuple[Law, Law]
    crimp: Any
    springs: Any
    coupling: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.yarns, tuple | list) or len(self.yarns) != 2:
            raise ValueError("yarns must be a pair of laws (warp, weft)")
        keep(
            self,
            yarns=tuple(inner_law("yarn", yarn) for yarn in self.yarns),
            crimp=pair("crimp", self.crimp, above=0),
        )
        _refuse_percent(self.crimp, _CELL_CRIMP)
        keep(self, springs=pair("springs", self.springs, above=0))
        if self.coupling is not None:
            keep(self, coupling=number("coupling", self.coupling))

    @property
    def shown(self) -> tuple[float, float]:
        """From half of the larger crimp in compression to 1.5 times it in tension."""
        crimp = max(self.crimp)
        return -0.5 * crimp, 1.5 * crimp

    def energy(self, strain: ndarray) -> ndarray:
        """W at the elongations of minimum energy."""
        L = np.exp(strain)
        y, _ = self._balanced(L)
        return self._energy(L, y)

    def value(self, strain: ndarray) -> ndarray:
        """L ∂W/∂L, shape (2, ...)."""
        L = np.exp(strain)
        return L * self._cell(L, self._balanced(L)[0]).pull

    def tangent(self, strain: ndarray) -> ndarray:
        """∂T_α/∂ε_β with the dependence of the elongations, shape (2, 2, ...)."""
        L = np.exp(strain)
        y, touching = self._balanced(L)
        cell = self._cell(L, y)
        inverse = self._inverse(cell.stiffness, touching)
        D = -cell.cross[:, None] * inverse * cell.cross
        D[0, 0] += cell.slope[0]
        D[1, 1] += cell.slope[1]
        D = L[:, None] * D * L
        D[0, 0] += L[0] * cell.pull[0]
        D[1, 1] += L[1] * cell.pull[1]
        return D

    @property
    def _heights(self) -> ndarray:
        """H of both crimps at rest."""
        return np.sqrt(np.square(np.add(self.crimp, 1.0)) - 1.0)

    @property
    def _stiff(self) -> float:
        """Second derivative of the coupling energy."""
        return 0.0 if self.coupling is None else self.coupling / self._heights.sum()

    def _balanced(self, L: ndarray) -> tuple[ndarray, ndarray]:
        """Elongations of minimum energy, shape (2, ...), and mask of contact."""
        L = np.asarray(L, dtype=float)
        nowhere = np.zeros(L.shape[1:], dtype=bool)
        if self.coupling is not None:
            return self._least(L, nowhere), nowhere
        separate = self._least(L, nowhere)
        touching = separate.sum(axis=0) < 0
        if not touching.any():
            return separate, touching
        return np.where(touching, self._least(L, touching), separate), touching

    def _least(self, L: ndarray, touching: ndarray) -> ndarray:
        """Elongations of minimum energy by Newton's method with descending steps.

        NaN where the iteration does not converge; states with NaN are refused.
        """
        H = _columns(self._heights, L)
        lowest = -(1 - _SHORTEST) * H
        y, W = np.zeros(L.shape), self._energy(L, np.zeros(L.shape))
        share, moves = np.ones(L.shape[1:]), np.ones(L.shape[1:], dtype=bool)
        for _ in range(_MOST_ITERATIONS):
            cell = self._cell(L, y)
            push = cell.push + self._stiff * y.sum(axis=0)
            inverse = self._inverse(np.abs(cell.stiffness), touching)
            step = -(inverse * push).sum(axis=1)
            far = share * (np.abs(step) / H).max(axis=0)
            moves = far > _CELL_STEP
            if not moves.any():
                break
            new = np.maximum(y + share * step, lowest)
            new[1] = np.where(touching, -new[0], new[1])
            W_new = self._energy(L, new)
            better = (W_new <= W + _ROUNDING * np.abs(W)) | (far < _NEAR)
            share = np.where(better, np.minimum(1.0, 2 * share), 0.5 * share)
            y, W = np.where(better, new, y), np.where(better, W_new, W)
        return np.where(moves, np.nan, y)

    def _inverse(self, stiffness: ndarray, touching: ndarray) -> ndarray:
        """Inverse of ∂²W/∂y², with y₁ + y₂ = 0 in contact, (2, 2, ...)."""
        h_1, h_2 = stiffness + self._stiff
        C = self._stiff
        tied = 1 / (stiffness[0] + stiffness[1])
        free = np.array([[h_2, 0 * h_1 - C], [0 * h_1 - C, h_1]]) / (h_1 * h_2 - C**2)
        both = np.array([[tied, -tied], [-tied, tied]])
        return np.where(touching, both, free)

    def _energy(self, L: ndarray, y: ndarray) -> ndarray:
        """W per reference area."""
        H = _columns(self._heights, L)
        d = np.hypot(L, H + y) - _columns(np.add(self.crimp, 1.0), L)
        k = _columns(np.asarray(self.springs), L)
        if self.coupling is None:
            springs = 0.5 * k * y**2
        else:
            e = y / H
            springs = k * H * ((1 + e) * np.log1p(e) - e)
        yarns = TwoLaws(*self.yarns).energy(d)
        return yarns + springs.sum(axis=0) + 0.5 * self._stiff * y.sum(axis=0) ** 2

    def _cell(self, L: ndarray, y: ndarray) -> _Cell:
        H, k = _columns(self._heights, L), _columns(np.asarray(self.springs), L)
        height = H + y
        D = np.hypot(L, height)
        d = D - _columns(np.add(self.crimp, 1.0), L)
        yarns = TwoLaws(*self.yarns)
        F, S = np.stack(yarns.value(d)), np.stack(yarns.slopes(d).own)
        c, s = L / D, height / D
        if self.coupling is None:
            spring, stiffness = k * y, k + 0 * y
        else:
            spring, stiffness = k * np.log1p(y / H), k / height
        return _Cell(
            pull=F * c,
            slope=S * c**2 + F * s**2 / D,
            push=F * s + spring,
            stiffness=S * s**2 + F * c**2 / D + stiffness,
            cross=(S - F / D) * c * s,
        )


def _columns(pair_of_numbers: ndarray, like: ndarray) -> ndarray:
    """Two numbers as an array that broadcasts with one of shape (2, ...)."""
    return np.reshape(pair_of_numbers, (2,) + (1,) * (like.ndim - 1))
