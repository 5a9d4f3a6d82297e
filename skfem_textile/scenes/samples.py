"""A case repeated with the laws of further specimens of its fabric, and bands."""

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from ..fabric import Fabric
from ..mesh.progress import shown, unlogged
from ..solve.interval import ErrorInterval
from ..solve.quantities import Quantity
from ..solve.result import Result, StepError
from ..sweep import ThisThread, sweep
from .scene import Case

#: Probability with which a band contains a further specimen.  Chosen: the largest that
#: 20 samples, the number in the examples, can have.
CONFIDENCE = 0.9


@dataclass(frozen=True, eq=False)
class Samples:
    """Results of a case with the laws of further specimens of its fabric.

    Attributes
    ----------
    figures
        Quantities of the summary that are printed first, by key, each of shape
        (completed,): loads, angles, draw-in and shares of area of the last state.
    curves
        Load factor, displacement in mm and force in N of the states of each completed
        sample, shape (3, n_states).
    completed
        Numbers of the samples that reached the full load, from 0.
    warnings
        Number of warnings of each of them, shape (completed,).
    stopped
        Messages of samples that stopped early, by their number from 0.  They have no
        figures.
    """

    figures: Mapping[str, ndarray]
    curves: Sequence[ndarray]
    completed: tuple[int, ...]
    warnings: ndarray
    stopped: Mapping[int, str]

    @property
    def number(self) -> int:
        """Number of completed samples."""
        return len(self.completed)

    @property
    def probability(self) -> float:
        """Probability that a band contains a further specimen, see `band_of`."""
        return (self.number + 1 - 2 * _rank(self.number)) / (self.number + 1)

    @property
    def bands(self) -> dict[str, tuple[float, float]]:
        """Band of each figure, see `band_of`."""
        return {key: band_of(values) for key, values in self.figures.items()}

    def force_band(self, load_factor: ndarray) -> ndarray:
        """Band of the force in N at load factors, shape (2, n); see `band_of`."""
        force = [np.interp(load_factor, t, f) for t, _, f in self.curves]
        return np.array([band_of(one) for one in np.transpose(force)]).T


def band_of(values: ndarray) -> tuple[float, float]:
    """Smallest and largest value, without as many of each as 90 % permit.

    A further draw lies between value k and value n + 1 − k of n in ascending order
    with a probability of (n + 1 − 2k)/(n + 1), for any distribution (Wilks 1941, Ann.
    Math. Statist. 12:91).  Fewer than 19 values do not reach 90 %: the smallest and the
    largest then have the probability (n − 1)/(n + 1).

    Examples
    --------
    >>> band_of(np.arange(39.0)), band_of(np.arange(20.0))
    ((1.0, 37.0), (0.0, 19.0))
    """
    k = _rank(len(values))
    ordered = np.sort(values)
    return float(ordered[k - 1]), float(ordered[-k])


def _rank(n: int) -> int:
    """Rank k of the ends of a band of n values."""
    return max(int(0.5 * (1 - CONFIDENCE) * (n + 1) + 1e-9), 1)


