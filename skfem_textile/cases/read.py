"""Declaration of a case from a file or plain values, validated key by key."""

import datetime
import math
import os
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Struct

from ..declarations.scenes import GRADED, AnyScene, WithTools
from ..declarations.words import unquoted
from ..mesh.user_input import errors_in, excerpt, printable
from .phases import PhaseTable, ToolInPhase, furthest
from .scenes import SCENES
from .scenes import AnyScene as SceneTable
from .schema import (
    MESH_KINDS,
    AnyFormulation,
    Bending,
    BendingOfFamily,
    Clamp,
    FabricOfFile,
    InCompression,
    Loads,
    Mesh,
    Output,
    PlyTable,
    Region,
    Shear,
    Stepping,
    Tension,
    Weft,
)
from .tables import (
    FILE,
    Table,
    about,
    named,
    tag_of,
)
from .tools import AnyTool

# Limit on the size of a case file; larger ones take long to read.
_MOST_BYTES = 1_000_000

# Types that a case file can contain.
_HELD = (Mapping, list, tuple, str, int, float, datetime.date, datetime.time, NoneType)

# Names of the types of msgspec in messages.
_KINDS = {
    "object": "a table",
    "array": "an array",
    "float": "a number",
    "int": "an integer",
    "str": "text",
    "bool": "true or false",
    "date": "a date",
    "datetime": "a date",
    "time": "a time",
}

# Laws by the suffix of a file.
_OF_FILES = {".csv": "FILE.csv", ".json": "FILE.json"}


class CaseFile(Table):
    """All tables of a case."""

    scene: SceneTable
    mesh: Mesh
    fabric: FabricOfFile
    tension: Tension
    shear: Shear
    bending: Bending
    formulation: AnyFormulation
    loads: Loads
    stepping: Stepping
    output: Output
    tools: tuple[AnyTool, ...]
    phases: tuple[PhaseTable, ...]
    clamps: tuple[Clamp, ...]
    plies: tuple[PlyTable, ...]
    regions: dict[str, Region]
    vary: Annotated[
        dict[str, tuple[Any, ...]],
        about("values of any key, such as scene.fibres_deg = [0, 45], for a sweep"),
    ]


class CaseFileError(ValueError):
    """Case file that cannot be read or does not describe a case."""


def read_tables(path: Path) -> dict[str, Any]:
    """Read the tables of a case file.

    Raises
    ------
    CaseFileError
        If it is not valid TOML.
    OSError
        If it cannot be read.
    """
    with open(path, "rb") as file:
        data = file.read(_MOST_BYTES + 1)
    with errors_in(f"{printable(path)}: ", CaseFileError):
        if len(data) > _MOST_BYTES:
            raise ValueError(f"a case file may contain at most {_MOST_BYTES} bytes")
        return _toml(data)


