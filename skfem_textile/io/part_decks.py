"""Decks of structural parts, read and written with the fibres of a draped ply.

The copy of a deck keeps labels, types of elements, sets and include files.
"""

import logging
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.checks import MeshError, refuse_positions
from ..mesh.user_input import printable
from ..nets.sheet import FibresInSpace
from ..surfaces.tool_mesh import ToolMesh
from .calculix import calculix_deck
from .draping import write_fibres
from .file_numbers import by_suffix, errors_about
from .layups import Element, Layup
from .meshes import refuse_no_file
from .part_abaqus import AbaqusDeck
from .part_cards import DynaDeck, NastranDeck, RadiossDeck

log = logging.getLogger(__name__)

_READERS: dict[str, Any] = {
    ".inp": AbaqusDeck,
    **dict.fromkeys((".bdf", ".nas", ".dat"), NastranDeck),
    **dict.fromkeys((".k", ".key", ".dyn"), DynaDeck),
    ".rad": RadiossDeck,
}

# Names of materials that all formats allow.
_NAME = re.compile(r"[A-Za-z0-9_.-]+")

# Numbers of elements that a message lists.
_LISTED = 5


@dataclass(frozen=True, eq=False)
class PartDeck:
    """Shells and membranes of the deck of a structural part.

    Attributes
    ----------
    path
        The file.
    files
        The file and the files that it includes.
    mesh
        The elements by their corners, in global axes: all with as many corners as the
        first, then the others.
    labels
        Numbers of the elements in the order of the mesh, shape (n_elements,).
    types
        Their types as in the deck.
    instances
        The instance of each element; empty if there are none.
    sets
        Positions in the mesh of the members of each set, part or property, ascending;
        sets of an instance as ``INSTANCE.SET``.
    """

    path: Path
    files: tuple[Path, ...]
    mesh: ToolMesh
    labels: ndarray
    types: tuple[str, ...]
    instances: tuple[str, ...]
    sets: dict[str, ndarray]
    _form: Any
    _elements: tuple[Element, ...]


def read_part_deck(path: str | os.PathLike[str]) -> PartDeck:
    """Read the shells and membranes of a deck, with its include files.

    By suffix: ``.inp`` of Abaqus and CalculiX, with parts and instances; ``.bdf``,
    ``.nas`` and ``.dat`` of Nastran; ``.k``, ``.key`` and ``.dyn`` of LS-DYNA; ``.rad``
    of the starter of OpenRadioss.  Quadratic elements are read by their corners,
    continuum shells by their middle surface.  A warning in the log ``skfem_textile``
    lists the other elements.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    MeshError
        If the deck cannot be read or has no shells; one line names the file.
    """
    path = Path(path)
    with errors_about(path):
        reader = by_suffix(path, _READERS, "decks of parts can be read only from")
        refuse_no_file(path)
        form = reader(path)
        if not form.elements:
            raise MeshError("the deck contains no shells or membranes")
        elements = _in_order(form.elements)
        mesh, at = _mesh(elements, form.positions), _positions(elements)
    if form.left:
        listed = ", ".join(f"{n} {printable(kind)}" for kind, n in form.left.items())
        log.warning("%s: not shells, left as they are: %s", printable(path), listed)
    sets = {
        name: np.unique([at[x] for x in members if x in at]).astype(int)
        for name, members in form.sets.items()
    }
    labels = np.array([x.number for x in elements])
    columns = (tuple(x.kind for x in elements), tuple(x.scope for x in elements))
    known = {name: members for name, members in sets.items() if members.size}
    files = tuple(file.path for file in form.text.files)
    return PartDeck(path, files, mesh, labels, *columns, known, form, elements)


def _in_order(elements: list[Element]) -> tuple[Element, ...]:
    """Elements with as many corners as the first, then the others."""
    for element in elements:
        if len(element.corners) not in (3, 4):
            raise MeshError(f"element {element.number} has fewer than 3 corners")
    first = len(elements[0].corners)
    return tuple(sorted(elements, key=lambda x: len(x.corners) != first))


def _positions(elements: tuple[Element, ...]) -> dict[tuple[str, int], int]:
    """Positions of elements by instance and number."""
    at: dict[tuple[str, int], int] = {}
    for i, x in enumerate(elements):
        if at.setdefault((x.scope, x.number), i) != i:
            raise MeshError(
                f"element number {x.number} is used twice: use unique numbers"
            )
    return at


def _mesh(
    elements: tuple[Element, ...], positions: dict[tuple[str, int], ndarray]
) -> ToolMesh:
    numbers: dict[tuple[str, int], int] = {}
    cells: dict[int, list[list[int]]] = {}
    for element in elements:
        keys = [(element.scope, n) for n in element.corners]
        for key in keys:
            if key not in positions:
                raise MeshError(
                    f"node {key[1]} of element {element.number} is not defined"
                )
        row = [numbers.setdefault(key, len(numbers)) for key in keys]
        cells.setdefault(len(row), []).append(row)
    points = np.array([positions[key] for key in numbers]).T
    arrays = tuple(np.array(rows).T for rows in cells.values())
    refuse_positions(points)
    for element, area in zip(elements, _areas(points, arrays), strict=True):
        if not area > 0:
            raise MeshError(f"element {element.number} has no area")
    return ToolMesh(points, arrays)


def _areas(points: ndarray, cells: tuple[ndarray, ...]) -> ndarray:
    """Twice the areas of elements, shape (n_elements,)."""
    corners = [points[:, cell] for cell in cells]
    diagonals = [(x[:, 2] - x[:, 0], x[:, -1] - x[:, 1]) for x in corners]
    normals = [np.cross(a, b, axis=0) for a, b in diagonals]
    return np.linalg.norm(np.hstack(normals), axis=0)


