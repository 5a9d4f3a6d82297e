"""Vectors on named edges, as options: forces, and how edges move."""

import math
from typing import TypeAlias

from ...registration import Option

#: A component of a displacement in mm, or that it is not prescribed.
Component: TypeAlias = float | str

FREE = "free"


def _read_force(word: str) -> tuple[str, tuple[float, ...]]:
    name, _, components = word.partition("=")
    try:
        force = tuple(float(component) for component in components.split(","))
    except ValueError:
        force = ()
    if not (name and len(force) in (2, 3) and all(map(math.isfinite, force))):
        raise ValueError(f"{word!r} is not like top=0,100, or top=0,0,100 in space")
    return name, force


def _read_move(word: str) -> tuple[str, tuple[Component, Component]]:
    name, _, components = word.partition("=")
    try:
        x, y = (c if c == FREE else float(c) for c in components.split(","))
    except ValueError:
        name = ""
    if not name:
        raise ValueError(f"{word!r} is not like top=0,40 or top={FREE},40")
    return name, (x, y)


#: Forces beside the conditions of a scene.
FORCES = Option(
    name="force",
    help="a force in N in all, spread over a named boundary beside the "
    "scene's conditions, in proportion to the load factor, with a third component in "
    "space; may be repeated",
    default=(),
    read=_read_force,
    metavar="NAME=FX,FY",
    repeated=True,
    unit="N",
    in_file=dict[str, tuple[float, ...]],
)

#: Displacements of boundaries at the end.
MOVES = Option(
    name="move",
    help="a named boundary that moves by this in mm in the end, in proportion to the "
    f"load factor: 0,0 to hold it, {FREE} for what is not prescribed; may be repeated",
    default=(),
    read=_read_move,
    metavar="NAME=UX,UY",
    repeated=True,
    unit="mm",
    in_file=dict[str, tuple[Component, Component]],
)
