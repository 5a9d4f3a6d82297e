"""Checks of tools before a run: room for the ply between them, and contact with it."""

import logging
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise, permutations
from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.recovery import nodes_and_normal
from ..ply import Ply
from ..solve.contact_points import OPPOSITE
from ..solve.on_surface import SurfaceError
from .holder import HolderPressure, contacts, pressing
from .obstacle import Obstacle, ToolContact, ToolTerm, no_reach
from .outline import ROUND_OFF

log = logging.getLogger(__name__)

# Penetration relative to the size of the ply that is round-off, and most projections of
# a point onto a tool, which are exact to first order.
_FREE, _MOST = 1e-6, 20

# Travel relative to the size of the ply that is in another unit, and travel beyond the
# plane of the ply, relative to the size of the whole ply, that is a warning.  Chosen: a
# tool may come from far, but the ply follows from both sides.
_TOO_FAR, _FAR = 10.0, 0.5

# Number of intervals in which tools push points along, a limit of work: tools pass over
# no point if they move by less than their size in an interval.
_PUSHES = 4

# Number of intervals between the load factors of which contact is checked.  Tools that
# touch the ply move through its plane, and stay beyond it for longer.
_INTERVALS = 40

# Largest deviation of a tool from its mirror image, relative to the size of the ply,
# and to the mean edge of its triangles.  It is 0.015 mm of 150 mm, above the rounding
# of positions; the smooth surfaces of symmetric shapes with irregular triangles deviate
# by 0.06 of the edge around fillets of two edges, and by 0.12 around fillets of one.
_ASYMMETRIC, _OF_TRIANGLES = 1e-4, 0.2


def check_tools(ply: Ply, moved: float = 0.0) -> None:
    """Refuse tools that cross, touch nothing, or break the symmetry of the ply.

    Far travels, and friction that can be seen to have no effect, are warnings.
    `LoadStepper` calls it before each run.  Each tool pushes the nodes along from load
    factor 0 to 1.  A node that one tool pushes into another on the opposite side of the
    ply has no room, because the two tools cross.

    Parameters
    ----------
    ply
        Ply with tools; one without is valid.
    moved
        Largest displacement in mm that conditions prescribe.

    Raises
    ------
    ValueError
        If there is no room for a node, if the whole undeformed ply is behind the
        surface of a tool, if a tool is not symmetric about a plane of symmetry of the
        fibres (``fibre_ends``), or if nothing touches the ply: no tool at any load
        factor, and no load or condition moves the ply out of its plane.
        The message names the tools and, if there is no room, the node, its position and
        the penetration.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Ply, Tool, drape
    >>> from skfem_textile.contact.checks import check_tools
    >>> mesh = MeshQuad().refined(3).scaled(100.0)
    >>> tools = [
    ...     Tool(drape.Plane((0, 0, -1)), motion=(0, 0, 4), name="punch"),
    ...     Tool(drape.Plane((0, 0, 2)), name="die"),
    ... ]
    >>> check_tools(Ply(mesh, Fabric(1e4, 0.1), terms=tools, dimension=3))
    Traceback (most recent call last):
    ValueError: tools 'punch' and 'die' leave no room for the ply at load factor 1: ...
    """
    tools = contacts(ply)
    _refuse_travels(ply)
    _warn_of_friction(ply, moved)
    if not tools:
        return
    for tool in tools:
        if tool._obstacle.reach is None:  # holders may close from far away
            _refuse_behind(ply, tool)
    _refuse_asymmetric(ply, pressing(ply))
    if not (_pushed(ply, tools) or moved or _has_normal_load(ply, ply.terms)):
        _refuse_untouched(ply, tools)
    _warn_of_travels(ply, tools)


def _pushed(ply: Ply, tools: Sequence[ToolContact]) -> bool:
    """Refuse tools that cross; True if one of them pushes a node."""
    X, free = np.pad(ply.nodes, ((0, 1), (0, 0))), _FREE * _size(ply)
    x, normals = [X] * len(tools), [_normal(x) for x in tools]
    pairs = permutations(range(len(tools)), 2)
    opposite = [(i, j) for i, j in pairs if normals[i] @ normals[j] < OPPOSITE]
    touches = False
    for t in _load_factors(tools):
        pushed = [_pushed_out(*pair, t, free) for pair in zip(tools, x, strict=True)]
        x = [at for at, _ in pushed]
        touches |= any(nodes.size for _, nodes in pushed)
        for i, j in opposite:
            _refuse_crossing(tools[i], tools[j], X, *pushed[i], t, free)
    return touches


