"""The command line ``skfem-textile``: its commands and exit codes."""

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from ..mesh.user_input import printable
from ..registration import Option
from ..scenes import SCENES
from ..scenes.shear_test import ShearTest
from .case.build import case_of, completed
from .case.file import CaseFileError, in_file_words, read_case_file
from .case.laws import IN_COMPRESSION, OF_WEFT
from .case.options import options_of, tables_of
from .case.text import case_text
from .case.written import WrittenCase
from .fibres import show
from .interruption import INTERRUPTED, raised
from .output import OutputError, complain, say, silence
from .parser import BAD_INPUT, command_parser, is_case_file
from .progress import STOPPED_EARLY
from .results import HandOver
from .run import run, stepper_of

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


def parser(arguments: Sequence[str] = ()) -> argparse.ArgumentParser:
    """The parser of the command line, as for `command_parser`."""
    own = {name: options_of(scene) for name, scene in SCENES.items()}
    return command_parser(own, arguments)


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
    try:
        options = parser(arguments).parse_args(arguments)
        if options.command == "list":
            return _list()
        if options.command == "show":
            return show(options)
        if options.command == "fit":
            from .fit import run_fit

            return run_fit(options)
        if options.command == "init":
            return _init(options.scene, options.file)
        if options.command == "report":
            from .report import write_report

            return write_report(options.folder, options.test_curve, _shear_test)
        if is_case_file(options.scene):
            return _run_file(Path(options.scene), options)
        given = {o.key: _given(o, options) for o in options_of(SCENES[options.scene])}
        said = {"scene": options.scene, "regions": {}, "pictures": True}
        parts = dict.fromkeys((OF_WEFT, IN_COMPRESSION))
        return _run_case(given | parts | said, options)
    finally:
        say("", end="")  # flushes what argparse printed


def _run_file(path: Path, options: argparse.Namespace) -> int:
    """Run a case file; what is wrong with it is told in its own words."""
    every = {name: tables_of(scene) for name, scene in SCENES.items()}
    values = read_case_file(path, every)
    try:
        return _run_case(values, options)
    except ValueError as error:
        said = in_file_words(str(error), every[values["scene"]])
        raise CaseFileError(f"{printable(path)}: {said}") from None


def _shear_test(path: Path) -> ShearTest | None:
    """The test of shear that the case of a file is."""
    every = {name: tables_of(scene) for name, scene in SCENES.items()}
    return case_of(read_case_file(path, every))[0].scene.shear_test


def _run_case(values: dict[str, Any], options: argparse.Namespace) -> int:
    values["pictures"] = values["pictures"] and not options.no_render
    case, values = case_of(values)
    tables = tables_of(SCENES[values["scene"]])
    hand_over = HandOver.read(values)
    written = WrittenCase(partial(case_text, tables, values))
    make = partial(stepper_of, case, values)
    return run(case, make, values, written, hand_over, options)


def _given(option: Option, options: argparse.Namespace) -> Any:
    """The value of an option; one that may be repeated and is not has its default."""
    value = getattr(options, option.key)
    return list(option.default) if option.repeated and not value else value


def _init(scene: str, file: Path) -> int:
    """Write a case file of a scene, with all defaults and comments."""
    tables = tables_of(SCENES[scene])
    values = {key: value for t in tables for key, value in t.nothing.items()}
    values = completed({**values, "scene": scene, "regions": {}}, SCENES[scene])
    head = f"# A case: skfem-textile run {file.name} --out results"
    text = case_text(tables, values, head)
    with open(file, "x", encoding="utf-8") as opened:
        opened.write(text)
    say(f"{printable(file)}: a case of the scene {scene}")
    return 0


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
