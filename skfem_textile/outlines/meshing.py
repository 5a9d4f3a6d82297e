"""Meshes of an outline whose edges follow the singular fibres."""

import logging
from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.spatial import KDTree
from skfem import Mesh, MeshQuad, MeshTri
from skfem.helpers import cross

from ..fabric import Fabric, unit_vectors
from ..mesh.scikit_fem import with_names
from ..mesh.selection import SINGULAR, edge_numbers, with_named_nodes
from ..mesh.splitting import split_cells
from ..mesh.user_input import coords
from ..solve.conditions import Conditions
from .fibres import SingularFibre, SingularFibres, singular_fibres
from .net import Lines, cut_cells, even, graded, net
from .outline import REST, Outline, by_ring
from .rings import NEAR
from .triangles import refuse_narrow_gaps, triangles

log = logging.getLogger(__name__)

# Round-off of the positions of nodes, relative to the size of the outline: irregular
# meshes are computed on a grid of 1e-8.
_ROUND_OFF = 1e-7

# Components of unit vectors below this are zero.  It is above the rounded cos 90°,
# 6e-17.
_ROUNDING = 1e-15

# Maximum number of triangles of a net.  They take about a minute.
_MOST = 1e6

# Default size of triangles relative to √area.
_SIZE = 1 / 16

#: Least distance of reflections relative to the size of triangles.  Compared by
#: `python -m studies singular_fibres --case "finest*" "choosing *"`.
FINEST = 0.35

# Share of the load that quadratic elements miss which are as high as the distance of
# lines at a singular fibre.  Compared by the cases below.
_AIM = 0.0004

# Largest distance of lines relative to √area, and its growth from line to line away
# from singular fibres.  Compared by
# `python -m studies singular_fibres --case "chosen *"`.
_LARGEST, _GROWTH = 0.22, 2.3

# Distance from other lines, relative to the largest distance, below which a weak line
# is left out.  Compared by the same cases of `python -m studies singular_fibres`.
_WEAK = 0.5


def mesh_outline(
    outline: Outline,
    fabric: Fabric,
    conditions: Conditions | None = None,
    loads: Iterable[Any] = (),
    *,
    fabrics: Mapping[str, Fabric] | None = None,
    density: float = 1.0,
    size: float | None = None,
) -> Mesh:
    """Triangles whose edges follow the fibres across which the shear angle may jump.

    Parameters
    ----------
    outline, fabric, conditions, loads, fabrics
        See `singular_fibres`.
    density
        Factor of the number of lines; 2 halves the size of all elements.
    size
        Length of edges in mm at density 1, for irregular triangles of one size instead
        of a net.  Curved fibres, regions and several fabrics have no net; the default
        is then √area/16.

    Returns
    -------
    Mesh
        A `skfem.MeshTri` with the names of the edges and points of the outline.  Its
        interior edges on singular fibres are named `SINGULAR`.  Regions of the outline
        are subdomains, and `REST` is what is outside of them.

    Raises
    ------
    ValueError
        See `singular_fibres`; also if the density or size is not positive or would give
        too many triangles, or a named point cannot become a node.
    """
    for name, value in (("density", density), ("size", size)):
        if value is not None and not 0 < value < np.inf:
            raise ValueError(f"the {name} must be positive and finite, got {value}")
    if not isinstance(fabric, Fabric):
        raise ValueError(
            f"the fabric of an outline must be a Fabric, not {type(fabric).__name__}; "
            "give the fabrics of regions as `fabrics`"
        )
    curved = any(callable(family.direction) for family in fabric.families)
    if size is None and (curved or fabrics or outline.regions):
        size = _SIZE * float(np.sqrt(outline.shape().area))
    finest = None if size is None else FINEST * size / density
    lines = singular_fibres(
        outline, fabric, conditions, loads, fabrics=fabrics, finest=finest
    )
    for line in lines.left_out():
        log.info("singular fibres: %s", line)
    if size is not None:
        return irregular(outline, lines, size / density)
    largest = _LARGEST * np.sqrt(outline.shape().area)
    A = _directions(fabric)
    to_fibres = np.linalg.inv(A)
    corners = to_fibres @ np.hstack(outline.rings)
    a, b = (
        _lines(lines, 1 - axis, to_fibres[axis], corners[axis], largest, density)
        for axis in range(2)
    )
    if (n := 2.0 * len(a.at) * len(b.at)) > _MOST:
        raise ValueError(
            f"a net with the density {density:g} would have about {n:.1g} triangles: "
            "choose a smaller one, or give a size for irregular triangles"
        )
    p, t = net(outline.shape(), A, a, b)
    mesh = MeshTri(_exact(p, outline, lines.held), t)
    return _named(mesh, outline, lines.fibres)


