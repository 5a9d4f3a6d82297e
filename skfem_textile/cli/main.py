"""Entry point of the command line ``skfem-textile``: commands and exit codes."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..cases.read import CaseFileError, declared, read_tables
from ..cases.scenes import SCENES
from ..cases.table import summary_of
from ..mesh.user_input import printable
from .interruption import INTERRUPTED, raised
from .output import OutputError, complain, say, silence
from .parser import BAD_INPUT, command_parser, is_case_file, tables_of_options
from .progress import STOPPED_EARLY
from .run import run
from .show import show

if TYPE_CHECKING:
    from ..scenes.shear_test import ShearTest


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    0 if every step converged, 1 if a run stopped early or its results cannot be
    written, 2 for invalid input, 130 after Ctrl-C or SIGTERM.
    """
    try:
        with raised():
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
    except (ValueError, OSError, MemoryError) as error:
        complain(f"error: {error or 'not enough memory'}")
        return BAD_INPUT


def _run(arguments: Sequence[str]) -> int:
    try:
        options = command_parser(arguments).parse_args(arguments)
        if options.command == "list":
            return _list()
        if options.command == "show":
            return show(options)
        if options.command == "fit":
            from .fit import run_fit

            return run_fit(options)
        if options.command == "net":
            from .net import run_net

            return run_net(options)
        if options.command == "init":
            return _init(options.scene, options.file)
        if options.command == "report":
            from .report import write_report

            return write_report(options.folder, options.test_curve, _shear_test)
        return _run_case(options)
    finally:
        say("", end="")  # flushes what argparse printed


def _run_case(options: argparse.Namespace) -> int:
    """Run a scene or a case file."""
    if not is_case_file(options.scene):
        tables: dict[str, Any] = {"scene": {"name": options.scene}}
        return run(declared(tables_of_options(tables, options)), options)
    path = Path(options.scene)
    tables = read_tables(path)
    try:
        case = declared(tables_of_options(tables, options), path.parent)
        return run(case, options)
    except ValueError as error:
        raise CaseFileError(f"{printable(path)}: {error}") from None


def _shear_test(path: Path) -> "ShearTest | None":
    """Shear test of a case file."""
    from ..cases import case_from_file

    return case_from_file(path).scene.shear_test


def _init(scene: str, file: Path) -> int:
    """Write the case file of a scene with all defaults and comments."""
    from ..cases.write import case_text

    head = (
        f"# A case file. Run it with: skfem-textile run {printable(file.name)} --out "
        "results"
    )
    text = case_text(declared({"scene": {"name": scene}}), head)
    with open(file, "x", encoding="utf-8") as opened:
        opened.write(text)
    say(f"case file of the scene {scene} written to {printable(file)}")
    return 0


def _list() -> int:
    width = max(map(len, SCENES)) + 2
    for name, scene in SCENES.items():
        say(f"{name:{width}}{summary_of(scene)}")
    return 0
