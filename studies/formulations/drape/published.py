"""A kinematic net by a published method, for comparison with `drape.net`.

KinDrape (Krogh, Bak, Lindgaard, Olesen, Hermansen, Broberg, Kepler, Lund & Jakobsen
2021, A simple MATLAB draping code for fiber-reinforced composites with application to
optimization of manufacturing process parameters, Struct. Multidisc. Optim. 64:457)
places the cells of a pin-jointed net in three steps.  The first edge lies in a vertical
plane through the origin.  Generator cells, in both directions from the first cell,
minimise the sum of the shear angles at their four corners.  The other cells are
constrained: three corners are known, and the fourth is the intersection of two spheres
with the surface.  Unlike `drape.net`, the method has no first threads.  This module
implements the description; it does not copy the authors' MIT-licensed program.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray
from scipy.optimize import brentq, minimize_scalar

from skfem_textile import Surface, drape

# Half of the search arc of a corner, and the largest rotation of a generator cell
# relative to the square, in radians.
_ARC, _TURN = 1.2, 0.7

# Tolerance of the rotation of a generator cell in radians.
_EXACT = 1e-9

#: First edge of each arm of generator cells, as two points of the first cell, and
#: direction of the arm, in rows and columns.
_ARMS = (
    ((0, 0), (0, 1), (1, 0)),
    ((1, 1), (0, 1), (0, 1)),
    ((0, 1), (0, 0), (-1, 0)),
    ((0, 0), (1, 0), (0, -1)),
)


@dataclass(frozen=True)
class Draping:
    """A draping example of the authors of the method, in mm.

    Attributes
    ----------
    surface
        The mould.
    cell
        Side length of a cell.
    nodes
        Numbers of nodes in rows and columns.
    origin
        Zero-based row and column of the origin.
    place
        x and y of the origin.
    degrees
        Angle of the rows to the x axis, seen from above.
    """

    surface: Surface
    cell: float
    nodes: tuple[int, int]
    origin: tuple[int, int]
    place: tuple[float, float]
    degrees: float = 0.0


def _double_curved(x: ndarray, y: ndarray) -> drape.Height:
    """The authors' double-curved mould of 500 mm × 500 mm, a cubic in metres."""
    x, y = 1e-3 * x, 1e-3 * y
    h = 1.004 * x + 1.089 * y - 3.667 * x**2 - 4.4 * x * y - 3.75 * y**2
    h = h + 3.086 * x**3 + 8.889 * x**2 * y + 4.321 * y**3
    h_x = 1.004 - 7.334 * x - 4.4 * y + 9.258 * x**2 + 17.778 * x * y
    h_y = 1.089 - 4.4 * x - 7.5 * y + 8.889 * x**2 + 12.963 * y**2
    h_xx = -7.334 + 18.516 * x + 17.778 * y
    h_xy = -4.4 + 17.778 * x
    h_yy = -7.5 + 25.926 * y
    return drape.Height(1e3 * h, h_x, h_y, 1e-3 * h_xx, 1e-3 * h_xy, 1e-3 * h_yy)


#: The authors' examples by name.  Their hemisphere has radius 1, here 100 mm.  From its
#: side they place 24 nodes per row; the threads of the net fold beyond the 20th.
DRAPINGS = {
    "hemisphere, from the pole": Draping(
        drape.Sphere(100.0), 8.0, (24, 24), (11, 11), (-4.0, -4.0)
    ),
    "hemisphere, from its side": Draping(
        drape.Sphere(100.0), 8.0, (20, 20), (2, 2), (0.0, -90.0), 60.0
    ),
    "double-curved mould": Draping(
        drape.HeightField(_double_curved), 22.0, (21, 21), (10, 10), (250.0, 250.0)
    ),
}


def published_net(draping: Draping, first: ndarray) -> ndarray:
    """Nodes of the net of the published method, shape (3, n_rows, n_columns).

    ``first`` is the origin in space, shape (3,).
    """
    surface, d = draping.surface, draping.cell
    x = np.full((3, *draping.nodes), np.nan)
    row, column = draping.origin
    x[:, row, column] = first
    turn = np.radians(draping.degrees + 90.0)
    along = np.array([np.cos(turn), np.sin(turn), 0.0])
    x[:, row, column + 1] = _at_distance(
        surface, first, along, np.array([0, 0, 1.0]), d
    )
    for start, side, direction in _ARMS:
        one, two = (np.add(draping.origin, at) for at in (start, side))
        while _inside(draping, one + direction):
            cell = _generator(surface, x[:, *one], x[:, *two], x, one - direction, d)
            one, two = one + direction, two + direction
            x[:, *one], x[:, *two] = cell
    for i_way in (1, -1):
        for j_way in (1, -1):
            _constrained(draping, x, i_way, j_way)
    return x


def _inside(draping: Draping, node: ndarray) -> bool:
    return bool(((node >= 0) & (node < draping.nodes)).all())


def _generator(
    surface: Surface, one: ndarray, two: ndarray, x: ndarray, before: ndarray, d: float
) -> tuple[ndarray, ndarray]:
    """The other two corners of the cell of minimum shear on the edge from one to two.

    The cell lies on the opposite side of the edge from the node ``before``, or, if that
    node is not yet placed, to the right of the edge seen from above.
    """
    normal = _normal(surface, one)
    edge = (two - one) / np.linalg.norm(two - one)
    ahead = np.cross(edge, normal)
    ahead = ahead / np.linalg.norm(ahead)
    inside = (before >= 0).all() and (before < x.shape[1:]).all()
    known = x[:, *before] if inside else np.full(3, np.nan)
    if np.isfinite(known).all() and ahead @ (known - one) > 0:
        ahead = -ahead

    def corners(turn: float) -> tuple[ndarray, ndarray]:
        direction = np.cos(turn) * ahead + np.sin(turn) * edge
        fourth = _at_distance(surface, one, direction, normal, d)
        return fourth, _across(surface, fourth, two, one, d)

    def shear(turn: float) -> float:
        fourth, third = corners(turn)
        return corner_shear(np.array([one, two, third, fourth]).T).sum()

    best = minimize_scalar(
        shear, bounds=(-_TURN, _TURN), method="bounded", options={"xatol": _EXACT}
    )
    return corners(best.x)


