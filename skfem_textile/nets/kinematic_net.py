"""Kinematic net: inextensible rods, pinned at their crossings, laid on a surface.

Two threads start at a point along geodesics or given curves.  Every further crossing is
at the distance of one cell from two known crossings (Mack & Taylor 1956, The fitting of
woven cloth to surfaces, J.  Text.  Inst.  47:T477).  Fibres do not stretch, and forces
play no role: the first two threads determine the whole net.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from ..mesh.user_input import coords, real_numbers
from ..surfaces.analytic import positive_length, three_numbers
from ..surfaces.surface import Surface, onto, tangents
from .crossings import Net, filled_at_seams, quadrant_of, up_to, with_corners
from .laying import (
    FOLDED,
    QUADRANTS,
    Start,
    Status,
    closest,
    curve_points,
    lay,
)

if TYPE_CHECKING:
    from ..surfaces.triangle_mesh import TriangleMesh
    from .seams import Seams

# Distance beyond the edges of a tool, relative to the cell, up to which a cell starts.
# A corner of the tool inside a square cell is at most 0.71 cells from its crossings.
_MARGIN = 0.8


class NetStart(NamedTuple):
    """Start of a net.

    Parameters
    ----------
    point
        Position in mm, shape (3,).
    first
        Direction in space of the x axis of the flat ply there.
    """

    point: ArrayLike
    first: ArrayLike = (1.0, 0.0, 0.0)


def net(
    surface: Surface,
    cell: float,
    warp: tuple[int, int] | None = None,
    weft: tuple[int, int] | None = None,
    *,
    angles: tuple[float, float] = (0.0, np.pi / 2),
    touch: tuple[float, float] = (0.0, 0.0),
    point: ArrayLike | None = None,
    first: ArrayLike = (1.0, 0.0, 0.0),
    warp_along: ArrayLike | None = None,
    weft_along: ArrayLike | None = None,
    over: ndarray | None = None,
    past_edges: bool = False,
) -> Net:
    """Lay a net on a surface.

    The net of a triangulated tool covers the tool, and ends beyond its edges.  A thread
    whose neighbour has ended there continues as a geodesic.  Crossings behind a fold
    are not laid: see `Net.folds`.

    Parameters
    ----------
    surface
        The surface.
    cell
        Length of the rods in mm.
    warp, weft
        Numbers of cells against and along the direction of each family, from the start
        of the net.  By default up to the edges of the tool.
    angles
        Inclination of warp and weft in the flat ply in radians.
    touch
        Start of the net in the flat ply.
    point
        Its position in space; by default (x, y, 0) of ``touch``.
    first
        Direction in space of the x axis of the ply there.
    warp_along, weft_along
        Curves in mm, shape (3, n), that the first threads follow in the order of the
        points, through the start; see `edge_through`.  By default geodesics, at the
        angle at rest to the curve of the other family if there is one.  Beyond its
        curve a thread continues as a geodesic.
    over
        Points of the flat ply in mm, shape (2, n), up to which the net is laid;
        crossings beyond all of them are omitted.  By default all are laid.
    past_edges
        Continue beyond the edges of the tool, where its surface is extrapolated.

    Raises
    ------
    ValueError
        If an argument is not valid.

    Examples
    --------
    A quarter of a sphere, with sides equal to its radius: the shear angle of the last
    cell, 53.6° in theory:

    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> sphere = drape.Sphere(100.0, (0, 0, -100))
    >>> angle = drape.net(sphere, 100 / 64, (0, 64), (0, 64)).shear_angle()
    >>> round(float(np.degrees(angle[-1, -1])), 1)
    53.6
    """
    cell = positive_length("net: cell", cell)
    flat, origin = _flat(angles), real_numbers("net: touch", touch)
    guess = np.array([*origin, 0.0]) if point is None else point
    start = start_of(surface, cell, guess, first, flat, (warp_along, weft_along))
    (laid,) = _laid(
        surface, [start], cell, flat, (warp, weft), origin, over, past_edges
    )
    return laid if past_edges else _with_corners(surface, cell, laid)


def nets(
    surface: Surface,
    cell: float,
    starts: Sequence[NetStart],
    *,
    angles: tuple[float, float] = (0.0, np.pi / 2),
) -> list[Net]:
    """Nets from several starts up to the edges of a tool, laid side by side.

    It takes much less time than one `net` after the other.

    Parameters
    ----------
    surface
        The tool.
    cell, angles
        See `net`.
    starts
        Starts.

    Raises
    ------
    ValueError
        If an argument is not valid.
    """
    if not len(starts):
        raise ValueError("nets: specify at least one start")
    cell = positive_length("net: cell", cell)
    flat = _flat(angles)
    points = onto(surface, np.array([s.point for s in starts], dtype=float).T)
    found = [
        Start(point, tangents(surface, point, np.asarray(s.first)) @ flat)
        for point, s in zip(points.T, starts, strict=True)
    ]
    laid = _laid(surface, found, cell, flat)
    return [_with_corners(surface, cell, of) for of in laid]


def nets_at_seams(
    tool: "TriangleMesh",
    cell: float,
    seams: "Seams",
    locking_angle: float,
    *,
    point: ArrayLike = (0.0, 0.0, 0.0),
    first: ArrayLike = (1.0, 0.0, 0.0),
    angles: tuple[float, float] = (0.0, np.pi / 2),
    warp_along: ArrayLike | None = None,
    weft_along: ArrayLike | None = None,
) -> tuple[Net, Net]:
    """Nets on the left and on the right of seams, which are edges of a tool.

    Both are equal where no thread has crossed a seam or a spot.

    Parameters
    ----------
    tool, cell, seams
        The tool, the length of the rods in mm, and the seams.
    locking_angle
        Shear angle in radians above which cells in spots are left open.
    point, first, angles, warp_along, weft_along
        See `net`.
    """
    flat = _flat(angles)
    start = start_of(tool, cell, point, first, flat, (warp_along, weft_along))
    (laid,) = _laid(tool, [start], cell, flat, seams=seams)
    return filled_at_seams(tool, laid, _MARGIN * cell, seams, locking_angle)


def _with_corners(surface: Any, cell: float, net: Net) -> Net:
    """Net with the cells at the corners of a tool, if the surface has triangles."""
    if not hasattr(surface, "facets"):
        return net
    return with_corners(surface, net, _MARGIN * cell)


def _flat(angles: tuple[float, float]) -> ndarray:
    """Unit vectors of warp and weft in the flat ply, columns of shape (2, 2)."""
    flat = np.array([np.cos(angles), np.sin(angles)])
    if not abs(np.linalg.det(flat)) > FOLDED:
        raise ValueError("net: warp and weft must not be parallel")
    return flat


def start_of(
    surface: Surface,
    cell: float,
    point: ArrayLike,
    first: ArrayLike,
    flat: ndarray,
    along: tuple[ArrayLike | None, ArrayLike | None],
) -> Start:
    """Start of a net on a surface, and on the curves of its first threads."""
    curves = [None if curve is None else curve_points(curve) for curve in along]
    place = three_numbers("net: the start", point)
    for curve in curves:
        if curve is None:
            continue
        on_curve = closest(curve, place).position
        if not np.linalg.norm(on_curve - place) <= cell:
            raise ValueError(
                f"net: the curve of a first thread passes the start "
                f"{coords(place)} mm at a distance of "
                f"{np.linalg.norm(on_curve - place):.3g} mm: specify a start on it"
            )
        place = on_curve
    start = onto(surface, place[:, None])[:, 0]
    directions = np.empty((3, 2))
    if curves[0] is None and curves[1] is None:
        directions = tangents(surface, start, np.asarray(first)) @ flat
    # The angle at rest to the curve of the other family, unless there are two curves.
    cosine, sine = float(flat[:, 0] @ flat[:, 1]), float(np.linalg.det(flat))
    for family in (1, 0) if curves[0] is None else (0, 1):
        curve = curves[family]
        if curve is None:
            continue
        plane = tangents(surface, start, closest(curve, start).tangent)
        directions[:, family] = plane[:, 0]
        if curves[1 - family] is None:
            turn = np.array([cosine, -sine if family else sine])
            directions[:, 1 - family] = plane @ turn
    if not np.linalg.norm(np.cross(*directions.T)) > FOLDED:
        raise ValueError(
            "net: the first threads are parallel at their crossing: specify curves "
            "that cross"
        )
    return Start(start, directions, (curves[0], curves[1]))


def _limits(
    surface: Surface, cell: float, counts: Sequence[Any], past_edges: bool
) -> ndarray:
    """Largest numbers of cells of the quadrants along warp and weft, shape (4, 2)."""
    facets = getattr(surface, "facets", None)
    given = []
    for name, n in zip(("warp", "weft"), counts, strict=True):
        if n is not None:
            given.append(_counts(name, n))
        elif facets is None or past_edges:
            raise ValueError(
                f"net: specify the numbers of cells along the {name}, because the "
                "surface has no edges at which the net could end"
            )
        else:
            # No thread is longer than the way around the box of a tool.
            most = int(np.ceil(np.ptp(facets.points, axis=1).sum() / cell)) + 1
            given.append((most, most))
    (warp, weft) = given
    return np.array([[warp[s > 0], weft[t > 0]] for s, t in QUADRANTS])


def _counts(name: str, n: Any) -> tuple[int, int]:
    """Validated numbers of cells against and along a direction, not both zero."""
    counts = real_numbers(f"net: {name}", n)
    integral = counts.shape == (2,) and (counts == np.round(counts)).all()
    if not integral or counts.min() < 0 or counts.sum() < 1:
        raise ValueError(
            f"net: {name} must be two whole numbers of cells, against and along its "
            f"direction, not both zero; got {n!r}"
        )
    return int(counts[0]), int(counts[1])


def _laid(
    surface: Surface,
    starts: list[Start],
    cell: float,
    flat: ndarray,
    counts: Sequence[Any] = (None, None),
    origin: ArrayLike = (0.0, 0.0),
    over: ndarray | None = None,
    past_edges: bool = False,
    seams: "Seams | None" = None,
) -> list[Net]:
    """Nets from starts on a surface, without the cells at the corners of a tool."""
    origin = np.asarray(origin, dtype=float)
    limits = _limits(surface, cell, counts, past_edges)
    masks = []
    if over is not None:
        ends = np.linalg.solve(flat, over - origin[:, None]) / cell
        for signs, shape in zip(QUADRANTS, limits + 1, strict=True):
            mask = up_to(ends * np.array(signs)[:, None], tuple(shape))
            mask[0], mask[:, 0] = True, True
            masks.append(mask)
    beyond = None if past_edges else getattr(surface, "beyond_edges", None)
    if beyond is not None:
        for start in starts:
            if beyond(start.point[:, None])[0] > 0:
                raise ValueError(
                    f"net: the start {coords(start.point)} mm is beyond the "
                    "edges of the tool: start on the tool"
                )

    def wanted(row: ndarray, i: ndarray, j: ndarray) -> ndarray:
        m, n = limits[row % 4].transpose(2, 0, 1)
        inside = (i <= m) & (j <= n)
        for quadrant, mask in enumerate(masks):
            m, n = limits[quadrant]
            inside[quadrant] &= mask[np.minimum(i, m), np.minimum(j, n)]
        return np.where(inside, Status.LAID, Status.OMITTED)

    def on_tool(x: ndarray) -> ndarray:
        if beyond is None:
            return np.ones(x.shape[1], dtype=bool)
        return np.asarray(beyond(x) <= _MARGIN * cell)

    x, status = lay(surface, starts, cell, wanted, on_tool, seams)
    return [
        _joined(x[:, of], status[of], cell, flat, origin, counts)
        for of in range(len(starts))
    ]


def _joined(
    x: ndarray,
    status: ndarray,
    cell: float,
    flat: ndarray,
    touch: ndarray,
    counts: Sequence[Any],
) -> Net:
    """Join four quadrants to a net with given, or else all, numbers of cells.

    Quadrants end one row behind the last laid one.
    """
    laid, signs = np.isfinite(x[0]), np.array(QUADRANTS)
    ends = [[np.flatnonzero(of.any(axis=k))[-1] for k in (1, 0)] for of in laid]
    sizes = np.array(ends) + 1
    reach = [
        [int(sizes[signs[:, axis] == s, axis].max()) for s in (-1, 1)]
        if given is None
        else [int(n) for n in given]
        for axis, given in enumerate(counts)
    ]
    shape = tuple(sum(sides) + 1 for sides in reach)
    positions = np.full((3, *shape), np.nan)
    statuses = np.full(shape, Status.BEHIND, dtype=np.int8)
    start = reach[0][0], reach[1][0]
    for number, (quadrant, size) in enumerate(zip(QUADRANTS, sizes, strict=True)):
        own = np.s_[..., *quadrant_of(start, quadrant)]
        m, n = np.minimum(size + 1, statuses[own].shape)
        part = np.s_[..., :m, :n]
        positions[own][part] = x[:, number][part]
        statuses[own][part] = status[number][part]
    along = [cell * np.arange(-before, after + 1) for before, after in reach]
    return Net(positions, statuses, (along[0], along[1]), flat, touch)
