"""Tables of the documentation."""

from collections.abc import Iterable, Sequence

import numpy as np

from ...common.tables import markdown_table
from ...study import Row
from .cases import ANGLES

#: Share of parameters that ought to lie in their bands.
CONFIDENCE = 0.95

#: Share of parameters inside their bands, and width of these over the least possible.
INSIDE, WIDTH = (0.930, 0.970), 1.5

#: Most by which loads and moments may differ, as a share: inverse fits and the two
#: tests of one fabric; the way from data to law to simulation; the benchmark.
CLOSE, ROUND, PRINTED = 0.02, 0.03, 0.05


def of(rows: Sequence[Row], task: str) -> list[Row]:
    """The rows of a task."""
    return [row for row in rows if row["task"] == task]


def coverage(rows: Sequence[Row]) -> str:
    """How often parameters are inside their bands, and how wide these are."""
    lines = [
        [
            row["test"],
            row["law"],
            row["parameter"],
            row["seeds"],
            f"{100 * row['inside']:.1f} %",
            f"{row['width_over_cramer_rao']:.3f}",
        ]
        for row in of(rows, "coverage")
    ]
    head = ["test", "law", "parameter", "seeds", "inside its band"]
    return markdown_table([*head, "width over Cramér–Rao"], lines)


def inverse(rows: Sequence[Row]) -> str:
    """Loads and moments of inverse fits, seed by seed."""
    lines = [
        [
            row["across"],
            row["seed"],
            f"{100 * row['stabilisation']:.0f} %",
            f"{100 * row['off_over_largest']:.2f} %",
            f"{100 * row['off_past_10']:.2f} %",
            *(_percent(row[f"moment_{angle}"]) for angle in ANGLES),
        ]
        for row in of(rows, "inverse")
    ]
    head = ["across", "seed", "stabilisation", "load, of the largest"]
    head += ["load past 10°, of itself", *(f"C at {angle}°" for angle in ANGLES)]
    return markdown_table(head, lines)


def agreement(rows: Sequence[Row]) -> str:
    """C of both tests."""
    lines = [
        [
            row["angle"],
            f"{row['frame']:.5f}",
            f"{row['bias']:.5f}",
            _percent(row["apart"]),
            _percent(row["frame_off"]),
        ]
        for row in of(rows, "agreement")
    ]
    head = ["angle, deg", "C of the frame", "C of the bias extension", "apart"]
    return markdown_table([*head, "frame off the known law"], lines)


def round_trip(rows: Sequence[Row]) -> str:
    """Simulated loads beside those of the data."""
    lines = []
    found = of(rows, "round trip")
    for degrees in dict.fromkeys(row["degrees"] for row in found):
        own = [row for row in found if row["degrees"] == degrees]
        lines.append(
            [
                f"{degrees:g}°",
                *(_percent(row["off"]) for row in own),
                own[0]["unknowns"],
                own[0]["refused"] or "-",
            ]
        )
    head = ["fibres", *(f"load at {angle}°" for angle in ANGLES)]
    return markdown_table([*head, "unknowns", "the stepper says"], lines)


def benchmark(rows: Sequence[Row]) -> str:
    """C of the benchmark's curves."""
    lines = [
        [
            row["specimen"],
            row["angle"],
            f"{row['moment']:.4f}",
            f"{row['expected']:.4f}",
            _percent(row["off"]),
        ]
        for row in of(rows, "benchmark")
    ]
    head = ["specimen, mm", "angle, deg", "C, N·mm/mm²", "expected", "apart"]
    return markdown_table(head, lines)


def missed(rows: Sequence[Row]) -> list[str]:
    """What is not as it should be."""
    found = []
    for row in of(rows, "coverage"):
        what = f"{row['test']}, {row['law']}, {row['parameter']}"
        if not INSIDE[0] <= row["inside"] <= INSIDE[1]:
            found.append(f"{what}: inside in {100 * row['inside']:.1f} %")
        if not row["width_over_cramer_rao"] <= WIDTH:
            found.append(f"{what}: too wide")
    for task, key, most in (
        ("inverse", "off_over_largest", CLOSE),
        ("agreement", "apart", CLOSE),
        ("round trip", "off", ROUND),
        ("benchmark", "off", PRINTED),
    ):
        own = [row[key] for row in of(rows, task)]
        if own and not np.abs(own).max() <= most:
            found.append(f"{task}: off by {100 * np.abs(own).max():.1f} %")
    return found


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Ranges of what the tables show, and the scatter of a share of the seeds."""
    bands = of(rows, "coverage")
    widest = max(row["width_over_cramer_rao"] for row in bands)
    chance = np.sqrt(CONFIDENCE * (1 - CONFIDENCE) / bands[0]["seeds"])
    return {
        "inside": _range(row["inside"] for row in bands),
        "wider": f"{100 * (widest - 1):.1f} %",
        "chance": f"{100 * chance:.1f} %",
        "inverse": _largest(of(rows, "inverse"), "off_over_largest"),
        "benchmark": _largest(of(rows, "benchmark"), "off"),
    }


def _range(shares: Iterable[float]) -> str:
    """The smallest and the largest share in per cent.

    Examples
    --------
    >>> _range([0.02, 0.011, 0.013])
    '1.1 to 2.0 %'
    """
    found = list(shares)
    return f"{100 * min(found):.1f} to {100 * max(found):.1f} %"


def _largest(rows: Iterable[Row], column: str) -> str:
    """The largest size of a share in per cent.

    Examples
    --------
    >>> _largest([{"off": -0.0282}, {"off": 0.01}], "off")
    '2.8 %'
    """
    return f"{100 * max(abs(row[column]) for row in rows):.1f} %"


def _percent(share: float) -> str:
    return f"{100 * share:+.2f} %"