def mesh_along_fibres(
    outline: Outline | ArrayLike, warp: ArrayLike, weft: ArrayLike, spacing: ArrayLike
) -> Mesh:
    """Mesh of an outline with edges along warp and weft, equally spaced.

    Lines of both families pass through each corner and each named point of the outline,
    with equally spaced lines between them.  If possible, lines of both families meet
    wherever one meets a side; otherwise this is logged at the level INFO.  The cells of
    this net are parallelograms, cut off at the sides.  The mesh consists of these if
    all sides follow the fibres, and otherwise of triangles, into which the cells are
    cut along a diagonal.

    Parameters
    ----------
    outline
        An `Outline`, or its corners in mm, in order, shape (2, n).  Lines also pass
        through a corner of 180°, such as the end of a clamp within a side.
    warp, weft
        Directions of the fibres: vectors of any length, not parallel.
    spacing
        Largest distance in mm between points at which lines meet a side: a number, or
        a pair for distances along x and y.

    Returns
    -------
    Mesh
        A `skfem.MeshQuad` or `skfem.MeshTri` with the names of the edges and points of
        the outline.

    Raises
    ------
    ValueError
        If the outline is not valid (see `Outline`) or has regions, a direction is zero
        or not finite, warp and weft are parallel, or the spacing is not positive or
        would give too many cells.

    Examples
    --------
    >>> square = [[0, 1, 1, 0], [0, 0, 1, 1]]
    >>> mesh_along_fibres(square, (1, 1), (-1, 1), 0.5).nelements
    16
    >>> mesh_along_fibres(square, (1, 0), (0, 1), 0.5).nelements
    4
    """
    outline = outline if isinstance(outline, Outline) else Outline(outline)
    if outline.regions:
        raise ValueError(
            "meshes of equal spacing have no regions: use mesh_outline with fabrics"
        )
    fabric = Fabric(warp=np.asarray(warp), weft=np.asarray(weft))
    h = np.broadcast_to(np.asarray(spacing, dtype=float), 2)
    if not (np.isfinite(h) & (h > 0)).all():
        raise ValueError(f"the spacing must be positive and finite, got {h} mm")
    A = _directions(fabric)
    A[np.abs(A) < _ROUNDING] = 0.0
    to_fibres = np.linalg.inv(A)
    sides = to_fibres @ np.stack(outline.edges())
    points = to_fibres @ np.reshape([*outline.points.values()], (-1, 2)).T
    a, b = even(np.hstack([sides[0], points]), sides, A / h[:, None])
    p, t = cut_cells(outline.shape(), A, a, b)
    kind = MeshQuad if len(t) == 4 else MeshTri
    return _named(kind(_exact(p, outline, []), t), outline, [])


def _directions(fabric: Fabric) -> ndarray:
    """Directions of straight fibres, the columns of a matrix."""
    return np.hstack(fabric.directions(np.zeros((2, 1, 1))))[:, :, 0]


def irregular(
    outline: Outline, lines: SingularFibres, size: float, turn: float = 0.0
) -> Mesh:
    """Irregular triangles of a size with singular fibres and borders as edges.

    ``turn`` is the direction of the rows of nodes, see `triangles`.
    """
    along = [*lines.borders, *(f.points for f in lines.fibres)]
    ends = [end for piece in lines.held for end in piece.T]
    fixed = np.array([*_ends_of_names(outline), *outline.points.values(), *ends])
    fixed, borders = fixed.reshape(-1, 2).T, len(lines.borders)
    found = triangles(outline.shape(), along, size, fixed, turn, borders)
    p = _exact(found.points, outline, lines.held)
    mesh = _named(MeshTri(p, found.triangles), outline, [])
    boundaries, subdomains = dict(mesh.boundaries or {}), {}
    singular = found.edges[:, found.line >= borders]
    if singular.size:
        boundaries[SINGULAR] = edge_numbers(mesh.facets, singular)
    if outline.regions:
        centre = shapely.points(mesh.p[:, mesh.t].mean(axis=1).T)
        rest = np.ones(mesh.nelements, dtype=bool)
        for name, corners in outline.regions.items():
            within = shapely.contains(shapely.Polygon(corners.T), centre)
            subdomains[name], rest = np.flatnonzero(within), rest & ~within
        if rest.any():
            subdomains.setdefault(REST, np.flatnonzero(rest))
    return with_names(mesh, boundaries, subdomains or None)


