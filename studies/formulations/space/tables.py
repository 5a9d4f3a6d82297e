"""Tables of the study of a ply in space."""

from collections.abc import Sequence

import numpy as np

from skfem_textile.scenes.elastica import hanging, peirce

from ...common.tables import markdown_table
from ...study import Row

# Weights w L³/D of hanging strips; 8 is that of the usual angle of the chord.
_WEIGHTS, _USUAL = (1, 2, 4, 8, 20, 80), 8

#: An answer that is off by more than this share is wrong.
WRONG = 0.02


def _of(rows: Sequence[Row], part: str) -> list[Row]:
    return [row for row in rows if row["part"] == part]


def _share(x: float | None) -> str:
    return "-" if x is None else f"{x:+.1e}"


def cantilevers(rows: Sequence[Row]) -> str:
    """Errors of the tip over the length."""
    head = ["formulation", "load", "edges", "x, of L", "z, of L", "steps", "solves"]
    lines = [
        [
            *(row["formulation"], row["load"], row["n"]),
            *(_share(row.get("off_x")), _share(row.get("off_z"))),
            *(row.get("load_steps") or "-", row.get("linear_solves") or "-"),
        ]
        for row in _of(rows, "cantilever")
    ]
    return markdown_table(head, lines)


def plates(rows: Sequence[Row]) -> str:
    """Largest error of the deflection over the largest deflection."""
    found = _of(rows, "plate")
    edges = list(dict.fromkeys(row["n"] for row in found))
    kinds = dict.fromkeys(
        (row["formulation"], row["degrees"], row["jitter"]) for row in found
    )
    lines = []
    for formulation, degrees, jitter in kinds:
        by_edges = {
            row["n"]: f"{row['off_z']:.1e}"
            for row in found
            if (row["formulation"], row["degrees"], row["jitter"])
            == (formulation, degrees, jitter)
        }
        mesh = "moved by 20 %" if jitter else "regular"
        errors = [by_edges.get(n, "-") for n in edges]
        lines.append([formulation, f"{degrees}°", mesh, *errors])
    return markdown_table(
        ["elements", "fibres at", "nodes", *(f"{n} edges" for n in edges)], lines
    )


def buckling(rows: Sequence[Row]) -> str:
    """Errors of critical tensions."""
    found = _of(rows, "buckling")
    edges = sorted({row["n"] for row in found})
    head = ["buckles", "formulation", "D, N·mm", "exact, N/mm"]
    kinds = dict.fromkeys((row["where"], row["formulation"], row["D"]) for row in found)
    lines = []
    for kind in kinds:
        own = [r for r in found if (r["where"], r["formulation"], r["D"]) == kind]
        errors = {row["n"]: _share(row["off_x"]) for row in own}
        exact = f"{own[0]['exact']:.4g}"
        where, formulation, D = kind
        ends = [errors.get(n, "-") for n in edges]
        lines.append([where, formulation, f"{D:g}", exact, *ends])
    return markdown_table([*head, *(f"{n} edges" for n in edges)], lines)


def modes(rows: Sequence[Row]) -> str:
    """Zero modes of a free flat patch."""
    lines = [
        [row["formulation"], f"{row['D']:g}", row["unknowns"], row["modes"]]
        for row in _of(rows, "modes")
    ]
    head = ["formulation", "D, N·mm", "unknowns", "motions without stiffness"]
    return markdown_table(head, lines)


def wrong(rows: Sequence[Row]) -> list[Row]:
    """Runs of extreme stiffnesses that converged to an answer that is off.

    A strip that has buckled against its push is in an equilibrium to which the path
    does not lead.  It is right if the run says that its path is not resolved.
    """
    return [
        row
        for row in rows
        if row["part"].startswith("extreme")
        and row["outcome"] == "converged"
        and (_off(row) > WRONG or (row.get("mirrored") and row["path_resolved"]))
    ]


def _off(row: Row) -> float:
    return max(abs(row["off_x"]), abs(row["off_z"]))


def extremes(rows: Sequence[Row]) -> str:
    """Runs that are right, refused and wrong, by problem and E/G."""
    found = [row for row in rows if row["part"].startswith("extreme")]
    lines = []
    for part in dict.fromkeys(row["part"] for row in found):
        for stiff in dict.fromkeys(row["E_over_G"] for row in found):
            own = [r for r in found if (r["part"], r["E_over_G"]) == (part, stiff)]
            good = [row for row in own if row["outcome"] == "converged"]
            bad = len(wrong(own))
            largest = max((_off(row) for row in good), default=0.0)
            counts = len(own), len(good) - bad, len(own) - len(good), bad
            name = part.removeprefix("extreme ")
            lines.append([name, f"{stiff:.0e}", *counts, f"{100 * largest:.2f} %"])
    head = ["problem", "E/G", "runs", "right", "refused", "wrong", "largest error"]
    return markdown_table(head, lines)


def peirce_over_elastica() -> str:
    """Bending stiffness by Peirce's formula over that of the elastica."""
    lines = []
    for weight in _WEIGHTS:
        angle, ratio = _peirce(weight)
        lines.append([weight, f"{angle:.1f}", f"{ratio:.3f}"])
    head = ["w L³/D", "angle of the chord in °", "Peirce over elastica"]
    return markdown_table(head, lines)


def _peirce(weight: float) -> tuple[float, float]:
    """The angle of the chord in degrees, and Peirce's formula over the elastica."""
    angle = hanging(weight).chord_angle
    return float(np.degrees(angle)), peirce(1.0, weight, angle)


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """Largest errors of quadrilaterals, outcomes of extremes, and Peirce's formula."""
    quadrilaterals = [r for r in rows if r["formulation"] in ("one point", "macro")]
    tips = [r for r in _of(quadrilaterals, "cantilever") if r["n"] == 32]
    bent = [r for r in _of(quadrilaterals, "buckling") if r["D"]]
    soft = [
        r["off_x"]
        for r in _of(rows, "buckling")
        if not r["D"] and r["formulation"] == "macro"
    ]
    found = [row for row in rows if row["part"].startswith("extreme")]
    refused = sum(row["outcome"] != "converged" for row in found)
    bad = len(wrong(found))
    words = {
        "tip": _per_cent(max(map(_off, tips))),
        "buckling": _per_cent(max(abs(r["off_x"]) for r in bent)),
        "buckling_soft": _per_cent(-min(soft)),
        "extremes": str(len(found)),
        "right": str(len(found) - refused - bad),
        "refused": str(refused),
        "wrong": str(bad),
    }
    for name, weight in (("small", _USUAL / 2), ("usual", _USUAL)):
        angle, ratio = _peirce(weight)
        words |= {f"{name}_chord": f"{angle:.1f}°", name: _per_cent(ratio - 1)}
    return words


def _per_cent(share: float) -> str:
    return f"{100 * share:.2g} %"
