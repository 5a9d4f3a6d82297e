"""Courses: strips of a roll side by side on a tool.

The middle course lies on both sides of the first warp thread.  The next ones start from
the thread of their neighbour at the overlap from its edge.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray

from ..mesh.graph import boundary_edges, edges_of
from ..mesh.user_input import coords
from ..surfaces.analytic import positive_length
from ..surfaces.surface import onto
from ..surfaces.triangle_mesh import TriangleMesh
from .crossings import Net
from .flat_pattern import FlatPattern, SeamLine
from .kinematic_net import net
from .laying import Status
from .sheet import Sheet

# Number of bisections between the last crossing on the tool and the next one beyond its
# edge, to a tolerance of a millionth of a cell.
_BISECTIONS = 20

# Rounding of distances, relative to a cell: edges of tools have single precision.
_ROUNDING = 1e-4


@dataclass(frozen=True, eq=False)
class Course:
    """Strip of a roll on a tool.

    Attributes
    ----------
    net
        Its net.
    pattern
        Its outline in the flat strip: the ends of the warp threads at the edges of the
        tool, and the sides of the strip.  Its seams are the lines at which a side
        of a neighbour lies.
    """

    net: Net
    pattern: FlatPattern

    @property
    def pieces(self) -> list[tuple[Net, ndarray]]:
        """The net and the mask of its cells."""
        return self.net.pieces


def courses(
    tool: TriangleMesh,
    cell: float,
    width: float,
    overlap: float = 0.0,
    **start: Any,
) -> list[Course]:
    """Lay strips of a roll side by side until they cover a tool.

    Parameters
    ----------
    tool
        The tool.
    cell
        Length of the rods in mm; width and overlap are rounded to whole cells.
    width
        Width of the roll in mm.
    overlap
        Overlap of neighbours in mm, along the weft of the earlier one.
    **start
        Start of the middle course and its first threads, see `net`.

    Returns
    -------
    list
        Courses, from the side against the weft to the side along it.

    Raises
    ------
    ValueError
        If an argument is not valid, the tool is closed, such as a sphere, or a strip
        folds.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> x, y = (a.ravel() for a in np.meshgrid(*2 * [np.linspace(-100, 100, 5)]))
    >>> k = np.add.outer(5 * np.arange(4), np.arange(4)).ravel()
    >>> t = np.hstack([[k, k + 1, k + 6], [k, k + 6, k + 5]])
    >>> flat = drape.TriangleMesh(np.array([x, y, 0 * x]), t)
    >>> strips = drape.courses(flat, 20.0, 120.0, 20.0, point=(0, 0, 0))
    >>> [round(strip.pattern.area) for strip in strips]
    [12000, 24000, 12000]
    """
    cell = positive_length("courses: cell", cell)
    width = positive_length("courses: width", width)
    across = max(round(width / cell), 2)
    if not 0 <= overlap < width:
        raise ValueError(
            f"courses: the overlap must be at least 0 and less than the width of "
            f"{width:g} mm, got {overlap:g} mm"
        )
    _refuse_closed(tool)
    half, inside = across // 2, min(round(overlap / cell), across - 1)
    middle = net(tool, cell, weft=(half, across - half), **start)
    laid, begin = [middle], middle.positions[:, *middle.start]
    settings = {k: v for k, v in start.items() if k not in _OF_START}
    for side in (1, -1):
        last = middle
        counts = (0, across) if side > 0 else (across, 0)
        while (thread := _thread(tool, laid, last, side, inside)) is not None:
            on_tool = thread[:, tool.beyond_edges(thread) == 0]
            away = np.linalg.norm(on_tool - begin[:, None], axis=0)
            last = net(
                tool,
                cell,
                weft=counts,
                point=on_tool[:, away.argmin()],
                warp_along=thread,
                **settings,
            )
            if side > 0:
                laid.append(last)
            else:
                laid.insert(0, last)
    patterns = [_outline(tool, strip) for strip in laid]
    # A strip with one thread on the tool covers nothing but the tolerance of its edge.
    kept = [k for k, of in enumerate(patterns) if of.outline.shape[1] > 2]
    laid, patterns = [laid[k] for k in kept], [patterns[k] for k in kept]
    first = next(k for k, strip in enumerate(laid) if strip is middle)
    for k in range(len(laid) - 1):
        lines = (-1 - inside, 0) if k >= first else (-1, inside)
        for n, line in zip((k, k + 1), lines, strict=True):
            seam = SeamLine(k + 1, *_on_tool(tool, laid[n], line))
            patterns[n] = replace(patterns[n], seams=(*patterns[n].seams, seam))
    return [Course(*of) for of in zip(laid, patterns, strict=True)]


def _refuse_closed(tool: TriangleMesh) -> None:
    """Refuse a closed surface on which every field of directions has a singular point.

    By the theorem of Poincaré and Hopf all have one unless the Euler characteristic is
    zero, as for a torus.
    """
    triangles = tool.facets.triangles()
    edges, _ = edges_of([triangles])
    euler = np.unique(triangles).size - edges.shape[1] + triangles.shape[1]
    if euler and not boundary_edges([triangles]).size:
        raise ValueError(
            "courses: the tool is closed, and parallel threads meet at a point of it, "
            "where any strip folds: cut the tool into parts with edges"
        )


# Options of `net` for the middle course alone.
_OF_START = ("point", "first", "warp_along", "weft_along")


def _thread(
    tool: TriangleMesh, laid: Sequence[Net], last: Net, side: int, inside: int
) -> ndarray | None:
    """First warp thread of the next course, shape (3, n).

    None beyond the tool, and where the courses around a tube meet.
    """
    edge = last.positions[:, :, -1 if side > 0 else 0]
    thread = last.positions[:, :, -1 - inside if side > 0 else inside]
    edge, thread = (x[:, np.isfinite(x[0])] for x in (edge, thread))
    edge = edge[:, tool.beyond_edges(edge) == 0]
    if not edge.size or not (tool.beyond_edges(thread) == 0).any():
        return None
    others = [Sheet.of_net(one) for one in laid if one is not last]
    if others and np.any([one.at(edge).found for one in others], axis=0).all():
        return None
    return thread


def _outline(tool: TriangleMesh, laid: Net) -> FlatPattern:
    """Outline of a strip: the ends of its warp threads at the edges of a tool."""
    if laid.folds.size:
        raise ValueError(
            f"courses: a strip folds at {coords(laid.folds[:, 0])} mm: use a narrower "
            "roll, or another start"
        )
    status = laid.status == Status.LAID
    x = laid.positions
    on = np.zeros(status.shape, dtype=bool)
    on[status] = tool.beyond_edges(x[:, status]) == 0
    threads = np.flatnonzero(on.any(axis=0))
    first, last = on.argmax(axis=0), len(on) - 1 - on[::-1].argmax(axis=0)
    ends = []
    for at, step in ((first, -1), (last, 1)):
        end = _end(tool, laid, threads, at[threads], step)
        ends.append(_with_sides(tool, laid, threads, at, *end))
    flat, on_tool = (
        np.hstack([one, other[:, ::-1]]) for one, other in zip(*ends, strict=True)
    )
    return FlatPattern(flat, on_tool, *laid.fibres(flat.shape[1]))


def _on_tool(tool: TriangleMesh, laid: Net, thread: int) -> tuple[ndarray, ndarray]:
    """Points of a warp thread on the tool, in the flat strip and in space."""
    x = laid.positions[:, :, thread]
    known = np.flatnonzero(np.isfinite(x[0]))
    on = known[tool.beyond_edges(x[:, known]) == 0]
    s, t = laid.along[0][on], np.full(len(on), laid.along[1][thread])
    flat = laid.directions @ np.array([s, t]) + laid.touch[:, None]
    first, last = (
        _end(tool, laid, np.array([thread]), on[[k]], step)
        for k, step in ((0, -1), (-1, 1))
    )
    # Crossings within the tolerance of the edges are beyond them.
    along, begin, end = (laid.directions[:, 0] @ of for of in (flat, first[0], last[0]))
    inside = (along > begin) & (along < end)
    return (
        np.hstack([first[0], flat[:, inside], last[0]]),
        np.hstack([first[1], x[:, on[inside]], last[1]]),
    )


def _end(
    tool: TriangleMesh, laid: Net, threads: ndarray, at: ndarray, step: int
) -> tuple[ndarray, ndarray]:
    """Ends of warp threads in the flat strip, (2, n), and on the tool, (3, n)."""
    beyond = np.clip(at + step, 0, len(laid.along[0]) - 1)
    inner, outer = laid.positions[:, at, threads], laid.positions[:, beyond, threads]
    outer = np.where(np.isfinite(outer), outer, inner)

    def at_share(share: ndarray) -> ndarray:
        return onto(tool, inner + share * (outer - inner))

    low, high = np.zeros(len(threads)), np.ones(len(threads))
    for _ in range(_BISECTIONS):
        share = 0.5 * (low + high)
        is_on = tool.beyond_edges(at_share(share)) == 0
        low, high = np.where(is_on, share, low), np.where(is_on, high, share)
    # Near the edge no distance is given; it is linear beyond.
    near, far = (tool.beyond_edges(at_share(x)) for x in (high, np.ones_like(high)))
    with np.errstate(divide="ignore", invalid="ignore"):
        before = near * (1 - high) / (far - near)
    share = np.where(far > near, high - before, low)
    s, t = laid.along
    along = s[at] + share * (s[beyond] - s[at])
    flat = laid.directions @ np.array([along, t[threads]]) + laid.touch[:, None]
    return flat, at_share(share)


def _with_sides(
    tool: TriangleMesh,
    laid: Net,
    threads: ndarray,
    at: ndarray,
    flat: ndarray,
    on_tool: ndarray,
) -> tuple[ndarray, ndarray]:
    """Add a thread on each side on which the tool ends between two threads."""
    weft = laid.cell * laid.directions[:, 1]
    x = laid.positions

    def is_needed(thread: int) -> bool:
        if len(threads) < 2 or not 0 <= thread < x.shape[2]:
            return False
        beyond = tool.beyond_edges(x[:, np.isfinite(x[0, :, thread]), thread])
        return bool((beyond < (1 - _ROUNDING) * laid.cell).any())

    for end, step in ((-1, 1), (0, -1)):
        k, i = threads[end], at[threads[end]]
        if is_needed(k + step):
            beside = on_tool[:, end] + x[:, i, k] - x[:, i, k - step]
            place = on_tool.shape[1] if step > 0 else 0
            on_tool = np.insert(on_tool, place, onto(tool, beside[:, None])[:, 0], 1)
            flat = np.insert(flat, place, flat[:, end] + step * weft, 1)
    return flat, on_tool


def side_by_side(
    patterns: Sequence[FlatPattern], gap: float = 10.0
) -> list[FlatPattern]:
    """Patterns moved side by side along their weft, to be cut from one file.

    Parameters
    ----------
    patterns
        The patterns.
    gap
        Distance between them in mm.
    """
    moved, begin = [], 0.0
    for pattern in patterns:
        weft = pattern.weft[:, 0]
        along = weft @ pattern.outline
        moved.append(pattern.moved((begin - along.min()) * weft))
        begin += np.ptp(along) + gap
    return moved
