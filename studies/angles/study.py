"""The bias extension with fibres at 30° to 60°: how far the load is off.

``--part references`` computes converged loads on meshes along the fibres, which are
stored.  The other parts compare the default formulation on irregular meshes with them.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from skfem_textile.solve.result import StepError

from ..common.log import errors_only, warnings_collected
from ..common.tables import csv_table
from ..study import Row, Study
from . import references
from .cases import (
    CHOOSING,
    JUDGING,
    SPECIMENS,
    Case,
    Judged,
    Reference,
    Specimen,
    judged,
)
from .runs import loads_over_inextensible, stepper
from .tables import agreements, are_references, in_words, split, summary

_OF_REFERENCES = "references.json", "references.md"


class Angles(Study[Case]):
    """References, or the default formulation beside them."""

    files = (*_OF_REFERENCES, "angles.csv", "summary.md")
    pictures = ("angles.png",)
    sample = "45°, linear, E/G = 2e5, quads, 16 across, seed 1"

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--part",
            choices=("judging", "choosing", "references"),
            default="judging",
            help="the cases that judge the default formulation (the default), those by "
            "which its constants are chosen, or the converged loads",
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        if options.part == "references":
            return [Reference(specimen) for specimen in SPECIMENS]
        references.stored()  # refuses a missing file before any work
        return list(judged(*(JUDGING if options.part == "judging" else CHOOSING)))

    def name(self, case: Case) -> str:
        return case.name

    def examine(self, case: Case) -> list[Row]:
        """A row for each shear angle; loads that a run does not reach are nan."""
        if isinstance(case, Judged):
            return _judged(case)
        with errors_only():
            return references.computed(case)

    def line(self, rows: list[Row]) -> str:
        name = Specimen.of(rows[0]).name
        if are_references(rows):
            found = ", ".join(f"{row['load']:.4f}" for row in rows)
            apart, halving = (
                max(abs(r[k]) for r in rows) for k in ("apart", "halving")
            )
            shares = f"apart {100 * apart:.2f} %, last halving {100 * halving:.2f} %"
            return f"{name}: {found}; {shares}"
        row = rows[-1]
        found = ", ".join(f"{r['load_over_reference']:.4f}" for r in rows)
        end = row["refused"] or f"{row['seconds']:.1f} s"
        mesh = f"{row['elements']}, {row['across']} across, seed {row['seed']}"
        return f"{name}, {mesh}: {found}; {end}"

    def tables(self, rows: list[Row]) -> dict[str, str]:
        converged, compared = split(rows)
        texts = {}
        if converged:
            texts["references.json"] = references.text(converged)
            texts["references.md"] = agreements(converged)
        if compared:
            texts["angles.csv"] = csv_table(compared)
            texts["summary.md"] = summary(compared)
        return texts

    def stored(self, folder: Path) -> list[Row]:
        """Rows of the references and of the cases that are judged."""
        data = folder / "references.json"
        text = data.read_text(encoding="utf-8") if data.is_file() else "[]"
        return [*json.loads(text), *super().stored(folder)]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        """References on which formulations or meshes do not agree."""
        if not are_references(rows):
            return ""
        doubtful = [row for row in rows if not references.agree(row)]
        if not doubtful:
            return ""
        first = self.line(doubtful[:1])
        return f"{len(doubtful)} load(s) are not converged, first: {first}"

    def written(self, cases: Sequence[Case]) -> list[str]:
        """Files of the references, or those of the cases that are judged."""
        if isinstance(cases[0], Reference):
            return [*_OF_REFERENCES]
        return [n for n in (*self.files, *self.pictures) if n not in _OF_REFERENCES]

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import draw_loads

        draw_loads(split(rows)[1], folder / "angles.png")


STUDY = Angles()


def _judged(case: Judged) -> list[Row]:
    specimen, refused = case.specimen, ""
    scene = specimen.scene(case.mesh())
    with warnings_collected() as warnings:
        try:
            result = stepper(scene, specimen, case.formulation).run()
        except StepError as error:
            result, refused = error.result, str(error)
    rows = []
    for angle, load in loads_over_inextensible(scene, specimen, result).items():
        reference = references.stored()[specimen, angle]["load"]
        rows.append(
            {
                **specimen.row,
                "elements": case.elements,
                "across": case.across,
                "seed": case.seed,
                "shear_angle": angle,
                "load": load,
                "load_over_reference": load / reference,
                "unknowns": result.ply.basis.N,
                "linear_solves": result.linear_solves,
                "seconds": result.wall_time_s,
                "warnings": " | ".join(warnings),
                "refused": refused,
            }
        )
    return rows
