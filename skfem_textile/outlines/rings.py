"""Curves of drawings, rings of those that meet end to end, and their nesting."""

import logging
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from ..mesh.extents import SMALLEST, diagonal_of, extent_of
from ..mesh.graph import components
from ..mesh.user_input import coords, excerpt, real_numbers

log = logging.getLogger(__name__)

# Largest number of elements of a drawing.  Patterns of plies have far fewer; arrays of
# blocks and clones of clones multiply them.
_MOST = 100_000

# Segments of a curve for an estimate of its bend, and the most.
_PROBES, _MOST_POINTS = 32, 10_000

#: Largest and smallest sagitta of an arc relative to its radius: of chords over 45°,
#: and of a circle of the most points.
SAGITTA = 1 - float(np.cos(np.pi / 8))
FINEST = (np.pi / _MOST_POINTS) ** 2 / 2

#: Number of layers or rings that a message lists.
LISTED = 5


class Curve(NamedTuple):
    """A polyline of a drawing.

    Parameters
    ----------
    points
        Corners in mm, shape (2, n).
    name
        Name of its edges, or ''.
    where
        Its place in the file, such as ``layer '0'``.
    layers
        Names by which it is chosen.
    flaw
        Why it cannot be read as it is drawn, if so.
    """

    points: ndarray
    name: str
    where: str
    layers: tuple[str, ...]
    flaw: str = ""


def sampled(at: Callable[[ndarray], ndarray], tolerance: float) -> ndarray:
    """Points of a smooth curve of t from 0 to 1, shape (dimension, n).

    The sagitta of a chord, an eighth of the second difference, is within the tolerance.
    """
    probe = at(np.linspace(0, 1, _PROBES + 1))
    bend = float(np.linalg.norm(np.diff(probe, 2), axis=0).max())
    if not np.isfinite(bend):
        return probe
    radius = diagonal_of(probe) / 2
    allowed = max(min(tolerance, SAGITTA * radius), 1e-300)
    n = np.clip(np.ceil(_PROBES * np.sqrt(bend / (8 * allowed))), 1, _MOST_POINTS)
    return at(np.linspace(0, 1, 1 + int(n)))


def selected(
    what: str,
    curves: Sequence[Curve],
    ignored: Counter[str],
    layer: str | Sequence[str] | None,
    key: Callable[[str], str] = str,
) -> list[Curve]:
    """Curves on the layers, or all; the log names what the file holds besides.

    Parameters
    ----------
    what
        The file, for messages.
    curves, ignored
        Visible curves, and the number of other elements by kind.
    layer
        Name of a layer, or several, or None for all.
    key
        Layers are equal if their keys are equal.

    Raises
    ------
    ValueError
        If there are no curves, a layer has none, or one cannot be read.
    """
    names = ", ".join(f"{n} {excerpt(kind)}" for kind, n in ignored.items())
    if not curves:
        raise ValueError(f"{what} has no lines{names and '; ignored: '}{names}")
    if names:
        log.warning("%s: ignored: %s", what, names)
    chosen = curves if layer is None else _on_layers(what, curves, layer, key)
    for curve in chosen:
        if curve.flaw:
            raise ValueError(curve.flaw)
    return list(chosen)


def _on_layers(
    what: str,
    curves: Sequence[Curve],
    layer: str | Sequence[str],
    key: Callable[[str], str],
) -> list[Curve]:
    wanted = [layer] if isinstance(layer, str) else list(layer)
    if not wanted:
        raise ValueError(f"{what}: layer has no name")
    known = dict.fromkeys(name for curve in curves for name in curve.layers)
    for name in wanted:
        if key(name) not in map(key, known):
            listed = ", ".join(repr(excerpt(other)) for other in [*known][:LISTED])
            more = ", ..." if len(known) > LISTED else ""
            raise ValueError(
                f"{what} has no visible lines on the layer {excerpt(name)!r}; it has "
                f"lines on {listed or 'no layer'}{more}"
            )
    keys = set(map(key, wanted))
    return [curve for curve in curves if not keys.isdisjoint(map(key, curve.layers))]


def refuse_too_many(what: str, number: int) -> None:
    """Refuse too many elements, as from nested clones."""
    if number > _MOST:
        raise ValueError(f"{what} has more than {_MOST} elements")


