"""Results of the stability study: counts by family, and what was refused or wrong."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .outcomes import MISSED, OTHER, OUTCOMES, REFUSED, RIGHT, WRONG

# Titles of the columns of the outcomes.
_TITLES = (
    *("right", "on another equilibrium, reported", "refused"),
    *("refused though solvable", "wrong"),
)

# Names of the outcomes in `in_words`.
_NAMES = "right", "other", "refused", "missed", "wrong"


def markdown(rows: list[Row], steps: Sequence[int]) -> str:
    """A line for each family, and one for each problem that was refused or wrong.

    Parameters
    ----------
    rows
        The runs.
    steps
        The numbers of load steps that problems were run in.
    """
    return f"{_counts(rows)}\n{_failures(rows, steps)}"


def in_words(rows: list[Row]) -> dict[str, str]:
    """Counts of the outcomes, and how far off the right and the other ones are."""
    by = {
        name: [row for row in rows if row["outcome"] == outcome]
        for name, outcome in zip(_NAMES, OUTCOMES, strict=True)
    }
    resolved = [row for row in by["right"] if row["path_resolved"]]
    own = [row for row in by["right"] if row["corners_energy"]]
    problems = {(row["family"], row["problem"]) for row in rows}
    several = {
        (row["family"], row["problem"])
        for row in by["other"]
        if row["family"].startswith("laws")
    }
    laws = {problem for problem in problems if problem[0].startswith("laws")}
    return {
        **{name: str(len(group)) for name, group in by.items()},
        "cases": str(len(rows)),
        "problems": str(len(problems)),
        "solvable": str(sum(row["solvable"] for row in rows)),
        "other_off": _per_cent(map(_off, by["other"])),
        "other_in_laws": str(sum(r["family"].startswith("laws") for r in by["other"])),
        "right_resolved": str(len(resolved)),
        "right_resolved_off": _per_cent(map(_off, resolved)),
        "right_unresolved": str(len(by["right"]) - len(resolved)),
        "law_problems_with_several": f"{len(several)} of {len(laws)}",
        "refused_problems": str(len({row["problem"] for row in by["refused"]})),
        "corners": str(len(own)),
        "corners_share": _per_cent(r["corners_energy"] / r["energy"] for r in own),
        "right_min_det_F": f"{min(row['min_det_F'] for row in by['right']):.2g}",
        "solves_1_step": _median_solves(rows, 1),
        "solves_20_steps": _median_solves(rows, 20),
    }


def _off(row: Row) -> float:
    found = row["energy_off"], row["reactions_off"]
    return float(max((x for x in found if x is not None), default=0.0))


def _per_cent(shares: Iterable[float]) -> str:
    """The largest share, in per cent with two digits."""
    largest = float(f"{100 * max(shares, default=0.0):.2g}")
    return f"{largest:g} %"


def _counts(rows: list[Row]) -> str:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(_family(row), []).append(row)
    lines = []
    for family, group in (groups | {"all": rows}).items():
        n = Counter(row["outcome"] for row in group)
        right = [row for row in group if row["outcome"] == RIGHT]
        counts = [len(group), *(n[kind] for kind in OUTCOMES)]
        counts.append(sum(not row["path_resolved"] for row in right))
        solves = [_median_solves(group, steps) for steps in (1, 20)]
        lines.append([family, *counts, *solves])
    columns = "cases", *_TITLES, "right, path not resolved"
    return markdown_table(["family", *columns, "solves, 1 step", "20 steps"], lines)


def _failures(rows: list[Row], steps: Sequence[int]) -> str:
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        if row["outcome"] in (REFUSED, MISSED, WRONG):
            ended = row["family"], row["kind"], row["outcome"]
            groups.setdefault(ended, []).append(row)
    lines = []
    for (family, kind, outcome), group in groups.items():
        run_in = {row["steps"] for row in group}
        reached = [row["load_factor"] for row in group]
        *_, message = group[-1]["message"].partition("; try")[0].split(": ", 2)
        lines.append(
            [
                f"{family}, {kind}{_seeds(group)}",
                outcome,
                ", ".join(str(n) for n in steps if n in run_in),
                f"{min(reached):.3f} to {max(reached):.3f}",
                message or "-",
            ]
        )
    head = ["problem", "outcome", "in steps", "up to load factor", "because"]
    return markdown_table(head, lines)


def _family(row: Row) -> str:
    """The family, with the kind if problems differ only in the seed."""
    family: str = row["family"]
    return family if row["seed"] is None else f"{family}: {row['kind']}"


def _seeds(rows: list[Row]) -> str:
    seeds = dict.fromkeys(row["seed"] for row in rows if row["seed"] is not None)
    return f", seeds {', '.join(map(str, seeds))}" if seeds else ""


def _median_solves(rows: Iterable[Row], steps: int) -> str:
    solves = [
        row["linear_solves"]
        for row in rows
        if row["steps"] == steps and row["outcome"] in (RIGHT, OTHER)
    ]
    return f"{np.median(solves):g}" if solves else "-"
