"""The command line ``skfem-textile``: its commands and exit codes."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from ..scenes import SCENES
from .case import case_of, options_of, stepper_of
from .interruption import INTERRUPTED, raised
from .output import OutputError, complain, say, silence
from .parser import BAD_INPUT, command_parser
from .progress import STOPPED_EARLY
from .run import run

_STUDIES = (
    "studies are no part of the command line: run `python -m studies NAME --out DIR` "
    "in a checkout of the repository"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    0 when every step converged, 1 when a run stopped early or its results cannot be
    written, 2 for bad input, 130 after Ctrl-C or SIGTERM.
    """
    try:
        with raised():
            return _answer(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED


def _answer(arguments: Sequence[str]) -> int:
    """Run the command line; an error is one line on stderr.  Returns the exit code."""
    try:
        return _run(arguments)
    except BrokenPipeError:  # the reader has closed the output
        silence(sys.stdout)
        return 0
    except OutputError as error:
        complain(f"error: {error}")
        return STOPPED_EARLY
    except (ValueError, OSError, MemoryError) as error:
        complain(f"error: {error or 'there is not enough memory'}")
        return BAD_INPUT


def _run(arguments: Sequence[str]) -> int:
    if _is_study(arguments):
        raise ValueError(_STUDIES)
    own = {name: options_of(scene) for name, scene in SCENES.items()}
    try:
        options = command_parser(own).parse_args(arguments)
        if options.command == "list":
            return _list()
        if options.command == "fit":
            from .fit.run import run_fit  # loads much of scipy

            return run_fit(options)
        given = {o.key: getattr(options, o.key) for o in own[options.scene]}
        case, values = case_of(given | {"scene": options.scene})
        case = replace(case, pictures=not options.no_render)
        return run(case, partial(stepper_of, case, values), values, options)
    finally:
        say("", end="")  # flushes what argparse printed


def _list() -> int:
    for name, scene in SCENES.items():
        say(f"{name:16}{scene.description}")
    return 0


def _is_study(arguments: Sequence[str]) -> bool:
    """Whether they ask for a study, which the command line once ran."""
    words = list(arguments)
    return (
        words[:1] == ["study"]
        or words[:2] == ["run", "two_element"]
        or (words[:2] == ["run", "strip"] and "--paper" in words)
    )
