"""Lossless JSON serialisation of laws and fabrics, with laws by class name."""

import json
import os
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.user_input import errors_in, excerpt, printable
from .directions import AlongCurve
from .fabric import Fabric
from .law import BiaxialLaw, Law, Linear, TwoLaws
from .laws.bending import Bilinear
from .laws.biaxial import CrimpedYarns, CrimpInterchange, Softening
from .laws.friction import WithFriction
from .laws.polynomial import Polynomial
from .laws.shear import Locking, Sin2, TangentShear
from .laws.tabulated import Tabulated
from .laws.tension import Asymmetric, CrimpToe, Pretensioned, TensionOnly
from .origin import Origin, SpecimenLaw
from .regions import RegionalDirection, RegionalLaw, RegionalTensions

_FORMAT = "skfem_textile fabric 1"

# Required keys of a fabric file, and optional keys for values other than the default.
_PARTS = "tension", "shear", "warp", "weft"
_OTHERS = "bending", "twist", "wrinkling_angle"

_LAWS: tuple[type[Any], ...] = (
    *(Linear, Sin2, Polynomial, Locking, Tabulated, TangentShear),
    *(CrimpToe, TensionOnly, Asymmetric, Pretensioned, CrimpInterchange, CrimpedYarns),
    *(Bilinear, TwoLaws, RegionalLaw, RegionalTensions, WithFriction),
)

# Classes in a file: laws, their components, directions, and the origin of the laws.
_KINDS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        *(*_LAWS, Softening, RegionalDirection, AlongCurve),
        *(Origin, SpecimenLaw),
    )
}


def law_to_json(law: Law | BiaxialLaw) -> dict[str, Any]:
    """Law as JSON content: its ``kind``, which is its class, and its parameters.

    Raises
    ------
    ValueError
        If it contains a law of a class outside the package.

    Examples
    --------
    >>> law_to_json(Linear(0.5))
    {'kind': 'Linear', 'stiffness': 0.5}
    """
    encoded = _encoded("law", law)
    if not isinstance(encoded, dict):
        raise ValueError(
            f"{type(law).__name__} is not a law of skfem_textile and cannot be written"
        )
    return encoded


def law_of_json(content: Any) -> Any:
    """Law described by `law_to_json`.

    Raises
    ------
    ValueError
        If the content does not describe a law.
    """
    law = _described("law", lambda: _decoded(content))
    if not isinstance(law, _LAWS):
        raise ValueError(
            "a law must be an object whose key 'kind' is the name of a law"
        )
    return law


def write_law(law: Law | BiaxialLaw, path: str | os.PathLike[str]) -> None:
    """Write a law as JSON; raises the errors of `law_to_json` and of writing.

    Examples
    --------
    >>> write_law(Polynomial((0.1, 0.0, 0.6)), "law.json")
    >>> read_law("law.json").coefficients
    (0.1, 0.0, 0.6)
    """
    Path(path).write_text(_text(law_to_json(law)), encoding="utf-8")


def read_law(path: str | os.PathLike[str]) -> Any:
    """Law of a JSON file.

    Raises
    ------
    ValueError
        If the file does not describe a law; one line names the file.
    OSError
        If it cannot be read.
    """
    with errors_in(f"{printable(path)}: "):
        return law_of_json(_content(Path(path).read_bytes()))


def fabric_text(fabric: Fabric, origin: Origin | None = None) -> str:
    """Fabric as JSON, with the origin of its laws if it is known.

    Raises
    ------
    ValueError
        If it contains a law of a class outside the package, or a direction that is a
        function.
    """
    tensions = fabric.tensions
    tension: Any = tensions
    if isinstance(tensions, TwoLaws):
        tension = {"warp": tensions.warp, "weft": tensions.weft}
    parts = {"tension": tension, "shear": fabric.shear_law}
    parts |= {family.name: family.direction for family in fabric.families}
    encoded = {name: _encoded(name, part) for name, part in parts.items()}
    for name in _OTHERS:
        value = _encoded(name, getattr(fabric, name))
        if value != _encoded(name, getattr(Fabric, name)):
            encoded[name] = value
    if origin is not None:
        encoded["origin"] = _encoded("origin", origin)
    if fabric.yarns is not None:
        encoded["yarns"] = asdict(fabric.yarns)
    return _text({"format": _FORMAT} | encoded)


