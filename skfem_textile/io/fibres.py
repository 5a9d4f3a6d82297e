"""Fibre directions of each element in files: VTU, CSV and input of Abaqus."""

import csv
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..fabric.directions import FibreDirections
from ..mesh.checks import MeshError
from ..mesh.splitting import original_elements
from ..mesh.user_input import excerpt, number_of_text, printable
from . import vtu
from .decks.abaqus import deck_of
from .decks.orientations import KEYWORDS
from .decks.orientations import read_directions as deck_directions

_VECTORS = ("warp_direction", "weft_direction")
_ANGLES = ("warp_angle_deg", "weft_angle_deg")

#: Names that `read_mesh` has for what `read_directions` reads.
OF_DIRECTIONS = (*_VECTORS, *_ANGLES, *(f"*{keyword}" for keyword in KEYWORDS))

_COMPONENTS = {**dict.fromkeys(_VECTORS, 3), **dict.fromkeys(_ANGLES, 1)}
_COLUMNS = ("element", "x", "y", *_ANGLES)

# Components out of the plane up to which a direction of length 1 lies in it.
_IN_PLANE = 1e-5


def read_directions(path: str | os.PathLike[str]) -> FibreDirections:
    """Read fibre directions, in the order of the elements of the mesh in the file.

    A .vtu has cell data ``warp_direction`` and ``weft_direction``, vectors, or else
    ``warp_angle_deg`` and ``weft_angle_deg``, angles to the x axis.  A .csv has the
    columns ``element``, from 1 on, and both angles.  A .inp of Abaqus has
    ``*ORIENTATION``, with ``*DISTRIBUTION`` where it differs from element to element.

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
    try:
        if path.suffix.lower() not in readers:
            raise MeshError(f"directions are read from {', '.join(readers)}")
        return readers[path.suffix.lower()](path.read_bytes())
    except OSError as error:
        reason = printable(error.strerror or error)
        raise MeshError(f"{printable(path)}: {reason}") from None
    except ValueError as error:
        raise MeshError(f"{printable(path)}: {error}") from None


def _of_vtu(content: bytes) -> FibreDirections:
    mesh, _ = vtu.read(content, _COMPONENTS)
    plane = [
        i for i, block in enumerate(mesh.cells) if block.type in ("triangle", "quad")
    ]
    if not plane:
        raise MeshError("it has no triangles or quadrilaterals")

    def of_elements(name: str) -> ndarray:
        return np.concatenate([mesh.cell_data[name][i] for i in plane])

    if set(_VECTORS) <= set(mesh.cell_data):
        vectors = [of_elements(name) for name in _VECTORS]
        for name, v in zip(_VECTORS, vectors, strict=True):
            if not np.all(np.abs(v[:, 2]) <= _IN_PLANE * np.abs(v[:, :2]).max(axis=1)):
                raise MeshError(f"{name} must lie in the plane of the mesh")
        return FibreDirections(*(v[:, :2].T for v in vectors))
    if set(_ANGLES) <= set(mesh.cell_data):
        return FibreDirections.of_angles(*(of_elements(n).ravel() for n in _ANGLES))
    raise MeshError(
        f"it has no cell data {' and '.join(_VECTORS)}, nor {' and '.join(_ANGLES)}"
    )


def _of_csv(content: bytes) -> FibreDirections:
    try:
        rows = list(csv.reader(content.decode("utf-8-sig").splitlines(), strict=True))
    except (UnicodeDecodeError, csv.Error):
        raise MeshError("no CSV file in UTF-8") from None
    lines = [(i, row) for i, row in enumerate(rows, 1) if any(map(str.strip, row))]
    header = [name.strip() for name in lines[0][1]] if lines else []
    needed = ("element", *_ANGLES)
    if any(header.count(name) != 1 for name in needed):
        raise MeshError(f"its first row must name the columns {', '.join(needed)}")
    columns = [header.index(name) for name in needed]
    angles: dict[int, tuple[float, float]] = {}
    for i, row in lines[1:]:
        try:
            element, *both = (row[column] for column in columns)
            _, warp, weft = map(number_of_text, (element, *both))
            number = int(element)
        except (ValueError, IndexError):
            shown = excerpt(",".join(row))
            raise MeshError(
                f"row {i}: '{shown}' is not an element and two angles"
            ) from None
        if number in angles:
            raise MeshError(f"row {i}: there are two rows of element {number}")
        angles[number] = warp, weft
    if not angles:
        raise MeshError("it has no elements")
    if set(angles) != set(range(1, len(angles) + 1)):
        raise MeshError(f"its {len(angles)} rows must number the elements from 1 on")
    warp_deg, weft_deg = np.transpose([angles[i + 1] for i in range(len(angles))])
    return FibreDirections.of_angles(warp_deg, weft_deg)


def _of_deck(content: bytes) -> FibreDirections:
    directions = deck_directions(content)
    if directions is None:
        raise MeshError("it has no *ORIENTATION and *ELEMENT")
    return FibreDirections(*directions)


def write_directions(
    path: str | os.PathLike[str],
    mesh: Mesh,
    directions: FibreDirections,
    points: ndarray | None = None,
) -> None:
    """Write fibre directions so that `read_directions` finds them.

    A .vtu has vectors and angles, bit by bit; a .csv angles with all digits; a .inp of
    Abaqus a distribution and an orientation for each family.

    Parameters
    ----------
    path
        The file.
    mesh
        The mesh; of a split or cut mesh the user's elements are written.
    directions
        Directions in these elements.
    points
        Positions of the nodes, if they are not those of the mesh, shape (2, n).

    Raises
    ------
    ValueError
        If the name has another suffix, or there is not one direction for each element.
    OSError
        If the file cannot be written.
    """
    path, points = Path(path), mesh.p if points is None else points
    cells, _ = original_elements(mesh)
    directions.refuse_other(cells)
    suffix = path.suffix.lower()
    if suffix == ".vtu":
        _write_vtu(path, cells, points, directions)
    elif suffix == ".csv":
        _write_csv(path, cells, points, directions)
    elif suffix == ".inp":
        path.write_text(_deck_of(mesh, cells, points, directions), encoding="utf-8")
    else:
        raise ValueError(f"{path}: directions are written to .vtu, .csv and .inp")


def _write_vtu(
    path: Path, cells: tuple[ndarray, ...], points: ndarray, directions: FibreDirections
) -> None:
    pair = _in_space(directions.warp), _in_space(directions.weft)
    fields = dict(zip(_VECTORS, (v.T for v in pair), strict=True))
    fields |= dict(zip(_ANGLES, directions.angles_deg(), strict=True))
    write_cells(path, cells, _in_space(points), fields)


def write_cells(
    path: Path, cells: Sequence[ndarray], points: ndarray, fields: dict[str, ndarray]
) -> None:
    """Write fields of cells whose corners are columns of points, shape (3, n)."""
    ends = np.cumsum([cell.shape[1] for cell in cells])[:-1]
    by_block: dict[str, Any] = {name: np.split(x, ends) for name, x in fields.items()}
    meshio.Mesh(
        points[:, : 1 + max(c.max() for c in cells)].T,
        [({3: "triangle", 4: "quad"}[len(cell)], cell.T) for cell in cells],
        cell_data=by_block,
    ).write(path)


def _write_csv(
    path: Path, cells: tuple[ndarray, ...], points: ndarray, directions: FibreDirections
) -> None:
    centres = np.hstack([points[:, cell].mean(axis=1) for cell in cells])
    table = np.vstack([centres, directions.angles_deg()])
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_COLUMNS)
        writer.writerows([i, *row] for i, row in enumerate(table.T.tolist(), 1))


def _deck_of(
    mesh: Mesh, cells: tuple[ndarray, ...], points: ndarray, directions: FibreDirections
) -> str:
    pair = _in_space(directions.warp), _in_space(directions.weft)
    normal = np.zeros_like(pair[0])
    normal[2] = 1.0
    n_nodes = 1 + max(cell.max() for cell in cells)
    ends = {
        name: np.unique(mesh.facets[:, np.asarray(edges)])
        for name, edges in (mesh.boundaries or {}).items()
    }
    sets = {name: nodes[nodes < n_nodes] for name, nodes in ends.items()}
    return deck_of(cells, _in_space(points), *pair, normal, sets)


def _in_space(x: ndarray) -> ndarray:
    """Columns of vectors in the plane, in space."""
    return np.pad(x, ((0, 1), (0, 0)))
