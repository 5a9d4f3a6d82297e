"""The command ``report``: one page of all that a run has found."""

import json
import tempfile
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, TypeAlias

from ...mesh.user_input import printable
from ...scenes.shear_test import ShearTest
from ..case.curve import CURVE, completed
from ..case.written import CASE
from ..output import say
from ..results.curves_of_tests import read_test_curve
from ..results.pictures import CURVES, draw_curves
from ..results.result_folder import ResultFolder
from .parts import (
    CITATION,
    case,
    every_figure,
    figures,
    gallery,
    lead,
    paragraph,
    table,
    title,
    verdict,
)

#: The test of shear that the case in a file is, if it is one.
ShearTestOf: TypeAlias = Callable[[Path], ShearTest | None]

#: The file of the report.
REPORT = "report.html"

# Pictures of the last state, and what each shows.
_PICTURES = {
    "refused.png": "The last good state, and where the next step was refused",
    "shear_angle.png": "Shear angle at the last load factor",
    "draped.png": "Shear angle and contact pressure on the tool",
    "fibre_strain.png": "Fibre strain at the last load factor",
    "fibre_directions.png": "Fibre directions at the last load factor",
    "animation.gif": "The shear angle as the load grows",
}


def write_report(folder: Path, test_curve: Path | None, shear_test: ShearTestOf) -> int:
    """Write ``report.html`` into the folder of a run; returns the exit code.

    The page holds all its pictures and refers to nothing else.  The curves are drawn
    anew.

    Parameters
    ----------
    folder
        Results of a run.
    test_curve
        The curve of a test, in place of the one that the case names.
    shear_test
        The test of shear that the case in a file is, if it is one.

    Raises
    ------
    ValueError
        If the folder has no results, or a file of them is damaged.
    OSError
        If a file cannot be read, or the report not be written.
    """
    summary = _summary(folder)
    text = _text(folder / CASE)
    test = test_curve or _named_test(folder, text)
    drawn, why_not = _drawn_curves(folder, test, shear_test)
    pictures = {
        title: (folder / name).read_bytes()
        for name, title in _PICTURES.items()
        if (folder / name).is_file()
    }
    nothing = "The run has drawn no pictures: pip install 'skfem-textile[plot]'."
    page = Template(
        files(__package__).joinpath("page.html").read_text(encoding="utf-8")
    ).substitute(
        title=title(summary),
        lead=lead(summary),
        verdict=verdict(summary),
        figures=figures(summary),
        curves=gallery(drawn) if drawn else paragraph(why_not),
        pictures=gallery(pictures) if pictures else paragraph(nothing),
        case=case(text),
        every=every_figure(summary),
        versions=table(summary.get("versions", {})),
        citation=CITATION,
    )
    with ResultFolder(folder, (REPORT,)) as scratch:
        (scratch / REPORT).write_text(page, encoding="utf-8")
    say(f"report in {printable(folder / REPORT)}")
    return 0


def _summary(folder: Path) -> dict[str, Any]:
    """What ``summary.json`` says."""
    file = folder / "summary.json"
    if not file.is_file():
        raise ValueError(f"{printable(folder)} holds no results, no {file.name}")
    try:
        summary = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        summary = None
    if not isinstance(summary, dict):
        raise ValueError(f"{printable(file)} is damaged: it is no summary of a run")
    return summary


def _text(file: Path) -> str | None:
    """The text of a file; None if it is not there."""
    if not file.is_file():
        return None
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{printable(file)} is damaged: no text in UTF-8") from None


def _named_test(folder: Path, text: str | None) -> Path | None:
    """The curve of a test that a case names."""
    try:
        output = tomllib.loads(text or "").get("output", {})
        named = output.get("test_curve")
    except (ValueError, AttributeError, RecursionError):
        damaged = f"{printable(folder / CASE)} is damaged: it is no case"
        raise ValueError(damaged) from None
    return folder / named if isinstance(named, str) else None


def _drawn_curves(
    folder: Path, test: Path | None, shear_test: ShearTestOf
) -> tuple[dict[str, bytes], str]:
    """Pictures of the curves by their titles, or why there are none."""
    if not (folder / CURVE).is_file():
        return {}, f"The folder holds no {CURVE}."
    run = read_test_curve(folder / CURVE)
    measured = None
    if test:
        of = shear_test(folder / CASE) if (folder / CASE).is_file() else None
        measured = completed(read_test_curve(test), of)
    with tempfile.TemporaryDirectory() as scratch:
        try:
            draw_curves(run, measured, Path(scratch))
        except ImportError:
            return {}, "Curves need matplotlib: pip install 'skfem-textile[plot]'."
        drawn = {
            title: (Path(scratch) / name).read_bytes()
            for name, (title, *_) in CURVES.items()
            if (Path(scratch) / name).is_file()
        }
    return drawn, "No force drives the run."
