"""What the command line does: each command checks, then computes, then writes."""

import argparse
import logging
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
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
}

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
