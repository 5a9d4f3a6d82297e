"""Results of finished runs, read from their folders."""

import json
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.progress import unlogged
from ..mesh.user_input import printable
from ..nets.sheet import Sheet
from ..ply import Ply
from ..scenes.scene import Case
from .build import case_from_file
from .write import CASE, WRITTEN

# Name of the folder of a checkpoint in a results folder, by default.
_CHECKPOINT = "checkpoint"

# A file of every net.
_OF_NET = "net.vtu"

# Name of the list of states.
_SERIES = "steps.pvd"

# A state in the list of a .pvd file.
_STEP = re.compile(r'timestep="([^"]+)" file="([^"]+)"')

# Distance relative to the ply below which nodes of a file and of the mesh coincide:
# above the rounding of positions that were moved and rotated.
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """State of a run that its summary describes, from the files in its folder.

    Attributes
    ----------
    case
        The case of the run.
    ply
        The ply at rest.
    u
        Displacement of the state, see `Case.described`.
    load_factor
        Its load factor.
    summary
        The content of ``summary.json``.
    """

    case: Case
    ply: Ply
    u: ndarray
    load_factor: float
    summary: dict[str, Any]

    def sheet(self) -> Sheet:
        """The ply in the axes of its tools, for maps to a part and flat patterns.

        Raises
        ------
        ValueError
            If the ply is not in space.
        """
        return Sheet.of_ply(self.ply, self.u, self.case.scene.axes)


def read_result(folder: str | os.PathLike[str]) -> FinishedRun:
    """Read a run from its results folder, without computing it again.

    In the state that its summary describes, usually the last one.  Forces and fields
    stay in the files of the folder.  If ``fields`` is missing, the state is read from
    the checkpoint in the folder, which is validated.

    Parameters
    ----------
    folder
        Folder that ``skfem-textile run`` has written.

    Raises
    ------
    ValueError
        If a file is missing, damaged or of another run, if the elements have nodes
        that the files do not contain, as quadratic elements do, or if the folder
        contains a net or a run that has not ended; one line names it.
    OSError
        If a file cannot be read.

    Examples
    --------
    >>> from skfem_textile.cli.main import main
    >>> main("run hemisphere --size 4x4 --no-render --out formed".split())
    ... # doctest: +ELLIPSIS
    Note ...
    0
    >>> finished = read_result("formed")
    >>> finished.sheet().positions.shape
    (3, 81)
    """
    folder = Path(folder)
    _refuse_other_folder(folder)
    text = content_of(folder / CASE)
    if not text.startswith(WRITTEN):
        raise ValueError(f"{printable(folder / CASE)} was not written by a run")
    with unlogged():
        case = case_from_file(folder / CASE)
        ply = case.ply()
    summary = read_summary(folder)
    if not (folder / "fields" / _SERIES).exists():
        return FinishedRun(case, ply, *_saved(case, folder, summary), summary)
    file, load_factor = _described(folder / "fields", summary)
    X, moves = _displacement(file)
    axes, mesh = case.scene.axes, ply.mesh
    at_rest = ply.at_rest[:, : mesh.nvertices]
    flat = axes.of_tool(np.pad(at_rest, ((0, 3 - len(at_rest)), (0, 0))))
    if X.shape != flat.shape or np.abs(X - flat).max() > _SAME * np.ptp(flat):
        raise ValueError(
            f"{printable(file)} does not belong to the case in {printable(folder)}: "
            "run the case again"
        )
    if ply.nodes.shape != mesh.p.shape:
        raise ValueError(
            f"{printable(folder)}: the files lack values at the mid-side nodes of "
            "quadratic elements"
        )
    moves = (axes.turn.T @ moves)[: 3 if case.scene.dimension == 3 else 2]
    return FinishedRun(case, ply, moves.T.ravel(), load_factor, summary)


def _refuse_other_folder(folder: Path) -> None:
    """Refuse the folder of a net, a checkpoint, or a run that has not ended."""
    if (folder / CASE).exists():
        return
    if (folder / _OF_NET).is_file():
        raise ValueError(
            f"{printable(folder)} is the folder of a net, not of a run: `net` itself "
            "writes net.html, and exports with --part-mesh, --deck and --trim; in "
            "Python use drape.Sheet.of_net"
        )
    for checkpoint in folder / _CHECKPOINT, folder:
        if (checkpoint / "run.npz").is_file():
            raise ValueError(
                f"{printable(checkpoint)} is a checkpoint without the case of its run: "
                "end this run with --resume, and name the folder of its --out"
            )


def read_summary(folder: Path) -> dict[str, Any]:
    """Read ``summary.json`` of a run.

    Raises
    ------
    ValueError
        If it is missing, damaged or not the summary of a run.
    """
    _refuse_other_folder(folder)
    file = folder / "summary.json"
    try:
        summary = json.loads(content_of(file))
    except (json.JSONDecodeError, RecursionError):
        summary = None
    if not isinstance(summary, dict) or "scene" not in summary:
        raise ValueError(f"{printable(file)} is not the summary of a run")
    return summary


def content_of(file: Path) -> str:
    """Text of a file of a results folder; a ValueError if it is missing or damaged."""
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ValueError(
            f"{printable(file)} is missing: name the results folder of a run"
        ) from None
    except UnicodeDecodeError:
        raise ValueError(
            f"{printable(file)} is damaged: it is not a text file in UTF-8"
        ) from None


def _nearest(load_factors: list[float], summary: dict[str, Any]) -> int:
    """Index of the last state at the load factor of a summary; -1 if it has none."""
    described = summary.get("load_factor")
    if not isinstance(described, int | float):
        return -1
    away = np.abs(np.array(load_factors) - described)
    return int(np.flatnonzero(away == away.min())[-1])


def _saved(case: Case, folder: Path, summary: dict[str, Any]) -> tuple[ndarray, float]:
    """Displacement and load factor of a state of a checkpoint."""
    with unlogged():
        stepper = case.stepper(folder / _CHECKPOINT)
    from ..solve.checkpoint import Replay

    checkpoint = stepper.checkpoint
    assert checkpoint is not None
    try:
        saved = checkpoint.load(
            Replay(stepper.problem, guessed=stepper.initial_guess is not None)
        )
    finally:
        checkpoint.unlock()
    if saved is None:
        raise ValueError(
            f"{printable(folder)} contains neither fields/{_SERIES} nor a checkpoint "
            f"in the folder {_CHECKPOINT}: run the case again, with --checkpoint"
        )
    state = saved.states[_nearest([x.load_factor for x in saved.states], summary)]
    return state.u, state.load_factor


def _described(folder: Path, summary: dict[str, Any]) -> tuple[Path, float]:
    """File of a state, and its load factor."""
    series = folder / _SERIES
    listed = _STEP.findall(content_of(series))
    if not listed:
        raise ValueError(f"{printable(series)} lists no states: run the case again")
    factors = [float(load_factor) for load_factor, _ in listed]
    i = _nearest(factors, summary)
    return folder / listed[i][1], factors[i]


def _displacement(file: Path) -> tuple[ndarray, ndarray]:
    """Nodes of the ply at rest and their displacements, shape (3, n)."""
    import meshio  # of finished runs alone

    try:
        grid = meshio.vtu.read(file)
        return grid.points.T, np.transpose(grid.point_data["displacement"])
    except (meshio.ReadError, SyntaxError, LookupError, ValueError, OSError) as error:
        raise ValueError(f"{printable(file)} cannot be read: {error}") from None
