"""What the command line does: each command checks, then computes, then writes."""

import argparse
import json
import logging
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from .. import __version__
from ..files.interruption import INTERRUPTED, held
from ..files.output import OutputError, complain, say
from ..mesh.user_input import printable
from ..scenes import Scene
from ..solve.result import Iteration, Result, State, StepError
from ..solve.stepper import LoadStepper

#: The scenes, and what they are.
SCENES = {
    "strip": "a strip laid on a circle, fibres along its sides, clamped at the bottom",
    "picture_frame": "a square sheared by a hinged frame, fibres along its sides",
    "trellis": "a square whose edges follow a motion that stretches no fibre",
    "bias_extension": "a rectangle pulled along the bisector of its fibres",
    "two_element": "why quadrilaterals lock: the paper's equations on two elements",
}

#: The studies, and what they tell.
STUDIES = {
    "stability": "stiff and extreme cases: which are right, refused or wrong",
    "formulations": "every formulation on every scene: how far from the exact answer",
}
ERROR_TIME = "error against run time, beside other codes: half an hour, undisturbed"

STOPPED_EARLY, BAD_INPUT = 1, 2

_PICTURES = (
    "fibre_strain.png",
    "shear_angle.png",
    "fibre_directions.png",
    "load.png",
    "animation.gif",
)


def scenes(_: argparse.Namespace) -> int:
    """List the scenes."""
    for name, what in SCENES.items():
        say(f"{name:16}{what}")
    return 0


def run(options: argparse.Namespace, scene: Scene, stepper: LoadStepper) -> int:
    """Load a scene and write its results."""
    from .. import io  # loads meshio

    fields = (f"fields/{name}" for name in io.FIELDS)
    written = ("summary.json", "history.csv", *fields, *_PICTURES)
    results = io.ResultFolder(options.out, written)
    code, said = _load(stepper, options)
    result = stepper.result
    summary = scene.summary(result)
    inputs = {"inputs": {"version": __version__, **_inputs(options)}}
    complete = False
    try:
        with held():
            with results as folder:
                io.write_summary(summary | inputs, folder / "summary.json")
                io.write_history(result, folder / "history.csv")
                io.write_fields(result, folder / "fields")
            complete = True
    except OutputError as error:
        raise OutputError(f"{error}; {_kept(stepper)}") from None
    except KeyboardInterrupt:
        if not complete:
            raise
        code, said = INTERRUPTED, "interrupted; the results are written"
    if code != INTERRUPTED:
        code = _render(options, _PICTURES, partial(_draw, scene, result), code)
    for key, value in summary.items():
        shown = f"{value:.6g}" if isinstance(value, float) else value
        say(f"{key:28}{shown}")
    say(f"results in {printable(options.out)}")
    if said:
        complain(said)
    return code


def paper(options: argparse.Namespace) -> int:
    """Run the strips of the paper's figures; a case that stops early is a row."""
    from .. import io

    study = _study("paper")

    results = io.ResultFolder(options.out, (*study.FILES, *study.PICTURES))
    with results as folder:
        rows = study.reproduce(folder, say)
    code = _render(options, study.PICTURES, partial(study.draw, rows))
    say(f"results in {printable(options.out)}")
    return code


def two_element(options: argparse.Namespace) -> int:
    """Write the systems of the paper's two-element mesh beside what it prints."""
    from .. import io

    systems = _study("systems")

    with io.ResultFolder(options.out, ("systems.json", "systems.md")) as folder:
        table = systems.table()
        (folder / "systems.md").write_text(table)
        text = json.dumps(systems.report(), indent=2, ensure_ascii=False)
        (folder / "systems.json").write_text(text + "\n")
    say(table, end="")
    say(f"results in {printable(options.out)}")
    return 0


def error_time(options: argparse.Namespace) -> int:
    """Time methods on one scene, one after the other, and write the report."""
    from .. import io

    study = _study("error_time")

    results = io.ResultFolder(options.out, (*study.FILES, *study.PICTURES))
    rows: list[dict[str, Any]] = []
    try:
        for some in study.cases(options.scene):
            say(study.line(some))
            rows += some
    finally:  # an interrupted study reports on what it has
        if rows:
            with results as folder:
                study.write(rows, folder)
    code = _render(options, study.PICTURES, partial(study.draw, rows))
    say(f"results in {printable(options.out)}")
    return code


def study(options: argparse.Namespace) -> int:
    """Run a study and write its report; a case that fails is not in it."""
    from .. import io
    from ..sweep import SweepError

    study = _study(options.study)
    results = io.ResultFolder(options.out, (*study.FILES, *study.PICTURES))
    kept = options.out / f"{options.study}-unfinished.jsonl"
    if kept.is_file() and kept.stat().st_size and not options.resume:
        raise ValueError(
            f"{kept} is of an unfinished study: --resume goes on with it, or remove it"
        )
    cases, code, said = study.cases(), 0, ""
    found: dict[str, list[dict[str, Any]]] = {}
    try:
        _examine(study, cases, options.workers, kept, found)
    except SweepError as error:
        code, said = STOPPED_EARLY, f"{error}; --resume runs what is left"
    except KeyboardInterrupt:
        code, said = INTERRUPTED, "interrupted; --resume runs what is left"
    finally:  # a study that stops reports on what it has
        rows = [row for case in cases for row in found.get(study.name(case), ())]
        if rows:
            with results as folder:
                study.write(rows, folder)
    if not (said and rows):
        kept.unlink(missing_ok=True)
    if code != INTERRUPTED:
        draw = partial(study.draw, rows)
        code = _render(options, study.PICTURES, draw, code)
    say(f"results in {printable(options.out)}")
    if said:
        complain(said)
    return code


