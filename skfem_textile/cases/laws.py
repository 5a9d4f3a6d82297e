"""Tables of a case file for the laws of a fabric."""

from collections.abc import Collection
from typing import Any, get_args

import numpy as np

from ..fabric import Fabric, TwoLaws
from . import schema
from .write import tables_of


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
    if np.ndim(getattr(law, "stiffness", 0.0)):
        return {}
    for table in {*get_args(schema.TensionLaw), *get_args(schema.ShearLaw)}:
        if table.keys and type(law) is table.implementation():
            return tables_of(table.of(law))
    return {}
