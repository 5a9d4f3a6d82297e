"""Curves of constitutive laws with matplotlib."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes

from ..fabric.law import BiaxialLaw, Law, domain_of

# Largest argument for laws without a shown range or a finite domain: fibre strain, and
# shear angle in radians.
_STRAIN, _ANGLE = 0.02, np.radians(60.0)

_N_POINTS = 401

# Strain of the weft over that of the warp, for which biaxial laws are drawn.
_STRAIN_RATIOS = (-0.5, 0.0, 0.5, 1.0)

# Labels of both axes by the quantity of the law, and the factor from the argument of
# the law to the unit of the axis.
_AXES: dict[str | None, tuple[str, str, float]] = {
    "tension": ("fibre strain ε (-)", "tension T (N/mm)", 1.0),
    "shear": ("shear angle Γ (deg)", "shear moment (N mm/mm²)", 180.0 / np.pi),
    None: (
        "fibre strain (-) or shear angle (rad)",
        "tension or shear moment (N/mm)",
        1.0,
    ),
}


def plot_law(
    law: Law | BiaxialLaw,
    axes: Axes | None = None,
    of: Literal["tension", "shear"] | None = None,
) -> Axes:
    """Plot the value of a law against its argument, with units.

    Parameters
    ----------
    law
        Any law.  The curve of a table includes its points.  A `BiaxialLaw` is plotted
        by `plot_tensions`.
    axes
        Axes of the plot; those of a new figure of pyplot if not given.
    of
        Quantity of the law, which determines labels and units; ``law.of`` if not
        given.  Without either the label of an axis is that of both quantities.

    Returns
    -------
    matplotlib.axes.Axes
        The axes: fibre strain (-) and tension (N/mm), or shear angle (deg) and shear
        moment (N mm/mm²).

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from skfem_textile import Sin2
    >>> axes = plot_law(Sin2(0.5), Figure().subplots())
    >>> axes.get_xlabel()
    'shear angle Γ (deg)'
    """
    if isinstance(law, BiaxialLaw):
        return plot_tensions(law, axes)
    axes = _axes(axes)
    quantity = of or getattr(law, "of", None)
    x_label, y_label, unit = _AXES[quantity]
    low, high = _ends(law, _STRAIN if quantity == "tension" else _ANGLE)
    x = np.linspace(low, high, _N_POINTS)
    with np.errstate(all="ignore"):  # values that are not finite are gaps
        (line,) = axes.plot(unit * x, law.value(x))
    points = getattr(law, "points", None)
    if points is not None:
        axes.plot(unit * points[0], points[1], "o", color=line.get_color())
    axes.set(xlabel=x_label, ylabel=y_label)
    axes.grid(alpha=0.3)
    return axes


def plot_tensions(
    law: BiaxialLaw,
    axes: Axes | None = None,
    ratios: Sequence[float] = _STRAIN_RATIOS,
) -> Axes:
    """Plot the tensions of a biaxial law along lines of a constant ratio of strains.

    Parameters
    ----------
    law
        A `BiaxialLaw`.
    axes
        Axes of the plot; those of a new figure of pyplot if not given.
    ratios
        Strain of the weft over that of the warp.  Each ratio has a line for the tension
        of the warp and a dashed line for that of the weft.

    Returns
    -------
    matplotlib.axes.Axes
        The axes: warp strain (-) and tension (N/mm).
    """
    axes = _axes(axes)
    low, high = law.shown or (-_STRAIN, _STRAIN)
    x = np.linspace(low, high, _N_POINTS)
    for ratio in ratios:
        with np.errstate(all="ignore"):  # values that are not finite are gaps
            warp, weft = law.value(np.array([x, ratio * x]))
        (line,) = axes.plot(x, warp, label=f"warp, weft strain {ratio:g} ε")
        axes.plot(x, weft, "--", color=line.get_color())
    axes.set(xlabel="warp strain ε (-)", ylabel="tension T (N/mm), weft dashed")
    axes.grid(alpha=0.3)
    axes.legend()
    return axes


def _axes(axes: Axes | None) -> Axes:
    """The given axes, or those of a new figure."""
    if axes is not None:
        return axes
    from matplotlib import pyplot  # slow to import

    return pyplot.subplots(layout="constrained")[1]


def _ends(law: Law, reach: float) -> tuple[float, float]:
    """Ends of the plot: the shown range, or the domain as far as it is finite."""
    shown = getattr(law, "shown", None)
    if shown is not None:
        return shown
    low, high = domain_of(law)
    low = low if np.isfinite(low) else min(-reach, high - 2 * reach)
    high = high if np.isfinite(high) else max(reach, low + 2 * reach)
    return low, high
