"""What a picture consists of, whatever draws it: panels, scales and keys."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy import ndarray
from skfem import Mesh

from ..mesh.contact import signed_areas

# Least extent of a scale, in its unit.  Chosen: above the rounding of zero.
_LEAST_EXTENT = 1e-8

# Most intervals between the numbers on a scale, and those to which its ends are
# rounded; their sizes, times powers of ten.
_MOST_INTERVALS, _FINE_INTERVALS, _ROUND = 6, 20, [1, 2, 2.5, 4, 5, 10]


# From where a ply in space is seen, and one on a tool, whose quarter has x, y > 0:
# azimuth and elevation of the eye in degrees, and its distance over half the diagonal
# of what it sees.  Chosen by eye.
_VIEW, _VIEW_OF_TOOL, _DISTANCE = (-60.0, 25.0), (60.0, 38.0), 4.0

# Height of a tool over its longer side from which it is seen so; a flat one is seen
# from this elevation in degrees, and in between linearly.  Chosen by eye.
_HIGH, _LOWEST = 0.2, 18.0

# How far a tool is behind the ply on it, as a share of half that diagonal.
_BEHIND = 0.02


class Tool(NamedTuple):
    """Triangles of a tool: corners (n, 3), their numbers (3, m), and a grey of each."""

    points: ndarray
    triangles: ndarray
    shades: ndarray

    @property
    def centres(self) -> ndarray:
        """The mean of the corners of each triangle, shape (m, 3)."""
        return np.asarray(self.points[self.triangles].mean(axis=0))


class Shape(NamedTuple):
    """Elements with straight edges.

    Attributes
    ----------
    points
        Their corners in mm, shape (n, 3).
    cells
        Corners of the elements, for each number k of corners an array (k, n_k).
    frames
        In perspective what becomes of vectors at the centres of the elements, shape
        (n_elements, 3, 3); None seen from above.
    tool
        The tool on which they lie, in perspective alone.
    """

    points: ndarray
    cells: tuple[ndarray, ...]
    frames: ndarray | None = None
    tool: Tool | None = None

    @classmethod
    def of(cls, mesh: Mesh, u: ndarray) -> "Shape":
        """A mesh whose vertices are displaced by ``u``, shape (2 or 3, n_vertices)."""
        points = np.zeros((mesh.nvertices, 3))
        points[:, : len(mesh.p)] = mesh.p[:, : mesh.nvertices].T
        points[:, : len(u)] += u[:, : mesh.nvertices].T
        return cls(points, (mesh.t,))

    @property
    def centres(self) -> ndarray:
        """The mean of the corners of each element, shape (n_elements, 3)."""
        return np.vstack([self.points[cell].mean(axis=0) for cell in self.cells])

    def seen(self, vectors: ndarray) -> ndarray:
        """Vectors of the elements as they are seen, shape (n_elements, 3)."""
        if self.frames is None:
            return vectors
        return np.einsum("nij,nj->ni", self.frames, vectors)

    @property
    def sides(self) -> ndarray:
        """Side in mm of a square as large as each element, shape (n_elements,)."""
        areas = []
        for cell in self.cells:
            x, y, _ = self.points[cell].transpose(2, 0, 1)
            areas.append(signed_areas(x, y))
        return np.sqrt(np.abs(np.concatenate(areas)))

    def edges(self, outer: bool) -> ndarray:
        """Ends of the edges, or of the outer ones alone, shape (n_edges, 2, 3)."""
        pairs = [np.stack([cell, np.roll(cell, -1, axis=0)]) for cell in self.cells]
        both = np.hstack([pair.reshape(2, -1) for pair in pairs])
        edges, count = np.unique(np.sort(both, axis=0), axis=1, return_counts=True)
        return self.points[edges[:, count == 1] if outer else edges].swapaxes(0, 1)

    def outline_of(self, elements: ndarray) -> ndarray:
        """Ends of the outer edges of some elements, shape (n_edges, 2, 3)."""
        chosen, first = [], 0
        for cell in self.cells:
            inside = (elements >= first) & (elements < first + cell.shape[1])
            chosen.append(cell[:, elements[inside] - first])
            first += cell.shape[1]
        return Shape(self.points, tuple(chosen)).edges(outer=True)


class Scale(NamedTuple):
    """A scale of colours.

    ``below`` and ``above`` tell whether values lie beyond its ends.
    """

    label: str
    low: float
    high: float
    colours: Any
    below: bool = False
    above: bool = False

    @classmethod
    def of(
        cls,
        label: str,
        reach: tuple[float, float],
        cmap: Any,
        clim: Sequence[float] | None,
    ) -> "Scale":
        """A scale to round numbers that hold ``reach``, or from one limit to the other.

        Raises
        ------
        ValueError
            If there is no such colour map, or the limits are not two that rise.
        """
        try:
            colours = mpl.colormaps.get_cmap(cmap)
        except (TypeError, ValueError):
            raise ValueError(
                f"matplotlib has no colour map {cmap!r}: see matplotlib.colormaps"
            ) from None
        if clim is None:
            low, high = reach[0], max(reach[1], reach[0] + _LEAST_EXTENT)
            ticks = MaxNLocator(_FINE_INTERVALS, steps=_ROUND).tick_values(low, high)
            return cls(label, float(ticks[0]), float(ticks[-1]), colours)
        limits = np.asarray(clim, dtype=float)
        if limits.shape != (2,) or not limits[0] < limits[1] < np.inf > -limits[0]:
            raise ValueError(f"clim {clim!r}: give two finite limits that rise")
        low, high = limits.tolist()
        return cls(label, low, high, colours, reach[0] < low, reach[1] > high)

    def ticks(self, intervals: int = _MOST_INTERVALS) -> ndarray:
        """Round numbers on the scale with at most so many intervals between them."""
        locator = MaxNLocator(intervals, steps=_ROUND)
        ticks = np.asarray(locator.tick_values(self.low, self.high))
        slack = 1e-9 * (self.high - self.low)
        return ticks[(ticks >= self.low - slack) & (ticks <= self.high + slack)]


class Lines(NamedTuple):
    """Straight lines of one colour: their ends (n, 2, 3), and their width in mm."""

    ends: ndarray
    colour: str
    width: float


class Fibres(NamedTuple):
    """Unit vectors along warp and weft of each element, shape (n_elements, 3)."""

    warp: ndarray
    weft: ndarray


class Panel(NamedTuple):
    """One shape with its title, in the colours of a scale or in grey.

    Attributes
    ----------
    title
        Its title.
    shape
        The elements.
    values, scale
        A value for each element, and their scale; None for grey.
    fibres
        Directions of fibres to draw as lines.
    marked
        Numbers of the elements to mark.
    """

    title: str
    shape: Shape
    values: ndarray | None = None
    scale: Scale | None = None
    fibres: Fibres | None = None
    marked: ndarray = np.empty(0, dtype=int)


class Legend(NamedTuple):
    """A scale, and names of colours, below the panels of some columns."""

    first: int
    last: int
    scale: Scale | None = None
    keys: Sequence[tuple[str, str]] = ()


class Sheet(NamedTuple):
    """Rows of panels and, below them, their legends.

    ``extent`` are the least and largest coordinates that all panels show, in mm.
    ``show_edges`` says whether the edges of elements are drawn; None: where there is
    room for them.
    """

    rows: Sequence[Sequence[Panel]]
    legends: Sequence[Legend]
    extent: tuple[ndarray, ndarray]
    show_edges: bool | None = None

    @property
    def panels(self) -> list[Panel]:
        """All panels, row by row."""
        return [panel for row in self.rows for panel in row]


def eye_axes(on_tool: bool, size: ndarray | None = None) -> ndarray:
    """Rows to the right, up and to the eye that sees plies in space, or on a tool.

    Of a shallow tool, by the ``size`` of what is seen, it is lower.
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
    """Shapes in space as an eye sees them, all from the same place.

    Their coordinates become those on the picture, to the right and up, in mm where
    they are as far away as the middle of all, and how much nearer to the eye they are.
    """
    low, high = extent(shapes)
    axes = eye_axes(any(shape.tool for shape in shapes), high - low)
    middle, distance = 0.5 * (low + high), _DISTANCE * 0.5 * np.linalg.norm(high - low)

    def enlarged(places: ndarray) -> tuple[ndarray, ndarray]:
        """Places along the axes, and by how much they are seen larger."""
        turned = (places - middle) @ axes.T
        return turned, distance / (distance - turned[:, 2])

    def of(shape: Shape) -> Shape:
        points, larger = enlarged(shape.points)
        points[:, :2] *= larger[:, None]
        centres, larger = enlarged(shape.centres)
        frames = np.repeat(axes[None], len(centres), axis=0)
        frames[:, :2] *= larger[:, None, None]
        shift = centres[:, :2] * (larger**2 / distance)[:, None]
        frames[:, :2] += shift[:, :, None] * axes[2]
        return Shape(points, shape.cells, frames, shape.tool and behind(shape.tool))

    def behind(tool: Tool) -> Tool:
        points, larger = enlarged(tool.points)
        points[:, :2] *= larger[:, None]
        points[:, 2] -= _BEHIND * distance / _DISTANCE
        return tool._replace(points=points)

    return [of(shape) for shape in shapes]


def extent(shapes: Sequence[Shape]) -> tuple[ndarray, ndarray]:
    """The least and the largest coordinates of shapes, each of shape (3,)."""
    tools = [shape.tool.points for shape in shapes if shape.tool]
    points = np.vstack([*(shape.points for shape in shapes), *tools])
    return points.min(axis=0), points.max(axis=0)
