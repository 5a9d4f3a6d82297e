"""Entry point of the command line ``skfem-textile``: commands, parser, exit codes."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple, NoReturn

from .. import __version__
from .interruption import INTERRUPTED, raised
from .output import BAD_INPUT, STOPPED_EARLY, OutputError, complain, say, silence


class Command(NamedTuple):
    """Command of the command line.

    Attributes
    ----------
    about
        Its help text.
    module
        Module of this package.
    function
        Function of the module that runs the command: of the options, returns the exit
        code.
    epilog
        End of its help.
    """

    about: str
    module: str
    function: str = "run"
    epilog: str = ""


_NET_EXIT_CODES = (
    "exit code: 0 if there is a flat pattern of the whole part; 1 if there is none, or "
    "none with darts, or courses leave a part of the tool uncovered (all other results "
    "are written); 2 for invalid input; 130 if interrupted"
)

#: Commands by name. A module is imported only for a command that is given.
COMMANDS = {
    "list": Command("list the scenes and fabrics", "scenes", "list_scenes"),
    "show": Command(
        "draw a mesh and its fibres, and write the directions to files; or show the "
        "laws of a fabric and their sources",
        "show",
    ),
    "run": Command(
        "run a scene or a case file and write its results to a folder", "run"
    ),
    "sweep": Command(
        "run a case with all combinations of values of its keys, and compare the "
        "figures",
        "sweep",
    ),
    "fit": Command("identify laws of a fabric from tests", "fit"),
    "init": Command(
        "write a commented case file as a starting point", "scenes", "write_case"
    ),
    "report": Command(
        "write report.html, one page with all results, into the results folder of a "
        "run",
        "report",
    ),
    "export": Command(
        "map the fibres of a finished run to the mesh of the part, and write its flat "
        "pattern",
        "export",
    ),
    "net": Command(
        "lay a kinematic net on a tool: shear angles, fibres and flat pattern",
        "net",
        epilog=_NET_EXIT_CODES,
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    0 if every step converged, 1 if a run stopped early or its results cannot be
    written, 2 for invalid input, 130 after Ctrl-C or SIGTERM.
    """
    try:
        return _dispatch(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        # After an interruption in a string that is run, as `dataclass` does, Python
        # kills its process at the end, unless another string was run since.
        exec("")
        complain("interrupted")
        return INTERRUPTED


def _dispatch(arguments: Sequence[str]) -> int:
    """Run the command line; an error is one line on stderr.  Returns the exit code."""
    try:
        return _run(arguments)
    except BrokenPipeError:  # the reader closed the output
        silence(sys.stdout)
        return 0
    except OutputError as error:
        complain(f"error: {error}")
        return STOPPED_EARLY
    except OSError as error:
        from ..mesh.user_input import printable

        name = printable(error.filename or "")
        complain(f"error: {name and f'{name}: '}{error.strerror or error}")
        return BAD_INPUT
    except (ValueError, MemoryError, ModuleNotFoundError) as error:
        complain(f"error: {error or 'not enough memory'}")
        return BAD_INPUT


def _run(arguments: Sequence[str]) -> int:
    """Import the command that is given, and run it."""
    try:
        options = command_parser(arguments).parse_args(arguments)
        command = COMMANDS[options.command]
        module = import_module(f".{command.module}", __package__)
        with raised():
            return int(getattr(module, command.function)(options))
    finally:
        say("", end="")  # flushes what argparse printed


class _Parser(argparse.ArgumentParser):
    """Parser that reports invalid input in one line."""

    def error(self, message: str) -> NoReturn:
        complain(f"error: {message}")
        self.exit(BAD_INPUT)

    def parse_args(self, arguments: Any = None, namespace: Any = None) -> Any:
        """Parse options; refuse ``--name=--``, for argparse a missing value."""
        for word in sys.argv[1:] if arguments is None else arguments:
            if word.startswith("--") and word.endswith("=--"):
                self.error(f"argument {word[:-3]}: expected a value, got '--'")
        return super().parse_args(arguments, namespace)


def _require_packages() -> None:
    """Raise an error if a package that a command requires is not installed."""
    from ..mesh.requirements import require

    packages = "jinja2", "msgspec", "shapely", "tomli_w"
    require("the command line", "cli", *packages)


def command_parser(arguments: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Build the parser; it sets ``command``.

    Parameters
    ----------
    arguments
        Arguments to parse; only the command that they name gets its options. All
        commands if None.
    """
    parser = _Parser(
        prog="skfem-textile",
        description="Mechanics of woven reinforcements, based on scikit-fem.",
    )
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(dest="command", required=True)
    words = None if arguments is None else [x for x in arguments if x[:1] != "-"]
    for name, command in COMMANDS.items():
        own = commands.add_parser(
            name,
            help=command.about,
            description=command.about,
            epilog=command.epilog,
        )
        if words is None or words[:1] == [name]:
            _require_packages()
            _add_options(own, name, words and words[1:2])
    return parser


def _add_options(
    parser: argparse.ArgumentParser, command: str, named: Sequence[str] | None
) -> None:
    """Add the options of a command.

    ``named`` are the words after it, or None for the options of every scene and every
    kind of test.
    """
    from . import options

    if command in ("run", "sweep"):
        from .run_options import add_run

        add_run(parser, named, is_sweep=command == "sweep")
    elif command == "fit":
        options.add_fit(parser, named)
    elif command in ("export", "net"):
        from .run_options import add_exports

        add_exports(parser, options.OPTIONS[command])
    else:
        options.add(parser, options.OPTIONS[command])
