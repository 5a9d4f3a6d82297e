"""Flat patterns of nets with darts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.overlap import signed_areas
from ..mesh.user_input import coords
from ..surfaces.analytic import positive_length
from ..surfaces.triangles import unit
from .crossings import Net
from .darts import NetWithDarts
from .flat_pattern import (
    JUMP,
    FlatPattern,
    SeamLine,
    refuse_crossing,
    refuse_holes,
    spaced,
    spaced_curve,
)
from .laying import Status
from .part import shares_inside

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
    laid: NetWithDarts,
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
    pattern = FlatPattern(flat, x, *_fibres(laid, x.shape[1]))
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


def _hole(laid: NetWithDarts, curve: ArrayLike, spacing: float) -> FlatPattern:
    """Outline of a hole, which must not cross a seam."""
    points = spaced_curve(curve, spacing)
    flat = _flat(laid, points, laid.side_of(points))
    steps = np.linalg.norm(flat - np.roll(flat, -1, axis=1), axis=0)
    if steps.max() > JUMP * spacing:
        raise ValueError(
            "net with darts: a hole crosses the seam of a dart at "
            f"{coords(points[:, steps.argmax()])} mm"
        )
    return FlatPattern(flat, points, *_fibres(laid, points.shape[1]))


def _only(laid: Net, mask: ndarray) -> ndarray:
    """Statuses, with crossings outside the masked cells set to `OMITTED`."""
    keep = np.zeros(laid.status.shape, dtype=bool)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        keep[i : i + mask.shape[0], j : j + mask.shape[1]] |= mask
    return np.where(keep, laid.status, Status.OMITTED)


def _with_seams(
    laid: NetWithDarts, points: ndarray, side: ndarray, spacing: float
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


def _edges(laid: NetWithDarts, seam: ndarray) -> tuple[ndarray, ndarray]:
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


def _located(laid: NetWithDarts, x: ndarray, side: int) -> ndarray:
    """Flat points of points x on one side of the seam, (2, n); NaN beyond the net."""
    sheet = laid.sheet(side)
    places, flat = sheet.at(x), np.full((2, x.shape[1]), np.nan)
    flat[:, places.found] = sheet.flat_at(places)[:, places.found]
    return flat


def _flat(laid: NetWithDarts, x: ndarray, number: ndarray) -> ndarray:
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


def _fibres(laid: NetWithDarts, n: int) -> tuple[ndarray, ndarray]:
    """Directions of warp and weft at n points of the flat ply, shape (2, n)."""
    warp, weft = (np.tile(a[:, None], (1, n)) for a in laid.sides[0].directions.T)
    return warp, weft
