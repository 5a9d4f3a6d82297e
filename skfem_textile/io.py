"""Meshes in and results out, in any format that meshio knows."""

import contextlib
import csv
import io
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from skfem import MeshQuad
from skfem.io.meshio import from_meshio

from .fields import cell_fields, point_fields
from .meshes import MeshError, check_quads
from .result import Result

_IGNORED_CELLS = {"vertex", "line"}


def read_mesh(path: str | os.PathLike[str]) -> MeshQuad:
    """Read a mesh of four-node quadrilaterals: Gmsh .msh, Abaqus .inp, .vtu and more.

    Named groups of edges (Gmsh physical groups, Abaqus element sets) and of nodes
    (Abaqus node sets) become boundaries of that name.

    Raises
    ------
    MeshError
        If the file cannot be read, has other cells than quadrilaterals, does not
        lie in a plane z = const, or is not a sound mesh (`check_quads`).
    """
    path = Path(path)
    if not path.is_file():
        raise MeshError(f"{path}: no such file")
    raw = _read(path)
    try:
        kinds = {block.type for block in raw.cells} - _IGNORED_CELLS
        if kinds != {"quad"}:
            found = ", ".join(sorted(kinds)) or "none"
            raise MeshError(
                f"only four-node quadrilaterals are supported, found {found}"
            )
        if raw.points.shape[1] == 3 and np.ptp(raw.points[:, 2]) > 0:
            raise MeshError("the mesh must lie in a plane z = const")
        mesh = from_meshio(raw, ignore_orientation=True)
        check_quads(mesh)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None
    return _with_node_sets(mesh, raw.point_sets)


def _read(path: Path) -> meshio.Mesh:
    """Read with meshio, which prints and exits where it cannot."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = str(error) if isinstance(error, meshio.ReadError) else ""
        raise MeshError(
            f"{path}: not a mesh that meshio can read. {reason}".strip()
        ) from None


def _with_node_sets(mesh: MeshQuad, node_sets: Mapping[str, Any]) -> MeshQuad:
    """Name the boundary edges whose both ends are in a set of nodes."""
    boundary = mesh.boundary_facets()
    ends = mesh.facets[:, boundary]
    edges: dict[str, Any] = {
        name: boundary[np.isin(ends, nodes).all(axis=0)]
        for name, nodes in node_sets.items()
    }
    named = {name: e for name, e in edges.items() if e.size}
    return mesh.with_boundaries(named) if named else mesh


def write_fields(result: Result, folder: str | os.PathLike[str]) -> None:
    """Write every state as ``step_0000.vtu``, ``step_0001.vtu``, ... into a folder.

    The points are those of the reference configuration; the fields are those of
    `point_fields` and `cell_fields`.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    mesh, ply = result.ply.mesh, result.ply
    points = np.pad(mesh.p, ((0, 1), (0, 0))).T
    for i, state in enumerate(result.states):
        meshio.Mesh(
            points,
            {"quad": mesh.t.T},
            point_data=dict(point_fields(ply, state.u)),
            cell_data={k: [v] for k, v in cell_fields(ply, state.u).items()},
        ).write(folder / f"step_{i:04d}.vtu")


def write_history(result: Result, path: str | os.PathLike[str]) -> None:
    """Write the history of a run as CSV, one row per converged state."""
    rows = result.history()
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def write_summary(
    summary: Mapping[str, str | int | float | bool], path: str | os.PathLike[str]
) -> None:
    """Write a summary as JSON."""
    Path(path).write_text(json.dumps(summary, indent=2) + "\n")


@contextlib.contextmanager
def all_or_nothing(folder: str | os.PathLike[str]) -> Iterator[Path]:
    """A scratch folder whose content moves into ``folder`` once it is complete.

    What ``folder`` already holds under the same names is replaced; nothing else in
    it is touched.

    Raises
    ------
    OSError
        If the folder cannot be written, before anything is.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=folder))
    try:
        yield scratch
        for item in scratch.iterdir():
            target = folder / item.name
            if target.is_dir():
                shutil.rmtree(target)
            os.replace(item, target)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
