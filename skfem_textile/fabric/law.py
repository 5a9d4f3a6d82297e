"""Interfaces of constitutive laws of one strain or shear angle, and of both strains.

Also the linear law, which a plain number can represent.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import (
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    Protocol,
    Self,
    TypeAlias,
    TypeVar,
)

import numpy as np
from numpy import ndarray

from ..mesh.user_input import keep_copies, shortened

#: Quantities of a law.
Resistance: TypeAlias = Literal["tension", "shear", "bending"]

#: Largest shear angle in radians: at a right angle both families are parallel.
RIGHT_ANGLE = 0.5 * np.pi

#: Largest strain of a fibre, far beyond the strain of any fibre or crimp.
LARGEST_STRAIN = 1.0

#: Largest curvature of a fibre in 1/mm: a radius of 1 mm, about the thickness of a ply.
LARGEST_CURVATURE = 1.0

# Relative rounding tolerance of a right angle.
_ROUNDING = 1e-9

# Strain to either side over which the stiffness of fibres is averaged: about the strain
# at which a crimped fabric straightens.
_WITHIN = 0.01


class Law(Protocol):
    """Scalar elastic law: energy, its derivative and its second derivative.

    For fibres ``x`` is the fibre strain ε and ``value`` the tension T in N/mm; for
    shear ``x`` is the shear angle Γ in radians and ``value`` the shear moment M_s in
    N/mm; for bending ``x`` is the curvature κ in 1/mm and ``value`` the moment M in
    N·mm per mm of width.  All three methods accept and return arrays.

    A law with friction elements, whose slip changes once a step, has ``n_slips``,
    ``with_slip``, ``slip_after`` and ``loss``, see `WithFriction`.

    A law that varies by element has a method ``at``: for element numbers of shape (n,
    n_points) or (n, 1), or None for all elements, it returns the law at these points,
    with parameters that broadcast with x.

    A law may have a ``domain``, the smallest and the largest x for which it is valid;
    a `Ply` and its load stepper refuse states beyond it, bare forms do not.  Without a
    domain the law ends where its energy is not finite, such as beyond a pole; the
    domain ``(-inf, inf)`` avoids this check.

    A law may have the attributes ``of`` and ``shown``, see `ScalarLaw`.
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


class ScalarLaw:
    """Base class of the laws of one argument in this package.

    Attributes
    ----------
    of
        Quantity of the law, ``tension``, ``shear`` or ``bending``; None for any.
    """

    of: ClassVar[Resistance | None] = None

    @property
    def shown(self) -> tuple[float, float] | None:
        """Smallest and largest argument of practical interest, or None.

        Fibre strains (-), shear angles (rad) or curvatures (1/mm).  It is the range of
        graphs, and `check_laws` tests a law with an unbounded domain in this range.
        """
        return None


@dataclass(frozen=True)
class OneStiffness(ScalarLaw):
    """Law with one parameter, its initial stiffness; finite everywhere.

    The stiffness is a number, or one per element, shape (n_elements,).
    """

    stiffness: float | ndarray
    domain: ClassVar[tuple[float, float]] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        stiffness = np.ravel(self.stiffness)
        if (wrong := stiffness[~(np.isfinite(stiffness) & (stiffness >= 0))]).size:
            raise ValueError(f"stiffness must be a finite number >= 0, got {wrong[0]}")
        keep_copies(self, "stiffness")

    def at(self, element: ndarray | None = None) -> Self:
        """Law at points, given by element numbers; see `Law`."""
        every = np.asarray(self.stiffness)
        if every.ndim == 0:
            return self
        selected = every[:, None] if element is None else every[element]
        return replace(self, stiffness=selected)


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


_AnyLaw = TypeVar("_AnyLaw")


def is_zero(law: Law) -> bool:
    """True if a law has zero stiffness and needs no term."""
    return isinstance(law, OneStiffness) and not np.any(law.stiffness)


def law_at(law: _AnyLaw, element: ndarray | None) -> _AnyLaw:
    """Law at points, given by element numbers, if it varies by element."""
    return law.at(element) if hasattr(law, "at") else law


def n_slips(law: Any) -> int:
    """Number of friction elements of a law, for one family if it has two."""
    return int(getattr(law, "n_slips", 0))


def with_slip(law: _AnyLaw, slip: ndarray) -> _AnyLaw:
    """A law with the slip of its friction elements; the law itself without any."""
    holder: Any = law
    return holder.with_slip(slip) if n_slips(law) else law


