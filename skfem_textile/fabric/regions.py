"""Laws and fabrics that vary from region to region of a ply."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy import ndarray
from skfem import Mesh

from .fabric import Direction, Fabric, is_law, unit_vectors
from .law import (
    BiaxialLaw,
    Linear,
    TwoLaws,
    domain_of,
    law_at,
    loss,
    n_slips,
    slip_after,
    with_slip,
)


@dataclass(frozen=True, eq=False)
class _OneOfLaws:
    """Energy and derivatives of one of several laws in each element."""

    laws: Sequence[Any]
    region: ndarray

    def at(self, element: ndarray | None = None) -> Self:
        """Law at points, given by element numbers.

        Parameters
        ----------
        element
            Of any shape that broadcasts with the arguments of the law; by default all
            elements, shape (n_elements, 1).
        """
        laws = [law_at(law, element) for law in self.laws]
        return replace(self, laws=laws, region=_region_at(self.region, element))

    def energy(self, x: ndarray) -> ndarray:
        """Energy density at each point; each law is evaluated for its own points.

        It is evaluated at 0 elsewhere, because a law may warn of an argument beyond its
        table.
        """
        arguments = [np.where(self.region == i, x, 0.0) for i in range(len(self.laws))]
        pairs = zip(self.laws, arguments, strict=True)
        return _chosen(self.region, [law.energy(at) for law, at in pairs])

    def value(self, x: ndarray) -> ndarray:
        """Derivative of the energy."""
        return _chosen(self.region, [np.array(law.value(x)) for law in self.laws])

    def tangent(self, x: ndarray) -> ndarray:
        """Derivative of the value."""
        return _chosen(self.region, [law.tangent(x) for law in self.laws])

    @property
    def n_slips(self) -> int:
        """Largest number of friction elements of the laws."""
        return max(map(n_slips, self.laws))

    def with_slip(self, slip: ndarray) -> Self:
        """The laws after slip of their elements, see `WithFriction`."""
        return replace(self, laws=[with_slip(law, slip) for law in self.laws])

    def slip_after(self, x: ndarray, slip: ndarray) -> ndarray:
        """Slip at the end of a monotonic step to x."""
        every = [slip_after(law, x, slip) for law in self.laws]
        return _chosen(self.region, every)

    def loss(self, change: ndarray) -> ndarray:
        """Energy density lost by changes of slip."""
        every = [np.asarray(loss(law, change)) for law in self.laws]
        return _chosen(self.region, every)


class RegionalLaw(_OneOfLaws):
    """One of several laws in each element.

    Parameters
    ----------
    laws
        The laws.
    region
        Index of the law for each element: integers, shape (n_elements,).
    """

    @property
    def domain(self) -> tuple[ndarray, ndarray]:
        """Smallest and largest x for which the law at each point is valid."""
        low, high = zip(*(domain_of(law) for law in self.laws), strict=True)
        return _chosen(self.region, low), _chosen(self.region, high)


class RegionalTensions(_OneOfLaws, BiaxialLaw):
    """One of several laws of both tensions in each element; see `RegionalLaw`."""

    @property
    def domain(self) -> tuple[ndarray, ndarray]:
        """Smallest and largest strains for which the law at each point is valid."""
        families = ([law.of_family(i) for law in self.laws] for i in range(2))
        domains = (RegionalLaw(laws, self.region).domain for laws in families)
        low, high = zip(*domains, strict=True)
        return np.array(low), np.array(high)


def _region_at(region: ndarray, element: ndarray | None) -> ndarray:
    """Regions at points, by element numbers; by default of all, (n, 1)."""
    return region[:, None] if element is None else region[element]


def _chosen(region: ndarray, values: Sequence[Any]) -> ndarray:
    """Values, of one value or array per law, for the law at each point."""
    region, *every = np.broadcast_arrays(region, *values)
    return np.take_along_axis(np.stack(every), region[None], axis=0)[0]


@dataclass(frozen=True, eq=False)
class RegionalDirection:
    """One of several direction fields in each element.

    Parameters
    ----------
    directions
        The fields, as for `Fabric`. region Index of the field for each element:
        integers, shape (n_elements,).
    """

    directions: Sequence[Direction]
    region: ndarray

    def at(self, name: str, x: ndarray, element: ndarray | None) -> ndarray:
        """Unit vectors at points, see `unit_vectors`."""
        region = _region_at(self.region, element)
        shape = np.broadcast_shapes(x.shape[1:], region.shape)
        x = np.broadcast_to(x, (2, *shape))
        region = np.broadcast_to(region, shape)
        chosen = np.empty((2, *shape))
        for number, direction in enumerate(self.directions):
            rows = np.flatnonzero((region == number).any(axis=1))
            if not rows.size:
                continue  # a field need not be defined outside its region
            numbers = rows[:, None] if element is None else element[rows]
            field = unit_vectors(name, direction, x[:, rows], numbers)
            in_region = region[rows] == number
            chosen[:, rows] = np.where(in_region, field, chosen[:, rows])
        return chosen


def fabric_on(parent: ndarray, fabric: Fabric) -> Fabric:
    """Fabric with values per element of the computational mesh.

    Values may be per element of either mesh; other numbers are refused.  ``parent`` is
    the user's element that contains each element of the mesh, shape (n_elements,).
    Without values per element it is the fabric itself.
    """
    tension: Any = fabric.tensions
    laws = tension.laws if isinstance(tension, TwoLaws) else (tension,)
    directions = [_as_array(family.direction) for family in fabric.families]
    data = *laws, fabric.shear_law, *directions, *fabric.bending
    numbers: Any = *fabric.bending, fabric.twist, fabric.wrinkling_angle
    if all(_n_elements(x) is None for x in data) and not any(map(np.ndim, numbers)):
        return fabric

    def carried(name: str, data: Any) -> Any:
        if isinstance(data, TwoLaws):
            return TwoLaws(*(carried(name, law) for law in data.laws))
        if isinstance(data, RegionalLaw | RegionalTensions):
            data = replace(data, laws=[carried(name, law) for law in data.laws])
        if isinstance(data, RegionalDirection):
            fields = [carried(name, _as_array(field)) for field in data.directions]
            data = replace(data, directions=fields)
        each = "value" if hasattr(data, "energy") else "vector"
        if not _is_by_users_element(name, _n_elements(data), parent, each):
            return data
        if hasattr(data, "region"):
            return replace(data, region=data.region[parent])
        return data[:, parent] if isinstance(data, ndarray) else law_at(data, parent)

    def on_elements(name: str, value: Any) -> Any:
        return _on_elements(name, value, parent)

    if isinstance(tension, TwoLaws):
        warp, weft = tension.laws
        tension = carried("tension of warp", warp), carried("tension of weft", weft)
    else:
        tension = carried("tension", tension)
    warp, weft = map(carried, ("warp", "weft"), directions)
    shear = carried("shear", fabric.shear_law)
    of_warp, of_weft = (
        (carried if is_law(D) else on_elements)(f"bending of {f.name}", D)
        for f, D in zip(fabric.families, fabric.bending, strict=True)
    )
    twist, wrinkling_angle = (
        on_elements(name.replace("_", " "), getattr(fabric, name))
        for name in ("twist", "wrinkling_angle")
    )
    bending = of_warp, of_weft
    others = bending, twist, wrinkling_angle, fabric.yarns
    return Fabric(tension, shear, warp, weft, *others)


def _on_elements(name: str, value: Any, parent: ndarray) -> Any:
    """Convert a number per user's element to a number per element of a mesh."""
    n = np.size(value) if np.ndim(value) else None
    return value[parent] if _is_by_users_element(name, n, parent) else value


