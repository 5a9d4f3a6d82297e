"""Entry point of the command line ``skfem-textile``: commands and exit codes."""

import sys
from collections.abc import Sequence
from importlib import import_module

from .interruption import INTERRUPTED, raised
from .output import BAD_INPUT, STOPPED_EARLY, OutputError, complain, say, silence
from .parser import COMMANDS, command_parser


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
        command = import_module(f".{COMMANDS[options.command].module}", __package__)
        with raised():
            return int(command.run(options))
    finally:
        say("", end="")  # flushes what argparse printed