def _toml(data: bytes) -> dict[str, Any]:
    try:
        return tomllib.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise ValueError("the file is not a text file in UTF-8") from None
    except RecursionError:
        raise ValueError("arrays or tables are nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"the file is not valid TOML: {printable(error)}") from None


def declared(
    tables: Mapping[str, Any], folder: str | os.PathLike[str] = "."
) -> CaseFile:
    """Declaration of a case.

    Parameters
    ----------
    tables
        The tables of a case file; missing keys take their defaults.
    folder
        Folder to which file names are relative.

    Raises
    ------
    CaseFileError
        If a key is unknown or missing, or a value has the wrong type; the message is
        one line and names the key.
    """
    try:
        with errors_in("", CaseFileError):
            case = _case(tables)
    except RecursionError:
        raise CaseFileError("tables are nested too deeply") from None
    return with_files(case, partial(_found, folder))


def _case(tables: Any) -> CaseFile:
    """Validated declaration of a case, with file names as stated."""
    if not isinstance(tables, Mapping):
        raise ValueError(f"a case must be a table of tables, not {_quoted(tables)}")
    _refuse_values("", tables)
    scene = _scene_of(tables.get("scene", {}))
    regions = tables.get("regions", {})
    if not isinstance(regions, dict):
        raise ValueError(f"regions must be a table, not {_quoted(regions)}")
    arrays = {name: _array(name, tables.get(name, []), scene) for name in ARRAYS}
    filled = _with_defaults(_for_phases(tables, arrays["phases"]), scene)
    none: dict[str, Any] = {**dict.fromkeys(ARRAYS, ()), "regions": {}, "vary": {}}
    case = converted("", {**filled, **none}, CaseFile)
    built = {
        name: converted(
            f"regions.{printable(name)}", _laws_nested(region, Region, scene), Region
        )
        for name, region in regions.items()
    }
    vary = varied(tables.get("vary", {}))
    return msgspec.structs.replace(case, vary=vary, regions=built, **arrays)


def _array(name: str, tables: Any, scene: type[AnyScene]) -> tuple[Any, ...]:
    """Validated tables of an array of tables."""
    if not isinstance(tables, list | tuple):
        raise ValueError(
            f"{name} must be an array of tables, [[{name}]], not {_quoted(tables)}"
        )
    if name == "plies":
        tables = [_laws_nested(table, PlyTable, scene) for table in tables]
    built = _phase if name == "phases" else partial(converted, kind=ARRAYS[name])
    return tuple(built(_named(name, i, x), x) for i, x in enumerate(tables, 1))


def _found(folder: str | os.PathLike[str], path: str, name: str) -> str:
    """File relative to a folder, or the file of a fabric of the catalogue."""
    of_fabric = path == "fabric.file" or path.endswith(".fabric")
    if not of_fabric or Path(name).suffix:
        return str(Path(folder) / name)
    from ..fabric.catalogue import file_of  # needed for few cases

    with errors_in(f"{path} ", CaseFileError):
        return str(file_of(name))


def with_files(table: Any, path_of: Callable[[str, str], str], where: str = "") -> Any:
    """Table with other file names.

    Parameters
    ----------
    table
        A table of a case, or the whole case.
    place
        Function of the dotted path of the key and the old name that returns the new
        name.
    where
        The path of the table.
    """
    changed: dict[str, Any] = {}
    hints = get_type_hints(type(table), include_extras=True)
    for name in table.__struct_fields__:
        value = getattr(table, name)
        path = f"{where}.{name}" if where and name != "law" else where or name
        if isinstance(value, Struct):
            changed[name] = with_files(value, path_of, path)
        elif name in ARRAYS and isinstance(value, tuple):
            changed[name] = tuple(
                with_files(one, path_of, numbered(name, number))
                for number, one in enumerate(value, 1)
            )
        elif name == "regions":
            changed[name] = {
                region: with_files(table_of_region, path_of, f"region_{number}")
                for number, (region, table_of_region) in enumerate(value.items(), 1)
            }
        elif FILE in get_args(hints[name]) and value is not None:
            if name == "source" and value in MESH_KINDS:
                continue
            changed[name] = (
                path_of(path, value)
                if isinstance(value, str)
                else tuple(path_of(path, one) for one in value)
            )
    return msgspec.structs.replace(table, **changed)


def varied(table: Any, where: str = "vary") -> dict[str, tuple[Any, ...]]:
    """Values by the path of their key, of a table that may contain tables.

    Raises
    ------
    ValueError
        If they are not arrays of at least two different values.
    """
    if not isinstance(table, Mapping):
        raise ValueError(
            f"{where} must be an array of at least two different values, not "
            f"{_quoted(table)}"
        )
    values: dict[str, tuple[Any, ...]] = {}
    for key, of_key in table.items():
        path = f"{where}.{printable(key)}"
        if isinstance(of_key, list | tuple):
            if len({*map(_as_stated, of_key)}) < max(len(of_key), 2):
                raise ValueError(
                    f"{path} must be an array of at least two different values"
                )
            values[unquoted(path.removeprefix("vary."))] = tuple(of_key)
        else:
            values |= varied(of_key, path)
    return values


def _as_stated(value: Any) -> str:
    """Text of a value: 1 and 1.0 are the same, 1 and true are not."""
    whole = isinstance(value, float) and value.is_integer()
    return repr(int(value) if whole else value)


def with_value(tables: Mapping[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Tables of a case with another value of a key.

    Parameters
    ----------
    tables
        The tables, which remain as they are.
    path
        Table and key, such as ``stepping.steps``.  A table of an array, such as
        ``[[tools]]``, is selected by its name, or its number from 1; ``*`` selects all,
        and as ``phases.NAME.tools.*`` all tools in a phase.
    value
        The value.

    Raises
    ------
    ValueError
        If the path leads through a value, or there is no such table of an array.
    """
    first, rest = first_name(path, tables)
    if not rest:
        return {**tables, first: value}
    of_all: dict[str, Any] = {"*": {}, **tables}
    if first == "*" and all(isinstance(x, Mapping) for x in of_all.values()):
        return {name: with_value(x, rest, value) for name, x in of_all.items()}
    inner = tables.get(first, () if first in ARRAYS else {})
    if isinstance(inner, Mapping):
        return {**tables, first: with_value(inner, rest, value)}
    if not (
        isinstance(inner, list | tuple) and all(isinstance(x, dict) for x in inner)
    ):
        raise ValueError(f"{printable(first)} is a value, not a table")
    names = [str(one.get("name", i)) for i, one in enumerate(inner, 1)]
    name, key = first_name(rest, names)
    at = index_of(inner, name)
    every = name == "*" and inner
    if (at is None and not every) or not key:
        known = ", ".join(map(printable, names))
        found = f"but {known}: write {first}.NAME.KEY" if known else "which is empty"
        if not known and first == "tools" and _is_of_scene(key, tables.get("scene")):
            found = f"which is empty: write scene.{key} for the tools of the scene"
        one = "table" if name == "*" else f"table {printable(name)!r}"
        raise ValueError(f"there is no {one} in [[{first}]], {found}")
    changed = [
        with_value(one, key, value) if every or i == at else one
        for i, one in enumerate(inner)
    ]
    return {**tables, first: changed}


def _is_of_scene(key: str, scene: Any) -> bool:
    """True if a key is one of a table of a scene, which may be invalid."""
    name = scene.get("name") if isinstance(scene, Mapping) else None
    return key in getattr(SCENES.get(str(name)), "__struct_fields__", ())


def first_name(path: str, names: Iterable[str]) -> tuple[str, str]:
    """First name of a path, the longest of ``names``, which may contain dots; the rest.

    The part up to the first dot if the path begins with none of them.
    """
    known = [name for name in names if path.startswith(f"{name}.")]
    first = max(known, key=len, default=path.partition(".")[0])
    return first, path[len(first) + 1 :]


def index_of(tables: Sequence[Mapping[str, Any]], name: str) -> int | None:
    """Index of a table of an array by its name, or number from 1; None if missing."""
    names = [str(one.get("name")) for one in tables]
    names += map(str, range(1, len(tables) + 1))
    return names.index(name) % len(tables) if name in names else None


#: Kinds of the tables in arrays of tables, by the name of the array.
ARRAYS: dict[str, Any] = {
    "tools": AnyTool,
    "phases": PhaseTable,
    "clamps": Clamp,
    "plies": PlyTable,
}


def numbered(array: str, number: int) -> str:
    """Name in messages of a table of an array, such as ``tool_1`` of ``[[tools]]``."""
    one = array.removesuffix("s").replace("plie", "ply")
    return f"{one}_{number}"


def _named(array: str, number: int, table: Any) -> str:
    """Path of a table of an array by its name, or ``numbered``."""
    name = table.get("name") if isinstance(table, Mapping) else None
    named = isinstance(name, str) and name
    return f"{array}.{printable(name)}" if named else numbered(array, number)


def _phase(where: str, table: Any) -> PhaseTable:
    """Validated table of a phase; messages begin with ``where``."""
    tools = table.get("tools", {}) if isinstance(table, dict) else {}
    if not isinstance(tools, dict):
        raise ValueError(f"{where}.tools must be a table, not {_quoted(tools)}")
    if isinstance(table, dict):
        table = {**table, "tools": {}}
    phase: PhaseTable = converted(where, table, PhaseTable)
    built = {
        name: converted(f"{where}.tools.{printable(name)}", tool, ToolInPhase)
        for name, tool in tools.items()
    }
    return msgspec.structs.replace(phase, tools=built)


def _for_phases(
    tables: Mapping[str, Any], phases: tuple[PhaseTable, ...]
) -> Mapping[str, Any]:
    """Tables without steps, and with the travel of the punch by the phases."""
    scene, stepping = tables["scene"], tables.get("stepping", {})
    if not (phases and isinstance(stepping, dict)):
        return tables
    if stepping.get("steps") is not None:
        raise ValueError(
            "stepping.steps does not apply beside [[phases]], each of which states its "
            "own steps: omit it"
        )
    far, stated = furthest(phases, "punch"), scene.get("travel_mm")
    if far is not None and "travel_mm" in SCENES[scene["name"]].__struct_fields__:
        if stated not in (None, far):
            raise ValueError(
                f"scene.travel_mm is {_quoted(stated)}, but the phases move the punch, "
                f"by up to {far:g} mm: omit scene.travel_mm"
            )
        scene = {**scene, "travel_mm": far}
    return {**tables, "scene": scene, "stepping": {**stepping, "steps": None}}


def _refuse_values(where: str, value: Any) -> None:
    """Refuse objects that exist in Python only, and numbers that are not finite."""
    if not isinstance(value, _HELD):
        kind = "function" if callable(value) else type(value).__name__
        raise ValueError(
            f"{where} is a {kind}, which a case file cannot contain: pass it to Case"
        )
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{where} must be a finite number, got {value}")
    if isinstance(value, Mapping):
        for key, part in value.items():
            _refuse_values(f"{where}.{printable(key)}".lstrip("."), part)
    elif isinstance(value, list | tuple):
        for number, part in enumerate(value, 1):
            named = where in ARRAYS
            _refuse_values(_named(where, number, part) if named else where, part)


def _scene_of(table: Any) -> type[AnyScene]:
    if not isinstance(table, dict):
        raise ValueError(f"scene must be a table, not {_quoted(table)}")
    name = table.get("name")
    if not isinstance(name, str) or name not in SCENES:
        reason = "is missing" if name is None else f"is {_quoted(name)}"
        raise ValueError(f"scene.name {reason}: expected one of {', '.join(SCENES)}")
    return SCENES[name].declaration


# ---------------------------------------------------------------------------- defaults


def _with_defaults(tables: Mapping[str, Any], scene: type[AnyScene]) -> dict[str, Any]:
    """All tables, with the defaults of the scene for missing keys."""
    filled = {name: tables.get(name, {}) for name in CaseFile.__struct_fields__}
    filled |= tables
    if isinstance(filled["fabric"], dict) and filled["fabric"].get("file") is not None:
        for name in ("tension", "shear", "bending"):
            if filled[name]:
                raise ValueError(
                    f"[{name}] sets a law, but fabric.file contains all laws: omit one "
                    "of them; fabric.compression and fabric.in_compression add a law "
                    "in compression"
                )
    filled["mesh"] = _with_kind(filled["mesh"], scene)
    if isinstance(formulation := filled["formulation"], dict):
        name = "macro" if formulation else "auto"
        filled["formulation"] = {"name": name, **formulation}
    if isinstance(stepping := filled["stepping"], dict):
        filled["stepping"] = {"steps": scene.steps, **stepping}
    return _laws_nested(filled, CaseFile, scene)


def _with_kind(mesh: Any, scene: type[AnyScene]) -> Any:
    """The table of a mesh with its kind, and the defaults of this kind."""
    if not isinstance(mesh, dict):
        return mesh
    of_grid = {"size": scene.of_grid or scene.size, "jitter": scene.jitter, "seed": 1}
    kind = scene.kind
    if mesh.get("outline") is not None:
        kind = kind if issubclass(scene, WithTools) else GRADED
    elif {*of_grid, "directions"} & mesh.keys():
        kind = "irregular"
    mesh = {"source": kind, **mesh}
    if mesh["source"] == GRADED:
        return {"density": 1.0, **mesh}
    if mesh.get("outline") is not None:
        return {"size": of_grid["size"], **mesh}
    return {**of_grid, **mesh} if mesh["source"] in MESH_KINDS else mesh


# Tables that contain laws, or have other defaults in each scene.
_WITH_LAWS: dict[str, type[Struct]] = {
    "fabric": FabricOfFile,
    "tension": Tension,
    "weft": Weft,
    "in_compression": InCompression,
    "shear": Shear,
    "bending": Bending,
    "warp_law": BendingOfFamily,
    "weft_law": BendingOfFamily,
}


def _laws_nested(table: Any, kind: type[Struct], scene: type[AnyScene]) -> Any:
    """Table in which the keys of each law are nested below it, at any depth.

    A missing stiffness has the default of the scene.
    """
    if not isinstance(table, dict):
        return table
    if kind is Bending:
        of_scene = {
            f"{family}_N_mm": 0.0 if f"{family}_law" in table else scene.bending
            for family in ("warp", "weft")
        }
        table = of_scene | table
    has_law = "law" in kind.__struct_fields__
    if has_law and "file" in table:
        raise ValueError(
            "a table of a law has no key 'file': name the file by law = 'FILE.csv'"
        )
    own = _keys_beside_law(kind) if has_law else table.keys()
    outer = {
        key: _laws_nested(value, _WITH_LAWS[key], scene) if key in _WITH_LAWS else value
        for key, value in table.items()
        if key in own
    }
    if not has_law:
        return outer
    law: dict[str, Any] = {"law": "linear"}
    law |= {key: value for key, value in table.items() if key not in own}
    if isinstance(word := law["law"], str):
        if name := _OF_FILES.get(Path(word).suffix.lower()):
            law |= {"law": name, "file": word}
        known = named(get_type_hints(kind)["law"]).get(law["law"])
        if known and "stiffness_N_per_mm" in known.__struct_fields__:
            of_fibres, of_shear = scene.fibre_stiffness, scene.shear_stiffness
            stiffness = of_shear if kind is Shear else of_fibres
            law.setdefault("stiffness_N_per_mm", stiffness)
    return {**outer, "law": law}


def default_laws(tables: Mapping[str, Any]) -> tuple[str, ...]:
    """Names of the laws, tension and shear, that tables of a case leave out."""
    if tables.get("fabric", {}).get("file") is not None:
        return ()
    given = [tables, *tables.get("regions", {}).values(), *tables.get("plies", ())]
    kinds: dict[str, type[Struct]] = {"tension": Tension, "shear": Shear}
    return tuple(
        name
        for name, kind in kinds.items()
        if not any({*x.get(name, {})} - _keys_beside_law(kind) for x in given)
    )


def _keys_beside_law(kind: type[Struct]) -> set[str]:
    return {name for name in kind.__struct_fields__ if name != "law"}


# ------------------------------------------------------------------------------ checks


def converted(where: str, value: Any, kind: Any) -> Any:
    """Validated table; an error names the path of the key."""
    try:
        return msgspec.convert(value, kind)
    except (msgspec.ValidationError, OverflowError) as error:
        raise ValueError(_message(where, str(error), value, kind)) from None


def _message(where: str, message: str, value: Any, kind: Any) -> str:
    """Message of msgspec in terms of the file, with the path first."""
    text, at, json_path = message.rpartition(" - at ")
    text, json_path = (text, json_path) if at else (message, "")
    keys = re.findall(r"\.(\w+)", json_path)
    table, others = _type_at(keys, value, kind)
    # The key of a law is written in the table that contains the law.
    shown_keys = [k for i, k in enumerate(keys) if k != "law" or "law" in keys[:i]]
    path = ".".join([where, *shown_keys] if where else shown_keys)
    if unknown := re.match(r"Object contains unknown field `(.*)`", text, re.DOTALL):
        return _unknown(path, unknown[1], table, others)
    if missing := re.match(r"Object missing required field `(.*)`", text):
        return f"{path}.{missing[1]} is missing{_meaning(table, missing[1])}"
    if text.startswith("Invalid "):
        known = [*dict.fromkeys(_choices(table))]
        word = re.findall(r"Invalid (?:enum )?value (.*)", text, re.DOTALL)[0]
        return (
            f"{path} is {excerpt(word)}: expected one of "
            f"{', '.join(known)}{_nearest(word.strip(chr(39)), known)}"
        )
    text = text.replace(" | null", "").replace("Expected", "must be")
    text = re.sub(r"`(\w+)", lambda kind: _KINDS.get(kind[1], kind[1]), text)
    return printable(f"{path} {text.replace('`', '')}".strip())


def _type_at(keys: list[str], value: Any, kind: Any) -> tuple[Any, list[Any]]:
    """Type at a path, and for a table its alternatives.

    The alternatives of a law include the table in which its keys are written.
    """
    kind, others = _table_of(kind, value)
    for key in keys:
        if not _is_table(kind):
            break
        if key == kind.__struct_config__.tag_field:
            names = [tag_of(one) for one in others if _tag_field(one)]
            return Literal[tuple(names)], []
        around = [kind] if key == "law" else []
        value = value.get(key) if isinstance(value, dict) else None
        kind, others = _table_of(get_type_hints(kind).get(key), value)
        others = [*around, *others]
    return kind, others


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Struct)


def _table_of(kind: Any, value: Any) -> tuple[Any, list[Any]]:
    """The selected table of a union, and all tables of the union."""
    union = get_origin(kind) in (Union, UnionType)
    tables = [*filter(_is_table, get_args(kind) if union else (kind,))]
    if not tables:
        return kind, []
    name = value.get(_tag_field(tables[0])) if isinstance(value, dict) else None
    chosen = [table for table in tables if tag_of(table) == name]
    return (chosen or tables)[0], tables


def _tag_field(table: type[Struct]) -> str | None:
    return table.__struct_config__.tag_field


def _unknown(path: str, key: str, table: type[Struct], beside: list[Any]) -> str:
    """Message on an unknown key, which may belong to another choice."""
    tag = _tag_field(table)
    others = [tag_of(one) for one in beside if tag and key in one.__struct_fields__]
    if others:
        return f"{path}.{key} requires that {path}.{tag} is {' or '.join(others)}"
    around = [one for one in beside if _tag_field(one) is None]
    tables = dict.fromkeys([table, *around])
    known = [
        *([tag] if tag else []),
        *(f for one in tables for f in one.__struct_fields__ if f != "file" or not tag),
    ]
    known = [*dict.fromkeys(known)]
    near = _nearest(key, known) or f": allowed are {', '.join(known)}"
    place = f"{path} has no key" if path else "there is no table"
    return f"{place} '{excerpt(key)}'{near}"


def _meaning(table: type[Struct], key: str) -> str:
    """Meaning of a key, as the end of a message; empty if none is declared."""
    hint = get_type_hints(table, include_extras=True).get(key)
    stated = (getattr(one, "description", None) for one in get_args(hint))
    return "".join(f": {text}" for text in stated if text)


def _choices(kind: Any) -> Iterator[str]:
    """Allowed words of a type, and other types that it accepts."""
    if get_origin(kind) is Literal:
        yield from map(str, get_args(kind))
    elif kind is float:
        yield "a number"
    elif get_origin(kind) is Annotated:
        yield from _choices(get_args(kind)[0])
    else:
        for part in get_args(kind):
            yield from _choices(part)


def _nearest(word: str, known: Iterable[str]) -> str:
    """The closest known word, as the end of a message; empty if there is none."""
    known = list(known)
    longer = [name for name in known if word and name.startswith(f"{word}_")]
    near = longer or get_close_matches(word[:100], known, n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _quoted(value: Any) -> str:
    """Value in a message, or its kind if it is long."""
    for kind, name in ((dict, "a table"), (list, "an array")):
        if isinstance(value, kind):
            return name
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return "a date or time"
    return f"'{excerpt(value)}'" if isinstance(value, str) else excerpt(str(value))
