"""Figures and verdict of the command ``net``."""

import argparse
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.spatial import KDTree

from ..mesh.user_input import coords
from ..nets.crossings import Net
from ..nets.flat_pattern import Dart, FlatPattern, PatternWithDarts, shares_inside
from ..nets.sheet import FibresInSpace
from ..nets.start_search import BestStart
from ..outlines import Outline
from ..surfaces.surface import Axes
from ..surfaces.tool_mesh import closest_on_triangles
from ..surfaces.triangle_mesh import TriangleMesh
from .page import Row

# Share of a cell inside the part above which its shear counts.
_HALF = 0.5

# Share of the area of the part that a whole net covers at least, and of which it covers
# no more than the rest twice.  Cells that are left open at the tips of darts are up to
# 0.6 % of a box (`docs/nets_on_tools/darts.csv`).
_WHOLE = 0.99


class Part(NamedTuple):
    """Nets on a tool, their flat pattern, or why there is none, and the search.

    Courses have one pattern for each net.  ``inside`` is the mask of the triangles of
    the tool in the part, ``no_darts`` the reason why darts were left out,
    ``uncut_angle`` the largest shear angle without darts in degrees, ``meets_itself``
    is true of nets around tubes and closed tools, and ``outline`` belongs to the
    flat ply.
    """

    tool: TriangleMesh
    pieces: Sequence[tuple[Net, ndarray]] = ()
    patterns: Sequence[FlatPattern] = ()
    darts: Sequence[Dart] = ()
    no_pattern: str = ""
    no_darts: str = ""
    uncut_angle: float | None = None
    search: BestStart | None = None
    inside: ndarray = np.ones(1, dtype=bool)
    meets_itself: bool = False
    outline: Outline | None = None

    def has(self, x: ndarray) -> ndarray:
        """Mask of points in space, (3, n), that are on the part."""
        facets = self.tool.facets
        triangle, _ = closest_on_triangles(facets.points, facets.triangles(), x)
        inside = np.broadcast_to(self.inside, facets.n_elements)[triangle]
        return np.asarray(inside & (self.tool.beyond_edges(x) == 0))

    def area(self) -> float:
        """Area of the part on the tool in mm²."""
        return float((self.tool.facets.areas() * self.inside).sum())


def refuse_overlap(part: Part, found: PatternWithDarts) -> None:
    """Refuse a net with darts of which both sides cover the same area of the part."""
    twice = found.area_on_tool - part.area()
    if twice > (1 - _WHOLE) * part.area():
        raise ValueError(
            f"net with darts: both sides of the darts cover {twice:.0f} mm² of the part"
        )


class Cover(NamedTuple):
    """Share of the area of a part that a ply covers, and the place furthest from it."""

    share: float
    place: ndarray

    @classmethod
    def of(cls, part: Part, fibres: FibresInSpace) -> "Cover":
        """Cover by the triangles of the tool that have fibres."""
        facets, covered = part.tool.facets, fibres.covered
        bare = np.flatnonzero(part.inside & ~covered)
        share = 1.0 - float(facets.areas()[bare].sum()) / part.area()
        if not bare.size:
            return cls(share, np.empty((3, 0)))
        centres = facets.centres().T
        away, _ = KDTree(centres[covered]).query(centres[bare])
        return cls(share, centres[bare[away.argmax()]][:, None])

    @property
    def is_whole(self) -> bool:
        """True if it is the whole part, except for open cells at tips of darts."""
        return self.share >= _WHOLE

    def text(self) -> str:
        """Share in words, rounded down."""
        if not self.place.size:
            return "the whole"
        return f"{np.floor(1000 * self.share) / 10:g} % of the"


class Cells(NamedTuple):
    """Cells of the part.

    ``pieces`` are nets with masks of the cells of which at least half is in the
    pattern, or without one, whose centres are on the part; sizes of their shear angles
    in degrees, areas on the tool in mm², and centres.  ``area`` is the area of the net
    in the patterns.
    """

    pieces: list[tuple[Net, ndarray]]
    angles: ndarray
    areas: ndarray
    centres: ndarray
    area: float

    @classmethod
    def of(cls, part: Part) -> "Cells":
        """Cells of the pieces of a part."""
        pieces, angles, areas, centres, whole = [], [], [], [], 0.0
        for k, (net, mask) in enumerate(part.pieces):
            shares, middle = mask.astype(float), net.middles()
            if not part.patterns:
                shares[mask] = part.has(middle[:, mask])
            else:
                one = part.patterns[min(k, len(part.patterns) - 1)]
                shares = shares_inside(net, one)
            inside = mask & (shares >= _HALF)
            whole += float((np.nan_to_num(net.areas()) * shares * mask).sum())
            pieces.append((net, inside))
            angles.append(np.degrees(np.abs(net.shear_angle()[inside])))
            areas.append((net.areas() * shares)[inside])
            centres.append(middle[:, inside])
        if not any(one.size for one in angles):
            raise ValueError("the net has no cell on the tool: use smaller cells")
        numbers = np.concatenate(angles), np.concatenate(areas), np.hstack(centres)
        return cls(pieces, *numbers, whole)


