"""Laws that tests determine: their choice, and the models of their parameters."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy import ndarray

from . import models
from .bending import BendingCurve, CantileverTest
from .measured import FAMILIES, families_of
from .models import Model
from .solving import PARTS
from .specimens import ROUNDING, Specimen
from .tensile import BiaxialCurve, Strip

#: Name that stands for the choice by cross-validation.
AUTO = "auto"

#: A test of any kind.
Test: TypeAlias = Specimen | Strip | BiaxialCurve | CantileverTest | BendingCurve

#: Shear laws by name, as functions of the largest angle, the degree, and the number of
#: points.
SHEAR_LAWS: dict[str, Callable[[float, int, int], Model]] = {
    "polynomial": lambda largest, degree, points: models.polynomial(degree),
    "linear": lambda largest, degree, points: models.linear(),
    "sin2": lambda largest, degree, points: models.sin2(),
    "locking": lambda largest, degree, points: models.locking(largest),
    "tabulated": lambda largest, degree, points: models.tabulated(largest, points),
}

#: Tension laws by name, as functions of the largest strain, the number of points, and
#: whether the slack of every test is unknown.
TENSION_LAWS: dict[str, Callable[[float, int, bool], Model]] = {
    "crimp-toe": lambda largest, points, slack: models.crimp_toe(largest, slack),
    "linear": lambda largest, points, slack: models.linear(),
    "tabulated": lambda largest, points, slack: models.tabulated(largest, points),
    "crimp-interchange": lambda largest, points, slack: models.crimp_interchange(
        largest
    ),
}

#: Bending laws by name, as functions of the largest curvature, the degree, and the
#: number of points.
BENDING_LAWS: dict[str, Callable[[float, int, int], Model]] = {
    "linear": lambda largest, degree, points: models.bending(),
    "bilinear": lambda largest, degree, points: models.bending_bilinear(largest),
    "polynomial": lambda largest, degree, points: models.bending_polynomial(
        largest, degree
    ),
    "tabulated": lambda largest, degree, points: models.bending_tabulated(
        largest, points
    ),
}

_Kind = TypeVar("_Kind")


@dataclass(frozen=True)
class Choice:
    """Laws that are fitted, and the range of the data.

    Parameters
    ----------
    shear
        Shear law: ``polynomial`` (odd powers), ``linear``, ``sin2``, ``locking`` or
        ``tabulated``; or ``auto``, the one with the best cross-validation.
    tension
        Tension law of each family, ``crimp-toe``, ``linear``, ``tabulated`` or
        ``auto``; or ``crimp-interchange``, whose tensions depend on both strains.
    bending
        Bending law of each family, ``linear``, ``bilinear``, ``polynomial`` (odd
        powers) or, for measured moments, ``tabulated``.  With ``auto`` it is linear,
        or, if the tests cover several curvatures (`asks_for_law`), the law with the
        best cross-validation.  Or law and degree of some parts, such as ``bending
        warp``; others are then linear.
    bending_degree
        Highest power of its polynomial.
    degree
        Highest power of the polynomial.
    points
        Number of points of a table besides 0.
    extrapolation
        Extrapolation of a table, ``refuse`` or ``linear``, see `Tabulated`.
    up_to
        Shear angle in radians above which points are excluded; see `Specimen.used`.
    bounds
        Smallest and largest value of parameters, by name, such as ``c1`` or ``warp
        stiffness``.

    Raises
    ------
    ValueError
        If a law is unknown, or a number is not positive.
    """

    shear: str = "polynomial"
    tension: str = "crimp-toe"
    degree: int = 5
    points: int = 8
    extrapolation: str | None = None
    up_to: float | None = None
    bounds: Mapping[str, tuple[float, float]] | None = None
    bending: str | Mapping[str, tuple[str, int]] = AUTO
    bending_degree: int = 3

    def __post_init__(self) -> None:
        by_part = {} if isinstance(self.bending, str) else self.bending
        bent = [law for law, _ in by_part.values()]
        bent += [self.bending] if isinstance(self.bending, str) else []
        named: list[tuple[str, Mapping[str, Any]]] = [
            *((self.shear, SHEAR_LAWS), (self.tension, TENSION_LAWS)),
            *((law, BENDING_LAWS) for law in bent),
        ]
        for law, laws in named:
            if law not in (*laws, AUTO):
                raise ValueError(
                    f"unknown law {law!r}: choose one of {', '.join(laws)} or {AUTO}"
                )
        if self.up_to is not None and not self.up_to > 0:
            raise ValueError(
                "the largest shear angle must be positive, got "
                f"{np.degrees(self.up_to):g} degrees"
            )
        if self.points < 1:
            raise ValueError(
                f"a table requires at least one point besides 0, got {self.points}"
            )

    def bending_of(self, part: str) -> tuple[str, int]:
        """Bending law of a part, and the degree of a polynomial."""
        if self.bending == AUTO:
            return "linear", 1
        if isinstance(self.bending, str):
            return self.bending, self.bending_degree
        return self.bending.get(part, ("linear", 1))


def of_kind(tests: Iterable[Test], kind: type[_Kind]) -> list[_Kind]:
    """Tests of one kind."""
    return [one for one in tests if isinstance(one, kind)]


def in_tension(tests: Iterable[Test]) -> list[Strip | BiaxialCurve]:
    """Strips and biaxial tests."""
    return [one for one in tests if isinstance(one, Strip | BiaxialCurve)]


def in_bending(tests: Iterable[Test]) -> list[CantileverTest | BendingCurve]:
    """Cantilevers and measured moments."""
    return [one for one in tests if isinstance(one, CantileverTest | BendingCurve)]


# Ratio of the largest to the smallest curvature at the clamps above which cantilevers
# ask for a law.  Chosen: repeated tests of one overhang vary by less.
_VARIED = 1.5


def asks_for_law(tests: Sequence[CantileverTest | BendingCurve]) -> bool:
    """True if tests of a family cover several curvatures: moments, or overhangs."""
    readings = [one.curvature for one in of_kind(tests, CantileverTest)]
    every = np.concatenate([np.ones(1), *readings])[1:]
    curves = bool(of_kind(tests, BendingCurve))
    return curves or bool(every.max(initial=0.0) > _VARIED * every.min(initial=np.inf))


def _largest_curvature(test: CantileverTest | BendingCurve) -> float:
    """Largest curvature of a test in 1/mm; of cantilevers by their elasticas."""
    return float(np.abs(test.curvature).max())


def tests_of(tests: Iterable[Test], part: str) -> list[Test]:
    """Tests that determine a law, in the order of its curves."""
    return [one for one in tests if part in one.parts]


def models_of(tests: Sequence[Test], choice: Choice) -> dict[str, Model]:
    """Laws that the tests determine, by part."""
    found: dict[str, Model] = {}
    strips = of_kind(tests, Strip)
    coupled = choice.tension == "crimp-interchange"
    if coupled and strips:
        raise ValueError(
            f"{strips[0].name}: a strip determines a tension that depends on one "
            "strain: use biaxial tests alone for crimp-interchange, or another law"
        )
    for name in ("both",) if coupled else FAMILIES:
        if own := in_tension(tests_of(tests, name)):
            largest = _largest_strain(own, name)
            slack = all(one.slack_is_unknown for one in own)
            found[name] = TENSION_LAWS[choice.tension](largest, choice.points, slack)
    if specimens := of_kind(tests, Specimen):
        for one in specimens:
            used = one.used(choice.up_to)
            _refuse_angles(one, used, choice.up_to)
            _refuse_forces(one, used)
        largest = max(reach(one, choice.up_to) for one in specimens)
        of_law = SHEAR_LAWS[choice.shear]
        found["shear"] = of_law(largest, choice.degree, choice.points)
    for part in {part for one in in_bending(tests) for part in one.parts}:
        bent = in_bending(tests_of(tests, part))
        law, degree = choice.bending_of(part)
        if law == "tabulated" and of_kind(bent, CantileverTest):
            raise ValueError(
                f"{bent[0].name}: cantilevers do not determine a table: use bilinear "
                "or polynomial"
            )
        largest = max(map(_largest_curvature, bent))
        found[part] = BENDING_LAWS[law](largest, degree, choice.points)
    ordered = {name: found[name] for name in PARTS if name in found}
    return _extrapolated(_bounded(ordered, choice.bounds or {}), choice.extrapolation)


def _extrapolated(
    found: Mapping[str, Model], extrapolation: str | None
) -> dict[str, Model]:
    """Models whose tables are extrapolated; an error if there is none."""
    if extrapolation is None:
        return dict(found)
    if not any(model.name == "tabulated" for model in found.values()):
        raise ValueError(
            f"the law {next(iter(found.values())).name} is defined beyond the data by "
            "its formula: omit the extrapolation, or use the law tabulated"
        )
    return {
        name: model.extrapolated(extrapolation) if model.name == "tabulated" else model
        for name, model in found.items()
    }


def _bounded(
    found: Mapping[str, Model], bounds: Mapping[str, tuple[float, float]]
) -> dict[str, Model]:
    """Models with the bounds of their parameters."""
    known = {
        given
        for part, model in found.items()
        for name in model.parameters
        for given in (name, f"{part} {name}")
    }
    of_bending = [m for part, m in found.items() if part.startswith("bending")]
    laws = [m for m in found.values() if m not in of_bending] or of_bending
    for name in bounds:
        if name not in known:
            of = " or ".join(dict.fromkeys(model.name for model in laws))
            names = dict.fromkeys(p for model in laws for p in model.parameters)
            raise ValueError(
                f"the law {of} has no parameter {name!r}: choose one of "
                f"{', '.join(names)}"
            )
    return {
        part: model.bounded(
            {
                name.removeprefix(f"{part} "): ends
                for name, ends in bounds.items()
                if name.removeprefix(f"{part} ") in model.parameters
            }
        )
        for part, model in found.items()
    }


def _largest_strain(tests: Sequence[Strip | BiaxialCurve], part: str) -> float:
    """Largest strain of the families of a part; an error without strain or force."""
    families = families_of(part)
    along = {i: [x for t in tests if (x := t.along(i))] for i in families}
    largest = max(float(x.strain.max()) for each in along.values() for x in each)
    if not largest > 0:
        names = " or ".join(FAMILIES[i] for i in families)
        raise ValueError(f"no test contains a positive strain of the {names}")
    for i, each in along.items():
        if not sum(float(x.force.sum()) for x in each) > 0:
            raise ValueError(
                f"the forces along the {FAMILIES[i]} must be positive in tension: "
                "reverse the sign of the column"
            )
    return largest


def reach(specimen: Specimen, up_to: float | None) -> float:
    """Largest fitted shear angle of a specimen in radians."""
    return float(specimen.angle[specimen.used(up_to)].max())


def largest_argument(tests: Sequence[Test], part: str, up_to: float | None) -> float:
    """Largest shear angle, strain or curvature of the data of a part."""
    if part == "shear":
        return max(reach(one, up_to) for one in of_kind(tests, Specimen))
    if part.startswith("bending"):
        return max(map(_largest_curvature, in_bending(tests_of(tests, part))))
    along = (t.along(FAMILIES.index(part)) for t in in_tension(tests))
    return max(float(one.strain.max()) for one in along if one)


def _refuse_angles(specimen: Specimen, used: ndarray, up_to: float | None) -> None:
    name, end = specimen.name, np.degrees(specimen.test.largest_angle)
    angles = np.degrees(specimen.angle[np.isfinite(specimen.angle)])
    if specimen.measured_angle is not None and np.any(angles > end * (1 + ROUNDING)):
        raise ValueError(
            f"{name}: shear angles reach {angles.max():.4g} degrees, but the test ends "
            f"at {end:.4g} degrees: check their unit"
        )
    if np.any(used & (specimen.angle > 0)):
        return
    last = np.degrees(specimen.last_angle(up_to))
    message = (
        f"the angles range from {angles.min():.3g} to {angles.max():.3g} degrees"
        if angles.size
        else "all displacements are beyond the end of the test: check their unit"
    )
    raise ValueError(
        f"{name}: no shear angle is between 0 and {last:.3g} degrees: {message}"
    )


def _refuse_forces(specimen: Specimen, used: ndarray) -> None:
    force = specimen.force[used]
    if force.size > 1 and np.ptp(force) == 0:
        raise ValueError(
            f"{specimen.name}: the force is {force[0]:g} N at every point, but it must "
            "change with the shear angle"
        )
    if not force.sum() > 0:
        raise ValueError(
            f"{specimen.name}: the forces must be positive in tension: reverse the "
            "sign of the column"
        )
