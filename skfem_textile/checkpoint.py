"""A run on disk, one file per converged state, to go on from after an interruption."""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

import numpy as np
from numpy import ndarray

from .problem import Problem
from .result import State
from .verdict import Verdict

_FORMAT = 3
_RUN, _STATES = "run.npz", "state_[0-9]*.npz"

# What a state has of each condition.
_VECTORS = ("reactions", "displacements")

# How far the forces of the same ply may differ between machines.
_SAME = 1e-9


class CheckpointError(ValueError):
    """A checkpoint that cannot be used; the message says why and what to do."""


class Saved(NamedTuple):
    """States read from a checkpoint, and where the stepper was at the last of them."""

    states: list[State]
    progress: dict[str, Any]


class Checkpoint:
    """The states of a run in a folder.

    Every file is written beside its place and then renamed, so a run may be killed at
    any moment.  ``run.npz`` tells runs apart: by their settings, their conditions and
    the forces with which the ply answers a given displacement.

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
        self.folder, self._problem = Path(folder), problem
        self._settings = json.loads(json.dumps({"format": _FORMAT, **settings}))
        self._run = uuid4().hex

    def begin(self) -> None:
        """Make the folder ready for a new run.

        Raises
        ------
        CheckpointError
            If it holds an unfinished run, or cannot be written.
        """
        states = sorted(self.folder.glob(_STATES))
        if states and _read(states[-1])[0]["load_factor"] < 1:
            raise CheckpointError(
                f"checkpoint {self.folder} holds an unfinished run: resume it, or "
                "remove the folder"
            )
        for file in states:
            file.unlink()
        self._write(_RUN, self._settings | {"run": self._run}, self._identity())

    def save(self, number: int, state: State, progress: Mapping[str, Any]) -> None:
        """Write a state, where the stepper is, and what the ply's terms remember.

        Raises
        ------
        CheckpointError
            If it cannot be written.
        """
        text = asdict(state) | {"progress": dict(progress), "work": {}}
        text["run"] = self._run
        arrays = {"u": text.pop("u")}
        for key in _VECTORS:
            text[key] = {name: v.tolist() for name, v in text[key].items()}
        for term in self._problem.ply.terms:
            if term.memory is not None:
                text["work"][term.name] = float(term.memory.work)
                for name, array in term.memory.parameters.items():
                    arrays[f"{term.name} {name}"] = np.asarray(array)
        self._write(f"state_{number:06d}.npz", text, arrays)

    def load(self) -> Saved | None:
        """Read every state, and let the ply's terms remember the last; None if none is.

        Raises
        ------
        CheckpointError
            If a file is damaged or missing, or belongs to another run.
        """
        files = sorted(self.folder.glob(_STATES))
        if not files:
            return None
        self._check_identity()
        if files[-1].name != f"state_{len(files) - 1:06d}.npz":
            raise CheckpointError(f"checkpoint {self.folder}: a state is missing")
        states = []
        for file in files:
            text, arrays = _read(file)
            if text.pop("run") != self._run:
                raise CheckpointError(f"checkpoint file {file} is of another run")
            progress, work = text.pop("progress"), text.pop("work")
            for key in _VECTORS:
                text[key] = {name: np.array(v) for name, v in text[key].items()}
            text["residuals"] = tuple(text["residuals"])
            text["verdict"] = Verdict(**text["verdict"])
            states.append(State(u=arrays.pop("u"), **text))
        for term in self._problem.ply.terms:
            if term.memory is not None:
                term.memory.work = work[term.name]
                term.memory.parameters = {
                    name: arrays[f"{term.name} {name}"]
                    for name in term.memory.parameters
                }
        return Saved(states, progress)

    def _identity(self) -> dict[str, ndarray]:
        """What tells this problem from another: mesh, conditions, forces of each term.

        The conditions are asked at the requested load factors and in between; the
        forces are those of a displacement that shears and stretches every element.
        """
        ply, constraints = self._problem.ply, self._problem.constraints
        at = np.linspace(0.0, 1.0, 2 * self._settings["steps"] + 1)
        ply.reset()
        probe = 0.1 * self._problem.element_size * np.sin(np.arange(ply.basis.N))
        return {
            "nodes": ply.mesh.p,
            "cells": ply.mesh.t,
            "fixed unknowns": constraints.fixed,
            "fixed values": np.array([constraints.fixed_values(t) for t in at]),
            **{f"{k} forces": f for k, f in ply.residuals(probe).items()},
        }

    def _write(
        self, name: str, text: Mapping[str, Any], arrays: Mapping[str, ndarray]
    ) -> None:
        beside = self.folder / f".{name}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with open(beside, "wb") as file:
                np.savez(file, text=np.array(json.dumps(text)), **arrays)  # type: ignore[arg-type]
                file.flush()
                os.fsync(file.fileno())
            beside.replace(self.folder / name)
        except OSError as error:
            raise CheckpointError(
                f"cannot write checkpoint {self.folder}: {error.strerror or error}"
            ) from None

    def _check_identity(self) -> None:
        settings, arrays = _read(self.folder / _RUN)
        for name, value in self._settings.items():
            if settings.get(name) != value:
                raise CheckpointError(
                    f"checkpoint {self.folder} is of another run: {name} was "
                    f"{settings.get(name)}, is {value}"
                )
        self._run = settings["run"]
        identity = self._identity()
        for name in identity | arrays:
            new, old = (some.get(name, np.empty(0)) for some in (identity, arrays))
            allowed = _SAME * np.abs(new).max(initial=0.0)
            if old.shape != new.shape or not np.all(np.abs(old - new) <= allowed):
                raise CheckpointError(
                    f"checkpoint {self.folder} is of another run: its {name} differ"
                )


def _read(path: Path) -> tuple[dict[str, Any], dict[str, ndarray]]:
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as content:
            arrays = dict(content)
        return json.loads(str(arrays.pop("text"))), arrays
    except FileNotFoundError:
        raise CheckpointError(f"checkpoint file {path} is missing") from None
    except Exception as error:  # a damaged file may raise anything
        reason = str(error).partition("\n")[0]
        raise CheckpointError(f"checkpoint file {path} is damaged: {reason}") from None
