"""Commands on pages, run as printed, and the results quoted there."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from itertools import chain

from ..common.tables import (
    grouped,
    markdown_table,
    minus,
    percent,
    scientific,
)
from ..study import Part, Row, Study, Table
from .documented import ALONG, DOCUMENTED, ON_TOOLS, STRETCHED, STRIPS, Results

# Lower limit of numbers in fixed-point notation.
_PLAIN = 1e-3


def by_case(rows: Sequence[Row]) -> dict[str, dict[str, float]]:
    """Results of each case."""
    return {
        case: {row["quantity"]: row["value"] for row in results}
        for case, results in grouped(rows, "case").items()
    }


def powers(number: float) -> str:
    """A number to two digits, in scientific notation if small or large.

    Examples
    --------
    >>> powers(3.81e-7), powers(0.0192), powers(1e5)
    ('3.8·10⁻⁷', '0.019', '10⁵')
    """
    plain = _PLAIN <= abs(number) < 1 / _PLAIN
    return f"{number:.2g}" if plain else scientific(number)


def _along_fibres(results: Mapping[str, Results]) -> str:
    stiffnesses = list(dict.fromkeys(E for _, E in ALONG))
    lines = []
    for formulation in dict.fromkeys(name for name, _ in ALONG):
        line = [f"`{formulation}`"]
        for E in stiffnesses:
            case = results[f"mesh along the fibres, {formulation}, E = {E}"]
            error, load = case["displacement_error_max"], case["load_over_exact"]
            line += [powers(error), f"{load:.4f}"]
        lines.append(line)
    heads = [
        (
            f"error (mm), E = {powers(float(E))} N/mm",
            f"load, E = {powers(float(E))} N/mm",
        )
        for E in stiffnesses
    ]
    return markdown_table(["formulation", *chain.from_iterable(heads)], lines)


def _on_tools(results: Mapping[str, Results]) -> str:
    head = [
        *("command", "largest shear angle", "largest error against the exact net"),
        *("error, rms over elements", "bridging", "solves in 4 steps"),
    ]
    lines = []
    for options in ON_TOOLS:
        name = f"on a tool: {options}"
        case = results[name]
        lines.append(
            [
                f"`{DOCUMENTED[name].command}`",
                f"{case['max_shear_angle_deg']:.2f}°"
                if case["max_shear_angle_deg"] > 1
                else _degrees(case["max_shear_angle_deg"]),
                _degrees(case.get("shear_angle_error_max_deg")),
                _degrees(case.get("shear_angle_error_rms_deg")),
                f"{100 * case['bridging_share_of_area']:.0f} %",
                f"{case['linear_solves']:.0f}",
            ]
        )
    return markdown_table(head, lines)


def _degrees(angle: float | None) -> str:
    """An angle to a thousandth of a degree, or to two digits."""
    if angle is None:
        return "–"
    return f"{angle:.3f}°" if angle < 0.1 else f"{angle:#.2g}°"


def _fibre_stretch(results: Mapping[str, Results]) -> str:
    lines = []
    for name, ply in STRETCHED.items():
        case = results[name]
        law = ", sin²" if ply.law == "sin²" else ""
        lines.append(
            [
                f"{ply.inclination:g}°{law}",
                f"{ply.shear_angle:g}°",
                " and ".join(powers(ratio) for ratio in ply.distinct),
                _share(case["estimate"]),
                _share(case["measured"]),
            ]
        )
    return markdown_table(["θ", "γ", "E/G", "estimate", "measured"], lines)


def _share(share: float) -> str:
    """A fraction in per cent, with two decimals below 2 %."""
    return percent(share, ".2f" if share < 0.02 else ".1f")


def _hole(results: Mapping[str, Results]) -> str:
    case = results["ply with a hole, half the element size"]
    lines = [
        [
            f"{case[f'triangles, {i}']:.0f}",
            f"{case[f'unknowns, {i}']:.0f}",
            f"{case[f'force, {i}']:.2f}",
            f"{case[f'processor time, {i}']:.0f}",
        ]
        for i in (1, 2)
    ]
    head = ["triangles", "unknowns", "force at 40 mm (N)", "processor time (s)"]
    return markdown_table(head, lines)


def _complete(table: Callable[[Mapping[str, Results]], str]) -> Table:
    """A table that is empty unless all its cases are among the rows."""

    def text(rows: list[Row]) -> str:
        try:
            return table(by_case(rows))
        except KeyError:
            return ""

    return text


def _strip(case: Results) -> dict[str, str]:
    """Results of the strip by formulation: full, point and macro."""
    words: dict[str, str] = {}
    for short, title in zip(("full", "point", "macro"), STRIPS, strict=True):
        force = case[f"force (N), {title}"]
        digits = ".0f" if abs(force) > 100 else ".2f"
        position = case[f"position error, rms over nodes (mm), {title}"]
        strain = case[f"largest fibre strain (%), {title}"]
        words |= {
            f"strip_force_{short}": minus(f"{force:{digits}} N"),
            f"strip_position_{short}": f"{position:.3f} mm",
            f"strip_strain_{short}": f"{strain:.2g} %",
        }
    return words


class Commands(Study[str]):
    """The commands by case name, with a row for each result."""

    parts = (
        Part(
            "commands.csv",
            {
                "along_fibres.md": _complete(_along_fibres),
                "on_tools.md": _complete(_on_tools),
                "fibre_stretch.md": _complete(_fibre_stretch),
                "hole.md": _complete(_hole),
            },
        ),
    )
    shown = "{quantity} {value:.4g}"
    sample = "strip"

    def cases(self, options: argparse.Namespace) -> Sequence[str]:
        return [*DOCUMENTED, *STRETCHED]

    def examine(self, case: str) -> list[Row]:
        of_case = DOCUMENTED.get(case) or STRETCHED[case]
        return [
            {"case": case, "quantity": name, "value": value}
            for name, value in of_case.results().items()
        ]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        results = by_case(rows)
        return _strip(results["strip"]) if "strip" in results else {}


STUDY = Commands()
