"""Writing of results: fields, history, summary, and their folder."""

import contextlib
import csv
import json
import math
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

from ..files.interruption import held
from ..files.lock import Lock
from ..files.output import OutputError
from ..solve.body import Body
from ..solve.result import Result
from ..splitting import was_split
from .fields import cell_fields, on_parents, point_fields

#: Names of files that `write_fields` writes.
FIELDS = ("step_[0-9]*.vtu", "steps.pvd", "own_step_[0-9]*.vtu", "own_steps.pvd")

# Prefix of the name of a folder that holds a result until it is complete.
_SCRATCH = ".unfinished-"


@contextlib.contextmanager
def _name_path(path: str | os.PathLike[str]) -> Iterator[None]:
    """Add the path to errors without one, such as that of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            error.filename = os.fspath(path)
        raise


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
    with _name_path(folder):
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
    ply: Body,
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
    # Fields that a viewer shows, and warps by, at first; meshio cannot set them.
    text = path.read_bytes()
    text = text.replace(b"<PointData>", b'<PointData Vectors="displacement">', 1)
    text = text.replace(b"<CellData>", b'<CellData Scalars="shear_angle">', 1)
    path.write_bytes(text)


def write_history(result: Result, path: str | os.PathLike[str]) -> None:
    """Write the history of a run as CSV, one row per converged state."""
    rows = result.history()
    with _name_path(path), open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def write_summary(summary: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write a summary as JSON; null stands for a number that is not finite."""
    with _name_path(path):
        Path(path).write_text(json.dumps(_finite(summary), indent=2) + "\n")


def _finite(value: Any) -> Any:
    """Replace numbers that are not finite by null, at any depth."""
    if isinstance(value, Mapping):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class ResultFolder:
    """A folder that receives the result of one run, all at once.

    It is locked until the result is in it or this object is deleted; a folder that was
    made for this and is empty is removed then.  Unfinished files of a killed run are
    removed.

    ``summary.json`` is removed first and written last, so that it never describes files
    that are missing, even if the process is killed.

    Parameters
    ----------
    path
        The folder; made if it is missing.
    names
        Files that a run may write: names of files, or patterns in a subfolder.

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
        lock = Lock(self.path)
        self._leave = finalize(self, _leave, lock, made)
        if lock.is_held:  # scratch folders here belong to runs that have ended
            for scratch in self.path.glob(f"{_SCRATCH}*"):
                shutil.rmtree(scratch, ignore_errors=True)

    def __enter__(self) -> Path:
        """Give a scratch folder to write into."""
        try:
            scratch = tempfile.mkdtemp(prefix=_SCRATCH, dir=self.path)
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
        """Replace the files of an earlier run by the new ones."""
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
    """Release a folder; remove those that were made for it if they are empty."""
    with contextlib.suppress(OSError):
        for folder in made:
            folder.rmdir()
    lock.release()


def _refuse_unwritable(folder: Path) -> None:
    """Try to write into a folder, or into its nearest parent that exists."""
    while not folder.exists():
        folder = folder.parent
    tempfile.TemporaryFile(dir=folder).close()
