"""Raw files of testing machines, read, prepared and fitted.

``--seed N`` draws other files.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from ..common.tables import grouped, having, markdown_table, percent
from ..study import Part, Row, Study
from .cases import ANGLES, GROUPS, Case, File, all_cases

#: Accepted share of files whose law is within its band.
INSIDE = (0.91, 0.98)

# Groups whose share is a target.
_TARGETS = ("clean", "contaminated")

# Smallest number of files whose share is compared with the target: its standard error
# is then 2 %.
_ENOUGH = 100

# Seed of the published results.
_SEED = 1


def inside(rows: Sequence[Row]) -> float:
    """Share of the angles and files at which the law is within its band."""
    read = [row for row in rows if not row.get("refused")]
    return float(np.mean([[row[f"inside_{a}"] for a in ANGLES] for row in read]))


def coverage(rows: list[Row]) -> str:
    """Files by group: read as written, and law within its band."""
    lines = []
    for (judged, group), own in grouped(_files(rows), "judged", "group").items():
        read = [row for row in own if not row.get("refused")]
        lines.append(
            [
                "judged" if judged else "chosen",
                *(group, len(own), len(own) - len(read)),
                sum(bool(row["misread"]) for row in read),
                percent(inside(own), ".1f"),
                *(
                    percent(float(np.mean([r[f"inside_{a}"] for r in read])), ".1f")
                    for a in ANGLES
                ),
                percent(float(np.median([row["width"] for row in read])), ".1f"),
                percent(float(np.median([row["error"] for row in read])), ".1f"),
            ]
        )
    head = ["files", "group", "number", "refused", "misread", "inside"]
    head += [f"at {angle}°" for angle in ANGLES]
    return markdown_table([*head, "width of the band", "error"], lines)


def machines(rows: list[Row]) -> str:
    """Judged files by machine."""
    lines = []
    for machine, own in grouped(having(_files(rows), judged=True), "machine").items():
        read = [row for row in own if not row.get("refused")]
        wrong = sum(bool(row["misread"]) for row in read)
        separators = len({row["separator"] for row in own})
        units = len({(row["force_unit"], row["length_unit"]) for row in own})
        lines.append(
            [machine, len(own), separators, units, len(own) - len(read), wrong]
        )
    head = ["machine", "files", "separators", "pairs of units", "refused", "misread"]
    return markdown_table(head, lines)


def doubtful(rows: list[Row]) -> str:
    """Files that allow two readings, with the message of one of them."""
    lines = [
        [what, len(own), sum(bool(row["as_needed"]) for row in own), own[0]["message"]]
        for what, own in grouped([r for r in rows if r.get("what")], "what").items()
    ]
    head = ["content", "files", "refused with the option", "message"]
    return markdown_table(head, lines) if lines else ""


def missed(rows: Sequence[Row]) -> list[str]:
    """Missed targets."""
    texts = []
    judged = having(_files(rows), judged=True)
    for group in _TARGETS:
        own = having(judged, group=group)
        enough = len(own) >= _ENOUGH
        if enough and not INSIDE[0] <= (share := inside(own)) <= INSIDE[1]:
            texts.append(f"{group}: inside in {percent(share, '.1f')}")
    for row in judged:
        if row.get("misread"):
            texts.append(f"{row['case']}: misread")
        if row.get("refused"):
            texts.append(f"{row['case']}: refused: {row['refused']}")
    for row in rows:
        if row.get("what") and not row["as_needed"]:
            texts.append(f"{row['case']}: not refused with its option")
    return texts


def _files(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row.get("group") in GROUPS]


class Laboratory(Study[Case]):
    """Raw files of known laws."""

    parts = (
        Part(
            "files.csv",
            {"coverage.md": coverage, "machines.md": machines},
            cases=("judged:*", "chosen:*"),
        ),
        Part("doubtful.csv", {"doubtful.md": doubtful}, cases=("doubtful:*",)),
    )
    sample = str(File(_SEED, "contaminated"))

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        parser.add_argument(
            "--seed",
            type=int,
            default=_SEED,
            metavar="N",
            help="number of the first judged file (default: %(default)s)",
        )

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return all_cases(getattr(options, "seed", _SEED))

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        text = row.get("refused") or row.get("message")
        if not text:
            within = sum(row[f"inside_{angle}"] for angle in ANGLES)
            text = f"{within} of {len(ANGLES)} angles within the band"
        return f"{row['case']}: {text}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        judged = having(_files(rows), judged=True)
        found = {"files": str(len(judged))}
        for group in GROUPS:
            share = inside(having(judged, group=group))
            found[group.replace(" ", "_")] = percent(share, ".1f")
        return found

    def complaint(self, rows: list[Row]) -> str:
        texts = missed(rows)
        return f"{len(texts)} target(s) missed, first: {texts[0]}" if texts else ""


STUDY = Laboratory()