def _is_by_users_element(
    name: str, n: int | None, parent: ndarray, each: str = "value"
) -> bool:
    """True if n values belong to the elements of the user, not of the mesh.

    ``n`` is None for values of any elements; other numbers are refused.
    """
    if n in (None, len(parent)):
        return False
    if n != parent.max() + 1:
        raise ValueError(
            f"{name}: {n} {each}s for {parent.max() + 1} elements; specify one {each} "
            "per element"
        )
    return True


def _as_array(direction: Any) -> Any:
    """Direction as an array, if it is neither a function nor regional."""
    plain = not callable(direction) and not hasattr(direction, "region")
    return np.asarray(direction) if plain else direction


def _n_elements(data: Any) -> int | None:
    """Number of elements for which a law or a direction has values; None for any."""
    if hasattr(data, "region"):
        return len(data.region)
    if isinstance(data, ndarray):
        return data.shape[1] if data.ndim == 2 else None
    stiffness = getattr(data, "stiffness", None)
    return len(stiffness) if isinstance(stiffness, ndarray) and stiffness.ndim else None


def fabric_of_regions(
    mesh: Mesh, fabrics: Mapping[str, Fabric], parent: ndarray | None = None
) -> Fabric:
    """Fabric of a mesh with a fabric for each subdomain, by name.

    Raises an error if a subdomain is unknown, or an element belongs to none or to two
    of them.  ``parent`` is as in `fabric_on`, if the mesh is not the user's.
    """
    subdomains, region = mesh.subdomains or {}, np.full(mesh.nelements, -1)
    for number, (name, fabric) in enumerate(fabrics.items()):
        if name not in subdomains:
            known = ", ".join(map(repr, subdomains)) or "none"
            raise ValueError(f"the mesh has no subdomain {name!r} (available: {known})")
        if not isinstance(fabric, Fabric):
            raise ValueError(f"subdomain {name!r} requires a Fabric, not {fabric!r}")
        if (region[subdomains[name]] >= 0).any():
            raise ValueError(f"subdomain {name!r} overlaps another that has a fabric")
        region[subdomains[name]] = number
    if (region < 0).any():
        left = np.flatnonzero(region < 0)
        first, more = ", ".join(map(str, left[:5])), ", ..." if left.size > 5 else ""
        raise ValueError(
            f"{left.size} element(s) are not in any subdomain with a fabric: "
            f"{first}{more}; define a fabric for them"
        )
    all_families = [fabric.families for fabric in fabrics.values()]
    warp, weft = zip(*all_families, strict=True)
    parent = np.arange(len(region)) if parent is None else parent
    bending = zip(*(fabric.bending for fabric in fabrics.values()), strict=True)
    of_warp, of_weft = (_bending(D, region, parent) for D in bending)
    twist = [fabric.twist for fabric in fabrics.values()]
    angles = [fabric.wrinkling_angle for fabric in fabrics.values()]
    return Fabric(
        tension=_tensions([fabric.tensions for fabric in fabrics.values()], region),
        shear=RegionalLaw([fabric.shear_law for fabric in fabrics.values()], region),
        warp=RegionalDirection([family.direction for family in warp], region),
        weft=RegionalDirection([family.direction for family in weft], region),
        bending=(of_warp, of_weft),
        twist=_numbers("twist", twist, region, parent),
        wrinkling_angle=_numbers("wrinkling angle", angles, region, parent),
        yarns=_yarns([fabric.yarns for fabric in fabrics.values()]),
    )


