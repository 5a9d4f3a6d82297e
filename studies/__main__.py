"""Run a study: ``python -m studies NAME --out DIR``.  Without a name, list them.

``python -m studies figures`` writes the results of the studies to the documentation.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NoReturn

from skfem_textile.cli.interruption import INTERRUPTED, raised
from skfem_textile.cli.output import OutputError, complain, say, silence

from .common import provenance
from .common.running import ONE_THREAD, executor_of
from .common.tables import grouped
from .study import Row, Study, descriptions, load

STOPPED_EARLY, BAD_INPUT = 1, 2


class _Parser(argparse.ArgumentParser):
    """A parser that reports bad input in one line."""

    def error(self, message: str) -> NoReturn:
        complain(f"error: {message}")
        self.exit(BAD_INPUT)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a study; returns the exit code.

    0 if every case ran and the study reports no failure, 1 otherwise or if results
    cannot be written, 2 for bad input, 130 after Ctrl-C or SIGTERM.
    """
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        with raised():
            return _main(words)
    except BrokenPipeError:  # the output pipe is closed
        silence(sys.stdout)
        return 0
    except OutputError as error:
        complain(f"error: {error}")
        return STOPPED_EARLY
    except (ValueError, OSError) as error:
        complain(f"error: {error}")
        return BAD_INPUT
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED


def _main(words: list[str]) -> int:
    if not words:
        for name, description in descriptions().items():
            say(f"{name:16}{description}")
        return 0
    parser = _Parser(prog="python -m studies", description=__doc__)
    names = parser.add_subparsers(dest="study", metavar="NAME", required=True)
    pages = names.add_parser("figures", help="write results to the documentation")
    pages.add_argument("--check", action="store_true", help="compare, do not write")
    study: Study[Any] | None = None
    for name, description in descriptions().items():
        options = names.add_parser(name, help=description, description=description)
        if name == words[0]:  # load the dependencies of this study only
            study = load(name)
            _add_options(options, study)
    chosen = parser.parse_args(words)
    if chosen.study == "figures":
        from .figures.pages import main as figures

        return figures(chosen.check)
    assert study is not None
    return _run(study, chosen)


def _add_options(parser: argparse.ArgumentParser, study: Study[Any]) -> None:
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    add("--resume", action="store_true", help="continue an interrupted study in DIR")
    add("--no-render", action="store_true", help="do not draw figures")
    add(
        "--case",
        nargs="+",
        metavar="NAME",
        help="run these cases only; * matches any characters",
    )
    if not study.timed:
        add("--workers", type=_positive, default=1, help="processes (default: 1)")
    study.add_options(parser)


def _positive(text: str) -> int:
    if not (text.isdecimal() and int(text)):
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive integer")
    return int(text)


def _run(study: Study[Any], options: argparse.Namespace) -> int:
    """Run the cases and write the report, without failed cases."""
    from skfem_textile.cli.result_folder import ResultFolder
    from skfem_textile.sweep import SweepError

    if study.timed:  # before linear-algebra libraries are loaded
        os.environ.update(ONE_THREAD)
    cases = _cases(study, options)
    written = [*study.written(cases), provenance.FILE]
    results = ResultFolder(options.out, written)
    pending = options.out / f"{options.study}-unfinished.jsonl"
    if pending.is_file() and pending.stat().st_size and not options.resume:
        raise ValueError(
            f"{pending} is from an unfinished study: use --resume, or delete the file"
        )
    code, complaint = 0, ""
    rows_by_name: dict[str, list[Row]] = {}
    rows: list[Row] = []
    try:
        _examine(study, cases, options, pending, rows_by_name)
    except SweepError as error:
        code, complaint = STOPPED_EARLY, f"{error}; --resume runs the remaining cases"
    except KeyboardInterrupt:
        code, complaint = INTERRUPTED, "interrupted; --resume runs the remaining cases"
    finally:  # an interrupted study still writes its report
        rows = _with_earlier(study, options, rows_by_name)
        if rows:
            with results as folder:
                record = {provenance.FILE: provenance.recorded(options)}
                for name, text in (study.tables(rows) | record).items():
                    (folder / name).write_text(text, encoding="utf-8", newline="")
    if not (complaint and pending.is_file() and pending.stat().st_size):
        pending.unlink(missing_ok=True)
    pictures = [name for name in study.pictures if name in written]
    if pictures and rows and code != INTERRUPTED and not options.no_render:
        code = _render(study, rows, ResultFolder(options.out, pictures), code)
    say(f"results in {options.out}")
    complaint = complaint or study.complaint(rows)
    if complaint:
        complain(complaint)
    return code or (STOPPED_EARLY if complaint else 0)


def _cases(study: Study[Any], options: argparse.Namespace) -> list[Any]:
    """The cases of the study that match ``--case``; all by default."""
    cases = list(study.cases(options))
    if options.case is None:
        return cases
    names = [study.name(case) for case in cases]
    chosen = set[str]()
    for pattern in options.case:
        if not (named := [n for n in names if fnmatchcase(n, pattern)]):
            known = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
            raise ValueError(f"no case matches {pattern}; available: {known}")
        chosen.update(named)
    return [case for case, name in zip(cases, names, strict=True) if name in chosen]


def _examine(
    study: Study[Any],
    cases: list[Any],
    options: argparse.Namespace,
    pending: Path,
    rows_by_name: dict[str, list[Row]],
) -> None:
    """Add the rows of each case by its name; they are saved as cases finish."""
    from skfem_textile.sweep import sweep

    pending.parent.mkdir(parents=True, exist_ok=True)
    workers = 1 if study.timed else min(options.workers, len(cases))
    with executor_of(workers) as executor:
        for case, rows in sweep(
            study.examine, cases, executor, out=pending, key=study.name
        ):
            name = study.name(case)
            rows_by_name[name] = [{"case": name} | row for row in rows]
            say(study.line(rows_by_name[name]))


def _with_earlier(
    study: Study[Any], options: argparse.Namespace, rows_by_name: dict[str, list[Row]]
) -> list[Row]:
    """The rows in case order; stored rows of cases not run are kept."""
    if options.case and rows_by_name:
        try:
            stored = study.stored(options.out)
        except FileNotFoundError:
            stored = []
        rows_by_name = grouped(stored, "case") | rows_by_name
    names = (study.name(case) for case in study.cases(options))
    return [row for name in names for row in rows_by_name.get(name, [])]


def _render(study: Study[Any], rows: list[Row], results: Any, code: int) -> int:
    """Draw the figures, or print the error on one line; returns the exit code."""
    try:
        with results as folder:
            study.draw(rows, folder)
    except KeyboardInterrupt:
        complain("interrupted; tables are written, figures are not")
        return INTERRUPTED
    except Exception as error:
        say(f"no figures: {error}")
    return code


if __name__ == "__main__":
    sys.exit(main())
