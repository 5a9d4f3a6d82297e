"""Predictions of published measurements: rows, tables and results for pages."""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..common.tables import grouped, having, percent, span
from ..study import Part, Row, Study
from . import pictures, tables
from .angle import FABRIC, NAME, TEST, angle_cases, departures, measured, onset
from .normalised import normalised_cases
from .nylon import nylon_cases
from .published import BIAS, FABRICS, FRAMES
from .shear import LawCase, fitted, shear_cases
from .tables import array, inside, ratios
from .temperature import Temperature

# Measured shear angle in degrees at which the change of a moment is stated.
_STATED = 30.0


class Measured(Study[Any]):
    """Predictions of published measurements."""

    parts = (
        Part(
            "laws.csv",
            {"laws.md": tables.laws, "misaligned.md": tables.misaligned},
            cases=("law: *",),
        ),
        Part(
            "predictions.csv",
            {
                "sets.md": tables.sets,
                "bias_extensions.md": tables.bias_extensions,
                "frames.md": tables.frames,
            },
            pictures.OF_PREDICTIONS,
            cases=("predicted: *",),
        ),
        Part(
            "angle.csv",
            {"angle.md": tables.angle, "onsets.md": tables.onsets},
            {"angle.png": pictures.angle},
            cases=("angle: *",),
        ),
        Part(
            *("normalised.csv", {"normalised.md": tables.normalised}),
            cases=("normalised: *",),
        ),
        Part(
            *("nylon.csv", {"nylon.md": tables.nylon}, {"nylon.png": pictures.nylon}),
            cases=("nylon: *",),
        ),
        Part(
            *("temperature.csv", {"temperature.md": tables.temperature}),
            cases=("temperature: *",),
        ),
    )
    sample = str(LawCase("plain", BIAS))

    def cases(self, options: argparse.Namespace) -> Sequence[Any]:
        return [
            *shear_cases(),
            *angle_cases(),
            *normalised_cases(),
            *nylon_cases(),
            Temperature(),
        ]

    def line(self, rows: list[Row]) -> str:
        return f"{rows[0]['case']}: {len(rows)} rows"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        found: dict[str, str] = {}
        for test, law in ((BIAS, FRAMES), (BIAS, BIAS), (FRAMES, BIAS)):
            group = having(rows, test=test, law=law)
            if not group:
                continue
            key = f"{test}_by_{law}".replace(" ", "_")
            found |= _of_set(key, group)
            for fabric in FABRICS:
                of_fabric = having(group, fabric=fabric)
                found |= _of_set(f"{key}_{fabric}".replace(" ", "_"), of_fabric)
        if angles := [row for row in rows if "pin_jointed" in row]:
            found |= _of_angle(angles)
        if factors := [row for row in rows if "factor" in row]:
            found["factors"] = span(array(factors, "factor"), ".2f")
            beyond = sum(row["factor"] > row["limit"] for row in factors)
            found["beyond_limit"] = f"{beyond} of {len(factors)}"
        if strips := having(rows, fitted=False):
            off = array(strips, "predicted") / array(strips, "measured") - 1
            low, high = (percent(x, ".0f") for x in (off.min(), off.max()))
            found["nylon"] = f"{low} to {high}"
            found["nylon_inside"] = f"{inside(strips, 'mean_half')} of {len(strips)}"
        return found


def _of_set(key: str, rows: list[Row]) -> dict[str, str]:
    """Points inside the bands, and ratios, of some predictions."""
    within = inside(rows, "specimen_half", "mesh_half")
    of_mean = inside(rows, "mean_half", "mesh_half")
    late = [row for row in rows if row["angle"] > tables.RATIO_FROM]
    low, high = np.quantile(ratios(rows), (0.05, 0.95))
    stiffness = np.hstack([array(rows, f"stiffness_{x}") for x in ("0.5", "2")])
    return {
        f"{key}_inside": f"{within} of {len(rows)}",
        f"{key}_late": f"{inside(late, 'specimen_half', 'mesh_half')} of {len(late)}",
        f"{key}_share": percent(within / len(rows), ".0f"),
        f"{key}_mean": f"{of_mean} of {len(rows)}",
        f"{key}_mesh": f"{inside(rows, 'mesh_half')} of {len(rows)}",
        f"{key}_ratio": f"{np.median(ratios(rows)):.2f}",
        f"{key}_ratios": f"{low:.2f} to {high:.2f}",
        f"{key}_stiffness": percent(np.abs(stiffness).max(), ".1f"),
        f"{key}_interval": percent(
            (array(rows, "mesh_half") / array(rows, "predicted")).max(), ".2f"
        ),
    }


def _of_angle(rows: list[Row]) -> dict[str, str]:
    """Departures of the measured angle, and onset of slip, on the finer mesh."""
    finest = next(iter(grouped(rows, "density").values()))
    found, first = departures(finest), onset(finest, "max_slip_index", 1.0)
    known = [row for row in finest if row["pin_jointed"] <= 40]
    stiffness = np.hstack(
        [array(known, f"stiffness_{x}") - array(known, "centre") for x in ("0.5", "2")]
    )
    net, moved_by = array(known, "pin_jointed"), _moments_moved(found.slack)
    below = {of: max(net - array(known, of)) for of in ("centre", "zone")}
    return {
        **{f"{of}_below": f"{x:.1f}°" for of, x in below.items()},
        **{key: percent(x, "+.0f") for key, x in moved_by.items()},
        "onset": f"{first:.1f}°",
        "onset_area": f"{onset(finest, 'slip_share_of_area', 0.01):.1f}°",
        "departure": f"{found.net:.1f}°",
        "departure_raw": f"{found.raw:.1f}°",
        "departure_model": f"{found.model:.1f}°",
        "onset_late": f"{abs(first - found.net):.1f}°",
        "onset_late_model": f"{abs(first - found.model):.1f}°",
        "slack": f"{found.slack:.1f} mm",
        "model_slack": f"{found.model_slack:.1f} mm",
        "angle_stiffness": f"{np.abs(stiffness).max():.2f}°",
    }


def _moments_moved(slack: float) -> dict[str, float]:
    """Change of the moment of the law at 30° by the measured angle.

    The moment at the angle of the net at this displacement belongs to the measured one.
    """
    law = fitted(FABRIC, BIAS, without=NAME).laws["shear"]
    moved, angle = measured()
    at = np.interp(np.radians(_STATED), angle, moved)
    nets = {
        "moment": TEST.shear_angle(at),
        "moment_less_slack": TEST.shear_angle(at - slack),
    }
    own = law.value(np.radians(_STATED))
    return {key: float(law.value(gamma) / own - 1) for key, gamma in nets.items()}


STUDY = Measured()