def quadrilaterals(outline: Outline, size: tuple[int, int]) -> Mesh:
    """Equal quadrilaterals inside an outline, and others between them and its sides.

    Parameters
    ----------
    outline
        The outline.
    size
        Number of quadrilaterals along x and y over its bounding box, before they are
        split.

    Returns
    -------
    Mesh
        A `skfem.MeshQuad` with the names of the edges and points of the outline.  It is
        a `SplitMesh` of quadrilaterals and triangles, unless the outline is a rectangle
        along the axes.

    Raises
    ------
    ValueError
        If the outline has regions, a size is not positive, or there would be too many
        elements.

    Examples
    --------
    >>> rhombus = Outline([[0, 40, 0, -40], [-30, 0, 30, 0]])
    >>> quadrilaterals(rhombus, (4, 3)).nelements
    54
    """
    if outline.regions:
        raise ValueError("meshes of quadrilaterals have no regions: use mesh_outline")
    if min(size) < 1:
        raise ValueError(f"the mesh requires at least 1x1 elements, got {size}")
    if size[0] * size[1] > _MOST:
        raise ValueError(f"the size {size[0]}x{size[1]} is too large: choose less")
    side = np.ptp(outline.polygon, axis=1)[:, None] / np.array([size]).T
    fixed = np.reshape([*_ends_of_names(outline), *outline.points.values()], (-1, 2)).T
    refuse_narrow_gaps(outline.shape(), float(side.max()))
    shape = shapely.transform(outline.shape(), lambda x: x / side.T)
    p, t, quads = _squares(shape, fixed / side)
    p = _exact(np.ascontiguousarray(p * side), outline, [])
    cells = [cell for cell in (t, quads) if cell.size]
    mesh = split_cells(p, cells) if t.size else MeshQuad(p, quads)
    return _named(mesh, outline, [])


