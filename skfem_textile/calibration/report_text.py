"""What a fit found, as text in Markdown."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

_PERCENT = 100.0


def report_text(reports: Mapping[str, Mapping[str, Any]]) -> str:
    """Reports as text in Markdown, by their titles."""
    return "\n".join(_section(title, report) for title, report in reports.items())


def _section(title: str, report: Mapping[str, Any]) -> str:
    lines = [f"# {title}", ""]
    if "compared_with" in report:
        lines += [
            f"Fitted up to {report['largest_angle_deg']:.1f} degrees of shear, beside "
            f"{report['compared_with']}. The kinematics hold up to "
            f"{report['kinematics_hold_to_deg']:.1f} degrees.",
            "",
        ]
    if "largest_strain" in report:
        reach = report["largest_strain"]
        lines += [f"Fitted up to a strain ln λ of {reach:.4g}.", ""]
    percent = f"{_PERCENT * report['confidence']:g} %"
    rows = [
        [p["name"], f"{p['value']:.5g}", _ends(p), p["unit"]]
        for p in report["parameters"]
    ]
    law = report["law"]["kind"]
    lines += [f"Law: {law}", "", *_table(["parameter", "value", percent, "unit"], rows)]
    rows = [
        [
            c["name"],
            _points(c),
            f"{c['noise_N']:.4g} ({_share(c['noise_over_largest'])})",
            f"{c['residual_rms_N']:.4g}",
            f"{c['correlation_of_neighbours']:+.2f}",
        ]
        for c in report.get("specimens", report.get("curves", []))
    ]
    head = ["curve", "points", "noise, N", "residual, N", "correlation"]
    lines += ["", *_table(head, rows)]
    if report.get("moments"):
        rows = [
            [
                f"{m['angle_deg']:g}",
                f"{m['moment']:.4g}",
                f"{m['low']:.4g} to {m['high']:.4g}",
                f"{m['between_specimens']:.2g}" if "between_specimens" in m else "-",
                ", ".join(f"{one:.4g}" for one in m["point_by_point"]) or "-",
            ]
            for m in report["moments"]
        ]
        head = ["angle, deg", "C, N·mm/mm²", percent, "between specimens"]
        lines += ["", *_table([*head, "point by point"], rows)]
    for note in report["notes"]:
        lines += ["", f"Note: {note}."]
    return "\n".join(lines) + "\n"


def _share(noise: float) -> str:
    """Noise over the largest force; a curve without force has none."""
    return f"{_PERCENT * noise:.1f} %" if np.isfinite(noise) else "no force"


def _points(curve: Mapping[str, Any]) -> str:
    """How many points are fitted, and of how many if some are left out."""
    points, left_out = curve["points"], curve.get("left_out", 0)
    return f"{points} of {points + left_out}" if left_out else f"{points}"


def _ends(parameter: Mapping[str, Any]) -> str:
    if parameter["at_bound"]:
        return "at a bound"
    return f"{parameter['low']:.5g} to {parameter['high']:.5g}"


def _table(head: Sequence[object], rows: Sequence[Sequence[object]]) -> list[str]:
    lines = [f"| {' | '.join(map(str, line))} |" for line in (head, *rows)]
    lines.insert(1, "|" + "---|" * len(head))
    return lines