def slip_after(law: Any, x: ndarray, slip: ndarray) -> ndarray:
    """Slip of the friction elements of a law at the end of a monotonic step to x."""
    return law.slip_after(x, slip) if n_slips(law) else slip


def loss(law: Any, change: ndarray) -> Any:
    """Energy density lost by changes of slip of the friction elements of a law."""
    return law.loss(change) if n_slips(law) else 0.0


def domain_of(law: Law) -> tuple[Any, Any]:
    """Smallest and largest argument for which a law is valid."""
    return getattr(law, "domain", (-np.inf, np.inf))


class Slopes(NamedTuple):
    """Derivatives of the tensions with respect to the strains, in N/mm.

    ``own`` are ∂T_α/∂ε_α of warp and weft, ``cross`` is ∂T₁/∂ε₂ = ∂T₂/∂ε₁, or None if
    neither tension depends on the strain of the other family.
    """

    own: Any
    cross: ndarray | None

    def times(self, change: ndarray) -> ndarray:
        """Tension increments for strain increments of shape (2, ...)."""
        alone = np.asarray(self.own) * change
        return alone if self.cross is None else alone + self.cross * change[::-1]


class BiaxialLaw(ABC):
    """Law of both tensions: an energy ψ(ε₁, ε₂) and its derivatives.

    Strains have the shape (2, ...), warp first.

    A law that varies by element has a method ``at``, see `Law`.
    """

    @property
    def domain(self) -> tuple[Any, Any]:
        """Smallest and largest valid strain, by default all strains.

        Each is a number, or a pair for warp and weft.
        """
        return -np.inf, np.inf

    @property
    def shown(self) -> tuple[float, float] | None:
        """Smallest and largest strain of practical interest; see `ScalarLaw.shown`."""
        return None

    @abstractmethod
    def energy(self, strain: ndarray) -> ndarray:
        """Energy density in N·mm/mm², zero at rest, shape (...)."""

    @abstractmethod
    def value(self, strain: ndarray) -> Any:
        """Tensions T_α = ∂ψ/∂ε_α of warp and weft in N/mm, shape (2, ...)."""

    @abstractmethod
    def tangent(self, strain: ndarray) -> ndarray:
        """∂T_α/∂ε_β in N/mm, symmetric, shape (2, 2, ...)."""

    def energies(self, strain: ndarray) -> Sequence[ndarray]:
        """Two densities whose sum is the energy of the fabric."""
        half = 0.5 * self.energy(strain)
        return half, half

    def slopes(self, strain: ndarray) -> Slopes:
        """Components of the tangent."""
        D = self.tangent(strain)
        return Slopes((D[0, 0], D[1, 1]), D[0, 1])

    def of_family(self, family: int, strain: Any = (0.0, 0.0)) -> Law:
        """Law of one family at a fixed strain of the other.

        Parameters
        ----------
        family
            0 for the warp, 1 for the weft.
        strain
            Strains of both families; the strain of the other family is used.
        """
        direction = (1.0, 0.0) if family == 0 else (0.0, 1.0)
        start = (0.0, strain[1]) if family == 0 else (strain[0], 0.0)
        return LawAlong(self, direction, start)


@dataclass(frozen=True, eq=False)
class LawAlong:
    """Biaxial law along a straight line of strains, as a law of one argument.

    Parameters
    ----------
    law
        The law.
    direction
        Derivative of both strains with respect to the argument.
    start
        Strains of warp and weft at the argument 0: numbers, or arrays that broadcast
        with the arguments.
    """

    law: BiaxialLaw
    direction: tuple[float, float]
    start: tuple[Any, Any] = (0.0, 0.0)

    def energy(self, x: ndarray) -> ndarray:
        """ψ on the line."""
        return self.law.energy(self._strain(x))

    def value(self, x: ndarray) -> ndarray:
        """T·d with the direction d."""
        T_1, T_2 = self.law.value(self._strain(x))
        d_1, d_2 = self.direction
        return d_1 * T_1 + d_2 * T_2

    def tangent(self, x: ndarray) -> ndarray:
        """d·D·d with the direction d and the tangent D."""
        (D_11, D_12), (D_21, D_22) = self.law.tangent(self._strain(x))
        d_1, d_2 = self.direction
        return d_1**2 * D_11 + d_1 * d_2 * (D_12 + D_21) + d_2**2 * D_22

    @property
    def domain(self) -> tuple[Any, Any]:
        """Range in which both strains are in the domain of the law."""
        low, high = -np.inf, np.inf
        for i, (d, start) in enumerate(zip(self.direction, self.start, strict=True)):
            if d != 0:
                bounds = (
                    end if np.ndim(end) == 0 else end[i] for end in self.law.domain
                )
                ends = [(end - start) / d for end in bounds]
                low = np.maximum(low, ends[0] if d > 0 else ends[1])
                high = np.minimum(high, ends[1] if d > 0 else ends[0])
        return low, high

    @property
    def shown(self) -> tuple[float, float] | None:
        """Shown range of the law."""
        return self.law.shown

    def _strain(self, x: ndarray) -> ndarray:
        pairs = zip(self.start, self.direction, strict=True)
        return np.array([start + d * x for start, d in pairs])


