"""Medians over the meshes of each code, E/G and distortion, in tables and words."""

from collections.abc import Iterable, Sequence
from statistics import median
from typing import NamedTuple, TypeAlias

from ...common.tables import markdown_table
from ...study import Row

#: Names in the column ``code``: this library, and converged loads.
OURS, REFERENCE = "this library, macro-elements", "converged"

#: Share of the converged load by which a load may differ and be right.
LIMIT = 0.05

#: Outcomes of a cell: within `LIMIT` of the converged load, not within it, and without
#: a stable, unfolded equilibrium on most of its meshes.
RIGHT, OFF, NONE = "right", "off", "none"

# Ratios E/G up to which errors of this library are given in words.
_UP_TO = 1e4, 1e6, 1e8

# Names of codes in the names of results.
_SHORT = {OURS: "ours", "FElupe": "felupe", "DOLFINx": "dolfinx"}


class Cell(NamedTuple):
    """Medians over the meshes that differ in their seeds.

    Attributes
    ----------
    load
        Load over the converged load; None where most meshes have no result.
    worst
        The load that is farthest from the converged load.
    solves
        Linear solves.
    """

    load: float | None = None
    worst: float | None = None
    solves: float | None = None

    @property
    def outcome(self) -> str:
        """One of `RIGHT`, `OFF` and `NONE`."""
        if self.load is None:
            return NONE
        return RIGHT if abs(self.load - 1) <= LIMIT else OFF


#: Cells of each code by E/G and distortion.
Cells: TypeAlias = dict[str, dict[tuple[float, float], Cell]]


def cells(rows: Sequence[Row]) -> Cells:
    """The cells of every code; those without a converged load are left out."""
    converged = {r["ratio"]: r["load"] for r in rows if r["code"] == REFERENCE}
    groups: dict[str, dict[tuple[float, float], list[Row]]] = {}
    for row in rows:
        if row.get("sound") is not None and row["ratio"] in converged:
            of_code = groups.setdefault(row["code"], {})
            of_code.setdefault((row["ratio"], row["distortion"]), []).append(row)
    return {
        code: {at: _cell(group, converged[at[0]]) for at, group in of_code.items()}
        for code, of_code in groups.items()
    }


def _cell(rows: list[Row], converged: float) -> Cell:
    sound = [row for row in rows if row["sound"]]
    if 2 * len(sound) <= len(rows):
        return Cell()
    loads = [row["load"] / converged for row in sound]
    solves = median(row["linear_solves"] for row in sound)
    return Cell(median(loads), max(loads, key=lambda x: abs(x - 1)), solves)


def markdown(rows: Sequence[Row]) -> str:
    """A line for each code and E/G: loads over the converged load, and solves."""
    lines, every = [], cells(rows)
    distortions = sorted({at[1] for of_code in every.values() for at in of_code})
    for code, of_code in every.items():
        for ratio in sorted({at[0] for at in of_code}):
            line = (of_code.get((ratio, x), Cell()) for x in distortions)
            lines.append([code, power_of_ten(ratio), *map(_in_table, line)])
    return markdown_table(
        ["code, element", "E/G", *(f"{x:g}" for x in distortions)], lines
    )


def figures(rows: Sequence[Row]) -> dict[str, str]:
    """Counts of outcomes and the largest load of each code, and errors of this library.

    ``ours_median_to_1e6`` is the largest error of a median up to E/G = 10⁶, and
    ``ours_worst_to_1e6`` that of a single mesh.
    """
    words, every = {}, cells(rows)
    for code, of_code in every.items():
        name = _SHORT.get(code) or _SHORT[code.partition(",")[0]]
        outcomes = [cell.outcome for cell in of_code.values()]
        for outcome in (RIGHT, OFF, NONE):
            count = outcomes.count(outcome)
            words[f"{name}_{outcome}"] = f"{count} of {len(outcomes)}"
        loads = [cell.load for cell in of_code.values() if cell.load is not None]
        words[f"{name}_largest"] = times(max(loads, default=0.0))
    for most in _UP_TO:
        ours = [cell for (x, _), cell in every.get(OURS, {}).items() if x <= most]
        to = f"to_{most:.0e}".replace("e+0", "e")
        words[f"ours_median_{to}"] = _largest_error(cell.load for cell in ours)
        words[f"ours_worst_{to}"] = _largest_error(cell.worst for cell in ours)
    unsure = (
        max(abs(row["halving"]), abs(row["apart"]))
        for row in rows
        if row["code"] == REFERENCE
    )
    words["converged_to"] = f"{100 * max(unsure, default=0.0):.1g} %"
    return words


def _largest_error(loads: Iterable[float | None]) -> str:
    """The largest error of loads over the converged load, in per cent."""
    errors = (abs(load - 1) for load in loads if load is not None)
    return f"{100 * max(errors, default=0.0):.1f} %"


def times(ratio: float) -> str:
    """A ratio with two or three digits, as a power of ten from 10⁴ on.

    Examples
    --------
    >>> times(1.2345), times(52.03), times(6711131.8)
    ('1.23', '52', '7·10⁶')
    """
    if ratio < 10:
        return f"{ratio:.2f}"
    if ratio < 1e4:
        return f"{ratio:.0f}"
    digit, exponent = f"{ratio:.0e}".split("e")
    return f"{digit}·{power_of_ten(10.0 ** int(exponent))}"


def power_of_ten(x: float) -> str:
    """A power of ten.

    Examples
    --------
    >>> power_of_ten(1e10)
    '10¹⁰'
    """
    return "10" + str(int(f"{x:e}".partition("e")[2])).translate(_RAISED)


_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def _in_table(cell: Cell) -> str:
    if cell.load is None:
        return "none"
    return f"{times(cell.load)} ({cell.solves:.0f})"
