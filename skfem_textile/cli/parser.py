"""The parser of the command line, built from all registrations."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from .. import __version__
from ..registration import Option
from ..scenes import SCENES
from .fibres import add_show
from .fit import TESTS
from .output import complain

#: Exit code of bad input.
BAD_INPUT = 2

# How the name of a case file ends.
_SUFFIX = ".toml"

_CASE_FILE = f"CASE{_SUFFIX}"

_EXIT_CODES = (
    "exit code: 0, every step converged; 1, stopped early and the last good state "
    "written, or what was found cannot be written; 2, bad input and nothing written; "
    "130, interrupted by Ctrl-C or SIGTERM and the last good state written"
)


class _Parser(argparse.ArgumentParser):
    """A parser that reports bad input in one line."""

    def error(self, message: str) -> NoReturn:
        complain(f"error: {message}")
        self.exit(BAD_INPUT)

    def parse_args(self, arguments: Any = None, namespace: Any = None) -> Any:
        """The options; refuses ``--name=--``, which argparse would read as no value."""
        for word in sys.argv[1:] if arguments is None else arguments:
            if word.startswith("--") and word.endswith("=--"):
                self.error(f"argument {word[:-3]}: '--' is no value")
        return super().parse_args(arguments, namespace)


def is_case_file(word: str) -> bool:
    """Whether a word in the place of a scene is the name of a case file."""
    return word.lower().endswith(_SUFFIX)


def command_parser(
    options: Mapping[str, Sequence[Option]], arguments: Sequence[str] = ()
) -> argparse.ArgumentParser:
    """The parser; it sets ``command``, and for the command ``run`` also ``scene``.

    Parameters
    ----------
    options
        The options that describe a case, for each scene by its name.
    arguments
        What is to be parsed: the name of a case file may stand for a scene.
    """
    whole = _Parser(
        prog="skfem-textile",
        description="Mechanics of woven reinforcements on scikit-fem.",
    )
    whole.add_argument("--version", action="version", version=__version__)
    commands = whole.add_subparsers(dest="command", required=True)
    commands.add_parser("list", help="list the scenes")
    add_show(commands)
    run = commands.add_parser(
        "run", help="run a scene or a case file and write its results to a folder"
    )
    scenes = run.add_subparsers(dest="scene", required=True)
    for name, scene in SCENES.items():
        one = scenes.add_parser(name, help=scene.description, epilog=_EXIT_CODES)
        _add_outputs(one)
        for option in options[name]:
            _add(one, option)
        _add_course(one)
    files = [word for word in arguments[1:2] if is_case_file(word)]
    file = scenes.add_parser(
        _CASE_FILE, aliases=files, help="a case in a file", epilog=_EXIT_CODES
    )
    _add_outputs(file)
    _add_course(file)
    _add_fits(commands)
    _add_init(commands)
    _add_report(commands)
    return whole


def _add_init(commands: Any) -> None:
    init = commands.add_parser("init", help="write a commented case file to start from")
    init.add_argument("file", type=_case_file, metavar=_CASE_FILE)
    init.add_argument(
        "--scene",
        choices=tuple(SCENES),
        default="specimen",
        help="of which it is a case (default: %(default)s)",
    )


def _add_report(commands: Any) -> None:
    report = commands.add_parser(
        "report", help="write report.html, one page of all that a run has found"
    )
    report.add_argument("folder", type=_folder, metavar="DIR", help="results of a run")
    report.add_argument(
        "--test-curve",
        type=Path,
        metavar="FILE.csv",
        help="the curve of a test, in place of the one of the case",
    )


def _case_file(text: str) -> Path:
    if not is_case_file(text):
        raise argparse.ArgumentTypeError(f"{text!r} must end with {_SUFFIX}")
    return Path(text)


def _add_fits(commands: Any) -> None:
    """Add the command ``fit``; it sets ``test``."""
    fit = commands.add_parser("fit", help="find laws of a fabric from its tests")
    tests = fit.add_subparsers(dest="test", required=True)
    for name, (description, options) in TESTS.items():
        one = tests.add_parser(name, help=description, description=description)
        one.add_argument("data", type=Path, nargs="+", metavar="DATA.csv")
        _add_outputs(one)
        for option in options:
            _add(one, option)


def _add(parser: argparse.ArgumentParser, option: Option) -> None:
    """Add an option; the help shows its default if there is one."""
    given: dict[str, Any] = {"default": option.default, "help": option.help}
    if option.default not in (None, ()) and not option.repeated:
        given["help"] += " (default: %(default)s)"
    if option.repeated:
        given |= {"action": "extend" if option.words else "append", "default": []}
    if option.read is not str:
        given["type"] = _reader(option.read)
    for key, value in (
        ("nargs", option.words),
        ("choices", option.choices),
        ("metavar", option.metavar),
    ):
        if value:
            given[key] = value
    parser.add_argument(f"--{option.name}", **given)


def _reader(read: Callable[[str], Any]) -> Callable[[str], Any]:
    """A reader for argparse, which words errors of types but not of functions."""
    return read if isinstance(read, type) else partial(_told, read)


def _told(read: Callable[[str], Any], word: str) -> Any:
    try:
        return read(word)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _add_outputs(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--out", type=_folder, required=True, metavar="DIR", help="where results go")
    add("--no-render", action="store_true", help="write no pictures")


def _add_course(parser: argparse.ArgumentParser) -> None:
    """Add the options that change no result."""
    parser.add_argument(
        "--checkpoint",
        type=_folder,
        nargs="?",
        const=True,
        metavar="FOLDER",
        help="write every converged step, to `checkpoint` in DIR if no folder is named",
    )
    parser.add_argument(
        "--resume",
        type=_folder,
        nargs="?",
        const=True,
        metavar="FOLDER",
        help="go on from the checkpoint of an interrupted run, and keep writing it",
    )
    parser.add_argument(
        "-v",
        "--verbose",
        action="count",
        default=0,
        help="tell of every step; twice: of every iteration",
    )


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("a folder must have a name")
    if text.startswith("--"):  # argparse does not know it as an option
        raise argparse.ArgumentTypeError(f"{text!r} is no option; a folder is ./{text}")
    return Path(text)
