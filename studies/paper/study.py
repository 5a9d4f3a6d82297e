"""Figs. 3 to 5 and 9 to 12 of Hamila & Boisse (2013), and the equations of §2.3.

The paper does not publish its mesh.  The irregular meshes here are from the scene
`strip` with 10×15 elements, jitter 0.3 and seed 1.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from skfem_textile.fabric import Fabric
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Kind, OnePoint
from skfem_textile.scenes import strip
from skfem_textile.solve.stepper import LoadStepper

from ..common.running import errors_only, run
from ..common.tables import markdown_table
from ..study import Part, Row, Study
from . import two_element

#: Case of the two elements of §2.3.
TWO_ELEMENTS = "two elements"

_STEPS = 40

#: Results of a strip: table heading and name in the summary.
MEASURED = {
    "strain": "max_fibre_strain",
    "mesh strain": "mesh_fibre_strain",
    "load (N)": "reaction_x",
    "position, rms over nodes (mm)": "displacement_error_rms",
    "max (mm)": "displacement_error_max",
    "angle, rms over elements (°)": "shear_angle_error_rms_deg",
}


class Strip(NamedTuple):
    """A figure of the paper: the run, and the paper's values."""

    figure: str
    mesh: str
    formulation: Full | OnePoint
    strain: str
    load: str

    def __str__(self) -> str:
        return f"Fig. {self.figure}, {self.mesh}, {self.formulation.title}"

    @property
    def is_of_rates(self) -> bool:
        """Return True for the paper's rate-form stabilisation, which has no energy."""
        return isinstance(self.formulation, OnePoint) and (
            self.formulation.kind == "rate"
        )

    def ply(self) -> Ply:
        """The unloaded ply."""
        return Ply(strip(self.mesh).mesh, Fabric(1e4), self.formulation)


def strips() -> list[Strip]:
    """The figures of the paper, the last three with both stabilisation kinds."""
    return [
        Strip("3, 5", "aligned", Full(), "< 2e-6", "almost zero"),
        Strip("4, 5", "irregular", Full(), "9.5e-3", "140 N"),
        Strip("9", "horizontal", Full(), "1.66e-6", "-"),
        Strip("10", "vertical", Full(), "locks", "-"),
        *_stabilised("energy"),
        *_stabilised("rate"),
    ]


def _stabilised(kind: Kind) -> list[Strip]:
    return [
        Strip(figure, "irregular", OnePoint(C_s, kind), strain, load)
        for figure, C_s, strain, load in (
            ("11c, 12", 10.0, "1.39e-3", "not negligible"),
            ("11a, 12", 1.0, "5.39e-4", "nearly negligible"),
            ("11b, 12", 0.01, "2.33e-5", "close to zero"),
        )
    ]


@errors_only()
def examined(case: Strip) -> Row:
    """Run a strip up to full load or failure.

    The row contains the results, the paper's values and, as ``drawn``, the data for
    figures: the load curve as displacements at the top of the right edge and forces on
    that edge, the last load factor and the last displacement.
    """
    scene, ply, outcome = strip(case.mesh), case.ply(), "stable"
    result, refused = run(LoadStepper(ply, scene.conditions, _STEPS))
    if refused:
        t = result.states[-1].load_factor
        outcome = f"no acceptable state beyond load factor {t:.3f}; results there"
    summary = scene.summary(result)
    corner = int(np.argmax(scene.mesh.p.sum(axis=0)))
    return {
        "figure": case.figure,
        "mesh": case.mesh,
        "element": case.formulation.title,
        "outcome": outcome,
        "strain, paper": case.strain,
        "load, paper": case.load,
        **{name: summary[key] for name, key in MEASURED.items()},
        "drawn": {
            "curve": (
                [float(ply.nodal(state.u)[0, corner]) for state in result.states],
                [float(scene.reaction(state)[0]) for state in result.states],
            ),
            "load_factor": result.states[-1].load_factor,
            "u": result.u.tolist(),
        },
    }


