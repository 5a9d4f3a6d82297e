"""A run on disk, one file per converged state, to go on from after an interruption."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

import numpy as np
from numpy import ndarray

from ..body import Body, Supports
from ..states import State
from . import fingerprint, sealed
from .contents import VECTORS, Progress, progress_of, same, state_of
from .lock import Lock
from .sealed import Content

# Version of the files; another one is refused.
_FORMAT = 7
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
    ply, constraints
        The ply that is loaded, and its conditions as fixed unknowns.
    settings
        What else the result depends on.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        ply: Body,
        constraints: Supports,
        settings: Mapping[str, Any],
    ) -> None:
        try:
            self.folder = Path(folder)
        except TypeError:
            raise CheckpointError(
                f"checkpoint must be a folder, not {folder!r}"
            ) from None
        if "\0" in str(folder):
            raise CheckpointError(f"checkpoint {str(folder)!r} is no path")
        self._ply, self._constraints = ply, constraints
        described = fingerprint.settings(ply, constraints)
        given = {"format": _FORMAT, **settings, **described}
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
        arrays = self._fingerprint()
        with self._writing():
            self._last = sealed.write(
                self.folder / f".{_RUN}", self._run, "run", "", self._settings, arrays
            )

    def save(self, number: int, state: State, progress: Progress) -> None:
        """Write a state, and where the stepper is.

        The first state of a run takes the place of a finished run.

        Raises
        ------
        CheckpointError
            If it cannot be written.
        """
        text = asdict(replace(state, parameters={}))
        path, clock = progress.path.saved(), asdict(progress.clock)
        text["progress"] = progress._asdict() | {"path": path, "clock": clock}
        arrays = {"u": text.pop("u")}
        del text["shares"], text["parameters"]  # `Replay` computes the shares
        for key in VECTORS:
            text[key] = {name: v.tolist() for name, v in text[key].items()}
        for term, values in state.parameters.items():
            arrays |= {f"{term} {name}": array for name, array in values.items()}
        name = f"state_{number:06d}"
        with self._writing():
            beside = self.folder / f".{name}.npz"
            self._last = sealed.write(beside, self._run, name, self._last, text, arrays)
            if number == 0:
                for file in reversed(self._files()):
                    file.unlink()
                (self.folder / f".{_RUN}").replace(self.folder / _RUN)
            beside.replace(self.folder / f"{name}.npz")

    def load(self, checked: Callable[[State], State]) -> Saved | None:
        """Read and check every state; None if there is none.

        Parameters
        ----------
        checked
            Called with one state after the other; returns the whole state, or raises
            ValueError where it is not one of this run.

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
                states.append(state_of(content, states, self._ply.parameters_at_rest))
        for i, file in enumerate(files):
            with self._using(file):
                states[i] = checked(states[i])
        with self._using(files[-1]):
            saved = contents[-1].text["progress"]
            progress = progress_of(saved, states, self._settings)
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
        identity = self._fingerprint()
        for name in identity | arrays:
            missing = np.empty(0)
            new, old = identity.get(name, missing), arrays.get(name, missing)
            if not same(old, new):
                raise CheckpointError(
                    f"checkpoint {self.folder} is of another run: its {name} differ"
                )

    def _fingerprint(self) -> dict[str, ndarray]:
        steps = self._settings["steps"]
        return fingerprint.arrays(self._ply, self._constraints, steps)

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
            message = (
                f"cannot write checkpoint {self.folder}: {error.strerror or error}"
            )
            if error.strerror and self._files():  # not where another run writes to it
                message += "; what it holds remains"
            raise CheckpointError(message) from None

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
        ) as error:
            raise CheckpointError(
                f"checkpoint file {file} is damaged: {_shown(error)}"
            ) from None


def _shown(value: object) -> str:
    """What a file may hold, short and on one line."""
    text = "".join(char if char.isprintable() else " " for char in str(value))
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
