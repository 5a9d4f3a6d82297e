"""The flat pattern of a trimmed part: what to cut from the flat ply."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.contact import Boundary, contact_of, signed_areas
from ..mesh.user_input import real_numbers
from .sheet import Places, Sheet
from .surfaces import positive_length
from .tool_mesh import curve_length

# Distance of points between two of a curve, over the ply's longest edge.  Chosen: the
# pattern has bends where the ply has nodes, and no finer ones.
_SPACING = 0.5

# Distance of neighbours in the outline over the largest one on the tool from which the
# ply lies on itself there.  Chosen: a diagonal of a cell that shears by 80° is 8 times
# as long in the flat ply.
_JUMP = 10.0

# Most points of an outline.  Chosen: to find them takes a minute.
_MOST = 1_000_000

# Area over squared length up to which an outline encloses nothing.  Chosen: far below
# any strip, and above rounding.
_NOTHING = 1e-9


@dataclass(frozen=True, eq=False)
class FlatPattern:
    """A closed outline in the flat ply, and where it is on the tool.

    Attributes
    ----------
    outline
        Points in the flat ply in mm, shape (2, n), the first not repeated.
    on_tool
        The same points in space in mm, shape (3, n).
    warp, weft
        Unit directions of the fibres in the flat ply there, shape (2, n).
    """

    outline: ndarray
    on_tool: ndarray
    warp: ndarray
    weft: ndarray

    @property
    def length(self) -> float:
        """Length of the outline in mm."""
        return curve_length(self.outline)

    @property
    def area(self) -> float:
        """Area inside the outline in mm²."""
        return abs(self.signed_area)

    @property
    def signed_area(self) -> float:
        """The area in mm², below zero where the outline goes clockwise."""
        return float(signed_areas(*self.outline))


def flat_pattern(
    sheet: Sheet, curve: ArrayLike, spacing: float | None = None
) -> FlatPattern:
    """The outline in the flat ply of a curve that trims the part on the tool.

    Parameters
    ----------
    sheet
        The draped ply.
    curve
        Points of a closed curve on the tool in mm, shape (3, n); a curve of
        `ToolMesh.boundary`, for one.
    spacing
        Largest distance of points in mm.  Where points of the curve are further apart
        there are others between them, on the straight line, which must stay near the
        ply.  Half of the ply's longest edge if not given.

    Raises
    ------
    ValueError
        If an argument is not valid, the ply does not lie on a point of the curve, it
        lies there twice, or the outline crosses itself.

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
    points = _closed(curve)
    if spacing is None:
        spacing = _SPACING * sheet.longest_edge
    spacing = positive_length("flat pattern: spacing", spacing)
    _places(sheet, points)  # before there are as many as a curve far away would have
    points = _spaced(points, spacing)
    places = _places(sheet, points)
    warp, weft = (A[:, places.element] for A in (sheet.warp, sheet.weft))
    outline = sheet.flat_at(places)
    steps = np.linalg.norm(outline - np.roll(outline, -1, axis=1), axis=0)
    if steps.max() > _JUMP * spacing:
        place = np.round(points[:, steps.argmax()], 3).tolist()
        raise ValueError(
            f"flat pattern: the outline jumps by {steps.max():.3g} mm at {place}: the "
            "ply lies on itself there, or the curve goes around the tool"
        )
    if steps.any():
        _refuse_crossing(outline[:, steps > 0], points[:, steps > 0])
    pattern = FlatPattern(outline, points, warp, weft)
    if not pattern.area > _NOTHING * pattern.length**2:
        raise ValueError(
            "flat pattern: the outline encloses no area: give a curve that goes around "
            "the part, and not there and back"
        )
    return pattern


def _places(sheet: Sheet, points: ndarray) -> Places:
    """Points of the ply at points of a curve, (3, n), which must lie on it."""
    places = sheet.at(points)
    off = np.flatnonzero(~places.found)
    if off.size:
        place = ", ".join(f"{c:.7g}" for c in points[:, off[0]])
        raise ValueError(
            f"flat pattern: the ply does not lie on {off.size} of {points.shape[1]} "
            f"points of the curve, the first at [{place}]: lay a larger ply, trim "
            "inside it, or give more points of the curve"
        )
    return places


def _refuse_crossing(outline: ndarray, points: ndarray) -> None:
    """Refuse an outline, (2, n), two edges of which cross or meet; points in space.

    Its area would be that of parts with different signs.
    """
    n = np.arange(outline.shape[1])
    edges = Boundary(outline, np.array([n, np.roll(n, -1)]), n, np.ones(len(n)))
    contact = contact_of(edges)
    if contact is None:
        raise ValueError(
            "flat pattern: too many points of the outline are close to each other to "
            "tell whether it crosses itself: give fewer, or a larger spacing"
        )
    at = np.concatenate([contact.crossing, contact.doubled])
    if at.size:
        place = np.round(points[:, at[0]], 3).tolist()
        raise ValueError(
            f"flat pattern: the outline crosses itself at {place}: give a curve that "
            "goes around one part once"
        )


def _closed(curve: ArrayLike) -> ndarray:
    """Points of a closed curve, none of them twice in a row."""
    points = real_numbers("flat pattern: curve", curve)
    if points.ndim != 2 or len(points) != 3 or not np.isfinite(points).all():
        raise ValueError("flat pattern: curve must be finite points, shape (3, n)")
    points = points[:, (points != np.roll(points, -1, axis=1)).any(axis=0)]
    if points.shape[1] < 3:
        raise ValueError("flat pattern: curve must have three points at least")
    return points


def _spaced(points: ndarray, spacing: float) -> ndarray:
    """A closed curve with points at most a spacing apart."""
    after = np.roll(points, -1, axis=1)
    with np.errstate(over="ignore"):  # infinitely many are refused
        parts = np.linalg.norm(after - points, axis=0) / spacing
    counts = np.maximum(np.ceil(parts), 1.0)
    if not counts.sum() <= _MOST:
        raise ValueError(
            f"flat pattern: the outline would have {counts.sum():.3g} points, {_MOST} "
            "at most: give fewer, or a larger spacing"
        )
    counts = counts.astype(int)
    start = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / counts[start]
    return points[:, start] + share * (after - points)[:, start]
