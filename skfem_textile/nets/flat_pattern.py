"""Flat pattern of a trimmed part, with or without darts: the outline to cut."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.overlap import Boundary, overlap_of, signed_areas
from ..mesh.requirements import require
from ..mesh.user_input import coords
from ..surfaces.analytic import points_in_space, positive_length
from ..surfaces.tool_mesh import curve_length, unit
from .crossings import Net, corners
from .laying import Status
from .sheet import Sheet, SheetPoints

if TYPE_CHECKING:
    from .darts import NetWithDarts

log = logging.getLogger(__name__)

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
    reach: float | None = None,
) -> FlatPattern:
    """Outline in the flat ply of a curve that trims the part on the tool.

    Holes of the ply inside the curve are holes of the pattern, and a warning in the log
    ``skfem_textile`` names each.  Of a net, cells that were not laid are filled.

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
    reach
        Largest distance of the curves from the ply in mm; by default a quarter of its
        longest edge.

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
    outer, *inner = (outlined(sheet, x, spacing, reach) for x in (curve, *holes))
    return with_holes(sheet, outer, tuple(inner))


def with_holes(
    sheet: Sheet, outer: FlatPattern, holes: tuple[FlatPattern, ...] = ()
) -> FlatPattern:
    """Pattern with holes, and with the holes of the ply, see `flat_pattern`."""
    if not (holes or sheet.holes):
        return outer
    require("a flat pattern with holes", "outlines", "shapely")
    refuse_holes(outer, holes)
    if own := _holes_of_ply(sheet, outer, holes):
        holes += own
        refuse_holes(outer, holes)
    return replace(outer, holes=holes)


def _holes_of_ply(
    sheet: Sheet, outer: FlatPattern, holes: tuple[FlatPattern, ...]
) -> tuple[FlatPattern, ...]:
    """Holes of a ply inside an outline and outside of other holes, each logged."""
    from shapely import Polygon

    # Curves lie on the ply: a hole of it is inside or outside, except for chords.
    left = Polygon(outer.outline.T, [hole.outline.T for hole in holes])
    element = np.zeros(sheet.flat.shape[1], dtype=int)
    element[sheet.elements] = np.arange(sheet.elements.shape[1])
    found = []
    for nodes in sheet.holes:
        cut = Polygon(sheet.flat[:, nodes].T)
        if left.intersection(cut).area < 0.5 * cut.area:
            continue
        at, x = element[nodes], sheet.positions[:, nodes]
        fibres = sheet.warp[:, at], sheet.weft[:, at]
        found.append(FlatPattern(sheet.flat[:, nodes], x, *fibres))
        log.warning(
            "flat pattern: the ply has a hole of %.3g mm² about %s mm inside the "
            "curve: it is cut out of the pattern",
            *(cut.area, coords(x.mean(axis=1))),
        )
    return tuple(found)


def outlined(
    sheet: Sheet,
    curve: ArrayLike,
    spacing: float | None = None,
    reach: float | None = None,
) -> FlatPattern:
    """Outline of one curve without holes, see `flat_pattern`."""
    if spacing is None:
        spacing = _SPACING * sheet.longest_edge
    spacing = positive_length("flat pattern: spacing", spacing)
    if reach is not None:
        reach = positive_length("flat pattern: reach", reach)
    points = _closed(curve)
    # Before points are added, a distant curve is refused.
    _points_on_ply(sheet, points, reach)
    points = spaced(points, spacing)
    places = _points_on_ply(sheet, points, reach)
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
        if cut.contains(left) and not cut.equals(left):
            raise ValueError(
                f"flat pattern: the hole that passes {coords(hole.on_tool[:, 0])} mm "
                "surrounds the outline: specify the outline first, then its holes"
            )
        if not left.contains(cut) or cut.equals(left):
            raise ValueError(
                f"flat pattern: the hole that passes {coords(hole.on_tool[:, 0])} mm "
                "is outside, or crosses the outline or another hole: specify curves "
                "inside the outline that do not meet"
            )
        left = left.difference(cut)


def _points_on_ply(sheet: Sheet, points: ndarray, reach: float | None) -> SheetPoints:
    """Points of the ply at points of a curve, (3, n), which must lie on it."""
    places = sheet.at(points, reach)
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
    points = points_in_space("flat pattern: curve", curve)
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


def shares_inside(net: Net, pattern: FlatPattern) -> ndarray:
    """Share of the area of each cell inside a pattern, shape (n_warp, n_weft)."""
    import shapely

    region = shapely.Polygon(
        pattern.outline.T, [hole.outline.T for hole in pattern.holes]
    )
    flat = net.flat()
    a, b, c, d = corners(flat)
    cells = shapely.polygons(np.stack([d, c, a, b]).transpose(2, 3, 0, 1)[net.cells])
    shapely.prepare(region)
    inside = shapely.contains(region, cells).astype(float)
    cut = shapely.intersects(region, cells) & (inside == 0)
    parts = shapely.area(shapely.intersection(region, cells[cut]))
    inside[cut] = parts / shapely.area(cells[cut])
    shares = np.zeros(net.cells.shape)
    shares[net.cells] = inside
    return shares


