"""Bias extensions and other plies on meshes along the singular fibres."""

import argparse
from collections.abc import Sequence

import numpy as np

from ..common.tables import (
    grouped,
    having,
    markdown_table,
    median,
    percent,
    thousands,
)
from ..study import Part, Row, Study
from .cases import FORMULATIONS as FORMULATIONS_ON_NETS
from .cases import STEEP, Case, chosen, convergence, shapes, specimens
from .inclusions import Inclusion, inclusions
from .irregular import (
    FORMULATIONS,
    Curved,
    Irregular,
    chosen_finest,
    curved,
    irregular_triangles,
)
from .outlines import Drawn, drawn

# Unknowns up to which a load counts as within one per cent.
_MOST = 6000


def summary(rows: list[Row]) -> str:
    """A line for each formulation and group of specimens."""
    steep = {case.case for case in specimens() if case.end_degrees > STEEP}
    groups = {
        "all": rows,
        f"fibres end above {STEEP:g}°": [r for r in rows if r["case"] in steep],
        "law with a pole": having(rows, law="locking"),
    }
    lines = [
        _line(name, group, own)
        for group, of in groups.items()
        for name, own in grouped(of, "formulation").items()
    ]
    head = [
        *("formulation", "specimens", "number", "refused", "median error", "rms"),
        *("largest", "within 1 %", "interval contains", "median half-width"),
        *("most unknowns", "longest run, s"),
    ]
    return markdown_table(head, lines)


def _line(name: str, group: str, rows: list[Row]) -> list[object]:
    known = [row for row in rows if row["error"] is not None]
    errors = np.array([abs(row["error"]) for row in known])
    half_widths = [row["half_width"] for row in known if row["half_width"]]
    contains = sum(inside_of(row) for row in known)
    return [
        *(name, group, len(rows), len(rows) - len(errors)),
        percent(float(np.median(errors)), ".2f"),
        percent(float(np.sqrt(np.mean(errors**2))), ".2f"),
        percent(float(errors.max()), ".2f"),
        int((errors < 0.01).sum()),
        f"{contains} of {len(half_widths)}",
        percent(median(half_widths), ".2f") if half_widths else "",
        max(row["unknowns"] for row in rows),
        f"{max(row['seconds'] for row in rows):.2f}",
    ]


def shape_table(rows: list[Row]) -> str:
    """A line for each ply, a column for each formulation."""
    lines = []
    for case, of in grouped(rows, "case").items():
        row = of[0]
        lines.append(
            [
                *(case, row["law"], f"{row['ratio']:.0e}", row["unknowns"]),
                f"{row['load']:.3f}",
                *(percent(one["error"]) for one in of),
                percent(row["spread"]),
                f"{row['seconds']:.2f}",
            ]
        )
    names = [formulation.title for formulation in FORMULATIONS_ON_NETS]
    head = ["ply", "law", "E/G", "unknowns", "load, N", *names, "spread", "seconds"]
    return markdown_table(head, lines)


def irregular_table(rows: list[Row]) -> str:
    """A line for each formulation and number of elements across."""
    lines = []
    for (formulation, across), of in grouped(rows, "formulation", "across").items():
        errors = np.array([row["error"] for row in of])
        angles = [row["angle_error"] for row in of]
        lines.append(
            [
                *(formulation, across, len(of)),
                percent(float(np.sqrt(np.mean(errors**2))), ".2f"),
                percent(float(errors[np.abs(errors).argmax()])),
                f"{median(angles):.2f}°",
                f"{max(angles):.2f}°",
                max(row["unknowns"] for row in of),
            ]
        )
    head = [
        *("formulation", "elements across", "runs", "load error, rms over runs"),
        *("largest", "shear-angle error, rms over area: median", "largest"),
    ]
    return markdown_table([*head, "most unknowns"], lines)


def curved_table(rows: list[Row]) -> str:
    """A line for each ply, a column for each formulation."""
    lines = []
    for case, of in grouped(rows, "case").items():
        mapped = {row["formulation"]: row for row in having(of, along_edges=True)}
        first = mapped[FORMULATIONS[0].title]
        (without,) = having(of, along_edges=False)
        lines.append(
            [
                *(case.partition(": ")[2], first["unknowns"], f"{first['load']:.3f}"),
                *(percent(mapped[f.title]["error"]) for f in FORMULATIONS),
                percent(without["error"]),
                percent(first["last_change"]),
            ]
        )
    names = [formulation.title for formulation in FORMULATIONS]
    head = ["ply", "unknowns", "load, N", *names, f"{names[0]}, not `along_edges`"]
    return markdown_table([*head, "last change of the reference"], lines)


def inclusion_table(rows: list[Row]) -> str:
    """A line for each ply with an inclusion."""
    lines = [
        [
            *(row["kind"], row["unknowns"], f"{row['reference']:.3f}"),
            percent(row["error"], "+.2f"),
            f"± {percent(row['half_width'], '.2f')}",
            percent(row["spread"], "+.2f"),
        ]
        for row in rows
    ]
    head = ["inclusion", "unknowns", "load, N", "error", "interval"]
    return markdown_table([*head, "last change of the reference"], lines)