def _study(name: str) -> ModuleType:
    """The module of a study, which loads what only studies need."""
    return import_module(f"skfem_textile.studies.{name}")


def _examine(
    study: ModuleType,
    cases: list[Any],
    workers: int,
    kept: Path,
    found: dict[str, list[dict[str, Any]]],
) -> None:
    """Find the rows of every case, by its name; they are on file as they come."""
    from ..sweep import WorkerProcesses, sweep

    kept.parent.mkdir(parents=True, exist_ok=True)
    with WorkerProcesses(min(workers, len(cases))) as executor:
        for case, rows in sweep(
            study.examined, cases, executor, out=kept, key=study.name
        ):
            say(study.line(rows))
            found[study.name(case)] = rows


def _inputs(options: argparse.Namespace) -> Mapping[str, Any]:
    """The options that decide the result."""
    others = "command", "task", "out", "no_render", "made", "checkpoint", "resume"
    return {k: v for k, v in vars(options).items() if k not in (*others, "verbose")}


def _load(stepper: LoadStepper, options: argparse.Namespace) -> tuple[int, str]:
    """Run with a progress bar on a terminal: exit code, and what to say at the end."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(stderr=True)
    columns = (BarColumn(), TextColumn("{task.description}"))
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        _log(options.verbose)
        task = bar.add_task("load factor 0", total=1.0)

        def told(at: Iteration) -> None:
            bar.update(
                task,
                description=f"load factor {at.load_factor:.4g}, step {at.step:.2g}, "
                f"{at.strategy} {at.number}",
            )

        def reached(state: State) -> None:
            bar.update(task, completed=state.load_factor)

        stepper.on_iteration, stepper.on_step = told, reached
        try:
            stepper.run(resume=options.resume is not None)
        except StepError as error:
            return STOPPED_EARLY, str(error)
        except KeyboardInterrupt:
            if not stepper.states:
                raise
            return INTERRUPTED, _interrupted(stepper)
    return 0, ""


def _interrupted(stepper: LoadStepper) -> str:
    at = stepper.states[-1].load_factor
    kept, lost = "--resume goes on from there", "--checkpoint lets a run resume"
    advice = kept if stepper.checkpoint else lost
    return f"interrupted; the state at load factor {at:.6g} is written, {advice}"


def _kept(stepper: LoadStepper) -> str:
    """What is left of a run whose results cannot be written."""
    if stepper.checkpoint is None:
        return "nothing is kept, as --checkpoint was not given"
    kept = stepper.checkpoint.folder
    return f"the checkpoint {kept} remains, and --resume goes on from there"


def _log(verbose: int) -> None:
    """Send the log to stderr, past the progress bar."""
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("%(message)s"))
    log = logging.getLogger("skfem_textile")
    log.handlers[:] = [handler]
    log.setLevel([logging.WARNING, logging.INFO, logging.DEBUG][min(verbose, 2)])


def _render(
    options: argparse.Namespace,
    pictures: tuple[str, ...],
    draw: Callable[[Path], None],
    code: int = 0,
) -> int:
    """Draw into a folder, or say in one line why not: the numbers are written.

    Returns the exit code: the given one, unless the drawing is interrupted.
    """
    from .. import io

    if options.no_render:
        return code
    try:
        with io.ResultFolder(options.out, pictures) as folder:
            draw(folder)
    except ImportError as error:
        say(f"no pictures: {printable(error)}; pip install 'skfem-textile[plot]'")
    except Exception as error:
        say(f"no pictures: {printable(error)}")
    except KeyboardInterrupt:
        complain("interrupted; the numbers are written, pictures are not")
        return INTERRUPTED
    return code


def _draw(scene: Scene, result: Result, folder: Path) -> None:
    with held():  # VTK may crash where it is interrupted
        from .. import plot
    for name, draw in (
        ("fibre_strain.png", plot.fibre_strain),
        ("shear_angle.png", plot.shear_angle),
        ("fibre_directions.png", plot.fibre_directions),
    ):
        with held():
            draw(result, filename=folder / name)
    with held():
        plot.animation(result, folder / "animation.gif")
    _draw_load(scene, result, folder / "load.png")


def _draw_load(scene: Scene, result: Result, file: Path) -> None:
    """Draw the force on the driven edge over its displacement."""
    from ..plot.curves import curves

    moved = np.array([scene.driven_displacement(state) for state in result.states])
    axis = np.abs(moved).max(axis=0).argmax()  # the one along which it moves further
    x, y = np.transpose([scene.reaction(state) for state in result.states])
    lines = {"along x": (moved[:, axis], x), "along y": (moved[:, axis], y)}
    curves(
        {"Force on the driven edge": lines},
        f"Mean displacement of the driven edge along {'xy'[axis]} (mm)",
        "Force (N)",
        file,
    )