def _load_factors(tools: Sequence[ToolTerm], intervals: int = _PUSHES) -> list[float]:
    """Load factors between equal intervals, and at which amounts of tools bend."""
    equal = np.linspace(0, 1, intervals + 1).tolist()
    amounts = (amount for tool in tools for amount in tool.amounts)
    return sorted({*equal, *(t for amount in amounts for t in amount.load_factors)})


def _normal(tool: ToolContact) -> ndarray:
    """Initial normal of a tool at the nearest node; zero if it does not reach any."""
    normal, gap = tool._obstacle.at_rest
    return np.where(np.isfinite(gap), normal, 0.0)


def _pushed_out(
    tool: ToolContact, x: ndarray, t: float, free: float
) -> tuple[ndarray, ndarray]:
    """Project points inside a tool onto its surface; all points, numbers of these."""
    nodes = np.flatnonzero(tool.gaps_at(x, t) < -free)
    on_tool, gap, _ = _projected(tool._obstacle, x[:, nodes], t, free)
    x = x.copy()
    x[:, nodes] = on_tool
    return x, nodes[np.abs(gap) <= free]


def _projected(
    obstacle: Obstacle, x: ndarray, t: float, free: float
) -> tuple[ndarray, ndarray, ndarray]:
    """Newton iteration to zero gap; points, their remaining gaps and normals."""
    for _ in range(_MOST):
        gap, normal, *_ = obstacle.gaps(x, t)
        off = np.isfinite(gap) & (np.abs(gap) > free)
        if not off.any():
            break
        x = x - np.where(off, gap, 0.0) * normal
    return x, gap, normal


def _refuse_crossing(
    one: ToolContact,
    other: ToolContact,
    X: ndarray,
    x: ndarray,
    nodes: ndarray,
    t: float,
    free: float,
) -> None:
    """Refuse a tool that pushes nodes from X to x, inside another tool."""
    depth = np.maximum(-other.gaps_at(x[:, nodes], t), 0.0)
    if depth.max(initial=0.0) <= 2 * free:
        return
    node, most = int(nodes[depth.argmax()]), float(depth.max())
    raise ValueError(
        f"tools {one.name!r} and {other.name!r} leave no room for the ply at load "
        f"factor {t:g}: {one.name!r} pushes node {node}, at "
        f"{one._obstacle.place(X[:, node])} in the undeformed ply, {most:.3g} mm into "
        f"{other.name!r}: reduce the travel, enlarge the opening, or move the tools "
        "apart"
    )


def _refuse_untouched(ply: Ply, tools: Sequence[ToolContact]) -> None:
    """Refuse tools that reach the undeformed ply at no load factor."""
    found = [_approach(ply, tools, tool) for tool in tools]
    if min(found)[0] <= _FREE * _size(ply):
        return
    (gap, t), moved = min(found), [_furthest(tool) for tool in tools]
    closest = "all its nodes are beyond the edges or outlines of the tools"
    if np.isfinite(gap):
        nearest, mover = tools[found.index((gap, t))], tools[int(np.argmax(moved))]
        closest = f"the nearest is {nearest.name!r}, {gap:.3g} mm away at load factor "
        closest += f"{t:g}"
        if nearest is not mover and max(moved) > 0:
            away = found[int(np.argmax(moved))][0]
            closest += (
                f", and {mover.name!r}, which moves by {max(moved):.3g} mm, stays "
                f"{away:.3g} mm away"
            )
    raise ValueError(
        f"nothing touches the ply at any load factor: {closest}: check positions, "
        "units and motions of the tools"
    )


def _approach(
    ply: Ply, tools: Sequence[ToolTerm], tool: ToolContact
) -> tuple[float, float]:
    """Smallest gap between a tool and the undeformed ply, and its load factor.

    The first gap at which it touches the ply.
    """
    flat, nearest = ply.basis.zeros(), (np.inf, 0.0)
    for t in _load_factors(tools, _INTERVALS):
        nearest = min(nearest, (float(tool.gaps(flat, t).min(initial=np.inf)), t))
        if nearest[0] <= _FREE * _size(ply):
            break
    return nearest


def _furthest(tool: ToolTerm) -> float:
    """Largest travel of a tool in mm; without rotation, if its axis is not known."""
    factors = _load_factors([tool], _INTERVALS)
    known = hasattr(tool._obstacle.motion, "translation")
    moved = [tool.travel(t) for t in factors if known or not tool.rotation(t)]
    return float(np.linalg.norm(moved, axis=1).max())


