"""Laws of a fabric with matplotlib: specimens, bands and assumptions."""

import os
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..fabric import Fabric, TwoLaws
from ..fabric.origin import Origin
from ..fabric.scatter import band_of_law
from .curves import COLOURS, columns_of, plot_law, plot_tensions
from .drawing import legend_below, new_figure

# Confidence level of the band of a law.
_CONFIDENCE = 0.95

# Number of points of a shear law, and share of the range at the first one: at rest
# there is no logarithm.
_N_POINTS, _FIRST = 100, 0.05

# Width and height of the picture in mm. Chosen by eye: square panels above a legend.
_SIZE = 130.0, 78.0

_SPECIMEN: dict[str, Any] = {"color": "0.55", "lw": 0.6}


def fabric_laws(
    fabric: Fabric,
    origin: Origin | None = None,
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Plot the laws of a fabric, with the specimens and the band of a further one.

    Shear moments are drawn over the measured range, if it is known, with logarithmic
    values: scatter is a factor.

    Parameters
    ----------
    fabric
        The fabric.
    origin
        Sources of its laws, see `FabricOfFile`.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> from skfem_textile.io import read_fabric
    >>> found = read_fabric("cao2008-plain-weave")
    >>> [axes.get_title() for axes in fabric_laws(found.fabric, found.origin).axes]
    ['Shear', 'Tension (assumed)']
    """
    with new_figure(filename) as figure:
        figure.set_size_inches(_SIZE[0] / 25.4, _SIZE[1] / 25.4)
        shear, tension = figure.subplots(1, 2)
        handles = _tension(fabric, tension)
        if origin is None or "shear" not in origin.ranges:
            plot_law(fabric.shear_law, shear, "shear")
        else:
            handles += _measured_shear(fabric, origin, shear)
        for axes, part in ((shear, "shear"), (tension, "tension")):
            is_assumed = origin is not None and part in origin.assumed
            axes.set_title(part.capitalize() + " (assumed)" * is_assumed)
        names = [str(one.get_label()) for one in handles]
        legend_below(figure, handles, columns_of(names, _SIZE[0]))
    return figure


def _tension(fabric: Fabric, axes: Axes) -> list[Artist]:
    """Draw the tension laws; returns the entries of the legend."""
    if not isinstance(fabric.tensions, TwoLaws):
        plot_tensions(fabric.tensions, axes)
        return []
    styles = ("-", COLOURS[0]), ("--", COLOURS[1])
    for family, (dashes, colour) in zip(fabric.families, styles, strict=True):
        before = len(axes.lines)
        plot_law(family.tension, axes, "tension")
        for line in axes.lines[before:]:
            line.set(linestyle=dashes if line.get_marker() == "None" else "")
            line.set_color(colour)
    return [
        Line2D([], [], linestyle=dashes, color=colour, label=family.name)
        for family, (dashes, colour) in zip(fabric.families, styles, strict=True)
    ]


def _measured_shear(fabric: Fabric, origin: Origin, axes: Axes) -> list[Artist]:
    """Draw the shear law over its range; returns the entries of the legend."""
    specimens = origin.specimens.get("shear", ())
    x = origin.ranges["shear"] * np.linspace(_FIRST, 1.0, _N_POINTS)
    band = band_of_law(specimens, x, _CONFIDENCE)
    degrees = np.degrees(x)
    plot = axes.plot if band is None else axes.semilogy
    handles: list[Artist] = [Line2D([], [], color="black", label="shear law")]
    for one in specimens:
        plot(degrees, one.law.value(x), **_SPECIMEN)
    if specimens:
        handles.append(Line2D([], [], label="specimens", **_SPECIMEN))
    if band is not None:
        axes.fill_between(degrees, *band, color="black", alpha=0.12, lw=0)
        label = "95 % band of a further specimen"
        handles.append(Patch(color="black", alpha=0.12, label=label))
    plot(degrees, fabric.shear_law.value(x), color="black", lw=1.4)
    axes.set(xlabel="shear angle Γ (deg)", ylabel="shear moment (N mm/mm²)")
    axes.grid(alpha=0.3)
    return handles
