"""Figures of fits: test curves, and the law with its confidence band."""

import os
from itertools import cycle
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy import ndarray

from ..plot.curves import COLOURS
from ..plot.picture_files import picture_path, save
from .bending import BendingFit
from .biaxial import FAMILIES, TensionFit
from .shear import ShearFit

# Number of points of a line.
_N = 201

# Upper limit of the axes, relative to the largest fitted force or angle.
_MOST = 1.6


def draw(
    fit: ShearFit | TensionFit | BendingFit, filename: str | os.PathLike[str]
) -> None:
    """Draw the test curves and the fitted laws.

    For a shear law, forces on the left, and moments with the confidence band of the law
    on the right; for tension laws, the tensions of warp and weft over their strains;
    for a bending stiffness, the overhangs on the left, and the stiffness of each
    reading on the right.

    Parameters
    ----------
    found
        The fit.
    filename
        File name of the PNG.
    """
    path = picture_path(filename)
    style = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 10}
    with mpl.rc_context(style):
        figure = Figure(figsize=(9.6, 4.2), layout="constrained")
        panels = figure.subplots(1, 2)
        if isinstance(fit, ShearFit):
            _draw_shear(fit, *panels)
        elif isinstance(fit, BendingFit):
            _draw_bending(fit, *panels)
        else:
            _draw_tension(fit, panels)
        for axes in panels:
            axes.grid(alpha=0.3)
            axes.legend(frameon=False)
        save(figure, path)


def _draw_shear(fit: ShearFit, left: Any, right: Any) -> None:
    """Forces and moments of the tests, and of the law with its band."""
    colours, largest = cycle(COLOURS[1:]), 0.0
    for i, specimen in enumerate(fit.specimens):
        colour, used = next(colours), specimen.used(fit.up_to)
        angle = np.degrees(specimen.angle)
        order = np.argsort(angle[used])
        predicted = fit.fit.predicted(i)
        largest = max(largest, float(specimen.force[used].max()))
        name = specimen.name
        left.plot(angle[used], specimen.force[used], ".", color=colour, label=name)
        left.plot(angle[~used], specimen.force[~used], "x", color=colour, ms=3)
        left.plot(angle[used][order], predicted[order], color=colour)
        at_rest, *_ = fit.fit.zeros(i).get("force at rest", (0.0,))
        gamma, C = specimen.pointwise(fit.up_to, at_rest)
        right.plot(np.degrees(gamma), C, ".", color=colour, ms=3)
    gamma = np.linspace(0.0, fit.largest_angle, _N)

    def value(law: Any) -> ndarray:
        return law.value(gamma)

    low, high = fit.fit.band(value)
    degrees = np.degrees(gamma)
    right.fill_between(degrees, low, high, color=COLOURS[0], alpha=0.3, lw=0)
    right.plot(degrees, value(fit.fit.law), color=COLOURS[0], label="law, 95 %")
    holds = min(np.degrees(s.kinematics_limit) for s in fit.specimens)
    right.axvline(holds, color="grey", ls=":", label="kinematics valid up to here")
    left.set(xlabel="shear angle (deg)", ylabel="force (N)")
    if left.get_ylim()[1] > _MOST * largest:  # excluded points would hide the others
        left.set_ylim(-0.05 * largest, _MOST * largest)
        left.set_xlim(right=_MOST * float(degrees[-1]))
    right.set(xlabel="shear angle (deg)", ylabel="shear moment C (N mm/mm²)")
    inside = value(fit.fit.law)
    right.set_ylim(min(0.0, 1.1 * float(low.min())), 1.3 * float(inside.max()))


def _draw_tension(fit: TensionFit, panels: ndarray) -> None:
    """Tensions of warp and weft over their strains, and the laws with their bands."""
    for i, (axes, family) in enumerate(zip(panels, FAMILIES, strict=True)):
        colours = cycle(COLOURS)
        for curve in fit.curves:
            colour, order = next(colours), np.argsort(curve.strain[i])
            strain = curve.strain[i][order]
            scale = np.exp(strain) / curve.widths[i]
            low, high = fit.band(curve)[:, i, order] * scale
            law = fit.forces(curve)[i, order] * scale
            measured = curve.tension[i][order]
            axes.plot(strain, measured, ".", color=colour, label=curve.name)
            axes.fill_between(strain, low, high, color=colour, alpha=0.15, lw=0)
            axes.plot(strain, law, color=colour)
        axes.locator_params(axis="x", nbins=5)
        axes.set(xlabel=f"{family} strain ln λ (-)", ylabel="tension (N/mm)")


def _draw_bending(fit: BendingFit, lengths: Any, stiffnesses: Any) -> None:
    """Readings over the angle, and the resulting stiffnesses."""
    for test, colour in zip(fit.tests, cycle(COLOURS), strict=False):
        degrees = np.degrees(test.angle)
        lengths.plot(degrees, test.overhang, "o", color=colour, label=test.name)
    degrees = np.degrees(np.concatenate([test.angle for test in fit.tests]))
    for values, label, mark in (
        (fit.by_elastica, "elastica", "o"),
        (fit.by_peirce, "Peirce", "x"),
    ):
        stiffnesses.plot(degrees, values, mark, label=label)
    stiffnesses.axhline(fit.stiffness, color="#808080", lw=1.0)
    lengths.set(xlabel="Chord angle (°)", ylabel="Overhang (mm)")
    stiffnesses.set(xlabel="Chord angle (°)", ylabel="Bending stiffness (N·mm)")
