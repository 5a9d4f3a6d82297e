"""Rows of the study by case and quantity."""

from collections.abc import Iterable, Mapping

from ..study import Row
from .documented import Results


def by_case(rows: Iterable[Row]) -> Mapping[str, Results]:
    """The results of each case."""
    found: dict[str, dict[str, float]] = {}
    for row in rows:
        found.setdefault(row["case"], {})[row["quantity"]] = row["value"]
    return found