def run_samples(
    case: Case,
    fabrics: Sequence[Fabric],
    executor: Executor | None = None,
    out: str | os.PathLike[str] | None = None,
    key: str = "",
) -> Samples:
    """Run a case with the laws of each of several fabrics, on any executor.

    Parameters
    ----------
    case
        The case.
    fabrics
        Fabrics whose laws replace the laws of the case, which keeps its fibre
        directions; see `FabricOfFile.samples`.
    executor
        See `sweep`, with its errors; by default `ThisThread`.
    out
        File to which every result is appended at once; completed samples in it are not
        repeated.
    key
        Text that identifies the case in ``out``.

    Raises
    ------
    ValueError
        If fewer than two samples were completed.

    Examples
    --------
    >>> from skfem_textile.cases import case_from_tables
    >>> from skfem_textile.io import read_fabric
    >>> name, scene = "cao2008-plain-weave", {"name": "picture_frame"}
    >>> case = case_from_tables(
    ...     {"scene": scene, "fabric": {"file": name}, "mesh": {"size": (2, 2)}}
    ... )
    >>> samples = run_samples(case, read_fabric(name).samples(3))
    >>> low, high = samples.bands["load_N"]
    >>> low < high, samples.probability
    (True, 0.5)
    """
    numbered = list(enumerate(fabrics))
    call, name = partial(_figures, case), partial(_name, key)
    called = ThisThread() if executor is None else executor
    swept = sweep(call, numbered, called, out=out, key=name, retries=0)
    found: dict[int, Any] = {}
    with shown(lambda: f"sample {len(found) + 1} of {len(numbered)}"):
        for (i, _), figures in swept:
            found[i] = figures
    stopped = {i: x["stopped"] for i, x in sorted(found.items()) if "stopped" in x}
    completed = tuple(i for i in sorted(found) if i not in stopped)
    done = [found[i] for i in completed]
    if len(done) < 2:
        reason = f": {next(iter(stopped.values()))}" if stopped else ""
        raise ValueError(
            f"{len(done)} of {len(numbered)} samples reached the full load, but a band "
            f"requires at least 2{reason}"
        )
    keys = [k for k in done[0]["figures"] if all(k in x["figures"] for x in done)]
    figures = {k: np.array([x["figures"][k] for x in done]) for k in keys}
    curves = [np.array(x["curve"]) for x in done]
    warnings = np.array([x["warnings"] for x in done])
    return Samples(figures, curves, completed, warnings, stopped)


def _name(key: str, case: tuple[int, Fabric]) -> str:
    return f"sample {case[0] + 1}{key and f' of {key}'}"


def _figures(case: Case, sample: tuple[int, Fabric]) -> dict[str, Any]:
    """Figures and curve of a sample, or the message with which it stopped."""
    fibres = case.fabric
    fabric = replace(sample[1], warp=fibres.warp, weft=fibres.weft)
    case = replace(case, fabric=fabric)
    # The error interval is a property of the mesh: the run has one.
    without_interval = partial(replace, interval=_no_interval)
    result, summary, stopped = run_unlogged(case, without_interval)
    if result is None or stopped:
        return {"stopped": stopped}
    return {
        "figures": {x.key: float(summary[x.key]) for x in printed_numbers(summary)},
        "curve": _curve(case, result),
        "warnings": len(summary.get("warnings", ())),
    }


def run_unlogged(
    case: Case, shown: Callable[[Result], Result]
) -> tuple[Result | None, dict[str, Any], str]:
    """Run a case without its log: its result, summary, and the error that stopped it.

    The result of a run that stopped ends there, or is None.  The summary describes what
    ``shown`` returns for it; it is empty if nothing was applied.  Of the error it is
    the first line; empty if there was none.
    """
    result: Result | None
    with unlogged():
        try:
            result, reason = case.run(), ""
        except (StepError, ValueError) as error:
            result = getattr(error, "result", None)
            reason = str(error).partition("\n")[0]
        if result is None or result.states[-1].load_factor == 0:
            return result, {}, reason
        return result, case.summary(shown(result)), reason


def _no_interval(_: Any) -> ErrorInterval:
    return ErrorInterval(reason="of a sample")


def printed_numbers(summary: Mapping[str, Any]) -> list[Quantity]:
    """Quantities of a summary that are printed first and are numbers."""
    declared = (Quantity(**one) for one in summary.get("first", ()))
    return [
        x for x in declared if x.unit and isinstance(summary.get(x.key), int | float)
    ]


def _curve(case: Case, result: Result) -> list[list[float]]:
    factors = [state.load_factor for state in result.states]
    displacement, force = case.scene.driven_curve(result)
    return [factors, displacement.tolist(), force.tolist()]