def figures_of(
    part: Part, cells: Cells, cover: Cover, options: argparse.Namespace
) -> dict[str, Any]:
    """Figures of the summary."""
    (net, _), worst = part.pieces[0], cells.angles.argmax()
    figures: dict[str, Any] = {
        "tool": ", ".join(options.tool),
        "fibres_deg": _warp_deg(part.tool, net),
        "cell_mm": net.cell,
        "n_cells": int(cells.angles.size),
        **_xyz("start", net.positions[:, *net.start]),
        **_of_search(part.search),
        "max_shear_angle_deg": float(cells.angles[worst]),
        **_xyz("max_shear_angle", cells.centres[:, worst]),
        "mean_shear_angle_deg": float(np.average(cells.angles, weights=cells.areas)),
        "area_of_tool_mm2": part.tool.facets.area,
    }
    covered = "part" if options.roll_width is None else "courses"
    figures[f"area_of_{covered}_mm2"] = (
        cells.area if part.patterns else cover.share * part.area()
    )
    figures["area_not_covered_mm2"] = (1 - cover.share) * part.area()
    if options.locking_angle is not None:
        figures["locking_angle_deg"] = options.locking_angle
        locked = cells.angles > options.locking_angle
        figures["area_above_locking_angle_mm2"] = float(cells.areas[locked].sum())
    if part.patterns:
        figures["pattern_area_mm2"] = sum(one.area for one in part.patterns)
        figures["pattern_length_mm"] = sum(one.length for one in part.patterns)
    else:
        figures["pattern"] = f"not written: {part.no_pattern}"
    if options.roll_width is not None:
        figures["courses"] = len(part.patterns)
    if part.no_darts:
        figures["darts"] = f"not found: {part.no_darts}"
    elif options.darts:
        figures["darts"] = len(part.darts)
        figures["dart_areas_mm2"] = [dart.area for dart in part.darts]
        figures["dart_lengths_mm"] = [list(dart.lengths) for dart in part.darts]
    if part.uncut_angle is not None:
        figures["max_shear_angle_without_darts_deg"] = part.uncut_angle
    return figures


def _of_search(search: BestStart | None) -> dict[str, Any]:
    """Figures of the search for the best start."""
    if search is None:
        return {}
    return {
        "starts_compared": len(search.measures),
        "best_start_deg": float(np.degrees(search.measure)),
        "default_start_deg": float(np.degrees(search.others[0])),
    }


def _warp_deg(tool: TriangleMesh, net: Net) -> float:
    """Angle of the first warp thread to the x axis of the tool at the start."""
    i, j = net.start
    x = net.positions
    ahead = x[:, min(i + 1, x.shape[1] - 1), j] - x[:, max(i - 1, 0), j]
    along, across = Axes.at(tool, x[:, i, j]).turn[:, :2].T @ ahead
    return round(float(np.degrees(np.arctan2(across, along))), 9)


def _xyz(what: str, point: ndarray) -> dict[str, float]:
    return {
        f"{what}_at_{axis}_mm": x for axis, x in zip("xyz", point.tolist(), strict=True)
    }