def table(rows: Sequence[Row]) -> str:
    """The strips, with a column for each entry of their rows."""
    cells = [{k: v for k, v in row.items() if k != "case"} for row in rows]
    lines = [
        [f"{x:.3g}" if isinstance(x, float) else x for x in row.values()]
        for row in cells
    ]
    return markdown_table(cells[0], lines)


def draw(rows: Sequence[tuple[Strip, Row]], folder: Path) -> None:
    """Draw the load curves and last states of strips, except rate forms."""
    from skfem_textile import plot
    from skfem_textile.plot.curves import curves

    drawn = [(case, row) for case, row in rows if not case.is_of_rates]
    panels = {
        "Fig. 5": [
            (case, row)
            for case, row in drawn
            if isinstance(case.formulation, Full)
            and case.mesh in ("aligned", "irregular")
        ],
        "Fig. 12": [pair for pair in drawn if pair[0].mesh == "irregular"],
        "Fig. 12, one point only": [
            pair for pair in drawn if isinstance(pair[0].formulation, OnePoint)
        ],
    }
    curves(
        {
            title: {
                f"{case.formulation.title}, {case.mesh}": tuple(row["curve"])
                for case, row in pairs
            }
            for title, pairs in panels.items()
        },
        "Displacement (mm)",
        "Force (N)",
        folder / "load_curves.png",
    )
    plot.contact_sheet(
        *(_last_state(case, row) for case, row in drawn),
        titles=[_caption(case, row) for case, row in drawn],
        filename=folder / "contact_sheet.png",
    )


def _last_state(case: Strip, row: Row) -> Any:
    """The data of a result that figures require."""
    u = np.array(row["u"])
    state = SimpleNamespace(u=u, load_factor=row["load_factor"])
    return SimpleNamespace(
        ply=case.ply(), u=u, states=[state], tool=lambda load_factor: None
    )


def _caption(case: Strip, row: Row) -> str:
    """The figure number, and the last load factor of a case that failed."""
    caption = f"Fig. {case.figure.partition(',')[0]}"
    if row["load_factor"] < 1:
        return f"{caption}, t = {row['load_factor']:.2f}"
    if isinstance(case.formulation, OnePoint):
        caption += f", C_s = {case.formulation.stabilisation:g} N/mm"
    return caption


class Paper(Study[Strip | str]):
    """The strips of the figures, and the two-element model."""

    parts = (
        Part("paper.csv", {"paper.md": table}, cases=("Fig. *",)),
        Part(
            "systems.json",
            cases=(TWO_ELEMENTS,),
        ),
    )
    pictures = ("contact_sheet.png", "load_curves.png")
    sample = "Fig. 4, 5, irregular, 2×2 points"
    volatile = ("drawn",)

    def cases(self, options: argparse.Namespace) -> list[Strip | str]:
        return [*strips(), TWO_ELEMENTS]

    def examine(self, case: Strip | str) -> list[Row]:
        """One row: results of a strip, or equations of the two-element model."""
        return [two_element.report() if isinstance(case, str) else examined(case)]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        if "systems" in row:
            return two_element.table(**_report(row))
        return f"{row['case']}: {row['outcome']}"

    def tables(self, rows: list[Row]) -> dict[str, str]:
        """Texts of the files, without the data for figures."""
        drawable = [{k: x for k, x in row.items() if k != "drawn"} for row in rows]
        return super().tables(drawable)

    def written(self, cases: Sequence[Strip | str]) -> list[str]:
        """Names of the files; figures are replaced only by runs of all strips."""
        complete = {*map(str, strips())} <= {*map(str, cases)}
        return [*super().written(cases), *(self.pictures if complete else ())]

    def draw(self, rows: list[Row], folder: Path) -> None:
        drawn = [row["drawn"] for row in rows if "drawn" in row]
        draw(list(zip(strips(), drawn, strict=True)), folder)


STUDY = Paper()


def _report(row: Row) -> dict[str, list[Row]]:
    return {key: row[key] for key in ("systems", "slips")}
