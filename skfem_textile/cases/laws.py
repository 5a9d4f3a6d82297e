"""Tables of a case file for the laws of a fabric."""

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from ..fabric import (
    CrimpToe,
    Fabric,
    Linear,
    Locking,
    Polynomial,
    Sin2,
    TwoLaws,
)
from . import schema
from .write import tables_of

# Tables of laws by class.
_TABLES: dict[type[Any], Callable[[Any], schema.Law]] = {
    Linear: lambda law: schema.Linear(stiffness_N_per_mm=law.stiffness),
    Sin2: lambda law: schema.Sin2(stiffness_N_per_mm=law.stiffness),
    Locking: lambda law: schema.Locking(
        stiffness_N_per_mm=law.stiffness,
        locking_angle_deg=float(np.degrees(law.angle)),
    ),
    Polynomial: lambda law: schema.Polynomial(
        coefficients_N_per_mm=tuple(law.coefficients),
        variable="sine" if law.sine else "angle",
        continuation="odd" if law.odd else "none",
    ),
    CrimpToe: lambda law: schema.CrimpToe(
        stiffness_N_per_mm=law.stiffness,
        toe=law.toe,
        initial_stiffness_N_per_mm=law.initial_stiffness,
    ),
}


def fabric_tables(fabric: Fabric, tables: Collection[str], file: str) -> dict[str, Any]:
    """Tables of a case file with the numbers of laws, or with the file of the fabric.

    Parameters
    ----------
    fabric
        The fabric.
    tables
        Names of the tables: ``tension``, ``shear`` or ``bending``.
    file
        File of the fabric, for laws that no table contains, such as tabulated ones.
    """
    tensions, found = fabric.tensions, {}
    if "tension" in tables:
        if not isinstance(tensions, TwoLaws):
            return {"fabric": {"file": file}}
        found["tension"] = _table(tensions.warp)
        if found["tension"] and tensions.weft != tensions.warp:
            found["tension"]["weft"] = _table(tensions.weft)
    if "shear" in tables:
        found["shear"] = _table(fabric.shear_law)
    if "bending" in tables:
        stiffnesses = *fabric.bending, fabric.twist
        keys = "warp_N_mm", "weft_N_mm", "twist_N_mm"
        found["bending"] = {}
        if not any(np.ndim(one) for one in stiffnesses):
            found["bending"] = dict(zip(keys, map(float, stiffnesses), strict=True))
    complete = all(one and one.get("weft", True) for one in found.values())
    return found if complete else {"fabric": {"file": file}}


def _table(law: Any) -> dict[str, Any]:
    """Table of a law with its numbers; empty if there is none for its class."""
    declared = _TABLES.get(type(law))
    if declared is None or np.ndim(getattr(law, "stiffness", 0.0)):
        return {}
    return tables_of(declared(law))
