"""Checks of tools before a run: room for the ply between them, and contact with it."""

from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..solve.conditions import Conditions, Constraints
from ..solve.surface.surface import place
from .tool import ToolContact

# Numbers of projections after which penetrations are compared, the ratio of the second
# to the first above which they do not decrease any more, and penetration relative to
# the size of the ply below which a point is between the tools.  Chosen: between tools
# that touch, penetrations decrease in proportion to 1/n, or to 1/sqrt(n) at least, by a
# ratio of 0.71; between tools that cross they have a limit.
_FIRST, _SECOND, _NO_LESS, _FREE = 50, 100, 0.9, 1e-6

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

    For each node a point outside all tools is searched by projections onto one tool
    after the other, at both load factors.  Tools that cross, but have room for every
    node elsewhere, are not found.

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
        _refuse_behind(ply, tool, load_factors[0])
    for t in load_factors:
        _refuse_no_room(ply, tools, t)
    end = load_factors[1]
    moved = conditions is not None and _moves(ply, conditions, end)
    if not (moved or _has_normal_load(ply, end)):
        _refuse_untouched(ply, tools, load_factors)


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


def _refuse_no_room(ply: Ply, tools: Sequence[ToolContact], t: float) -> None:
    """Refuse tools without a point outside all of them for some node."""
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))
    free, x = _FREE * _size(ply), X
    depths = []
    for count in (_FIRST, _SECOND - _FIRST):
        x, depth = _projected(X, x, tools, t, free, count)
        if depth.max() <= free:
            return
        depths.append(depth)
    stuck = (depths[1] > free) & (depths[1] > _NO_LESS * depths[0])
    if not stuck.any():
        return
    node = int(np.where(stuck, depths[1], 0.0).argmax())
    gaps = _gaps(X, x, tools, t)[:, node]
    _, after = _step(X, x, tools, t)
    between = (gaps < -free) | (after[:, node] < -free)
    names = " and ".join(
        repr(tool.name) for tool, one in zip(tools, between, strict=True) if one
    )
    raise ValueError(
        f"tools {names} leave no room for the ply at load factor {t:g}: node {node}, "
        f"at {place(X[:, node])} in the undeformed ply, is at least "
        f"{depths[1][node]:.3g} mm inside one of them: reduce the travel, or move the "
        "tools apart"
    )


def _projected(
    X: ndarray,
    x: ndarray,
    tools: Sequence[ToolContact],
    t: float,
    free: float,
    count: int,
) -> tuple[ndarray, ndarray]:
    """Points after projections, and their penetrations in mm, shape (n,)."""
    depth = -_gaps(X, x, tools, t).min(axis=0)
    for _ in range(count):
        if depth.max() <= free:
            break
        x, _ = _step(X, x, tools, t)
        depth = -_gaps(X, x, tools, t).min(axis=0)
    return x, np.maximum(depth, 0.0)


def _step(
    X: ndarray, x: ndarray, tools: Sequence[ToolContact], t: float
) -> tuple[ndarray, ndarray]:
    """Points projected out of each tool in turn, and the gaps before that."""
    met = []
    for tool in tools:
        u = (x - X).T.ravel()
        gap = tool.gaps(u, t)
        met.append(gap)
        inside = gap < 0
        out = np.where(inside, gap, 0.0) * np.where(inside, tool.normals(u, t), 0.0)
        x = x - out
    return x, np.array(met)


def _gaps(X: ndarray, x: ndarray, tools: Sequence[ToolContact], t: float) -> ndarray:
    """Gaps of points from the tools, shape (n_tools, n)."""
    u = (x - X).T.ravel()
    return np.array([tool.gaps(u, t) for tool in tools])
