"""Laws with parameters that are to be found from tests."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric import CrimpInterchange, CrimpToe, Linear, Locking, Polynomial, Sin2
from ..fabric.law import RIGHT_ANGLE
from ..fabric.laws.tabulated import Tabulated


@dataclass(frozen=True)
class Model:
    """A law with parameters to be found.

    Attributes
    ----------
    name
        What it is called.
    parameters, units
        Names and units of the parameters, p of them.
    build
        Makes the law of p numbers.
    low, high
        Bounds of the parameters, shape (p,).
    start
        Parameters to begin with, of the stiffness of the linear law that is nearest to
        the data.  None where forces are linear in the parameters.
    """

    name: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    build: Callable[[ndarray], Any]
    low: ndarray
    high: ndarray
    start: Callable[[float], ndarray] | None = None

    def bounded(self, bounds: Mapping[str, tuple[float, float]]) -> "Model":
        """The model with further bounds of parameters, by their names.

        Raises
        ------
        ValueError
            If no parameter has a name, or no number is within its bounds.
        """
        low, high = self.low.copy(), self.high.copy()
        for name, (least, most) in bounds.items():
            if name not in self.parameters:
                raise ValueError(
                    f"the law {self.name} has no parameter {name!r}: there are "
                    f"{', '.join(self.parameters)}"
                )
            i = self.parameters.index(name)
            low[i], high[i] = max(low[i], least), min(high[i], most)
            if not low[i] < high[i]:
                raise ValueError(
                    f"no number is within the bounds of {name}: {low[i]:g} to "
                    f"{high[i]:g}"
                )
        return replace(self, low=low, high=high)

    def extrapolated(self, extrapolation: str | None) -> "Model":
        """The model whose law does that beyond the data, as of `Tabulated`.

        Without a word it is the model as it is.

        Raises
        ------
        ValueError
            If the law is no table, so that it does not end with the data.
        """
        if extrapolation is None:
            return self
        if self.name != "tabulated":
            raise ValueError(
                f"the law {self.name} goes on beyond the data as its formula does: "
                "only a tabulated law has an extrapolation"
            )

        def build(values: ndarray) -> Any:
            return replace(self.build(values), extrapolation=extrapolation)

        return replace(self, build=build)


def linear() -> Model:
    """`Linear`: C = G γ, or T = E ε."""
    return _one("linear", Linear)


def sin2() -> Model:
    """`Sin2`: C = ½ G sin 2γ."""
    return _one("sin2", Sin2)


def polynomial(degree: int = 5) -> Model:
    """`Polynomial` of the odd powers of γ up to a degree: C = c₁ γ + c₃ γ³ + ...

    Raises
    ------
    ValueError
        If the degree is not odd or not between 1 and 15.
    """
    if degree not in range(1, 16, 2):
        raise ValueError(f"the degree must be an odd number up to 15, got {degree}")
    powers = range(1, degree + 1, 2)

    def build(c: ndarray) -> Polynomial:
        every = np.zeros(degree)
        every[::2] = c
        return Polynomial(tuple(every))

    names = tuple(f"c{power}" for power in powers)
    return Model("polynomial", names, ("N/mm",) * len(names), build, *_free(len(names)))


def locking(largest: float) -> Model:
    """`Locking`, with a pole beyond the largest shear angle in radians."""
    low = np.array([1e-12, 1.001 * largest])

    def start(stiffness: float) -> ndarray:
        angle = min(1.3 * largest, 0.5 * (largest + RIGHT_ANGLE))
        return np.array([0.5 * stiffness, angle])

    high = np.array([np.inf, RIGHT_ANGLE])
    names = "stiffness", "angle"
    return Model("locking", names, ("N/mm", "rad"), _locking, low, high, start)


def _locking(values: ndarray) -> Locking:
    return Locking(*map(float, values))


def tabulated(arguments: ndarray) -> Model:
    """`Tabulated` through 0 and values at arguments in rising order, above 0."""
    x = np.asarray(arguments, dtype=float) * (1 + _ROUNDING)
    every = np.concatenate([[0.0], x])

    def build(values: ndarray) -> Tabulated:
        return Tabulated(every, np.concatenate([[0.0], values]), odd=True)

    names = tuple(f"v{i}" for i in range(1, x.size + 1))
    units = ("N/mm",) * x.size
    free = _free(x.size)

    def start(stiffness: float) -> ndarray:
        return stiffness * x

    return Model("tabulated", names, units, build, *free, start)


def crimp_toe(largest: float) -> Model:
    """`CrimpToe`, whose toe is no wider than the largest strain."""
    low = np.array([1e-9, 1e-3 * largest, 0.0])
    high = np.array([np.inf, largest, np.inf])

    def start(stiffness: float) -> ndarray:
        return np.array([1.5 * stiffness, 0.2 * largest, 1e-3 * stiffness])

    names = "stiffness", "toe", "initial_stiffness"

    def build(values: ndarray) -> CrimpToe:
        return CrimpToe(*map(float, values))

    return Model("crimp-toe", names, ("N/mm", "-", "N/mm"), build, low, high, start)


def crimp_interchange(largest: float) -> Model:
    """`CrimpInterchange`: both tensions take both strains.

    Of the initial stiffness, which holds the fabric in compression and which no pull
    tells, a small share of the stiffness is taken.
    """
    names = (
        *("warp_stiffness", "weft_stiffness", "warp_crimp", "weft_crimp"),
        *("bending", "toe"),
    )
    low = np.array([1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-2 * largest])
    high = np.array([np.inf, np.inf, 0.2, 0.2, np.inf, largest])

    def build(values: ndarray) -> CrimpInterchange:
        E1, E2, c1, c2, K, e_0 = map(float, values)
        return CrimpInterchange((E1, E2), (c1, c2), K, e_0, _AT_REST * min(E1, E2))

    def start(stiffness: float) -> ndarray:
        E, c = 3 * stiffness, 0.5 * largest
        return np.array([E, E, c, c, 0.01 * stiffness, 0.1 * largest])

    units = ("N/mm", "N/mm", "-", "-", "N/mm", "-")
    return Model("crimp-interchange", names, units, build, low, high, start)


# Share by which tables are longer, so that no point is beyond by an error of rounding.
_ROUNDING = 1e-12

# Initial stiffness of crimped fabrics over the stiffness of their yarns.  Chosen: too
# small to be seen in a pull, large enough for a tangent that is positive definite.
_AT_REST = 1e-4


def _one(name: str, law: Callable[[float], Any]) -> Model:
    def build(values: ndarray) -> Any:
        return law(float(values[0]))

    zero, none = np.zeros(1), np.full(1, np.inf)
    return Model(name, ("stiffness",), ("N/mm",), build, zero, none)


def _free(n: int) -> tuple[ndarray, ndarray]:
    return np.full(n, -np.inf), np.full(n, np.inf)
