"""Content of a picture, independent of the renderer: panels, fibres, scales and keys.

Fibres are lines at equal distances in the undeformed ply.  Lines along a family are
contours of a position ψ across it, with A·∇ψ = 0 and |∇ψ| = 1 for parallel fibres with
the unit direction A.  For other fibres the second cannot hold everywhere, and ψ
minimises ∫ w (A·∇ψ)² + (A⊥·∇ψ − 1)² on linear triangles, with w ≫ 1.  ψ has one value
at a point: radial fibres around a closed ring have no lines.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.colors import Colormap, ListedColormap
from matplotlib.ticker import MaxNLocator
from numpy import ndarray
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import spsolve
from scipy.spatial import KDTree
from skfem import Mesh

from ..mesh.graph import boundary_edges, components, edges_of
from ..mesh.overlap import signed_areas
from ..surfaces.tool_mesh import cut_in_two

# Minimum extent of a scale in its unit. Chosen: above the round-off of zero.
_LEAST_EXTENT = 1e-8

# Maximum number of intervals for rounding the ends of a scale; sizes of intervals, up
# to powers of ten.
_FINE_INTERVALS, _ROUND = 20, [1, 2, 2.5, 4, 5, 10]


# Factor of the number of colours from which a part of a map is taken.
_FINER = 16

# Viewpoints for a ply in space and for a ply on a tool, whose quarter has x, y > 0:
# azimuth and elevation in degrees, and distance relative to half the diagonal of the
# view. Chosen by eye.
_VIEW, _VIEW_OF_TOOL, _DISTANCE = (-60.0, 25.0), (60.0, 38.0), 4.0

# Height of a tool relative to its longer side above which this elevation is used;
# elevation for a flat tool in degrees, with linear interpolation in between. Chosen by
# eye.
_HIGH, _LOWEST = 0.2, 18.0

# Distance of a tool behind the ply on it, relative to half this diagonal.
_BEHIND = 0.02

#: Direction of the light: right, up and towards the eye.  Chosen by eye.
LIGHT = (-0.35, 0.65, 0.67)

# Grey level of a ply that faces the viewer or the light, and the share of it that is
# lost where the light is along the ply.  Chosen by eye.
_FLAT, _SHADE = 0.957, 0.35


class Tool(NamedTuple):
    """Triangles of a tool: corners (n, 3), connectivity (3, m), and grey levels.

    One-sided triangles are drawn only where their corners are seen anticlockwise.
    """

    points: ndarray
    triangles: ndarray
    shades: ndarray
    one_sided: bool = False

    @property
    def centres(self) -> ndarray:
        """Mean of the corners of each triangle, shape (m, 3)."""
        return np.asarray(self.points[self.triangles].mean(axis=0))


class Shape(NamedTuple):
    """Elements with straight edges between corners in mm, shape (n, 3).

    ``cells`` is the connectivity, for each k an array (k, n_k), and ``tool`` may be the
    tool on which they lie.  A ``veil`` is a tool in front of them, drawn translucent.
    """

    points: ndarray
    cells: tuple[ndarray, ...]
    tool: Tool | None = None
    veil: Tool | None = None

    @classmethod
    def of(cls, mesh: Mesh, u: ndarray) -> "Shape":
        """Mesh with vertices displaced by ``u``, shape (2 or 3, n_vertices)."""
        points = np.zeros((mesh.nvertices, 3))
        points[:, : len(mesh.p)] = mesh.p[:, : mesh.nvertices].T
        points[:, : len(u)] += u[:, : mesh.nvertices].T
        return cls(points, (mesh.t,))

    @property
    def centres(self) -> ndarray:
        """Mean of the corners of each element, shape (n_elements, 3)."""
        return np.vstack([self.points[cell].mean(axis=0) for cell in self.cells])

    @property
    def greys(self) -> ndarray:
        """Grey levels of the elements in the view, shape (n_elements,)."""
        crosses = []
        for cell in self.cells:
            corners = self.points[cell]
            one, other = corners[2] - corners[0], corners[-1] - corners[1]
            crosses.append(np.cross(one, other))
        normal = np.vstack(crosses) * np.sign(np.vstack(crosses)[:, 2:])
        length = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
        lit = np.clip(normal @ np.array(LIGHT) / length / LIGHT[2], 0.0, 1.0)
        return np.asarray(_FLAT * (1 - _SHADE * (1 - lit)))

    @property
    def sides(self) -> ndarray:
        """Side in mm of a square with the area of each element, shape (n_elements,)."""
        areas = []
        for cell in self.cells:
            x, y, _ = self.points[cell].transpose(2, 0, 1)
            areas.append(signed_areas(x, y))
        return np.sqrt(np.abs(np.concatenate(areas)))

    def edges(self, outer: bool) -> ndarray:
        """Ends of all edges, or of the outer edges only, shape (n_edges, 2, 3)."""
        edges = boundary_edges(self.cells) if outer else edges_of(self.cells)[0]
        return self.points[edges].swapaxes(0, 1)

    def outline_of(self, elements: ndarray) -> ndarray:
        """Ends of the outer edges of some elements, shape (n_edges, 2, 3)."""
        chosen, first = [], 0
        for cell in self.cells:
            inside = (elements >= first) & (elements < first + cell.shape[1])
            chosen.append(cell[:, elements[inside] - first])
            first += cell.shape[1]
        return Shape(self.points, tuple(chosen)).edges(outer=True)


class Scale(NamedTuple):
    """Colour scale.

    ``below`` and ``above`` are true if values lie beyond its ends.  On a ``signed`` one
    zero is marked.
    """

    label: str
    low: float
    high: float
    colours: Any
    below: bool = False
    above: bool = False
    signed: bool = False

    @classmethod
    def of(
        cls,
        label: str,
        reach: tuple[float, float],
        cmap: Any,
        clim: Sequence[float] | None = None,
        signed: bool = False,
    ) -> "Scale":
        """Scale between round numbers that enclose ``reach``, or between limits.

        A signed one has the middle of its colour map at zero.
        """
        try:
            colours = mpl.colormaps.get_cmap(cmap)
        except (TypeError, ValueError):
            raise ValueError(
                f"unknown colour map {cmap!r}: choose a name in matplotlib.colormaps"
            ) from None
        if clim is None:
            low, high = reach[0], max(reach[1], reach[0] + _LEAST_EXTENT)
            ticks = MaxNLocator(_FINE_INTERVALS, steps=_ROUND).tick_values(low, high)
            limits = np.asarray(ticks)[[0, -1]]
        else:
            limits = np.asarray(clim, dtype=float)
        if limits.shape != (2,) or not limits[0] < limits[1] < np.inf > -limits[0]:
            raise ValueError(
                f"clim must be two finite limits in ascending order, got {clim!r}"
            )
        low, high = limits.tolist()
        if signed:
            colours = _around_zero(colours, low, high)
        beyond = reach[0] < low, reach[1] > high
        return cls(label, low, high, colours, *beyond, signed)

    def ticks(self, intervals: int) -> ndarray:
        """Round numbers on the scale with at most the given number of intervals."""
        locator = MaxNLocator(intervals, steps=_ROUND)
        ticks = np.asarray(locator.tick_values(self.low, self.high))
        slack = 1e-9 * (self.high - self.low)
        return ticks[(ticks >= self.low - slack) & (ticks <= self.high + slack)]


def _around_zero(colours: Colormap, low: float, high: float) -> Colormap:
    """Part of a colour map between two values, with its middle at zero."""
    shares = 0.5 + 0.5 * np.linspace(low, high, colours.N) / max(abs(low), abs(high))
    fine = colours.resampled(_FINER * colours.N)
    return ListedColormap(fine(shares), colours.name)


# Weight of A·∇ψ = 0.  Chosen: lines deviate by less than their width from the fibres.
_ALONG = 1e3

# Cosine of the angle between the directions in adjacent elements below which no fibre
# continues from one to the other.  Chosen: 20°, more than a curved fibre turns.
_CONTINUES = np.cos(np.radians(20))

# Weight of ψ = A⊥·X relative to the other equations: it fixes the constant in ψ.
_FIXED = 1e-9


class Fibres(NamedTuple):
    """Positions across warp and weft at the corners of triangles.

    ``triangles`` are vertices of a shape, shape (3, n); ``across`` are the positions in
    mm in the undeformed ply, shape (2, 3, n).
    """

    triangles: ndarray
    across: ndarray

    @classmethod
    def of(
        cls, flat: ndarray, cells: tuple[ndarray, ...], warp: ndarray, weft: ndarray
    ) -> "Fibres":
        """Fibres with given directions in the elements of a flat ply.

        Parameters
        ----------
        flat
            Vertices in mm, shape (2, n_vertices).
        cells
            Vertices of the elements, arrays of shape (3, n) and (4, n).
        warp, weft
            Directions in the elements, of any length, shape (2, n_elements).
        """
        triangles = cut_in_two(cells)
        numbers, first = [], 0
        for cell in cells:
            numbers += (len(cell) - 2) * [first + np.arange(cell.shape[1])]
            first += cell.shape[1]
        element = np.concatenate(numbers)
        families = (A[:, element] / np.hypot(*A[:, element]) for A in (warp, weft))
        return cls(triangles, np.array([_across(flat, triangles, A) for A in families]))

    def lines(self, points: ndarray, family: int, spacing: float) -> ndarray:
        """Ends of the lines of a family in the triangles, shape (n, 2, 3).

        Parameters
        ----------
        points
            Positions of the vertices, shape (n_vertices, 3).
        family
            0 for the warp, 1 for the weft.
        spacing
            Distance between the lines in the undeformed ply in mm.
        """
        number = self.across[family] / spacing - 0.5
        first, last = np.ceil(number.min(axis=0)), np.floor(number.max(axis=0))
        counts = np.maximum(last - first + 1, 0).astype(int)
        triangle = np.repeat(np.arange(counts.size), counts)
        begins = np.repeat(np.cumsum(counts) - counts, counts)
        level = first[triangle] + np.arange(triangle.size) - begins
        at, corners = number[:, triangle], self.triangles[:, triangle]
        ends_at, ends = np.roll(at, -1, axis=0), np.roll(corners, -1, axis=0)
        crossed = (at > level) != (ends_at > level)
        two = crossed.any(axis=0)
        sides = np.argsort(~crossed[:, two], axis=0, kind="stable")[:2]
        at, ends_at, corners, ends = (
            np.take_along_axis(x[:, two], sides, axis=0)
            for x in (at, ends_at, corners, ends)
        )
        share = ((level[two] - at) / (ends_at - at))[..., None]
        along = (1 - share) * points[corners] + share * points[ends]
        return np.asarray(along.swapaxes(0, 1))


def _across(flat: ndarray, triangles: ndarray, A: ndarray) -> ndarray:
    """ψ at the corners of triangles with directions A, (2, n), shape (3, n)."""
    n, part = triangles.shape[1], _connected(triangles, A)
    corners = np.stack([np.tile(part, 3), triangles.ravel()])
    _, some, vertex = np.unique(corners, axis=1, return_index=True, return_inverse=True)
    vertex = vertex.reshape(3, n)
    a, b, c = flat[:, triangles].swapaxes(0, 1)
    sides = np.array([c - b, a - c, b - a])
    twice = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
    root = np.sqrt(np.abs(twice))
    # Gradients of the hat functions times the root of twice the area.
    slopes = np.stack([-sides[:, 1], sides[:, 0]], axis=1) * np.sign(twice)
    slopes = np.divide(slopes, root, out=np.zeros_like(slopes), where=root > 0)
    B = np.array([-A[1], A[0]])

    def derivative(along: ndarray) -> csr_matrix:
        entries = (slopes * along).sum(axis=1)
        at = np.tile(np.arange(n), 3), vertex.ravel()
        return csr_matrix((entries.ravel(), at), (n, some.size))

    along, across = derivative(A), derivative(B)
    K = _ALONG * along.T @ along + across.T @ across
    fixed = _FIXED * K.diagonal().mean()
    of_corners = (flat[:, triangles] * B[:, None]).sum(axis=0).ravel()
    psi = spsolve(
        (K + fixed * identity(some.size)).tocsc(),
        across.T @ root + fixed * of_corners[some],
    )
    return np.asarray(psi[vertex])


def _connected(triangles: ndarray, A: ndarray) -> ndarray:
    """Number of the part of each triangle within which fibres continue, shape (n,)."""
    n = triangles.shape[1]
    _, edge = edges_of((triangles,))
    order = np.argsort(edge, kind="stable")
    same = edge[order[1:]] == edge[order[:-1]]
    one, other = order[:-1][same] % n, order[1:][same] % n
    continues = (A[:, one] * A[:, other]).sum(axis=0) >= _CONTINUES
    return components(n, (one[continues], other[continues]))


class Lines(NamedTuple):
    """Straight lines of one colour: ends (n, 2, 3), and width in mm."""

    ends: ndarray
    colour: str
    width: float


class Panel(NamedTuple):
    """Shape with a title, coloured by a scale, or grey without one.

    Optional fibres are drawn as lines, without the edges of elements by default: on
    grey in the colours of their families, on a field all in one.  Optional elements are
    marked.
    """

    title: str
    shape: Shape
    values: ndarray | None = None
    scale: Scale | None = None
    fibres: Fibres | None = None
    marked: ndarray = np.empty(0, dtype=int)


class Legend(NamedTuple):
    """Scale and keys below the columns ``first`` to ``last - 1`` of panels."""

    first: int
    last: int
    scale: Scale | None = None
    keys: Sequence[tuple[str, str]] = ()


class Sheet(NamedTuple):
    """Rows of panels with legends below.

    ``extent`` contains the minimum and maximum coordinates of all panels, in mm.
    ``show_edges``: draw element edges; if None, only if elements are large enough.
    """

    rows: Sequence[Sequence[Panel]]
    legends: Sequence[Legend]
    extent: tuple[ndarray, ndarray]
    show_edges: bool | None = None

    @property
    def panels(self) -> list[Panel]:
        """All panels, row by row."""
        return [panel for row in self.rows for panel in row]

    @property
    def is_flat(self) -> bool:
        """True if no part of it is in front of another."""
        low, high = self.extent
        return bool(low[2] == high[2])


def eye_axes(on_tool: bool, size: ndarray | None = None) -> ndarray:
    """Rows: directions right, up and towards the viewer, in space or on a tool.

    The viewer is lower for a shallow tool, depending on the ``size`` of the view.
    """
    azimuth, elevation = _VIEW_OF_TOOL if on_tool else _VIEW
    if on_tool and size is not None:
        share = min(1.0, float(size[2] / size[:2].max()) / _HIGH)
        elevation = _LOWEST + share * (elevation - _LOWEST)
    azimuth, elevation = np.radians((azimuth, elevation))
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    near = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    near[2] = np.sin(elevation)
    return np.array([right, np.cross(near, right), near])


def in_perspective(shapes: Sequence[Shape]) -> list[Shape]:
    """Perspective projection of shapes in space, from a common viewpoint.

    The projected coordinates are right, up (in mm at the distance of the common
    centre), and the depth towards the viewer.
    """
    low, high = extent(shapes)
    axes = eye_axes(any(shape.tool for shape in shapes), high - low)
    middle, distance = 0.5 * (low + high), _DISTANCE * 0.5 * np.linalg.norm(high - low)

    def projected(points: ndarray) -> ndarray:
        turned = (points - middle) @ axes.T
        turned[:, :2] *= (distance / (distance - turned[:, 2]))[:, None]
        return turned

    def of(shape: Shape) -> Shape:
        tool = shape.tool and seen(shape.tool, float(_BEHIND * distance / _DISTANCE))
        veil = shape.veil and seen(shape.veil)
        return Shape(projected(shape.points), shape.cells, tool, veil)

    def seen(tool: Tool, behind: float = 0.0) -> Tool:
        points = projected(tool.points)
        points[:, 2] -= behind
        if not tool.one_sided:
            return tool._replace(points=points)
        front = signed_areas(*points[tool.triangles, :2].transpose(2, 0, 1)) > 0
        return Tool(points, tool.triangles[:, front], tool.shades[front], True)

    return [of(shape) for shape in shapes]


def extent(shapes: Sequence[Shape]) -> tuple[ndarray, ndarray]:
    """Minimum and maximum coordinates of shapes, each of shape (3,)."""
    tools = [x.points for shape in shapes for x in (shape.tool, shape.veil) if x]
    points = np.vstack([*(shape.points for shape in shapes), *tools])
    return points.min(axis=0), points.max(axis=0)


# Chosen by eye, in mm on the picture, as all sizes and colours below. Distance between
# fibres where the ply is flat, and their width, also on a field.
_SPACING, _WIDTH, _THIN = 2.4, 0.25, 0.15

# Number of triangles of a tool that may hide a line, by distance of their centres.
_CANDIDATES = 8

# Minimum mean side of elements with drawn edges, and widths of the edges and of the
# outline of the ply.
_LEAST_SIDE, _EDGE, _OUTLINE = 1.3, 0.1, 0.2

# Depth behind a tool, relative to its depth, above which the tool hides a line.
_HIDDEN = 0.05

# Marks of elements: line width, radius of the rings around smaller elements, number of
# their corners, and maximum number of rings.
_MARK, _RING, _CORNERS, _FEW = 0.45, 1.6, 24, 12

# Colours of edges on a ply without a field and elsewhere, and of outlines.
_PALE_EDGE, _DARK_EDGE, _OUTER = "#B8B8B8", "#404040", "#202020"

#: Blue and vermilion of Okabe & Ito (2008), distinct for any kind of colour vision.
WARP, WEFT = "#0072B2", "#D55E00"

#: Names and colours of the families.
FAMILIES = [("Warp", WARP), ("Weft", WEFT)]

#: Colour of fibres on a field, and their key.
THREAD = "#202020"
THREADS = [("Fibres", THREAD)]

#: Magenta, which common colour maps do not contain.
REFUSED = "#E6007E"


def lines_of(panel: Panel, scale: float, show_edges: bool | None) -> list[Lines]:
    """All lines drawn on a ply, in order.

    The scale is in mm on the picture per mm of the ply. Without ``show_edges`` element
    edges are drawn if elements are large enough.
    """
    shape = panel.shape
    drawn = []
    if show_edges is None:
        show_edges = not panel.fibres and shape.sides.mean() * scale >= _LEAST_SIDE
    if show_edges:
        colour = _PALE_EDGE if panel.fibres else _DARK_EDGE
        drawn.append(Lines(shape.edges(outer=False), colour, _EDGE))
    drawn.append(Lines(shape.edges(outer=True), _OUTER, _OUTLINE))
    if panel.fibres:
        on_field = panel.scale is not None
        colours = (THREAD, THREAD) if on_field else (WARP, WEFT)
        for family, colour in enumerate(colours):
            ends = panel.fibres.lines(shape.points, family, _SPACING / scale)
            drawn.append(Lines(ends, colour, _THIN if on_field else _WIDTH))
    if panel.marked.size:
        drawn.append(Lines(_marks(panel, scale), REFUSED, _MARK))
    return drawn


def in_front_of_tool(ends: ndarray, tool: Tool | None) -> ndarray:
    """Lines that a tool does not hide, shape (n, 2, 3)."""
    if tool is None or not len(ends):
        return ends
    centres, middles = tool.centres, ends.mean(axis=1)
    near = KDTree(centres[:, :2]).query(middles[:, :2], _CANDIDATES)[1]
    allowed = _HIDDEN * np.ptp(centres[:, 2])
    return ends[centres[near, 2].max(axis=1) <= middles[:, 2] + allowed]


def _marks(panel: Panel, scale: float) -> ndarray:
    """Outline of the marked elements, and rings around a few small ones."""
    edges = panel.shape.outline_of(panel.marked)
    if panel.marked.size > _FEW or panel.shape.sides.mean() * scale > _RING:
        return edges
    centres = panel.shape.centres[panel.marked]
    turn = np.linspace(0, 2 * np.pi, _CORNERS + 1)
    ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1) * _RING / scale
    rings = centres[:, None] + np.stack([ring[:-1], ring[1:]], axis=1)[:, None]
    return np.vstack([edges, rings.reshape(-1, 2, 3)])