@dataclass(frozen=True)
class TwoLaws(BiaxialLaw):
    """One law per family: neither tension depends on the strain of the other family.

    Parameters
    ----------
    warp, weft
        The laws.
    """

    warp: Law
    weft: Law

    @property
    def laws(self) -> tuple[Law, Law]:
        """Both laws."""
        return self.warp, self.weft

    def at(self, element: ndarray | None = None) -> "TwoLaws":
        """Laws at points, given by element numbers; see `Law`."""
        warp, weft = law_at(self.warp, element), law_at(self.weft, element)
        same = warp is self.warp and weft is self.weft
        return self if same else TwoLaws(warp, weft)

    def energy(self, strain: ndarray) -> ndarray:
        """Sum of both energies."""
        of_warp, of_weft = self.energies(strain)
        return of_warp + of_weft

    def energies(self, strain: ndarray) -> Sequence[ndarray]:
        """Energy of each family."""
        return self._each("energy", strain)

    def value(self, strain: ndarray) -> list[ndarray]:
        """Tension of each family."""
        return self._each("value", strain)

    def tangent(self, strain: ndarray) -> ndarray:
        """Slopes on the diagonal."""
        warp, weft = self.slopes(strain).own
        nothing = np.zeros(np.broadcast_shapes(warp.shape, weft.shape))
        return np.array([[warp + nothing, nothing], [nothing, weft + nothing]])

    def slopes(self, strain: ndarray) -> Slopes:
        """Slope of each law."""
        return Slopes(self._each("tangent", strain), None)

    def of_family(self, family: int, strain: Any = (0.0, 0.0)) -> Law:
        """Law of the family."""
        return (self.warp, self.weft)[family]

    @property
    def n_slips(self) -> int:
        """Larger number of friction elements of both laws."""
        return max(map(n_slips, self.laws))

    def with_slip(self, slip: ndarray) -> "TwoLaws":
        """The laws after slip of their elements, shape (2, n_slips, ...)."""
        return TwoLaws(*map(with_slip, self.laws, slip))

    def slip_after(self, strain: ndarray, slip: ndarray) -> ndarray:
        """Slip at the end of a monotonic step, shape (2, n_slips, ...)."""
        return np.array([*map(slip_after, self.laws, strain, slip)])

    def loss(self, change: ndarray) -> Any:
        """Energy density lost by changes of slip, shape (2, n_slips, ...)."""
        return sum(map(loss, self.laws, change))

    @property
    def domain(self) -> tuple[Any, Any]:
        """Domains of the laws."""
        low, high = zip(*map(domain_of, self.laws), strict=True)
        return low, high

    def _each(self, part: str, strain: ndarray) -> list[ndarray]:
        each = []
        for law, x in zip((self.warp, self.weft), strain, strict=True):
            values, shape = getattr(law, part)(x), np.shape(x)
            same = getattr(values, "shape", ()) == shape
            each.append(values if same else np.broadcast_to(values, shape))
        return each


def mean_slope(law: Law, strain: ndarray) -> ndarray:
    """Mean slope of T(ε) in N/mm within one percent of strain to either side.

    A tangent at one strain does not represent a law that is soft at rest and stiff
    beyond, or stiff in tension and soft in compression, where a state may cover both.
    In compression it is the mean slope at rest, as slack fibres are elastic only within
    limits. Beyond the domain of the law it is the slope at the end: if the tension
    follows from the mean stretch, the strain at a point may lie outside the domain.
    """
    lowest, highest = domain_of(law)
    strain = np.clip(np.maximum(strain, 0.0), lowest, highest)
    low = np.clip(strain - _WITHIN, lowest, highest)
    high = np.clip(strain + _WITHIN, lowest, highest)
    width = high - low
    rise = law.value(high) - law.value(low)
    slope = np.where(width > 0, rise / np.where(width > 0, width, 1.0), np.nan)
    known = np.where(np.isfinite(slope), slope, law.tangent(strain))
    return np.maximum(known, 0.0)


