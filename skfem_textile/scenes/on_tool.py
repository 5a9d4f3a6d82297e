"""Figures of a ply that lies on a tool."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..drape import (
    Axes,
    Net,
    beyond_edges,
    bridging,
    contact_pressure,
    net,
    off_triangles,
    turn_of_normal,
    wrinkle_risk,
)
from ..ply import Ply
from ..solve.result import Result
from ..solve.surface import OnSurface, Surface

#: Cells of a net over the longer side of the ply.  Chosen: directions of its threads at
#: the edges are off by 1e-4.
CELLS = 64


def net_over(
    points: ndarray,
    on_tool: OnSurface,
    t: float,
    angles: tuple[float, float],
    beyond: int = 0,
) -> Net:
    """A net that reaches up to points of a ply, or beyond them.

    Parameters
    ----------
    points
        Points of the flat ply in mm, shape (2, n).
    on_tool, t
        The surface, and the load factor to which it has grown.
    angles
        Inclination of warp and weft at rest in radians.
    beyond
        Cells that it reaches beyond them.

    Raises
    ------
    ValueError
        As from `net`.
    """
    cell = float(np.ptp(points, axis=1).max()) / CELLS
    flat, touch = np.array([np.cos(angles), np.sin(angles)]), on_tool.touch
    ends = np.linalg.solve(flat, points - np.array(touch)[:, None]) / cell
    further = [[[i], [j]] for i in (-beyond, beyond) for j in (-beyond, beyond)]
    over = np.hstack([ends + np.array(step) for step in further])
    reach = np.array([np.maximum(-over.min(axis=1), 0), over.max(axis=1)])
    warp, weft = np.ceil(reach).astype(int).T.tolist()
    return net(
        *(on_tool.at("tool", t), cell, tuple(warp), tuple(weft)),
        angles=angles,
        touch=touch,
        over=cell * flat @ over + np.array(touch)[:, None],
    )


_NO_NET = (
    "nothing pulls the edges, and fibres do not resist bending: where fibres are "
    "compressed they buckle in the plane of the ply, and the state is not the net"
)

# Turn of the tool's normal over an element in degrees from which a mesh is coarse.
# Measured on boxes and domes with walls of 50° and fillets of 6 to 60 mm, against
# elements of a quarter of the size: up to 27° all shear angles are within 0.9°, from
# 36° to 50° the largest errors are 0.4° to 2.9°
# (`pytest tests/drape/test_coarse_elements.py` has one of each).
_COARSE = 30.0


# Force of a node that holds a ply over all forces on its edges, from which it is told.
# Measured with 8×8 elements: up to 0.008 where tool and fibres have planes of symmetry,
# 0.012 to 0.047 elsewhere.
_HOLDS = 0.01


def measured_on_tool(
    result: Result, axes: Axes, holding: Sequence[str] = ()
) -> dict[str, float | str]:
    """Where the shear is largest, contact pressures, shares of the ply's area, advice.

    Places are in the axes of the tool, among which ``axes`` are those of the ply;
    ``holding`` are conditions on single nodes that keep it from sliding.
    Empty of a ply that is on no tool.
    """
    ply, state = result.ply, result.states[-1]
    u, t = state.u, state.load_factor
    surface = result.tool(t)
    if surface is None:
        return {}
    found = _Found(
        contact_pressure(ply, surface, u, t, state.parameters),
        np.degrees(turn_of_normal(ply, surface, u)),
        beyond_edges(ply, surface, u),
    )
    figures, advice = _figures(result, found), _advice(result, surface, found)
    held = _held(result, holding) if holding else {}
    return {**_places(result, axes), **figures, **held, **advice}


class _Found(NamedTuple):
    """Pressures at nodes, and of each element the turn and whether it is beyond."""

    pressure: ndarray
    turn_deg: ndarray
    beyond: ndarray | None


def _places(result: Result, axes: Axes) -> dict[str, float]:
    """Where the ply touches the tool at first, and where it shears most."""
    ply, u = result.ply, result.u
    sheared = np.abs(ply.shear_angle(u)).max(axis=1).argmax()
    corners = ply.mesh.t[:, sheared]
    x = np.pad(ply.nodes, ((0, 1), (0, 0))) + ply.nodal(u)
    place = axes.of_tool(x[:, corners].mean(axis=1, keepdims=True))[:, 0]
    return {
        f"{what}_at_{axis}_mm": at
        for what, point in (("touches", axes.origin), ("max_shear_angle", place))
        for axis, at in zip("xyz", point.tolist(), strict=True)
    }


def _figures(result: Result, found: _Found) -> dict[str, float]:
    ply, u, pressure = result.ply, result.u, found.pressure
    at_risk = wrinkle_risk(ply, u, result.states[-1].parameters)
    figures = {
        "max_contact_pressure_N_per_mm2": float(pressure.max()),
        "min_contact_pressure_N_per_mm2": float(pressure.min()),
        "bridging_share_of_area": _share(ply, bridging(ply, u, pressure)),
        "wrinkle_risk_share_of_area": _share(ply, at_risk),
        "max_turn_of_normal_deg": float(found.turn_deg.max()),
    }
    if found.beyond is not None:
        figures["beyond_tool_share_of_area"] = _share(ply, found.beyond)
    return figures


def _advice(result: Result, surface: Surface, found: _Found) -> dict[str, str]:
    """What keeps figures from being true, and what to do."""
    ply, u, (pressure, turn, beyond) = result.ply, result.u, found
    advice: dict[str, str] = {}
    if beyond is not None and beyond.any():
        advice["beyond_tool"] = (
            f"{100 * _share(ply, beyond):.3g} % of the ply is beyond the edges of the "
            "tool, or over its holes, where its surface is a guess: trim there, or "
            "take a smaller ply or a larger tool"
        )
    off = off_triangles(ply, surface, u)
    if off is not None and off.any():
        advice["off_triangles"] = (
            f"under {100 * _share(ply, off):.3g} % of the ply the smoothed tool is off "
            "its triangles by more than a tenth of their mean edge: give one side of a "
            "shell, and triangles that are about as long as wide"
        )
    if (coarse := turn > _COARSE).any():
        advice["coarse_elements"] = (
            f"the normal of the tool turns by up to {turn.max():.0f} degrees over one "
            f"element, by more than {_COARSE:.0f} under {100 * _share(ply, coarse):.3g}"
            " % of the ply: shear angles may be off by up to 3 degrees near its edges "
            f"and fillets, take elements of {_COARSE / turn.max():.0%} of the size "
            "there"
        )
    if surface.gradient(np.zeros((3, 1)))[2, 0] < 0:
        advice["faces_away"] = (
            "the tool faces down where the ply touches it: turn its triangles round if "
            "the ply lies above it, for pressures have the other sign now"
        )
    elif (pressure < 0).all():
        advice["faces_away"] = (
            "the tool would have to pull everywhere: turn its triangles round if the "
            "ply lies on its other side"
        )
    if not (any(map(np.any, ply.fabric.bending)) or _load(result).any()):
        advice["not_the_net"] = _NO_NET
    return advice


def _held(result: Result, holding: Sequence[str]) -> dict[str, float | str]:
    """The largest force of a node that holds the ply, and what follows of it."""
    state, ply = result.states[-1], result.ply
    force = max(float(np.linalg.norm(state.reactions[name])) for name in holding)
    held: dict[str, float | str] = {"max_holding_force_N": force}
    load = ply.nodal(_load(result))
    if 0 < _HOLDS * np.linalg.norm(load, axis=0).sum() < force:
        held["held_askew"] = (
            f"a node that keeps the ply from sliding carries {force:.3g} N, for the "
            "tensions of the edges do not balance on this tool: shear near it is of "
            "this force, and grows as elements become smaller; let the ply touch where "
            "the tool is symmetric, or take no tension and fibres that resist bending"
        )
    return held


def _load(result: Result) -> ndarray:
    """Nodal forces of the loads in N, in the last state."""
    state = result.states[-1]
    return result.ply.load(state.u, state.load_factor, state.parameters)


def _share(ply: Ply, elements: ndarray) -> float:
    """Share of the area of a ply that some of its elements have."""
    area = np.abs(ply.basis.mapping.detDF(ply.centre))[:, 0]
    return float(area[elements].sum() / area.sum())