def _constrained(draping: Draping, x: ndarray, i_way: int, j_way: int) -> None:
    """Place the nodes of a quadrant, each with three known corners of a cell."""
    row, column = draping.origin
    ends = [
        (start + 2, n) if direction > 0 else (start - 1, -1)
        for start, n, direction in zip(
            (row, column), draping.nodes, (i_way, j_way), strict=True
        )
    ]
    for i in range(*ends[0], i_way):
        for j in range(*ends[1], j_way):
            one, two = x[:, i - i_way, j], x[:, i, j - j_way]
            corner = x[:, i - i_way, j - j_way]
            x[:, i, j] = _across(draping.surface, one, two, corner, draping.cell)


def corner_shear(x: ndarray) -> ndarray:
    """Shear angles at the four corners of cells in radians, corners (3, 4, ...)."""
    after, before = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    sine = np.linalg.norm(np.cross(after, before, axis=0), axis=0)
    return np.abs(np.arctan2(sine, (after * before).sum(axis=0)) - np.pi / 2)


def _normal(surface: Surface, x: ndarray) -> ndarray:
    """The unit normal on the upper side."""
    n = surface.gradient(x[:, None])[:, 0]
    return n / np.linalg.norm(n) * np.copysign(1.0, n[2])


def _at_distance(
    surface: Surface, x: ndarray, along: ndarray, up: ndarray, d: float
) -> ndarray:
    """Point of a surface at a distance from x, in the plane of two directions."""
    normal = _normal(surface, x)
    tangent = along - up * (along @ normal) / (up @ normal)
    tangent = tangent / np.linalg.norm(tangent)
    second = up - tangent * (up @ tangent)
    return _on_circle(surface, x, d * tangent, d * second / np.linalg.norm(second))


def _across(
    surface: Surface, one: ndarray, two: ndarray, corner: ndarray, d: float
) -> ndarray:
    """Intersection of two spheres with the surface, opposite a corner."""
    middle, axis = 0.5 * (one + two), two - one
    radius = np.sqrt(d * d - 0.25 * axis @ axis)
    u = middle - corner
    u = u - axis * (u @ axis) / (axis @ axis)
    u = u / np.linalg.norm(u)
    v = np.cross(axis, u) / np.linalg.norm(axis)
    return _on_circle(surface, middle, radius * u, radius * v)


def _on_circle(surface: Surface, centre: ndarray, u: ndarray, v: ndarray) -> ndarray:
    """Intersection of a surface with the circle of u and v, near u."""

    def at(angle: float) -> ndarray:
        return centre + np.cos(angle) * u + np.sin(angle) * v

    def level(angle: float) -> float:
        return float(surface.level(at(angle)[:, None])[0])

    return at(brentq(level, -_ARC, _ARC, xtol=1e-14))


def differences(name: str, finer: int = 1) -> tuple[ndarray, ndarray]:
    """Shear angles of cells by the published method, and differences of `drape.net`.

    `drape.net` starts at the centre of the published first cell, along its rows, with
    half the cell size: four of its cells correspond to one published cell.

    Parameters
    ----------
    name
        Name in `DRAPINGS`.
    finer
        Number of cells that replace one, in both directions.

    Returns
    -------
    tuple
        Corner means and differences in degrees, shapes (n_rows, n_columns).
    """
    draping = _finer(DRAPINGS[name], finer)
    height = _above(draping)
    x = published_net(draping, height)
    cells = np.stack(
        [x[:, :-1, :-1], x[:, 1:, :-1], x[:, 1:, 1:], x[:, :-1, 1:]], axis=1
    )
    shear = np.degrees(corner_shear(cells).mean(axis=0))
    (row, column), (rows, columns) = draping.origin, shear.shape
    first = cells[:, :, row, column]
    along = first[:, 1] + first[:, 2] - first[:, 0] - first[:, 3]
    net = drape.net(
        draping.surface,
        0.5 * draping.cell,
        (2 * row + 1, 2 * (rows - row) - 1),
        (2 * column + 1, 2 * (columns - column) - 1),
        point=first.mean(axis=1),
        first=along,
    )
    angle = np.degrees(net.shear_angle()).reshape(rows, 2, columns, 2).mean(axis=(1, 3))
    return shear, np.abs(angle) - shear


def _finer(draping: Draping, finer: int) -> Draping:
    """The same ply with smaller cells, from the same origin."""
    rows, columns = draping.nodes
    return replace(
        draping,
        cell=draping.cell / finer,
        nodes=(finer * (rows - 1) + 1, finer * (columns - 1) + 1),
        origin=(finer * draping.origin[0], finer * draping.origin[1]),
    )


def _above(draping: Draping) -> ndarray:
    """The point of the surface above the origin."""
    x, y = draping.place

    def level(z: float) -> float:
        return float(draping.surface.level(np.array([[x], [y], [z]]))[0])

    return np.array([x, y, brentq(level, 0.0, 500.0, xtol=1e-12)])
