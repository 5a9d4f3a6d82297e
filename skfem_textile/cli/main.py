"""The command line: ``skfem-textile`` with ``list`` and ``run``."""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn, get_args

from .. import __version__
from ..files.interruption import INTERRUPTED, raised
from ..files.output import OutputError, complain, say, silence
from ..ply.formulations import Kind
from ..scenes.bias_extension import PARTS
from ..scenes.rectangle import KINDS
from ..scenes.trellis import SIDES
from ..solve.linear import SOLVERS
from ..solve.stepper import DEFAULT_STRATEGIES, DEFAULT_WARN_ONLY
from ..solve.strategies import STRATEGIES
from ..solve.verdict import CHECKS
from . import commands
from .described import SHEAR_LAWS, scene_of, stepper_of

_EXIT_CODES = (
    "exit code: 0, every step converged; 1, stopped early and the last good state "
    "written, or what was found cannot be written; 2, bad input and nothing written; "
    "130, interrupted by Ctrl-C or SIGTERM and the last good state written"
)

# So far from zero an angle still has ten decimals; at 1e17 a turn by 45 is lost.
_MOST_DEGREES = 36_000.0

_SHOWN = " (default: %(default)s)"


class _Parser(argparse.ArgumentParser):
    """A parser that answers bad input with one line."""

    def error(self, message: str) -> NoReturn:
        complain(f"error: {message}")
        self.exit(commands.BAD_INPUT)

    def parse_args(self, arguments: Any = None, namespace: Any = None) -> Any:
        """The options; ``--name=--`` is no value, which argparse takes for none."""
        for word in sys.argv[1:] if arguments is None else arguments:
            if word.startswith("--") and word.endswith("=--"):
                self.error(f"argument {word[:-3]}: '--' is no value")
        return super().parse_args(arguments, namespace)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    0 when every step converged, 1 when a run stopped early or its results cannot be
    written, 2 for bad input, 130 after Ctrl-C or SIGTERM.
    """
    try:
        with raised():
            return _answer(arguments)
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED


def _answer(arguments: Sequence[str] | None) -> int:
    """The exit code, after one line to stderr if something is wrong."""
    try:
        return _run(arguments)
    except BrokenPipeError:  # nobody reads on
        silence(sys.stdout)
        return 0
    except OutputError as error:
        complain(f"error: {error}")
        return commands.STOPPED_EARLY
    except (ValueError, OSError, MemoryError) as error:
        complain(f"error: {error or 'there is not enough memory'}")
        return commands.BAD_INPUT


def _run(arguments: Sequence[str] | None) -> int:
    _refuse_studies(sys.argv[1:] if arguments is None else arguments)
    try:
        options = _parser().parse_args(arguments)
        return options.task(options)
    finally:
        say("", end="")  # what argparse has printed


def _refuse_studies(words: Sequence[str]) -> None:
    """Say where studies are run, which are not installed with the package."""
    match list(words):
        case ["study", *_]:
            name = "NAME"
        case ["run", "two_element", *_]:
            name = "paper"
        case ["run", "strip", *others] if "--paper" in others:
            name = "paper"
        case _:
            return
    raise ValueError(
        "studies are run in a checkout of the project, or in its sdist, by "
        f"python -m studies {name} --out DIR"
    )


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
    for name, add_options in _OPTIONS.items():
        scene = scenes.add_parser(name, help=commands.SCENES[name], epilog=_EXIT_CODES)
        _output(scene)
        add_options(scene)
    return parser


def _output(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--out", type=_folder, required=True, metavar="DIR", help="where results go")
    add("--no-render", action="store_true", help="write no pictures")


def _strip(parser: argparse.ArgumentParser) -> None:
    _loaded(parser, "10x15")


def _picture_frame(parser: argparse.ArgumentParser) -> None:
    _loaded(parser, "10x10")
    _angle(parser, "shear-angle", 45.0, "shear angle at the end")


def _bias_extension(parser: argparse.ArgumentParser) -> None:
    _loaded(parser, "16x32", jitter=0.25)
    _angle(parser, "warp", 45.0, "inclination of the warp, below 90")
    _angle(parser, "weft", 135.0, "inclination of the weft, 180 less the warp's")
    _angle(parser, "shear-angle", 40.0, "shear angle of the middle at the end")
    parser.add_argument(
        "--part",
        choices=PARTS,
        default="whole",
        help="half: on a roller along the axis of symmetry" + _SHOWN,
    )


def _trellis(parser: argparse.ArgumentParser) -> None:
    _loaded(parser, "10x10")
    _angle(parser, "warp", 0.0, "inclination of the warp")
    _angle(parser, "weft", 90.0, "inclination of the weft")
    _angle(parser, "shear-angle", 45.0, "shear angle at the origin, at the end")
    _angle(parser, "bend", 30.0, "by which a fibre of 100 mm bends in the end")
    parser.add_argument(
        "--free",
        nargs="+",
        action="extend",
        choices=SIDES,
        default=[],
        metavar="SIDE",
        help=f"sides that are not held, of {', '.join(SIDES)}",
    )
    parser.add_argument(
        "--roller",
        type=_roller,
        action="append",
        default=[],
        metavar="SIDE=DEG",
        help="a side on a roller that rolls along a line of this inclination; "
        "may be repeated",
    )


def _run_scene(options: argparse.Namespace) -> int:
    scene = scene_of(options)
    return commands.run(options, scene, stepper_of(scene, options))


_OPTIONS = {
    "strip": _strip,
    "picture_frame": _picture_frame,
    "trellis": _trellis,
    "bias_extension": _bias_extension,
}


def _angle(
    parser: argparse.ArgumentParser, name: str, default: float, what: str
) -> None:
    parser.add_argument(
        f"--{name}", type=_degrees, default=default, metavar="DEG", help=what + _SHOWN
    )


def _loaded(parser: argparse.ArgumentParser, size: str, jitter: float = 0.3) -> None:
    """Options of every scene in which a ply is loaded."""
    made = {"size": _size(size), "jitter": jitter, "seed": 1}
    parser.set_defaults(task=_run_scene, made=made)
    add = parser.add_argument
    add(
        "--mesh",
        default="irregular",
        metavar="KIND|FILE",
        help=f"{', '.join(KINDS)}, or a file of quadrilaterals or triangles" + _SHOWN,
    )
    add(
        "--size",
        type=_size,
        help=f"elements along x and y of a mesh to make (default: {size})",
    )
    add(
        "--jitter",
        type=float,
        help=f"its node moves per spacing (default: {jitter:g})",
    )
    add(
        "--split",
        nargs="?",
        choices=("triangles", "quads"),
        const="triangles",
        help="cut the quadrilaterals in triangles, and these in three each; or quads: "
        "cut them in four",
    )
    add("--seed", type=int, help="seed of its node moves (default: 1)")
    add(
        "--formulation",
        choices=("one-point", "macro", "full", "quadratic"),
        help="one stabilised point, macro-elements of what was split, 2x2 points, or "
        "quadratic triangles, for which quadrilaterals are cut along a diagonal "
        "(default: macro on a mesh that was split, else one-point)",
    )
    add(
        "--cs",
        type=_stabilisation,
        default="auto",
        help="stabilisation C_s in N/mm, or auto: eight times the shear stiffness of "
        "each element, 1e-4 E without any" + _SHOWN,
    )
    add(
        "--stabilisation",
        choices=get_args(Kind),
        default="energy",
        help="independent of the path, the paper's rates, by jumps between elements, "
        "or isotropic; the last three need --cs" + _SHOWN,
    )
    add(
        "--deviation",
        type=float,
        metavar="C",
        help="give quadratic triangles the tension of their mean strain, and "
        "deviations from it this multiple of the shear stiffness (20 does well), or "
        "half of the fibre stiffness where there is none",
    )
    add("--fibre-stiffness", type=float, default=1e4, metavar="E", help="N/mm" + _SHOWN)
    add("--shear-stiffness", type=float, default=0.0, metavar="G", help="N/mm" + _SHOWN)
    add(
        "--shear-law",
        choices=tuple(SHEAR_LAWS),
        default="linear",
        help="M_s = G gamma, or sin2: w = G sin^2 gamma / 2" + _SHOWN,
    )
    add(
        "--force",
        type=_force,
        action="append",
        default=[],
        metavar="NAME=FX,FY",
        help="a force in N in all, spread over a named boundary beside the scene's "
        "conditions, in proportion to the load factor; may be repeated",
    )
    _angle(parser, "rotate", 0.0, "turn it all")
    _stepping(parser)


def _stepping(parser: argparse.ArgumentParser) -> None:
    """Options of the load stepper."""
    add = parser.add_argument
    add("--steps", type=int, default=20, help="load steps" + _SHOWN)
    add(
        "--strategy",
        nargs="+",
        choices=tuple(STRATEGIES),
        default=list(DEFAULT_STRATEGIES),
        metavar="NAME",
        help=f"what a step tries, in this order, of {', '.join(STRATEGIES)}" + _SHOWN,
    )
    add(
        "--warn-only",
        nargs="*",
        choices=tuple(CHECKS),
        default=list(DEFAULT_WARN_ONLY),
        metavar="CHECK",
        help=f"checks that do not refuse a state, of {', '.join(CHECKS)}" + _SHOWN,
    )
    add(
        "--solver",
        choices=("auto", *SOLVERS),
        default="auto",
        help="linear solver: cholmod needs cvxopt, pardiso pypardiso; auto takes the "
        "fastest that is there, which it measures for large systems" + _SHOWN,
    )
    add(
        "--checkpoint",
        type=_folder,
        nargs="?",
        const=True,
        metavar="FOLDER",
        help="write every converged step, to `checkpoint` in DIR if no folder is named",
    )
    add(
        "--resume",
        type=_folder,
        nargs="?",
        const=True,
        metavar="FOLDER",
        help="go on from the checkpoint of an interrupted run, and keep writing it",
    )
    add(
        "-v",
        "--verbose",
        action="count",
        default=0,
        help="tell of every step; twice: of every iteration",
    )


def _degrees(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is no finite number")
    if abs(number) > _MOST_DEGREES:
        raise argparse.ArgumentTypeError(f"{text!r} is more than a hundred turns")
    return number


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("a folder must have a name")
    if text.startswith("--"):  # which argparse takes for none of its options
        raise argparse.ArgumentTypeError(f"{text!r} is no option; a folder is ./{text}")
    return Path(text)


def _roller(text: str) -> tuple[str, float]:
    side, _, degrees = text.partition("=")
    try:
        return side, float(degrees)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not like left=30") from None


def _force(text: str) -> tuple[str, tuple[float, float]]:
    name, _, components = text.partition("=")
    try:
        x, y = (float(component) for component in components.split(","))
    except ValueError:
        x = math.nan
    if not (name and math.isfinite(x) and math.isfinite(y)):
        raise argparse.ArgumentTypeError(f"{text!r} is not like top=0,100")
    return name, (x, y)


def _stabilisation(text: str) -> float | str:
    try:
        return text if text == "auto" else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number, nor auto") from None


def _size(text: str) -> tuple[int, int]:
    try:
        nx, ny = (int(n) for n in text.split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not like 10x15") from None
    return nx, ny