def _squares(
    shape: shapely.Polygon, fixed: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Nodes, (2, n), triangles and unit squares in a polygon, anticlockwise.

    Corners of squares are at whole distances from the corner of its bounding box.
    """
    x0, y0, x1, y1 = shape.bounds
    rows = np.meshgrid(np.arange(x0, x1), np.arange(y0, y1))
    lattice = np.reshape(rows, (2, -1)).T
    p, t, *_ = triangles(shape, [], 1.0, fixed, lattice=lattice)
    at = p - [[x0], [y0]]
    cell = np.floor(at[:, t].mean(axis=1))
    corner = at[:, t] - cell[:, None]  # (2, 3, n)
    in_cell = (np.abs(np.abs(corner - 0.5) - 0.5) < _ROUND_OFF).all(axis=(0, 1))
    _, number, count = np.unique(
        cell[:, in_cell], axis=1, return_inverse=True, return_counts=True
    )
    half = count[number.ravel()] == 2
    of_cell = np.unique(number.ravel()[half], return_inverse=True)[1]
    chosen = np.flatnonzero(in_cell)[half]
    x, y = np.rint(corner[:, :, chosen]).astype(int)
    quads = np.empty((4, len(chosen) // 2), dtype=int)
    quads[np.where(y, 3 - x, x), of_cell] = t[:, chosen]
    return p, np.delete(t, chosen, axis=1), quads


def _ends_of_names(outline: Outline) -> list[ndarray]:
    """Corners of an outline at which the names of edges change, each of shape (2,)."""
    n = outline.edges()[0].shape[1]
    names = np.reshape([*outline.boundaries.values()], (-1, n))
    ends: list[ndarray] = []
    for ring, own in zip(outline.rings, by_ring(outline.rings, names), strict=True):
        changes = (own != np.roll(own, 1, axis=1)).any(axis=0)
        ends += list(ring[:, changes].T)
    return ends


def _lines(
    lines: SingularFibres,
    family: int,
    to_fibres: ndarray,
    corners: ndarray,
    largest: float,
    density: float,
) -> Lines:
    """Lines of a family: the coordinate across it, in ascending order."""

    def across(fibres: list[SingularFibre]) -> ndarray:
        return np.array(
            [(to_fibres @ f.points[:, :1])[0] for f in fibres if f.family == family]
        )

    ends = np.array([corners.min(), corners.max()])
    near = NEAR * np.ptp(ends)
    strong = np.unique(across(lines.fibres))
    strong = strong[np.diff(strong, prepend=-np.inf) > near]
    keys, is_strong = strong.tolist(), [True] * len(strong)
    least = _WEAK * largest
    others = [f.points[:, [0, -1]] for f in lines.fibres if f.family != family]
    starts = to_fibres @ np.hstack([np.empty((2, 0)), *others])
    begin = [bool((np.abs(starts - x) <= near).any()) for x in ends]
    for x, apart, of_start in [
        *((x, near, at_start) for x, at_start in zip(ends, begin, strict=True)),
        *((x, least, False) for x in across(lines.weak)),
    ]:
        i = bisect_left(keys, x)
        if all(abs(k - x) > apart for k in keys[max(i - 1, 0) : i + 1]):
            keys.insert(i, x)
            is_strong.insert(i, of_start)
    # A layer of the width w changes the load by a share w/L, of which elements of the
    # size h miss about (h/w)² if they are of second order.
    finest = np.sqrt(_AIM * lines.width * largest / _LARGEST)
    at = graded(np.array(keys), np.array(is_strong), finest, largest, _GROWTH, density)
    return Lines(at, np.isin(at, strong))


def _sides(outline: Outline) -> shapely.STRtree:
    """Search tree of the edges of an outline."""
    return shapely.STRtree(shapely.linestrings(np.stack(outline.edges(), axis=1).T))


def _exact(p: ndarray, outline: Outline, held: list[ndarray]) -> ndarray:
    """Nodes with round-off removed.

    Nodes of the outline are on its edges.  Corners, named points and ends of held parts
    are where they are given, so that functions of position select them.
    """
    p, near = p.copy(), _ROUND_OFF * outline.size
    start, end = outline.edges()
    node, edge = _sides(outline).query(shapely.points(p.T), "dwithin", near)
    a, e = start[:, edge], (end - start)[:, edge]
    share = ((p[:, node] - a) * e).sum(axis=0) / (e * e).sum(axis=0)
    p[:, node] = a + share * e
    given = [
        *held,
        *(x[:, None] for x in outline.points.values()),
        *outline.rings,
    ]
    x = np.hstack(given)
    distance, node = KDTree(p.T).query(x.T)
    close = distance <= near
    p[:, node[close]] = x[:, close]
    return p


def _named(mesh: Mesh, outline: Outline, fibres: list[SingularFibre]) -> Mesh:
    """The mesh with the names of the outline, and of edges on singular fibres."""
    boundary = mesh.boundary_facets()
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    _, edge = _sides(outline).query_nearest(
        shapely.points(middle[:, boundary].T), all_matches=False
    )
    names = {name: boundary[on[edge]] for name, on in outline.boundaries.items()}
    if fibres:
        lines = shapely.MultiLineString([f.points.T for f in fibres])
        shapely.prepare(lines)
        near = 100 * NEAR * outline.size
        ends = shapely.dwithin(lines, shapely.points(mesh.p.T), near)
        on = ends[mesh.facets].all(axis=0) & (mesh.f2t[1] >= 0)
        on[on] = shapely.dwithin(lines, shapely.points(middle[:, on].T), near)
        names[SINGULAR] = np.flatnonzero(on)
    mesh = with_names(mesh, {n: e for n, e in names.items() if len(e)}, None)
    nodes = {}
    for name, x in outline.points.items():
        distance = np.hypot(*(mesh.p - x[:, None]))
        nodes[name] = np.array([distance.argmin()])
        if distance.min() > _ROUND_OFF * outline.size:
            raise ValueError(
                f"point {name!r} at {coords(x)} is too close to another point, a "
                "singular fibre or the outline: choose a smaller size"
            )
    return with_named_nodes(mesh, nodes)


# Angle in radians between an edge and a fibre at its ends above which the edge does not
# follow the fibre.  Edges of the default size turn by 0.02.
_ASTRAY = 0.25


@dataclass(frozen=True, eq=False)
class _Straightened:
    """Directions in triangles with curved edges, mapped to straight edges.

    ``corners`` belong to the triangles, and ``bows`` the vectors by which the curved
    edges, from each corner to the next, deviate from the straight ones in the middle,
    both of shape (2, 3, n).
    """

    name: str
    direction: Any
    corners: ndarray
    bows: ndarray
    tree: shapely.STRtree

    def __call__(self, x: ndarray) -> ndarray:
        points = x.reshape(2, -1)
        vectors = np.array(np.broadcast_to(self._at(points), points.shape))
        i, of = self.tree.query(shapely.points(points.T), "intersects")
        corners, bows, points = self.corners[..., of], self.bows[..., of], points[:, i]
        e = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
        twice = cross(e[:, 1], e[:, 2])
        at = cross(e, points[:, None] - np.roll(corners, -1, axis=1)) / twice
        slope = np.stack([-e[1], e[0]]) / twice
        after, slope_after = np.roll(at, -1, axis=0), np.roll(slope, -1, axis=1)
        curved = points + (4 * at * after * bows).sum(axis=1)
        F = 4 * np.einsum("ijn,kjn->ikn", bows, after * slope + at * slope_after)
        F[0, 0] += 1
        F[1, 1] += 1
        v = self._at(curved)
        # The inverse of F times v, up to its length.
        vectors[:, i] = np.stack([cross(v, F[:, 1]), -cross(v, F[:, 0])])
        return vectors.reshape(x.shape)

    def _at(self, x: ndarray) -> ndarray:
        return unit_vectors(self.name, self.direction, x)


def along_edges(mesh: MeshTri, fabric: Fabric) -> Fabric:
    """Straighten a fabric so that its singular fibres coincide with mesh edges.

    The stretch of a fibre at an angle δ to an edge along which the shear angle jumps by
    Δγ jumps by about δ Δγ, with opposite signs at both ends of the edge.  The elements
    beside the edge cannot follow it, and are too stiff.  Here, triangles with an edge
    on a singular fibre are mapped from triangles with a curved edge, and the fibre
    directions are mapped with them, so that the edge is a fibre.

    Parameters
    ----------
    mesh
        Triangles, such as of `mesh_outline`, with the edges `SINGULAR`.
    fabric
        The fabric; straight fibres stay.

    Returns
    -------
    Fabric
        For a `Ply` on this mesh.

    Examples
    --------
    Circular arcs about the origin: the edges are chords, and fibres.

    >>> from skfem_textile import Condition, Outline, mesh_outline
    >>> outline = Outline([[50, 90, 90, 50], [0, 0, 70, 90]])
    >>> arcs = Fabric(1e4, 0.5, lambda x: np.stack([-x[1], x[0]]), lambda x: x)
    >>> held = {"held": Condition("bottom"), "corner": Condition(lambda x: x[1] > 89)}
    >>> mesh = mesh_outline(outline, arcs, held)
    >>> edges = mesh.facets[:, mesh.boundaries["singular fibres"]]
    >>> along = mesh.p[:, edges[1]] - mesh.p[:, edges[0]]
    >>> quarter = mesh.p[:, edges[0]] + 0.25 * along
    >>> def follow(fabric):
    ...     d = fabric.directions(quarter[:, :, None])
    ...     sine = [abs(cross(v[:, :, 0], along)) / np.hypot(*along) for v in d]
    ...     return bool(np.median(np.minimum(*sine)) < 1e-4)
    >>> follow(arcs), follow(along_edges(mesh, arcs))
    (False, True)
    """
    curved = [family for family in fabric.families if callable(family.direction)]
    edges = np.asarray((mesh.boundaries or {}).get(SINGULAR, ()), dtype=int)
    if not curved or not edges.size:
        return fabric
    bow = np.zeros((2, mesh.nfacets))
    bow[:, edges] = _bows(mesh.p[:, mesh.facets[:, edges]], fabric)
    # scikit-fem's edges of a triangle join corners 0 and 1, 1 and 2, 0 and 2.
    bows = bow[:, mesh.t2f]
    some = (bows != 0).any(axis=(0, 1))
    corners = mesh.p[:, mesh.t[:, some]]
    tree = shapely.STRtree(shapely.polygons(corners.transpose(2, 1, 0)))
    warp, weft = (
        _Straightened(f.name, f.direction, corners, bows[:, :, some], tree)
        for f in fabric.families
    )
    return replace(fabric, warp=warp, weft=weft)


def _bows(ends: ndarray, fabric: Fabric) -> ndarray:
    """Middles of fibres relative to the middles of their chords, shape (2, n).

    ``ends`` of the chords have shape (2, 2, n).
    """
    chord = ends[:, 1] - ends[:, 0]
    bows, closest = np.zeros_like(chord), np.full(chord.shape[1], _ASTRAY)
    for family in fabric.families:
        v = unit_vectors(family.name, family.direction, ends)
        v = np.broadcast_to(v, ends.shape)
        dot = (chord[:, None] * v).sum(axis=0)
        angle = np.arctan2(
            cross(chord[:, None], v) * np.where(dot < 0, -1, 1), np.abs(dot)
        )
        most = np.abs(angle).max(axis=0)
        normal = np.stack([-chord[1], chord[0]])
        # A parabola deviates in the middle by an eighth of its turn times the chord.
        bows = np.where(most < closest, (angle[0] - angle[1]) / 8 * normal, bows)
        closest = np.minimum(closest, most)
    return bows
