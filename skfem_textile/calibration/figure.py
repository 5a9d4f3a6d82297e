"""Figures of fits: test curves, and the law with its confidence band."""

import os
from collections.abc import Sequence
from itertools import cycle
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy import ndarray

from ..plot.curves import COLOURS
from ..plot.picture_files import picture_path, save
from .bands import Fit
from .fitting import FabricFit
from .measured import FAMILIES
from .validation import NORMAL_95, Validation

# Number of points of a line.
_N = 201

# Upper limit of the axes, relative to the largest fitted force or angle.
_MOST = 1.6


def draw(result: FabricFit, filename: str | os.PathLike[str]) -> None:
    """Draw the test curves and the fitted laws, two panels for each kind of law.

    For a shear law, forces on the left, and moments with the confidence band of the law
    on the right; for tension laws, the tensions of warp and weft over their strains;
    for bending stiffnesses, the overhangs on the left, and the stiffness of each
    reading on the right.

    Parameters
    ----------
    result
        The fit.
    filename
        File name of the PNG.
    """
    path = picture_path(filename)
    style = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 10}
    drawn = [
        (_draw_tension, bool({*FAMILIES, "both"} & set(result.parts))),
        (_draw_shear, "shear" in result.parts),
        (_draw_bending, any(part.startswith("bending") for part in result.parts)),
    ]
    rows = [of_kind for of_kind, needed in drawn if needed]
    with mpl.rc_context(style):
        figure = Figure(figsize=(9.6, 4.2 * len(rows)), layout="constrained")
        panels = figure.subplots(len(rows), 2, squeeze=False)
        for of_kind, pair in zip(rows, panels, strict=True):
            of_kind(result, *pair)
        for axes in panels.ravel():
            axes.grid(alpha=0.3)
            if axes.get_legend_handles_labels()[0]:
                axes.legend(frameon=False)
        save(figure, path)


def draw_validation(
    found: Sequence[Validation], filename: str | os.PathLike[str]
) -> None:
    """Draw tests that were not used in the fit, beside their predictions.

    Parameters
    ----------
    found
        The tests.
    filename
        File name of the PNG.
    """
    path = picture_path(filename)
    style = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 10}
    with mpl.rc_context(style):
        figure = Figure(figsize=(6.4, 4.2 * len(found)), layout="constrained")
        panels = figure.subplots(len(found), 1, squeeze=False)[:, 0]
        for one, axes in zip(found, panels, strict=True):
            _draw_prediction(one, axes)
        save(figure, path)


