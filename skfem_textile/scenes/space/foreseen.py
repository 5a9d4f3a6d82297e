"""What a tool asks of a ply, told before the ply is draped.

Fibres that do not stretch lie on a tool as a kinematic net does: how far it shears
follows from the curvature of the tool.  At the corner of a box the whole right angle
of curvature is in one place, and no net lies around it.  Load steps become tiny there.
"""

import logging

import numpy as np
from numpy import ndarray

from ...drape import Axes
from ...drape.kinematic_net import NetError
from ...solve.conditions import OnSurface
from .edge_tension import net_over

log = logging.getLogger(__name__)

# Shear angle of a net in degrees above which it is told.  Measured: with the walls of a
# box at 45°, 67° and 78° nets shear by 21°, 52° and 72° beyond its corners.  Under
# tension a ply of 16×16 elements gets over the first, and over none of the others.
_MOST_SHEAR = 45.0

# Rounding a corner spreads its curvature and leaves the shear beyond it as it is.
_FOLDS = "let the ply end before that corner, or drape it in parts"
_SHEARS = (
    "let the ply end before that corner, take walls that are less steep, or elements "
    "much smaller than the corner and a start from a net (equilibrium_near)"
)


def tell_of_net(
    on_tool: OnSurface, X: ndarray, angles: tuple[float, float], axes: Axes
) -> None:
    """Warn of a tool on which a net folds, or shears far.

    Parameters
    ----------
    on_tool
        The tool.
    X
        Nodes of the flat ply in mm, shape (2, n).
    angles
        Inclination of warp and weft at rest in radians.
    axes
        Axes of the ply among those of the tool, in which places are told.
    """
    try:
        net = net_over(X, on_tool, 1.0, angles, beyond=0)
    except NetError as error:
        log.warning(
            "drape: fibres that do not stretch cannot lie on this tool: their net "
            "folds at (%s). The load steps may become tiny and the run may stop: %s",
            _said(axes, error.place),
            _FOLDS,
        )
        return
    shear = np.degrees(np.abs(np.nan_to_num(net.shear_angle())))
    if shear.max() > _MOST_SHEAR:
        i, j = np.unravel_index(shear.argmax(), shear.shape)
        place = net.positions[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
        log.warning(
            "drape: the curvature of this tool makes fibres that do not stretch shear "
            "by %.0f degrees at (%s). The load steps may become tiny: %s",
            shear.max(),
            _said(axes, place),
            _SHEARS,
        )


def _said(axes: Axes, place: ndarray) -> str:
    return ", ".join(f"{x:.4g}" for x in axes.of_tool(place[:, None])[:, 0])