def _refuse_travels(ply: Ply) -> None:
    """Refuse travels in another unit."""
    for tool in pressing(ply):
        if (travel := _furthest(tool)) > _TOO_FAR * _size(ply):
            raise ValueError(
                f"tool {tool.name!r} moves by {travel:.4g} mm, over {_TOO_FAR:g} times "
                f"the size of the ply, {_size(ply):.3g} mm: check its unit"
            )


def _warn_of_travels(ply: Ply, tools: Sequence[ToolContact]) -> None:
    """Warn of tools that push the ply far."""
    whole = _size(ply) * (2 if "mirror" in ply.fibre_ends.values() else 1)
    for tool in tools:
        pushed = max(map(tool._obstacle.depth, _load_factors(tools)))
        if pushed <= _FAR * whole or _approach(ply, tools, tool)[0] > _FREE * whole:
            continue
        text = (
            "tool %r pushes the ply by %.3g mm, over half of the size of the whole "
            "ply, %.3g mm, which has to follow: check its travel"
        )
        log.warning(text, tool.name, pushed, whole)


def _warn_of_friction(ply: Ply, moved: float) -> None:
    """Warn of friction of tools out of reach, and of holders that never press.

    Points of a ply rarely move further than its size, the supports and the tools.
    """
    tools = pressing(ply)
    for tool in tools:
        factors, what = _load_factors([tool], _INTERVALS), tool._obstacle.what
        if not any(map(tool.rubs, factors)):
            continue
        if isinstance(tool, HolderPressure):
            if not any(tool.amounts_at(t)[tool.presses_by] for t in factors):
                log.warning("friction of %s will have no effect: %s", what, tool.idle)
            continue
        others = (_furthest(x) for x in tools if x is not tool)
        reach = _size(ply) + moved + max(others, default=0.0)
        if all(_away(ply, tool, t) > reach for t in factors):
            away = min(_away(ply, tool, t) for t in factors)
            text = (
                "friction of %s will hardly have an effect: it stays %.3g mm away from "
                "the undeformed ply, further than the size of the ply and all motions: "
                "check its position, motion and unit of length"
            )
            log.warning(text, what, away)


def _away(ply: Ply, tool: Any, t: float) -> float:
    """Distance of a contact from the undeformed ply; beyond edges of a bounding box."""
    gaps, obstacle = tool.gaps(ply.basis.zeros(), t), tool._obstacle
    beyond, ends = ~np.isfinite(gaps), obstacle.outline
    if facets := getattr(obstacle.surface, "facets", None):
        ends = facets.points
    gaps[beyond] = 0.0  # unknown
    if ends is not None:
        rotation, translation = obstacle.placement(t)
        x = rotation.T @ (obstacle.X[:, beyond] - translation[:, None])
        low, high = (of(ends, axis=1)[:, None] for of in (np.min, np.max))
        x = x[: len(ends)]
        off = np.maximum(np.maximum(low - x, x - high), 0.0)
        gaps[beyond] = np.linalg.norm(off, axis=0)
    return float(gaps.min())


def _size(ply: Ply) -> float:
    """Extent of a ply in mm."""
    return float(np.ptp(ply.nodes, axis=1).max())


def _refuse_asymmetric(ply: Ply, tools: Sequence[ToolTerm]) -> None:
    """Refuse tools that are not symmetric, within reach of the ply, about its planes.

    The nodes are moved along with each tool and projected onto every tool.  The mirror
    images of these points must be on the tool too, unless they are beyond its edges,
    its outline, or the domain of its functions.  A tool with friction also moves
    symmetrically: mirrored nodes that move with it are the mirror images of these.
    """
    planes = [name for name, end in ply.fibre_ends.items() if end == "mirror"]
    X, factors = np.pad(ply.nodes, ((0, 1), (0, 0))), _load_factors(tools)
    # At equal load factors a motion that repeats itself may be where it began, but not
    # at the golden section between them.
    golden = (5**0.5 - 1) / 2
    within = [a + golden * (b - a) for a, b in pairwise(factors)]
    for t in (*factors, *within) if planes else ():
        travels = np.unique([tool.travel(t) for tool in tools], axis=0)
        moved = np.hstack([X + travel[:, None] for travel in travels])
        for tool in tools:
            for name in planes if tool.friction else ():
                _refuse_turned(tool, name, X, ply, t)
            bare = replace(tool._obstacle, reach=no_reach, half=0.0)
            with suppress(SurfaceError):  # not defined everywhere
                x = _points_of(bare, moved, t, ply)
                for name in planes if x.size else ():
                    off = np.abs(bare.gaps(_mirrored(ply, name, x), t).gap)
                    _refuse_off(tool, name, x, np.where(np.isinf(off), 0, off), ply, t)


