"""Fibre directions of each element in files: VTU, CSV and Abaqus decks.

The first local direction of an `*ORIENTATION` is along the fill yarns of a fabric, the
second along the warp yarns (Abaqus Analysis User's Guide, "Fabric material behavior").
"""

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..fabric.directions import FibreDirections
from ..fabric.laws.tabulated import lines_of
from ..mesh.checks import MeshError
from ..mesh.splitting import original_elements, sets_of
from ..mesh.user_input import excerpt, number_of_text
from . import abaqus
from .abaqus import SECTIONS, WARP, WEFT, Block, Deck, blocks, without_trailing_comma
from .file_numbers import (
    by_suffix,
    errors_about,
    from_words,
    refuse_duplicates,
    tag_positions,
    write_table,
)
from .vtk import in_space, read_xml, write_grid

# Keywords of a deck that define directions.
_KEYWORDS = ("ORIENTATION", "DISTRIBUTION", "DISTRIBUTION TABLE", *SECTIONS)

_VECTORS = ("warp_direction", "weft_direction")
_ANGLES = ("warp_angle_deg", "weft_angle_deg")

#: Names for ``others`` of `read_mesh`, of data that `read_directions` reads.
OF_DIRECTIONS = (*_VECTORS, *_ANGLES, *(f"*{keyword}" for keyword in _KEYWORDS))

_COMPONENTS = {**dict.fromkeys(_VECTORS, 3), **dict.fromkeys(_ANGLES, 1)}

# Out-of-plane component of a unit vector below which it lies in the plane.  Chosen:
# above the six digits of a deck.
_IN_PLANE = 1e-5


def read_directions(path: str | os.PathLike[str]) -> FibreDirections:
    """Read fibre directions, in the order of the elements of the mesh in the file.

    A .vtu has cell data ``warp_direction`` and ``weft_direction``, vectors, or else
    ``warp_angle_deg`` and ``weft_angle_deg``, angles to the x axis.  A .csv has the
    columns ``element``, from 1 on, and both angles.  An Abaqus .inp has
    ``*ORIENTATION``, with ``*DISTRIBUTION`` if it varies by element.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    MeshError
        If the file cannot be read or has no directions; one line names the file.
    """
    path = Path(path)
    readers = {".vtu": _of_vtu, ".csv": _of_csv, ".inp": _of_deck}
    with errors_about(path):
        read = by_suffix(path, readers, "fibre directions can be read only from")
        return read(abaqus.content_of(path))


def _of_vtu(content: bytes) -> FibreDirections:
    mesh, _ = read_xml(content, _COMPONENTS)
    plane = [
        i for i, block in enumerate(mesh.cells) if block.type in ("triangle", "quad")
    ]
    if not plane:
        raise MeshError("the file contains no triangles or quadrilaterals")

    def of_elements(name: str) -> ndarray:
        return np.concatenate([mesh.cell_data[name][i] for i in plane])

    if set(mesh.cell_data) >= set(_VECTORS):
        vectors = [of_elements(name) for name in _VECTORS]
        for name, v in zip(_VECTORS, vectors, strict=True):
            if not np.all(np.abs(v[:, 2]) <= _IN_PLANE * np.abs(v[:, :2]).max(axis=1)):
                raise MeshError(f"{name} must lie in the plane of the mesh")
        return FibreDirections(*(v[:, :2].T for v in vectors))
    if set(mesh.cell_data) >= set(_ANGLES):
        return FibreDirections.of_angles(*(of_elements(n).ravel() for n in _ANGLES))
    raise MeshError(
        f"the file must contain the cell data {' and '.join(_VECTORS)}, or "
        f"{' and '.join(_ANGLES)}"
    )


def _of_csv(content: bytes) -> FibreDirections:
    lines = lines_of(content)
    header = [name.strip() for name in lines[0][1]]
    needed = ("element", *_ANGLES)
    if any(header.count(name) != 1 for name in needed):
        raise MeshError(f"row 1: the header must name the columns {', '.join(needed)}")
    columns = [header.index(name) for name in needed]
    angles: dict[int, tuple[float, float]] = {}
    for i, row in lines[1:]:
        try:
            element, *both = (row[column] for column in columns)
            _, warp, weft = map(number_of_text, (element, *both))
            number = int(element)
        except (ValueError, IndexError):
            text = excerpt(",".join(row))
            raise MeshError(
                f"row {i}: expected an element and two angles, got '{text}'"
            ) from None
        if number in angles:
            raise MeshError(
                f"row {i}: element {number} already has a row: keep one of them"
            )
        angles[number] = warp, weft
    if not angles:
        raise MeshError("the file contains no elements")
    if set(angles) != set(range(1, len(angles) + 1)):
        raise MeshError(
            f"the elements of the {len(angles)} rows must be numbered from 1 to "
            f"{len(angles)}"
        )
    warp_deg, weft_deg = np.transpose([angles[i + 1] for i in range(len(angles))])
    return FibreDirections.of_angles(warp_deg, weft_deg)


