"""Tables of the study of error against time: how many times faster each method is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .timed_codes import ThisLibrary


@dataclass(frozen=True)
class Bar:
    """A condition that a result must fulfil."""

    text: str
    reached: Callable[[Row], bool]


BARS = {
    "strip": Bar(
        "shear angle within 0.1° rms and load under 1 N",
        lambda row: row["angle"] <= 0.1 and row["load_error"] < 1,
    ),
    "bias_extension": Bar(
        "load within 3 % of the exact one", lambda row: row["load_error"] <= 0.03
    ),
}

#: The kinds of errors, and their labels.
ERRORS = {
    "position": "Position error (mm)",
    "angle": "Shear-angle error (°)",
    "strain": "Largest fibre strain",
    "load_error": "Load error (N, or share)",
}

Key = tuple[str, str]


def of(rows: Sequence[Row]) -> dict[Key, list[Row]]:
    """Results by code and element, from coarse to fine, without refused runs."""
    by: dict[Key, list[Row]] = {}
    for row in rows:
        if "seconds" in row:
            results = by.setdefault((row["code"], row["element"]), [])
            results += [] if np.isnan(row["seconds"]) else [row]
    return by


def fastest(rows: Sequence[Row], bar: Bar) -> Row | None:
    """The fastest run that reaches a bar, as do all runs on finer meshes.

    Parameters
    ----------
    rows
        Results of one method, from coarse to fine.
    bar
        The bar.
    """
    there: list[Row] = []
    for row in reversed(rows):
        if not bar.reached(row):
            break
        there.append(row)
    return min(there, key=lambda row: row["seconds"], default=None)


def standing(rows: Sequence[Row]) -> list[tuple[Key, Row | None]]:
    """Each method with its fastest run that reaches the bar; fastest method first."""
    bar = BARS[rows[0]["scene"]]
    methods = [(key, fastest(meshes, bar)) for key, meshes in of(rows).items()]
    return sorted(methods, key=lambda pair: pair[1]["seconds"] if pair[1] else np.inf)


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """The bar, the fastest method, and how many times longer the others take.

    None for a method that does not reach the bar.
    """
    order = standing(rows)
    best = order[0][1] if order else None
    return {
        "scene": rows[0]["scene"],
        "bar": BARS[rows[0]["scene"]].text,
        "fastest": _name(order[0][0]) if best else None,
        "methods": {
            _name(key): {
                "across": row["across"],
                **({"tolerance": row["tolerance"]} if "tolerance" in row else {}),
                "seconds": row["seconds"],
                "over_fastest": row["seconds"] / best["seconds"],
            }
            if row and best
            else None
            for key, row in order
        },
        "skipped": {_of(row): row["note"] for row in rows if "seconds" not in row},
        "refused": [
            f"{_of(row)}, {mesh_of(row)}: {row['note']}"
            for row in rows
            if "seconds" in row and row["note"]
        ],
    }


def tables(rows: Sequence[Row]) -> str:
    """All tables, and what was skipped or refused, in Markdown."""
    told = summary(rows)
    notes = [f"{name}: {why}" for name, why in told["skipped"].items()]
    notes += told["refused"]
    listed = "".join(f"- {note}\n" for note in notes)
    return "\n".join(x for x in (to_the_bar(rows), same_mesh(rows), listed) if x)


def to_the_bar(rows: Sequence[Row]) -> str:
    """The fastest run of each method that reaches the bar, or else its finest run."""
    order = standing(rows)
    best = order[0][1] if order else None
    own = next((row for method, row in order if row and _is_own(method)), None)
    by, lines = of(rows), []
    for method, row in order:
        if not by[method]:
            continue
        shown = row or by[method][-1]
        lines.append(
            [
                *(_bold(method), _across(shown), str(shown["unknowns"])),
                *(f"{shown['steps']} / {shown['linear_solves']}", _seconds(shown)),
                *(_ratio(row, best), _ratio(row, own)),
                *(f"{shown[key]:.2g}" for key in ("angle", "load_error")),
                *(f"{shown['position']:.2g}", f"{shown['strain']:.1e}"),
            ]
        )
    head = [
        *(f"to {BARS[rows[0]['scene']].text}", "across", "unknowns"),
        *("steps / solves", "time (s)", "over the fastest", "over the fastest of ours"),
        *("shear angle off by (°)", "load off by", "position off by (mm)", "strain"),
    ]
    return markdown_table(head, lines)


def same_mesh(rows: Sequence[Row]) -> str:
    """Other codes on the same element and mesh: their times over this library's."""
    by = of(rows)
    lines = []
    for (code, element), meshes in by.items():
        if code != ThisLibrary.code:
            continue
        rivals = {k[0]: v for k, v in by.items() if k[1] == element and k[0] != code}
        for rival, theirs in rivals.items():
            ours = {row["across"]: row for row in meshes}
            both = [row for row in theirs if row["across"] in ours]
            for row in both[-1:]:
                own = ours[row["across"]]
                lines.append(
                    [
                        *(element, rival, str(row["across"])),
                        *(f"{own['steps']} / {own['linear_solves']}", _seconds(own)),
                        *(f"{row['steps']} / {row['linear_solves']}", _seconds(row)),
                        _ratio(row, own),
                    ]
                )
    head = [
        *("same element and mesh", "rival", "across"),
        *("ours: steps / solves", "ours: time (s)"),
        *("rival's: steps / solves", "rival's: time (s)", "rival over ours"),
    ]
    return markdown_table(head, lines) if lines else ""


def curves(rows: Sequence[Row]) -> dict[str, dict[Key, tuple[list, list]]]:
    """Errors over seconds for the figure, by kind of error, code and element."""
    return {
        label: {
            key: ([row["seconds"] for row in meshes], [row[error] for row in meshes])
            for key, meshes in of(rows).items()
            if meshes
        }
        for error, label in ERRORS.items()
    }


def mesh_of(row: Row) -> str:
    """What a mesh is called, by its edges across and the tolerance it is refined to."""
    refined = f", refined to {row['tolerance']:g}" if "tolerance" in row else ""
    return f"{row['across']} across{refined}"


def _across(row: Row) -> str:
    return mesh_of(row).replace(" across", "")


def _is_own(key: Key) -> bool:
    return key[0] == ThisLibrary.code


def _name(key: Key) -> str:
    return ", ".join(key)


def _of(row: Row) -> str:
    return _name((row["code"], row["element"]))


def _bold(key: Key) -> str:
    return f"**{key[1]}**" if _is_own(key) else _name(key)


def _seconds(row: Row) -> str:
    return (
        f"{row['seconds']:.3g} ({row['seconds_min']:.3g} to {row['seconds_max']:.3g})"
    )


def _ratio(row: Row | None, other: Row | None) -> str:
    return f"{row['seconds'] / other['seconds']:.2g}" if row and other else "-"
