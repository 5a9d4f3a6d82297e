"""Parametric laws, whose parameters are identified from tests."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric import (
    Bilinear,
    CrimpInterchange,
    CrimpToe,
    Linear,
    Locking,
    Polynomial,
    Sin2,
    Tabulated,
)
from ..fabric.law import RIGHT_ANGLE

# Relative extension of tables, so that rounding puts no point beyond the end.
_ROUNDING = 1e-12

# Ratio of the initial stiffness of crimped fabrics to the yarn stiffness.  Chosen:
# negligible in tension, and large enough for a positive definite tangent.
_AT_REST = 1e-4


@dataclass(frozen=True)
class Model:
    """Law with unknown parameters.

    Attributes
    ----------
    name
        Name of the law.
    parameters, units
        Names and units of the parameters, p of them.
    build
        Builds the law from p numbers.
    low, high
        Bounds of the parameters, shape (p,).
    start
        Initial parameters, as a function of the stiffness of the best linear law; None
        if they are not needed.
    is_linear
        True if forces are linear in the parameters.
    """

    name: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    build: Callable[[ndarray], Any]
    low: ndarray
    high: ndarray
    start: Callable[[float], ndarray] | None = None
    is_linear: bool = True

    def bounded(self, bounds: Mapping[str, tuple[float, float]]) -> "Model":
        """Model with additional bounds of parameters, by name.

        Raises
        ------
        ValueError
            If the bounds of a parameter contain no number.
        """
        low, high = self.low.copy(), self.high.copy()
        for name, (least, most) in bounds.items():
            i = self.parameters.index(name)
            low[i], high[i] = max(low[i], least), min(high[i], most)
            if not low[i] < high[i]:
                raise ValueError(
                    f"the bounds of {name} and the limits of the law leave no number "
                    f"between {low[i]:g} and {high[i]:g}: change the bounds"
                )
        return replace(self, low=low, high=high)

    def extrapolated(self, extrapolation: str) -> "Model":
        """Model whose table is extrapolated beyond the data, see `Tabulated`."""
        return replace(
            self, build=lambda x: replace(self.build(x), extrapolation=extrapolation)
        )


def _of_numbers(law: Callable[..., Any]) -> Callable[[ndarray], Any]:
    """Function that builds a law whose arguments are its parameters."""
    return lambda values: law(*values.tolist())


def linear() -> Model:
    """`Linear`: C = G γ, or T = E ε."""
    build, ends = _of_numbers(Linear), np.array([[0.0], [np.inf]])
    return Model("linear", ("stiffness",), ("N/mm",), build, *ends)


def sin2() -> Model:
    """`Sin2`: C = ½ G sin 2γ."""
    return replace(linear(), name="sin2", build=_of_numbers(Sin2))


def polynomial(degree: int = 5) -> Model:
    """`Polynomial` of the odd powers of γ up to a degree: C = c₁ γ + c₃ γ³ + ...

    Raises
    ------
    ValueError
        If the degree is not odd or not between 1 and 15.
    """
    if degree not in range(1, 16, 2):
        raise ValueError(f"the degree must be an odd number up to 15, got {degree}")
    names = tuple(f"c{power}" for power in range(1, degree + 1, 2))

    def build(c: ndarray) -> Polynomial:
        every = np.zeros(degree)
        every[::2] = c
        return Polynomial(tuple(every))

    free = np.full(len(names), np.inf)
    return Model("polynomial", names, ("N/mm",) * free.size, build, -free, free)


def locking(largest: float) -> Model:
    """`Locking`, with the pole beyond the largest shear angle in radians."""

    def start(stiffness: float) -> ndarray:
        angle = min(1.3 * largest, 0.5 * (largest + RIGHT_ANGLE))
        return np.array([0.5 * stiffness, angle])

    low, high = np.array([[1e-12, 1.001 * largest], [np.inf, RIGHT_ANGLE]])
    names, units, build = ("stiffness", "angle"), ("N/mm", "rad"), _of_numbers(Locking)
    return Model("locking", names, units, build, low, high, start, is_linear=False)


def tabulated(largest: float, points: int) -> Model:
    """`Tabulated` at 0 and at equidistant points up to the largest argument."""
    x = np.linspace(0.0, largest, points + 1) * (1 + _ROUNDING)

    def build(values: ndarray) -> Tabulated:
        return Tabulated(x, np.concatenate([[0.0], values]), odd=True)

    def start(stiffness: float) -> ndarray:
        return stiffness * x[1:]

    names = tuple(f"v{i}" for i in range(1, x.size))
    units, free = ("N/mm",) * points, np.full(points, np.inf)
    return Model("tabulated", names, units, build, -free, free, start, is_linear=False)


def crimp_toe(largest: float, slack_is_unknown: bool = False) -> Model:
    """`CrimpToe`, with a toe of at most the largest strain.

    Beside an unknown slack s, the initial stiffness k cannot be identified, and is a
    small share of the stiffness E.  For a shift of the strain, ∂T/∂s = −(E/e₀)(∂T/∂k −
    ∂T/∂E) − k: without k, the derivatives are linearly dependent.
    """
    n = 2 if slack_is_unknown else 3

    def start(stiffness: float) -> ndarray:
        return np.array([1.5 * stiffness, 0.2 * largest, 1e-3 * stiffness])[:n]

    def build(values: ndarray) -> CrimpToe:
        E, e_0, *k = map(float, values)
        return CrimpToe(E, e_0, *(k or (_AT_REST * E,)))

    low, high = np.array([[1e-9, 1e-3 * largest, 0.0], [np.inf, largest, np.inf]])
    names, units = ("stiffness", "toe", "initial_stiffness"), ("N/mm", "-", "N/mm")
    return Model(
        *("crimp-toe", names[:n], units[:n], build, low[:n], high[:n], start),
        is_linear=False,
    )


def crimp_interchange(largest: float) -> Model:
    """`CrimpInterchange`: both tensions depend on both strains.

    The initial stiffness acts in compression and cannot be identified in tension; it is
    a small share of the stiffness.
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
    return Model(
        *("crimp-interchange", names, units, build, low, high, start),
        is_linear=False,
    )


