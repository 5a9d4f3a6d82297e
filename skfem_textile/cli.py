"""The command line: ``skfem-textile list`` and ``skfem-textile run SCENE``."""

import argparse
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

import numpy as np

from .fabric import Fabric
from .formulations import Formulation, Full, OnePoint
from .ply import Ply
from .result import Result, State
from .scenes import SCENES, Scene
from .scenes.rectangle import KINDS
from .stepper import LoadStepper, StepError

BAD_INPUT, STOPPED_EARLY = 2, 1


class _Parser(argparse.ArgumentParser):
    """A parser that answers bad input with one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: error: {message}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    0 when every step converged, 1 when a run stopped early, 2 for bad input.
    """
    options = _parser().parse_args(arguments)
    if options.command == "list":
        for name, scene in SCENES.items():
            print(f"{name:16}{(scene.__doc__ or '').splitlines()[0]}")
        return 0
    try:
        return _run(options)
    except (ValueError, OSError) as error:
        print(f"skfem-textile: error: {error}", file=sys.stderr)
        return BAD_INPUT


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="skfem-textile",
        description="Mechanics of woven reinforcements on scikit-fem.",
    )
    parser.add_argument(
        "--version", action="version", version=f"%(prog)s {version('skfem-textile')}"
    )
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="list the scenes")
    run = commands.add_parser(
        "run",
        help="run a scene and write its results to a folder",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    add = run.add_argument
    add("scene", choices=SCENES, help="what to run")
    add("--out", type=Path, required=True, metavar="DIR", help="where results go")
    mesh_help = f"{', '.join(KINDS)}, or a file of quadrilaterals"
    add("--mesh", default="irregular", metavar="KIND|FILE", help=mesh_help)
    add("--size", type=_size, default="10x15", help="elements along x and y")
    add("--jitter", type=float, default=0.3, help="node moves as a share of spacing")
    add("--seed", type=int, default=1, help="seed of the node moves")
    add("--formulation", choices=("one-point", "full"), default="one-point", help=" ")
    add("--cs", type=float, default=1.0, help="one-point stabilisation C_s (N/mm)")
    add("--fibre-stiffness", type=float, default=1e4, metavar="E", help="N/mm")
    add("--shear-stiffness", type=float, default=0.0, metavar="G", help="N/mm")
    add("--rotate", type=float, default=0.0, metavar="DEG", help="turn the problem")
    add("--steps", type=int, default=20, help="load steps")
    add("--no-render", action="store_true", help="write no pictures")
    return parser


def _size(text: str) -> tuple[int, int]:
    try:
        nx, ny = (int(n) for n in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not like 10x15") from None
    return nx, ny


def _run(options: argparse.Namespace) -> int:
    """Check everything, then compute, then write."""
    from . import io  # loads meshio

    scene = _scene(options)
    fabric = Fabric(
        options.fibre_stiffness, options.shear_stiffness, scene.warp, scene.weft
    )
    formulation: Formulation = (
        Full() if options.formulation == "full" else OnePoint(options.cs)
    )
    stepper = LoadStepper(
        Ply(scene.mesh, fabric, formulation), scene.conditions, options.steps
    )
    with io.all_or_nothing(options.out) as folder:
        result, stopped = _load(stepper)
        summary = scene.summary(result)
        io.write_summary(summary, folder / "summary.json")
        io.write_history(result, folder / "history.csv")
        io.write_fields(result, folder / "fields")
        if not options.no_render:
            _render(result, folder)
    for key, value in summary.items():
        print(
            f"{key:28}{value:.6g}" if isinstance(value, float) else f"{key:28}{value}"
        )
    print(f"results in {options.out}")
    if stopped:
        print(f"skfem-textile: {stopped}", file=sys.stderr)
    return STOPPED_EARLY if stopped else 0


def _scene(options: argparse.Namespace) -> Scene:
    mesh = options.mesh
    if mesh not in KINDS:
        if not Path(mesh).exists():
            raise ValueError(f"--mesh {mesh}: neither a file nor {', '.join(KINDS)}")
        from .io import read_mesh

        mesh = read_mesh(mesh)
    make = SCENES[options.scene]
    scene = make(mesh, options.size, options.jitter, options.seed)
    return scene.rotated(np.radians(options.rotate))


def _load(stepper: LoadStepper) -> tuple[Result, StepError | None]:
    """The result with a progress bar on a terminal, and what stopped it early."""
    from tqdm import tqdm

    layout = "{l_bar}{bar}| load factor {n:.3f} [{elapsed}<{remaining}]"
    with tqdm(total=1.0, disable=None, bar_format=layout, leave=False) as bar:

        def show(state: State) -> None:
            bar.update(state.load_factor - bar.n)

        stepper.progress = show
        try:
            return stepper.run(), None
        except StepError as error:
            return error.result, error


def _render(result: Result, folder: Path) -> None:
    """Write the pictures, or say in one line why there are none."""
    try:
        from . import plot

        plot.fibre_strain(result, filename=folder / "fibre_strain.png")
        plot.shear_angle(result, filename=folder / "shear_angle.png")
    except (ImportError, RuntimeError) as error:
        print(f"no pictures: {error}")
