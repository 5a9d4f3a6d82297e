"""Calibration of laws to synthetic data and to benchmark data.

``--benchmark DIR`` reads a copy of the folder ``test_data`` of the repository
guzmalalo/bias_test, with the curves of Cao et al. (2008).
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ...common.tables import (
    Column,
    cell,
    grouped,
    having,
    markdown_table,
    percent,
    percent_of,
    table,
)
from ...study import Part, Row, Study
from .cases import ANGLES, PUBLISHED, Agreement, Case, all_cases, example

#: Accepted coverage of the bands, and largest width over the Cramér–Rao bound.
INSIDE, WIDTH = (0.930, 0.970), 1.5

#: Largest relative differences of loads and moments, by task and column: inverse fits,
#: two tests of one fabric, round trip from data to law to simulation, benchmark.
MOST = {
    ("inverse", "off_over_largest"): 0.02,
    ("agreement", "apart"): 0.02,
    ("round trip", "off"): 0.03,
    ("benchmark", "off"): 0.05,
}


_COLUMNS: Mapping[str, Mapping[str, Column]] = {
    "coverage": {
        "test": "{test}",
        "law": "{law}",
        "parameter": "{parameter}",
        "seeds": "{seeds}",
        "inside its band": percent_of("inside", ".1f"),
        "width over Cramér–Rao": "{width_over_cramer_rao:.3f}",
    },
    "agreement": {
        "angle, deg": "{angle}",
        "C of the frame": "{frame:.5f}",
        "C of the bias extension": "{bias:.5f}",
        "difference": percent_of("apart"),
        "frame, error": percent_of("frame_off"),
    },
    "benchmark": {
        "specimen, mm": "{specimen}",
        "angle, deg": "{angle}",
        "C, N·mm/mm²": "{moment:.4f}",
        "expected": "{expected:.4f}",
        "difference": percent_of("off"),
    },
}


def of_task(rows: Sequence[Row], task: str) -> str:
    """The table of a task: bands, two tests of one fabric, benchmark."""
    return table(having(rows, task=task), _COLUMNS[task])


def inverse(rows: Sequence[Row]) -> str:
    """Largest magnitudes over the seeds of inverse fits, by element edges across."""
    columns = {
        "stabilisation": "stabilisation",
        "load error / largest load": "off_over_largest",
        "relative load error past 10°": "off_past_10",
        **{f"C at {angle}°": f"moment_{angle}" for angle in ANGLES},
    }
    lines = [
        [
            across,
            *(percent(max(abs(x[k]) for x in own), ".2f") for k in columns.values()),
        ]
        for across, own in grouped(having(rows, task="inverse"), "across").items()
    ]
    return markdown_table(["across", *columns], lines)


def round_trip(rows: Sequence[Row]) -> str:
    """Errors of simulated loads against the data."""
    lines = [
        [
            *(f"{degrees:g}°", *(percent(row["off"]) for row in own)),
            *(own[0]["unknowns"], own[0]["refused"] or "-"),
        ]
        for degrees, own in grouped(having(rows, task="round trip"), "degrees").items()
    ]
    head = ["fibres", *(f"load at {angle}°" for angle in ANGLES)]
    return markdown_table([*head, "unknowns", "message of the stepper"], lines)


def laboratories(rows: Sequence[Row]) -> str:
    """Normalised shear force by fits, and its published ranges."""
    lines = [
        [f"fit to {specimen}", *map(_with_band, own)]
        for specimen, own in grouped(rows, "specimen").items()
    ]
    lines += [
        [what, *(f"{low:.3f} to {high:.3f}" for low, high in ranges)]
        for what, ranges in PUBLISHED.items()
    ]
    head = ["normalised shear force, N/mm", *(f"at {angle}°" for angle in ANGLES)]
    return markdown_table(head, lines)


def _with_band(row: Row) -> str:
    return f"{row['shear_force']:.3f} ± {row['half_width']:.3f}"


def missed(rows: Sequence[Row]) -> list[str]:
    """Missed targets."""
    texts = []
    for row in having(rows, task="coverage"):
        what = f"{row['test']}, {row['law']}, {row['parameter']}"
        if not INSIDE[0] <= row["inside"] <= INSIDE[1]:
            texts.append(f"{what}: inside in {percent(row['inside'], '.1f')}")
        if not row["width_over_cramer_rao"] <= WIDTH:
            texts.append(f"{what}: too wide")
    for (task, key), most in MOST.items():
        errors = [row[key] for row in having(rows, task=task)]
        if errors and not np.abs(errors).max() <= most:
            texts.append(f"{task}: error of {100 * np.abs(errors).max():.1f} %")
    return texts


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Coverage, widths and largest errors of the tables."""
    bands = having(rows, task="coverage")
    inside = [100 * row["inside"] for row in bands]
    widest = max(row["width_over_cramer_rao"] for row in bands)
    words = {
        "inside": f"{min(inside):.1f} to {max(inside):.1f} %",
        "wider": percent(widest - 1, ".1f"),
    }
    for task, key in (("inverse", "off_over_largest"), ("benchmark", "off")):
        most = max(abs(row[key]) for row in having(rows, task=task))
        words[task] = percent(most, ".1f")
    return words


def draw_fit(rows: Sequence[Row], file: Path) -> None:
    """Draw a fit to three specimens."""
    from skfem_textile.calibration.figure import draw

    draw(example(), file)


def draw_forces(rows: Sequence[Row], file: Path) -> None:
    """Draw the forces of this fit."""
    from skfem_textile.calibration.figure import law_panels, save_panels

    save_panels([*law_panels(example(), "shear").values()][:1], file)


class Calibration(Study[Case]):
    """Confidence bands, inverse fits, agreement of tests, round trips."""

    parts = (
        Part(
            "calibration.csv",
            {
                "inverse.md": inverse,
                "agreement.md": lambda rows: of_task(rows, "agreement"),
                "round_trip.md": round_trip,
            },
            {"fit.png": draw_fit, "forces.png": draw_forces},
            ("coverage:*", "inverse:*", "agreement", "round trip:*"),
        ),
        Part(
            "benchmark.csv",
            {
                "benchmark.md": lambda rows: of_task(rows, "benchmark"),
                "laboratories.md": laboratories,
            },
            cases=("benchmark:*",),
        ),
    )
    sample = str(Agreement())

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--benchmark",
            type=Path,
            metavar="DIR",
            help="folder of the benchmark curves glass_plain_115_230.csv and "
            "glass_plain_150_450.csv",
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return all_cases(options.benchmark)

    def line(self, rows: list[Row]) -> str:
        columns = _COLUMNS.get(rows[0]["task"], {"load": percent_of("off")})
        texts = (
            ", ".join(f"{head} {cell(row, column)}" for head, column in columns.items())
            for row in rows
        )
        return f"{rows[0]['case']}: {'; '.join(texts)}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)

    def complaint(self, rows: list[Row]) -> str:
        texts = missed(rows)
        return f"{len(texts)} target(s) missed, first: {texts[0]}" if texts else ""


STUDY = Calibration()