def _yarns(values: Sequence[Any]) -> Any:
    """The yarns of all fabrics that have some; an error if they differ."""
    known = [value for value in values if value is not None]
    if any(value != known[0] for value in known):
        raise ValueError("the fabrics of all subdomains must have the same yarns")
    return known[0] if known else None


def _bending(values: Sequence[Any], region: ndarray, parent: ndarray) -> Any:
    """Bending stiffness, or a law in each element if a fabric has a law."""
    if not any(map(is_law, values)):
        return _numbers("bending", values, region, parent)
    laws = [
        value if is_law(value) else Linear(_on_elements("bending", value, parent))
        for value in values
    ]
    return RegionalLaw(laws, region)


def _numbers(
    name: str, values: Sequence[Any], region: ndarray, parent: ndarray
) -> float | ndarray:
    """A number if it is the same for all fabrics, else one per element."""
    if all(np.ndim(value) == 0 and value == values[0] for value in values):
        return float(values[0])
    every = [_on_elements(name, value, parent) for value in values]
    return _chosen(region, every)


def _tensions(
    laws: Sequence[BiaxialLaw], region: ndarray
) -> tuple[RegionalLaw, RegionalLaw] | RegionalTensions:
    """One law per family, or one for both if a tension depends on both."""
    alone = [law for law in laws if isinstance(law, TwoLaws)]
    if len(alone) < len(laws):
        return RegionalTensions(laws, region)
    warp, weft = zip(*(law.laws for law in alone), strict=True)
    return RegionalLaw(warp, region), RegionalLaw(weft, region)