def refuse_tolerance(tolerance: float) -> None:
    """Refuse a distance between curves and chords that is not positive and finite."""
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise ValueError(f"the tolerance must be positive and finite, got {tolerance}")


log = logging.getLogger(__name__)

#: Distance relative to the size of an outline below which points coincide, and angle in
#: radians below which a fibre runs along an edge.  It is far above rounding (2e-16),
#: and far below practical edges.
NEAR = 1e-9

#: Distance relative to the size below which ends of lines in a file are joined.  It is
#: above the rounding of coordinates with six digits.
JOINED = 1e-5


class Ring(NamedTuple):
    """A closed curve.

    Parameters
    ----------
    points
        Corners, shape (2, n), without the repetition of the first at the end.
    names
        Names of each edge, which runs from its corner to the next.
    where
        Its place in the file.
    """

    points: ndarray
    names: list[list[str]]
    where: str


class Segment(NamedTuple):
    """An edge between two nodes, its names, and the number of its curve."""

    start: int
    end: int
    names: list[str]
    curve: int = 0


def rings_of_curves(curves: Sequence[Curve], what: str, tolerance: float) -> list[Ring]:
    """Rings of an outline, the outer one first.

    Closed curves are rings, and open ones that meet end to end form rings.  Equal rings
    count once.

    Parameters
    ----------
    curves
        Curves of a file.
    what
        The file, for messages.
    tolerance
        Largest distance in mm between a curve and its chords.

    Raises
    ------
    ValueError
        If the curves are not one polygon with holes, or extend over less than 5 mm,
        which indicates another unit.
    """
    p = np.hstack([curve.points for curve in curves])
    refuse_not_finite(what, p)
    if (extent := extent_of(p)) < SMALLEST:
        raise ValueError(
            f"the outline of {what} extends over {extent:.3g} mm: if it is in m, "
            "specify this unit (mesh.unit)"
        )
    size = float(np.hypot(*np.ptp(p, axis=1)))
    rings: dict[int, Ring] = {}
    still_open = []
    for i, curve in enumerate(curves):
        corners = _corners(curve.points)
        if _is_closed(curve.points) and corners.shape[1] > 2:
            names = [[curve.name] if curve.name else [] for _ in corners.T]
            rings[i] = Ring(corners, names, curve.where)
        elif curve.points.shape[1] > 1:
            still_open.append(i)
    near = 2 * tolerance + JOINED * size
    if others := _unrepeated(curves, still_open, list(rings.values()), near):
        rings |= _joined(curves, others, JOINED * size, NEAR * size, what)
    in_order = [_merged(rings[i]) for i in sorted(rings)]
    layers = any(curve.layers for curve in curves)
    return _nested(_distinct(in_order, near), what, layers)


def rings_of_segments(p: ndarray, segments: Sequence[Segment], what: str) -> list[Ring]:
    """Rings of an outline, the outer one first, of segments between nodes at p."""
    traced = [
        _merged(Ring(p[:, nodes], [segments[i].names for i in of], ""))
        for nodes, of in _traced(p, segments, what, ())
    ]
    return _nested(traced, what, False)


def _is_closed(points: ndarray) -> bool:
    gap = float(np.hypot(*(points[:, -1:] - points[:, :1])).max(initial=0.0))
    return gap <= JOINED * float(np.hypot(*np.ptp(points, axis=1)))


def _corners(points: ndarray) -> ndarray:
    """Corners of a closed curve without coincident neighbours."""
    size = float(np.hypot(*np.ptp(points, axis=1)))
    gaps = np.hypot(*(np.roll(points, -1, axis=1) - points))
    corners = points[:, gaps > NEAR * size]
    to_first = np.hypot(*(corners - corners[:, :1]))
    return corners[:, :-1] if (to_first[-1:] <= JOINED * size).any() else corners


def _unrepeated(
    curves: Sequence[Curve], numbers: list[int], rings: list[Ring], near: float
) -> list[int]:
    """Indices of open curves, without those along a ring."""
    tree = shapely.STRtree([shapely.LinearRing(ring.points.T) for ring in rings])
    first = np.array([shapely.Point(curves[i].points[:, 0]) for i in numbers], object)
    repeated = {
        numbers[i]
        for i, j in tree.query(first, "dwithin", near).T
        if _repeats(curves[numbers[i]], rings[j], near)
    }
    return [i for i in numbers if i not in repeated]


