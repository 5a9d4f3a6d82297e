"""Figures of the plies of a stack, and between them, for summaries."""

from typing import Any

import numpy as np

from ..solve.direction import TINY
from ..solve.quantities import Quantity
from ..solve.result import Result
from ..solve.states import State
from .risks import NO_FORCE
from .shape import areal_weight, draw_in


def between_plies(result: Result) -> dict[str, Any]:
    """Figures of the last state of a stack in N, mm and degrees.

    For each pair of plies on each other ``plies_1_and_2_force_N``, the sum of the
    normal forces; ``plies_1_and_2_max_gap_mm`` and ``plies_1_and_2_max_slip_mm`` where
    they face each other, see `Stack.gap`; ``plies_1_and_2_contact_share_of_area``, of
    the area where they do; and ``plies_1_and_2_energy_lost`` in N·mm, with friction.
    For each ply ``ply_1_recovered_max_shear_angle_deg``, ``ply_1_max_draw_in_mm``, and
    ``ply_1_max_areal_weight_ratio``.
    """
    stack: Any = result.ply
    figures, state = dict[str, Any](), result.states[-1]
    for contact in stack.contacts:
        figures |= _of_pair(stack, contact, state)
    for i, ply in enumerate(stack.with_tools, 1):
        u = stack.nodal(state.u)[:, stack.nodes_of(i)].T.ravel()
        angle = float(np.degrees(ply.largest_shear_angle(u)))
        figures |= {
            f"ply_{i}_recovered_max_shear_angle_deg": angle,
            f"ply_{i}_max_draw_in_mm": float(draw_in(ply, u).inwards.max()),
            f"ply_{i}_max_areal_weight_ratio": float(areal_weight(ply, u).max()),
        }
    first = []
    for title, end in (
        ("Largest gap", "_max_gap_mm"),
        ("Largest slip", "_max_slip_mm"),
        ("Largest draw-in", "_max_draw_in_mm"),
    ):
        most = max((k for k in figures if k.endswith(end)), key=figures.__getitem__)
        of = most.removesuffix(end).replace("_", " ")
        note = f" between {of}" if of.startswith("plies") else f" of {of}"
        first.append(Quantity(title, most, "mm", note=note).declared())
    return figures | {"first": first}


def _of_pair(stack: Any, contact: Any, state: State) -> dict[str, float]:
    """Figures of two plies on each other."""
    u, t, name = state.u, state.load_factor, contact.name.replace(" ", "_")
    force, gap = (
        contact.forces(u, t, state.parameters[contact.name]),
        contact.gaps(u, t),
    )
    faces, (low, high) = np.isfinite(gap), (1 + i for i in contact.between)
    area, slip = contact.areas, stack.slip(state, low, high)
    touches = force > NO_FORCE * force.max()
    share = area[touches & faces].sum() / max(area[faces].sum(), TINY)
    figures = {
        f"{name}_force_N": float(force.sum()),
        f"{name}_max_gap_mm": float(gap[faces].max(initial=0.0)),
        f"{name}_max_slip_mm": float(np.nan_to_num(slip).max()),
        f"{name}_contact_share_of_area": float(share),
    }
    if contact.name in state.energy_lost:
        figures[f"{name}_energy_lost"] = state.energy_lost[contact.name]
    return figures
