"""Meshes in, in any format that meshio knows, and results out."""

import contextlib
import csv
import io
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from weakref import finalize
from xml.etree import ElementTree

import meshio
import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri
from skfem.io.meshio import from_meshio

from .fields import cell_fields, on_parents, point_fields
from .interruption import held
from .lock import Lock
from .meshes import MeshError, check_mesh, check_quads
from .output import OutputError
from .ply import Ply
from .result import Result
from .splitting import SplitMesh, boundary_edges, split_cells, was_split

#: What `write_fields` may write.
FIELDS = ("step_[0-9]*.vtu", "steps.pvd", "own_step_[0-9]*.vtu", "own_steps.pvd")

_IGNORED_CELLS = {"vertex", "line"}


def read_mesh(path: str | os.PathLike[str], split: bool = True) -> Mesh:
    """Read a plane mesh: Gmsh .msh, Abaqus .inp, .vtu and more.

    Triangles, and quadrilaterals beside triangles, are split in quadrilaterals
    (`split_cells`).  Named groups of edges (Gmsh physical groups) and of nodes (Abaqus
    node sets) become boundaries of that name.

    Parameters
    ----------
    path
        The file.
    split
        Whether triangles are split.  If not, a mesh of triangles alone is a
        `skfem.MeshTri`, as `Quadratic` takes it.

    Raises
    ------
    MeshError
        If the file cannot be read, has other cells than triangles and four-node
        quadrilaterals, or both and they are not to be split, does not lie in a plane
        z = const, or is not a sound mesh (`check_mesh`).
    """
    path = Path(path)
    if not path.is_file():
        raise MeshError(f"{path}: no such file")
    raw = _read(path)
    try:
        return _mesh(raw, split)
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


def _mesh(raw: meshio.Mesh, split: bool) -> Mesh:
    kinds = {block.type for block in raw.cells} - _IGNORED_CELLS
    if not kinds or not kinds <= {"quad", "triangle"}:
        found = ", ".join(sorted(kinds)) or "none"
        raise MeshError(
            "only triangles and four-node quadrilaterals are supported, found " + found
        )
    size = np.ptp(raw.points, axis=0)
    if not np.all(size[2:] <= 1e-9 * size[:2].max()):
        raise MeshError("the mesh must lie in a plane z = const")
    if split and kinds != {"quad"}:
        return _split(raw)
    if len(kinds) > 1:
        raise MeshError(
            "triangles beside quadrilaterals must be split, for a formulation of "
            "quadrilaterals"
        )
    (kind,) = kinds
    cells = {"quad": MeshQuad, "triangle": MeshTri}[kind]
    check_mesh(cells(raw.points[:, :2].T.copy(), raw.cells_dict[kind].T.copy()))
    return _with_node_sets(from_meshio(raw, ignore_orientation=True), raw.point_sets)


def _split(raw: meshio.Mesh) -> SplitMesh:
    """Quadrilaterals of triangles, or of triangles and quadrilaterals."""
    points = raw.points[:, :2].T.copy()
    blocks = [i for i, b in enumerate(raw.cells) if b.type in ("triangle", "quad")]
    cells = [np.asarray(raw.cells[i].data).T for i in blocks]
    for cell in cells:
        if cell.min() < 0 or cell.max() >= points.shape[1]:
            raise MeshError(f"the mesh has nodes 0 to {points.shape[1] - 1} only")
    starts = np.cumsum([0, *(cell.shape[1] for cell in cells[:-1])])
    first = dict(zip(blocks, starts, strict=True))
    edges: dict[str, list[ndarray]] = {}
    subdomains: dict[str, list[ndarray]] = {}
    for name, block, members in _groups(raw):
        if raw.cells[block].type == "line":
            edges.setdefault(name, []).append(raw.cells[block].data[members].T)
        elif block in first:
            subdomains.setdefault(name, []).append(first[block] + members)
    outer = boundary_edges(cells)
    for name, nodes in raw.point_sets.items():
        within = outer[:, np.isin(outer, nodes).all(axis=0)]
        if within.size:
            edges.setdefault(name, []).append(within)
    mesh = split_cells(
        points,
        cells,
        {name: np.concatenate(parts, axis=1) for name, parts in edges.items()},
        {name: np.concatenate(parts) for name, parts in subdomains.items()},
    )
    check_quads(mesh)
    return mesh


def _groups(raw: meshio.Mesh) -> Iterator[tuple[str, int, ndarray]]:
    """Named groups of cells: name, block of cells, numbers in the block."""
    tags: Any = raw.cell_data.get("gmsh:physical", [])
    for name, (tag, dimension) in raw.field_data.items():
        for block, physical in enumerate(tags):
            if raw.cells[block].dim == dimension:
                yield name, block, np.flatnonzero(physical == tag)
    for name, sets in raw.cell_sets.items():
        members: Any
        for block, members in enumerate(sets):
            if not name.startswith("gmsh:") and members is not None and len(members):
                yield name, block, np.asarray(members, dtype=int)