def _repeats(curve: Curve, ring: Ring, near: float) -> bool:
    """True if a curve coincides with edges of a ring, which then take its name."""
    line = shapely.LineString(curve.points.T)
    if not shapely.LinearRing(ring.points.T).buffer(near).covers(line):
        return False
    ends = np.roll(ring.points, -1, axis=1)
    x = np.stack([ring.points, (ring.points + ends) / 2, ends], axis=-1).T
    on = shapely.dwithin(shapely.points(x), line, near).all(axis=0)
    for edge in np.flatnonzero(on) if curve.name else ():
        ring.names[edge].append(curve.name)
    return bool(on.any()) or not curve.name


def _joined(
    curves: Sequence[Curve],
    numbers: Sequence[int],
    near: float,
    equal: float,
    what: str,
) -> dict[int, Ring]:
    """Rings of open curves by the number of their first curve.

    Parameters
    ----------
    curves, numbers
        All curves, and the numbers of the open ones.
    near
        Distance in mm below which ends meet.
    equal
        Distance in mm below which other points coincide.
    what
        The file, for messages.
    """
    points = [curves[i].points for i in numbers]
    p = np.hstack(points)
    last = np.cumsum([x.shape[1] for x in points]) - 1
    ends = np.concatenate([[0], last[:-1] + 1, last])
    joined = ends[KDTree(p[:, ends].T).query_pairs(near, output_type="ndarray")]
    pairs = KDTree(p.T).query_pairs(equal, output_type="ndarray")
    labels = components(p.shape[1], np.vstack([joined, pairs]).T)
    nodes = np.unique(labels, return_index=True)[1][labels]  # the first of each
    segments: dict[tuple[int, int], Segment] = {}
    for number, of_curve in zip(numbers, np.split(nodes, last[:-1] + 1), strict=True):
        name = curves[number].name
        for start, end in pairwise(of_curve.tolist()):
            if start != end:
                key = min(start, end), max(start, end)
                segment = segments.setdefault(key, Segment(start, end, [], number))
                if name and name not in segment.names:
                    segment.names.append(name)
    where = [curve.where for curve in curves]
    listed = list(segments.values())
    rings = {}
    for at, of in _traced(p, listed, what, where):
        number = min(listed[i].curve for i in of)
        rings[number] = Ring(p[:, at], [listed[i].names for i in of], where[number])
    return rings


def _traced(
    p: ndarray, segments: Sequence[Segment], what: str, where: Sequence[str]
) -> list[tuple[list[int], list[int]]]:
    """Nodes and segments of each ring of segments between nodes at p."""
    at: dict[int, list[int]] = defaultdict(list)
    for i, segment in enumerate(segments):
        for node in segment[:2]:
            at[node].append(i)
    for node, incident in at.items():
        if len(incident) != 2:
            of = f" of {where[segments[incident[0]].curve]}" if where else ""
            raise ValueError(
                f"{what}: {len(incident)} line(s) end at {coords(p[:, node])}{of}; an "
                "outline has two at each corner: close it, or select layers"
            )
    rings: list[tuple[list[int], list[int]]] = []
    left = dict.fromkeys(range(len(segments)))
    while left:
        i, numbers = next(iter(left)), []
        nodes = [segments[i].start]
        while i in left:
            del left[i]
            numbers.append(i)
            start, end = segments[i][:2]
            nodes.append(end if nodes[-1] == start else start)
            i = next((j for j in at[nodes[-1]] if j in left), i)
        rings.append((nodes[:-1], numbers))
    return rings


def _merged(ring: Ring) -> Ring:
    """Ring without collinear corners between edges of the same names."""
    x, names = ring.points, ring.names
    before, after = x - np.roll(x, 1, axis=1), np.roll(x, -1, axis=1) - x
    cross = np.abs(before[0] * after[1] - before[1] * after[0])
    lengths = np.hypot(*before) * np.hypot(*after)
    straight = (cross <= NEAR * lengths) & ((before * after).sum(axis=0) > 0)
    kept = [i for i, s in enumerate(straight) if not s or names[i] != names[i - 1]]
    if len(kept) < 3:
        return ring
    return Ring(x[:, kept], [names[i] for i in kept], ring.where)


