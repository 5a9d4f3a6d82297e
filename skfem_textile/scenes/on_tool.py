"""Results of a ply on a tool."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..contact.risks import (
    COARSE,
    beyond_edges,
    bridging,
    contact_pressure,
    off_triangles,
    share_of_area,
    turn_of_normal,
)
from ..nets.crossings import Net
from ..nets.kinematic_net import net
from ..solve.conditions import Condition
from ..solve.on_surface import OnSurface
from ..solve.quantities import Quantity
from ..solve.result import Result, components_mm
from ..surfaces.surface import Axes, Surface

#: Number of cells of a net along the longer side of the ply.  Chosen: the error of the
#: thread directions at the edges is 1e-4.
CELLS = 64


def net_over(
    points: ndarray,
    on_tool: OnSurface,
    angles: tuple[float, float],
    beyond: int = 0,
) -> Net:
    """Net that covers the points of a ply.

    Parameters
    ----------
    points
        Points of the flat ply in mm, shape (2, n).
    on_tool
        The surface.
    angles
        Inclination of warp and weft at rest in radians.
    beyond
        Number of cells beyond the points.

    Raises
    ------
    ValueError
        See `net`.
    """
    cell = float(np.ptp(points, axis=1).max()) / CELLS
    flat, touch = np.array([np.cos(angles), np.sin(angles)]), on_tool.touch
    ends = np.linalg.solve(flat, points - np.array(touch)[:, None]) / cell
    further = [[[i], [j]] for i in (-beyond, beyond) for j in (-beyond, beyond)]
    over = np.hstack([ends + np.array(step) for step in further])
    reach = np.array([np.maximum(-over.min(axis=1), 0), over.max(axis=1)])
    warp, weft = np.ceil(reach).astype(int).T.tolist()
    return net(
        *(on_tool.surface, cell, tuple(warp), tuple(weft)),
        angles=angles,
        touch=touch,
        over=cell * flat @ over + np.array(touch)[:, None],
        past_edges=True,
    )


_NO_NET = (
    "the edges have no tension and the fibres no bending stiffness: compressed fibres "
    "buckle in the plane of the ply, and the state differs from the kinematic net"
)


#: Figures of `measured_on_tool` that are printed first.
FIRST_ON_TOOL = (
    Quantity(
        *("Largest tool pressure", "max_contact_pressure_N_per_mm2", "N/mm²"),
        has_interval=True,
    ),
    Quantity("Bridging", "bridging_share_of_area", "%", note=" of the area"),
    *(
        Quantity("Note", key)
        for key in (
            *("not_on_tool", "beyond_tool", "off_triangles", "coarse_elements"),
            *("faces_away", "not_the_net"),
        )
    ),
)


def measured_on_tool(
    result: Result, axes: Axes, holding: Mapping[str, Condition]
) -> dict[str, float | str]:
    """Contact point, contact pressures, area fractions of defects, and advice.

    The contact point is in the axes of the tool; ``axes`` are the axes of the ply
    relative to the tool; ``holding`` are conditions on single nodes that prevent
    sliding.  Empty for a ply that is not on its tool.
    """
    ply, state = result.ply, result.states[-1]
    u, surface = state.u, result.tool(1.0)
    if surface is None or result.not_on_tool:
        return {}
    measured = _Measured(
        contact_pressure(ply, surface, u, 1.0, state.parameters),
        np.degrees(turn_of_normal(ply, surface, u)),
        beyond_edges(ply, surface, u),
    )
    figures, advice = _figures(result, measured), _advice(result, surface, measured)
    if holding:
        figures["max_holding_force_N"] = _holding_force(result, surface, holding)
    return {**components_mm("touches_at", axes.origin), **figures, **advice}


class _Measured(NamedTuple):
    """Pressures at nodes; rotation of the normal and masks by element."""

    pressure: ndarray
    turn_deg: ndarray
    beyond: ndarray | None


def _figures(result: Result, measured: _Measured) -> dict[str, float]:
    ply, u, pressure = result.ply, result.u, measured.pressure
    figures = {
        "max_contact_pressure_N_per_mm2": float(pressure.max()),
        "min_contact_pressure_N_per_mm2": float(pressure.min()),
        "bridging_share_of_area": share_of_area(ply, bridging(ply, u, pressure)),
        "max_turn_of_normal_deg": float(measured.turn_deg.max()),
    }
    if measured.beyond is not None:
        figures["beyond_tool_share_of_area"] = share_of_area(ply, measured.beyond)
    return figures


def _advice(result: Result, surface: Surface, measured: _Measured) -> dict[str, str]:
    """Limitations of the results, and advice."""
    ply, u, (pressure, turn, beyond) = result.ply, result.u, measured
    advice: dict[str, str] = {}
    if beyond is not None and beyond.any():
        advice["beyond_tool"] = (
            f"{100 * share_of_area(ply, beyond):.3g} % of the ply is beyond the edges "
            "of the tool or over its holes, where the surface of the tool is "
            "extrapolated: trim the ply there, or use a smaller ply or a larger tool"
        )
    off = off_triangles(ply, surface, u)
    if off is not None and off.any():
        advice["off_triangles"] = (
            f"under {100 * share_of_area(ply, off):.3g} % of the ply the smoothed tool "
            "deviates from its triangles by more than a tenth of their mean edge: use "
            "only one side of a shell, and triangles that are nearly equilateral"
        )
    if (coarse := turn > COARSE).any():
        advice["coarse_elements"] = (
            f"the normal of the tool rotates by up to {turn.max():.0f} degrees over "
            f"one element, and by more than {COARSE:.0f} degrees under "
            f"{100 * share_of_area(ply, coarse):.3g} % of the ply. The error of the "
            "shear angle may reach 3 degrees near edges and fillets of the tool: use "
            f"elements of {COARSE / turn.max():.0%} of the size there"
        )
    if surface.gradient(np.zeros((3, 1)))[2, 0] < 0:
        advice["faces_away"] = (
            "the tool faces down at the contact point of the ply, so that pressures "
            "have the opposite sign if the ply lies above it: in this case reverse the "
            "triangles of the tool"
        )
    elif (pressure < 0).all():
        advice["faces_away"] = (
            "the contact pressure is tensile everywhere: reverse the triangles of the "
            "tool if the ply lies on its other side"
        )
    if not (any(map(np.any, ply.fabric.bending)) or _load(result).any()):
        advice["not_the_net"] = _NO_NET
    return advice


def _holding_force(
    result: Result, surface: Surface, holding: Mapping[str, Condition]
) -> float:
    """Largest force along the tool of a node that prevents the ply from sliding."""
    state, ply = result.states[-1], result.ply
    forces = np.array([state.reactions[name] for name in holding]).T
    nodes = [at.nodes(name, ply.basis)[0] for name, at in holding.items()]
    x = ply.positions(state.u)[:, nodes]
    normal = surface.gradient(x) / np.linalg.norm(surface.gradient(x), axis=0)
    along = forces - (forces * normal).sum(axis=0) * normal
    return float(np.linalg.norm(along, axis=0).max())


def _load(result: Result) -> ndarray:
    """Nodal forces of the loads in N, in the last state."""
    state = result.states[-1]
    return result.ply.load(state.u, state.load_factor, state.parameters)