def verdict_of(
    part: Part, cells: Cells, cover: Cover, options: argparse.Namespace
) -> list[Row]:
    """Rows: whether the net is whole, the shear within the limit, the pattern cut."""
    verdict = [_net_row(part, cover, options), _shear_row(cells, options)]
    if part.search is not None:
        verdict.append(_start_row(part.search, part, options))
    if part.no_darts:
        text = f"no pattern with darts was found, the net has none: {part.no_darts}"
        verdict.append(("Darts", "bad", text))
    elif useless := useless_darts(part, cells):
        verdict.append(("Darts", "bad", useless))
    elif options.darts and not part.darts:
        verdict.append(("Darts", "good", "none is needed"))
    elif part.darts:
        areas = ", ".join(f"{dart.area:.0f}" for dart in part.darts)
        lengths = np.array([dart.lengths for dart in part.darts])
        apart = float((np.ptp(lengths, axis=1) / lengths.min(axis=1)).max())
        text = (
            f"{len(part.darts)}, of {areas} mm²; the lengths of both edges differ by "
            f"at most {100 * apart:.1f} %"
        )
        if part.uncut_angle is not None:
            text += f"; without darts the shear angle is up to {part.uncut_angle:.1f}°"
        verdict.append(("Darts", "", text))
    if options.roll_width is not None:
        text = f"{len(part.patterns)}, each {options.roll_width:g} mm wide"
        verdict.append(("Courses", "", text))
    if part.patterns:
        area, length = (
            sum(getattr(one, what) for one in part.patterns)
            for what in ("area", "length")
        )
        text = f"{area:.0f} mm² of fabric, {length:.0f} mm to cut"
        verdict.append(("Flat pattern", "good", text))
    else:
        verdict.append(("Flat pattern", "bad", part.no_pattern))
    return verdict


def useless_darts(part: Part, cells: Cells) -> str:
    """Reason why the darts of a part are useless; empty if they are not."""
    largest, uncut = float(cells.angles.max()), part.uncut_angle
    if not part.darts or uncut is None or largest < uncut - _LOWERED:
        return ""
    return (
        f"{len(part.darts)} without use: the shear angle is up to {largest:.1f}°, and "
        f"{uncut:.1f}° without darts: omit --darts, or choose another start"
    )


# Reduction of the largest shear angle in degrees below which darts are useless: the
# printed digit.
_LOWERED = 0.1


def _net_row(part: Part, cover: Cover, options: argparse.Namespace) -> Row:
    """Row of the net: whether it covers the part."""
    folds, leaves = (
        np.hstack([getattr(net, what) for net, _ in part.pieces])
        for what in ("folds", "leaves")
    )
    of_courses = options.roll_width is not None
    what, of = ("the courses cover", "tool") if of_courses else ("covers", "part")
    share = f"{what} {cover.text()} {of}"
    if part.patterns and cover.is_whole:
        return ("Net", "good", f"{share} without folding")
    if part.meets_itself and not part.patterns and cover.is_whole:
        return ("Net", "good", f"{share} and meets itself around the tool")
    folds, leaves = (x[:, part.has(x)] for x in (folds, leaves))
    if folds.size:
        text = f"folds at {_places(folds)}: threads lie on one another"
    elif leaves.size:
        text = f"leaves the tool at {_places(leaves)}"
    elif cover.place.size:
        text = f"{share}, but not {_places(cover.place)}"
    else:
        text = "does not cover the outline of the part"
    return ("Net", "bad", text)


def _start_row(search: BestStart, part: Part, options: argparse.Namespace) -> Row:
    """Row of the best start: its place, its direction, and what it gains."""
    (net, _), default = part.pieces[0], float(search.others[0])
    warp = _warp_deg(part.tool, net)
    found, given = np.degrees([search.measure, default])
    text = f"{coords(net.positions[:, *net.start], 4)} mm, warp at {warp:.1f}°: "
    text += f"{options.best} shear angle {found:.1f}°"
    if np.isnan(given):
        text += "; from the default start the net does not cover the part"
    elif search.measure == default:
        text += ", which is the default start: no other start is better"
    else:
        text += f", {given:.1f}° from the default start"
    return ("Best start", "", f"{text}; {len(search.measures)} starts were compared")


def _shear_row(cells: Cells, options: argparse.Namespace) -> Row:
    """Row of the largest shear angle."""
    worst, limit = cells.angles.argmax(), options.locking_angle
    largest = f"at most {cells.angles[worst]:.1f}°"
    if limit is None:
        return ("Shear angle", "", f"{largest}; no locking angle is given")
    if cells.angles[worst] <= limit:
        return (
            "Shear angle",
            "good",
            f"{largest}, within the locking angle of {limit:g}°",
        )
    at = _places(cells.centres[:, [worst]])
    text = f"{largest} at {at}, above the locking angle of {limit:g}°"
    return ("Shear angle", "bad", text)


def _places(points: ndarray) -> str:
    """First of some points, and their number."""
    more = points.shape[1] - 1
    others = f" and {more} other places" if more else ""
    return f"{coords(points[:, 0], 4)} mm{others}"