def bending() -> Model:
    """Moment per curvature and width of one family: M = D κ."""
    return replace(linear(), name="bending", units=("N·mm",))


def bending_bilinear(largest: float) -> Model:
    """`Bilinear`, with the knee below the largest curvature in 1/mm."""

    def start(stiffness: float) -> ndarray:
        return np.array([1.2 * stiffness, 0.4 * largest, 0.5 * stiffness])

    low, high = np.array([[1e-9, 0.02 * largest, 0.0], [np.inf, largest, np.inf]])
    names, units = ("stiffness", "knee", "further_stiffness"), ("N·mm", "1/mm", "N·mm")
    build = _of_numbers(Bilinear)
    return Model("bilinear", names, units, build, low, high, start, is_linear=False)


def bending_polynomial(largest: float, degree: int) -> Model:
    """`polynomial` of the curvature up to the largest one in 1/mm."""
    model = polynomial(degree)
    powers = np.arange(0, degree, 2)

    def start(stiffness: float) -> ndarray:
        share = np.where(powers, 0.1, 1.0)
        return share * stiffness / largest**powers

    units = tuple(f"N·mm{_exponent(n)}" for n in range(1, degree + 1, 2))
    return replace(model, units=units, start=start, is_linear=False)


def bending_tabulated(largest: float, points: int) -> Model:
    """`tabulated` up to the largest curvature in 1/mm."""
    return replace(tabulated(largest, points), units=("N·mm/mm",) * points)


def _exponent(n: int) -> str:
    return "" if n == 1 else str(n).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


def joint(models: Mapping[str, Model]) -> Model:
    """Laws of several parts; it builds a dictionary.

    Names of parameters begin with the part.
    """
    sizes = [len(model.parameters) for model in models.values()]
    ends = np.cumsum(sizes)[:-1]

    def build(values: ndarray) -> dict[str, Any]:
        blocks = np.split(values, ends)
        pairs = zip(models.items(), blocks, strict=True)
        return {name: model.build(block) for (name, model), block in pairs}

    return Model(
        "joint",
        tuple(f"{name} {p}" for name, m in models.items() for p in m.parameters),
        tuple(unit for model in models.values() for unit in model.units),
        build,
        np.concatenate([model.low for model in models.values()]),
        np.concatenate([model.high for model in models.values()]),
        is_linear=all(model.is_linear for model in models.values()),
    )
