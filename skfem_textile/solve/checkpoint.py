"""Checkpoints: one file per converged state, from which a run is resumed."""

import json
import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

import numpy as np
from numpy import ndarray

from ..fabric import Law, TwoLaws
from ..ply import Ply
from ..ply.parameters import Frozen
from . import checksummed
from .continuation import Continuation, LoadSteps
from .linear.solver import Clock
from .problem import Problem
from .states import CheckpointError, Equilibrium, State, Verdict
from .verdict import Trial

# File format version; other versions are refused.
_FORMAT = 11

# Advice for a checkpoint of another run.
_OTHER = "; use the arguments of that run, or another folder"

# Entries that identify a surface of a tool, and surfaces of conditions.
_SURFACE, _SURFACES = "surface", "surfaces"

_RUN, _STATES = "run.npz", "state_*.npz"

# Fields of a state with a vector for each condition.
_VECTORS = ("reactions", "displacements")

# Attributes of states that files do not contain: `Replay` computes them.
_COMPUTED = ("shares", "forces", "energy_lost")

# Length to which a setting is shortened in a message.
_SHOWN = 100

# Relative difference between machines of the forces of the same ply, and round-off of
# strains and area ratios.
_SAME, _ROUND_OFF = 1e-9, 1e-13

# Load factors at which loads and user terms are compared, irregularly spaced.
_PROBED = (
    *(0.0, 0.0313, 0.1303, 0.2541, 0.3719, 0.5, 0.6237),
    *(0.7177, 0.8119, 0.9091, 0.9707, 1.0),
)

# Fibre strain and shear angle (radians) up to which laws are compared.
_STRAIN, _ANGLE = 0.1, np.radians(80.0)


class Progress(NamedTuple):
    """Continuation parameters, counters and times of a run; duration in s."""

    continuation: Continuation
    clock: Clock
    elapsed: float


class RestoredRun(NamedTuple):
    """States read from a checkpoint, and the progress at each of them."""

    states: list[State]
    progress: list[Progress]


