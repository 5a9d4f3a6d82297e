"""DOLFINx: the same energy in UFL, with MUMPS' LDLᵀ.

It runs in a new process of the first interpreter that can import it: the present one,
or that of the system, which has Debian's python3-dolfinx.
"""

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy import ndarray

from .newton import NotConvergedError, Run
from .rival import Shape
from .task import Task

_CHILD = Path(__file__).with_name("dolfinx_child.py")
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class DolfinxError(RuntimeError):
    """The process of DOLFINx failed; the message is its last line."""


@dataclass(frozen=True, eq=False)
class Dolfinx:
    """DOLFINx 0.5 on one thread.

    Mesh, space and compiled forms are made before the clock starts.

    Parameters
    ----------
    shape
        The element: `QUAD4` or `TRIANGLE6`.
    """

    shape: Shape
    code: ClassVar[str] = "DOLFINx"
    solver: ClassVar[str] = "MUMPS"

    def missing(self) -> str:
        """DOLFINx, if no interpreter can import it."""
        return "" if interpreter() else "dolfinx 0.5 (Debian's python3-dolfinx)"

    def run(self, task: Task, steps: int, repeats: int) -> Run:
        """Load a ply in equal steps; see `Rival`.

        Raises
        ------
        NotConvergedError
            If a step does not converge.
        DolfinxError
            If its process fails.
        """
        said = _child(task, values=task.values(steps), repeats=repeats)
        if "failure" in said:
            raise NotConvergedError(str(said["failure"]))
        linear_solves, seconds = int(said["linear_solves"]), said["seconds"].tolist()
        return Run(said["u"], said["f"], linear_solves, seconds)

    def iterations(
        self, task: Task, u: ndarray, repeats: int
    ) -> list[tuple[float, float]]:
        """Time Newton iterations; see `Rival`."""
        return _child(task, u=u, repeats=repeats)["iterations"].tolist()


@cache
def interpreter() -> tuple[str, str] | None:
    """The first interpreter that can import DOLFINx, and its version and BLAS."""
    for python in (sys.executable, "/usr/bin/python3"):
        try:
            return python, _run(python, timeout=60)
        except (OSError, DolfinxError, subprocess.TimeoutExpired):
            continue
    return None


def _child(task: Task, **more: Any) -> dict[str, ndarray]:
    """The results of the process for a task."""
    if (there := interpreter()) is None:
        raise DolfinxError("DOLFINx: no interpreter can import it")
    with tempfile.TemporaryDirectory() as folder:
        source, target = Path(folder, "task.npz"), Path(folder, "results.npz")
        np.savez(
            source,
            nodes=task.nodes,
            cells=task.cells,
            warp=task.scene.warp,
            weft=task.scene.weft,
            E=task.E,
            G=task.G,
            fixed=task.fixed,
            **more,
        )
        _run(there[0], str(source), str(target))
        with np.load(target) as said:
            return dict(said)


def _run(python: str, *arguments: str, timeout: float | None = None) -> str:
    """The output of the script."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    environment |= dict.fromkeys(_ONE_THREAD, "1")
    child = subprocess.run(
        [python, str(_CHILD), *arguments],
        capture_output=True,
        text=True,
        env=environment,
        timeout=timeout,
    )
    if child.returncode:
        said = child.stderr.strip().splitlines() or [f"exit code {child.returncode}"]
        raise DolfinxError(f"DOLFINx: {said[-1]}")
    return child.stdout.strip()
