"""Tables of extreme drapes."""

from collections import Counter
from collections.abc import Sequence

from ....common.tables import markdown_table
from ....study import Row
from .judging import REFUSED, RIGHT, TOLD, WRONG

_WORDS = {
    RIGHT: "right",
    TOLD: "off, and told so",
    REFUSED: "refused",
    WRONG: "wrong",
}


def outcomes(rows: Sequence[Row]) -> str:
    """How many drapes of each group end how."""
    groups = list(dict.fromkeys(row["group"] for row in rows))
    head = (
        *("what is extreme", "drapes", *_WORDS.values(), "right, but not compared"),
        *("largest off the net in °", "off the finer mesh in °"),
    )
    lines = []
    for group in (*groups, ""):
        own = [row for row in rows if group in ("", row["group"])]
        count = Counter(row["outcome"] for row in own)
        alone = sum(
            row["outcome"] == RIGHT and not {"off_net", "off_finer"} & {*row}
            for row in own
        )
        off = [
            max((row[name] for row in own if row.get(name) is not None), default=None)
            for name in ("off_net", "off_finer")
        ]
        angles = ["–" if angle is None else f"{angle:.1f}" for angle in off]
        counts = len(own), *(count[outcome] for outcome in _WORDS), alone
        lines.append([group or "all", *counts, *angles])
    return markdown_table(head, lines)


def told_or_refused(rows: Sequence[Row]) -> str:
    """The drapes that are not right, and why."""
    lines = [
        [row["case"].partition(", ")[2], _WORDS[row["outcome"]], _reason(row)]
        for row in rows
        if row["outcome"] != RIGHT
    ]
    return markdown_table(("drape", "outcome", "why"), lines)


def _reason(row: Row) -> str:
    told = f" (told by: {row['told']})" if row.get("told") else ""
    return row["reason"] + told
