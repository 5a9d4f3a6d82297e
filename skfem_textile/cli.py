"""The command line: ``skfem-textile list`` and ``skfem-textile run SCENE``."""

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from . import __version__
from .fabric import Fabric
from .formulations import Formulation, Full, OnePoint
from .ply import Ply
from .result import Result, State
from .scenes import SCENES, Scene
from .scenes.rectangle import KINDS
from .stepper import LoadStepper, StepError

BAD_INPUT, STOPPED_EARLY, INTERRUPTED = 2, 1, 130

_PICTURES = ("fibre_strain.png", "shear_angle.png")
_EXIT_CODES = (
    "exit code: 0, every step converged; 1, stopped early and the last good state "
    "written; 2, bad input and nothing written"
)


class _Parser(argparse.ArgumentParser):
    """A parser that answers bad input with one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"skfem-textile: error: {message}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    0 when every step converged, 1 when a run stopped early, 2 for bad input.
    """
    options = _parser().parse_args(arguments)
    try:
        return _list() if options.command == "list" else _run(options)
    except BrokenPipeError:  # nobody reads on: let Python's last flush go nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print("skfem-textile: interrupted, nothing written", file=sys.stderr)
        return INTERRUPTED
    except (ValueError, OSError, MemoryError) as error:
        print(f"skfem-textile: error: {error}", file=sys.stderr)
        return BAD_INPUT


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="skfem-textile",
        description="Mechanics of woven reinforcements on scikit-fem.",
    )
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="list the scenes")
    run = commands.add_parser(
        "run", help="run a scene and write its results to a folder", epilog=_EXIT_CODES
    )
    add = run.add_argument
    add("scene", choices=SCENES, help="what to run")
    add("--out", type=Path, required=True, metavar="DIR", help="where results go")
    add(
        "--mesh",
        default="irregular",
        metavar="KIND|FILE",
        help=f"{', '.join(KINDS)} (default: irregular), or a file of quadrilaterals",
    )
    shown = " (default: %(default)s)"
    add("--size", type=_size, default="10x15", help="elements along x and y" + shown)
    add("--jitter", type=float, default=0.3, help="node moves per spacing" + shown)
    add("--seed", type=int, default=1, help="seed of the node moves" + shown)
    add(
        "--formulation",
        choices=("one-point", "full"),
        default="one-point",
        help="one stabilised point, or 2x2 points" + shown,
    )
    add("--cs", type=float, default=1.0, help="stabilisation C_s in N/mm" + shown)
    add(
        "--stabilisation",
        choices=("energy", "rate"),
        default="energy",
        help="independent of the path, or the paper's rates" + shown,
    )
    add("--fibre-stiffness", type=float, default=1e4, metavar="E", help="N/mm" + shown)
    add("--shear-stiffness", type=float, default=0.0, metavar="G", help="N/mm" + shown)
    add("--rotate", type=float, default=0.0, metavar="DEG", help="turn it all" + shown)
    add("--steps", type=int, default=20, help="load steps" + shown)
    add("--no-render", action="store_true", help="write no pictures")
    return parser


def _size(text: str) -> tuple[int, int]:
    try:
        nx, ny = (int(n) for n in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not like 10x15") from None
    return nx, ny


def _list() -> int:
    for name, scene in SCENES.items():
        print(f"{name:16}{(scene.__doc__ or '').splitlines()[0]}")
    return 0


def _run(options: argparse.Namespace) -> int:
    """Check everything, then compute, then write."""
    from . import io  # loads meshio

    scene = _scene(options)
    fabric = Fabric(
        options.fibre_stiffness, options.shear_stiffness, scene.warp, scene.weft
    )
    formulation: Formulation = (
        Full()
        if options.formulation == "full"
        else OnePoint(options.cs, options.stabilisation)
    )
    stepper = LoadStepper(
        Ply(scene.mesh, fabric, formulation), scene.conditions, options.steps
    )
    written = ("summary.json", "history.csv", f"fields/{io.STEPS}", *_PICTURES)
    with io.ResultFolder(options.out, written) as folder:
        result, stopped = _load(stepper)
        summary = scene.summary(result)
        given = {k: v for k, v in vars(options).items() if k not in ("command", "out")}
        inputs = {"inputs": {"version": __version__, **given}}
        io.write_summary(summary | inputs, folder / "summary.json")
        io.write_history(result, folder / "history.csv")
        io.write_fields(result, folder / "fields")
        if not options.no_render:
            _render(result, folder)
    _report(summary, options.out, stopped)
    return STOPPED_EARLY if stopped else 0


def _scene(options: argparse.Namespace) -> Scene:
    mesh = options.mesh
    if mesh not in KINDS:
        if not Path(mesh).is_file():
            raise ValueError(f"--mesh {mesh}: neither a file nor {', '.join(KINDS)}")
        from .io import read_mesh

        mesh = read_mesh(mesh)
    make = SCENES[options.scene]
    scene = make(mesh, options.size, options.jitter, options.seed)
    return scene.rotated(np.radians(options.rotate))


def _load(stepper: LoadStepper) -> tuple[Result, StepError | None]:
    """The result with a progress bar on a terminal, and what stopped it early."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(
        console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("load factor", total=1.0)

        def show(state: State) -> None:
            bar.update(task, completed=state.load_factor)

        stepper.progress = show
        try:
            return stepper.run(), None
        except StepError as error:
            return error.result, error


def _render(result: Result, folder: Path) -> None:
    """Write the pictures, or say in one line why there are none."""
    try:
        from . import plot
    except ImportError as error:
        print(f"no pictures: {error}; pip install 'skfem-textile[plot]'")
        return
    try:
        for name, draw in zip(
            _PICTURES, (plot.fibre_strain, plot.shear_angle), strict=True
        ):
            draw(result, filename=folder / name)
    except RuntimeError as error:
        print(f"no pictures: {error}")


def _report(summary: Mapping[str, Any], out: Path, stopped: StepError | None) -> None:
    for key, value in summary.items():
        print(
            f"{key:28}{value:.6g}" if isinstance(value, float) else f"{key:28}{value}"
        )
    print(f"results in {out}")
    if stopped:
        print(f"skfem-textile: {stopped}", file=sys.stderr)
