"""The estimated error against references, and refinement against uniform meshes."""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from skfem_textile.solve.error_estimate import LOAD_OVER_SHARE, SHEAR_ANGLE_OVER_CHANGE

from ..common.figures import File, figure_of, legend, style_of
from ..common.tables import having, markdown_table, percent, span, table
from ..study import Part, Row, Study
from .cases import KINKS, TOLERANCE, Case, all_cases

#: Errors below this are small: an estimate is to stay below `_LEAST_LARGE` there.
SMALL, _LEAST_LARGE = 0.005, 0.02

#: Least and largest estimate over error that pass.
PASSES = 0.5, 3.0

#: What meshes of the comparison at equal unknowns are called.
MESHES = {
    "refined": "refined at kinks",
    "known": "refined at the exact kinks",
    "along": "along fibres, quadratic",
}

_POSITIONS = "position_error", "over_area"

# Ends of the axes of load errors in per cent, and of position errors in mm.
_ENDS, _POSITION_ENDS = (0.03, 30.0), (0.004, 1.0)


def estimates(rows: Sequence[Row]) -> str:
    """Ratios of estimate and error, of the cases that calibrate and that judge."""
    lines = []
    for task in ("calibrates", "judges"):
        if found := having(rows, task=task):
            costs = [row["cost"] for row in found]
            cost = f"{np.median(costs):.0%}, {np.max(costs):.0%}"
            lines.append([task, *_passed(found), cost])
    head = [
        "cases",
        f"estimate over error from {PASSES[0]:g} to {PASSES[1]:g}",
        f"error at most {SMALL:.1%}, estimate below {_LEAST_LARGE:.0%}",
        "share of the run, median and most",
    ]
    return markdown_table(head, lines)


def _passed(rows: Sequence[Row]) -> tuple[str, str]:
    """How many estimates of large errors and of small errors pass."""
    large = [row for row in rows if abs(row["error"]) > SMALL]
    small = [row for row in rows if abs(row["error"]) <= SMALL]
    ratios = [(row["estimate"] or 0.0) / abs(row["error"]) for row in large]
    passed = sum(PASSES[0] <= ratio <= PASSES[1] for ratio in ratios)
    below = sum((row["estimate"] or np.inf) < _LEAST_LARGE for row in small)
    return f"{passed} of {len(large)}", f"{below} of {len(small)}"


def factor(rows: Sequence[Row]) -> str:
    """Error over what tells of it in the cases that calibrate, and what is taken."""
    found = [row for row in having(rows, task="calibrates") if row["estimate"]]
    large = [row for row in found if abs(row["error"]) > SMALL]
    load = [abs(r["error"]) / r["carried"] for r in large]
    taken = SHEAR_ANGLE_OVER_CHANGE
    angle = [taken * r["angle_error"] / r["angle_estimate"] for r in found]
    lines = [
        [name, f"{np.median(x):.2f}", span(x, ".2f"), f"{now:g}"]
        for name, x, now in (
            ("load over the share of the energy", load, LOAD_OVER_SHARE),
            ("shear angle over its change", angle, taken),
        )
        if x
    ]
    return markdown_table(["error", "median", "range", "taken"], lines)


def tolerances(rows: Sequence[Row]) -> str:
    """Runs to a tolerance against the reference."""
    return table(
        having(rows, task="tolerance"),
        {
            "case": lambda row: row["case"].removeprefix("tolerance, "),
            "unknowns": "{unknowns}",
            "error": "{error:.2%}",
            "estimate": "{estimate:.2%}",
            "reported as met": lambda row: "yes" if row["met"] else "no",
        },
    )


def kinks(rows: Sequence[Row]) -> str:
    """Position errors over those of uniform meshes, interpolated at equal unknowns."""
    lines, found = [], having(rows, task="kinks")
    for row in (row for row in found if row["mesh"] != "uniform"):
        line = [f"{row['degrees']:g}°", MESHES[row["mesh"]], row["unknowns"]]
        for key in _POSITIONS:
            at = _uniform(found, row, key)
            line += [f"{row[key]:.4f}", f"{at:.4f}", f"{row[key] / at:.2f}"]
        lines.append(line)
    head = ["fibres", "mesh", "unknowns"]
    for what in ("nodes", "area"):
        head += [f"{name}, {what}" for name in ("error (mm)", "uniform (mm)", "ratio")]
    return markdown_table(head, lines)