def keep(law: Any, **values: Any) -> None:
    """Set validated parameters of a frozen law."""
    for name, value in values.items():
        object.__setattr__(law, name, value)


# Share of a nearby value below which a law is zero at rest: round-off.
_NOTHING = 1e-9


def number(name: str, value: Any, above: float | None = None) -> float:
    """Validate a parameter of a law, by its name, as a finite number.

    It must be larger than ``above``; by default any finite number >= 0 is valid.
    """
    least = ">= 0" if above is None else f"> {above:g}"
    try:
        converted = float(value)
    except (TypeError, ValueError):
        converted = math.nan
    large_enough = converted >= 0 if above is None else converted > above
    if not (math.isfinite(converted) and large_enough):
        given = shortened(value)
        raise ValueError(f"{name} must be a finite number {least}, got {given}")
    return converted


def refuse_other_units(
    name: str, values: Any, of: Resistance | None, ask: bool = True
) -> None:
    """Refuse angles beyond a right angle, `LARGEST_STRAIN` and `LARGEST_CURVATURE`.

    The values are shear angles in radians if ``of`` is "shear", strains if it is
    "tension", curvatures in 1/mm if it is "bending", and any of them if it is None.  By
    default the message asks whether they are in another unit.
    """
    x = np.ravel(values)
    limits = {"tension": LARGEST_STRAIN, "bending": LARGEST_CURVATURE}
    most = RIGHT_ANGLE if of is None else limits.get(of, RIGHT_ANGLE)
    beyond = x[np.abs(x) > most * (1 + _ROUNDING)]
    if not beyond.size:
        return
    angle = f"a right angle, {RIGHT_ANGLE:.4g} rad"
    symbol, end, unit = {
        "shear": (" rad", angle, "degrees"),
        "tension": ("", f"the largest strain, {most:g}", "per cent"),
        "bending": (" 1/mm", "the largest curvature, of a radius of 1 mm", "1/m"),
        None: ("", angle, "degrees, or in per cent"),
    }[of]
    question = f": is the value in {unit}?" if ask else ""
    raise ValueError(f"{name}: {beyond[0]:.4g}{symbol} exceeds {end}{question}")


def pair(name: str, value: Any, above: float | None = None) -> tuple[float, float]:
    """Parameter of warp and weft: one `number` for both, or two.

    Raises an error if it varies by element.
    """
    if isinstance(value, np.ndarray):
        raise ValueError(
            f"{name} must be a number or a pair (warp, weft), uniform over the "
            "elements; define a fabric for each subdomain instead"
        )
    both = tuple(value) if isinstance(value, tuple | list) else (value, value)
    if len(both) != 2:
        raise ValueError(
            f"{name} must be a number or a pair (warp, weft), got {shortened(value)}"
        )
    return number(name, both[0], above), number(name, both[1], above)


def inner_law(name: str, law: Any) -> Law:
    """Law of one strain, uniform over the elements, as part of another law."""
    parts = ("energy", "value", "tangent")
    if isinstance(law, type) or not all(hasattr(law, part) for part in parts):
        raise ValueError(f"{name} must be a law, such as Linear(5e3), got {law!r}")
    if isinstance(law, BiaxialLaw):
        raise ValueError(f"{name} must be a law of one strain, got {law!r}")
    if n_slips(law):
        raise ValueError(
            f"{name} must not have friction: add it to the whole law, as in "
            "WithFriction(TensionOnly(law), limits, onsets)"
        )
    if hasattr(law, "region") or law_at(law, None) is not law:
        raise ValueError(
            f"{name} must be uniform over the elements; define a fabric for each "
            "subdomain instead"
        )
    return law


def refuse_force_at_rest(name: str, law: Law, strain: float) -> None:
    """Refuse a law that is not zero at rest, or is not defined up to a strain."""
    low, high = domain_of(law)
    if not low <= min(strain, 0.0) <= max(strain, 0.0) <= high:
        raise ValueError(
            f"{name} must be defined from 0 to the switch at {strain:g}, but its "
            f"domain is {low:g} to {high:g}"
        )
    F0, F = law.value(np.array([0.0, strain]))
    if not abs(F0) <= _NOTHING * abs(F):
        raise ValueError(f"{name} must be zero at rest, but is {F0:.4g} N/mm there")
