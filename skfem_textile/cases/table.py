"""Building blocks of the tables of a case, and tables of declared parameters."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields
from importlib import import_module
from math import degrees, radians
from typing import Annotated, Any, ClassVar, TypeAlias, get_args, get_type_hints

from msgspec import NODEFAULT, Meta, Struct, defstruct

from ..declarations.fields import DEGREES, REQUIRED, About, Declared, Key, Range, Unit
from ..mesh.user_input import MOST_DEGREES


class Table(Struct, kw_only=True, forbid_unknown_fields=True):
    """Table of a case file."""


#: Kind of mesh whose edges follow the singular fibres.
GRADED = "graded"

Degrees: TypeAlias = Annotated[float, Meta(ge=-MOST_DEGREES, le=MOST_DEGREES)]

# Significant digits of a default in degrees, which the rounding of radians does not
# reach.
_DIGITS = 12


class DeclaredTable(Table):
    """Table of the parameters of a class or function.

    Attributes
    ----------
    declaration
        The dataclass of the parameters.
    names
        Parameters by their keys.
    """

    declaration: ClassVar[type[Declared]]
    names: ClassVar[Mapping[str, str]] = {}

    def values(self) -> dict[str, Any]:
        """Parameters by name, angles in radians."""
        return {
            name: radians(value) if _is_angle(key) and value is not None else value
            for key, name in self.names.items()
            for value in [getattr(self, key)]
        }

    @property
    def implementation(self) -> Any:
        """The class or function that has the parameters, imported now."""
        of = self.declaration
        module = import_module(f"...{of.module}", __name__)
        return getattr(module, of.__name__, None) or getattr(module, snake_case(of))

    def built(self, **others: Any) -> Any:
        """Object of the class or function with the parameters, and with others."""
        return self.implementation(**self.values(), **others)

    @classmethod
    def of(cls, built: Any) -> "DeclaredTable":
        """The table of an object with the parameters."""
        given = {key: getattr(built, name) for key, name in cls.names.items()}
        return cls(**{k: degrees(v) if _is_angle(k) else v for k, v in given.items()})


def _is_angle(key: str) -> bool:
    return key.endswith(f"_{DEGREES.name}")


def table_of(
    declaration: type[Declared],
    base: type[DeclaredTable] = DeclaredTable,
    tag: str | None = None,
    last: Sequence[str] = (),
) -> Any:
    """Table of a case file with the keys of declared parameters.

    Parameters
    ----------
    declaration
        The parameters, see `Declared`.
    base
        Base class, with further keys, which come first.
    tag
        Name that selects the table; by default the name of the class, its words
        separated by hyphens.
    last
        Parameters that come last, in their order.
    """
    hints = get_type_hints(declaration, include_extras=True)
    notes = {one: get_args(hint)[1:] for one, hint in hints.items()}
    stated = [
        one
        for one in fields(declaration)
        if any(isinstance(note, About) for note in notes[one.name])
    ]
    stated.sort(
        key=lambda one: (*last, one.name).index(one.name) if one.name in last else -1
    )
    names = {_key(one.name, notes[one.name]): one.name for one in stated}
    keys = []
    for (key, name), one in zip(names.items(), stated, strict=True):
        limits = _limits(key, notes[name])
        hint = Annotated[hints[name], *limits] if limits else hints[name]
        keys.append((key, hint, _default(key, one, notes[name])))
    return defstruct(
        declaration.__name__,
        keys,
        bases=(base,),
        namespace={
            "__doc__": declaration.__doc__,
            "declaration": declaration,
            "names": {**base.names, **names},
        },
        module=base.__module__,
        tag=tag or snake_case(declaration).replace("_", "-"),
        kw_only=True,
    )


def _key(name: str, notes: Sequence[Any]) -> str:
    """Key of a parameter."""
    given = [note.name for note in notes if isinstance(note, Key)]
    return "_".join(
        [*(given or [name]), *(n.name for n in notes if isinstance(n, Unit))]
    )


def _limits(key: str, notes: Sequence[Any]) -> list[Meta]:
    """Limits of a number, by default those of an angle."""
    limits = [Meta(gt=n.above, le=n.most) for n in notes if isinstance(n, Range)]
    return limits or [Meta(ge=-MOST_DEGREES, le=MOST_DEGREES)] * _is_angle(key)


def _default(key: str, one: Field[Any], notes: Sequence[Any]) -> Any:
    """Default of a parameter in the unit of its key."""
    if one.default is MISSING or REQUIRED in notes:
        return NODEFAULT
    if _is_angle(key) and one.default is not None:
        return float(f"{degrees(one.default):.{_DIGITS}g}")
    return one.default


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
