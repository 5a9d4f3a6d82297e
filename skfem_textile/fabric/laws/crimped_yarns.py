"""Tensions of a cell of two crimped yarns that press on each other where they cross.

The model is that of OpenRadioss's ``/MAT/LAW58`` and ``/MAT/LAW158``
(``sigeps58c.F``, ``sigeps158c.F``), without damping.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..law import BiaxialLaw, Law, ScalarLaw, inner_law, number, pair

# Newton steps end where they are this share of the heights of the crimp.
_STEP = 1e-13

# Rounding of an energy, as a share of it.
_ROUNDING = 1e-15

# Share of the heights below which a step is taken even if rounding hides that the
# energy falls.  Chosen: Newton's method converges quadratically there.
_NEAR = 1e-6

# More iterations than any state needed: the steepest table takes 30.
_MOST_ITERATIONS = 200

# Largest crimp.  It tells a crimp in percent from a ratio.
_MOST_CRIMP = 1.0

# Shortest height of a crimp over that at rest, where its spring is logarithmic.
_SHORTEST = 1e-9


@dataclass(frozen=True)
class Softening(ScalarLaw):
    """A yarn of force (K − ½ B d) d at the elongation d, constant past d = K/B.

    Parameters
    ----------
    stiffness
        K in N/mm.
    softening
        B in N/mm; without it the yarn is linear.

    Raises
    ------
    ValueError
        If K is not a positive finite number or B not one >= 0.
    """

    stiffness: float
    softening: float = 0.0

    def __post_init__(self) -> None:
        K = number("stiffness", self.stiffness, above=0)
        object.__setattr__(self, "stiffness", K)
        object.__setattr__(self, "softening", number("softening", self.softening))

    def energy(self, x: ndarray) -> ndarray:
        """The integral of the force from 0."""
        d, past = self._split(x)
        return (0.5 * self.stiffness - self.softening * d / 6) * d**2 + past * (
            self.stiffness - 0.5 * self.softening * d
        ) * d

    def value(self, x: ndarray) -> ndarray:
        """The force."""
        d, _ = self._split(x)
        return (self.stiffness - 0.5 * self.softening * d) * d

    def tangent(self, x: ndarray) -> ndarray:
        """Its slope."""
        d, _ = self._split(x)
        return self.stiffness - self.softening * d

    def _split(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """The elongation as far as the force grows, and what is past it."""
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
    """Tensions of two yarns in a cell of side 1, each the hypotenuse of its crimp.

    A yarn over the side L = exp ε has the length D = √(L² + (H + y)²), where
    H = √((1 + s)² − 1) is the height of its crimp at rest, and bears the force
    F(D − D₀).  A spring holds y back.  Without a ``coupling`` the yarns touch and
    cannot pass through each other, y₁ + y₂ >= 0.  With one, ½ C (y₁ + y₂)²/(H₁ + H₂) is
    part of the energy and springs are logarithmic.  The elongations y are those of
    least energy, and the tensions T = L ∂W/∂L.

    Parameters
    ----------
    yarns
        The laws F(d) in N/mm of warp and weft, of the elongation d of a yarn over a
        cell of side 1.
    crimp
        s, length of a yarn over that of the cell less one: a number, or a pair.
    springs
        Their stiffness in N/mm: a number, or a pair.
    coupling
        C in N/mm; None for yarns that touch.

    Raises
    ------
    ValueError
        If a stiffness or a crimp is not a positive finite number, a crimp more than 1,
        or a yarn no law.

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
        yarns = tuple(inner_law("yarn", yarn) for yarn in self.yarns)
        object.__setattr__(self, "yarns", yarns)
        object.__setattr__(self, "crimp", pair("crimp", self.crimp, above=0))
        if max(self.crimp) > _MOST_CRIMP:
            raise ValueError(
                f"crimp must be a ratio of at most {_MOST_CRIMP:g}, like 0.1 for 10 %, "
                f"got {self.crimp}"
            )
        object.__setattr__(self, "springs", pair("springs", self.springs, above=0))
        if self.coupling is not None:
            object.__setattr__(self, "coupling", number("coupling", self.coupling))

    @property
    def shown(self) -> tuple[float, float]:
        """From half of the larger crimp in compression to one and a half of it."""
        crimp = max(self.crimp)
        return -0.5 * crimp, 1.5 * crimp

    def energy(self, strain: ndarray) -> ndarray:
        """W at the elongations of least energy."""
        L = np.exp(strain)
        y, _ = self._balanced(L)
        return self._energy(L, y)

    def value(self, strain: ndarray) -> ndarray:
        """L ∂W/∂L, shape (2, ...)."""
        L = np.exp(strain)
        return L * self._cell(L, self._balanced(L)[0]).pull

    def tangent(self, strain: ndarray) -> ndarray:
        """∂T_α/∂ε_β with the elongations that follow, shape (2, 2, ...)."""
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
        """Second derivative of the coupling's energy."""
        return 0.0 if self.coupling is None else self.coupling / self._heights.sum()

    def _balanced(self, L: ndarray) -> tuple[ndarray, ndarray]:
        """Elongations of least energy, shape (2, ...), and where yarns touch."""
        L = np.asarray(L, dtype=float)
        nowhere = np.zeros(L.shape[1:], dtype=bool)
        if self.coupling is not None:
            return self._least(L, nowhere), nowhere
        apart = self._least(L, nowhere)
        touching = apart.sum(axis=0) < 0
        if not touching.any():
            return apart, touching
        return np.where(touching, self._least(L, touching), apart), touching

    def _least(self, L: ndarray, touching: ndarray) -> ndarray:
        """Elongations of least energy by Newton's method, with steps that descend.

        NaN where they are not found, which no state of a run may be.
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
            moves = far > _STEP
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
        """Inverse of ∂²W/∂y², on y₁ + y₂ = 0 where yarns touch; shape (2, 2, ...)."""
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
        yarns = sum(law.energy(own) for law, own in zip(self.yarns, d, strict=True))
        return yarns + springs.sum(axis=0) + 0.5 * self._stiff * y.sum(axis=0) ** 2

    def _cell(self, L: ndarray, y: ndarray) -> _Cell:
        H, k = _columns(self._heights, L), _columns(np.asarray(self.springs), L)
        height = H + y
        D = np.hypot(L, height)
        d = D - _columns(np.add(self.crimp, 1.0), L)
        F = np.stack([law.value(own) for law, own in zip(self.yarns, d, strict=True)])
        S = np.stack([law.tangent(own) for law, own in zip(self.yarns, d, strict=True)])
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