def _uniform(rows: Sequence[Row], row: Row, key: str) -> float:
    """The error of uniform meshes with as many unknowns as a row has."""
    uniform = having(rows, degrees=row["degrees"], mesh="uniform")
    sizes = np.log([other["unknowns"] for other in uniform])
    errors = np.log([other[key] for other in uniform])
    return float(np.exp(np.interp(np.log(row["unknowns"]), sizes, errors)))


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results that pages say, by name."""
    runs, found = having(rows, task="tolerance"), having(rows, task="kinks")
    within = [row for row in runs if abs(row["error"]) <= TOLERANCE]
    met = [row for row in runs if row["met"]]
    right = [row for row in met if row in within]
    words = {
        "estimates": _passed(having(rows, task="judges"))[0],
        "within": f"{len(within)} of {len(runs)}",
        "met": f"{len(met)} of {len(runs)}",
        "right": f"{len(right)} of {len(met)}",
        "met_worst": percent(max(abs(row["error"]) for row in met), ".2f"),
    }
    for mesh in MESHES:
        ratios = [
            row[key] / _uniform(found, row, key)
            for row in having(found, mesh=mesh)
            for key in _POSITIONS
        ]
        words[mesh] = span(ratios, ".2f")
    return words


def draw_errors(rows: Sequence[Row], file: File = None) -> Any:
    """Estimated against true errors of loads, and position errors by unknowns."""
    with figure_of((8.0, 6.6), file, 9) as figure:
        load, *positions = figure.subplots(2, 2).flat
        _draw_loads(load, having(rows, task="judges"))
        kinds = {"uniform": "uniform"} | MESHES
        styles = {
            label: style_of(i, markersize=4, linewidth=1.0)
            for i, label in enumerate(kinds.values())
        }
        for axes, degrees in zip(positions, KINKS, strict=True):
            for mesh, label in kinds.items():
                own = having(rows, degrees=degrees, mesh=mesh)
                errors = [row["position_error"] for row in own]
                axes.loglog([row["unknowns"] for row in own], errors, **styles[label])
            axes.set(title=f"Position, {degrees:g}°", xlabel="Unknowns")
            axes.set(ylim=_POSITION_ENDS, ylabel="Error, rms over nodes (mm)")
        legend(figure, styles, len(styles))
    return figure


def _draw_loads(axes: Any, rows: Sequence[Row]) -> None:
    ends = np.array(_ENDS)
    least, most = PASSES
    axes.fill_between(ends, least * ends, most * ends, color="0.9")
    axes.plot(ends, ends, color="grey", linewidth=0.8)
    axes.axvline(100 * SMALL, color="grey", linewidth=0.8, linestyle=":")
    known = [row for row in rows if row["estimate"] is not None]
    errors = [100 * abs(row["error"]) for row in known]
    axes.plot(errors, [100 * row["estimate"] for row in known], "o", markersize=3)
    axes.set(title="Load", xlabel="True error (%)", ylabel="Estimated error (%)")
    axes.set(xscale="log", yscale="log", xlim=_ENDS, ylim=_ENDS)


class Adaptive(Study[Case]):
    """Estimates, tolerances, and position errors at equal unknowns."""

    parts = (
        Part(
            "adaptive.csv",
            {
                "estimates.md": estimates,
                "factor.md": factor,
                "tolerances.md": tolerances,
                "kinks.md": kinks,
            },
            {"adaptive.png": draw_errors},
        ),
    )
    sample = "judges, 45°, sheared 20°, E 100000, irregular 8"
    volatile = (*Study.volatile, "cost")

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return list(all_cases())

    def line(self, rows: list[Row]) -> str:
        row = rows[-1]
        if row["task"] == "kinks":
            return f"{row['case']}: {row['position_error']:.4f} mm"
        estimate = row["estimate"]
        said = "none" if estimate is None else f"{estimate:.4f}"
        return f"{row['case']}: error {row['error']:.4f}, estimate {said}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)


STUDY = Adaptive()