def fabric_of_text(content: bytes) -> tuple[Fabric, Origin | None]:
    """Fabric described by `fabric_text`, in UTF-8, and the origin of its laws.

    Raises
    ------
    ValueError
        If the text does not describe a fabric.
    """
    parts = _content(content)
    if not isinstance(parts, Mapping) or parts.get("format") != _FORMAT:
        raise ValueError(f"the key 'format' must be {_FORMAT!r}")
    optional = *_OTHERS, "yarns", "origin"
    if set(parts) - {"format", *optional} != set(_PARTS):
        raise ValueError(
            f"the keys must be {', '.join(_PARTS)} and, optionally, "
            f"{', '.join(optional[:-1])} and origin"
        )
    return _described("fabric", lambda: (_fabric(parts), _origin(parts.get("origin"))))


def _origin(content: Any) -> Origin | None:
    origin = _decoded(content)
    if not (origin is None or isinstance(origin, Origin)):
        raise ValueError("origin must be an object of the kind Origin")
    return origin


def _fabric(content: Mapping[str, Any]) -> Fabric:
    apart = "format", "origin"
    decoded = {name: _decoded(content[name]) for name in content if name not in apart}
    tension = content["tension"]
    if isinstance(tension, Mapping) and "kind" not in tension:
        if set(tension) != {"warp", "weft"}:
            raise ValueError(
                "tension must be a law, or an object with one law for warp and one "
                "for weft"
            )
        decoded["tension"] = tuple(decoded["tension"][k] for k in ("warp", "weft"))
    for name in ("warp", "weft"):
        if isinstance(decoded[name], tuple):
            decoded[name] = np.array(decoded[name], dtype=float)
    if "yarns" in decoded:
        from .yarns import Yarns

        decoded["yarns"] = Yarns(**decoded["yarns"])
    return Fabric(**decoded)


def _described(what: str, make: Any) -> Any:
    """Object built from the content of a file; exceptions become input errors."""
    try:
        return make()
    except (ValueError, TypeError, OverflowError, AttributeError, KeyError) as error:
        raise ValueError(
            printable(error) or f"the content does not describe a {what}"
        ) from None


def _text(content: Any) -> str:
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def _content(content: bytes) -> Any:
    try:
        return json.loads(content.decode("utf-8"), parse_constant=_refuse_constant)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError):
        raise ValueError("the content is not JSON in UTF-8") from None


def _refuse_constant(word: str) -> Any:
    raise ValueError(f"{word} is not a finite number")


def _encoded(name: str, value: Any) -> Any:
    if isinstance(value, ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_encoded(name, one) for one in value]
    if isinstance(value, Mapping):
        return {key: _encoded(f"{name} of {key}", one) for key, one in value.items()}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    kind = type(value).__name__
    if _KINDS.get(kind) is type(value):
        items = {f.name: _encoded(name, getattr(value, f.name)) for f in fields(value)}
        return {"kind": kind} | items
    if callable(value):
        raise ValueError(
            f"{name} is a function, which cannot be written: evaluate it in each "
            "element with directions_of, or use AlongCurve"
        )
    raise ValueError(
        f"{name}: {kind} is not a law of skfem_textile and cannot be written"
    )


def _decoded(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_decoded(one) for one in value)
    if not isinstance(value, Mapping):
        return value
    if "kind" not in value:
        return {key: _decoded(one) for key, one in value.items()}
    kind = _KINDS.get(value["kind"]) if isinstance(value["kind"], str) else None
    if kind is None:
        raise ValueError(f"unknown law {excerpt(str(value['kind']))!r}")
    arguments = {key: _decoded(one) for key, one in value.items() if key != "kind"}
    if other := set(arguments) - {f.name for f in fields(kind)}:
        raise ValueError(f"{kind.__name__} has no parameter {excerpt(min(other))!r}")
    needed = (f for f in fields(kind) if f.default is f.default_factory is MISSING)
    if missing := {f.name for f in needed} - set(arguments):
        raise ValueError(f"{kind.__name__} requires the parameter {min(missing)!r}")
    if "region" in arguments:
        arguments["region"] = np.array(arguments["region"], dtype=int)
    if isinstance(arguments.get("stiffness"), tuple) and kind in (Linear, Sin2):
        arguments["stiffness"] = np.array(arguments["stiffness"], dtype=float)
    if "directions" in arguments:
        arguments["directions"] = [
            np.array(d, dtype=float) if isinstance(d, tuple) else d
            for d in arguments["directions"]
        ]
    return kind(**arguments)
