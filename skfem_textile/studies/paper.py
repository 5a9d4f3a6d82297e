"""The strips of Hamila & Boisse (2013), Figs. 3 to 5 and 9 to 12, run again.

The paper's mesh is not published: the irregular meshes here are those of the scene
`strip` with 10×15 elements, jitter 0.3 and seed 1.
"""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..fabric import Fabric
from ..ply import Ply
from ..ply.formulations import Full, Kind, OnePoint
from ..scenes import Scene, strip
from ..solve.result import Result, StepError
from ..solve.stepper import LoadStepper

#: Written by `reproduce` and by `draw`.
FILES = ("paper.csv", "paper.md")
PICTURES = ("contact_sheet.png", "load_curves.png")

_STEPS = 40


class Case(NamedTuple):
    """A figure of the paper: what was run, and what the paper says of it."""

    figure: str
    mesh: str
    formulation: Full | OnePoint
    strain: str
    load: str


class Row(NamedTuple):
    """A case run again: its result, and what became of it."""

    case: Case
    scene: Scene
    result: Result
    outcome: str


def cases() -> list[Case]:
    """The figures of the paper, the last three with both kinds of stabilisation."""
    return [
        Case("3, 5", "aligned", Full(), "< 2e-6", "almost zero"),
        Case("4, 5", "irregular", Full(), "9.5e-3", "140 N"),
        Case("9", "horizontal", Full(), "1.66e-6", "-"),
        Case("10", "vertical", Full(), "locks", "-"),
        *_stabilised("energy"),
        *_stabilised("rate"),
    ]


def _stabilised(kind: Kind) -> list[Case]:
    return [
        Case(figure, "irregular", OnePoint(C_s, kind), strain, load)
        for figure, C_s, strain, load in (
            ("11c, 12", 10.0, "1.39e-3", "not negligible"),
            ("11a, 12", 1.0, "5.39e-4", "nearly negligible"),
            ("11b, 12", 0.01, "2.33e-5", "close to zero"),
        )
    ]


_RATES = [case.formulation for case in _stabilised("rate")]


def reproduce(folder: Path, progress: Callable[[str], None] = print) -> list[Row]:
    """Run every case and write the table.

    Parameters
    ----------
    folder
        Receives `FILES`.
    progress
        Told a line per case.

    Returns
    -------
    list of Row
        One per case; those that stopped early hold their last good state.
    """
    rows = []
    for case in cases():
        row = run(case)
        progress(f"Fig. {case.figure:8} {case.mesh:11} {_title(row):24} {row.outcome}")
        rows.append(row)
    table = [numbers(row) for row in rows]
    with open(folder / "paper.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=list(table[0]))
        writer.writeheader()
        writer.writerows(table)
    (folder / "paper.md").write_text(markdown(table))
    return rows


def run(case: Case) -> Row:
    """One case, as far as it goes."""
    scene = strip(case.mesh)
    ply = Ply(scene.mesh, Fabric(1e4), case.formulation)
    try:
        result = LoadStepper(ply, scene.conditions, _STEPS).run()
    except StepError as error:
        t = error.result.states[-1].load_factor
        outcome = f"no acceptable state beyond load factor {t:.3f}; figures at that"
        return Row(case, scene, error.result, outcome)
    return Row(case, scene, result, "stable")


def numbers(row: Row) -> dict[str, Any]:
    """The numbers of a row beside the paper's."""
    summary = row.scene.summary(row.result)
    return {
        "figure": row.case.figure,
        "mesh": row.case.mesh,
        "element": _title(row),
        "outcome": row.outcome,
        "strain, paper": row.case.strain,
        "load, paper": row.case.load,
        "strain": summary["max_fibre_strain"],
        "mesh strain": summary["mesh_fibre_strain"],
        "load (N)": summary["reaction_x"],
        "position, rms (mm)": summary["displacement_error_rms"],
        "max (mm)": summary["displacement_error_max"],
        "angle, rms (°)": summary["shear_angle_error_rms_deg"],
    }


def markdown(table: list[dict[str, Any]]) -> str:
    """The table in Markdown."""
    lines = [list(table[0]), ["---"] * len(table[0])]
    lines += [
        [f"{x:.3g}" if isinstance(x, float) else str(x) for x in row.values()]
        for row in table
    ]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _title(row: Row) -> str:
    return row.case.formulation.title


def draw(rows: list[Row], folder: Path) -> None:
    """Draw `PICTURES`, with the stabilisation of kind ``energy``."""
    from .. import plot
    from ..plot.curves import curves

    rows = [row for row in rows if row.case.formulation not in _RATES]
    full = [row for row in rows if isinstance(row.case.formulation, Full)]
    one_point = [row for row in rows if isinstance(row.case.formulation, OnePoint)]
    irregular = [row for row in rows if row.case.mesh == "irregular"]
    panels = {
        "Fig. 5": [row for row in full if row.case.mesh in ("aligned", "irregular")],
        "Fig. 12": irregular,
        "Fig. 12, one point only": one_point,
    }
    curves(
        {title: {_label(r): _load(r) for r in some} for title, some in panels.items()},
        "Displacement along x at the top (mm)",
        "Force on the right edge along x (N)",
        folder / "load_curves.png",
    )
    plot.contact_sheet(
        *(row.result for row in rows),
        titles=[_caption(row) for row in rows],
        filename=folder / "contact_sheet.png",
    )


def _caption(row: Row) -> str:
    """The figure's number, and how far the case came if it stopped early."""
    caption = f"Fig. {row.case.figure.partition(',')[0]}"
    if not row.result.converged:
        return f"{caption}, t = {row.result.states[-1].load_factor:.2f}"
    if isinstance(row.case.formulation, OnePoint):
        caption += f", Cs = {row.case.formulation.stabilisation:g}"
    return caption


def _label(row: Row) -> str:
    return f"{_title(row)}, {row.case.mesh}"


def _load(row: Row) -> tuple[list[float], list[float]]:
    """Displacement at the top of the right edge, and force on that edge."""
    corner = int(np.argmax(row.scene.mesh.p.sum(axis=0)))
    states, ply = row.result.states, row.result.ply
    return (
        [float(ply.nodal(state.u)[0, corner]) for state in states],
        [float(row.scene.reaction(state)[0]) for state in states],
    )
