"""Samples of a run: the case with further specimens of its fabric, and their bands."""

import os
from argparse import Namespace
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..cases.fabrics import sampled_fabrics
from ..cases.read import CaseFile
from ..cases.write import WrittenCase
from ..fabric import Fabric
from ..io.file_numbers import word_of, write_table
from ..mesh.progress import shown
from ..mesh.requirements import require
from ..scenes.samples import Samples, run_samples
from ..scenes.scene import Case
from ..solve.quantities import BAND, Quantity
from ..solve.result import Result
from ..sweep import WorkerProcesses
from .curve import HIGH, LOW, Curve

#: File of completed samples, with which an interrupted run continues.
RESULTS = "samples.jsonl"

# Relative rounding of a figure that is prescribed.
_EQUAL = 1e-9


@dataclass(frozen=True)
class Sampling:
    """Samples of a case that are to be run.

    Attributes
    ----------
    case
        The case.
    fabrics
        A fabric for each sample.
    key
        Checksum of the case and the files that it names.
    workers, scheduler
        See `executor_of`.
    """

    case: Case
    fabrics: list[Fabric]
    key: str
    workers: int | None
    scheduler: str | None

    @classmethod
    def of(
        cls, file: CaseFile, case: Case, written: WrittenCase, options: Namespace
    ) -> "Sampling":
        """Samples of a case; raises a ValueError if there are none."""
        require_packages("samples of a fabric", options.scheduler)
        fabrics, key = sampled_fabrics(file.fabric), written.checksum()
        return cls(case, fabrics, key, options.workers, options.scheduler)

    def run(self, folder: Path) -> Samples:
        """Run all samples; completed ones in the folder are not repeated."""
        most = len(self.fabrics)
        chosen = executor_of(self.workers, self.scheduler, most)
        with shown("running the samples", printed=True), chosen as executor:
            out = folder / RESULTS
            return run_samples(self.case, self.fabrics, executor, out, self.key)


def require_packages(what: str, scheduler: str | None) -> None:
    """Raise an error if a package for several runs is not installed."""
    require(what, "sweep", "threadpoolctl")
    if scheduler is not None:
        require("a dask scheduler", "sweep", "distributed")


def executor_of(
    workers: int | None, scheduler: str | None, most: int
) -> AbstractContextManager[Executor]:
    """Executor of a number of runs, for a ``with`` block.

    Parameters
    ----------
    workers
        Number of processes; None for one for each processor.
    scheduler
        Address of a dask scheduler, which replaces the processes, or None.
    most
        Number of runs.
    """
    if scheduler is None:
        return WorkerProcesses(min(workers or _processors(), most))
    return _on_dask(scheduler)


@contextmanager
def _on_dask(scheduler: str) -> Iterator[Executor]:
    from dask.distributed import Client

    with Client(scheduler) as client:
        yield client.get_executor()


def _processors() -> int:
    """Number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def with_bands(summary: Mapping[str, Any], samples: Samples) -> dict[str, Any]:
    """Summary with the bands of figures that vary, their number and probability."""
    bands = {
        f"{key}{BAND}": [low, high]
        for key, (low, high) in samples.bands.items()
        if high - low > _EQUAL * abs(high)
    }
    total, share = samples.number + len(samples.stopped), 100 * samples.probability
    text = (
        f"{samples.number} further specimens of the fabric; with a probability of "
        f"{share:.0f} % a band contains another one"
    )
    if samples.stopped:
        text += f"; {len(samples.stopped)} of {total} samples stopped early"
    quantity = Quantity("Samples", "samples_text").declared()
    return {
        **summary,
        **bands,
        "samples": samples.number,
        "samples_stopped": len(samples.stopped),
        "samples_probability": samples.probability,
        "samples_text": text,
        "first": [quantity, *summary["first"]],
    }


def curve_with_band(curve: Curve, result: Result, samples: Samples) -> Curve:
    """Curve of a run with the band of its force at the load factor of each state."""
    factors = np.array([state.load_factor for state in result.states])
    low, high = samples.force_band(factors)
    return {**curve, LOW: low, HIGH: high}


def write_samples(samples: Samples, path: Path) -> None:
    """Write the figures of each sample as CSV, numbered from 1."""
    figures = [values.tolist() for values in samples.figures.values()]
    columns = samples.completed, *figures, samples.warnings.tolist()
    rows: list[list[Any]] = [
        [i + 1, *map(word_of, numbers), warnings, ""]
        for i, *numbers, warnings in zip(*columns, strict=True)
    ]
    rows += [
        [i + 1, *[""] * len(figures), "", text] for i, text in samples.stopped.items()
    ]
    write_table(path, ["sample", *samples.figures, "warnings", "stopped"], rows)


def stopped_text(samples: Samples) -> str:
    """Message on the samples that stopped early; empty if there are none."""
    texts = [f"sample {i + 1} stopped early: {x}" for i, x in samples.stopped.items()]
    return "; ".join(texts)
