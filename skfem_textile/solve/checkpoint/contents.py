"""States, and where the stepper is, as the files of a checkpoint hold them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..body import Parameters
from ..linear.solver import Clock
from ..states import State, Verdict
from ..stepping.load_path import LoadPath
from .sealed import Content

# How far the forces of the same ply may differ between machines.
SAME = 1e-9

#: What a state has of each condition.
VECTORS = ("reactions", "displacements")


class Progress(NamedTuple):
    """Where the stepper is: length of its next step, steps cut, path, clock, time."""

    length: float
    steps_cut: int
    path: LoadPath
    clock: Clock
    elapsed: float


def state_of(content: Content, before: Sequence[State], at_rest: Parameters) -> State:
    """The state in a file, after those before it.

    ``at_rest`` are the ply's parameters at rest.

    Raises
    ------
    ValueError
        If its load factor is not one after theirs, or its parameters are not of the
        ply.
    """
    text = {k: v for k, v in content.text.items() if k != "progress"}
    for key in VECTORS:
        text[key] = {name: np.array(v) for name, v in text[key].items()}
    text["residuals"] = tuple(text["residuals"])
    text["verdict"] = Verdict(**text["verdict"])
    parameters = _parameters(content, at_rest)
    state = State(u=content.arrays["u"], parameters=parameters, **text)
    last = before[-1].load_factor if before else -1.0
    if not last < state.load_factor <= 1:
        raise ValueError(f"its load factor is {state.load_factor}, after {last}")
    return state


def _parameters(content: Content, at_rest: Parameters) -> Parameters:
    """Parameters in a file, of the same names, shapes and types as those at rest."""
    found = {}
    for term, values in at_rest.items():
        saved = {name: content.arrays[f"{term} {name}"] for name in values}
        for name, like in values.items():
            if saved[name].shape != like.shape or saved[name].dtype != like.dtype:
                raise ValueError(f"its {name} is not of this ply")
        found[term] = type(values)(saved)
    kind: Any = type(at_rest)
    return kind(found)


def progress_of(
    text: Mapping[str, Any], states: Sequence[State], settings: Mapping[str, Any]
) -> Progress:
    """Where the stepper was at the last of the states.

    Raises
    ------
    ValueError
        If that is not a place of a run with these states and settings.
    """
    path, clock = LoadPath.of(text["path"]), Clock(**text["clock"])
    progress = Progress(**{**text, "path": path, "clock": clock})
    longest = 1.0 / settings["steps"]
    if not 0 < progress.length <= longest * (1 + SAME):
        raise ValueError(f"the length of its step is {progress.length}")
    numbers = list(path.unresolved)
    numbers += [x for end in path.to_compare for x in (end.energy, *end.reactions)]
    if not np.isfinite([progress.elapsed, *clock.seconds.values(), *numbers]).all():
        raise ValueError("its times or load factors are not finite")
    if set(clock.seconds) != set(Clock().seconds):
        raise ValueError("its times are not those of a run")
    if (
        path.longest != longest
        or path.halvings not in (0, settings["max_halvings"])
        or clock.solves != sum(state.linear_solves for state in states)
        or not (clock.factorisations >= 0 and progress.steps_cut >= 0)
    ):
        raise ValueError("its counts are not those of its states")
    return progress


def same(old: ndarray, new: ndarray) -> bool:
    """Whether arrays are those of one problem on two machines; laws may have poles."""
    finite = np.isfinite(new)
    if old.shape != new.shape or not np.array_equal(np.isfinite(old), finite):
        return False
    allowed = SAME * np.abs(new[finite]).max(initial=0.0)
    return bool(np.all(np.abs(old[finite] - new[finite]) <= allowed))