class Checkpoint:
    """Folder with the states of a run, created when the run begins.

    Every file is written under a temporary name and then renamed, so that a run may be
    killed at any moment; the next run removes unfinished files.  ``run.npz`` identifies
    the run by its ``settings`` and by mesh, laws, conditions and forces of the problem.
    Every file contains the name of the run, its own name, and a checksum.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        problem: Problem,
        steps: LoadSteps,
        settings: Mapping[str, Any],
    ) -> None:
        try:
            self.folder = Path(folder)
        except TypeError:
            raise CheckpointError(
                f"checkpoint must be the path of a folder, not {folder!r}"
            ) from None
        if "\0" in str(folder):
            raise CheckpointError(f"checkpoint {str(folder)!r} is not a valid path")
        self._ply, self._constraints = problem.ply, problem.constraints
        self._ends = [*problem.endings]
        self._steps = steps
        stated = {"format": _FORMAT, "steps": steps.stated}
        described = {**stated, **settings, **_described(problem)}
        self._settings = json.loads(json.dumps(described))
        self._run = ""
        self._lock: checksummed.Lock | None = None

    def unlock(self) -> None:
        """Unlock the folder."""
        if self._lock is not None:
            self._lock.release()
        self._lock = None

    def begin(self) -> None:
        """Prepare the folder for a new run; a finished run is kept until `save`.

        Raises an error if the folder holds an unfinished run, is in use by another run,
        or cannot be written.
        """
        with self._writing():
            self.folder.mkdir(parents=True, exist_ok=True)
        self._lock_folder()
        if self._files():
            run = self._read(_RUN, "")
            *_, last = self._states(run)
            with self._content_errors(self._files()[-1]):
                finished = last.text["load_factor"] == 1.0 and not any(
                    np.linalg.norm(force)
                    >= run.arrays.get(f"values of the release of {name!r}", np.inf)
                    for name, force in last.text["reactions"].items()
                )
            if not finished:
                raise CheckpointError(
                    f"checkpoint {self.folder} contains an unfinished run: resume it, "
                    "or remove the folder"
                )
        self._run, beside = uuid4().hex, self.folder / f".{_RUN}"
        settings = self._settings
        arrays = self._fingerprint() | self._by_load_factor()
        with self._writing():
            checksummed.write(beside, self._run, "run", settings, arrays)

    def save(
        self,
        number: int,
        state: State,
        continuation: Continuation,
        clock: Clock,
        elapsed: float,
    ) -> None:
        """Write a state and the progress of the run, of a duration in s.

        The first state of a run replaces a finished run.  Raises an error if the file
        cannot be written.
        """
        text = asdict(replace(state, parameters={}))
        text["progress"] = {
            "continuation": asdict(continuation),
            "clock": asdict(clock),
            "elapsed": elapsed,
        }
        arrays = {"u": text.pop("u")}
        del text["parameters"]
        for key in _COMPUTED:
            del text[key]
        for key in _VECTORS:
            text[key] = {name: v.tolist() for name, v in text[key].items()}
        for term, values in state.parameters.items():
            arrays |= {f"{term} {name}": array for name, array in values.items()}
        name = f"state_{number:06d}"
        with self._writing():
            beside = self.folder / f".{name}.npz"
            checksummed.write(beside, self._run, name, text, arrays)
            if number == 0:
                for file in reversed(self._files()):
                    file.unlink()
                (self.folder / f".{_RUN}").replace(self.folder / _RUN)
            beside.replace(self.folder / f"{name}.npz")

    def load(self, replay: "Replay") -> RestoredRun | None:
        """Read every state and validate it by a replay; None if there is none.

        Raises an error if a file is damaged or missing, if it belongs to another run,
        or if another run writes to the folder.
        """
        if not self.folder.is_dir():
            return None
        self._lock_folder()
        return self._restored(replay, np.inf) if self._files() else None

    def begun(self, replay: "Replay", until: float) -> RestoredRun:
        """Read the states up to a load factor, of a run that may differ beyond it.

        Nothing is written into the folder, not even a lock.

        Raises
        ------
        CheckpointError
            If there is no state at this load factor; see also `load`.
        """
        if not self._files():
            raise CheckpointError(f"checkpoint {self.folder} contains no states")
        run = self._restored(replay, until)
        if (last := run.states[-1].load_factor) != until:
            raise CheckpointError(
                f"checkpoint {self.folder} contains no state at the load factor "
                f"{until:g}: the last one before is at {last:g}"
            )
        return run

    def _restored(self, replay: "Replay", until: float) -> RestoredRun:
        """States up to a load factor, validated by a replay."""
        run = self._read(_RUN, "")
        with self._content_errors(self.folder / _RUN):
            self._check_identity(run, until)
        with self._content_errors(self.folder):
            contents = [
                *takewhile(
                    lambda x: not x.text["load_factor"] > until, self._states(run)
                )
            ]
        files = self._files()[: len(contents)]
        states: list[State] = []
        for file, content in zip(files, contents, strict=True):
            with self._content_errors(file):
                states.append(_state(content, states, self._ply, self._ends))
        for i, file in enumerate(files):
            trial, values = replay.repeated(states[i])  # which calls user functions
            with self._content_errors(file):
                states[i] = replay.compared(states[i], trial, values)
        progress = []
        for i, file in enumerate(files, 1):
            with self._content_errors(file):
                saved = contents[i - 1].text["progress"]
                progress.append(
                    _progress(saved, states[:i], self._settings, self._steps)
                )
        return RestoredRun(states, progress)

    def _files(self) -> list[Path]:
        """Files of states in order; other files in the folder are ignored."""
        files = [f for f in self.folder.glob(_STATES) if f.stem[6:].isdecimal()]
        return sorted(files, key=lambda file: int(file.stem[6:]))

    def _states(self, run: checksummed.Content) -> Iterator[checksummed.Content]:
        """Contents of the files of states, each of this run and with its number."""
        for number, file in enumerate(self._files()):
            if file.stem != (name := f"state_{number:06d}"):
                raise CheckpointError(
                    f"checkpoint file {self.folder / name}.npz is missing"
                )
            yield self._read(file.name, run.run)

    def _read(self, name: str, run: str) -> checksummed.Content:
        path = self.folder / name
        try:
            return checksummed.read(path, run)
        except FileNotFoundError:
            why = "is missing"
        except OSError as error:
            why = f"cannot be read: {error.strerror or error}"
        except ValueError as error:
            why = str(error)
        raise CheckpointError(f"checkpoint file {path} {why}")

    def _check_identity(self, run: checksummed.Content, until: float) -> None:
        """Refuse other settings or, up to a load factor, another fingerprint."""
        another, advice = f"checkpoint {self.folder} belongs to another run: ", _OTHER
        if until < 1:
            another = (
                f"checkpoint {self.folder} belongs to a run that differs before the "
                f"load factor {until:g}: "
            )
            advice = "; repeat it from an earlier phase, or start a new run"
        for name, value in self._settings.items():
            was = run.text.get(name)
            begun = until < 1 and name == "steps"
            if was != value and not (
                begun and _up_to(until, was) == _up_to(until, value)
            ):
                raise CheckpointError(
                    f"{another}{name} was {_excerpt(was)} and is now "
                    f"{_excerpt(value)}{advice}"
                )
        self._run = run.run
        missing, varying = np.empty(0), self._by_load_factor(until)
        ours, theirs = self._fingerprint() | varying, dict(run.arrays)
        if until < 1:
            for name in varying.keys() & theirs.keys():
                theirs[name] = theirs[name][: len(varying[name])]
        for name in ours | theirs:
            new, old = ours.get(name, missing), theirs.get(name, missing)
            finite = np.isfinite(new)  # laws may have poles
            same = old.shape == new.shape and np.array_equal(np.isfinite(old), finite)
            allowed = _SAME * np.abs(new[finite]).max(initial=0.0)
            if not same or np.any(np.abs(old[finite] - new[finite]) > allowed):
                always = name not in varying or not np.array_equal(old[:1], new[:1])
                if until < 1 and always:
                    advice = ", from the start: start a new run"
                elif name.startswith(_SURFACE):
                    advice = (
                        ": restore its file if this was changed since that run, or "
                        "start a new run in another folder"
                    )
                raise CheckpointError(f"{another}its {name} differ{advice}")

    def _fingerprint(self) -> dict[str, ndarray]:
        """Mesh, fibre directions, laws and conditions, at all load factors."""
        ply, constraints = self._ply, self._constraints
        turn, surfaces = constraints.turn, constraints.surfaces
        fabric = ply.fabric.at()
        warp, weft, shear = fabric.laws
        entries = {
            "nodes": ply.mesh.p,
            "cells": ply.mesh.t,
            "fibre directions": np.concatenate([A.ravel() for A in ply.directions()]),
            "values of the warp law": _values(warp, _STRAIN),
            "values of the weft law": _values(weft, _STRAIN),
        }
        if not isinstance(fabric.tensions, TwoLaws):
            beside = [
                fabric.tensions.of_family(i, (_STRAIN, _STRAIN)) for i in range(2)
            ]
            values = np.concatenate([_values(law, _STRAIN) for law in beside])
            entries["values of the tensions with the other family stretched"] = values
        entries["values of the shear law"] = _values(shear, _ANGLE)
        entries |= {
            f"nodes of {name!r}": nodes for name, nodes in constraints.nodes.items()
        }
        entries |= {
            "fixed unknowns": constraints.fixed,
            "fixed directions": np.empty(0) if turn is None else turn.data,
            _SURFACES: np.empty(0) if surfaces is None else surfaces.levels(1.0),
        }
        for term in ply.terms:
            of_tool: Any = getattr(term, "identity", dict)()
            entries |= {f"{key} of {term.name!r}": x for key, x in of_tool.items()}
        entries |= {
            f"values of the release of {x.name!r}": np.array([x.release])
            for x in ply.terms
            if x.release is not None
        }
        if self._ends:
            entries["ends of conditions"] = np.array(self._ends)
        return entries

    def _by_load_factor(self, until: float = np.inf) -> dict[str, ndarray]:
        """Values of conditions and tools, and forces, by rows of load factors.

        Up to a load factor: values at the requested load factors and between them.
        Forces are evaluated at a displacement that shears and stretches every element,
        with the parameters at rest.
        """
        ply, load_factors = self._ply, _up_to(until, self._steps.stated, finer=2)
        fixed = [self._constraints.fixed_values(t) for t in load_factors]
        rows: dict[str, list[ndarray]] = {"fixed values": fixed}
        for term in ply.terms:
            of_tool: Any = getattr(term, "amounts_at", None)
            for t in load_factors if of_tool else ():
                for what, value in of_tool(t).items():
                    key = f"values of the {what} of {term.name!r}"
                    rows.setdefault(key, []).append(value)
        probe = 0.1 * ply.element_size * np.sin(np.arange(ply.basis.N))
        for t in _PROBED if ply.follows_load_factor else (1.0,):
            if t <= until or not ply.follows_load_factor:
                for name, f in ply.residuals(probe, t).items():
                    rows.setdefault(f"{name} forces", []).append(f)
        return {name: np.array(values) for name, values in rows.items()}

    def _lock_folder(self) -> None:
        """Lock the folder and remove the unfinished files of a killed run."""
        if self._lock is not None:
            return
        with self._writing():
            self._lock = checksummed.Lock(self.folder)
        if self._lock.is_held:
            for beside in (f".{_RUN}", f".{_STATES}"):
                for file in self.folder.glob(beside):
                    with suppress(OSError):  # in a read-only folder
                        file.unlink()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            why = error.strerror or error
            if error.strerror and self._files():  # not where another run writes to it
                why = f"{why}; the states written before are kept"
            raise CheckpointError(
                f"cannot write to checkpoint {self.folder}: {why}"
            ) from None

    @contextmanager
    def _content_errors(self, file: Path) -> Iterator[None]:
        """Refuse content that is intact but invalid."""
        makes_no_sense = ArithmeticError, AttributeError, LookupError, TypeError
        try:
            yield
        except CheckpointError:
            raise
        except (*makes_no_sense, ValueError) as error:
            raise CheckpointError(
                f"checkpoint file {file} is damaged: {_excerpt(error)}"
            ) from None


class Replay:
    """Sequential validation of the states of a checkpoint.

    ``problem`` is the one after the last state, and ``last`` its trial.  ``guessed`` is
    True if the state at the load factor 1 may follow the ply at rest without load
    steps.
    """

    last: Trial

    def __init__(self, problem: Problem, guessed: bool = False) -> None:
        self.problem, self._guessed = problem, guessed

    def repeated(self, state: State) -> tuple[Trial, ndarray]:
        """Evaluate a stored state again; its trial and the fixed values."""
        t, u, p = state.load_factor, state.u, state.parameters
        before = None
        last = getattr(self, "last", None)
        if last and not (self._guessed and t == 1 and not last.problem.load_factor):
            before = last.next_start()
            ends = t in self.problem.endings and t == last.problem.load_factor
            if ends and not self.problem.let_go(last.parameters, before.parameters):
                self.problem = self.problem.ended(t)
        problem = self.problem.at(t)
        equilibrium = Equilibrium(u, problem.residual(u, p), p, (), state.tolerance)
        trial = Trial.of(problem, equilibrium, before)
        return trial, problem.constraints.fixed_values(t)

    def compared(self, state: State, trial: Trial, fixed_values: ndarray) -> State:
        """Compare a state with its trial; returns it with the values not stored.

        Raises an error if they disagree.  Counters and residuals are not compared,
        because they depend on the iterations.
        """
        problem, u, f = trial.problem, trial.u, trial.f
        if not problem.is_fixed(u, fixed_values):
            raise ValueError(
                "its displacement does not satisfy the conditions at its load factor"
            )
        state_again, largest = trial.state(state.linear_solves), float(np.abs(f).max())
        rounding = max(state.tolerance - problem.converged * largest, 0.0)
        stored = *trial.energies.values(), *trial.potentials.values()
        energy = _SAME * sum(map(abs, stored))
        energy += rounding * float(np.abs(u).sum())
        allowed = {
            "reactions": _SAME * largest + rounding * u.size,
            "displacements": _SAME * float(np.abs(u).max()),
            "energies": energy,
            "potentials": energy,
        }
        for name, error in allowed.items():
            _compare(name, getattr(state, name), getattr(state_again, name), error)
        ours, theirs = asdict(state_again.verdict), asdict(state.verdict)
        del ours["negative_pivots"], theirs["negative_pivots"]
        work = {"work": ours.pop("work")}, {"work": theirs.pop("work")}
        _compare("work", *work, energy + _SAME * sum(map(abs, trial.works)))
        for name, value in ours.items():
            error = _SAME * abs(value) + _ROUND_OFF
            _compare("verdict", {name: theirs[name]}, {name: value}, error)
        self.last = trial
        computed = {key: getattr(state_again, key) for key in _COMPUTED}
        return replace(state, **computed)


def _described(problem: Problem) -> dict[str, Any]:
    """Formulation and laws by their ``repr``, and names of conditions."""
    ply, law = problem.ply, problem.ply.fabric.tensions
    warp, weft = law.laws if isinstance(law, TwoLaws) else (law, law)
    parts = {
        "formulation": ply.formulation,
        "warp law": warp,
        "weft law": weft,
        "shear law": ply.fabric.shear_law,
    }
    # On one line, without the memory address.
    reprs = {k: re.sub(r" at 0x[0-9a-fA-F]+", "", repr(x)) for k, x in parts.items()}
    texts = {name: " ".join(text.split()) for name, text in reprs.items()}
    return texts | {"conditions": list(problem.constraints.nodes)}


def _up_to(until: float, steps: Any, finer: int = 1) -> list[float]:
    """Load factors up to a given one at which steps end, or parts of these."""
    ends = LoadSteps(tuple(np.atleast_1d(steps).tolist())).ends(finer)
    return [t for t in ends if t <= until]


def _values(law: Law, most: float) -> ndarray:
    """Values of a law as a flat sequence; its parameters may vary by element."""
    with np.errstate(all="ignore"):
        values = [law.value(np.full(1, x)) for x in np.linspace(-most, most, 41)]
    return np.concatenate([np.ravel(value) for value in values])


def _compare(
    name: str, saved: Mapping[str, Any], expected: Mapping[str, Any], error: float
) -> None:
    """Refuse values that differ from the expected ones by more than ``error``."""
    if list(saved) != list(expected):
        raise ValueError(f"its {name} belong to another problem")
    for key, value in expected.items():
        off = np.abs(np.subtract(saved[key], value))
        if np.shape(saved[key]) != np.shape(value) or not np.all(off <= error):
            raise ValueError(f"its {name} do not match its displacement")


def _state(
    content: checksummed.Content,
    before: Sequence[State],
    ply: Ply,
    ends: Collection[float],
) -> State:
    """State in a file; refused if it does not follow the previous ones.

    Its displacement and parameters must have the names, shapes and types of the ply.
    Two states may follow at the load factors ``ends``.
    """
    text = {k: v for k, v in content.text.items() if k != "progress"}
    for key in _VECTORS:
        text[key] = {name: np.array(v) for name, v in text[key].items()}
    text["residuals"] = tuple(text["residuals"])
    text["verdict"] = Verdict(**text["verdict"])
    parameters = {}
    for term, values in ply.parameters_at_rest.items():
        saved = {name: content.arrays[f"{term} {name}"] for name in values}
        for name, like in values.items():
            if saved[name].shape != like.shape or saved[name].dtype != like.dtype:
                raise ValueError(f"its {name} does not belong to this ply")
        parameters[term] = type(values)(saved)
    u = content.arrays["u"]
    if u.shape != (ply.basis.N,) or u.dtype != float or not np.isfinite(u).all():
        raise ValueError("its displacement does not belong to this ply")
    state = State(u=u, parameters=Frozen(parameters), **text)
    last = before[-1].load_factor if before else -1.0
    lets_go = any(x.release is not None for x in ply.terms)
    if lets_go or last in ends:  # at which there are several states
        last = np.nextafter(last, -np.inf)
    if not last < state.load_factor <= 1:
        raise ValueError(
            f"its load factor must be above {last} and at most 1, but is "
            f"{state.load_factor}"
        )
    return state


def _progress(
    text: Mapping[str, Any],
    states: Sequence[State],
    settings: Mapping[str, Any],
    steps: LoadSteps,
) -> Progress:
    """Progress in a file; refused if it is inconsistent with states and settings."""
    path, clock = Continuation.of(text["continuation"]), Clock(**text["clock"])
    progress = Progress(**{**text, "continuation": path, "clock": clock})
    longest = steps.length(states[-1].load_factor)
    if not 0 < path.next <= longest * (1 + _SAME):
        raise ValueError(
            f"its step length must be above 0 and at most {longest}, but is {path.next}"
        )
    numbers = [*path.unresolved, *(x for t, _, x in path.overloads for x in (t, x))]
    numbers += [x for end in path.to_compare for x in (end.energy, *end.forces)]
    if not np.isfinite([progress.elapsed, *clock.seconds.values(), *numbers]).all():
        raise ValueError("its times, factors, energies or forces are not finite")
    if set(clock.seconds) != set(Clock().seconds):
        raise ValueError("its times are incomplete")
    if (
        path.longest != longest
        or path.halvings != settings["max_halvings"]
        or clock.solves != sum(state.linear_solves for state in states)
        or not (clock.factorisations >= 0 and path.cut >= 0)
    ):
        raise ValueError("its counts do not match its states")
    return progress


def _excerpt(value: object) -> str:
    """A value of a file, shortened to one line."""
    text = "".join(char if char.isprintable() else " " for char in str(value))
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