# Longest end of an edge that the net does not cover, relative to a cell, and number of
# points for the slope at an end.
_GAP, _SLOPE = 2.5, 4


@dataclass(frozen=True, eq=False)
class Dart:
    """Dart of a flat pattern.

    Attributes
    ----------
    seam
        The seam on the tool in mm, shape (3, n), from the tip.
    edges
        Its two edges in the flat ply, shape (2, n) each.
    """

    seam: ndarray
    edges: tuple[ndarray, ndarray]

    @property
    def area(self) -> float:
        """Area between the edges in mm²."""
        one, other = self.edges
        around = np.column_stack([one, other[:, ::-1]])
        return float(abs(signed_areas(*around)))

    @property
    def lengths(self) -> tuple[float, float]:
        """Lengths of the edges in mm."""
        one, other = (
            float(np.linalg.norm(np.diff(edge), axis=0).sum()) for edge in self.edges
        )
        return one, other


@dataclass(frozen=True, eq=False)
class PatternWithDarts:
    """Flat pattern of a net with darts.

    Attributes
    ----------
    pattern
        The outline, which contains the edges of the darts.
    darts
        The darts.
    area_on_tool
        Area of the part on the tool in mm².
    shear_angle
        Largest magnitude of the shear angle inside the outline in radians.
    shear_angle_beside_spots
        The same without cells in the spots of seams, see `Seams.in_spots`.
    """

    pattern: FlatPattern
    darts: tuple[Dart, ...]
    area_on_tool: float
    shear_angle: float
    shear_angle_beside_spots: float


def pattern_with_darts(
    laid: "NetWithDarts",
    curve: ArrayLike,
    spacing: float | None = None,
    holes: Sequence[ArrayLike] = (),
) -> PatternWithDarts:
    """Flat pattern of a net with darts, trimmed along a curve on the tool.

    Parameters
    ----------
    laid
        The net, which covers the curve.
    curve, spacing, holes
        See `flat_pattern`.

    Raises
    ------
    ValueError
        If an argument is not valid, a point of a curve or of a seam is not covered, the
        outline crosses itself, or a hole crosses it or a seam.
    """
    spacing = 0.5 * laid.sides[0].cell if spacing is None else spacing
    spacing = positive_length("flat pattern: spacing", spacing)
    points = spaced_curve(curve, spacing)
    side = laid.side_of(points)
    parts, darts = _with_seams(laid, points, side, spacing)
    x, flat = (np.hstack(of) for of in zip(*parts, strict=True))
    refuse_crossing(flat, x)
    pattern = FlatPattern(flat, x, *laid.sides[0].fibres(x.shape[1]))
    if len(holes):
        inner = tuple(_hole(laid, hole, spacing) for hole in holes)
        refuse_holes(pattern, inner)
        pattern = replace(pattern, holes=inner)
    lines = [
        SeamLine(number, edge, dart.seam)
        for number, dart in enumerate(darts, 1)
        for edge in dart.edges
    ]
    pattern = replace(pattern, seams=tuple(lines))
    area, largest, beside = 0.0, 0.0, 0.0
    for of, mask in laid.pieces:
        part = replace(of, status=_only(of, mask))
        shares = np.where(mask, shares_inside(part, pattern), 0.0)
        inside = shares > 0
        area += float((of.areas()[inside] * shares[inside]).sum())
        angles = np.abs(of.shear_angle())
        largest = max(largest, float(angles[inside].max(initial=0.0)))
        inside[inside] = ~laid.in_spots(of, inside)
        beside = max(beside, float(angles[inside].max(initial=0.0)))
    return PatternWithDarts(pattern, darts, area, largest, beside)


def _hole(laid: "NetWithDarts", curve: ArrayLike, spacing: float) -> FlatPattern:
    """Outline of a hole, which must not cross a seam."""
    points = spaced_curve(curve, spacing)
    flat = _flat(laid, points, laid.side_of(points))
    steps = np.linalg.norm(flat - np.roll(flat, -1, axis=1), axis=0)
    if steps.max() > JUMP * spacing:
        raise ValueError(
            "net with darts: a hole crosses the seam of a dart at "
            f"{coords(points[:, steps.argmax()])} mm"
        )
    return FlatPattern(flat, points, *laid.sides[0].fibres(points.shape[1]))


def _only(laid: Net, mask: ndarray) -> ndarray:
    """Statuses, with crossings outside the masked cells set to `OMITTED`."""
    keep = np.any(corners(np.pad(mask, 1)), axis=0)
    return np.where(keep, laid.status, Status.OMITTED)