def _of_deck(content: bytes) -> FibreDirections:
    directions = directions_of_deck(content)
    if directions is None:
        raise MeshError("the file must contain *ORIENTATION and *ELEMENT")
    return FibreDirections(*directions)


def write_directions(
    path: str | os.PathLike[str],
    mesh: Mesh,
    directions: FibreDirections,
    points: ndarray | None = None,
) -> None:
    """Write fibre directions in a format for `read_directions`.

    A .vtu has vectors and angles, bit for bit; a .csv angles with full precision; an
    Abaqus .inp a distribution and an orientation for each
    family, and the named boundaries, nodes and subdomains as sets.

    Parameters
    ----------
    path
        The file.
    mesh
        The mesh; for a split or cut mesh the user's elements are written.
    directions
        Directions in these elements.
    points
        Positions of the nodes, shape (2, n); by default ``mesh.p``.

    Raises
    ------
    ValueError
        If the name has another suffix, or the number of directions differs from the
        number of elements.
    OSError
        If the file cannot be written.
    """
    path, points = Path(path), mesh.p if points is None else points
    cells, _ = original_elements(mesh)
    directions.refuse_other(cells)
    warp, weft, nodes = (
        in_space(x.T).T for x in (directions.warp, directions.weft, points)
    )
    suffix = path.suffix.lower()
    if suffix == ".vtu":
        fields = dict(zip(_VECTORS, (warp.T, weft.T), strict=True))
        fields |= dict(zip(_ANGLES, directions.angles_deg(), strict=True))
        write_grid(path, nodes, cells, fields)
    elif suffix == ".csv":
        centres = np.hstack([points[:, cell].mean(axis=1) for cell in cells])
        table = np.vstack([centres, directions.angles_deg()]).T.tolist()
        rows = ([i, *row] for i, row in enumerate(table, 1))
        write_table(path, ("element", "x", "y", *_ANGLES), rows)
    elif suffix == ".inp":
        normal = np.zeros_like(warp)
        normal[2] = 1.0
        deck = abaqus.deck_of(cells, nodes, warp, weft, normal, *sets_of(mesh))
        path.write_text(deck, encoding="utf-8")
    else:
        raise ValueError(
            f"{path}: fibre directions can be written only to .vtu, .csv, .inp files"
        )


# Parameters of an orientation besides its name, with their only supported values.
_PARAMETERS = {
    "SYSTEM": "RECTANGULAR",
    "DEFINITION": "COORDINATES",
    "LOCAL DIRECTIONS": "2",
}

# Supported tables of distributions, with the number of values per element.
_TABLES = {("COORD3D", "COORD3D"): 6, ("ANGLE",): 1}


@dataclass
class _Deck:
    """Blocks of a deck that define directions, by their names in upper case.

    ``sections`` are pairs of a set of elements and an orientation.  ``numbers`` are the
    numbers of all elements of ``mesh``.
    """

    orientations: dict[str, Block] = field(default_factory=dict)
    distributions: dict[str, Block] = field(default_factory=dict)
    tables: dict[str, int] = field(default_factory=dict)
    sections: list[tuple[bytes, str]] = field(default_factory=list)
    numbers: ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    mesh: Deck = field(default_factory=Deck)

    def members(self, name: bytes) -> ndarray:
        """Mask of the elements of a set."""
        return np.isin(self.numbers, abaqus.members_of(self.mesh, "ELSET", name))


def _named(what: str, name: str, among: dict[str, Block]) -> Block:
    if name not in among:
        raise MeshError(f"{what} {excerpt(name)!r} is not defined")
    return among[name]


