"""The report of a run: one page in HTML."""

import json
import tempfile
import tomllib
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, TypeAlias

from .. import __version__
from ..cases.write import CASE
from ..mesh.user_input import printable
from ..scenes.shear_test import ShearTest
from .curve import CURVE, completed, read_test_curve
from .output import say
from .result_folder import ResultFolder
from .results import CURVES, draw_curves

# Figures that are shown first, and what they are called.
_FIGURES = {
    "load_factor": "Load factor reached",
    "reaction_x": "Force on the driven edge along x (N)",
    "reaction_y": "Force on the driven edge along y (N)",
    "load_over_exact": "Load over the exact load",
    "max_shear_angle_deg": "Largest shear angle (°)",
    "max_fibre_strain": "Largest fibre strain that the law sees",
    "max_fibre_tension": "Largest fibre tension (N/mm)",
    "energy": "Energy (N·mm)",
    "n_elements": "Elements",
    "n_dofs": "Unknowns",
    "load_steps": "Load steps",
    "linear_solves": "Linear solves",
    "wall_time_s": "Time of the run (s)",
}

# What is judged: its name, what holds, and what does not.
_JUDGED = {
    "converged": ("Whole load", "applied", "not applied: the run stopped early"),
    "stable": ("Equilibrium", "stable", "not stable"),
    "path_resolved": (
        "Path of the load",
        "resolved",
        "not resolved: another number of steps may lead to another equilibrium",
    ),
}

# Kinds of pictures by the first bytes of their files.
_KINDS = {b"\x89PNG": "image/png", b"GIF8": "image/gif"}

CITATION = f"""<p>skfem_textile {__version__}, BSD-3-Clause, by the skfem_textile
developers. It goes on from N. Hamila and P. Boisse, <cite>Tension locking in
finite-element analyses of textile composite reinforcement deformation</cite>, Comptes
Rendus Mécanique 341 (2013). Please cite both.</p>"""


def title(summary: Mapping[str, Any]) -> str:
    """Scene and formulation."""
    scene = printable(summary.get("scene", "run")).replace("_", " ").capitalize()
    return escape(f"{scene}, {printable(summary.get('formulation', 'unknown'))}")


def lead(summary: Mapping[str, Any]) -> str:
    """One sentence on how the run ended."""
    reached = _figure(summary.get("load_factor"))
    if summary.get("converged") is True:
        return "Every step converged, and the whole load is applied."
    return f"The run stopped at load factor {reached}. What follows is its last state."


def verdict(summary: Mapping[str, Any]) -> str:
    """What the run says of its last state."""
    rows = []
    for key, (name, good, bad) in _JUDGED.items():
        if summary.get(key) is None:
            rows.append((escape(name), "unknown"))
        else:
            rows.append((escape(name), _judged(summary[key] is True, good, bad)))
    folding = summary.get("min_det_F")
    if isinstance(folding, int | float):
        text = f"smallest det F {_figure(folding)}"
        rows.append(("Elements", _judged(folding > 0, f"none folded, {text}", text)))
    rows.append(("Estimated error of the load", escape(_estimate(summary))))
    if "exact_answer" in summary:
        rows.append(("Exact answer", _text(summary["exact_answer"])))
    return _rows(rows)


def figures(summary: Mapping[str, Any]) -> str:
    """The figures that are looked at first."""
    found = [
        (escape(name), _figure(summary[key]))
        for key, name in _FIGURES.items()
        if summary.get(key) is not None
    ]
    return _rows(found, "number")


def every_figure(summary: Mapping[str, Any]) -> str:
    """Every figure but the inputs and versions, to be unfolded."""
    rest = {k: v for k, v in summary.items() if k not in ("inputs", "versions")}
    return f"<details><summary>Show them</summary>{table(rest)}</details>"


def table(values: Any) -> str:
    """Names and values of a mapping."""
    if not isinstance(values, Mapping) or not values:
        return paragraph("The results do not tell.")
    return _rows([(_name(name), _figure(value)) for name, value in values.items()])


def case(text: str | None) -> str:
    """The case file, in a box of its own."""
    if text is None:
        return paragraph("The folder holds no case.toml.")
    return f'<div class="box" tabindex="0"><pre>{escape(text)}</pre></div>'


def gallery(pictures: Mapping[str, bytes]) -> str:
    """Pictures by their titles, held by the page itself."""
    shown = "\n".join(_shown(title, data) for title, data in pictures.items())
    return f'<div class="pictures">\n{shown}\n</div>'


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{_text(text)}</p>"


def _shown(title: str, data: bytes) -> str:
    kind = _KINDS.get(data[:4], "image/png")
    source = f"data:{kind};base64,{b64encode(data).decode()}"
    name = escape(title)
    image = f'<img src="{source}" alt="{name}">'
    return f"<figure>{image}<figcaption>{name}</figcaption></figure>"


def _estimate(summary: Mapping[str, Any]) -> str:
    error, said = summary.get("estimated_load_error"), summary.get("error_estimate", "")
    if not isinstance(error, int | float):
        return printable(said) or "none"
    return f"{100 * error:.2g} % {printable(said)}".strip()


def _judged(holds: bool, good: str, bad: str) -> str:
    mark, text = ("good", good) if holds else ("bad", bad)
    return f'<span class="{mark}">{escape(text)}</span>'


def _rows(rows: Iterable[tuple[str, str]], kind: str = "") -> str:
    """A table of two columns, of names and values that are HTML already."""
    cell = f'<td class="{kind}">' if kind else "<td>"
    body = "\n".join(f"<tr><th>{x}</th>{cell}{y}</td></tr>" for x, y in rows)
    return f'<div class="box" tabindex="0"><table>\n{body}\n</table></div>'


def _figure(value: Any) -> str:
    """A value as HTML; numbers with six digits."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return _text("" if value is None else value)


def _name(name: str) -> str:
    """A name that a narrow screen breaks after an underscore."""
    return _text(name).replace("_", "_<wbr>")


def _text(value: Any) -> str:
    return escape(printable(value))


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
    text = _text_of_file(folder / CASE)
    test = test_curve or _named_test(folder, text)
    drawn, why_not = _drawn_curves(folder, test, shear_test)
    pictures = {
        title: (folder / name).read_bytes()
        for name, title in _PICTURES.items()
        if (folder / name).is_file()
    }
    nothing = "The run has drawn no pictures: pip install 'skfem-textile[plot]'."
    page = Template(
        files(__package__).joinpath("report.html").read_text(encoding="utf-8")
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


def _text_of_file(file: Path) -> str | None:
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