def _with_node_sets(mesh: Mesh, node_sets: Mapping[str, Any]) -> Mesh:
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
    """Write every state as ``step_0000.vtu``, ... and ``steps.pvd`` into a folder.

    The points are those of the undeformed ply: a viewer that warps them by
    ``displacement`` shows the deformed one.  Fields are those of `point_fields` and
    `cell_fields`.  The .pvd file lists the steps by load factor; ParaView opens it as
    one series.
    Of a mesh that was split (`SplitMesh`) there is a second series, ``own_steps.pvd``,
    on the original elements.  Steps that the folder already holds are removed.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for pattern in FIELDS:
        for stale in folder.glob(pattern):
            stale.unlink()
    ply, mesh = result.ply, result.ply.mesh
    _write_series(result, folder, "", [mesh.t], lambda u: cell_fields(ply, u))
    if was_split(mesh):
        _write_series(
            *(result, folder, "own_", mesh.cells),
            lambda u: on_parents(mesh, cell_fields(ply, u)),
        )


def _write_series(
    result: Result,
    folder: Path,
    prefix: str,
    cells: Sequence[ndarray],
    fields: Callable[[ndarray], dict[str, ndarray]],
) -> None:
    """Write a file per state, and the .pvd file that lists them."""
    series = ElementTree.Element("VTKFile", type="Collection", version="0.1")
    collection = ElementTree.SubElement(series, "Collection")
    for i, state in enumerate(result.states):
        name = f"{prefix}step_{i:04d}.vtu"
        _write_state(result.ply, state.u, folder / name, cells, fields(state.u))
        ElementTree.SubElement(
            collection, "DataSet", timestep=repr(state.load_factor), file=name
        )
    ElementTree.ElementTree(series).write(folder / f"{prefix}steps.pvd")


def _write_state(
    ply: Ply,
    u: ndarray,
    path: Path,
    cells: Sequence[ndarray],
    fields: dict[str, ndarray],
) -> None:
    # The vertices of the cells: not the other nodes of a split mesh.
    n = 1 + max(cell.max() for cell in cells)
    points = {k: v[:n] for k, v in point_fields(ply, u).items()}
    ends = np.cumsum([cell.shape[1] for cell in cells])[:-1]
    by_block: dict[str, Any] = {k: np.split(v, ends) for k, v in fields.items()}
    meshio.Mesh(
        np.pad(ply.mesh.p, ((0, 1), (0, 0))).T[:n],
        [({3: "triangle", 4: "quad"}[len(cell)], cell.T) for cell in cells],
        point_data=dict(points),
        cell_data=by_block,
    ).write(path)
    # What a viewer shows, and warps by, first; meshio has no say in it.
    text = path.read_bytes()
    text = text.replace(b"<PointData>", b'<PointData Vectors="displacement">', 1)
    text = text.replace(b"<CellData>", b'<CellData Scalars="shear_angle">', 1)
    path.write_bytes(text)


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
    """A folder that receives the whole result of a run at once, and of no other run.

    It is locked until the result is in it, or this object is no more; it is then
    removed if it was made for this and is empty.

    ``summary.json`` goes first and comes last, so that it never speaks of files that
    are not there, whenever the process is killed.

    Parameters
    ----------
    path
        The folder; made if it is not there.
    names
        What a run may write into it: names of files, or patterns in a subfolder.

    Raises
    ------
    OSError
        If the folder cannot be written, or something else stands in its way, or another
        run writes to it.
    OutputError
        On leaving, if the result cannot be written, as on a full disk; what the folder
        held before is left as it was.
    """

    def __init__(self, path: str | os.PathLike[str], names: Sequence[str]) -> None:
        self.path = Path(path)
        self._names = sorted(names, key=self._is_summary, reverse=True)
        try:
            _refuse_unwritable(self.path)
            for name in names:
                target = self.path / name
                if target.is_dir():
                    raise IsADirectoryError(f"{target} is a folder")
                if target.parent.exists() and not target.parent.is_dir():
                    raise NotADirectoryError(f"{target.parent} is no folder")
            made = [p for p in (self.path, *self.path.parents) if not p.exists()]
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OSError(self._unwritable(error)) from None
        self._leave = finalize(self, _leave, Lock(self.path), made)

    def __enter__(self) -> Path:
        """Give a scratch folder to write into."""
        try:
            scratch = tempfile.mkdtemp(prefix=".unfinished-", dir=self.path)
        except OSError as error:
            raise OutputError(self._unwritable(error)) from None
        self._scratch = Path(scratch)
        return self._scratch

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, *_: object
    ) -> None:
        """Put the scratch folder's content in place of an earlier run's."""
        try:
            if error is None:
                with held():
                    self._move()
        except OSError as failure:
            error = failure
        finally:
            shutil.rmtree(self._scratch, ignore_errors=True)
            self._leave()
        if isinstance(error, OSError) and not isinstance(
            error, OutputError | BrokenPipeError
        ):
            raise OutputError(self._unwritable(error)) from None

    def _move(self) -> None:
        """Remove an earlier run's files, and put the new ones there."""
        for name in self._names:
            for stale in self.path.glob(name):
                stale.unlink()
        for file in sorted(self._scratch.rglob("*"), key=self._is_summary):
            target = self.path / file.relative_to(self._scratch)
            if file.is_dir():
                target.mkdir(exist_ok=True)
            else:
                file.replace(target)

    @staticmethod
    def _is_summary(file: str | Path) -> bool:
        return Path(file).name == "summary.json"

    def _unwritable(self, error: OSError) -> str:
        return f"cannot write results to {self.path}: {error.strerror or error}"


def _leave(lock: Lock, made: Sequence[Path]) -> None:
    """Let others have a folder; those that were made for it go if they are empty."""
    with contextlib.suppress(OSError):
        for folder in made:
            folder.rmdir()
    lock.release()


def _refuse_unwritable(folder: Path) -> None:
    """Try to write into a folder, or into the nearest one above it that is there."""
    while not folder.exists():
        folder = folder.parent
    tempfile.TemporaryFile(dir=folder).close()
