"""Tables of the pages, from the rows of the study."""

from collections.abc import Mapping, Sequence

from ..common.tables import markdown_table
from ..study import Row
from .documented import ALONG, DOCUMENTED, ON_TOOLS, Results
from .results import by_case
from .stretched import STRETCHED
from .words import powers

_NONE = "–"


def tables(rows: Sequence[Row]) -> dict[str, str]:
    """The tables whose cases are all among the rows, by the names of their files."""
    found = by_case(rows)
    texts = {
        "along_fibres.md": _along_fibres,
        "on_tools.md": _on_tools,
        "fibre_stretch.md": _fibre_stretch,
        "hole.md": _hole,
    }
    written = {}
    for name, text in texts.items():
        try:
            written[name] = text(found)
        except KeyError:  # these cases were not run
            continue
    return written


def _along_fibres(found: Mapping[str, Results]) -> str:
    stiffnesses = list(dict.fromkeys(E for _, E in ALONG))
    lines = []
    for formulation in dict.fromkeys(name for name, _ in ALONG):
        line = [f"`{formulation}`"]
        for E in stiffnesses:
            case = found[f"mesh along the fibres, {formulation}, E = {E}"]
            error, load = case["displacement_error_max"], case["load_over_exact"]
            line.append(f"{powers(error)}, {load:.4f}")
        lines.append(line)
    head = [f"error (mm), load at E = {powers(float(E))} N/mm" for E in stiffnesses]
    return markdown_table(["formulation", *head], lines)


def _on_tools(found: Mapping[str, Results]) -> str:
    head = [
        *("command", "largest shear angle", "largest error against the exact net"),
        *("root mean square", "bridging", "solves in 4 steps"),
    ]
    lines = []
    for options in ON_TOOLS:
        name = f"on a tool: {options}"
        case = found[name]
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
        return _NONE
    return f"{angle:.3f}°" if angle < 0.1 else f"{angle:#.2g}°"


def _fibre_stretch(found: Mapping[str, Results]) -> str:
    lines = []
    for name, ply in STRETCHED.items():
        case = found[name]
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
    """A share in per cent, with two digits behind the point below 2 %."""
    percent = 100 * share
    return f"{percent:.2f} %" if percent < 2 else f"{percent:.1f} %"


def _hole(found: Mapping[str, Results]) -> str:
    case = found["ply with a hole, half the element size"]
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