def _distinct(rings: list[Ring], near: float) -> list[Ring]:
    """Rings that are farther apart than a distance from all earlier ones.

    A name of all edges of an omitted ring is passed on to the ring that it equals.
    """
    if len(rings) < 2:
        return rings
    boxes = [np.hstack([r.points.min(axis=1), r.points.max(axis=1)]) for r in rings]
    pairs = KDTree(boxes).query_pairs(near, p=np.inf, output_type="ndarray")
    shapes = [shapely.LinearRing(ring.points.T) for ring in rings]
    kept = dict(enumerate(rings))
    for i, j in sorted(pairs.tolist()):
        if {i, j} <= kept.keys() and (
            shapely.hausdorff_distance(shapes[i], shapes[j]) <= near
        ):
            common = set.intersection(*map(set, kept.pop(j).names))
            names = [[*own, *sorted(common.difference(own))] for own in kept[i].names]
            kept[i] = kept[i]._replace(names=names)
    return list(kept.values())


def _nested(rings: list[Ring], what: str, has_layers: bool) -> list[Ring]:
    """The outer ring of one polygon with holes, and the others.

    Messages name layers only if curves are on layers.

    Raises
    ------
    ValueError
        If rings cross, or if there are several pieces.
    """
    choose = "select its layer" if has_layers else "remove the other curves"
    of = [f"{what}{ring.where and ', '}{ring.where}: the line" for ring in rings]
    corners = [valid_ring(name, r.points) for name, r in zip(of, rings, strict=True)]
    lines = np.array([shapely.LinearRing(x.T) for x in corners])
    tree = shapely.STRtree(lines)
    for i, j in tree.query(lines, "intersects").T:
        if i < j:
            where = shapely.get_point(shapely.shortest_line(lines[i], lines[j]), 0)
            raise ValueError(
                f"{what}: {_about(rings[i])} and {_about(rings[j])} touch or cross at "
                f"{coords(where)}"
            )
    inside = tree.query(shapely.polygons(lines), "contains_properly")[1]
    depth = np.bincount(inside, minlength=len(rings))
    outer = [rings[i] for i in np.flatnonzero(depth == 0)]
    if len(outer) > 1:
        raise ValueError(
            f"{what} has {len(outer)} pieces: {_listed(outer)}; a ply is one: {choose}"
        )
    islands = np.flatnonzero(depth > 1)
    if islands.size:
        raise ValueError(
            f"{what}: {_about(rings[islands[0]])} is a piece in a hole of "
            f"{_about(outer[0])}; a ply is one piece: {choose}"
        )
    holes = [rings[i] for i in np.flatnonzero(depth)]
    if holes and outer[0].where:
        log.warning(
            "%s: the ply is %s, with the hole(s) %s; %s if this is not so",
            *(what, _about(outer[0]), _listed(holes)),
            "select other layers" if has_layers else "remove curves",
        )
    return [*outer, *holes]


def _about(ring: Ring) -> str:
    width, height = np.ptp(ring.points, axis=1).round(1)
    of = ring.where and f" ({ring.where})"
    return f"{width:g} x {height:g} mm{of}"


def _listed(rings: Sequence[Ring]) -> str:
    more = f" and {len(rings) - LISTED} more" if len(rings) > LISTED else ""
    return ", ".join(_about(ring) for ring in rings[:LISTED]) + more


def refuse_not_finite(what: str, p: ndarray) -> None:
    """Refuse corners, shape (2, n), that are not finite or cannot be squared."""
    bad = ~(np.abs(p) < 1e100).all(axis=0)  # their squares do not overflow
    if bad.any():
        raise ValueError(f"{what}: corner {bad.argmax()} is not finite, or too large")


def valid_ring(what: str, corners: ArrayLike) -> ndarray:
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
            f"{what} has coincident corners at {coords(ring[:, short.argmax()])}"
        )
    if ring.shape[1] < 3 or _width(ring) <= NEAR * size:
        raise ValueError(f"{what} has no area, at {coords(ring[:, 0])}")
    polygon = shapely.Polygon(ring.T)
    if not polygon.is_valid:
        where = shapely.is_valid_reason(polygon).partition("[")[2].rstrip("]").split()
        raise ValueError(
            f"{what} crosses or touches itself at {coords(np.array(where, float))}"
        )
    return ring


def _width(ring: ndarray) -> float:
    """Extent of corners across their main direction, about."""
    centred = ring - ring.mean(axis=1, keepdims=True)
    return float(np.linalg.svd(centred, compute_uv=False)[1])
