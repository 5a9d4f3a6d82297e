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
from ..solve.conditions import Condition
from ..solve.result import Result, components_mm
from ..surfaces.surface import Axes, Surface

_NO_NET = (
    "the edges have no tension and the fibres no bending stiffness: compressed fibres "
    "buckle in the plane of the ply, and the state differs from the kinematic net"
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
