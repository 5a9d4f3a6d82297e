"""Counts of the trials by outcome."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from .trial import OUTCOMES
from .workers import Tried

#: How often each outcome was found.
Counts: TypeAlias = dict[str, int]


def counts_of(tried: Sequence[Tried]) -> Counts:
    """How often each outcome was found."""
    found = Counter(one.finding.outcome for one in tried)
    return {outcome: found[outcome] for outcome in OUTCOMES}


def table(counts: Mapping[str, Counts]) -> str:
    """The counts of each family as a Markdown table."""
    heads = ["family", "trials", *OUTCOMES]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for family, found in counts.items():
        cells = [family, sum(found.values()), *found.values()]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines) + "\n"
