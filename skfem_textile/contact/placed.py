"""Triangles of tools at their positions at load factors, for pictures and files."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..ply import Ply
from ..solve.states import State
from ..surfaces.surface import OffSurfaceError, Surface, onto
from ..surfaces.tool_mesh import triangles_within
from .holder import pressing
from .obstacle import ToolTerm
from .outline import inside, nearest

# Margin around a ply relative to the diagonal of its box, and number of cubes along the
# longest side of the box in which surfaces are triangulated.  Only pictures and files
# of tools depend on them.
_BEYOND, _CUBES = 0.08, 32


class PlacedTool(NamedTuple):
    """Triangles of a tool in the axes of the ply.

    Attributes
    ----------
    name
        Name of the tool.
    points
        Corners in mm, shape (3, n).
    triangles
        Their numbers, anticlockwise as seen from the ply, shape (3, n_triangles).
    normals
        Normals of the triangles towards the ply, of any length, (3, n_triangles).
    """

    name: str
    points: ndarray
    triangles: ndarray
    normals: ndarray


def box_of(ply: Ply, states: Iterable[State]) -> tuple[ndarray, ndarray]:
    """Corners of a box around a ply in some states, with a margin, each (3,)."""
    x = np.hstack([ply.positions(state.u) for state in states])
    low, high = x.min(axis=1), x.max(axis=1)
    margin = _BEYOND * float(np.linalg.norm(high - low))
    return low - margin, high + margin


def placed_tools(
    ply: Ply,
    states: Sequence[State],
    low: ndarray,
    high: ndarray,
    cells: int = _CUBES,
) -> list[list[PlacedTool]]:
    """Tools of a ply, and holders with a gap or force, at their positions in states.

    Parameters
    ----------
    ply
        The ply.
    states
        Its states.
    low, high
        Corners of the box within which tools are shown, see `box_of`.
    cells
        Number of cubes along its longest side, in which surfaces without triangles are
        triangulated.

    Returns
    -------
    list
        For each state, the tools that stand in the box.
    """
    tools = [list(_placed(x, states, low, high, cells)) for x in standing(ply)]
    return [
        [tool[i] for tool in tools if tool[i].triangles.size]
        for i in range(len(states))
    ]


def standing(ply: Ply) -> list[ToolTerm]:
    """Tools of a ply, and holders with a gap or force: all whose position is known."""
    return [x for x in pressing(ply) if getattr(x, "rigid", True)]


def _placed(
    contact: ToolTerm,
    states: Sequence[State],
    low: ndarray,
    high: ndarray,
    cells: int,
) -> Iterator[PlacedTool]:
    """A tool in each state; its surface is triangulated once."""
    obstacle = contact._obstacle
    places = [obstacle.placement(state.load_factor) for state in states]
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1)
    local = np.hstack([turn.T @ (corners - moved[:, None]) for turn, moved in places])
    x, triangles, normals = triangles_within(
        obstacle.surface, local.min(axis=1), local.max(axis=1), cells
    )
    if obstacle.outline is not None:
        x, kept = _cut(obstacle.surface, obstacle.outline, x, triangles)
        triangles, normals = triangles[:, kept], normals[:, kept]
    sign = obstacle.side
    if obstacle.reach is not None:  # a holder stands on the other side of the ply
        gradient = obstacle.surface.gradient(x)
        outwards = sign * gradient / np.linalg.norm(gradient, axis=0)
        sign = -sign
    for state, (turn, moved) in zip(states, places, strict=True):
        stands = x
        if obstacle.reach is not None:
            own = state.parameters[contact.name]  # of a holder with a force
            stands = (
                x + own.get("distance", obstacle.reach(state.load_factor)) * outwards
            )
        stands = turn @ stands + moved[:, None]
        centres = stands[:, triangles].mean(axis=1).T
        shown = (np.clip(centres, low, high) == centres).all(axis=1)
        used, numbers = np.unique(triangles[:, shown], return_inverse=True)
        numbers, towards = numbers.reshape(3, -1), sign * turn @ normals[:, shown]
        yield PlacedTool(
            contact.name,
            stands[:, used],
            _anticlockwise(stands[:, used], numbers, towards),
            towards,
        )


def _anticlockwise(x: ndarray, triangles: ndarray, normals: ndarray) -> ndarray:
    """Reorder corners of triangles anticlockwise about the normals."""
    a, b, c = (x[:, corner] for corner in triangles)
    clockwise = (np.cross(b - a, c - a, axis=0) * normals).sum(axis=0) < 0
    return np.where(clockwise, triangles[::-1], triangles)


def _cut(
    surface: Surface, outline: ndarray, x: ndarray, triangles: ndarray
) -> tuple[ndarray, ndarray]:
    """Trim triangles at an outline: moved points, and mask of kept triangles."""
    within = inside(outline, x[:2])
    kept = within[triangles].any(axis=0)
    crossing = np.zeros(x.shape[1], dtype=bool)
    crossing[triangles[:, kept]] = True
    crossing &= ~within
    moved = x.copy()
    moved[:2, crossing] = nearest(outline, x[:2, crossing])
    with suppress(OffSurfaceError):  # at a kink, they stay at their height
        moved[:, crossing] = onto(surface, moved[:, crossing])
    return moved, kept
