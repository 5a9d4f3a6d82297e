"""Fabrics as `*FABRIC` of Abaqus: points of their laws."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy import ndarray

from ...fabric import Fabric, Law, Linear, Tabulated, TensionOnly, TwoLaws
from ...fabric.law import domain_of

# Points of a law that is no table: a straight line between two of a parabola is off by
# a millionth of its largest value.
_N_POINTS = 1001

# Strain and angle up to which laws are written that do not tell.
_STRAIN, _ANGLE = 0.1, np.radians(80.0)

# Shear and fibres in the order of Abaqus: fill, warp, shear.
_COMPONENTS = (("1", 1), ("2", 0), ("SHEAR", 2))


def material_of(fabric: Fabric, thickness: float, name: str) -> str:
    """A material of Abaqus with the laws of a fabric.

    Raises
    ------
    ValueError
        If a tension takes the strain of both families, fibres resist bending, there is
        a wrinkling angle, or a law differs from element to element, which *FABRIC
        cannot say.
    """
    if not isinstance(fabric.tensions, TwoLaws):
        raise ValueError("*FABRIC has no law of both fibre strains; write a .json")
    if fabric.bends:
        raise ValueError("*FABRIC has no bending or twist stiffness; write a .json")
    if np.any(np.not_equal(fabric.wrinkling_angle, Fabric.wrinkling_angle)):
        raise ValueError("*FABRIC has no wrinkling angle; write a .json")
    if fabric.at() is not fabric:
        raise ValueError("*FABRIC is the same in every element; write a .json")
    lines = [f"*MATERIAL, NAME={name}", "*FABRIC"]
    for word, number in _COMPONENTS:
        lines.append(f"*UNIAXIAL, COMPONENT={word}")
        lines += _component(fabric.laws[number], word == "SHEAR", thickness)
    return "\n".join([*lines, ""])


def _component(law: Law, shear: bool, thickness: float) -> Iterator[str]:
    inner, tension = law, ""
    if isinstance(law, TensionOnly):
        inner, tension = law.law, ", DIRECTION=TENSION"
    x, y, beyond = _points(inner, _ANGLE if shear else _STRAIN)
    if tension:
        y = np.where(x < 0, 0.0, y)
        x, y = x[x >= 0], y[x >= 0]
    if shear:
        strain, stress = -x[::-1], -y[::-1] / thickness
    else:
        strain, stress = np.expm1(x), y / (thickness * np.exp(x))
    yield f"*LOADING DATA, TYPE=ELASTIC{tension}{beyond}"
    for s, e in zip(stress.tolist(), strain.tolist(), strict=True):
        yield f"{s!r}, {e!r}"


def _points(law: Any, reach: float) -> tuple[ndarray, ndarray, str]:
    """Arguments and values of a law, and what Abaqus is told of those beyond."""
    if isinstance(law, Tabulated):
        x, y = law.points
        beyond = ", EXTRAPOLATION=LINEAR" if law.extrapolation == "linear" else ""
        return x, y, beyond
    if isinstance(law, Linear):
        x = np.array([-reach, 0.0, reach])
        return x, law.value(x), ", EXTRAPOLATION=LINEAR"
    ends = domain_of(law)
    if np.isfinite(ends).any():  # where there may be a pole
        ends = getattr(law, "shown", None) or ends
    low, high = max(float(ends[0]), -reach), min(float(ends[1]), reach)
    x = np.linspace(low, high, _N_POINTS)
    x[np.abs(x).argmin()] = 0.0
    return x, law.value(x), ""
