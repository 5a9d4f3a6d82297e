"""Error intervals against converged loads, and runs to a tolerance."""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from skfem_textile.ply.formulations import OF_MACRO, OF_ONE_POINT, OF_QUADRATIC

from ..common.figures import File, figure_of, legend, style_of
from ..common.tables import grouped, having, markdown_table, median, percent, span
from ..study import Part, Row, Study
from .cases import CHOOSING, JUDGING, TOLERANCE, Judged, ToTolerance, judged
from .cases import to_tolerance as runs_to_tolerance

# Plates of the meshes of Gmsh, in order.
_PLATES = (
    "circular hole, pulled",
    "two holes, rollers, pulled",
    "rounded notch, force",
    "L, crimped fibres, pulled",
    "square window, rollers, force",
)

# Ends of the axes of the picture in %.
_ENDS = 1e-3, 100.0


def coverage(rows: list[Row]) -> str:
    """A line for each class, and one for all."""
    lines = [_line(kind, of) for kind, of in grouped(rows, "kind").items()]
    if len(lines) > 1:
        lines.append(_line("all", rows))
    head = [
        *("class", "converged", "interval", "inside", "half-width / error"),
        *("mean error", "largest", "cost / run", "shear angle inside"),
    ]
    return markdown_table([*head, "estimate / error"], lines)


def _line(kind: str, rows: Sequence[Row]) -> list[object]:
    converged = [row for row in rows if not row["refused"]]
    known = _with_interval(rows)
    errors = np.array([row["error"] for row in known])
    offs, halves = (np.array(x) for x in zip(*map(_off, known), strict=True))
    costs = [row["interval_seconds"] / row["run_seconds"] for row in known]
    sheared = [row for row in known if row.get("angle_error") is not None]
    angles = [row["angle_estimate"] / row["angle_error"] for row in sheared]
    return [
        *(kind, f"{len(converged)} of {len(rows)}", len(known)),
        f"{sum(offs <= halves)} ({np.mean(offs <= halves):.0%})",
        f"{median(halves / offs):.1f}",
        percent(float(errors.mean())),
        percent(float(errors[np.abs(errors).argmax()])),
        f"{median(costs):.2f}",
        f"{sum(x >= 1 for x in angles)} of {len(angles)}" if angles else "",
        f"{median(angles):.1f}" if angles else "",
    ]


def _off(row: Row) -> tuple[float, float]:
    """Error and half-width, both relative to the computed load."""
    return abs(row["load"] - row["reference"]) / abs(row["load"]), row["half_width"]


def _is_inside(row: Row) -> bool:
    off, half = _off(row)
    return off <= half


def _with_interval(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row.get("half_width") is not None]


def plates(rows: list[Row]) -> str:
    """A line for each mesh of Gmsh."""
    lines = [
        [
            *(name, row["unknowns"], f"{row['load']:.5g}"),
            f"± {row['half_width']:.2%}",
            percent(row["error"]),
            "yes" if _is_inside(row) else "no",
        ]
        for name, row in zip(
            _PLATES, _with_interval(having(rows, kind="meshes of gmsh")), strict=False
        )
    ]
    head = ["plate", "unknowns", "work of the load, N·mm", "interval", "error"]
    return markdown_table([*head, "inside"], lines)


def tolerances(rows: list[Row]) -> str:
    """Outcomes of the runs to a tolerance."""
    counted = _outcomes(rows)
    known = [row for row in rows if row.get("seconds") is not None]
    ratios = [row["seconds"] / row["fixed_seconds"] for row in known]
    meshes = [row["meshes"] for row in known]
    errors = [abs(row["error"]) for row in known if row["met"]]
    return markdown_table(
        [
            "runs",
            *counted,
            "largest error where met",
            "meshes",
            "time / last net alone",
        ],
        [
            [
                *(len(rows), *counted.values(), percent(max(errors), ".2f")),
                span(meshes, ""),
                f"{median(ratios):.1f}, at most {max(ratios):.1f}",
            ]
        ],
    )


def _outcomes(rows: Sequence[Row]) -> dict[str, int]:
    met = [row for row in rows if row.get("met")]
    right = sum(abs(row["error"]) <= TOLERANCE for row in met)
    return {
        "met and right": right,
        "met and wrong": len(met) - right,
        "refused": len(rows) - len(met),
    }


def draw(rows: Sequence[Row], file: File = None) -> Any:
    """Half-widths against errors."""
    with figure_of((4.6, 4.4), file, 8) as figure:
        axes = figure.subplots()
        axes.fill_between(_ENDS, _ENDS, _ENDS[1], color="0.93")
        styles = {}
        groups = {
            "nets, laws and holes": ("law", "fibres", "holes", "families"),
            "nets, loads and terms": ("forces", "terms"),
            "free and conforming meshes": ("free", "conforming", "gmsh", "examples"),
            "other formulations": ("other",),
        }
        known = _with_interval(rows)
        for i, (label, words) in enumerate(groups.items()):
            own = [row for row in known if any(word in row["kind"] for word in words)]
            styles[label] = style_of(i, linestyle="", markersize=3)
            errors = [max(100 * _off(row)[0], _ENDS[0]) for row in own]
            axes.plot(errors, [100 * row["half_width"] for row in own], **styles[label])
        axes.plot(_ENDS, _ENDS, color="grey", linewidth=0.8)
        axes.set(xscale="log", yscale="log", xlim=_ENDS, ylim=_ENDS)
        axes.set(xlabel="Error of the load (%)", ylabel="Half-width (%)")
        legend(figure, styles, 2)
    return figure


class Interval(Study[Judged | ToTolerance]):
    """Coverage by class, and runs to a tolerance."""

    parts = (
        Part(
            "judged.csv",
            {"coverage.md": coverage, "plates.md": plates},
            {"interval.png": draw},
            cases=("judged: *",),
        ),
        Part("chosen.csv", cases=("chosen: *",)),
        Part("tolerance.csv", {"tolerance.md": tolerances}, cases=("tolerance *",)),
    )
    timed = True
    sample = "judged: crimped fibres 1"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        own = [row for row in rows if row["case"].startswith("judged: ")]
        known, met = _with_interval(own), having(rows, met=True)
        inside = [row for row in known if _is_inside(row)]
        converged = [row for row in own if not row["refused"]]
        ratios = [half / off for off, half in map(_off, known)]
        outcomes = _outcomes([r for r in rows if r["case"].startswith("tolerance ")])
        return {
            "inside": f"{len(inside)} of {len(known)}",
            "known": f"{len(known)} of {len(converged)}",
            "ratio": f"{median(ratios):.1f}",
            "met_right": str(outcomes["met and right"]),
            "met_wrong": str(outcomes["met and wrong"]),
            "of_quadratic": f"{OF_QUADRATIC:g}",
            "of_macro": f"{OF_MACRO:g}",
            "of_one_point": f"{OF_ONE_POINT:g}",
            "met_largest": percent(max(abs(row["error"]) for row in met), ".2f"),
        }

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        text = "seed of the judged cases"
        parser.add_argument("--seed", type=int, default=JUDGING, help=text)

    def cases(self, options: argparse.Namespace) -> Sequence[Judged | ToTolerance]:
        chosen = judged(CHOOSING, "chosen: ", 1 / 3)
        drawn = [c for c in chosen if c.kind.split()[0] not in ("meshes", "examples")]
        return [*judged(options.seed, "judged: "), *drawn, *runs_to_tolerance()]


STUDY = Interval()
