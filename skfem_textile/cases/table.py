"""Building blocks of the tables of a case."""

from typing import Annotated, Any, TypeAlias, get_args

from msgspec import Meta, Struct

from ..mesh.user_input import MOST_DEGREES


class Table(Struct, kw_only=True, forbid_unknown_fields=True):
    """Table of a case file."""


def about(text: str) -> Meta:
    """Metadata with the meaning of a key."""
    return Meta(description=text)


#: Kind of mesh whose edges follow the singular fibres.
GRADED = "graded"

#: Metadata of a key whose value is a file name.
FILE = Meta(extra={"file": True})

Degrees: TypeAlias = Annotated[float, Meta(ge=-MOST_DEGREES, le=MOST_DEGREES)]


def tag_of(table: type[Struct]) -> str:
    """Name that selects a table of a union."""
    return str(table.__struct_config__.tag)


def named(union: Any) -> dict[str, type[Any]]:
    """Tables of a union by name."""
    return {tag_of(table): table for table in get_args(union)}


def summary_of(table: type[Struct]) -> str:
    """First line of the docstring of a table."""
    return (table.__doc__ or "").partition("\n")[0]
