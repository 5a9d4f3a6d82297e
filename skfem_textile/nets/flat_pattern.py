"""Flat pattern of a trimmed part: the outline to cut from the flat ply."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.overlap import Boundary, overlap_of, signed_areas
from ..mesh.requirements import require
from ..mesh.user_input import coords, real_numbers
from ..surfaces.analytic import positive_length
from ..surfaces.tool_mesh import curve_length
from .sheet import Sheet, SheetPoints

# Spacing of points added to a curve, relative to the longest edge of the ply.  The
# pattern then has kinks only at nodes of the ply.
_SPACING = 0.5

#: Distance between neighbours in the outline, relative to the largest one on the tool,
#: above which the ply overlaps itself.  A guard: the short diagonal of a cell sheared
#: by 80° is 8 times as long in the flat ply.
JUMP = 10.0

# Maximum number of points of an outline.  Locating them takes a minute.
_MOST = 1_000_000

# Area over squared length below which an outline encloses no area.  It is far below any
# strip, and above rounding.
_NOTHING = 1e-9


class SeamLine(NamedTuple):
    """Line of a flat pattern that is sewn to another one with the same number.

    Both edges of a dart have one number, and both sides of the seam of two courses.

    Parameters
    ----------
    number
        Number of the seam, from 1 on.
    flat
        Points in the flat ply in mm, shape (2, n).
    on_tool
        The same points in space in mm, shape (3, n).
    """

    number: int
    flat: ndarray
    on_tool: ndarray


@dataclass(frozen=True, eq=False)
class FlatPattern:
    """Closed outline in the flat ply, and its position on the tool.

    Attributes
    ----------
    outline
        Points in the flat ply in mm, shape (2, n), the first not repeated.
    on_tool
        The same points in space in mm, shape (3, n).
    warp, weft
        Unit directions of the fibres in the flat ply at these points, shape (2, n).
    holes
        Outlines of holes, inside the outline.
    seams
        Lines that are joined to others.
    """

    outline: ndarray
    on_tool: ndarray
    warp: ndarray
    weft: ndarray
    holes: tuple["FlatPattern", ...] = ()
    seams: tuple[SeamLine, ...] = ()

    @property
    def length(self) -> float:
        """Length of the outline and of the holes in mm."""
        return curve_length(self.outline) + sum(hole.length for hole in self.holes)

    @property
    def area(self) -> float:
        """Area inside the outline and outside the holes in mm²."""
        return abs(self.signed_area) - sum(hole.area for hole in self.holes)

    @property
    def signed_area(self) -> float:
        """Area in mm² inside the outline, negative for a clockwise one."""
        return float(signed_areas(*self.outline))

    def moved(self, shift: ndarray) -> "FlatPattern":
        """The pattern at another place of the plane, moved by ``shift``, (2,)."""
        by = shift[:, None]
        return replace(
            self,
            outline=self.outline + by,
            holes=tuple(hole.moved(shift) for hole in self.holes),
            seams=tuple(seam._replace(flat=seam.flat + by) for seam in self.seams),
        )


def flat_pattern(
    sheet: Sheet,
    curve: ArrayLike,
    spacing: float | None = None,
    holes: Sequence[ArrayLike] = (),
) -> FlatPattern:
    """Outline in the flat ply of a curve that trims the part on the tool.

    Parameters
    ----------
    sheet
        The draped ply.
    curve
        Points of a closed curve on the tool in mm, shape (3, n), such as a curve of
        `ToolMesh.boundary`.
    spacing
        Largest distance between points in mm.  Points are added on straight lines
        between points of the curve further apart; these lines must stay near the ply.
        By default half of the longest edge of the ply.
    holes
        Closed curves that are cut out, inside the outline.

    Raises
    ------
    ValueError
        If an argument is not valid, a point of a curve is not covered by the ply or
        covered twice, an outline crosses itself, or a hole crosses the outline or
        another hole.

    Examples
    --------
    A circle at the polar angle 0.5 of a sphere of the radius 100 mm, cut from a net:

    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> sphere = drape.Sphere(100.0, (0, 0, -100))
    >>> sheet = drape.Sheet.of_net(drape.net(sphere, 2.0, (30, 30), (30, 30)))
    >>> t = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    >>> x, y = 100 * np.sin(0.5) * np.array([np.cos(t), np.sin(t)])
    >>> pattern = drape.flat_pattern(sheet, [x, y, 0 * t + 100 * np.cos(0.5) - 100])
    >>> round(pattern.length), round(pattern.area)
    (311, 7695)
    """
    if spacing is None:
        spacing = _SPACING * sheet.longest_edge
    spacing = positive_length("flat pattern: spacing", spacing)
    outer = _outlined(sheet, curve, spacing)
    if not len(holes):
        return outer
    require("a flat pattern with holes", "outlines", "shapely")
    inner = tuple(_outlined(sheet, hole, spacing) for hole in holes)
    refuse_holes(outer, inner)
    return replace(outer, holes=inner)


def _outlined(sheet: Sheet, curve: ArrayLike, spacing: float) -> FlatPattern:
    """Outline of one curve."""
    points = _closed(curve)
    _points_on_ply(sheet, points)  # refuses a distant curve before points are added
    points = spaced(points, spacing)
    places = _points_on_ply(sheet, points)
    warp, weft = (A[:, places.element] for A in (sheet.warp, sheet.weft))
    outline = sheet.flat_at(places)
    steps = np.linalg.norm(outline - np.roll(outline, -1, axis=1), axis=0)
    if steps.max() > JUMP * spacing:
        raise ValueError(
            f"flat pattern: the outline jumps by {steps.max():.3g} mm at "
            f"{coords(points[:, steps.argmax()])} mm, "
            "because the ply overlaps itself there or the curve runs around the tool: "
            "specify another curve, or a start inside it"
        )
    if steps.any():
        refuse_crossing(outline[:, steps > 0], points[:, steps > 0])
    pattern = FlatPattern(outline, points, warp, weft)
    if not pattern.area > _NOTHING * pattern.length**2:
        raise ValueError(
            "flat pattern: the outline encloses no area: specify a curve that runs "
            "around the part and does not return along itself"
        )
    return pattern


def refuse_holes(outer: FlatPattern, holes: tuple[FlatPattern, ...]) -> None:
    """Refuse holes that are not inside the outline, or that overlap."""
    from shapely import Polygon

    left = Polygon(outer.outline.T)
    for hole in holes:
        cut = Polygon(hole.outline.T)
        if not left.contains(cut):
            raise ValueError(
                f"flat pattern: the hole that passes {coords(hole.on_tool[:, 0])} mm "
                "crosses the outline or another hole: specify curves that do not meet"
            )
        left = left.difference(cut)


def _points_on_ply(sheet: Sheet, points: ndarray) -> SheetPoints:
    """Points of the ply at points of a curve, (3, n), which must lie on it."""
    places = sheet.at(points)
    off = np.flatnonzero(~places.found)
    if off.size:
        raise ValueError(
            f"flat pattern: the ply does not lie on {off.size} of {points.shape[1]} "
            f"points of the curve, the first at {coords(points[:, off[0]])} mm: lay "
            "the ply up to there, trim inside it, or specify more points of the curve"
        )
    return places


def refuse_crossing(outline: ndarray, points: ndarray) -> None:
    """Refuse an outline with crossing or touching edges; ``points`` in space.

    Its area would have parts of different signs.
    """
    n = np.arange(outline.shape[1])
    edges = Boundary(outline, np.array([n, np.roll(n, -1)]), n, np.ones(len(n)))
    overlap = overlap_of(edges)
    if overlap is None:
        raise ValueError(
            "flat pattern: too many points of the outline are close to each other to "
            "determine whether it crosses itself: use fewer points, or a larger "
            "spacing"
        )
    at = np.concatenate([overlap.crossing, overlap.doubled])
    if at.size:
        raise ValueError(
            f"flat pattern: the outline crosses itself at {coords(points[:, at[0]])} "
            "mm: specify a curve that runs once around the part"
        )


def _closed(curve: ArrayLike) -> ndarray:
    """Points of a closed curve without consecutive duplicates."""
    points = real_numbers("flat pattern: curve", curve)
    if points.ndim != 2 or len(points) != 3 or not np.isfinite(points).all():
        raise ValueError("flat pattern: curve must be finite numbers of shape (3, n)")
    points = points[:, (points != np.roll(points, -1, axis=1)).any(axis=0)]
    if points.shape[1] < 3:
        raise ValueError("flat pattern: curve must have at least three distinct points")
    return points


def spaced_curve(curve: ArrayLike, spacing: float) -> ndarray:
    """Points of a closed curve without duplicates, at most a spacing apart."""
    return spaced(_closed(curve), spacing)


def spaced(points: ndarray, spacing: float, closed: bool = True) -> ndarray:
    """Polyline with added points, at most a spacing apart."""
    after = np.roll(points, -1, axis=1)
    with np.errstate(over="ignore"):  # infinitely many are refused
        parts = np.linalg.norm(after - points, axis=0) / spacing
    counts = np.maximum(np.ceil(parts), 1.0)
    if not closed:
        counts[-1] = 1.0
    if not counts.sum() <= _MOST:
        raise ValueError(
            f"flat pattern: the outline would have {counts.sum():.3g} points, but at "
            f"most {_MOST} are allowed: use fewer points, or a larger spacing"
        )
    counts = counts.astype(int)
    start = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / counts[start]
    return points[:, start] + share * (after - points)[:, start]
