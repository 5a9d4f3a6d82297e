"""Inf-sup constants, kernels, and the motions of fibres that do not stretch."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from ..common.tables import csv_table
from ..study import Row, Study
from .cases import Case, all_cases
from .constants import spectrum
from .in_words import in_words
from .motions import KINKED, SMOOTH, distances, stiffness
from .tables import constants, kernels, norms, ratios, sheared, stiffnesses

#: What counts as zero must be below this share of the smallest other singular value.
CLEAR = 0.01


class InfSup(Study[Case]):
    """Every method on every layout of fibres, flat and sheared."""

    files = (
        "inf_sup.csv",
        "constants.md",
        "in_l2.md",
        "kernels.md",
        "distances.md",
        "stiffness.md",
        "sheared.md",
        "norms.md",
    )
    pictures = ("inf_sup.png",)
    sample = "macro-elements, triangles, 0°, irregular, 8 across, refined 2"
    volatile = ("largest_zero",)  # round-off

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return list(all_cases())

    def name(self, case: Case) -> str:
        state = f", sheared {case.shear}°" if case.shear else ""
        return (
            f"{case.method.name}, {case.layout.name}{state}, {case.across} across, "
            f"refined {case.refined}"
        )

    def examine(self, case: Case) -> list[Row]:
        """Singular values, kernel and distances; of flat plies the stiffness too."""
        asked = case.constraints()
        found = spectrum(asked, case.refined)
        row: Row = {
            "method": case.method.name,
            "layout": case.layout.name,
            "shear": case.shear,
            "refined": case.refined,
            "across": case.across,
            "unknowns": asked.basis.N,
            "constraints": asked.matrix.shape[0],
            "rank": len(found.values),
            "kernel": found.kernel.shape[1],
            "inf_sup": found.inf_sup,
            "inf_sup_in_l2": found.in_l2,
            "largest": float(found.values[-1]),
            "largest_zero": found.largest_zero,
        }
        for kind, profiles in (("smooth", SMOOTH), ("kinked", KINKED)):
            from_mesh, from_kernel = distances(asked, found.kernel, profiles)
            row[f"{kind}_from_mesh"] = from_mesh
            row[f"{kind}_from_kernel"] = from_kernel
            if not case.shear:
                row[f"{kind}_stiffness"] = stiffness(asked, profiles)
        return [row]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        state = f", sheared {row['shear']}°" if row["shear"] else ""
        return (
            f"{row['method']}, {row['layout']}{state}, {row['across']} across: "
            f"inf-sup {row['inf_sup']:.4f}, kernel {row['kernel']}"
        )

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {
            "inf_sup.csv": csv_table(rows),
            "constants.md": constants(rows, "inf_sup"),
            "in_l2.md": constants(rows, "inf_sup_in_l2"),
            "kernels.md": kernels(rows),
            "distances.md": ratios(rows),
            "stiffness.md": stiffnesses(rows),
            "sheared.md": sheared(rows),
            "norms.md": norms(rows),
        }

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        """Rows in which what counts as zero is not far below every other value."""
        doubtful = [r for r in rows if r["largest_zero"] > CLEAR * r["inf_sup"]]
        if not doubtful:
            return ""
        return (
            f"{len(doubtful)} case(s) have no clear smallest singular value, first: "
            f"{self.line(doubtful[:1])}"
        )

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import draw_constants

        draw_constants(rows, folder / "inf_sup.png")


STUDY = InfSup()