def write_part_deck(
    folder: str | os.PathLike[str],
    deck: PartDeck,
    fibres: FibresInSpace,
    thickness: float | ndarray,
    material: str | None = None,
    calculix: bool = False,
) -> list[Path]:
    """Write a copy of a deck with the fibres of a draped ply, and a VTU file.

    In Abaqus and OpenRadioss, only a line that includes a file of layers is added, and
    sections of the covered elements are commented out.  A ply is four layers, two along
    the warp and two along the weft, that bend as a homogeneous sheet.  In
    Nastran and LS-DYNA, the cards of the covered elements have the angle of the warp
    and the thickness.  Warnings in the log ``skfem_textile`` list what is commented
    out, a material that is not defined, and the elements that the ply does not cover:
    they keep their sections, and form the set ``NOT_COVERED`` of each part in Abaqus,
    and groups with this title in OpenRadioss.

    Parameters
    ----------
    folder
        A folder in which no file of the deck would be overwritten.
    deck
        The deck.
    fibres
        Fibres in the elements of ``deck.mesh``.
    thickness
        Thickness of the ply at rest in mm; sheared by the angle Γ it becomes
        thickness/cos Γ, because the weight and the length of the fibres remain the
        same.  An array of shape (n_elements,) is the thickness of the draped ply.
    material
        Name of the material of a layer in Abaqus, or its number in OpenRadioss; by
        default the material of the section.
    calculix
        If true, an Abaqus deck of one instance is written for CalculiX too, as
        ``NAME_ccx.inp`` in one file: with S8R and S6, and a section for each class of
        0.1°.

    Returns
    -------
    list
        The files, the deck first.

    Raises
    ------
    ValueError
        If an argument is not valid.
    MeshError
        If the deck cannot represent the fibres; one line names the deck.
    OSError
        If a file cannot be written.
    """
    return written_part_deck(folder, deck, fibres, thickness, material, calculix)[0]


def written_part_deck(
    folder: str | os.PathLike[str],
    deck: PartDeck,
    fibres: FibresInSpace,
    thickness: float | ndarray,
    material: str | None = None,
    calculix: bool = False,
) -> tuple[list[Path], str]:
    """Files of `write_part_deck`, and why a requested one for CalculiX is missing."""
    folder, path, no_calculix = Path(folder), deck.path, ""
    layup = _layup(deck, fibres, thickness, material)
    with errors_about(path):
        if calculix and not isinstance(deck._form, AbaqusDeck):
            raise MeshError("CalculiX requires an .inp file")
        files, remarks = deck._form.written(layup)
        if material is not None and not deck._form.has_material(material):
            remarks.append(
                f"the material {material} is not defined in the deck or its include "
                "files: define it"
            )
        if calculix:
            try:
                name = f"{path.stem}_ccx.inp"
                if name in files:
                    raise MeshError(f"the deck includes {printable(name)} already")
                files[name], more = calculix_deck(deck._form, layup)
                remarks += more
            except MeshError as error:
                no_calculix = str(error)
                remarks.append(f"not written for CalculiX: {no_calculix}")
    if left := _by_part(deck, np.flatnonzero(~layup.covered)):
        remarks.append(f"the ply does not cover element(s) {left}")
    written = [folder / name for name in (*files, f"{path.stem}_fibres.vtu")]
    _refuse_sources(written, deck)
    for file, content in zip(written[:-1], files.values(), strict=True):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    write_fibres(written[-1], fibres)
    for remark in remarks:
        log.warning("%s: %s", printable(path), remark)
    return written, no_calculix


def _refuse_sources(written: list[Path], deck: PartDeck) -> None:
    """Refuse to overwrite a file of the deck."""
    for file in written:
        if file.exists() and any(map(file.samefile, deck.files)):
            raise ValueError(
                f"{printable(file)}: this file of the deck is not overwritten: specify "
                "another folder"
            )


def _by_part(deck: PartDeck, index: ndarray) -> str:
    """First numbers of elements by instance, part or property, if there are several."""
    parts = [x.scope or x.owner for x in deck._elements]
    numbers: dict[str, list[int]] = {}
    for i in index.tolist():
        numbers.setdefault(parts[i], []).append(deck._elements[i].number)
    listed = []
    for part, own in numbers.items():
        more = f" and {len(own) - _LISTED} more" if len(own) > _LISTED else ""
        of_part = f" of {printable(part)}" if len(set(parts)) > 1 and part else ""
        listed.append(", ".join(map(str, own[:_LISTED])) + more + of_part)
    return "; ".join(listed)


def _layup(
    deck: PartDeck,
    fibres: FibresInSpace,
    thickness: float | ndarray,
    material: str | None,
) -> Layup:
    n, t = deck.mesh.n_elements, np.asarray(thickness, dtype=float)
    if fibres.covered.shape != (n,):
        raise ValueError(
            f"fibres must be in the {n} elements of the deck, not in "
            f"{fibres.covered.size}"
        )
    used = t[fibres.covered] if t.shape == (n,) else t
    if t.shape not in ((), (n,)) or not (np.isfinite(used) & (used > 0)).all():
        raise ValueError(f"thickness must be positive, a number or of shape ({n},)")
    if not fibres.covered.any():
        raise ValueError("the ply does not cover any element of the deck")
    if material is not None and not _NAME.fullmatch(material):
        raise ValueError(
            f"the material {printable(material)!r} must be a name of letters, digits, "
            "points, hyphens and underscores"
        )
    on_deck = replace(fibres, mesh=deck.mesh)
    return Layup.of(deck._elements, on_deck, t, material)