def _with_seams(
    laid: "NetWithDarts", points: ndarray, side: ndarray, spacing: float
) -> tuple[list[tuple[ndarray, ndarray]], tuple[Dart, ...]]:
    """Split an outline at seams; pairs of points on the tool and flat, and darts."""
    cuts: list[tuple[int, ndarray]] = []
    for dart in laid.darts:
        away, *_ = dart.nearest(points)
        k = int(away.argmin())
        end = points[:, k]
        seam = dart.points
        last = int(np.linalg.norm(seam - end[:, None], axis=0).argmin())
        along = seam[:, last] - seam[:, last - 1]
        if (end - seam[:, last]) @ along < 0:
            last -= 1
        trimmed = np.column_stack([seam[:, : last + 1], end])
        cuts.append((k, spaced(trimmed, spacing, closed=False)))
    flat = np.full((2, points.shape[1]), np.nan)
    others = ~np.isin(np.arange(points.shape[1]), [k for k, _ in cuts])
    flat[:, others] = _flat(laid, points[:, others], side[others])
    parts: list[tuple[ndarray, ndarray]] = []
    darts: list[Dart] = []
    begin, n = 0, points.shape[1]
    for k, seam in sorted(cuts, key=lambda cut: cut[0]):
        before, after = (int(side[(k + step) % n]) for step in (-2, 2))
        parts.append((points[:, begin:k], flat[:, begin:k]))
        begin = k + 1
        if before == after:  # the dart is outside the outline
            continue
        edges = _edges(laid, seam)
        parts += [(seam[:, ::-1], edges[before][:, ::-1])]
        parts += [(seam[:, 1:], edges[after][:, 1:])]
        darts.append(Dart(seam, edges))
    parts.append((points[:, begin:], flat[:, begin:]))
    return parts, tuple(darts)


def _edges(laid: "NetWithDarts", seam: ndarray) -> tuple[ndarray, ndarray]:
    """Edges of a dart in the flat ply, shape (2, n) each.

    They are straight next to spots that the net cannot cover without shear.  The tip is
    where both edges are as long as the seam up to the net.
    """
    assert laid.seams is not None
    lengths = np.linalg.norm(np.diff(seam), axis=0)
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    clean = ~laid.seams.in_spots(seam)
    edges = [_located(laid, seam, k) for k in (0, 1)]
    known = [clean & np.isfinite(of[0]) for of in edges]
    both = np.flatnonzero(known[0] & known[1])
    if len(both) < _SLOPE:
        _refuse(seam)
    first = both[[0, _SLOPE - 1]]
    tip = _tip(edges[0][:, first], edges[1][:, first], float(s[first[0]]))
    for of, covered in zip(edges, known, strict=True):
        covered[: first[0]] = False
        covered[0], of[:, 0] = True, tip
        last = np.flatnonzero(covered)[[-_SLOPE, -1]]
        if s[-1] - s[last[1]] > _GAP * laid.sides[0].cell:
            _refuse(seam[:, last[1] + 1 :])
        if last[1] < len(s) - 1:
            slope = np.diff(of[:, last])[:, 0] / np.diff(s[last])
            of[:, -1] = of[:, last[1]] + slope * (s[-1] - s[last[1]])
            covered[-1] = True
        of[:] = [np.interp(s, s[covered], one[covered]) for one in of]
    return edges[0], edges[1]


def _tip(one: ndarray, other: ndarray, length: float) -> ndarray:
    """Apex of the isosceles triangle over the first points of two edges, shape (2,).

    Its sides have the given length.  Edges have two points, (2, 2), and lead away from
    the apex.
    """
    middle, across = 0.5 * (one[:, 0] + other[:, 0]), other[:, 0] - one[:, 0]
    width = float(np.linalg.norm(across))
    along = sum(
        np.diff(edge)[:, 0] / np.linalg.norm(np.diff(edge)) for edge in (one, other)
    )
    if width > 0:
        along -= across * (along @ across) / width**2
    height = np.sqrt(max(length**2 - 0.25 * width**2, 0.0))
    return np.asarray(middle - height * unit(along))


def _located(laid: "NetWithDarts", x: ndarray, side: int) -> ndarray:
    """Flat points of points x on one side of the seam, (2, n); NaN beyond the net."""
    sheet = laid.sheet(side)
    return sheet.flat_at(sheet.at(x))


def _flat(laid: "NetWithDarts", x: ndarray, number: ndarray) -> ndarray:
    """Flat points of points x on the tool, each on the side of its number, (2, n)."""
    flat = np.full((2, x.shape[1]), np.nan)
    for side in (0, 1):
        own = np.flatnonzero(number == side)
        if own.size:
            flat[:, own] = _located(laid, x[:, own], side)
    off = ~np.isfinite(flat[0])
    if off.any():
        _refuse(x[:, off])
    return flat


def _refuse(x: ndarray) -> None:
    """Refuse a net that does not cover points of an outline or a seam."""
    raise ValueError(
        f"net with darts: the net does not cover {x.shape[1]} points of the outline or "
        f"a seam, the first at {coords(x[:, 0])} mm: start elsewhere, or trim "
        "inside"
    )
