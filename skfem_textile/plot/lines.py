"""Lines on a ply: edges, fibres thinned to a spacing, marks of elements."""

import numpy as np
from numpy import ndarray
from scipy.spatial import KDTree

from .sheet import Lines, Panel, Shape, Tool

# Chosen by eye, in mm on the picture, as all sizes and colours below.  The least side
# of an element that has fibres of its own; elsewhere they stand on a square grid of
# this spacing.  Their length over spacing or side, the greatest length, and the width.
_OWN, _SPACING, _LENGTH, _LONGEST, _WIDTH = 1.6, 2.4, 0.8, 7.0, 0.3

# Points of the grid that are closer than this share of the spacing to an element's own
# fibres have none.
_NEAREST = 0.7

# How many lengths, each half the last, are tried of a line that leaves the outline.
_LENGTHS = 4

# Elements of which one may hold a point: so many with the nearest centres.
_CANDIDATES = 8

# The least mean side of elements whose edges are drawn, and the widths of the edges and
# of the outline of the ply.
_LEAST_SIDE, _EDGE, _OUTLINE = 1.3, 0.1, 0.2

# Depth behind a tool, as a share of its own, from which the tool hides a line.
_HIDDEN = 0.05

# Marks of elements: the width of their lines, and the radius of the rings around
# elements that are smaller, and at most so many.
_MARK, _RING, _CORNERS, _FEW = 0.45, 1.6, 24, 12

#: Colours of a ply without colours, of edges on it and elsewhere, and of outlines.
PLY = "#F4F4F4"
_PALE_EDGE, _DARK_EDGE, _OUTER = "#B8B8B8", "#404040", "#202020"

#: Blue and vermilion of Okabe & Ito (2008), distinct in any kind of colour vision.
WARP, WEFT = "#0072B2", "#D55E00"

#: Magenta, which no usual colour map has.
REFUSED = "#E6007E"


def lines_of(panel: Panel, scale: float, show_edges: bool | None) -> list[Lines]:
    """Everything that is drawn on a ply, in order.

    Parameters
    ----------
    panel
        The ply and what is to be seen on it.
    scale
        Mm on the picture over mm of the ply.
    show_edges
        Whether the edges of elements are drawn; None: where they are not too small.
    """
    shape = panel.shape
    drawn = []
    if show_edges or (show_edges is None and shape.sides.mean() * scale >= _LEAST_SIDE):
        colour = _PALE_EDGE if panel.fibres else _DARK_EDGE
        drawn.append(Lines(shape.edges(outer=False), colour, _EDGE))
    drawn.append(Lines(shape.edges(outer=True), _OUTER, _OUTLINE))
    if panel.fibres:
        for vectors, colour in zip(panel.fibres, (WARP, WEFT), strict=True):
            drawn.append(Lines(_along(shape, vectors, scale), colour, _WIDTH))
    if panel.marked.size:
        drawn.append(Lines(_marks(panel, scale), REFUSED, _MARK))
    return drawn


def in_front_of_tool(ends: ndarray, tool: Tool | None) -> ndarray:
    """The lines that a tool does not hide, shape (n, 2, 3)."""
    if tool is None or not len(ends):
        return ends
    centres, middles = tool.centres, ends.mean(axis=1)
    near = KDTree(centres[:, :2]).query(middles[:, :2], _CANDIDATES)[1]
    allowed = _HIDDEN * np.ptp(centres[:, 2])
    return ends[centres[near, 2].max(axis=1) <= middles[:, 2] + allowed]


def _along(shape: Shape, vectors: ndarray, scale: float) -> ndarray:
    """Lines along vectors of elements within the ply, shape (n, 2, 3)."""
    points, elements, room = places_of_fibres(shape, scale)
    half = 0.5 * np.minimum(_LENGTH * room, _LONGEST / scale)[:, None]
    along = half * vectors[elements]
    for _ in range(_LENGTHS):
        ends = np.stack([points - along, points + along], axis=1)
        beyond = (holding(shape, ends.reshape(-1, 3)) < 0).reshape(-1, 2).any(axis=1)
        along[beyond] /= 2
    return ends[~beyond]


def places_of_fibres(shape: Shape, scale: float) -> tuple[ndarray, ndarray, ndarray]:
    """Where fibres are drawn: in each element, or on a grid where these are small.

    Returns
    -------
    tuple
        Points (n, 3), the element at each (n,), and the room there in mm of the ply
        (n,).
    """
    centres, sides, spacing = shape.centres, shape.sides, _SPACING / scale
    if shape.tool:  # elements shrink towards its flanks: all have them, or none
        sides = np.full_like(sides, sides.mean())
    large = np.flatnonzero(sides * scale >= _OWN)
    grid = _grid_over(centres, spacing)
    element = holding(shape, grid)
    inside = (element >= 0) & (sides[element] * scale < _OWN)
    if large.size:
        inside &= KDTree(centres[large]).query(grid)[0] >= _NEAREST * spacing
    grid, element = grid[inside], element[inside]
    grid[:, 2] = centres[element, 2]
    return (
        np.vstack([centres[large], grid]),
        np.concatenate([large, element]),
        np.concatenate([sides[large], np.full(len(grid), spacing)]),
    )


def holding(shape: Shape, points: ndarray) -> ndarray:
    """Number of the element above or below each point; -1 where there is none."""
    corners = np.vstack(
        [shape.points[cell[[*range(len(cell)), -1][:4]].T] for cell in shape.cells]
    )[..., :2]
    n = min(_CANDIDATES, len(corners))
    near = KDTree(shape.centres[:, :2]).query(points[:, :2], n)[1].reshape(-1, n)
    start = corners[near]
    edge = np.roll(start, -1, axis=-2) - start
    to = points[:, None, None, :2] - start
    turn = edge[..., 0] * to[..., 1] - edge[..., 1] * to[..., 0]
    inside = (turn >= 0).all(axis=-1) | (turn <= 0).all(axis=-1)
    first = near[np.arange(len(near)), inside.argmax(axis=1)]
    return np.where(inside.any(axis=1), first, -1)


def _grid_over(points: ndarray, spacing: float) -> ndarray:
    """A square grid over points, in the middle of them, shape (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    axes = []
    for a, b in zip(low[:2], high[:2], strict=True):
        n = max(1, round((b - a) / spacing))
        axes.append(0.5 * (a + b) + spacing * (np.arange(n) - (n - 1) / 2))
    x, y = np.meshgrid(*axes)
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, low[2])])


def _marks(panel: Panel, scale: float) -> ndarray:
    """The outline of the marked elements, and rings around a few that are small."""
    edges = panel.shape.outline_of(panel.marked)
    if panel.marked.size > _FEW or panel.shape.sides.mean() * scale > _RING:
        return edges
    centres = panel.shape.centres[panel.marked]
    turn = np.linspace(0, 2 * np.pi, _CORNERS + 1)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1) * _RING / scale
    rings = centres[:, None] + np.stack([ring[:-1], ring[1:]], axis=1)[:, None]
    return np.vstack([edges, rings.reshape(-1, 2, 3)])
