"""Laws and fabrics in JSON files: a law by its class and its parameters."""

import json
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..mesh.user_input import excerpt, printable
from .fabric import Fabric
from .law import BiaxialLaw, Law, Linear, TwoLaws
from .laws.crimp_interchange import CrimpInterchange
from .laws.crimp_toe import CrimpToe
from .laws.locking import Locking
from .laws.one_sided import Asymmetric, TensionOnly
from .laws.polynomial import Polynomial
from .laws.pretensioned import Pretensioned
from .laws.sin2 import Sin2
from .laws.tabulated import Tabulated

_CLASSES: tuple[type[Any], ...] = (
    *(Linear, Sin2, Polynomial, Locking, Tabulated),
    *(CrimpToe, TensionOnly, Asymmetric, Pretensioned, CrimpInterchange),
)
_BY_NAME = {one.__name__: one for one in _CLASSES}

# Parts of a fabric in its file.
_PARTS = "tension", "shear", "warp", "weft"


def law_to_json(law: Law | BiaxialLaw) -> dict[str, Any]:
    """A law as JSON has it: ``name``, that of its class, and its parameters.

    Raises
    ------
    ValueError
        If it is no law of the library, or differs from element to element.

    Examples
    --------
    >>> law_to_json(Polynomial((0.1, 0.0, 0.6)))["coefficients"]
    [0.1, 0.0, 0.6]
    """
    if not (is_dataclass(law) and type(law) in _CLASSES):
        raise ValueError(
            f"{type(law).__name__} is no law of the library: keep its code"
        )
    own = {field.name: getattr(law, field.name) for field in fields(law)}
    return {"name": type(law).__name__} | {k: _plain(v) for k, v in own.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        raise ValueError("a law that differs from element to element has no file")
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    if isinstance(value, bool | str):
        return value
    law: Any = value
    return law_to_json(law) if is_dataclass(value) else float(value)


def law_of_json(content: Any) -> Any:
    """The law that `law_to_json` described.

    Raises
    ------
    ValueError
        If the content is no such law.
    """
    if not isinstance(content, Mapping) or "name" not in content:
        raise ValueError("a law is an object with the 'name' of a law")
    name = content["name"]
    if not isinstance(name, str) or name not in _BY_NAME:
        raise ValueError(f"law {name!r} is none of {', '.join(_BY_NAME)}")
    given = {
        key: law_of_json(value) if isinstance(value, Mapping) else value
        for key, value in content.items()
        if key != "name"
    }
    known = {field.name for field in fields(_BY_NAME[name])}
    if unknown := sorted(set(given) - known):
        raise ValueError(f"{name} has no parameter {unknown[0]!r}")
    try:
        return _BY_NAME[name](**given)
    except TypeError as error:  # one is missing
        raise ValueError(f"{name}: {error}") from None


def write_law(law: Law | BiaxialLaw, path: str | os.PathLike[str]) -> None:
    """Write a law as JSON; raises what `law_to_json` and writing raise."""
    _write(law_to_json(law), path)


def read_law(path: str | os.PathLike[str]) -> Any:
    """The law of a JSON file.

    Raises
    ------
    ValueError
        If the file has no law; one line names the file.
    OSError
        If it cannot be read.
    """
    try:
        return law_of_json(_read(path))
    except ValueError as error:
        raise ValueError(f"{printable(path)}: {error}") from None


def write_fabric(fabric: Fabric, path: str | os.PathLike[str]) -> None:
    """Write a fabric as JSON, from which `read_fabric` makes the same one.

    Parameters
    ----------
    fabric
        A fabric with laws of the library and constant directions.
    path
        Where to.

    Raises
    ------
    ValueError
        If a law is none of the library, or a law or a direction differs from place to
        place.
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> file = Path(tempfile.mkdtemp()) / "fabric.json"
    >>> write_fabric(Fabric(1e5, Sin2(0.5)), file)
    >>> read_fabric(file).shear_law
    Sin2(stiffness=0.5)
    """
    laws: Any = fabric.tensions
    pair = [f.tension for f in fabric.families] if isinstance(laws, TwoLaws) else None
    tension = law_to_json(laws) if pair is None else [law_to_json(one) for one in pair]
    directions = {}
    given: dict[str, Any] = {"warp": fabric.warp, "weft": fabric.weft}
    for name, direction in given.items():
        if callable(direction) or np.shape(direction) != (2,):
            raise ValueError(f"{name} differs from place to place, and has no file")
        directions[name] = [float(x) for x in np.asarray(direction)]
    shear = law_to_json(fabric.shear_law)
    _write({"tension": tension, "shear": shear, **directions}, path)


def read_fabric(path: str | os.PathLike[str]) -> Fabric:
    """The fabric of a file of `write_fabric`.

    Raises
    ------
    ValueError
        If the file has no fabric; one line names the file.
    OSError
        If it cannot be read.
    """
    try:
        content = _read(path)
        if not isinstance(content, Mapping) or set(content) != set(_PARTS):
            raise ValueError(f"a fabric is an object of {', '.join(_PARTS)}")
        tension = content["tension"]
        several = isinstance(tension, list)
        laws = tuple(map(law_of_json, tension)) if several else law_of_json(tension)
        shear = law_of_json(content["shear"])
        return Fabric(laws, shear, content["warp"], content["weft"])
    except ValueError as error:
        raise ValueError(f"{printable(path)}: {error}") from None


def _write(content: Any, path: str | os.PathLike[str]) -> None:
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    Path(path).write_text(text, encoding="utf-8")


def _read(path: str | os.PathLike[str]) -> Any:
    try:
        return json.loads(Path(path).read_bytes())
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"no JSON: {excerpt(str(error))}") from None
