"""Outlines of plies: polygons with holes, named edges, named points and regions."""

import os
from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise
from typing import Any, Self

import numpy as np
import shapely
from numpy import ndarray
from numpy.typing import ArrayLike
from shapely.validation import explain_validity
from skfem import Mesh

from ..mesh.checks import refuse_metres
from ..mesh.selection import named_nodes
from ..mesh.user_input import printable, real_numbers

#: Distance relative to the size of an outline below which points coincide.  Chosen: far
#: above rounding (2e-16), far below practical edges.
NEAR = 1e-9

#: Name of the elements of a mesh outside of the regions of its outline.
REST = "rest"

#: Numbers of edges of the outer polygon, or a pair (ring, numbers), or a list of such
#: pairs.
Edges = Any


class Outline:
    """Outline of a ply: a polygon with holes.

    Ring 0 is the outer polygon and ring i the hole i − 1.  Edge k of a ring runs from
    corner k to the next.

    Parameters
    ----------
    polygon
        Corners in mm, shape (2, n), in either order.  Corners of 180° are allowed, such
        as the ends of a clamp within a side.
    holes
        Corners of each hole, shape (2, n).
    names
        Edges by name, numbered as given: numbers of edges of the outer polygon, or a
        pair (ring, numbers), or a list of such pairs.  An edge may have several names.
        Names that are not given are added: ``left``, ``bottom``, ``right`` and ``top``
        for edges of the outer polygon on the bounding box, and ``hole`` for all edges
        of the only hole, or ``hole 1``, ``hole 2``, ...
    points
        Positions (x, y) in mm by name: stitches, supports and loads at points.
    regions
        Corners of regions of another fabric by name, shape (2, n), inside the outline
        or partly inside.

    Attributes
    ----------
    polygon
        Corners of the outer polygon, anticlockwise, shape (2, n).
    holes
        Corners of the holes, clockwise.
    boundaries
        By name, the edges as one bool per edge of all rings, ring after ring.
    edge_names
        For each ring the first name of each edge, given names first; '' if none.
    points, regions
        As given, as arrays; regions are anticlockwise.
    size
        Diagonal of the bounding box in mm.

    Raises
    ------
    ValueError
        If a ring crosses or touches itself or another, has no area, coincident corners
        or corners that are not finite, a hole or point lies outside, regions overlap or
        lie outside, or a name refers to unknown edges.

    Examples
    --------
    >>> square = [[0, 100, 100, 0], [0, 0, 100, 100]]
    >>> hole = [[40, 60, 60, 40], [40, 40, 60, 60]]
    >>> outline = Outline(square, [hole], names={"clamp": [0]})
    >>> outline.edge_names[0]
    ['clamp', 'right', 'top', 'left']
    >>> float(outline.shape().area)
    9600.0
    """

    def __init__(
        self,
        polygon: ArrayLike,
        holes: Sequence[ArrayLike] = (),
        names: Mapping[str, Edges] | None = None,
        points: Mapping[str, ArrayLike] | None = None,
        regions: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        given = [_ring("the outline", polygon)]
        given += [_ring(_hole(i, len(holes)), hole) for i, hole in enumerate(holes)]
        turned = [(signed_area(r) < 0) == (i == 0) for i, r in enumerate(given)]
        self.rings = [
            np.ascontiguousarray(r[:, ::-1]) if t else r
            for r, t in zip(given, turned, strict=True)
        ]
        self.polygon, self.holes = self.rings[0], self.rings[1:]
        self.size = float(np.hypot(*np.ptp(self.polygon, axis=1)))
        self._shape = shapely.Polygon(self.polygon.T, [hole.T for hole in self.holes])
        self._refuse_contact()
        self.boundaries = self._named(names or {}, turned)
        self.edge_names = self._first_names()
        self.points = {n: self._point(n, x) for n, x in (points or {}).items()}
        self.regions = {n: self._region(n, x) for n, x in (regions or {}).items()}
        for a, b in combinations(self.regions, 2):
            both = shapely.Polygon(self.regions[a].T) & shapely.Polygon(
                self.regions[b].T
            )
            if both.area > NEAR * self.size**2:
                raise ValueError(
                    f"the regions {a!r} and {b!r} overlap near "
                    f"{place(both.representative_point())}"
                )

    def shape(self) -> shapely.Polygon:
        """The outline as a polygon of shapely."""
        return self._shape

    def edges(self) -> tuple[ndarray, ndarray]:
        """Starts and ends of the edges of all rings, both of shape (2, n_edges)."""
        ends = [np.roll(ring, -1, axis=1) for ring in self.rings]
        return np.hstack(self.rings), np.hstack(ends)

    def _refuse_contact(self) -> None:
        rings = [shapely.LinearRing(ring.T) for ring in self.rings]
        outer = shapely.Polygon(self.polygon.T)
        what = [_hole(i - 1, len(self.holes)) for i in range(len(rings))]
        for i, ring in enumerate(rings[1:], start=1):
            if rings[0].distance(ring) <= NEAR * self.size:
                where = shapely.shortest_line(rings[0], ring)
                raise ValueError(
                    f"{what[i]} touches or crosses the outer polygon at "
                    f"{place(shapely.get_point(where, 0))}"
                )
            if not outer.contains(ring):
                raise ValueError(
                    f"{what[i]} lies outside the outer polygon, near "
                    f"{place(shapely.get_point(ring, 0))}"
                )
        inner = np.array(rings[1:], dtype=object)
        tree = shapely.STRtree(inner)
        near = tree.query(inner, "dwithin", NEAR * self.size)
        within = tree.query(shapely.polygons(inner), "contains")
        for i, j in np.hstack([near, within]).T:
            if i != j:
                where = shapely.shortest_line(rings[i + 1], rings[j + 1])
                raise ValueError(
                    f"{what[i + 1]} and {what[j + 1]} touch or overlap at "
                    f"{place(shapely.get_point(where, 0))}; give them as one hole"
                )

    def _named(
        self, names: Mapping[str, Edges], turned: Sequence[bool]
    ) -> dict[str, ndarray]:
        """Edges by name, given names first."""
        sizes = [ring.shape[1] for ring in self.rings]
        first = np.concatenate([[0], np.cumsum(sizes)])
        boundaries = {}
        for name, edges in names.items():
            boundaries[name] = np.zeros(first[-1], dtype=bool)
            for ring, numbers in _pairs(name, edges):
                n = sizes[ring] if 0 <= ring < len(sizes) else 0
                if not n:
                    raise ValueError(
                        f"edges {name!r}: there is no ring {ring}; rings are numbered "
                        f"from 0 to {len(sizes) - 1}"
                    )
                if numbers.size == 0 or numbers.min() < 0 or numbers.max() >= n:
                    raise ValueError(
                        f"edges {name!r}: ring {ring} has the edges 0 to {n - 1}, got "
                        f"{numbers.tolist()}"
                    )
                if turned[ring]:
                    numbers = (n - 2 - numbers) % n
                boundaries[name][first[ring] + numbers] = True
        x = np.stack(self.edges())[:, :, : sizes[0]]
        for axis, sides in enumerate((("left", "right"), ("bottom", "top"))):
            low, high = self.polygon[axis].min(), self.polygon[axis].max()
            for name, side in zip(sides, (low, high), strict=True):
                on = (np.abs(x[:, axis] - side) <= NEAR * self.size).all(axis=0)
                if on.any():
                    default = np.pad(on, (0, first[-1] - sizes[0]))
                    boundaries.setdefault(name, default)
        for i in range(len(self.holes)):
            of_hole = np.zeros(first[-1], dtype=bool)
            of_hole[first[i + 1] : first[i + 2]] = True
            boundaries.setdefault(_hole(i, len(self.holes)), of_hole)
        return boundaries

    def _first_names(self) -> list[list[str]]:
        names = np.full(sum(ring.shape[1] for ring in self.rings), "", dtype=object)
        for name, edges in reversed(self.boundaries.items()):
            names[edges] = name
        ends = np.cumsum([ring.shape[1] for ring in self.rings])
        return [part.tolist() for part in np.split(names, ends[:-1])]

    def _point(self, name: str, position: ArrayLike) -> ndarray:
        x = real_numbers(f"point {name!r}", position)
        if x.shape != (2,) or not np.isfinite(x).all():
            raise ValueError(f"point {name!r} must be a finite pair (x, y) in mm")
        if self._shape.distance(shapely.Point(x)) > NEAR * self.size:
            raise ValueError(f"point {name!r} at {place(x)} lies outside the outline")
        return x

    def _region(self, name: str, corners: ArrayLike) -> ndarray:
        if name == REST:
            raise ValueError(
                f"a region must not be named {REST!r}, the name of what is outside of "
                "all regions"
            )
        ring = _ring(f"region {name!r}", corners)
        if (self._shape & shapely.Polygon(ring.T)).area <= NEAR * self.size**2:
            raise ValueError(
                f"region {name!r} at {place(ring[:, 0])} lies outside the outline"
            )
        return ring if signed_area(ring) > 0 else np.ascontiguousarray(ring[:, ::-1])

    @classmethod
    def of_mesh(cls, mesh: Mesh) -> Self:
        """Outline of a mesh: its boundary, with the names of its edges.

        Collinear nodes are merged, except where names change.  Single named nodes are
        points of the outline.

        Raises
        ------
        ValueError
            If the boundary is not one polygon with holes, such as in two parts.

        Examples
        --------
        >>> from skfem import MeshTri
        >>> outline = Outline.of_mesh(MeshTri().refined(3).with_defaults())
        >>> outline.polygon.shape, outline.edge_names
        ((2, 4), [['bottom', 'right', 'top', 'left']])
        """
        boundary = mesh.boundary_facets()
        names = {n: np.asarray(e, int) for n, e in (mesh.boundaries or {}).items()}
        named = [(name, np.isin(boundary, edges)) for name, edges in names.items()]
        of_edge = [
            (int(a), int(b), [name for name, on in named if on[i]])
            for i, (a, b) in enumerate(mesh.facets[:, boundary].T)
        ]
        points = {
            n: mesh.p[:, at[0]] for n, at in named_nodes(mesh).items() if at.size == 1
        }
        what = "the boundary of the mesh"
        return cls._of_segments(mesh.p, of_edge, what, points=points)

    @classmethod
    def from_dxf(
        cls, path: str | os.PathLike[str], tolerance: float = 0.01, **more: Any
    ) -> Self:
        """Outline from the lines, polylines, arcs and splines of a DXF file.

        Lines that meet end to end form rings; the largest one is the outer polygon.
        Edges have the name of their layer, except on layer ``0``.

        Parameters
        ----------
        path
            The file; without units, coordinates are in mm.  Blocks are not read.
        tolerance
            Largest distance in mm between a curve and its chords.
        more
            ``points`` and ``regions``, see `Outline`.

        Raises
        ------
        ModuleNotFoundError
            If ezdxf is not installed.
        ValueError
            If the file cannot be read, or its lines do not form one outline.
        """
        from .files import lines_of_dxf

        return cls._of_lines(lines_of_dxf(path, tolerance), printable(path), **more)

    @classmethod
    def from_svg(
        cls, path: str | os.PathLike[str], tolerance: float = 0.01, **more: Any
    ) -> Self:
        """Outline from the shapes and paths of an SVG file.

        Paths that meet end to end form rings; the largest one is the outer polygon.
        Edges have the ``id`` of their element as their name.  The y axis, which points
        down in SVG, is reversed.  Lengths are in mm: a width of the drawing in mm, cm,
        in, pt or px sets the scale; without a unit, one unit is 1 mm.

        Parameters
        ----------
        path
            The file.
        tolerance, more
            See `from_dxf`.

        Raises
        ------
        ValueError
            If the file cannot be read, or its paths do not form one outline.
        """
        from .files import lines_of_svg

        return cls._of_lines(lines_of_svg(path, tolerance), printable(path), **more)

    @classmethod
    def _of_lines(
        cls, lines: Sequence[tuple[ndarray, str]], what: str, **more: Any
    ) -> Self:
        """Outline of polylines (2, n) with names, joined where their ends coincide."""
        if not lines:
            raise ValueError(f"{what} has no lines")
        p = np.hstack([points for points, _ in lines])
        refuse_not_finite(what, p)
        refuse_metres(p, f"outline of {what}")
        last = np.cumsum([points.shape[1] for points, _ in lines]) - 1
        ends = np.concatenate([[0], last[:-1] + 1, last])
        near = JOINED * float(np.hypot(*np.ptp(p, axis=1)))
        tree = shapely.STRtree(shapely.points(p[:, ends].T))
        pairs = ends[tree.query(tree.geometries, "dwithin", near)]
        number = np.arange(p.shape[1])
        np.minimum.at(number, pairs[0], pairs[1])
        segments, start = [], 0
        for points, name in lines:
            n = points.shape[1]
            nodes = number[start : start + n]
            start += n
            segments += [
                (a, b, [name] if name else [])
                for a, b in pairwise(nodes.tolist())
                if a != b
            ]
        return cls._of_segments(p, segments, what, **more)

    @classmethod
    def _of_segments(
        cls,
        p: ndarray,
        segments: Sequence[tuple[int, int, list[str]]],
        what: str,
        **more: Any,
    ) -> Self:
        """Outline of segments (node, node, names) at positions p."""
        at: dict[int, list[int]] = {}
        for i, (a, b, _) in enumerate(segments):
            at.setdefault(a, []).append(i)
            at.setdefault(b, []).append(i)
        for node, incident in at.items():
            if len(incident) != 2:
                raise ValueError(
                    f"{what}: {len(incident)} line(s) end at {place(p[:, node])}; an "
                    "outline has two at each corner"
                )
        rings, left = [], set(range(len(segments)))
        while left:
            i = min(left)
            node, ring = segments[i][0], []
            while i in left:
                left.remove(i)
                a, b, names = segments[i]
                ring.append((node, names))
                node = b if node == a else a
                i = next((j for j in at[node] if j in left), i)
            rings.append(_merged(p, ring))
        areas = [abs(signed_area(p[:, [n for n, _ in ring]])) for ring in rings]
        rings.insert(0, rings.pop(int(np.argmax(areas))))  # the others are its holes
        edges: dict[str, list[tuple[int, list[int]]]] = {}
        for r, ring in enumerate(rings):
            for k, (_, of_edge) in enumerate(ring):
                for name in of_edge:
                    edges.setdefault(name, []).append((r, [k]))
        corners = [p[:, [n for n, _ in ring]] for ring in rings]
        return cls(corners[0], corners[1:], edges, **more)


#: Distance relative to the size below which ends of lines in a file are joined.
#: Chosen: above the rounding of coordinates with six digits.
JOINED = 1e-5


def place(point: Any) -> str:
    """Position as text, of a point of shapely or an array of shape (2,)."""
    x, y = point.coords[0] if hasattr(point, "coords") else point
    return f"({x + 0.0:.6g}, {y + 0.0:.6g})"


def signed_area(ring: ndarray) -> float:
    """Area of a polygon with corners (2, n), positive if they run anticlockwise."""
    x, y = ring - ring[:, :1]
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def refuse_not_finite(what: str, p: ndarray) -> None:
    """Refuse corners, shape (2, n), that are not finite or cannot be squared."""
    bad = ~(np.abs(p) < 1e100).all(axis=0)  # their squares do not overflow
    if bad.any():
        raise ValueError(f"{what}: corner {bad.argmax()} is not finite, or too large")


def _hole(i: int, n: int) -> str:
    return "hole" if n == 1 else f"hole {i + 1}"


def _ring(what: str, corners: ArrayLike) -> ndarray:
    """Corners of a valid polygon, without the repetition of the first at the end."""
    ring = real_numbers(what, corners)
    if ring.ndim != 2 or ring.shape[0] != 2 or ring.shape[1] < 3:
        raise ValueError(f"{what} must have the shape (2, n), n >= 3, not {ring.shape}")
    refuse_not_finite(what, ring)
    if (ring[:, 0] == ring[:, -1]).all():
        ring = ring[:, :-1]
    size = np.hypot(*np.ptp(ring, axis=1))
    short = np.hypot(*(np.roll(ring, -1, axis=1) - ring)) <= NEAR * size
    if short.any():
        raise ValueError(
            f"{what} has coincident corners at {place(ring[:, short.argmax()])}"
        )
    if ring.shape[1] < 3 or _width(ring) <= NEAR * size:
        raise ValueError(f"{what} has no area, at {place(ring[:, 0])}")
    polygon = shapely.Polygon(ring.T)
    if not polygon.is_valid:
        where = explain_validity(polygon).partition("[")[2].rstrip("]").split()
        raise ValueError(
            f"{what} crosses or touches itself at {place(np.array(where, float))}"
        )
    return ring


def _width(ring: ndarray) -> float:
    """Extent of corners across their main direction, about."""
    centred = ring - ring.mean(axis=1, keepdims=True)
    return float(np.linalg.svd(centred, compute_uv=False)[1])


def _pairs(name: str, edges: Edges) -> list[tuple[int, ndarray]]:
    """Edges as pairs (ring, numbers)."""
    try:
        listed: list[Any] = [edges] if np.isscalar(edges) else list(edges)
        if all(np.isscalar(edge) for edge in listed):
            return [(0, _whole_numbers(listed))]
        pairs = [listed] if np.isscalar(listed[0]) else listed
        return [
            (int(_whole_numbers(ring)[0]), _whole_numbers(numbers))
            for ring, numbers in pairs
        ]
    except (TypeError, ValueError):
        raise ValueError(
            f"edges {name!r} must be numbers of edges, a pair (ring, numbers) or a "
            "list of such pairs"
        ) from None


def _whole_numbers(numbers: Any) -> ndarray:
    array = np.atleast_1d(numbers)
    if array.size and (array.ndim > 1 or array.dtype.kind not in "iu"):
        raise ValueError("edges are numbered")
    return array.astype(int)


def _merged(
    p: ndarray, ring: list[tuple[int, list[str]]]
) -> list[tuple[int, list[str]]]:
    """Ring without collinear nodes between edges of the same names."""
    x = p[:, [node for node, _ in ring]]
    before, after = x - np.roll(x, 1, axis=1), np.roll(x, -1, axis=1) - x
    cross = np.abs(before[0] * after[1] - before[1] * after[0])
    lengths = np.hypot(*before) * np.hypot(*after)
    straight = (cross <= NEAR * lengths) & ((before * after).sum(axis=0) > 0)
    kept = [
        edge
        for i, edge in enumerate(ring)
        if not straight[i] or edge[1] != ring[i - 1][1]
    ]
    return kept if len(kept) >= 3 else ring
