"""The command line: ``skfem-textile list`` and ``skfem-textile run SCENE``."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn, get_args

from . import __version__, commands
from .formulations import Kind
from .scenes.rectangle import KINDS

BAD_INPUT, INTERRUPTED = 2, 130

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
        return options.task(options)
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
    tasks = parser.add_subparsers(dest="command", required=True)
    tasks.add_parser("list", help="list the scenes").set_defaults(task=commands.scenes)
    run = tasks.add_parser("run", help="run a scene and write its results to a folder")
    scenes = run.add_subparsers(dest="scene", required=True)
    for name, add_options in (("strip", _strip), ("two_element", _two_element)):
        scene = scenes.add_parser(name, help=commands.SCENES[name], epilog=_EXIT_CODES)
        scene.add_argument(
            "--out", type=Path, required=True, metavar="DIR", help="where results go"
        )
        scene.add_argument("--no-render", action="store_true", help="write no pictures")
        add_options(scene)
    return parser


def _two_element(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(task=commands.two_element)


def _strip(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(task=commands.run)
    add, shown = parser.add_argument, " (default: %(default)s)"
    add(
        "--paper",
        action="store_const",
        const=commands.paper,
        dest="task",
        help="run the paper's figures; of the other options only --no-render counts",
    )
    add(
        "--mesh",
        default="irregular",
        metavar="KIND|FILE",
        help=f"{', '.join(KINDS)}, or a file of quadrilaterals" + shown,
    )
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
        choices=get_args(Kind),
        default="energy",
        help="independent of the path, or the paper's rates" + shown,
    )
    add("--fibre-stiffness", type=float, default=1e4, metavar="E", help="N/mm" + shown)
    add("--shear-stiffness", type=float, default=0.0, metavar="G", help="N/mm" + shown)
    add("--rotate", type=float, default=0.0, metavar="DEG", help="turn it all" + shown)
    add("--steps", type=int, default=20, help="load steps" + shown)


def _size(text: str) -> tuple[int, int]:
    try:
        nx, ny = (int(n) for n in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not like 10x15") from None
    return nx, ny
