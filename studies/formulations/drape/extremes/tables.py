"""Tables of extreme drapes."""

from collections import Counter
from collections.abc import Sequence

from ....common.tables import markdown_table
from ....study import Row
from .judging import REFUSED, RIGHT, TOLD, WRONG

_WORDS = {
    RIGHT: "right",
    TOLD: "off, and reported",
    REFUSED: "refused",
    WRONG: "wrong",
}


def outcomes(rows: Sequence[Row]) -> str:
    """How many drapes of each group end how."""
    groups = list(dict.fromkeys(row["group"] for row in rows))
    head = (
        *("what is extreme", "drapes", *_WORDS.values(), "right, but not compared"),
        *("largest difference from the net in °", "from the finer mesh in °"),
    )
    lines = []
    for group in (*groups, ""):
        own = [row for row in rows if group in ("", row["group"])]
        count = Counter(row["outcome"] for row in own)
        alone = sum(
            row["outcome"] == RIGHT
            and row.get("off_net") is None
            and row.get("off_finer") is None
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
    told = f" (reported: {row['told']})" if row.get("told") else ""
    return row["reason"] + told


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """How many drapes there are, how they end, and how many right ones warn.

    Examples
    --------
    >>> rows = [{"outcome": "right", "told": told} for told in ("wrinkles", None)]
    >>> words = in_words([*rows, {"outcome": "refused", "told": None}])
    >>> words["extremes"], words["extremes_right"], words["extremes_right_reported"]
    ('3', '2', '1 of 2')
    """
    count = Counter(row["outcome"] for row in rows)
    told = sum(row["outcome"] == RIGHT and bool(row["told"]) for row in rows)
    names = {RIGHT: "right", TOLD: "reported", REFUSED: "refused", WRONG: "wrong"}
    return {
        "extremes": str(len(rows)),
        **{f"extremes_{name}": str(count[kind]) for kind, name in names.items()},
        "extremes_right_reported": f"{told} of {count[RIGHT]}",
    }
