"""What a tool asks of a ply, told before the ply is draped.

Fibres that do not stretch lie on a tool as a kinematic net does: how far it shears
follows from the curvature of the tool.  At the corner of a box the whole right angle
of curvature is in one place, and no net lies around it.  Load steps become tiny there.
"""

import logging

import numpy as np
from numpy import ndarray

from ...drape import Axes
from ...drape.kinematic_net import FoldedNetError, NetError
from ...solve.surface import OnSurface
from ..common.net_over import CELLS, net_over

log = logging.getLogger(__name__)

# Shear angle of a net in degrees, and its change over the length of an element, above
# which both together are told.  Measured with 6 to 32 elements along the ply: beyond
# the corners of boxes with walls of 45°, 67° and 78° nets shear by 21°, 52° and 72°,
# with changes of 11° to 24°, 33° to 54° and 51° to 77°.  Under tension 16×16 elements
# get over the second in short load steps and 8×8 do not.  Over a sphere nets shear by
# up to 72°; where it is more than 45° changes are 28° at most.
_MOST_SHEAR, _MOST_CHANGE = 45.0, 30.0

# No tension or stiffness mends it.  Rounding a corner spreads its curvature and leaves
# the shear beyond it as it is.
_ADVICE = (
    "The load steps may become tiny and the run may stop: let the ply end before that "
    "corner, or drape it in parts"
)


def tell_of_net(
    on_tool: OnSurface, X: ndarray, angles: tuple[float, float], axes: Axes
) -> None:
    """Warn of a tool on which a net folds, or shears far at a corner.

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
        net = net_over(X, on_tool, 1.0, angles)
    except FoldedNetError as error:
        log.warning(
            "drape: fibres that do not stretch cannot lie on this tool: their net "
            "folds at (%s). %s",
            _said(axes, error.place),
            _ADVICE,
        )
        return
    except NetError:  # its first threads leave the surface, which tells of no fold
        return
    shear = np.degrees(net.shear_angle())
    cell = np.ptp(X, axis=1).max() / CELLS
    element = np.sqrt(np.ptp(X, axis=1).prod() / X.shape[1])
    over = max(1, round(float(element / cell)))
    change = max(
        np.nan_to_num(np.abs(shear[over:] - shear[:-over])).max(initial=0.0),
        np.nan_to_num(np.abs(shear[:, over:] - shear[:, :-over])).max(initial=0.0),
    )
    shear = np.nan_to_num(np.abs(shear))
    if shear.max() > _MOST_SHEAR and change > _MOST_CHANGE:
        i, j = np.unravel_index(shear.argmax(), shear.shape)
        place = net.positions[:, i : i + 2, j : j + 2].mean(axis=(1, 2))
        log.warning(
            "drape: fibres that do not stretch shear by %.0f degrees at (%s), for the "
            "curvature of this tool is at a corner. %s",
            shear.max(),
            _said(axes, place),
            _ADVICE,
        )


def _said(axes: Axes, place: ndarray) -> str:
    return ", ".join(f"{x:.4g}" for x in axes.of_tool(place[:, None])[:, 0])