def directions_of_deck(content: bytes) -> tuple[ndarray, ndarray] | None:
    """Directions of warp and weft in the elements of a deck, or None.

    Both have the shape (2, n_elements), in the order of the deck.

    Raises
    ------
    MeshError
        If the deck violates its format, or has unsupported directions.
    """
    deck, has_elements = _Deck(), False
    for block in blocks(content):
        has_elements |= block.keyword == "ELEMENT"
        _store(deck, block)
    if not deck.orientations or not has_elements:
        return None
    deck.numbers, deck.mesh = abaqus.read_elements(content)
    local = np.full((2, 2, len(deck.numbers)), np.nan)
    if deck.sections:
        for elements, orientation in deck.sections:
            chosen = deck.members(elements)
            block = _named("*ORIENTATION", orientation, deck.orientations)
            local[:, :, chosen] = _local(deck, block)[:, :, chosen]
        fill, warp = local
    elif {WARP, WEFT} <= set(deck.orientations):
        warp, fill = (_local(deck, deck.orientations[n])[0] for n in (WARP, WEFT))
    elif len(deck.orientations) == 1:
        (block,) = deck.orientations.values()
        fill, warp = _local(deck, block)
    else:
        raise MeshError(
            "no section refers to an orientation of this file: refer to one in *SHELL "
            f"SECTION, or name two orientations {WARP} and {WEFT}"
        )
    if (without := np.isnan(fill).any(axis=0)).any():
        raise MeshError(
            f"element {deck.numbers[without][0]} is not in a section with an "
            "orientation"
        )
    return warp, fill


def _store(deck: _Deck, block: Block) -> None:
    """Store a block if it defines directions."""
    keyword, parameters, data, _ = block
    name = parameters.get("NAME", "").upper()
    blocks = {"ORIENTATION": deck.orientations, "DISTRIBUTION": deck.distributions}
    if keyword in SECTIONS:
        if orientation := parameters.get("ORIENTATION", "").upper():
            deck.sections.append((parameters.get("ELSET", "").encode(), orientation))
    elif keyword == "DISTRIBUTION TABLE":
        words = tuple(w.decode(errors="replace").upper() for row in data for w in row)
        deck.tables[name] = _TABLES.get(tuple(filter(None, words)), 0)
    elif keyword in blocks:
        if name in blocks[keyword]:
            raise MeshError(f"{block} is defined twice: use unique names")
        blocks[keyword][name] = block


def _local(deck: _Deck, block: Block) -> ndarray:
    """First and second direction of an orientation in the plane, shape (2, 2, n)."""
    with errors_about(f"*ORIENTATION {excerpt(block.parameters.get('NAME', ''))!r}"):
        return _local_directions(deck, block.parameters, block.data)


def _local_directions(
    deck: _Deck, parameters: dict[str, str], data: list[list[bytes]]
) -> ndarray:
    for key, known in _PARAMETERS.items():
        given = " ".join(parameters.get(key, known).upper().split())
        if given != known:
            raise MeshError(f"{key}={excerpt(given)} is not supported: use {known}")
    if other := set(parameters) - {"NAME", *_PARAMETERS}:
        raise MeshError(
            f"the parameter {excerpt(min(other))!r} is not supported: remove it"
        )
    axes = _axes(deck, data)
    second = data[1] if len(data) > 1 else [b"3", b"0"]
    axis = 1 if second[0] == b"" else int(from_words(second[:1], "i8")[0])
    if axis not in (1, 2, 3):
        raise MeshError(
            f"the additional rotation must be about the axis 1, 2 or 3, got {axis}"
        )
    one, two, normal = (axes[(axis + i) % 3] for i in range(3))
    if np.abs(normal[:2]).max() > _IN_PLANE:
        raise MeshError(
            f"the local direction {axis} must be normal to the plane of the mesh"
        )
    alpha = np.radians(_angles(deck, second[1:]))
    c, s = np.cos(alpha), np.sin(alpha)
    one, two = c * one + s * two, c * two - s * one
    if "LOCAL DIRECTIONS" not in parameters:
        if len(data) > 2:
            raise MeshError(
                "unexpected lines follow the axis and angle of the additional rotation"
            )
        return np.stack([one[:2], two[:2]])
    return np.stack([u * one[:2] + v * two[:2] for u, v in _yarns(data[2:])])


def _yarns(rows: list[list[bytes]]) -> list[tuple[float, float]]:
    """Both directions in local components, from the lines after axis and angle."""
    if len(rows) != 2:
        raise MeshError("LOCAL DIRECTIONS=2 requires two lines of components")
    yarns = []
    for row in rows:
        x = from_words(row, "f8")
        if len(x) not in (2, 3) or not np.isfinite(x).all() or x[2:].any():
            raise MeshError(
                "a local direction must have two finite components in the plane of the "
                "mesh"
            )
        yarns.append((float(x[0]), float(x[1])))
    return yarns


