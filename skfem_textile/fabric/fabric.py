"""Fabric model: fibre directions, tension laws, shear law and bending stiffnesses."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.user_input import (
    call_user_function,
    errors_in,
    keep_copies,
    real_numbers,
    shortened,
)
from .law import (
    BiaxialLaw,
    Law,
    Linear,
    TwoLaws,
    domain_of,
    keep,
    law_at,
    n_slips,
    refuse_other_units,
)

if TYPE_CHECKING:
    from .yarns import Yarns


class PiecewiseDirections(Protocol):
    """Directions that are defined differently by region."""

    @property
    def region(self) -> ndarray:
        """Region number of each element."""
        ...

    def at(self, name: str, x: ndarray, element: ndarray | None) -> ndarray:
        """Unit vectors at points, see `unit_vectors`."""
        ...


Direction: TypeAlias = ArrayLike | Callable[[ndarray], ndarray] | PiecewiseDirections

#: Angle in radians below which two fibre families are parallel.
PARALLEL = 1e-6

#: A number, such as a bending stiffness, or one per element.
ByElement: TypeAlias = float | ndarray

#: A stiffness, one per element, or a law.
Stiffness: TypeAlias = float | ndarray | Law


class Family(NamedTuple):
    """Fibre family: name, reference direction and tension law.

    If the tensions depend on both strains, the law is taken at zero strain of the other
    family.
    """

    name: str
    direction: Direction
    tension: Law


# Quantities of the laws of a fabric, in their order.
_QUANTITIES = "warp_strain", "weft_strain", "shear_angle"

# Hint for a shear law that ends at rest.
_GO_ON = (
    " (a table that starts at 0 requires odd=True; in a case file, shear.continuation "
    "= 'odd')"
)

# Difference, relative to the end of a law, within which elements count as equally close
# to it.  Chosen: half a degree at 50°, indistinguishable by colour.
_AS_CLOSE = 0.01


class LawEnd(NamedTuple):
    """Law close to an end of its domain.

    Attributes
    ----------
    quantity
        Quantity of the law: warp_strain, weft_strain, shear_angle, warp_curvature or
        weft_curvature.
    value, end
        The value closest to the end, and the end; angles in radians, curvatures in
        1/mm.
    elements
        Numbers of the elements that are equally close.
    """

    quantity: str
    value: float
    end: float
    elements: ndarray

    def __str__(self) -> str:
        name, (value, end) = self.quantity.replace("_", " "), self[1:3]
        texts = f"{value:.3g}", f"{end:.3g}"
        if self.quantity == "shear_angle":
            texts = f"{np.degrees(value):.4g}°", f"{np.degrees(end):.4g}°"
        elif self.quantity.endswith("curvature"):
            texts = f"{value:.3g} 1/mm", f"{end:.3g} 1/mm"
        text = f"the {name} is {texts[0]}, and the domain of its law ends at {texts[1]}"
        return text + (_GO_ON if self.quantity == "shear_angle" and end == 0 else "")


@dataclass(frozen=True, eq=False)
class Fabric:
    """Biaxial fabric: two fibre families with tension laws, and a shear law.

    Parameters
    ----------
    tension
        Fibre stiffness E in N/mm (tension T = E ε), a number or one per element, shape
        (n_elements,), or a `Law` T(ε); one for both families or a tuple (warp, weft).
        Or a `BiaxialLaw`, whose tensions depend on both strains.
    shear
        Shear stiffness G in N/mm (moment M_s = G Γ), a number or one per element, or a
        `Law` M_s(Γ).
    warp, weft
        Reference direction of each family: a vector, a function of position ``(2, ...)
        -> (2, ...)``, or one vector per element, shape (2, n_elements).  They are
        normalised.
    bending
        Bending stiffness D of each family per width of ply in N·mm (moment M = D κ), a
        pair (warp, weft): each a number or one per element, shape (n_elements,), or a
        `Law` M(κ), of the curvature in 1/mm, such as `Bilinear`.  Fibres bend
        independently, in space and in the plane.  A law that differs by the sign of the
        curvature is positive where fibres bend to the left of their direction in the
        plane, and towards the normal of the ply, +z at rest, in space.
    twist
        Twist stiffness D_t of the ply in N·mm, a number or one per element.  The energy
        per area is ½ D_t τ·τ, where τ is the mixed second derivative of the position
        along warp and weft: ½ D_t c² for z = c x y with fibres along x and y.
    wrinkling_angle
        Shear angle in radians beyond which compressed fibres wrinkle: the locking angle
        of tests.  A number or one per element, up to π/2.  It does not enter the
        energy; it is used by `drape.wrinkle_risk`.
    yarns
        Spacing and width of the yarns, for `slip_index`; None if they are unknown.

    Raises
    ------
    ValueError
        If a stiffness is negative, a bending law is of another quantity, not defined
        for both signs, or has curvatures of a radius below 1 mm, a direction is zero or
        not finite, warp and weft are parallel, or the wrinkling angle is not between 0
        and π/2.

    Examples
    --------
    >>> fabric = Fabric(tension=1e4, shear=0.5, warp=(1, 1), weft=(-1, 1))
    >>> fabric.families[0].tension
    Linear(stiffness=10000.0)
    """

    tension: Stiffness | tuple[Stiffness, Stiffness] | BiaxialLaw = 1e4
    shear: Stiffness = 0.0
    warp: Direction = (1.0, 0.0)
    weft: Direction = (0.0, 1.0)
    bending: tuple[Stiffness, Stiffness] = (0.0, 0.0)
    twist: ByElement = 0.0
    wrinkling_angle: ByElement = 0.5 * np.pi
    yarns: "Yarns | None" = None
    # Unit directions at points of elements, (2, 1, 1), if each family has one vector.
    _uniform: ClassVar[tuple[ndarray, ndarray] | None] = None

    def __post_init__(self) -> None:
        keep_copies(self, "tension", "shear", "warp", "weft")
        _ = self.families, self.shear_law
        keep(
            self,
            bending=_bending(self.bending),
            twist=_stiffness("twist", self.twist),
            wrinkling_angle=_angle(self.wrinkling_angle),
        )
        if not (self.yarns is None or hasattr(self.yarns, "lever")):
            raise ValueError(
                f"yarns must be Yarns(spacing=..., width=...), not {self.yarns!r}"
            )
        if any(hasattr(f.direction, "region") for f in self.families):
            return  # each of its fabrics is valid
        families = [f for f in self.families if not callable(f.direction)]
        sizes = [real_numbers(f.name, f.direction).size // 2 for f in families]
        x = np.zeros((2, max(sizes, default=1), 1))
        for family in families:
            unit_vectors(family.name, family.direction, x)
        if len(families) == 2:
            pair = self.directions(x)  # refuses parallel families
            vectors: list[Any] = [family.direction for family in families]
            if all(np.ndim(vector) == 1 for vector in vectors):
                keep(self, _uniform=pair)

    @cached_property
    def families(self) -> tuple[Family, Family]:
        """Warp and weft."""
        return (
            Family("warp", self.warp, self.tensions.of_family(0)),
            Family("weft", self.weft, self.tensions.of_family(1)),
        )

    @cached_property
    def tensions(self) -> BiaxialLaw:
        """Law of both tensions; `TwoLaws` if each depends on its own strain only."""
        if isinstance(self.tension, BiaxialLaw):
            return self.tension
        one = not isinstance(self.tension, tuple | list)
        pair: Any = (self.tension, self.tension) if one else self.tension
        if len(pair) != 2:
            raise ValueError("tension must be one law or a pair (warp, weft)")
        return TwoLaws(_law("tension", pair[0]), _law("tension", pair[1]))

    @cached_property
    def shear_law(self) -> Law:
        """Shear moment M_s(Γ)."""
        return _law("shear", self.shear)

    @cached_property
    def laws(self) -> tuple[Law, Law, Law]:
        """Laws of warp, weft and shear."""
        warp, weft = self.families
        return warp.tension, weft.tension, self.shear_law

    def at(self, element: ndarray | None = None) -> "Fabric":
        """The fabric with its laws at points, given by element numbers.

        Parameters
        ----------
        element
            Shape (n, n_points) or (n, 1); by default all elements, shape (n_elements,
            1).
        """
        tensions = law_at(self.tensions, element)
        shear = law_at(self.shear_law, element)
        if tensions is self.tensions and shear is self.shear_law:
            return self
        other = object.__new__(Fabric)  # its directions are valid
        attributes = {field.name: getattr(self, field.name) for field in fields(self)}
        vars(other).update(attributes | {"tension": tensions, "shear": shear})
        return other

    @property
    def has_friction(self) -> bool:
        """True if the unloading of a law differs from its loading."""
        return any(map(n_slips, (self.tensions, self.shear_law, *self.bending)))

    @property
    def bends(self) -> bool:
        """True if fibres have a bending stiffness, or the ply a twist stiffness."""
        return any(self.bent) or bool(np.any(self.twist))

    @property
    def bent(self) -> tuple[bool, bool]:
        """True for warp and for weft, if they have a bending stiffness or law."""
        of_each: tuple[Any, Any] = self.bending
        warp, weft = (is_law(D) or bool(np.any(D)) for D in of_each)
        return warp, weft

    @cached_property
    def bending_at_rest(self) -> tuple[ByElement, ByElement]:
        """Bending stiffness of warp and weft at zero curvature in N·mm."""
        warp, weft = map(_at_rest, self.bending)
        return warp, weft

    @cached_property
    def unbounded(self) -> bool:
        """True if the domains of all laws are unbounded."""
        laws = *self.laws, *filter(is_law, self.bending)
        stated = [getattr(law, "domain", None) for law in laws]
        return all(ends is not None and np.isinf(ends).all() for ends in stated)

    def in_domain(self, strain: ndarray, angle: ndarray) -> bool:
        """True if every law is evaluated within its domain.

        Parameters
        ----------
        strain
            Fibre strains of warp and weft, shape (2, ...).
        angle
            Shear angles in radians.
        """
        pairs = zip(self.laws, (*strain, angle), strict=True)
        return all(
            bool(np.all((low <= x) & (x <= high)))
            for law, x in pairs
            for low, high in [domain_of(law)]
        )

    def closest_end(
        self,
        strain: ndarray,
        angle: ndarray,
        curvatures: Iterable[tuple[str, ndarray, Any, Any]] = (),
    ) -> LawEnd | None:
        """The closest end of a law; parameters as `in_domain`, (2, n_elements, n).

        ``curvatures`` are, for each bending law, the name, the curvatures at points of
        shape (n_elements, n), and the smallest and largest one.  None if the domains of
        all laws are unbounded.
        """
        named = zip(_QUANTITIES, self.laws, (*strain, angle), strict=True)
        every = [(name, x, *domain_of(law)) for name, law, x in named]
        found = []
        for name, x, *ends in (*every, *curvatures):
            for end, side in zip(ends, (-1, 1), strict=True):
                ends_at = np.broadcast_to(end, x.shape)
                gaps = side * (ends_at - x)
                if name.endswith("curvature"):  # of another unit: relative
                    gaps = gaps / np.abs(ends_at)
                at = int(np.nanargmin(gaps))
                if np.isfinite(least := gaps.flat[at]):
                    close = gaps <= least + _AS_CLOSE * np.abs(ends_at)
                    elements = np.flatnonzero(close.any(axis=1))
                    location = float(x.flat[at]), float(ends_at.flat[at]), elements
                    found.append((least, LawEnd(name, *location)))
        return min(found, key=lambda each: each[0])[1] if found else None

    def directions(
        self,
        x: ndarray,
        element: ndarray | None = None,
        given: Mapping[str, ndarray] = MappingProxyType({}),
    ) -> tuple[ndarray, ndarray]:
        """Unit reference directions (A₁, A₂) at the points ``x``.

        Parameters
        ----------
        x
            Reference positions, shape (2, n_elements, n_points).
        element
            Element numbers of the points, shape (n_elements, n_points); by default the
            row numbers.
        given
            Directions at the points, by family, instead of the fabric's own.

        Returns
        -------
        tuple of ndarray
            Each with a shape that broadcasts with ``x``.
        """
        if self._uniform and not given and x.ndim == self._uniform[0].ndim:
            return self._uniform
        A1, A2 = (
            unit_vectors(f.name, given.get(f.name, f.direction), x, element)
            for f in self.families
        )
        if np.any(np.abs(A1[0] * A2[1] - A1[1] * A2[0]) < PARALLEL):
            raise ValueError("warp and weft are parallel: they must cross at an angle")
        return A1, A2


def _law(name: str, law: Stiffness) -> Law:
    if isinstance(law, BiaxialLaw):
        raise ValueError(
            f"{name}: {type(law).__name__} is a law of both fibre strains: pass it as "
            "tension=law, not in a pair"
        )
    by_element = isinstance(law, ndarray) and law.ndim == 1
    if not by_element and not isinstance(law, int | float | np.number):
        if isinstance(law, type):
            raise ValueError(
                f"{name} must be a law: {law.__name__} is a class, pass an instance"
            )
        parts = ("energy", "value", "tangent")
        if missing := [part for part in parts if not hasattr(law, part)]:
            raise ValueError(
                f"{name} must be a number or a law with energy, value and tangent: "
                f"{type(law).__name__} has no {' and no '.join(missing)}"
            )
        return law  # type: ignore[return-value]
    stiffness = real_numbers(name, law)
    with errors_in(f"{name} "):
        return Linear(stiffness if by_element else float(stiffness))


def is_law(bending: Any) -> bool:
    """True for a bending law, False for a stiffness, or one per element."""
    return hasattr(bending, "energy")


def _at_rest(bending: Stiffness) -> ByElement:
    """Bending stiffness at zero curvature: a number, or one per element."""
    given: Any = bending
    if not is_law(given):
        at_rest: ByElement = given
        return at_rest
    law = law_at(given, None)
    if law is given:
        return float(law.tangent(np.zeros(1))[0])
    at_rest = law.tangent(np.zeros((1, 1)))[:, 0]
    return at_rest


def _bending(value: Any) -> tuple[Stiffness, Stiffness]:
    """Bending stiffnesses or laws of warp and weft, validated."""
    if not isinstance(value, tuple | list) or len(value) != 2:
        raise ValueError(
            "bending must be a pair (warp, weft) of stiffnesses in N·mm or laws, not "
            f"{value!r}"
        )
    warp, weft = value
    return _bending_of("bending of warp", warp), _bending_of("bending of weft", weft)


def _bending_of(name: str, value: Any) -> Stiffness:
    """Bending stiffness or law of a family; a linear law is its stiffness."""
    if isinstance(value, Linear):
        value = value.stiffness
    plain = isinstance(value, ndarray | list | tuple | int | float | np.generic | str)
    if plain or value is None:
        return _stiffness(name, value)
    law = _law(name, value)
    if (of := getattr(law, "of", None)) not in (None, "bending"):
        raise ValueError(
            f"{name}: {type(law).__name__} is a law of {of}, not of the curvature"
        )
    ends = [np.ravel(end) for end in domain_of(law)]
    if not (np.max(ends[0]) < 0 < np.min(ends[1])):
        raise ValueError(
            f"{name}: a law must be defined for both signs of the curvature, but its "
            f"domain is {ends[0].max():g} to {ends[1].min():g} 1/mm: a table that "
            "starts at 0 requires odd=True (in a case file, continuation = 'odd')"
        )
    finite = np.concatenate([end[np.isfinite(end)] for end in ends])
    refuse_other_units(name, finite, "bending")
    refuse_other_units(name, getattr(law, "shown", None) or 0.0, "bending")
    return law


def _stiffness(name: str, value: Any) -> ByElement:
    """Bending or twist stiffness, validated."""
    D = real_numbers(name, value)
    if D.ndim > 1 or not (np.isfinite(D) & (D >= 0)).all():
        raise ValueError(
            f"{name} must be a finite number >= 0 in N·mm, or one per element, got "
            f"{shortened(value)}"
        )
    return D if D.ndim else float(D)


def _angle(value: Any) -> ByElement:
    """Wrinkling angle, validated."""
    angle = real_numbers("wrinkling angle", value)
    refuse_other_units("wrinkling angle", angle, "shear")
    if angle.ndim > 1 or not ((angle > 0) & (angle <= 0.5 * np.pi)).all():
        raise ValueError(
            "wrinkling angle must be above 0 and at most π/2 radians, as one number "
            f"or one per element, got {shortened(value)}"
        )
    return angle if angle.ndim else float(angle)


def unit_vectors(
    name: str,
    direction: Direction,
    x: ndarray,
    element: ndarray | None = None,
    d: int = 2,
) -> ndarray:
    """Unit vectors of a direction field with d components at points ``x`` of elements.

    Raises
    ------
    ValueError
        If a direction has the wrong shape, or is zero or not finite.
    """
    field: Any = direction
    if hasattr(field, "region"):
        return field.at(name, x, element)
    value = call_user_function(name, direction, x) if callable(direction) else direction
    a = real_numbers(name, value)
    if element is not None and a.ndim == 2 and a.shape[1] > element.max():
        a = a[:, element]
    given = a.shape
    a = a.reshape(given + (1,) * (x.ndim - a.ndim))
    try:
        shape = d, *x.shape[1:]
        fits = len(a) == d and np.broadcast_shapes(a.shape, shape) == shape
    except (TypeError, ValueError):
        fits = False
    if not fits:
        points = f" for points of shape {x.shape}" if callable(direction) else ""
        raise ValueError(
            f"{name} must be a vector of {d} components, a function of position or one "
            f"vector per element, shape ({d}, n_elements); got shape {given}{points}"
        )
    largest = np.abs(a).max(axis=0)
    if not np.all(np.isfinite(largest) & (largest > 0)):
        raise ValueError(f"{name} must be a non-zero finite vector everywhere")
    a = np.ldexp(a, -np.frexp(largest)[1])  # avoids overflow
    return a / np.linalg.norm(a, axis=0)
