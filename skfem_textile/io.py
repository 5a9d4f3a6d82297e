"""Meshes in, in any format that meshio knows, and results out."""

import contextlib
import csv
import io
import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from skfem import MeshQuad
from skfem.io.meshio import from_meshio

from .fields import cell_fields, point_fields
from .meshes import MeshError, check_quads
from .result import Result

STEPS = "step_[0-9]*.vtu"

_IGNORED_CELLS = {"vertex", "line"}


def read_mesh(path: str | os.PathLike[str]) -> MeshQuad:
    """Read a mesh of four-node quadrilaterals: Gmsh .msh, Abaqus .inp, .vtu and more.

    Named groups of edges (Gmsh physical groups) and of nodes (Abaqus node sets)
    become boundaries of that name.

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
        return _quad_mesh(raw)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None


def _read(path: Path) -> meshio.Mesh:
    """Read with meshio, which prints and exits where it cannot."""
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except OSError as error:
        raise MeshError(f"{path}: {error.strerror}") from None
    except (Exception, SystemExit) as error:
        reason = (said.getvalue() or str(error)).strip().partition("\n")[0]
        raise MeshError(f"{path}: meshio cannot read it. {reason}".strip()) from None


def _quad_mesh(raw: meshio.Mesh) -> MeshQuad:
    kinds = {block.type for block in raw.cells} - _IGNORED_CELLS
    if kinds != {"quad"}:
        found = ", ".join(sorted(kinds)) or "none"
        raise MeshError(f"only four-node quadrilaterals are supported, found {found}")
    size = np.ptp(raw.points, axis=0)
    if not np.all(size[2:] <= 1e-9 * size[:2].max()):
        raise MeshError("the mesh must lie in a plane z = const")
    check_quads(MeshQuad(raw.points[:, :2].T.copy(), raw.cells_dict["quad"].T.copy()))
    return _with_node_sets(from_meshio(raw, ignore_orientation=True), raw.point_sets)


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

    Steps that the folder already holds are removed.  The points are those of the
    reference configuration; the fields are those of `point_fields` and `cell_fields`.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for stale in folder.glob(STEPS):
        stale.unlink()
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


def write_summary(summary: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write a summary as JSON."""
    Path(path).write_text(json.dumps(summary, indent=2) + "\n")


class ResultFolder:
    """A folder that receives the whole result of a run at once.

    Parameters
    ----------
    path
        The folder; made if it is not there.
    names
        What a run may write into it: names of files, or patterns in a subfolder.

    Raises
    ------
    OSError
        If the folder cannot be written, or something else stands in its way.
    """

    def __init__(self, path: str | os.PathLike[str], names: Sequence[str]) -> None:
        self.path, self._names = Path(path), names
        self._made = not self.path.exists()
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            for name in names:
                target = self.path / name
                if target.is_dir():
                    raise IsADirectoryError(f"{target} is a folder")
                if target.parent.exists() and not target.parent.is_dir():
                    raise NotADirectoryError(f"{target.parent} is no folder")
            self._scratch = Path(tempfile.mkdtemp(prefix=".unfinished-", dir=self.path))
        except OSError as error:
            reason = error.strerror or error
            raise OSError(f"cannot write results to {self.path}: {reason}") from None

    def __enter__(self) -> Path:
        """Give a scratch folder to write into."""
        return self._scratch

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        """Put the scratch folder's content in place of an earlier run's."""
        try:
            if error is None:
                for name in self._names:
                    for stale in self.path.glob(name):
                        stale.unlink()
                for file in self._scratch.rglob("*"):
                    target = self.path / file.relative_to(self._scratch)
                    if file.is_dir():
                        target.mkdir(exist_ok=True)
                    else:
                        file.replace(target)
        finally:
            shutil.rmtree(self._scratch, ignore_errors=True)
            if self._made and error is not None:
                shutil.rmtree(self.path, ignore_errors=True)
