"""A run on disk, one file per converged state, to go on from after an interruption."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

import numpy as np
from numpy import ndarray

from ..problem import Problem, Start
from ..result import State
from . import fingerprint, sealed
from .consistency import check_state, same
from .contents import VECTORS, Progress, progress_of, state_of
from .lock import Lock
from .sealed import Content

_FORMAT = 5
_RUN, _STATES = "run.npz", "state_*.npz"

# Characters of a setting that a message shows.
_SHOWN = 100


class CheckpointError(ValueError):
    """A checkpoint that cannot be used; the message says why and what to do."""


class Saved(NamedTuple):
    """States read from a checkpoint, and where the stepper was at the last of them."""

    states: list[State]
    progress: Progress


class Checkpoint:
    """The states of a run in a folder.

    Every file is written beside its place and then renamed, so a run may be killed at
    any moment; the next removes what it left there.  ``run.npz`` tells runs apart: by
    their settings as given, and by mesh, laws, conditions and forces (`fingerprint`).
    Every state has the name of the run, its own number, and a digest of its content and
    of all files before it.

    Parameters
    ----------
    folder
        The folder; made when a run begins.
    problem
        The problem that is run.
    settings
        What else the result depends on.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        problem: Problem,
        settings: Mapping[str, Any],
    ) -> None:
        try:
            self.folder, self._problem = Path(folder), problem
        except TypeError:
            raise CheckpointError(
                f"checkpoint must be a folder, not {folder!r}"
            ) from None
        if "\0" in str(folder):
            raise CheckpointError(f"checkpoint {str(folder)!r} is no path")
        given = {"format": _FORMAT, **settings, **fingerprint.settings(problem)}
        self._settings = json.loads(json.dumps(given))
        self._run, self._last = "", ""
        self._lock: Lock | None = None

    def release(self) -> None:
        """Let others have the folder."""
        if self._lock is not None:
            self._lock.release()
        self._lock = None

    def begin(self) -> None:
        """Make the folder ready for a new run; a finished one stays until `save`.

        Raises
        ------
        CheckpointError
            If it holds an unfinished run, or another run writes to it, or it cannot be
            written.
        """
        with self._writing():
            self.folder.mkdir(parents=True, exist_ok=True)
        self._hold()
        if self._files():
            *_, last = self._states(self._read(_RUN, "", ""))
            with self._using(self._files()[-1]):
                finished = last.text["load_factor"] == 1.0
            if not finished:
                raise CheckpointError(
                    f"checkpoint {self.folder} holds an unfinished run: resume it, or "
                    "remove the folder"
                )
        self._run = uuid4().hex
        arrays = fingerprint.arrays(self._problem, self._settings["steps"])
        with self._writing():
            self._last = sealed.write(
                self.folder / f".{_RUN}", self._run, "run", "", self._settings, arrays
            )

    def save(self, number: int, state: State, progress: Progress) -> None:
        """Write a state, where the stepper is, and what the ply's terms remember.

        The first state of a run takes the place of a finished run.

        Raises
        ------
        CheckpointError
            If it cannot be written.
        """
        text = asdict(state) | {"work": {}}
        path, clock = progress.path.saved(), asdict(progress.clock)
        text["progress"] = progress._asdict() | {"path": path, "clock": clock}
        arrays = {"u": text.pop("u")}
        for key in VECTORS:
            text[key] = {name: v.tolist() for name, v in text[key].items()}
        for term, memory in self._problem.ply.memories.items():
            text["work"][term] = float(memory.work)
            for name, array in memory.parameters.items():
                arrays[f"{term} {name}"] = np.asarray(array)
        name = f"state_{number:06d}"
        with self._writing():
            beside = self.folder / f".{name}.npz"
            self._last = sealed.write(beside, self._run, name, self._last, text, arrays)
            if number == 0:
                for file in reversed(self._files()):
                    file.unlink()
                (self.folder / f".{_RUN}").replace(self.folder / _RUN)
            beside.replace(self.folder / f"{name}.npz")

    def load(self) -> Saved | None:
        """Read every state, and let the ply's terms remember the last; None if none is.

        Raises
        ------
        CheckpointError
            If a file is damaged or missing, or belongs to another run, or another run
            writes to the folder.
        """
        if not self.folder.is_dir():
            return None
        self._hold()
        if not (files := self._files()):
            return None
        run = self._read(_RUN, "", "")
        with self._using(self.folder / _RUN):
            self._check_identity(run)
        states: list[State] = []
        contents = list(self._states(run))
        for file, content in zip(files, contents, strict=True):
            with self._using(file):
                states.append(state_of(content, states))
        self._check(files, states, contents)
        with self._using(files[-1]):
            told = contents[-1].text["progress"]
            progress = progress_of(told, states, self._settings)
        self._last = contents[-1].digest
        return Saved(states, progress)

    def _files(self) -> list[Path]:
        """The files of states in their order, whatever else the folder holds."""
        files = [f for f in self.folder.glob(_STATES) if f.stem[6:].isdecimal()]
        return sorted(files, key=lambda file: int(file.stem[6:]))

    def _states(self, run: Content) -> Iterator[Content]:
        """What the files of states hold, each of this run and with its number."""
        last = run
        for number, file in enumerate(self._files()):
            if file.stem != (name := f"state_{number:06d}"):
                raise CheckpointError(
                    f"checkpoint file {self.folder / name}.npz is missing"
                )
            last = self._read(file.name, run.run, last.digest)
            yield last

    def _read(self, name: str, run: str, before: str) -> Content:
        path = self.folder / name
        try:
            return sealed.read(path, run, before)
        except FileNotFoundError:
            raise CheckpointError(f"checkpoint file {path} is missing") from None
        except OSError as error:
            raise CheckpointError(
                f"checkpoint file {path} cannot be read: {error.strerror or error}"
            ) from None
        except ValueError as error:
            raise CheckpointError(f"checkpoint file {path} {error}") from None

    def _check_identity(self, run: Content) -> None:
        settings, arrays = run.text, run.arrays
        for name, value in self._settings.items():
            if settings.get(name) != value:
                raise CheckpointError(
                    f"checkpoint {self.folder} is of another run: {name} was "
                    f"{_shown(settings.get(name))}, is {_shown(value)}"
                )
        self._run = run.run
        identity = fingerprint.arrays(self._problem, self._settings["steps"])
        for name in identity | arrays:
            new, old = (some.get(name, np.empty(0)) for some in (identity, arrays))
            if not same(old, new):
                raise CheckpointError(
                    f"checkpoint {self.folder} is of another run: its {name} differ"
                )

    def _check(
        self, files: list[Path], states: list[State], contents: list[Content]
    ) -> None:
        """Find anew what each state's forces are, and what the ply remembers of it."""
        self._problem.ply.reset()
        start = None
        for file, state, content in zip(files, states, contents, strict=True):
            with self._using(file):
                start = self._check_state(state, content, start)

    def _check_state(
        self, state: State, content: Content, start: Start | None
    ) -> Start:
        """Check a state that follows another; returns the start of the next."""
        problem, u = self._problem.at(state.load_factor), state.u
        check_state(problem, state, start)
        problem.ply.commit(u)
        found = self._memories()
        self._remember(content)
        if not all(same(a, b) for a, b in zip(self._memories(), found, strict=True)):
            raise ValueError("what its ply remembers is not of its displacement")
        return Start(u, problem.residual(u), problem.load(u), None)

    def _memories(self) -> list[ndarray]:
        memories = self._problem.ply.memories.values()
        return [a for m in memories for a in (np.array(m.work), *m.parameters.values())]

    def _remember(self, content: Content) -> None:
        for term, memory in self._problem.ply.memories.items():
            found = {k: content.arrays[f"{term} {k}"] for k in memory.parameters}
            for name, value in memory.parameters.items():
                old = np.asarray(value)
                if found[name].shape != old.shape or found[name].dtype != old.dtype:
                    raise ValueError(f"its {name} is not of this ply")
            memory.restore(found, content.text["work"][term])

    def _hold(self) -> None:
        """Let no other run write to the folder, and remove what one left half done."""
        if self._lock is not None:
            return
        with self._writing():
            self._lock = Lock(self.folder)
        if self._lock.is_held:
            for beside in (f".{_RUN}", f".{_STATES}"):
                for file in self.folder.glob(beside):
                    with suppress(OSError):  # in a folder that can only be read
                        file.unlink()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            said = f"cannot write checkpoint {self.folder}: {error.strerror or error}"
            if error.strerror and self._files():  # not where another run writes to it
                said += "; what it holds remains"
            raise CheckpointError(said) from None

    @contextmanager
    def _using(self, file: Path) -> Iterator[None]:
        """Refuse what is whole and makes no sense."""
        try:
            yield
        except CheckpointError:
            raise
        except (
            ArithmeticError,
            AttributeError,
            LookupError,
            TypeError,
            ValueError,
        ) as e:
            raise CheckpointError(
                f"checkpoint file {file} is damaged: {_shown(e)}"
            ) from None


def _shown(value: object) -> str:
    """What a file may hold, short and on one line."""
    text = "".join(c if c.isprintable() else " " for c in str(value))
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
