"""Fibre directions from `*ORIENTATION` and `*DISTRIBUTION` of Abaqus.

Abaqus takes the first local direction for the fill yarns of a fabric, and the second
for the warp yarns (Abaqus Analysis User's Guide, "Fabric material behavior").
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ...mesh.checks import MeshError
from ...mesh.user_input import excerpt
from ..file_numbers import from_words, tag_positions
from .abaqus import WARP, WEFT, Block, blocks, read_elements

_SECTIONS = ("SHELL SECTION", "MEMBRANE SECTION", "SHELL GENERAL SECTION")

#: Keywords that bear on directions.
KEYWORDS = ("ORIENTATION", "DISTRIBUTION", "DISTRIBUTION TABLE", *_SECTIONS)

# Components of unit vectors out of the plane up to which they lie in it.  Chosen: above
# the six digits of a deck.
_IN_PLANE = 1e-5

# Tables of distributions that are read: how many numbers each element has.
_TABLES = {("COORD3D", "COORD3D"): 6, ("ANGLE",): 1}


class _Section(NamedTuple):
    """Elements of a section and their orientation, by names in capitals."""

    elements: str
    orientation: str


@dataclass
class _Deck:
    """Blocks of a deck by what they are and their name in capitals."""

    orientations: dict[str, Block] = field(default_factory=dict)
    distributions: dict[str, Block] = field(default_factory=dict)
    tables: dict[str, int] = field(default_factory=dict)
    sections: list[_Section] = field(default_factory=list)
    has_elements: bool = False


def read_directions(content: bytes) -> tuple[ndarray, ndarray] | None:
    """Directions of warp and weft in the elements of a deck, or None.

    Both have the shape (2, n_elements), in the order of the deck.

    Raises
    ------
    MeshError
        If the deck departs from its format, or states directions that are not read.
    """
    deck = _Deck()
    for block in blocks(content):
        with_name = _store(deck, block)
        if with_name:
            raise MeshError(f"{block}: there are two of this name")
    if not deck.orientations or not deck.has_elements:
        return None
    numbers, sets = read_elements(content)
    local = np.full((2, 2, len(numbers)), np.nan)
    used = [s for s in deck.sections if s.orientation]
    if used:
        for section in used:
            chosen = _members(section.elements, numbers, sets)
            block = _named("*ORIENTATION", section.orientation, deck.orientations)
            local[:, :, chosen] = _local(deck, block, numbers, sets)[:, :, chosen]
        fill, warp = local
    elif {WARP, WEFT} <= set(deck.orientations):
        warp, fill = (
            _local(deck, deck.orientations[name], numbers, sets)[0]
            for name in (WARP, WEFT)
        )
    elif len(deck.orientations) == 1:
        (block,) = deck.orientations.values()
        fill, warp = _local(deck, block, numbers, sets)
    else:
        raise MeshError(
            "no section names one of its orientations; name it in *SHELL SECTION, or "
            f"call two of them {WARP} and {WEFT}"
        )
    if (without := np.isnan(fill).any(axis=0)).any():
        raise MeshError(
            f"element {numbers[without][0]} is in no section that has an orientation"
        )
    return warp, fill


def _store(deck: _Deck, block: Block) -> bool:
    """Keep a block if it bears on directions; whether its name is there already."""
    keyword, parameters, data = block
    name = parameters.get("NAME", "").upper()
    deck.has_elements |= keyword == "ELEMENT"
    kept = {"ORIENTATION": deck.orientations, "DISTRIBUTION": deck.distributions}
    if keyword in _SECTIONS:
        if parameters.get("ORIENTATION"):
            elements = parameters.get("ELSET", "").upper()
            section = _Section(elements, parameters["ORIENTATION"].upper())
            deck.sections.append(section)
    elif keyword == "DISTRIBUTION TABLE":
        words = tuple(w.decode(errors="replace").upper() for row in data for w in row)
        deck.tables[name] = _TABLES.get(tuple(filter(None, words)), 0)
    elif keyword in kept:
        if name in kept[keyword]:
            return True
        kept[keyword][name] = block
    return False


def _named(what: str, name: str, among: dict[str, Block]) -> Block:
    if name not in among:
        raise MeshError(f"there is no {what} of the name {excerpt(name)!r}")
    return among[name]


def _members(name: str, numbers: ndarray, sets: dict[str, ndarray]) -> ndarray:
    """Positions of the elements of a set."""
    if name not in sets:
        raise MeshError(f"there is no *ELSET of the name {excerpt(name)!r}")
    return np.flatnonzero(np.isin(numbers, sets[name]))


def _local(
    deck: _Deck, block: Block, numbers: ndarray, sets: dict[str, ndarray]
) -> ndarray:
    """First and second direction of an orientation in the plane, shape (2, 2, n)."""
    try:
        return _local_of(deck, block, numbers, sets)
    except MeshError as error:
        name = excerpt(block.parameters.get("NAME", ""))
        raise MeshError(f"*ORIENTATION {name!r}: {error}") from None


def _local_of(
    deck: _Deck, block: Block, numbers: ndarray, sets: dict[str, ndarray]
) -> ndarray:
    parameters, data = block.parameters, block.data
    for key, known in (
        ("SYSTEM", ("RECTANGULAR",)),
        ("DEFINITION", ("COORDINATES",)),
        ("LOCAL DIRECTIONS", ("2",)),
    ):
        given = " ".join(parameters.get(key, known[0]).upper().split())
        if given not in known:
            raise MeshError(f"{key}={excerpt(given)} is not read, only {known[0]}")
    if other := set(parameters) - {"NAME", "SYSTEM", "DEFINITION", "LOCAL DIRECTIONS"}:
        raise MeshError(f"{excerpt(min(other))!r} is not read")
    axes = _axes(deck, data, numbers, sets)
    second = data[1] if len(data) > 1 else [b"3", b"0"]
    axis = 1 if second[0] == b"" else int(from_words(second[:1], "i8")[0])
    if axis not in (1, 2, 3):
        raise MeshError(f"its additional rotation is about {axis}, which is no axis")
    one, two, normal = (axes[(axis + i) % 3] for i in range(3))
    if np.abs(normal[:2]).max() > _IN_PLANE:
        raise MeshError(
            f"its local direction {axis} is not normal to the plane of the mesh"
        )
    alpha = np.radians(_angles(deck, second[1:], numbers, sets))
    c, s = np.cos(alpha), np.sin(alpha)
    one, two = c * one + s * two, c * two - s * one
    if "LOCAL DIRECTIONS" not in parameters:
        if len(data) > 2:
            raise MeshError("it has more lines than an axis and an angle")
        return np.stack([one[:2], two[:2]])
    return np.stack([u * one[:2] + v * two[:2] for u, v in _yarns(data[2:])])


def _yarns(rows: list[list[bytes]]) -> list[tuple[float, float]]:
    """Both directions in local components, of the lines after the axis and angle."""
    if len(rows) != 2:
        raise MeshError("LOCAL DIRECTIONS=2 needs two lines of components")
    found = []
    for row in rows:
        x = from_words(row, "f8")
        if len(x) not in (2, 3) or not np.isfinite(x).all() or x[2:].any():
            raise MeshError("a local direction needs components in the plane")
        found.append((float(x[0]), float(x[1])))
    return found


def _axes(
    deck: _Deck, data: list[list[bytes]], numbers: ndarray, sets: dict[str, ndarray]
) -> ndarray:
    """Unit vectors of the three axes, shape (3, 3, n): axis, component, element."""
    if not data or not data[0]:
        raise MeshError("it has no points a and b")
    words = data[0][:-1] if data[0][-1] == b"" else data[0]
    if len(words) == 1:
        points = _distributed(deck, words[0], 6, numbers, sets)
    else:
        x = from_words(words, "f8")
        if len(x) not in (6, 9):
            raise MeshError("its points a, b and c need three coordinates each")
        points = np.repeat(
            (x[:6] - np.tile(x[6:], 2) if len(x) == 9 else x)[:, None],
            len(numbers),
            axis=1,
        )
    if not np.isfinite(points).all():
        raise MeshError("its points are not finite")
    a, b = points[:3], points[3:]
    normal = np.cross(_unit(a), _unit(b), axis=0)
    if (np.linalg.norm(normal, axis=0) < _IN_PLANE).any():
        raise MeshError("its points a, b and the origin lie on a line")
    z = _unit(normal)
    x = _unit(a)
    return np.stack([x, np.cross(z, x, axis=0), z])


def _unit(v: ndarray) -> ndarray:
    """Columns of length 1; a column without length stays zero."""
    largest = np.abs(v).max(axis=0)
    v = v / np.where(largest > 0, largest, 1.0)
    length = np.linalg.norm(v, axis=0)
    return v / np.where(length > 0, length, 1.0)


def _angles(
    deck: _Deck, words: list[bytes], numbers: ndarray, sets: dict[str, ndarray]
) -> ndarray:
    """The additional rotation of each element in degrees."""
    words = [word for word in words if word]
    if not words:
        return np.zeros(len(numbers))
    if len(words) > 1:
        raise MeshError("its second line needs an axis and an angle")
    try:
        angle = from_words(words, "f8")
    except MeshError:
        angle = _distributed(deck, words[0], 1, numbers, sets)[0]
    if not np.isfinite(angle).all():
        raise MeshError("its additional rotation is not finite")
    return np.broadcast_to(angle, len(numbers))


def _distributed(
    deck: _Deck, word: bytes, width: int, numbers: ndarray, sets: dict[str, ndarray]
) -> ndarray:
    """Values of a distribution in each element, shape (width, n_elements)."""
    name = word.decode(errors="replace").upper()
    block = _named("*DISTRIBUTION", name, deck.distributions)
    try:
        return _values(deck, block, width, numbers, sets)
    except MeshError as error:
        raise MeshError(f"*DISTRIBUTION {excerpt(name)!r}: {error}") from None


def _values(
    deck: _Deck, block: Block, width: int, numbers: ndarray, sets: dict[str, ndarray]
) -> ndarray:
    parameters = block.parameters
    if other := set(parameters) - {"NAME", "LOCATION", "TABLE"}:
        raise MeshError(f"{excerpt(min(other))!r} is not read; give numbers without it")
    if parameters.get("LOCATION", "").upper() != "ELEMENT":
        raise MeshError("only LOCATION=ELEMENT is read")
    table = parameters.get("TABLE", "").upper()
    if deck.tables.get(table, 0) != width:
        kinds = {6: "COORD3D, COORD3D", 1: "ANGLE"}
        raise MeshError(f"its *DISTRIBUTION TABLE must be there, with {kinds[width]}")
    by_element: list[tuple[bytes, list[bytes]]] = []
    values = np.full((width, len(numbers)), np.nan)
    for words in block.data:
        row = words[:-1] if len(words) > width + 1 and words[-1] == b"" else words
        if len(row) != width + 1:
            shown = excerpt(b", ".join(words))
            raise MeshError(f"{shown!r} must be an element and {width} number(s)")
        if row[0].isdigit():
            by_element.append((row[0], row[1:]))
            continue
        own = from_words(row[1:], "f8")[:, None]
        if row[0] == b"":
            values[:] = np.where(np.isnan(values), own, values)
        else:
            chosen = _members(row[0].decode(errors="replace").upper(), numbers, sets)
            values[:, chosen] = own
    if by_element:
        tags = from_words([tag for tag, _ in by_element], "i8")
        given = from_words([word for _, own in by_element for word in own], "f8")
        if len(np.unique(tags)) < len(tags):
            raise MeshError("it has two lines of one element")
        values[:, tag_positions(numbers, tags, "element")] = given.reshape(-1, width).T
    if (left := np.isnan(values).any(axis=0)).any():
        raise MeshError(f"it has no value for element {numbers[left][0]}")
    return values
