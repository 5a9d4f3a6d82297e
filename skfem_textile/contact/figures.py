"""Figures of a formed ply for summaries, and advice."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.recovery import nodes_and_normal
from ..ply import Ply
from ..solve.quantities import IN_SPACE, LOST, Quantity
from ..solve.result import Result, components_mm
from ..solve.states import State
from .gaps import (
    SmallestGap,
    nodes_in_contact,
    smallest_gap,
    tool_force,
    tool_pressure,
    touching,
    turn_on_tool,
)
from .holder import HolderPressure, contacts, flat_thickness, pressing
from .motion import deepest
from .obstacle import ToolContact, ToolTerm
from .risks import COARSE, most_compressed, share_of_area, wrinkle_risk
from .shape import areal_weight, draw_in, fibre_curvature

# Angles in degrees to the x axis of the flat ply at which the draw-in is listed.
_RAYS = (0, 45, 90)

# Ends of the columns of `tool_history` in the table of phases, and digits of a share.
_TABLED = ("_travel_mm", "_rotation_deg", "_force_N", "_distance_mm")
_DIGITS = 9

# Cosine of an angle between the motion of a tool and the normal of a holder below which
# the motion is along the holder.  Chosen: between the two motions that occur, at right
# angles to the holder with a cosine of 1 and along it with 0, from which the normals of
# smooth triangles deviate by a few degrees.
_PARALLEL = 0.5

# Relative difference of motions that is round-off.
_ROUND_OFF = 1e-9


def formed(result: Result) -> dict[str, Any]:
    """Figures of the last state of a ply between tools in N, mm and degrees; advice.

    For each tool the last row of `tool_history`; ``NAME_energy_lost_error``, the
    estimated error of the work of sliding in N·mm, with friction (`Friction.errors`);
    ``NAME_force_N_half_width``, if there is an error interval;
    ``NAME_force_on_whole_ply_N`` with its half-width, if a half or quarter of the ply
    is computed; and, except for holders with a prescribed pressure,
    ``NAME_penetration_mm``, the largest depth of the ply in the tool between nodes
    (`smallest_gap`).  Places are in the axes ``stated`` by the tools.  Of the ply the
    draw-in, the areal weight relative to the flat ply (`areal_weight`), risks, and
    ``energy_lost_on_whole_ply`` in N·mm, if a half or quarter is computed.
    ``first`` declares the figures that are printed first.

    Parameters
    ----------
    result
        Result of a run.  One that stopped is described at the travel that it reached;
        ``not_formed`` states it.

    Returns
    -------
    dict
        Empty for a ply without tools.
    """
    ply, state = result.ply, result.states[-1]
    tools = contacts(ply)
    if not tools:
        return {}
    of_stack = hasattr(ply, "plies")  # whose plies have their own figures
    of_one = hasattr(ply.basis, "layers") and not of_stack  # others may touch
    gaps = {x.name: smallest_gap(ply, x, state.u, state.load_factor) for x in tools}
    inside = _deepest(tools, gaps)
    turn = np.degrees(np.max([turn_on_tool(ply, x, state) for x in tools], axis=0))
    at_risk = wrinkle_risk(ply, state.u, state.parameters)
    most = most_compressed(ply, state.u, state.parameters)
    stated = tools[0].stated
    return {
        **_of_tools(result, tool_history(result)),
        **{
            f"{name}_penetration_mm": max(-least.gap, 0.0) if least else 0.0
            for name, least in gaps.items()
        },
        **inside,
        **({} if of_stack else _draw_in(ply, state.u) | _areal_weight(ply, state.u)),
        **_curvature(ply, state, tools),
        "wrinkle_risk_share_of_area": share_of_area(ply, at_risk),
        **result.place_of(most, "wrinkle_risk_at", stated),
        "max_turn_of_normal_deg": float(turn.max()),
        **(_untouched(result) if result.converged and not of_one else {}),
        **_advice(result, tools, turn, at_risk),
        "first": [quantity.declared() for quantity in _first(result, inside)],
    }


# Cosine of the angle between two planes that is round-off: they are at right angles.
_ACROSS = 1e-6

#: Computed part of a ply by the number of its mirror images.
PARTS = {2: "half", 4: "quarter"}

# Key of the energy lost on the whole ply, if a half or quarter is computed.
_LOST_ON_WHOLE_PLY = f"{LOST.key}_on_whole_ply"

# Texts among the figures.
_NOTES = "not_formed", "untouched_tools", "coarse_elements", "wrinkles"


def _first(result: Result, depth: Mapping[str, float | str]) -> list[Quantity]:
    """Figures that are printed first; of the tool that reaches deepest."""
    ply, name = result.ply, driven_tool(result)
    parts, of = mirror_images(ply), name.replace("_", " ").capitalize()
    inside = depth.get("max_penetration_tool")
    key, note, lost = f"{name}_force_N", "", []
    if parts in PARTS:
        key = f"{name}_force_on_whole_ply_N"
        note = f" on the whole ply, {parts} times that on the computed {PARTS[parts]}"
        if result.states[-1].energy_lost:
            lost = [LOST._replace(key=_LOST_ON_WHOLE_PLY, note=note)]
    return [
        Quantity(f"{of} force", key, "N", has_interval=True, note=note),
        Quantity(f"{of} travel", f"{name}_travel_mm", "mm"),
        Quantity(  # printed if it is in the summary
            *("Largest draw-in", "max_draw_in_mm", "mm", "max_draw_in_at_flat"),
            at=" in the flat ply at",
        ),
        Quantity(
            *("Largest penetration", "max_penetration_mm", "mm", "max_penetration_at"),
            note=f" into the tool {inside!r}" if inside else "",
        ),
        *lost,
        *(Quantity("Note", key) for key in _NOTES),
    ]


def mirror_images(ply: Ply) -> int:
    """Number of mirror images of a ply that make up the whole ply.

    1 without planes; 2 for one plane, and 4 for two at right angles; 0 if the copies do
    not fit together.
    """
    planes = [
        ply.mesh.boundaries[x] for x, end in ply.fibre_ends.items() if end == "mirror"
    ]
    normals = [nodes_and_normal(ply.mesh, edges)[1] for edges in planes]
    if len(normals) == 2 and abs(normals[0] @ normals[1]) > _ACROSS:
        return 0
    return {0: 1, 1: 2, 2: 4}.get(len(normals), 0)


def _of_tools(result: Result, history: Mapping[str, ndarray]) -> dict[str, float]:
    """Last row of a history, half-widths of the forces, and forces on the whole ply.

    The latter in N, and the energy lost, if only a half or quarter of the ply is
    computed.
    """
    figures = {name: column[-1].item() for name, column in history.items()}
    for tool in pressing(result.ply):
        if tool.friction:
            errors = tool.friction.errors(tool, result.states)
            figures[f"{tool.name}_energy_lost_error"] = float(errors.sum())
    directions, known = _directions(result), result.error.reactions
    names = [*directions]
    for name, along in directions.items():
        if name in known:
            figures[f"{name}_force_N_half_width"] = float(np.abs(along) @ known[name])
    parts = mirror_images(result.ply)
    for name in names if parts in PARTS else ():
        for end in ("", "_half_width"):
            if (key := f"{name}_force_N{end}") in figures:
                figures[f"{name}_force_on_whole_ply_N{end}"] = parts * figures[key]
    if parts in PARTS and (lost := result.states[-1].energy_lost):
        figures[_LOST_ON_WHOLE_PLY] = parts * sum(lost.values())
    return figures


def tool_history(result: Result) -> dict[str, ndarray]:
    """Figures of each tool over the states of a run, columns of shape (n_states,).

    ``NAME_travel_mm``, see `travels`; ``NAME_rotation_deg``, if the tool turns, the
    angle from its initial position; ``NAME_force_N``, see `tool_forces`;
    ``NAME_nodes_in_contact``, the number of nodes on which the tool presses;
    ``NAME_max_pressure_N_per_mm2``, the largest `tool_pressure`; and, for a holder with
    a force, ``NAME_distance_mm``, its distance from the surface.

    Parameters
    ----------
    result
        Result of a run.

    Returns
    -------
    dict
        Empty for a ply without tools.
    """
    ply, states = result.ply, result.states
    tools = pressing(ply)
    columns: dict[str, ndarray] = {}
    if not tools:
        return {}
    far, forces = travels(result), tool_forces(result)
    for tool in tools:
        pressure = [tool_pressure(ply, tool, state).max() for state in states]
        touched = [nodes_in_contact(tool, state) for state in states]
        turned = np.degrees([tool.rotation(state.load_factor) for state in states])
        columns |= {
            f"{tool.name}_travel_mm": far[tool.name],
            **({f"{tool.name}_rotation_deg": turned} if turned.any() else {}),
            f"{tool.name}_force_N": forces[tool.name],
            f"{tool.name}_nodes_in_contact": np.array(touched),
            f"{tool.name}_max_pressure_N_per_mm2": np.array(pressure),
        }
        if "distance" in states[-1].parameters[tool.name]:
            distance = [state.parameters[tool.name]["distance"] for state in states]
            columns[f"{tool.name}_distance_mm"] = np.array(distance)
    return columns


def phase_table(result: Result, process: Any) -> list[dict[str, Any]]:
    """Figures at the ends of phases, a row each.

    ``phase``, its name; ``share``, the share of it that is completed, 1 except in the
    last state of a run that stopped early; ``load_factor``; of each tool
    ``NAME_travel_mm``, ``NAME_force_N`` and so on, see `tool_history`; of each clamp
    ``NAME_force_N``;
    ``recovered_max_shear_angle_deg``, as in the summary; ``max_draw_in_mm``;
    ``wrinkle_risk_share_of_area``; and ``energy_lost`` in N·mm, by friction and by
    laws, if any is lost.

    Parameters
    ----------
    result
        Result of a run of the process.
    process
        The `Process`.
    """
    ply, history, rows = result.ply, tool_history(result), []
    columns = {k: x for k, x in history.items() if k.endswith(_TABLED)}
    for i in process.at_ends(result):
        state = result.states[i]
        t, u, name = state.load_factor, state.u, process.phase_at(state.load_factor)
        risk = wrinkle_risk(ply, u, state.parameters)
        share = (t - process.begin(name)) * len(process.phases)
        row: dict[str, Any] = {
            "phase": name,
            "share": round(share, _DIGITS),
            "load_factor": t,
            **{key: column[i].item() for key, column in columns.items()},
            **result.clamp_forces(state),
            IN_SPACE.key: float(np.degrees(ply.largest_shear_angle(u))),
            "max_draw_in_mm": float(draw_in(ply, u).inwards.max()),
            "wrinkle_risk_share_of_area": share_of_area(ply, risk),
        }
        if state.energy_lost:
            row["energy_lost"] = sum(state.energy_lost.values())
        rows.append(row)
    return rows


def travels(result: Result) -> dict[str, ndarray]:
    """Distance of each tool from its initial position in mm, by name, (n_states,)."""
    factors = [state.load_factor for state in result.states]
    return {
        x.name: np.array([travel(x, t) for t in factors]) for x in pressing(result.ply)
    }


def tool_forces(result: Result) -> dict[str, ndarray]:
    """Force of each tool on the ply in N, by name, shape (n_states,).

    The component along the motion of the `driven_tool`, so that the forces of opposite
    tools have opposite signs; along z if it does not travel.  Of a holder the component
    along the direction in which it presses, positive if it presses.

    Raises
    ------
    ValueError
        If the ply has no tools.
    """
    ply, states, directions = result.ply, result.states, _directions(result)
    return {
        x.name: np.array(
            [tool_force(ply, x, state) @ directions[x.name] for state in states]
        )
        for x in pressing(ply)
    }


def driven_tool(result: Result) -> str:
    """Name of the tool that reaches deepest beyond the plane of the flat ply.

    In the whole run, also if the result ends earlier.  The one that travels farthest if
    none moves beyond the plane.
    """
    return _deepest_tool(result)[0].name


def last_closed(result: Result) -> int:
    """Index of the last state before tools open.

    In which the `driven_tool` is deepest beyond the plane of the flat ply; of several
    the last one in which the tools have moved furthest towards it in total.
    """
    driven, _ = _deepest_tool(result)
    obstacles = [x._obstacle for x in contacts(result.ply)]
    factors = [state.load_factor for state in result.states]
    depth = np.array([driven._obstacle.depth(t) for t in factors])
    closed = np.array([sum(x.closed(t) for x in obstacles) for t in factors])
    least = _ROUND_OFF * max(np.abs(depth).max(), np.abs(closed).max())
    deep = depth >= depth.max() - least
    return int(np.flatnonzero(deep & (closed >= closed[deep].max() - least))[-1])


def _deepest_tool(result: Result) -> tuple[ToolTerm, float]:
    """The `driven_tool`, and the load factor at which it is deepest."""
    tools: Sequence[ToolTerm] = contacts(result.ply) or pressing(result.ply)
    if not tools:
        raise ValueError("the ply has no tools or holders, and so no tool forces")
    number, t = deepest([x._obstacle for x in tools])
    return tools[number], t


def _directions(result: Result) -> dict[str, ndarray]:
    """Directions of `tool_forces`, by the name of the tool."""
    tool, t = _deepest_tool(result)
    travelled = tool.travel(t)
    length = float(np.linalg.norm(travelled))
    along = travelled / length if length > 0 else np.array([0.0, 0.0, 1.0])
    found = {}
    for x in pressing(result.ply):
        normal, _ = x._obstacle.at_rest
        presses = float(normal @ along) if x._obstacle.reach else 1.0
        parallel = abs(presses) > _PARALLEL or not normal.any()
        found[x.name] = np.copysign(1.0, presses) * along if parallel else normal
    return found


def travel(tool: ToolTerm, t: float) -> float:
    """Distance of a tool from its initial position at a load factor, in mm."""
    return float(np.linalg.norm(tool.travel(t)))


def _deepest(
    tools: Sequence[ToolContact], gaps: dict[str, SmallestGap | None]
) -> dict[str, float | str]:
    """Deepest penetration in mm; its tool, place and element, if there is one."""
    inside = {name: x for name, x in gaps.items() if x is not None and x.gap < 0}
    if not inside:
        return {"max_penetration_mm": 0.0}
    name, most = min(inside.items(), key=lambda item: item[1].gap)
    at = tools[0].stated(most.place[:, None])[:, 0]
    return {
        "max_penetration_mm": -most.gap,
        "max_penetration_tool": name,
        **components_mm("max_penetration_at", at),
        "max_penetration_element": most.element,
    }


def _draw_in(ply: Ply, u: ndarray) -> dict[str, float]:
    """Largest draw-in, its place in the flat ply, and the draw-in on rays."""
    drawn = draw_in(ply, u)
    most = int(drawn.inwards.argmax())
    x, y = drawn.x[:, most].tolist()
    figures = {
        "max_draw_in_mm": float(drawn.inwards[most]),
        "max_draw_in_at_flat_x_mm": x,
        "max_draw_in_at_flat_y_mm": y,
        "min_draw_in_mm": float(drawn.inwards.min()),
    }
    for angle in _RAYS:
        on_ray = drawn.at(np.radians(angle))
        if on_ray is not None:
            figures[f"draw_in_at_{angle}_deg_mm"] = on_ray
    return figures


def _areal_weight(ply: Ply, u: ndarray) -> dict[str, float]:
    """Largest and smallest areal weight relative to the flat ply.

    If a tool states the thickness of the ply also its largest and smallest thickness at
    constant fibre volume fraction.
    """
    ratio, thickness = areal_weight(ply, u), flat_thickness(ply)
    fields = {"areal_weight_ratio": ratio}
    if thickness:
        fields["thickness_at_constant_fibre_fraction_mm"] = thickness * ratio
    figures: dict[str, float] = {}
    for name, field in fields.items():
        figures[f"max_{name}"] = float(field.max())
        figures[f"min_{name}"] = float(field.min())
    return figures


def _curvature(
    ply: Ply, state: State, tools: Sequence[ToolContact]
) -> dict[str, float]:
    """Largest curvature of fibres with bending stiffness off all tools."""
    free = ~np.any([touching(ply, x, state) for x in tools], axis=0)
    bent = np.flatnonzero(ply.fabric.bent)
    if not bent.size or not free.any():
        return {}
    curvature = np.abs(fibre_curvature(ply, state.u)[bent]).max(axis=0)
    return {"max_fibre_curvature_off_tools_per_mm": float(curvature[free].max())}


def _untouched(result: Result) -> dict[str, str]:
    """Tools without friction, of which a warning says it, that touch in no state."""
    away = [
        tool.name
        for tool in pressing(result.ply)
        if not tool.friction
        and not any(nodes_in_contact(tool, state) for state in result.every_state)
    ]
    if not away:
        return {}
    never = f"no state touches {', '.join(map(repr, away))}"
    return {"untouched_tools": f"{never}: check position, motion and unit of length"}


def _advice(
    result: Result, tools: Sequence[ToolContact], turn: ndarray, at_risk: ndarray
) -> dict[str, str]:
    """Limitations of the results, and advice; ``turn`` is in degrees."""
    ply, t = result.ply, result.states[-1].load_factor
    advice: dict[str, str] = {}
    if not result.converged:
        stands = [(x.name, travel(x, t), travel(x, 1.0)) for x in tools]
        where = ", ".join(
            f"{name} {far:.4g} of {end:.4g} mm" if end > far else f"{name} {far:.4g} mm"
            for name, far, end in stands
            if far or end
        )
        advice["not_formed"] = (
            f"the run stopped at load factor {t:.4g}: the figures describe the ply "
            f"there, with the tools where they stand then ({where or 'none moves'})"
        )
    if (coarse := turn > COARSE).any():
        advice["coarse_elements"] = (
            f"the normal of a tool rotates by up to {turn.max():.0f} degrees over one "
            f"element, and by more than {COARSE:.0f} degrees at "
            f"{100 * share_of_area(ply, coarse):.3g} % of the ply, so that the ply "
            "penetrates the tool between nodes: use elements of "
            f"{COARSE / turn.max():.0%} of the size at fillets"
        )
    if at_risk.any():
        advice["wrinkles"] = (
            f"fibres are compressed in {100 * share_of_area(ply, at_risk):.3g} % of "
            "the ply: they may wrinkle, and wrinkles depend on the mesh. "
            f"{_against_wrinkles(ply)}"
        )
    return advice


def _against_wrinkles(ply: Ply) -> str:
    """Advice by what the holders of a ply state."""
    advice = []
    for tool in pressing(ply):
        if isinstance(tool, HolderPressure):
            advice.append(f"increase the {tool.presses_by} of the holder")
        elif tool._obstacle.reach:
            advice.append("reduce the gap of the holder")
    both = [*dict.fromkeys(advice or ["add a holder"])]
    text = f"{', '.join(both)}, or increase the tension at the edges"
    return text[:1].upper() + text[1:]
