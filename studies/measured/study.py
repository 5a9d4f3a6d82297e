"""Predictions of published measurements: rows, tables and results for pages."""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..common.tables import grouped, having, percent
from ..study import Part, Row, Study
from . import pictures, tables
from .angle import FABRIC, NAME, TEST, angle_cases, departures, measured, onset
from .normalised import normalised_cases
from .nylon import nylon_cases
from .published import BIAS, FRAMES
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
            {"angle.png": pictures.angle, "slip.png": pictures.slip},
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
        if predicted := [row for row in rows if "specimen_half" in row and "x" in row]:
            found |= _of_sets(predicted)
        if angles := [row for row in rows if "pin_jointed" in row]:
            found |= _of_angle(angles)
        if strips := having(rows, fitted=False):
            off = array(strips, "predicted") / array(strips, "measured") - 1
            low, high = (percent(x, ".0f") for x in (off.min(), off.max()))
            found["nylon"] = f"{low} to {high}"
            found["nylon_inside"] = f"{inside(strips, 'mean_half')} of {len(strips)}"
        return found


def _of_sets(rows: list[Row]) -> dict[str, str]:
    """Points inside the bands, and ratios of predicted and measured forces."""
    bias, across, frames = (
        having(rows, test=test, law=law)
        for test, law in ((BIAS, BIAS), (BIAS, FRAMES), (FRAMES, BIAS))
    )
    found = {}
    for fabric, group in grouped(bias, "fabric").items():
        low, high = np.quantile(ratios(group), (0.05, 0.95))
        found[f"ratios_{fabric}".replace(" ", "_")] = f"{low:.2f} to {high:.2f}"
    for name, group in (("bias", bias), ("across", across), ("frames", frames)):
        late = [row for row in group if row["angle"] > tables.RATIO_FROM]
        within = inside(late, "specimen_half", "mesh_half")
        found[f"{name}_inside"] = f"{within} of {len(late)}"
    stiffness = np.hstack([array(rows, f"stiffness_{x}") for x in ("0.5", "2")])
    interval = array(rows, "mesh_half") / array(rows, "predicted")
    return found | {
        "across_ratio": f"{np.median(ratios(across)):.2f}",
        "frames_ratio": f"{np.median(ratios(frames)):.2f}",
        "stiffness": percent(np.abs(stiffness).max(), ".1f"),
        "interval": percent(interval.max(), ".2f"),
    }


def _of_angle(rows: list[Row]) -> dict[str, str]:
    """Departures of the measured angle, and onset of slip, on the finer mesh."""
    finest = next(iter(grouped(rows, "density").values()))
    found, first = departures(finest), onset(finest, "max_slip_index", 1.0)
    known = [row for row in finest if row["pin_jointed"] < 40.5]
    stiffness = np.hstack(
        [array(known, f"stiffness_{x}") - array(known, "centre") for x in ("0.5", "2")]
    )
    net, moved_by = array(known, "pin_jointed"), _moments_moved(found.slack)
    below = {of: max(net - array(known, of)) for of in ("centre", "zone")}
    return {
        **{f"{of}_below": f"{x:.1f}°" for of, x in below.items()},
        **{key: percent(x, "+.0f") for key, x in moved_by.items()},
        "onset": f"{first:.1f}°",
        "departure": f"{found.net:.1f}°",
        "departure_raw": f"{found.raw:.1f}°",
        "departure_model": f"{found.model:.1f}°",
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
