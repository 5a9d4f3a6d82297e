"""Tables of the stability study: counts by family, and what was refused or wrong."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from ..common.tables import markdown_table
from ..study import Row
from .outcomes import MISSED, OTHER, OUTCOMES, REFUSED, RIGHT, WRONG

#: How many of each kind a cell of the figure stands for, and its text.
Cell: TypeAlias = tuple[Mapping[str, int], str]

# Titles of the columns of the outcomes.
_TITLES = "right", "another", "refused", "though solvable", "wrong"


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


def _counts(rows: list[Row]) -> str:
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(_family(row), []).append(row)
    lines = []
    for family, group in (groups | {"all": rows}).items():
        n = Counter(row["outcome"] for row in group)
        agreeing = [row for row in group if row["agrees"]]
        counts = [len(group), *(n[kind] for kind in OUTCOMES), len(agreeing)]
        counts.append(sum(not row["path_resolved"] for row in agreeing))
        solves = [_median_solves(group, steps) for steps in (1, 20)]
        lines.append([family, *counts, *solves])
    columns = "cases", *_TITLES, "as 400 steps", "of these not resolved"
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


def picture_lines(
    rows: list[Row], steps: Sequence[int]
) -> dict[str, dict[str, list[Cell]]]:
    """Lines of the figure, by family and kind, with a cell for each number of steps.

    Problems that differ only in their seed share a line, with the shares of the
    outcomes and the number of right ones.
    """
    groups: dict[str, dict[str, dict[int, list[Row]]]] = {}
    for row in rows:
        line = groups.setdefault(row["family"], {}).setdefault(row["kind"], {})
        line.setdefault(row["steps"], []).append(row)
    return {
        family: {
            kind: [_cell(line.get(n, [])) for n in steps]
            for kind, line in kinds.items()
        }
        for family, kinds in groups.items()
    }


def _cell(rows: list[Row]) -> Cell:
    """Counts of the outcomes in their order, and the text of the cell."""
    n = Counter(row["outcome"] for row in rows)
    if len(rows) > 1:
        text = f"{n[RIGHT] + n[OTHER]}/{len(rows)}"
    else:
        text = "".join(str(row["linear_solves"]) for row in rows if not row["message"])
    return {kind: n[kind] for kind in OUTCOMES if n[kind]}, text