def _points_of(bare: Obstacle, x: ndarray, t: float, ply: Ply) -> ndarray:
    """Project points onto a surface; those above the ply, on the side facing it.

    ``bare`` has neither thickness nor gap.
    """
    free = _FREE * _size(ply)
    x, gap, normal = _projected(bare, x, t, free)
    low, high = (get(ply.mesh.p, axis=1)[:, None] for get in (np.min, np.max))
    over = ((x[:2] >= low) & (x[:2] <= high)).all(axis=0) & (np.abs(gap) <= free)
    x, normal = x[:, over], normal[:, over]
    return x[:, normal[:, :1].sum(axis=1) @ normal > OPPOSITE]


def _mirrored(ply: Ply, name: str, x: ndarray) -> ndarray:
    """Points mirrored at the plane of a straight boundary of a ply."""
    nodes, N = nodes_and_normal(ply.mesh, ply.mesh.boundaries[name])
    off = N @ (x[:2] - ply.mesh.p[:, nodes[:1]])
    return np.asarray(x - 2 * np.outer([*N, 0.0], off))


def _refuse_off(
    tool: ToolTerm, boundary: str, x: ndarray, off: ndarray, ply: Ply, t: float
) -> None:
    """Refuse distances ``off`` of mirror images of x from the tool beyond rounding."""
    obstacle, allowed, worst = tool._obstacle, _ASYMMETRIC * _size(ply), off.argmax()
    if facets := getattr(obstacle.surface, "facets", None):
        allowed = max(allowed, _OF_TRIANGLES * float(facets.longest_edges().mean()))
    if off[worst] > allowed:
        raise ValueError(
            f"{obstacle.what} is not symmetric about the boundary {boundary!r} of the "
            f"ply: it is {off[worst]:.3g} mm away from the mirror image of "
            f"{obstacle.place(x[:, worst])} at load factor {t:g}: compute the whole "
            "ply, or move the tool"
        )


def _refuse_turned(
    tool: ToolTerm, boundary: str, X: ndarray, ply: Ply, t: float
) -> None:
    """Refuse a motion since load factor 0 that is not symmetric about a boundary."""
    (R0, c0), (R, c) = map(tool._obstacle.placement, (0.0, t))
    turn = R @ R0.T

    def moved(x: ndarray) -> ndarray:
        return turn @ (x - c0[:, None]) + c[:, None]

    one, other = moved(_mirrored(ply, boundary, X)), _mirrored(ply, boundary, moved(X))
    if (off := float(np.abs(one - other).max())) > _ASYMMETRIC * _size(ply):
        raise ValueError(
            f"{tool._obstacle.what} has friction, and its motion is not symmetric "
            f"about the boundary {boundary!r} of the ply: mirror images differ by "
            f"{off:.3g} mm at load factor {t:g}: compute the whole ply, or change the "
            "motion"
        )


def _has_normal_load(ply: Ply, terms: Sequence[Any]) -> bool:
    """True if loads among the terms act on the flat ply along its normal."""
    flat, loads = ply.basis.zeros(), [x for x in terms if x.role == "load"]
    for t in _load_factors(pressing(ply)) if loads else ():
        p = ply.updated(ply.parameters_at_rest, flat, t)
        load = np.abs(ply.nodal(ply.residual(flat, t, p, loads)))
        if load[2].max() > ROUND_OFF * load.max():
            return True
    return False


def _refuse_behind(ply: Ply, tool: ToolContact) -> None:
    """Refuse a tool with the whole undeformed ply on the wrong side of its surface."""
    gaps = tool.gaps(ply.basis.zeros(), 0.0)
    gaps, free = gaps[np.isfinite(gaps)], _FREE * _size(ply)
    if gaps.size and gaps.max() <= free and gaps.min() < -free:
        raise ValueError(
            f"tool {tool.name!r}: the whole undeformed ply is behind its surface, by "
            f"up to {-gaps.min():.3g} mm: reverse its side, or move the tool"
        )