def outline_table(rows: list[Row]) -> str:
    """A line for each kind of mesh, and one for invalid outlines."""
    lines: list[list[object]] = []
    for kind, of in grouped([row for row in rows if not row["fault"]], "kind").items():
        meshes = [row for row in of if row["smallest"] is not None]
        if not meshes:
            lines.append(["no mesh", len(of), *[""] * 6])
            continue
        smallest = np.array([row["smallest"] for row in meshes])
        elsewhere = np.array([row["elsewhere"] for row in meshes])
        lines.append(
            [
                "net" if kind == "net" else f"irregular, {kind} fibres",
                len(meshes),
                _largest_area_error(having(meshes, circles=False)),
                _largest_area_error(having(meshes, circles=True)),
                sum(bool(row["missing"]) for row in meshes),
                f"{median(smallest):.1f}°",
                f"{smallest.min():.1f}°",
                f"{elsewhere.min():.1f}°",
            ]
        )
    invalid = [row for row in rows if row["fault"]]
    messages = [row["refused"] or "" for row in invalid]
    refused = sum(text.strip() != "" and "\n" not in text for text in messages)
    lines.append([f"invalid, refused: {refused}", len(invalid), *[""] * 6])
    head = [
        *("mesh", "outlines", "largest error of the area"),
        *("with circular holes", "names missing or 1 % shorter"),
        *("smallest angle, median", "least"),
        "least away from small given angles",
    ]
    return markdown_table(head, lines)


def _largest_area_error(rows: list[Row]) -> str:
    return f"{max(abs(row['area_error']) for row in rows):.0e}" if rows else ""


def inside_of(row: Row) -> bool:
    """True if the converged load is inside the interval."""
    known = row["error"] is not None and row["half_width"] is not None
    return known and abs(row["error"]) <= row["half_width"]


class SingularFibres(Study[Case | Irregular | Curved | Drawn | Inclusion]):
    """Specimens, shapes, convergence, and irregular triangles."""

    parts = (
        Part("specimens.csv", {"specimens.md": summary}, cases=("specimen *",)),
        Part(
            "convergence.csv",
            cases=("convergence*",),
        ),
        Part("shapes.csv", {"shapes.md": shape_table}, cases=("*°",)),
        Part("chosen.csv", cases=("chosen *",)),
        Part(
            "triangles.csv", {"triangles.md": irregular_table}, cases=("triangles *",)
        ),
        Part(
            "curved.csv",
            {"curved.md": curved_table},
            cases=("curved: *", "fabrics: *"),
        ),
        Part(
            "inclusions.csv",
            {"inclusions.md": inclusion_table},
            cases=("inclusion *",),
        ),
        Part("choosing_inclusions.csv", cases=("choosing *",)),
        Part("finest.csv", cases=("finest: *",)),
        Part("outlines.csv", {"outlines.md": outline_table}, cases=("outline *",)),
    )
    timed = True
    sample = "hole, 41°"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        on_nets = having(rows, formulation=FORMULATIONS_ON_NETS[0].title)
        random = [row for row in on_nets if row["case"].startswith("specimen")]
        plies = [row for row in on_nets if row["case"].endswith("°")]
        errors = [abs(row["error"]) for row in random if row["error"] is not None]
        plies += [
            row
            for row in rows
            if row["case"].startswith(("curved: ", "fabrics: "))
            and (row["formulation"], row["along_edges"])
            == (FORMULATIONS[0].title, True)
        ]
        included = [row for row in rows if row["case"].startswith("inclusion")]
        inside = [row for row in included if inside_of(row)]
        good = [r for r in plies if abs(r["error"]) < 0.01 and r["unknowns"] <= _MOST]
        return {
            "within_one": f"{sum(e < 0.01 for e in errors)} of {len(random)}",
            "rms": percent(float(np.sqrt(np.mean(np.square(errors)))), ".2f"),
            "contains": f"{sum(inside_of(row) for row in random)} of {len(random)}",
            "most_unknowns": thousands(max(row["unknowns"] for row in random)),
            "inclusions_largest": percent(
                max(abs(row["error"]) for row in included), ".2f"
            ),
            "inclusions_inside": f"{len(inside)} of {len(included)}",
            "plies_within_one": f"{len(good)} of {len(plies)}",
        }

    def cases(
        self, options: argparse.Namespace
    ) -> Sequence[Case | Irregular | Curved | Drawn | Inclusion]:
        return [
            *specimens(),
            *shapes(),
            *convergence(),
            *chosen(),
            *irregular_triangles(),
            *curved(),
            *inclusions(),
            *chosen_finest(),
            *drawn(),
        ]


STUDY = SingularFibres()