def _draw_prediction(one: Validation, axes: Any) -> None:
    """Prediction with its bands, and the measured curve with the one of its noise."""
    x, prediction = one.displacement, one.prediction
    force, law = prediction.force, prediction.pointwise
    both = law + np.nan_to_num(prediction.discretisation)
    noise = NORMAL_95 * one.noise
    for half, alpha, label in (
        (both, 0.2, "parameters and discretisation"),
        (law, 0.35, "parameters"),
    ):
        band = force - half, force + half
        axes.fill_between(
            x, *band, color=COLOURS[0], alpha=alpha, lw=0, label=f"{label}, 95 %"
        )
    measured = one.measured - noise, one.measured + noise
    axes.fill_between(
        x, *measured, color=COLOURS[1], alpha=0.2, lw=0, label="noise, 95 %"
    )
    axes.plot(x, force, color=COLOURS[0], label="prediction")
    axes.plot(x, one.measured, ".", color=COLOURS[1], label=one.specimen.name)
    axes.set(xlabel="displacement (mm)", ylabel="force (N)")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def _draw_shear(result: FabricFit, left: Any, right: Any) -> None:
    """Forces and moments of the tests, and of the law with its band."""
    colours, largest, fit = cycle(COLOURS[1:]), 0.0, result.parts["shear"]
    up_to = result.choice.up_to
    for i, specimen in enumerate(result.specimens):
        colour, used = next(colours), specimen.used(up_to)
        angle = np.degrees(specimen.angle)
        order = np.argsort(angle[used])
        predicted = fit.predicted(i)
        largest = max(largest, float(specimen.force[used].max()))
        name = specimen.name
        left.plot(angle[used], specimen.force[used], ".", color=colour, label=name)
        left.plot(angle[~used], specimen.force[~used], "x", color=colour, ms=3)
        left.plot(angle[used][order], predicted[order], color=colour)
        at_rest, *_ = fit.zeros(i).get("force at rest", (0.0,))
        gamma, C = specimen.pointwise(up_to, at_rest)
        right.plot(np.degrees(gamma), C, ".", color=colour, ms=3)
    gamma = np.linspace(0.0, result.largest_angle, _N)

    def value(law: Any) -> ndarray:
        return law.value(gamma)

    low, high = fit.band(value)
    degrees = np.degrees(gamma)
    right.fill_between(degrees, low, high, color=COLOURS[0], alpha=0.3, lw=0)
    right.plot(degrees, value(fit.law), color=COLOURS[0], label="law, 95 %")
    scatter = fit.scatter(value)
    if scatter is not None:
        right.fill_between(
            *(degrees, *scatter), color=COLOURS[0], alpha=0.12, lw=0, label="a specimen"
        )
    holds = min(np.degrees(s.kinematics_limit) for s in result.specimens)
    right.axvline(holds, color="grey", ls=":", label="kinematics valid up to here")
    left.set(xlabel="shear angle (deg)", ylabel="force (N)")
    if left.get_ylim()[1] > _MOST * largest:  # excluded points would hide the others
        left.set_ylim(-0.05 * largest, _MOST * largest)
        left.set_xlim(right=_MOST * float(degrees[-1]))
    right.set(xlabel="shear angle (deg)", ylabel="shear moment C (N mm/mm²)")
    inside = value(fit.law)
    right.set_ylim(min(0.0, 1.1 * float(low.min())), 1.3 * float(inside.max()))


def _draw_tension(result: FabricFit, *panels: Any) -> None:
    """Tensions of warp and weft over their strains, and the laws with their bands."""
    colours = cycle(COLOURS)
    for part in (name for name in ("both", *FAMILIES) if name in result.parts):
        fit = result.parts[part]
        for k, (test, families) in enumerate(result.along(part)):
            colour = next(colours)
            curves = np.array([*_band_of_curve(fit, k), fit.predicted(k)])
            for i, forces in zip(
                families, np.split(curves, len(families), axis=1), strict=True
            ):
                along = test.along(i)
                assert along is not None
                order = np.argsort(along.strain)
                x, scale = along.strain[order], np.exp(along.strain) / along.width
                low, high, law = (forces * scale)[:, order]
                axes = panels[i]
                axes.plot(x, along.tension[order], ".", color=colour, label=test.name)
                axes.fill_between(x, low, high, color=colour, alpha=0.15, lw=0)
                axes.plot(x, law, color=colour)
    for axes, family in zip(panels, FAMILIES, strict=True):
        axes.locator_params(axis="x", nbins=5)
        axes.set(xlabel=f"{family} strain ln λ (-)", ylabel="tension (N/mm)")


def _band_of_curve(fit: Fit, k: int) -> ndarray:
    """Band of the predictions of a curve, (2, n)."""
    sample, zeros = fit.samples[k], fit.offsets[k]
    return fit.band(lambda law: sample.predict({sample.part: law}, *zeros))


def _draw_bending(result: FabricFit, lengths: Any, stiffnesses: Any) -> None:
    """Readings over the angle, and the resulting stiffnesses."""
    colours = cycle(COLOURS)
    for part in (name for name in result.parts if name.startswith("bending")):
        for test in result.cantilevers(part):
            colour, degrees = next(colours), np.degrees(test.angle)
            lengths.plot(degrees, test.overhang, "o", color=colour, label=test.name)
            stiffnesses.plot(degrees, test.by_elastica, "o", color=colour)
            stiffnesses.plot(degrees, test.by_peirce, "x", color=colour)
        stiffness = result.parts[part].law.stiffness
        stiffnesses.axhline(stiffness, color="#808080", lw=1.0)
    label = "Bending stiffness (N·mm), o elastica, x Peirce"
    lengths.set(xlabel="Chord angle (°)", ylabel="Overhang (mm)")
    stiffnesses.set(xlabel="Chord angle (°)", ylabel=label)
