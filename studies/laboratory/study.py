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

#: Largest error of a parameter of a joint fit, and smallest share of predictions whose
#: whole curve is inside the band: the lower limit of 95 % for 100 seeds.
WITHIN, PREDICTED = 0.02, 0.89

#: Relative rounding error of equal bands.
ROUNDING = 1e-3

# Kinds of tests, as columns of the joint fits; and loads with which predictions are
# compared.
_KINDS = "strip", "picture frame", "bias extension", "biaxial", "cantilever"
_TRUTHS = {"converged": "converged", "same_mesh": "on the mesh of the prediction"}

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
                percent(float(np.median([row["width"] for row in read])), ".1f"),
                percent(float(np.median([row["error"] for row in read])), ".1f"),
            ]
        )
    head = ["files", "group", "number", "refused", "misread", "inside"]
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


def joint(rows: list[Row]) -> str:
    """Errors and half-widths of the parameters of joint fits, over the seeds."""
    lines = []
    for parameter, own in grouped(_joint(rows), "parameter").items():
        errors = np.abs([row["error"] for row in own])
        lines.append(
            [
                parameter,
                percent(float(np.median(errors)), ".2f"),
                percent(float(errors.max()), ".2f"),
                *(_half_width(own, kind) for kind in ("joint", *_KINDS)),
            ]
        )
    head = ["parameter", "median error", "largest error", "band, joint", *_KINDS]
    return markdown_table(head, lines) if lines else ""


def _half_width(rows: Sequence[Row], kind: str) -> str:
    """Median half-width of a band; empty if the test does not determine it."""
    found = [row[kind] for row in rows if _known(row, kind)]
    return f"±{percent(float(np.median(found)), '.2f')}" if found else ""


def held_out(rows: list[Row]) -> str:
    """Predictions of the held-out test."""
    lines = []
    for full in (False, True):
        own = [row for row in _held_out(rows) if _known(row, "band_apart") == full]
        for name, of in _TRUTHS.items() if own else ():
            lines.append(
                [
                    "of the fitted laws" if full else "shared",
                    *(of, len(own), sum(bool(row[f"{name}_inside"]) for row in own)),
                    percent(float(np.mean([r[f"{name}_share"] for r in own])), ".1f"),
                    percent(float(np.median([r[f"{name}_error"] for r in own])), ".1f"),
                ]
            )
    head = ["simulations", "load of the known fabric", "seeds", "whole curve inside"]
    head += ["points inside", "largest error, median"]
    return markdown_table(head, lines) if lines else ""


def repeats(rows: list[Row]) -> str:
    """Time and error of fits to ten repeats."""
    lines = [
        [
            row["known"],
            row["chosen"]
            if row["fitted"] == row["chosen"]
            else f"{row['fitted']}: {row['chosen']}",
            percent(row["noise"], ".0f"),
            "simulation" if row["simulated"] else "closed forms",
            f"{row['seconds']:.1f}",
            percent(row["error"], ".1f"),
        ]
        for row in _repeats(rows)
    ]
    head = ["known law", "fitted law", "noise", "by", "s", "largest error"]
    return markdown_table(head, lines) if lines else ""


def missed(rows: Sequence[Row]) -> list[str]:
    """Missed targets."""
    texts = _missed_jointly(rows)
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


def _missed_jointly(rows: Sequence[Row]) -> list[str]:
    """Missed targets of joint fits and predictions."""
    texts = []
    for row in _joint(rows):
        what = f"seed {row['seed']}, {row['parameter']}"
        if not abs(row["error"]) <= WITHIN:
            texts.append(f"{what}: error of {percent(row['error'], '.1f')}")
        alone = sum(_known(row, kind) for kind in _KINDS)
        if row["joint"] > _narrowest(row):
            texts.append(f"{what}: the joint band is wider than by one test")
        elif alone > 1 and not row["joint"] < _narrowest(row) / (1 + ROUNDING):
            texts.append(f"{what}: the joint band is not narrower")
    seeds = _of_seeds(rows)
    for name in _TRUTHS if seeds else ():
        inside = sum(bool(row[f"{name}_inside"]) for row in seeds)
        if inside < PREDICTED * len(seeds):
            texts.append(f"held out, {name}: {inside} of {len(seeds)} inside")
    return texts


def _narrowest(row: Row) -> float:
    """Narrowest band by one kind of test, with its rounding error."""
    return min(row[kind] for kind in _KINDS if _known(row, kind)) * (1 + ROUNDING)


def _repeats(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row.get("fitted")]


def _joint(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row.get("parameter")]


def _held_out(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if _known(row, "converged_share")]


def _of_seeds(rows: Sequence[Row]) -> list[Row]:
    """Held-out predictions with shared simulations, one for each seed."""
    return [row for row in _held_out(rows) if not _known(row, "band_apart")]


def _known(row: Row, key: str) -> bool:
    """True if a row has a value; cells of a file may be empty."""
    return row.get(key) not in (None, "")


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
        Part("joint.csv", {"joint.md": joint}, cases=("joint:*",)),
        Part("held_out.csv", {"held_out.md": held_out}, cases=("held out:*",)),
        Part("repeats.csv", {"repeats.md": repeats}, cases=("repeats:*",)),
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
        if _joint(rows):
            most = max(abs(row["error"]) for row in rows)
            return f"{rows[0]['case']}: errors up to {percent(most, '.2f')}"
        if _held_out(rows):
            inside = sum(row["converged_inside"] for row in rows)
            return f"{rows[0]['case']}: {inside} of {len(rows)} inside"
        (row,) = rows
        if _repeats(rows):
            return f"{row['case']}: {row['seconds']:.1f} s"
        text = row.get("refused") or row.get("message")
        if not text:
            within = sum(row[f"inside_{angle}"] for angle in ANGLES)
            text = f"{within} of {len(ANGLES)} angles within the band"
        return f"{row['case']}: {text}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        found = {}
        if errors := [abs(row["error"]) for row in _joint(rows)]:
            found["joint"] = percent(max(errors), ".1f")
        if seeds := _of_seeds(rows):
            found["held_out"] = f"{sum(r['converged_inside'] for r in seeds)}"
            found["same_mesh"] = f"{sum(r['same_mesh_inside'] for r in seeds)}"
        return found

    def complaint(self, rows: list[Row]) -> str:
        texts = missed(rows)
        return f"{len(texts)} target(s) missed, first: {texts[0]}" if texts else ""


STUDY = Laboratory()
