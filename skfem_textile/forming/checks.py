"""Checks of tools before a run: room for the ply between them, and contact with it."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..solve.conditions import Conditions, Constraints
from .tool import ToolContact

# Numbers of projections after which penetrations are compared, the ratio of the second
# to the first above which they do not decrease any more, and penetration relative to
# the size of the ply below which a point is between the tools.  Chosen: between tools
# that touch, penetrations decrease in proportion to 1/n, or to 1/sqrt(n) at least, by a
# ratio of 0.71; between tools that cross they have a limit.
_FIRST, _SECOND, _NO_LESS, _FREE = 50, 100, 0.9, 1e-6

# Number of intervals in which tools push points along.  Chosen: tools pass over no
# point if they move by less than their size in an interval.
_PUSHES = 4

# Number of intervals between the load factors of which contact is checked.  Chosen:
# tools that touch the ply move through its plane, and stay beyond it for longer.
_INTERVALS = 40

# Load normal to the ply, relative to all loads, that is round-off.
_ROUND_OFF = 1e-9


def check_tools(
    ply: Ply,
    conditions: Conditions | None = None,
    load_factors: tuple[float, float] = (0.0, 1.0),
) -> None:
    """Refuse tools that leave no room for a ply, or that never touch it.

    The tools push each node along from the first load factor to the second, by
    projections out of one tool after the other.  Tools that cross, but have room for
    every node beside, are not found.

    Parameters
    ----------
    ply
        Ply with tools; one without is valid.
    conditions
        Its displacement conditions.
    load_factors
        Load factors at the beginning and end of the run.

    Raises
    ------
    ValueError
        If there is no room for a node, if the whole undeformed ply is behind the
        surface of a tool, or if nothing touches the ply: no tool at any load factor,
        and no load or support moves the ply out of its plane.  The message names the
        tools and, if there is no room, the node, its position and the penetration.

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Ply, Tool, drape
    >>> from skfem_textile.forming.checks import check_tools
    >>> mesh = MeshQuad().refined(3).scaled(100.0)
    >>> tools = [
    ...     Tool(drape.Plane((0, 0, -1)), motion=(0, 0, 4), name="punch"),
    ...     Tool(drape.Plane((0, 0, 2)), name="die"),
    ... ]
    >>> check_tools(Ply(mesh, Fabric(1e4, 0.1), terms=tools, dimension=3))
    Traceback (most recent call last):
    ValueError: tools 'punch' and 'die' leave no room for the ply at load factor 1: ...
    """
    tools = [term for term in ply.terms if isinstance(term, ToolContact)]
    if not tools:
        return
    for tool in tools:
        if tool._obstacle.reach is None:  # holders may close from far away
            _refuse_behind(ply, tool, load_factors[0])
    touched = _pushed(ply, tools, load_factors)
    end = load_factors[1]
    moved = conditions is not None and _moves(ply, conditions, end)
    if not (touched or moved or _has_normal_load(ply, end)):
        _refuse_untouched(ply, tools, load_factors)


def _pushed(
    ply: Ply, tools: Sequence[ToolContact], load_factors: tuple[float, float]
) -> bool:
    """Refuse tools without room for a node; returns True if they push one.

    Raises
    ------
    ValueError
        If there is no room for a node.
    """
    X, free, touched = np.pad(ply.nodes, ((0, 1), (0, 0))), _FREE * _size(ply), False
    x = X
    for t in np.linspace(*load_factors, _PUSHES + 1).tolist():
        after = _with_room(tools, X, x, t, free)
        touched |= bool((after != x).any())
        x = after
    return touched


def _refuse_untouched(
    ply: Ply, tools: Sequence[ToolContact], load_factors: tuple[float, float]
) -> None:
    """Refuse tools that reach the undeformed ply at no load factor."""
    flat, nearest, name, at = ply.basis.zeros(), np.inf, "", 0.0
    for t in np.linspace(*load_factors, _INTERVALS + 1).tolist():
        for tool in tools:
            gap = float(tool.gaps(flat, t).min(initial=np.inf))
            if gap <= _FREE * _size(ply):
                return
            if gap < nearest:
                nearest, name, at = gap, tool.name, t
    closest = "all its nodes are beyond the edges or outlines of the tools"
    if np.isfinite(nearest):
        closest = (
            f"the nearest is {name!r}, {nearest:.3g} mm away at load factor {at:g}"
        )
    raise ValueError(
        f"nothing touches the ply at any load factor: {closest}: check positions, "
        "units and motions of the tools"
    )


def _size(ply: Ply) -> float:
    """Extent of a ply in mm."""
    return float(np.ptp(ply.nodes, axis=1).max())


def _moves(ply: Ply, conditions: Conditions, t: float) -> bool:
    """True if a condition prescribes a displacement."""
    return bool(Constraints(ply.basis, conditions).fixed_values(t).any())


def _has_normal_load(ply: Ply, t: float) -> bool:
    flat = ply.basis.zeros()
    load = np.abs(ply.nodal(ply.load(flat, t)))
    return bool(load[2].max() > _ROUND_OFF * load.max())


def _refuse_behind(ply: Ply, tool: ToolContact, t: float) -> None:
    """Refuse a tool with the whole undeformed ply on the wrong side of its surface."""
    gaps = tool.gaps(ply.basis.zeros(), t)
    gaps, free = gaps[np.isfinite(gaps)], _FREE * _size(ply)
    if gaps.size and gaps.max() <= free and gaps.min() < -free:
        raise ValueError(
            f"tool {tool.name!r}: the whole undeformed ply is behind its surface, by "
            f"up to {-gaps.min():.3g} mm: reverse its side, or move the tool"
        )


def _with_room(
    tools: Sequence[ToolContact], X: ndarray, x: ndarray, t: float, free: float
) -> ndarray:
    """Points outside all tools, of nodes X; an error if there is none for some node."""
    x, before = _projected(tools, x, t, free, _FIRST)
    if before.max() <= free:
        return x
    x, depth = _projected(tools, x, t, free, _SECOND - _FIRST)
    stuck = (depth > free) & (depth > _NO_LESS * before)
    if not stuck.any():
        return x
    node = int(np.where(stuck, depth, 0.0).argmax())
    names = " and ".join(repr(name) for name in _around(tools, x[:, [node]], t, free))
    raise ValueError(
        f"tools {names} leave no room for the ply at load factor {t:g}: node {node}, "
        f"at {tools[0].place(X[:, node])} in the undeformed ply, is at least "
        f"{depth[node]:.3g} mm inside one of them: reduce the travel, or move the "
        "tools apart"
    )


def _projected(
    tools: Sequence[ToolContact], x: ndarray, t: float, free: float, most: int
) -> tuple[ndarray, ndarray]:
    """Points after projections, and their penetrations in mm, shape (n,)."""
    x, depth = x.copy(), _depth(tools, x, t)
    for _ in range(most):
        inside = np.flatnonzero(depth > free)
        if not inside.size:
            break
        for tool in tools:
            x[:, inside] = _outside(tool, x[:, inside], t)
        depth[inside] = _depth(tools, x[:, inside], t)
    return x, depth


def _outside(tool: ToolContact, x: ndarray, t: float) -> ndarray:
    """Points projected out of a tool, to first order."""
    at = tool._obstacle.gaps(x, t)
    return x - np.where(at.gap < 0, at.gap, 0.0) * at.normal


def _depth(tools: Sequence[ToolContact], x: ndarray, t: float) -> ndarray:
    """Largest penetration of points into a tool in mm, shape (n,)."""
    gap = np.min([tool.gaps_at(x, t) for tool in tools], axis=0)
    return np.maximum(-gap, 0.0)


def _around(
    tools: Sequence[ToolContact], x: ndarray, t: float, free: float
) -> list[str]:
    """Names of the tools between which a point, shape (3, 1), is projected."""
    names = []
    for tool in tools:
        if tool.gaps_at(x, t)[0] < -free:
            names.append(tool.name)
        x = _outside(tool, x, t)
    return names
