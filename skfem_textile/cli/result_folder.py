"""Atomic replacement of the results folder of a run."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Collection, Sequence
from pathlib import Path
from weakref import finalize

from ..solve.checksummed import Lock
from .interruption import held
from .output import OutputError

# Prefix of scratch folders for incomplete results.
_SCRATCH = ".unfinished-"


class ResultFolder:
    """Folder whose content is atomically replaced by the result of one run.

    The folder is locked until it contains the result or this object is deleted. If it
    was created for the result and is still empty, it is then removed. Incomplete files
    of a killed run are removed at the start.

    ``removed`` lists the names of files of an earlier run without a new file.  Such
    files are removed if ``stale`` contains their names, by default all.

    ``summary.json`` is removed first and written last, so that it never describes files
    that are missing, even if the process is killed.

    Parameters
    ----------
    path
        The folder; created if it is missing.
    names
        Files that a run may write: file names, or patterns in a subfolder.

    Raises
    ------
    OSError
        If the folder cannot be written, is not a folder, or another run writes to it.
    OutputError
        At the end of the block, if the result cannot be written, for example on a full
        disk. The previous content of the folder remains.
    """

    def __init__(self, path: str | os.PathLike[str], names: Sequence[str]) -> None:
        self.path = Path(path)
        self._names = sorted(names, key=self._is_summary, reverse=True)
        self.stale: Collection[str] = names
        self.removed: list[str] = []
        try:
            _refuse_unwritable(self.path)
            for name in names:
                target = self.path / name
                if target.is_dir():
                    raise IsADirectoryError(f"{target} is a folder")
                if target.parent.exists() and not target.parent.is_dir():
                    raise NotADirectoryError(f"{target.parent} is not a folder")
            created = [p for p in (self.path, *self.path.parents) if not p.exists()]
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OSError(self._unwritable(error)) from None
        lock = Lock(self.path)
        self._release = finalize(self, _release, lock, created)
        if lock.is_held:  # scratch folders here belong to runs that have ended
            for scratch in self.path.glob(f"{_SCRATCH}*"):
                shutil.rmtree(scratch, ignore_errors=True)

    def __enter__(self) -> Path:
        """Create a scratch folder."""
        try:
            scratch = tempfile.mkdtemp(prefix=_SCRATCH, dir=self.path)
        except OSError as error:
            raise OutputError(self._unwritable(error)) from None
        self._scratch = Path(scratch)
        return self._scratch

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, *_: object
    ) -> None:
        """Replace the result of an earlier run by the content of the scratch folder."""
        try:
            if error is None:
                with held():
                    self._move()
        except OSError as failure:
            error = failure
        finally:
            shutil.rmtree(self._scratch, ignore_errors=True)
            self._release()
        if isinstance(error, OSError) and not isinstance(
            error, OutputError | BrokenPipeError
        ):
            raise OutputError(self._unwritable(error)) from None

    def _move(self) -> None:
        """Replace the files of an earlier run by the new ones."""
        for name in self._names:
            old_files = [*self.path.glob(name)]
            if not any(self._scratch.glob(name)):
                if name not in self.stale:
                    continue
                self.removed += [name] if old_files else []
            for old_file in old_files:
                old_file.unlink()
                with contextlib.suppress(OSError):  # another file is in it
                    for folder in old_file.relative_to(self.path).parents[:-1]:
                        (self.path / folder).rmdir()
        for file in sorted(self._scratch.rglob("*"), key=self._is_summary):
            target = self.path / file.relative_to(self._scratch)
            if file.is_dir():
                target.mkdir(exist_ok=True)
            else:
                file.replace(target)

    def removed_text(self) -> str:
        """Note on the removed files that no later file replaces; empty if none."""
        names = [name for name in self.removed if not any(self.path.glob(name))]
        return f"; removed from an earlier run: {', '.join(names)}" if names else ""

    @staticmethod
    def _is_summary(file: str | Path) -> bool:
        return Path(file).name == "summary.json"

    def _unwritable(self, error: OSError) -> str:
        return f"cannot write results to {self.path}: {error.strerror or error}"


def _release(lock: Lock, created: Sequence[Path]) -> None:
    """Release the folder; remove created folders that are empty."""
    with contextlib.suppress(OSError):
        for folder in created:
            folder.rmdir()
    lock.release()


def _refuse_unwritable(folder: Path) -> None:
    """Test writing into a folder, or into its nearest existing parent."""
    while not folder.exists():
        folder = folder.parent
    tempfile.TemporaryFile(dir=folder).close()
