"""Fabrics as JSON, without loss: laws by the names of their classes."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from ... import fabric as laws_of_package
from ...fabric import Fabric, TwoLaws
from ...fabric.directions.curve import AlongCurve
from ...fabric.regions import RegionalDirection, RegionalLaw, RegionalTensions
from ...mesh.checks import MeshError
from ...mesh.user_input import excerpt
from .fabric_of_deck import FabricOfFile

_FORMAT = "skfem_textile fabric 1"

# Regional laws and directions hold arrays, which are lists in the file.
_REGIONAL = {c.__name__: c for c in (RegionalLaw, RegionalTensions, RegionalDirection)}

_LAWS: dict[str, Any] = {
    **{
        name: kind
        for name in laws_of_package.__all__
        if is_dataclass(kind := getattr(laws_of_package, name)) and name != "Fabric"
    },
    **_REGIONAL,
    "AlongCurve": AlongCurve,
}


def text_of(fabric: Fabric) -> str:
    """The fabric as JSON.

    Raises
    ------
    ValueError
        If it has a law of another class than the package's, or a direction that is a
        function.
    """
    tensions = fabric.tensions
    tension: Any = tensions
    if isinstance(tensions, TwoLaws):
        tension = {"warp": tensions.warp, "weft": tensions.weft}
    parts = {"tension": tension, "shear": fabric.shear_law}
    parts |= {family.name: family.direction for family in fabric.families}
    encoded = {name: _encoded(name, part) for name, part in parts.items()}
    return json.dumps({"format": _FORMAT} | encoded, indent=1, allow_nan=False) + "\n"


def _encoded(name: str, value: Any) -> Any:
    if isinstance(value, ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_encoded(name, one) for one in value]
    if isinstance(value, dict):
        return {key: _encoded(f"{name} of {key}", one) for key, one in value.items()}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    kind = type(value).__name__
    if _LAWS.get(kind) is type(value):
        own = {f.name: _encoded(name, getattr(value, f.name)) for f in fields(value)}
        return {"kind": kind} | own
    if callable(value):
        raise ValueError(
            f"{name} is a function, which no file holds: evaluate it in each element "
            "with directions_of, or take AlongCurve"
        )
    raise ValueError(f"{name}: {kind} is no law of the package, which no file holds")


def read(content: bytes) -> FabricOfFile:
    """Read a fabric from JSON.

    Raises
    ------
    MeshError
        If it is no such file, or describes no fabric.
    """
    try:
        found = json.loads(content.decode("utf-8"), parse_constant=_refuse_constant)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError):
        raise MeshError("it is no JSON in UTF-8") from None
    if not isinstance(found, Mapping) or found.get("format") != _FORMAT:
        raise MeshError(f"it does not state the format {_FORMAT!r}")
    names = ("tension", "shear", "warp", "weft")
    if set(found) - {"format"} != set(names):
        raise MeshError(f"it must have {', '.join(names)}, and nothing else")
    try:
        decoded = {name: _decoded(found[name]) for name in names}
        tension = found["tension"]
        if isinstance(tension, Mapping) and "kind" not in tension:
            if set(tension) != {"warp", "weft"}:
                raise MeshError("tension must be a law, or one of warp and one of weft")
            decoded["tension"] = tuple(decoded["tension"][k] for k in ("warp", "weft"))
        for name in ("warp", "weft"):
            if isinstance(decoded[name], tuple):
                decoded[name] = np.array(decoded[name], dtype=float)
        return FabricOfFile(Fabric(**decoded), ())
    except MeshError:
        raise
    except (ValueError, TypeError, OverflowError, AttributeError, KeyError) as error:
        raise MeshError(excerpt(str(error)) or "it describes no fabric") from None


def _refuse_constant(word: str) -> Any:
    raise MeshError(f"{word} is no finite number")


def _decoded(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_decoded(one) for one in value)
    if not isinstance(value, Mapping):
        return value
    if "kind" not in value:
        return {key: _decoded(one) for key, one in value.items()}
    kind = _LAWS.get(value["kind"]) if isinstance(value["kind"], str) else None
    if kind is None:
        raise MeshError(f"there is no law {excerpt(str(value['kind']))!r}")
    own = {key: _decoded(one) for key, one in value.items() if key != "kind"}
    if other := set(own) - {f.name for f in fields(kind)}:
        raise MeshError(f"{kind.__name__} has no parameter {excerpt(min(other))!r}")
    if "region" in own:
        own["region"] = np.array(own["region"], dtype=int)
    if isinstance(own.get("stiffness"), tuple) and kind.__name__ in ("Linear", "Sin2"):
        own["stiffness"] = np.array(own["stiffness"], dtype=float)
    if "directions" in own:
        own["directions"] = [
            np.array(d, dtype=float) if isinstance(d, tuple) else d
            for d in own["directions"]
        ]
    return kind(**own)
