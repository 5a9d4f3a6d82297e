"""What the tables of a case are made of."""

from typing import Annotated, Any, TypeAlias, get_args

from msgspec import Meta, Struct

from ..mesh.user_input import MOST_DEGREES


class Table(Struct, kw_only=True, forbid_unknown_fields=True):
    """A table of a case file."""


def about(text: str) -> Meta:
    """The meaning of a key."""
    return Meta(description=text)


#: Marks a key whose value is the name of a file.
FILE = Meta(extra={"file": True})

Degrees: TypeAlias = Annotated[float, Meta(ge=-MOST_DEGREES, le=MOST_DEGREES)]


def tag_of(table: type[Struct]) -> str:
    """The name by which a table of a union is chosen."""
    return str(table.__struct_config__.tag)


def named(union: Any) -> dict[str, type[Any]]:
    """The tables of a union by their names."""
    return {tag_of(table): table for table in get_args(union)}


def summary_of(table: type[Struct]) -> str:
    """The first line of the documentation of a table."""
    return (table.__doc__ or "").partition("\n")[0]