def _axes(deck: _Deck, data: list[list[bytes]]) -> ndarray:
    """Unit vectors of the three axes, shape (3, 3, n): axis, component, element."""
    if not data or not data[0]:
        raise MeshError("the points a and b are missing")
    words = without_trailing_comma(data[0])
    if len(words) == 1:
        points = _distributed(deck, words[0], 6)
    else:
        x = from_words(words, "f8")
        if len(x) not in (6, 9):
            raise MeshError("the points a, b and c must have three coordinates each")
        origin = np.tile(x[6:], 2) if len(x) == 9 else 0.0
        points = np.tile((x[:6] - origin)[:, None], len(deck.numbers))
    if not np.isfinite(points).all():
        raise MeshError("the coordinates of the points must be finite")
    a, b = points[:3], points[3:]
    normal = np.cross(_unit(a), _unit(b), axis=0)
    if (np.linalg.norm(normal, axis=0) < _IN_PLANE).any():
        raise MeshError("the points a, b and the origin must not lie on a line")
    z = _unit(normal)
    x = _unit(a)
    return np.stack([x, np.cross(z, x, axis=0), z])


def _unit(v: ndarray) -> ndarray:
    """Normalised columns; a column of length zero stays zero."""
    largest = np.abs(v).max(axis=0)
    v = v / np.where(largest > 0, largest, 1.0)
    length = np.linalg.norm(v, axis=0)
    return v / np.where(length > 0, length, 1.0)


def _angles(deck: _Deck, words: list[bytes]) -> ndarray:
    """Additional rotation of each element in degrees."""
    words = [word for word in words if word]
    if not words:
        return np.zeros(len(deck.numbers))
    if len(words) > 1:
        raise MeshError("the second line must be an axis and an angle")
    try:
        angle = from_words(words, "f8")
    except MeshError:
        angle = _distributed(deck, words[0], 1)[0]
    if not np.isfinite(angle).all():
        raise MeshError("the additional rotation must be finite")
    return np.broadcast_to(angle, len(deck.numbers))


def _distributed(deck: _Deck, word: bytes, width: int) -> ndarray:
    """Values of a distribution in each element, shape (width, n_elements)."""
    name = word.decode(errors="replace").upper()
    block = _named("*DISTRIBUTION", name, deck.distributions)
    with errors_about(f"*DISTRIBUTION {excerpt(name)!r}"):
        return _values(deck, block, width)


def _values(deck: _Deck, block: Block, width: int) -> ndarray:
    parameters, numbers = block.parameters, deck.numbers
    if other := set(parameters) - {"NAME", "LOCATION", "TABLE"}:
        raise MeshError(
            f"the parameter {excerpt(min(other))!r} is not supported in a "
            "distribution: remove it"
        )
    if parameters.get("LOCATION", "").upper() != "ELEMENT":
        raise MeshError("only LOCATION=ELEMENT is supported")
    table = parameters.get("TABLE", "").upper()
    if deck.tables.get(table, 0) != width:
        kinds = {6: "COORD3D, COORD3D", 1: "ANGLE"}
        raise MeshError(
            f"the distribution requires a *DISTRIBUTION TABLE with {kinds[width]}"
        )
    by_element: list[list[bytes]] = []
    values, with_default = np.full((width, len(numbers)), np.nan), False
    for words in block.data:
        row = without_trailing_comma(words)
        if len(row) != width + 1:
            shown = excerpt(b", ".join(words))
            raise MeshError(
                f"the line {shown!r} must contain an element and {width} number(s)"
            )
        if row[0].isdigit():
            by_element.append(row)
            continue
        row_values = from_words(row[1:], "f8")[:, None]
        if row[0]:
            values[:, deck.members(row[0])] = row_values
        elif with_default:
            raise MeshError("two lines without an element are given: keep one of them")
        else:
            with_default = True
            values = np.where(np.isnan(values), row_values, values)
    tags = from_words([row[0] for row in by_element], "i8")
    refuse_duplicates(tags, "element")
    flat = from_words([word for row in by_element for word in row[1:]], "f8")
    values[:, tag_positions(numbers, tags, "element")] = flat.reshape(-1, width).T
    if (left := np.isnan(values).any(axis=0)).any():
        raise MeshError(f"element {numbers[left][0]} has no value")
    return values
