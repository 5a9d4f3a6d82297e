"""Tables of the study."""

from collections.abc import Callable, Sequence
from dataclasses import fields

from ...common.tables import markdown_table
from ...study import Row
from .cases import NET, PUBLISHED, ROLLED, SPHERE, Case

_DEFAULTS = {
    field.name: field.default
    for field in fields(Case)
    if field.name not in ("kind", "parts", "formulation")
}


def _of(rows: Sequence[Row], kind: str, ordinary: bool | None = None) -> list[Row]:
    """Rows of a kind: all, or those with or without settings of their own."""
    return [
        row
        for row in rows
        if row["kind"] == kind and (ordinary is None or ordinary == (_own(row) == []))
    ]


def _own(row: Row) -> list[str]:
    """What a case has for itself, in words."""
    words: dict[str, Callable] = {
        "stretch": lambda x: f"E = {x:g} N/mm",
        "tension": lambda x: "edges free of load" if not x else f"q = {x:g} N/mm",
        "distortion": lambda x: f"nodes moved by {100 * x:g} %",
        "surface": lambda x: "sphere of 5000 triangles" if x == "triangles" else x,
        "start": lambda x: f"start from a {x}",
    }
    return [say(row[k]) for k, say in words.items() if row[k] != _DEFAULTS[k]]


def refinement(rows: Sequence[Row]) -> str:
    """Error, solves and time of the Chebyshev net on regular meshes."""
    head = (
        *("formulation", "parts a side", "unknowns", "largest error of Γ in °"),
        *(
            "root mean square in °",
            "solves",
            "seconds of processor",
            "pressure off by at most",
        ),
    )
    lines = [
        [
            *(row["formulation"], row["parts"], row["unknowns"]),
            *(f"{row['largest']:.4f}", f"{row['rms']:.4f}", row["solves"]),
            *(f"{row['seconds']:.1f}", f"{row['pressure_error']:.2%}"),
        ]
        for row in _of(rows, SPHERE, ordinary=True)
        if not row["refused"]
    ]
    return markdown_table(head, lines)


def other_drapes(rows: Sequence[Row]) -> str:
    """The same with moved nodes, other stiffness, starts, surfaces, and free edges."""
    head = (
        *(
            "formulation",
            "parts a side",
            "what is different",
            "largest error of Γ in °",
        ),
        *("solves", "fibre strain", "elements at risk of wrinkles", "stable"),
    )
    lines = []
    for row in _of(rows, SPHERE, ordinary=False):
        line = [row["formulation"], row["parts"], ", ".join(_own(row))]
        if row["refused"]:
            line += ["refused", *4 * ["–"]]
        else:
            line += [f"{row['largest']:.3f}", row["solves"]]
            line += [f"{row['fibre_strain']:.1e}", f"{row['at_risk']:.0%}"]
            line += ["yes" if row["stable"] else "no"]
        lines.append(line)
    return markdown_table(head, lines)


def nets(rows: Sequence[Row]) -> str:
    """Error of kinematic nets."""
    head = (
        "cells a side",
        "largest error of Γ in °",
        "root mean square in °",
        "seconds",
    )
    lines = [
        [
            *(row["parts"], f"{row['largest']:.5f}", f"{row['rms']:.5f}"),
            f"{row['seconds']:.1f}",
        ]
        for row in _of(rows, NET)
    ]
    return markdown_table(head, lines)


def published_nets(rows: Sequence[Row]) -> str:
    """Differences of nets against those by a published method."""
    head = (
        *("draping", "cells", "largest shear angle in °"),
        *("largest difference in °", "mean difference in °"),
    )
    lines = [
        [
            *(row["surface"], row["cells"], f"{row['largest_shear']:.1f}"),
            *(f"{row['largest']:.3f}", f"{row['mean']:.4f}"),
        ]
        for row in _of(rows, PUBLISHED)
    ]
    return markdown_table(head, lines)


def rolled(rows: Sequence[Row]) -> str:
    """Shear on developable surfaces, which ought to be none."""
    head = (
        *("surface", "formulation", "parts a side", "largest shear angle in °"),
        *("pressure off by at most", "solves"),
    )
    lines = [
        [
            *(row["surface"], row["formulation"], row["parts"]),
            *(f"{row['largest']:.1e}", f"{row['pressure_error']:.2%}", row["solves"]),
        ]
        for row in _of(rows, ROLLED)
        if not row["refused"]
    ]
    return markdown_table(head, lines)
