"""Tables of a case file, made from declared parameters.

A key ends with its unit.  Each table builds the object that it declares and imports the
modules for it only then.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import partial
from importlib import import_module
from math import degrees, radians
from types import MappingProxyType, NoneType
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, get_args, get_origin

from msgspec import NODEFAULT, Meta, Struct, defstruct, field

from ..declarations import REQUIRED, Key
from ..mesh.user_input import MOST_DEGREES


class Table(Struct, kw_only=True, forbid_unknown_fields=True):
    """Table of a case file."""


def about(text: str) -> Meta:
    """Metadata with the meaning of a key."""
    return Meta(description=text)


#: Metadata of a key whose value is a file name.
FILE = Meta(extra={"file": True})

#: Units of length of files, see `IN_MM`.
LengthUnit: TypeAlias = Literal["mm", "cm", "m", "in"]

Degrees: TypeAlias = Annotated[float, Meta(ge=-MOST_DEGREES, le=MOST_DEGREES)]


class DeclaredTable(Table):
    """Table of the parameters of a class or function.

    Attributes
    ----------
    declaration
        The dataclass of the parameters.
    called
        Name of this class or function.
    keys
        Parameters by their keys in the file, each a name and a `Key`.
    """

    declaration: ClassVar[type[Any]]
    called: ClassVar[str]
    keys: ClassVar[Mapping[str, tuple[str, Key]]] = {}

    def values(self) -> dict[str, Any]:
        """Parameters by name, angles in radians, and tables as pairs."""
        values = {}
        for key, (name, stated) in self.keys.items():
            value = getattr(self, key)
            if stated.unit == "deg" and value is not None:
                value = radians(value)
            elif stated.words:
                value = value == stated.words[True]
            values[name] = tuple(value.items()) if isinstance(value, dict) else value
        return values

    @classmethod
    def implementation(cls) -> Any:
        """The class or function that has the parameters, imported now."""
        module = import_module(f"...{cls.declaration.implemented_in}", __name__)
        return getattr(module, cls.called)

    def construct(self, **others: Any) -> Any:
        """Object of the class or function with the parameters, and with others."""
        return self.implementation()(**{**self.values(), **others})

    @classmethod
    def of(cls, built: Any) -> "DeclaredTable":
        """The table of an object with the parameters."""
        values = {}
        for key, (name, stated) in cls.keys.items():
            value = getattr(built, name)
            if stated.unit == "deg":
                value = degrees(value)
            values[key] = stated.words[value] if stated.words else value
        return cls(**values)


def table_of(
    declaration: type[Any],
    base: type[DeclaredTable] = DeclaredTable,
    tag: str | Literal[False] | None = None,
    also: Mapping[str, Any] = MappingProxyType({}),
    last: Sequence[str] = (),
) -> Any:
    """Table of a case file with the keys of declared parameters.

    Parameters
    ----------
    declaration
        The parameters, see `declaration`.
    base
        Base class, with further keys, which come first.
    tag
        Name that selects the table, and of the function; by default, for a class, its
        name in lower case with hyphens.  False for a table that is not selected.
    also
        Types of further keys of the table, which are None by default.
    last
        Keys and parameters that come last, in their order.
    """
    keys, typed = {}, {name: (name, hint, None) for name, hint in also.items()}
    for parameter in fields(declaration):
        if stated := parameter.metadata.get("key"):
            name = parameter.name
            key = "_".join(filter(None, (stated.name or name, stated.unit)))
            typed[name] = key, *_typed(stated.kind or parameter.type, stated)
            keys[key] = name, stated
    order = sorted(typed, key=lambda name: last.index(name) if name in last else -1)
    return defstruct(
        declaration.__name__,
        [typed[name] for name in order],
        bases=(base,),
        namespace={
            "__doc__": declaration.__doc__,
            "declaration": declaration,
            "called": tag or declaration.__name__,
            "keys": keys,
        },
        module=base.__module__,
        tag=snake_case(declaration).replace("_", "-") if tag is None else tag,
        kw_only=True,
    )


def _typed(kind: Any, stated: Key) -> tuple[Any, Any]:
    """Type and default of a key."""
    metadata = [about(stated.about), *[FILE] * stated.file]
    default: Any = NODEFAULT if stated.default is REQUIRED else stated.default
    if stated.words:
        kind, default = Literal[stated.words], stated.words[default]
    if get_origin(kind) is dict:
        default = field(default_factory=partial(dict, default))
    if stated.limits is not None:
        low, high = stated.limits
        metadata.append(
            Meta(ge=low, le=high) if stated.closed else Meta(gt=low, le=high)
        )
    elif stated.unit == "deg":
        kind = Degrees | None if NoneType in get_args(kind) else Degrees
    return Annotated[kind, *metadata], default


def snake_case(kind: type) -> str:
    """Name of a class in lower case, its words separated by underscores."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()


def tag_of(table: type[Struct]) -> str:
    """Name that selects a table of a union."""
    return str(table.__struct_config__.tag)


def named(union: Any) -> dict[str, type[Any]]:
    """Tables of a union by name."""
    return {tag_of(table): table for table in get_args(union)}


def summary_of(table: type[Struct]) -> str:
    """First line of the docstring of a table."""
    return (table.__doc__ or "").partition("\n")[0]
