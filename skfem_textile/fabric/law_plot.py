"""Curves of laws, drawn with matplotlib."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ..registration import Resistance
from .law import BiaxialLaw, Law, domain_of

# Arguments up to which a law is drawn that does not tell: fibre strain, and radians.
_STRAIN, _ANGLE = 0.02, np.radians(60.0)

_N_POINTS = 401

# Strain of the weft over that of the warp, for which biaxial laws are drawn.
_STRAIN_RATIOS = (-0.5, 0.0, 0.5, 1.0)

# What an axis shows, and the units of the argument's in radians or as a strain.
_AXES: dict[Resistance | None, tuple[str, str, float]] = {
    "tension": ("fibre strain ε (-)", "tension T (N/mm)", 1.0),
    "shear": ("shear angle Γ (deg)", "shear moment (N mm/mm²)", 180.0 / np.pi),
    None: (
        "fibre strain (-) or shear angle (rad)",
        "tension or shear moment (N/mm)",
        1.0,
    ),
}


class Drawn:
    """A law that can be drawn.

    Attributes
    ----------
    of
        What it is the law of; None if it may be either.
    shown
        Least and largest argument at which it is drawn; None to leave that open.  Where
        the law has no end, `check_laws` asks it no further.
    """

    of: ClassVar[Resistance | None] = None

    @property
    def shown(self) -> tuple[float, float] | None:
        """Least and largest argument at which the law is drawn, if it tells."""
        return None

    def plot(self: Law, axes: Any = None, of: Resistance | None = None) -> Any:
        """Draw the law; see `plot_law`."""
        return plot_law(self, axes, of)


class DrawnTensions(BiaxialLaw):
    """A law of both fibre strains that can be drawn."""

    def plot(self, axes: Any = None) -> Any:
        """Draw the tensions; see `plot_tensions`."""
        return plot_tensions(self, axes)


def plot_law(
    law: Law | BiaxialLaw, axes: Any = None, of: Resistance | None = None
) -> Any:
    """Draw the value of a law against its argument, with units.

    Parameters
    ----------
    law
        Any law; the points of a table are drawn too.  Of a law of both fibre strains
        `plot_tensions` draws the tensions.
    axes
        Where to draw; axes of a new figure of pyplot if not given.
    of
        Whether it is a law of ``tension`` or ``shear``, where the law does not tell.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.
    """
    if isinstance(law, BiaxialLaw):
        return plot_tensions(law, axes)
    axes = _axes(axes)
    of = of or getattr(law, "of", None)
    x_label, y_label, unit = _AXES[of]
    low, high = _ends(law, _STRAIN if of == "tension" else _ANGLE)
    x = np.linspace(low, high, _N_POINTS)
    with np.errstate(all="ignore"):  # a gap is drawn where it is not finite
        (line,) = axes.plot(unit * x, law.value(x))
    points = getattr(law, "points", None)
    if points is not None:
        axes.plot(unit * points[0], points[1], "o", color=line.get_color())
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.grid(alpha=0.3)
    return axes


def plot_tensions(
    law: BiaxialLaw, axes: Any = None, ratios: Sequence[float] = _STRAIN_RATIOS
) -> Any:
    """Draw the tensions of a biaxial law along lines of a constant ratio of strains.

    Parameters
    ----------
    law
        A `BiaxialLaw`.
    axes
        Where to draw; axes of a new figure of pyplot if not given.
    ratios
        Strain of the weft over that of the warp, a line of the warp's tension and a
        dashed one of the weft's for each.

    Returns
    -------
    matplotlib.axes.Axes
        The axes.
    """
    axes = _axes(axes)
    low, high = law.shown or (-_STRAIN, _STRAIN)
    x = np.linspace(low, high, _N_POINTS)
    for ratio in ratios:
        with np.errstate(all="ignore"):  # a gap is drawn where it is not finite
            warp, weft = law.value(np.array([x, ratio * x]))
        (line,) = axes.plot(x, warp, label=f"warp, weft strain {ratio:g} ε")
        axes.plot(x, weft, "--", color=line.get_color())
    axes.set(xlabel="warp strain ε (-)", ylabel="tension T (N/mm), weft dashed")
    axes.grid(alpha=0.3)
    axes.legend()
    return axes


def _axes(axes: Any) -> Any:
    """The axes that are given, or new ones."""
    if axes is not None:
        return axes
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


def _ends(law: Law, reach: float) -> tuple[float, float]:
    """Where to draw a law: where it tells, or its domain as far as that is finite."""
    shown = getattr(law, "shown", None)
    if shown is not None:
        return shown
    low, high = domain_of(law)
    low = low if np.isfinite(low) else min(-reach, high - 2 * reach)
    high = high if np.isfinite(high) else max(reach, low + 2 * reach)
    return low, high
