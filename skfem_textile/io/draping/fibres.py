"""Fibres of a draped ply in files: VTU, CSV and input of Abaqus."""

import csv
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...drape import SAME_AXES, Axes, FibresInSpace, ToolMesh, fibres_on_ply
from ...fabric.directions.per_element import FibreDirections
from ...mesh.user_input import printable
from ...solve.result import Result
from ..decks.write_deck import deck_of
from ..fibres import write_cells, write_directions
from ..fields import cell_fields, on_users_elements

#: Names of files that `write_draped` writes.
DRAPED = ("fibres.vtu", "fibres.csv", "fibres.inp")

_VECTORS = ("warp_direction", "weft_direction")
_MEASURES = ("warp_angle_deg", "weft_angle_deg", "shear_angle_deg")
_COLUMNS = ("element", "x", "y", "z", "covered", *_MEASURES)


def write_fibres(path: str | os.PathLike[str], fibres: FibresInSpace) -> None:
    """Write the fibres in elements in space.

    A .vtu has the vectors ``warp_direction``, ``weft_direction`` and ``reference``,
    from which angles are counted, ``warp_angle_deg``, ``weft_angle_deg`` and
    ``shear_angle_deg``, and ``covered``, 1 or 0.  A .csv has the angles at the centre
    of each element.  A .inp of Abaqus has a distribution and an orientation for each
    family.  Elements are numbered from 1 on.  Where the ply does not reach, a .vtu has
    NaN, a .csv empty cells, and a .inp the set ``NOT_COVERED``.

    Parameters
    ----------
    path
        The file.
    fibres
        Of `fibres_on_tool` or `fibres_on_ply`.

    Raises
    ------
    ValueError
        If the name has another suffix.
    OSError
        If the file cannot be written.
    """
    path = Path(path)
    writers = {".vtu": _write_vtu, ".csv": _write_csv, ".inp": _write_deck}
    if path.suffix.lower() not in writers:
        raise ValueError(
            f"{printable(path)}: fibres are written to {', '.join(writers)}"
        )
    writers[path.suffix.lower()](path, fibres)


def _measures(fibres: FibresInSpace) -> tuple[ndarray, ...]:
    return *fibres.angles_deg(), np.degrees(fibres.shear_angle)


def _write_vtu(path: Path, fibres: FibresInSpace) -> None:
    fields = dict(zip(_VECTORS, (fibres.warp.T, fibres.weft.T), strict=True))
    fields["reference"] = fibres.reference().T
    fields |= dict(zip(_MEASURES, _measures(fibres), strict=True))
    fields["covered"] = fibres.covered.astype(int)
    write_cells(path, fibres.mesh.cells, fibres.mesh.points, fields)


def _write_csv(path: Path, fibres: FibresInSpace) -> None:
    table = np.vstack([fibres.mesh.centres(), *_measures(fibres)]).T
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_COLUMNS)
        for i, row in enumerate(table.tolist(), 1):
            there = fibres.covered[i - 1]
            measures = row[3:] if there else [""] * len(_MEASURES)
            writer.writerow([i, *row[:3], int(there), *measures])


def _write_deck(path: Path, fibres: FibresInSpace) -> None:
    mesh, directions = fibres.mesh, (fibres.warp, fibres.weft, fibres.normal)
    path.write_text(deck_of(mesh.cells, mesh.points, *directions), encoding="utf-8")


def write_draped(
    result: Result, folder: str | os.PathLike[str], axes: Axes = SAME_AXES
) -> None:
    """Write the fibres of the last state for the next analysis: VTU, CSV and Abaqus.

    Nodes are where they ended, and directions those of the deformed fibres in the
    mean of each of the user's elements.

    Parameters
    ----------
    result
        The result.
    folder
        Where ``fibres.vtu``, ``fibres.csv`` and ``fibres.inp`` go.
    axes
        Axes of a ply in space among those of the files.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    ply, moved = result.ply, result.ply.nodal(result.u)
    files = [Path(folder) / name for name in DRAPED]
    if len(moved) == 3:
        fibres = _in_axes(fibres_on_ply(ply, result.u), axes)
        for file in files:
            write_fibres(file, fibres)
        return
    fields = on_users_elements(
        ply, cell_fields(ply, result.u, result.states[-1].parameters)
    )
    directions = FibreDirections(*(fields[name][:, :2].T for name in _VECTORS))
    points = ply.mesh.p + moved[:, : ply.mesh.nvertices]
    for file in files:
        write_directions(file, ply.mesh, directions, points)


def _in_axes(fibres: FibresInSpace, axes: Axes) -> FibresInSpace:
    """Fibres with positions and directions in the axes of a tool."""
    names = "normal", "warp", "weft"
    turned = {name: axes.turn @ getattr(fibres, name) for name in names}
    place = ToolMesh(axes.of_tool(fibres.mesh.points), fibres.mesh.cells)
    return replace(fibres, mesh=place, **turned)
