"""Outlines of plies: polygons with holes, named edges, named points and regions."""

import os
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, Self

import numpy as np
import shapely
from numpy import ndarray
from numpy.typing import ArrayLike
from skfem import Mesh

from ..mesh.checks import sides_of_box
from ..mesh.selection import named_nodes
from ..mesh.user_input import coords, printable, real_numbers
from .drawings import kind_of_drawing
from .rings import NEAR, Ring, Segment, rings_of_curves, rings_of_segments, valid_ring

# Names of tables of curves.
_TABLES = ".csv", ".txt", ".dat"

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
        numbers = [""] if len(holes) == 1 else [f" {i + 1}" for i in range(len(holes))]
        self._what = ["the outline", *(f"hole{number}" for number in numbers)]
        given = list(map(valid_ring, self._what, (polygon, *holes)))
        self.rings = [_oriented(ring, i == 0) for i, ring in enumerate(given)]
        turned = [x is not y for x, y in zip(given, self.rings, strict=True)]
        self.polygon, self.holes = self.rings[0], self.rings[1:]
        self.size = float(np.hypot(*np.ptp(self.polygon, axis=1)))
        self._shape = shapely.Polygon(self.polygon.T, [hole.T for hole in self.holes])
        self._refuse_contact()
        self.boundaries = self._named(names or {}, turned)
        self.edge_names = self._first_names()
        self.points = {n: self._point(n, x) for n, x in (points or {}).items()}
        self.regions = {n: self._region(n, x) for n, x in (regions or {}).items()}
        polygons = {name: shapely.Polygon(x.T) for name, x in self.regions.items()}
        for a, b in combinations(polygons, 2):
            both = polygons[a] & polygons[b]
            if both.area > NEAR * self.size**2:
                raise ValueError(
                    f"the regions {a!r} and {b!r} overlap near "
                    f"{coords(both.representative_point())}"
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
        what = self._what
        shapely.prepare([rings[0], outer])
        for i, ring in enumerate(rings[1:], start=1):
            if rings[0].dwithin(ring, NEAR * self.size):
                where = shapely.shortest_line(rings[0], ring)
                raise ValueError(
                    f"{what[i]} touches or crosses the outer polygon at "
                    f"{coords(shapely.get_point(where, 0))}"
                )
            if not outer.contains(ring):
                raise ValueError(
                    f"{what[i]} lies outside the outer polygon, near "
                    f"{coords(shapely.get_point(ring, 0))}"
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
                    f"{coords(shapely.get_point(where, 0))}; give them as one hole"
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
        outer = np.stack(self.edges(), axis=1)[:, :, : sizes[0]]
        for name, on_side in sides_of_box(outer).items():
            boundaries.setdefault(name, np.pad(on_side, (0, first[-1] - sizes[0])))
        of_ring = np.repeat(np.arange(len(sizes)), sizes)
        for i, name in enumerate(self._what[1:], start=1):
            boundaries.setdefault(name, of_ring == i)
        return boundaries

    def _first_names(self) -> list[list[str]]:
        names = np.full(self.edges()[0].shape[1], "", dtype=object)
        for name, edges in reversed(self.boundaries.items()):
            names[edges] = name
        return [part.tolist() for part in by_ring(self.rings, names)]

    def _point(self, name: str, position: ArrayLike) -> ndarray:
        x = real_numbers(f"point {name!r}", position)
        if x.shape != (2,) or not np.isfinite(x).all():
            raise ValueError(f"point {name!r} must be a finite pair (x, y) in mm")
        if self._shape.distance(shapely.Point(x)) > NEAR * self.size:
            raise ValueError(f"point {name!r} at {coords(x)} lies outside the outline")
        return x

    def _region(self, name: str, corners: ArrayLike) -> ndarray:
        if name == REST:
            raise ValueError(
                f"a region must not be named {REST!r}, the name of what is outside of "
                "all regions"
            )
        ring = valid_ring(f"region {name!r}", corners)
        if (self._shape & shapely.Polygon(ring.T)).area <= NEAR * self.size**2:
            raise ValueError(
                f"region {name!r} at {coords(ring[:, 0])} lies outside the outline"
            )
        return _oriented(ring, anticlockwise=True)

    @classmethod
    def of_mesh(
        cls, mesh: Mesh, regions: Mapping[str, ArrayLike] | None = None
    ) -> Self:
        """Outline of a mesh: its boundary, with the names of its edges.

        Collinear nodes are merged, except where names change.  Single named nodes are
        points of the outline.

        Parameters
        ----------
        mesh
            The mesh.
        regions
            See `Outline`.

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
        names: dict[int, list[str]] = {edge: [] for edge in boundary.tolist()}
        for name, edges in (mesh.boundaries or {}).items():
            for edge in np.intersect1d(np.asarray(edges, int), boundary).tolist():
                names[edge].append(name)
        ends = mesh.facets[:, boundary].tolist()
        segments = list(map(Segment, *ends, names.values()))
        points = {
            n: mesh.p[:, at[0]] for n, at in named_nodes(mesh).items() if at.size == 1
        }
        rings = rings_of_segments(mesh.p, segments, "the boundary of the mesh")
        return cls._of_rings(rings, {"points": points, "regions": regions})

    @classmethod
    def from_dxf(
        cls,
        path: str | os.PathLike[str],
        tolerance: float = 0.01,
        unit: str | None = None,
        layer: str | Sequence[str] | None = None,
        **more: Any,
    ) -> Self:
        """Outline from the lines, polylines, arcs and splines of a DXF file.

        Closed curves, and lines that meet end to end, form rings: the outer polygon
        and its holes.  Blocks are read, hidden elements are not.  Edges have the name
        of their layer, except on layer ``0``.  The log ``skfem_textile`` names what is
        ignored, an assumed unit, and the outer polygon if there are holes.

        Parameters
        ----------
        path
            The file.
        tolerance
            Largest distance in mm between a curve and its chords.
        unit
            Unit of length, ``mm``, ``cm``, ``m`` or ``in``; by default as the file
            states, or mm if it states none.
        layer
            Name of a layer, or several, of which curves are read; by default all.
        more
            ``points`` and ``regions``, see `Outline`.

        Raises
        ------
        ModuleNotFoundError
            If ezdxf is not installed.
        ValueError
            If the file cannot be read, or its lines do not form one outline.
        """
        from .drawings.dxf import curves_of_dxf

        curves = curves_of_dxf(path, tolerance, unit, layer)
        return cls._of_rings(rings_of_curves(curves, printable(path), tolerance), more)

    @classmethod
    def from_svg(
        cls,
        path: str | os.PathLike[str],
        tolerance: float = 0.01,
        unit: str | None = None,
        layer: str | Sequence[str] | None = None,
        **more: Any,
    ) -> Self:
        """Outline from the shapes and paths of an SVG file.

        Rings form as in `from_dxf`.  Clones are read, hidden elements are not.  Edges
        have the ``id`` of their element as their name.  The y axis, which points down
        in SVG, is reversed.

        Parameters
        ----------
        path
            The file.
        unit
            Length of one unit of the drawing; by default the width or height of the
            drawing sets the scale, and without units of theirs it is 1 mm.
        layer
            ``id`` of an element or a group, or label of an Inkscape layer, or several.
        tolerance, more
            See `from_dxf`.

        Raises
        ------
        ValueError
            If the file cannot be read, a visible element is not supported, or the lines
            do not form one outline.
        """
        from .drawings.svg import curves_of_svg

        curves = curves_of_svg(path, tolerance, unit, layer)
        return cls._of_rings(rings_of_curves(curves, printable(path), tolerance), more)

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        tolerance: float = 0.01,
        unit: str | None = None,
        layer: str | Sequence[str] | None = None,
        **more: Any,
    ) -> Self:
        """Outline of a DXF or SVG file, or of a table of closed curves.

        The content of a file decides what it is.  The columns of a table are ``x`` and
        ``y``, possibly with units as ``x (cm)``, and ``curve`` if there are holes, as
        in the files ``pattern.csv`` of `skfem_textile.io.write_pattern`.

        Parameters
        ----------
        path, tolerance, unit, layer, more
            See `from_dxf` and `from_svg`; tables are without layers.

        Raises
        ------
        ModuleNotFoundError
            If it is a DXF file and ezdxf is not installed.
        ValueError
            If the file cannot be read, or its curves do not form one outline.
        OSError
            If it cannot be opened.

        Examples
        --------
        >>> rows = "x (cm),y (cm)", "0,0", "20,0", "0,10"
        >>> _ = Path("ply.csv").write_text(chr(10).join(rows))
        >>> float(Outline.from_file("ply.csv").shape().area)  # mm2
        10000.0
        """
        kind, what = kind_of_drawing(path), printable(path)
        if kind is not None:
            read = {"dxf": cls.from_dxf, "svg": cls.from_svg}[kind]
            return read(path, tolerance, unit, layer, **more)
        if Path(path).suffix.lower() not in _TABLES:
            raise ValueError(
                f"{what} contains no DXF or SVG drawing: an outline is read from .dxf, "
                ".svg and .csv files"
            )
        if layer is not None:
            raise ValueError(f"{what} is a table, which has no layers: omit them")
        from .drawings.table import curves_of_table

        curves = curves_of_table(path, unit)
        return cls._of_rings(rings_of_curves(curves, what, tolerance), more)

    @classmethod
    def _of_rings(cls, rings: Sequence[Ring], more: Mapping[str, Any]) -> Self:
        """Outline of rings with names, the outer one first."""
        edges: dict[str, list[tuple[int, list[int]]]] = {}
        for r, ring in enumerate(rings):
            for k, names in enumerate(ring.names):
                for name in names:
                    edges.setdefault(name, []).append((r, [k]))
        corners = [ring.points for ring in rings]
        return cls(corners[0], corners[1:], edges, **more)


def by_ring(rings: Sequence[ndarray], values: ndarray) -> list[ndarray]:
    """Values of edges, shape (..., n_edges), in parts of one ring each."""
    ends = np.cumsum([ring.shape[1] for ring in rings])
    return np.split(values, ends[:-1], axis=-1)


def _oriented(ring: ndarray, anticlockwise: bool) -> ndarray:
    """The ring itself, or its corners in reverse order."""
    turned = shapely.is_ccw(shapely.linearrings(ring.T)) != anticlockwise
    return np.ascontiguousarray(ring[:, ::-1]) if turned else ring


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
