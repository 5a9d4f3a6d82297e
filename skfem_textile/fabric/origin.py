"""Origin of the laws of a fabric: sources, assumptions, and laws of specimens."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .fabric import Fabric


@dataclass(frozen=True)
class SpecimenLaw:
    """Law of one specimen.

    Attributes
    ----------
    name
        Name of the specimen.
    law
        Law fitted to this specimen alone.
    """

    name: str
    law: Any


@dataclass(frozen=True)
class Origin:
    """Where the laws of a fabric come from.

    Attributes
    ----------
    title
        Name of the fabric; empty for a fit of a user.
    reference
        Publication of the measurements.
    sources
        Where a law or quantity comes from, by its name, such as ``shear``.
    assumed
        Why a law or quantity has its value, by its name, if it was not measured.
    properties
        Properties that do not enter the laws: value with unit and source, by name.
    notes
        Restrictions of the laws.
    ranges
        Largest argument of the data, in radians or strain, by part of the fabric.
    specimens
        Laws of single specimens by part of the fabric: ``shear``, ``warp``, ``weft``,
        ``both``, ``bending warp`` or ``bending weft``.

    Raises
    ------
    ValueError
        If specimens are not a mapping of tuples.
    """

    title: str = ""
    reference: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)
    assumed: Mapping[str, str] = field(default_factory=dict)
    properties: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    ranges: Mapping[str, float] = field(default_factory=dict)
    specimens: Mapping[str, tuple[SpecimenLaw, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        known = isinstance(self.specimens, Mapping) and all(
            isinstance(laws, tuple) and all(isinstance(x, SpecimenLaw) for x in laws)
            for laws in self.specimens.values()
        )
        if not known:
            raise ValueError("the specimens of an origin must be laws by part")


def tension_of(laws: Mapping[str, Any], base: Fabric) -> Any:
    """Tension of a fabric with laws by part, and of a base for missing ones."""
    if {"warp", "weft"} & set(laws):
        return tuple(laws.get(one.name, one.tension) for one in base.families)
    return laws.get("both", base.tension)


def with_laws(base: Fabric, laws: Mapping[str, Any]) -> Fabric:
    """A fabric whose laws are replaced by laws by part, see `Origin.specimens`."""
    warp, weft = base.bending
    bending = laws.get("bending warp", warp), laws.get("bending weft", weft)
    return replace(
        base,
        tension=tension_of(laws, base),
        shear=laws.get("shear", base.shear),
        bending=bending,
    )
