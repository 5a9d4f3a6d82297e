"""Figures of fits: the curves of the tests, and the law with its band."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy import ndarray

from ..plot.curves import COLOURS
from ..plot.picture_files import picture_path, save

if TYPE_CHECKING:
    from .biaxial import TensionFit
    from .shear import ShearFit

# Points of a line.
_N = 201


def draw_shear(found: "ShearFit", filename: str | os.PathLike[str]) -> None:
    """Draw forces and moments of the tests, and those of the law with its band.

    Parameters
    ----------
    found
        The fit.
    filename
        Where to write a PNG.
    """
    with _panels(filename) as (left, right):
        colours = cycle(COLOURS[1:])
        for i, specimen in enumerate(found.specimens):
            colour, used = next(colours), specimen.used(found.up_to)
            angle = np.degrees(specimen.angle)
            order = np.argsort(angle[used])
            predicted = found.fit.samples[i].predict(found.fit.law)
            name = specimen.name
            left.plot(angle[used], specimen.force[used], ".", color=colour, label=name)
            left.plot(angle[~used], specimen.force[~used], "x", color=colour, ms=3)
            left.plot(angle[used][order], predicted[order], color=colour)
            gamma, C = specimen.pointwise(found.up_to)
            right.plot(np.degrees(gamma), C, ".", color=colour, ms=3)
        gamma = np.linspace(0.0, found.largest_angle, _N)

        def value(law: Any) -> ndarray:
            return law.value(gamma)

        low, high = found.fit.band(value)
        degrees = np.degrees(gamma)
        right.fill_between(degrees, low, high, color=COLOURS[0], alpha=0.3, lw=0)
        right.plot(degrees, value(found.fit.law), color=COLOURS[0], label="law, 95 %")
        holds = min(np.degrees(s.kinematics_hold_to) for s in found.specimens)
        right.axvline(holds, color="grey", ls=":", label="kinematics hold to here")
        left.set(xlabel="shear angle (deg)", ylabel="force (N)")
        right.set(xlabel="shear angle (deg)", ylabel="shear moment C (N mm/mm²)")
        inside = value(found.fit.law)
        right.set_ylim(min(0.0, 1.1 * float(low.min())), 1.3 * float(inside.max()))


def draw_tension(found: "TensionFit", filename: str | os.PathLike[str]) -> None:
    """Draw tensions of warp and weft over their strains, and those of the laws.

    Parameters
    ----------
    found
        The fit.
    filename
        Where to write a PNG.
    """
    with _panels(filename) as panels:
        for i, (axes, family) in enumerate(zip(panels, ("warp", "weft"), strict=True)):
            colours = cycle(COLOURS)
            for curve in found.curves:
                colour, strain = next(colours), curve.strain[i]
                scale = np.exp(strain) / curve.widths[i]
                axes.plot(strain, curve.tension[i], ".", color=colour, label=curve.name)
                axes.plot(strain, found.forces(curve)[i] * scale, color=colour)
            axes.set(xlabel=f"{family} strain ln λ (-)", ylabel="tension (N/mm)")


@contextmanager
def _panels(filename: str | os.PathLike[str]) -> Iterator[tuple[Any, Any]]:
    """Two panels of a figure that is written when the block ends."""
    path = picture_path(filename)
    style = {"axes.spines.top": False, "axes.spines.right": False, "font.size": 10}
    with mpl.rc_context(style):
        figure = Figure(figsize=(9.6, 4.2), layout="constrained")
        panels = figure.subplots(1, 2)
        yield tuple(panels)
        for axes in panels:
            axes.grid(alpha=0.3)
            axes.legend(frameon=False)
        save(figure, path)
