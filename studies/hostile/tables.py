"""Counts of the trials by outcome."""

from collections import Counter
from collections.abc import Mapping, Sequence

from .trial import OUTCOMES
from .workers import Tried

Counts = Mapping[str, Mapping[str, int]]


def counts_by_family(tried: Sequence[Tried]) -> Counts:
    """How often each outcome was found, by family."""
    found: dict[str, Counter[str]] = {}
    for one in tried:
        found.setdefault(one.family, Counter())[one.finding.outcome] += 1
    return {family: {o: c[o] for o in OUTCOMES} for family, c in found.items()}


def table(counts: Counts) -> str:
    """The counts as a Markdown table."""
    heads = ["family", "trials", *OUTCOMES]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for family, found in counts.items():
        cells = [family, sum(found.values()), *found.values()]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines) + "\n"
