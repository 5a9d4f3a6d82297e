"""Parser of the command line: commands, and the modules of their options."""

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any, NamedTuple, NoReturn

from .. import __version__
from .output import BAD_INPUT, complain


class Command(NamedTuple):
    """Command of the command line.

    Attributes
    ----------
    about
        Its help text.
    module
        Module of this package with ``run(options)``, which returns the exit code.
    options
        Module of this package with ``add_NAME(parser, named)``, which adds the options
        of the command ``NAME``; ``named`` are the words after the command, or None for
        the options of every scene and every kind of test.
    """

    about: str
    module: str
    options: str = "options"


#: Commands by name. A module is imported only for a command that is given.
COMMANDS = {
    "list": Command("list the scenes", "listing"),
    "show": Command(
        "draw a mesh and its fibres, and write the directions to files", "show"
    ),
    "run": Command(
        "run a scene or a case file and write its results to a folder",
        "run",
        "run_options",
    ),
    "fit": Command("identify laws of a fabric from tests", "fit", "fit_options"),
    "init": Command("write a commented case file as a starting point", "init"),
    "report": Command(
        "write report.html, one page with all results, into the results folder of a "
        "run",
        "report",
    ),
    "net": Command(
        "lay a kinematic net on a tool: shear angles, fibres and flat pattern", "net"
    ),
}


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
        own = commands.add_parser(name, help=command.about)
        if words is None or words[:1] == [name]:
            _require_packages()
            options = import_module(f".{command.options}", __package__)
            getattr(options, f"add_{name}")(own, words and words[1:2])
    return parser
