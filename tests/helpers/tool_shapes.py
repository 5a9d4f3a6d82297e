"""Tools of nearly equilateral triangles: points, (3, n), and triangles, (3, m).

Lengths in mm.  Flanges lie in z = 0, triangles face upwards, edges are about ``size``
long.  Fillets need triangles of at most half of their radius.
"""

from itertools import pairwise

import numpy as np

# Shapes of rows of points


def plate(length=200.0, width=150.0, size=8.0):
    """A flat rectangle with the middle at the origin."""
    return height_field(lambda x, y: 0 * x, length, width, size)


def saddle(length=200.0, width=200.0, radius=150.0, size=8.0):
    """z = (x² − y²)/2R."""
    return height_field(lambda x, y: (x**2 - y**2) / (2 * radius), length, width, size)


def bonnet(length=400.0, width=300.0, crown=60.0, askew=False, size=10.0):
    """A panel curved in both directions, with a falling front.

    It has the plane of symmetry y = 0, or none if ``askew``.
    """

    def height(x, y):
        s, t = 2 * x / length, 2 * y / width
        z = crown * (1 - 0.45 * s**2 - 0.35 * t**2 - 0.2 * np.exp(3 * (s - 1)))
        power_dome = 0.15 * np.exp(-8 * (t**2 + (0.4 * s) ** 2))
        one_sided = 0.12 * s * t + 0.1 * t**3 + 0.08 * s**2 * t if askew else 0
        return z + crown * (power_dome + one_sided)

    return height_field(height, length, width, size)


def double_dome(length=320.0, width=200.0, height=50.0, size=8.0):
    """Two domes with a waist between them, on a flat plane."""

    def of_place(x, y):
        domes = [np.exp(-(((x - at) / 60) ** 2 + (y / 45) ** 2)) for at in (-65, 65)]
        return height * sum(domes)

    return height_field(of_place, length, width, size)


def height_field(height, length, width, size):
    """z = h(x, y) over a rectangle with the middle at the origin."""

    def surface(s, t):
        x, y = length * (s - 0.5), width * (t - 0.5)
        return np.array([x, y, height(x, y) + 0 * x])

    return patch(surface, length, width, size)


def cap(side=100.0, size=6.0, radius=100.0):
    """A part of a sphere with its pole at the origin."""
    return height_field(
        lambda x, y: np.sqrt(radius**2 - x**2 - y**2) - radius, side, side, size
    )


def cylinder(radius=100.0, length=200.0, angle=120.0, size=8.0):
    """A part of a cylinder along x, with the highest line at y = z = 0."""
    half = np.radians(angle) / 2

    def surface(s, t):
        around = half * (2 * t - 1)
        z = radius * (np.cos(around) - 1)
        return np.array([length * (s - 0.5), radius * np.sin(around), z])

    return patch(surface, length, 2 * half * radius, size)


def torus_part(
    radius=200.0, small_radius=80.0, angle=60.0, small_angle=120.0, size=8.0
):
    """The outer part of a torus around the y axis, with the top at the origin."""
    half, small = np.radians(angle) / 2, np.radians(small_angle) / 2

    def surface(s, t):
        around, across = half * (2 * s - 1), small * (2 * t - 1)
        r = radius - small_radius + small_radius * np.cos(across)
        y = small_radius * np.sin(across)
        return np.array([r * np.sin(around), y, r * np.cos(around) - radius])

    return patch(surface, 2 * half * radius, 2 * small * small_radius, size)


def hat(
    length=240.0,
    top=50.0,
    height=40.0,
    flange=50.0,
    fillet=8.0,
    draft=20.0,
    bow=None,
    size=None,
):
    """A hat section along x, straight or bent upwards to a radius of ``bow``."""
    size = size or min(8.0, fillet / 2.5)
    half = _profile(height, fillet, np.radians(draft), flange, size, top / 2)
    profile = np.hstack([half[:, :0:-1] * [[-1], [1]], half])
    along = int(np.ceil(length / size))
    s = np.linspace(-length / 2, length / 2, along + 1)
    mids = np.concatenate([s[:1], (s[1:] + s[:-1]) / 2, s[-1:]])
    chains, places = [], []
    for number, (y, z) in enumerate(profile.T):
        x = mids if number % 2 else s
        chains.append(np.array([x, 0 * x + y, 0 * x + z]))
        places.append(x)
    x, t = stitched(chains, places)
    if bow:
        around, r = x[0] / bow, bow + x[2]
        x = np.array([r * np.sin(around), x[1], r * np.cos(around) - bow])
    return facing_up(x, t)


def patch(surface, length, width, size):
    """x(s, t), s and t from 0 to 1, with rows of triangles across ``width``."""
    rows = max(int(np.ceil(width / (size * np.sqrt(0.75)))), 2)
    n = max(int(np.ceil(length / size)), 2)
    s = np.linspace(0, 1, n + 1)
    mids = np.concatenate([[0], (s[1:] + s[:-1]) / 2, [1]])
    places = [mids if row % 2 else s for row in range(rows + 1)]
    chains = [surface(s, np.full(len(s), row / rows)) for row, s in enumerate(places)]
    return facing_up(*stitched(chains, places))


# Surfaces of revolution, and boxes


def hemisphere_with_flange(radius=50.0, fillet=8.0, flange=60.0, size=3.0):
    """Half of a sphere around the origin, with a fillet and a round flange."""
    steep = np.arccos(fillet / (radius + fillet))
    foot = (radius + fillet) * np.sin(steep)
    profile = _joined(
        _arc((0, 0), radius, np.pi / 2, np.pi / 2 - steep, size),
        _arc((foot, fillet), fillet, 1.5 * np.pi - steep, 1.5 * np.pi, size),
        _line((foot, 0), (foot + flange, 0), size),
    )
    return revolved(profile, size)


def cone(radius=80.0, top=30.0, height=80.0, size=5.0):
    """The wall of a cone, with a round top of this radius."""
    steep = np.arctan2(height, radius)
    r, z = top * np.sin(steep), top * (np.cos(steep) - 1)
    foot = (r + height / np.tan(steep), z - height)
    profile = _joined(
        _arc((0, -top), top, np.pi / 2, np.pi / 2 - steep, size),
        _line((r, z), foot, size),
    )
    return revolved(profile, size)


def ring(inner=40.0, outer=100.0, size=5.0):
    """A flat ring."""
    return revolved(_line((inner, 0), (outer, 0), size), size)


def curved_ring(radius=120.0, inner=40.0, outer=100.0, size=5.0):
    """A zone of a sphere with the centre at the origin, between two radii."""
    inner, outer = np.arccos(inner / radius), np.arccos(outer / radius)
    return revolved(_arc((0, 0), radius, inner, outer, size), size)


def tube(radii=(30.0, 30.0), length=90.0, around=48, along=16):
    """A tube or a cone along z, open at both ends."""
    t = np.linspace(0, 2 * np.pi, around + 1)
    rows = np.linspace((radii[0], 0.0), (radii[1], length), along)
    chains = [np.array([r * np.cos(t), r * np.sin(t), z + 0 * t]) for r, z in rows]
    return stitched(chains, [t] * along, closed=True)


def revolved(profile, size):
    """A surface of revolution about z of a profile r, z, shape (2, n)."""
    chains, places = [], []
    for number, (r, z) in enumerate(profile.T):
        n = max(int(np.round(2 * np.pi * r / size)), 3) if r > 0 else 0
        around = 2 * np.pi * (np.arange(n + 1) + 0.5 * (number % 2)) / max(n, 1)
        chains.append(
            np.array([r * np.cos(around), r * np.sin(around), 0 * around + z])
        )
        places.append(around)
    return facing_up(*stitched(chains, places, closed=True))


def deep_box(
    length=200.0,
    width=120.0,
    depth=60.0,
    fillet=5.0,
    draft=5.0,
    flange=40.0,
    size=None,
):
    """A box upside down: a flat top of length × width, walls, and a flange.

    All its edges have fillets; ``draft`` is the angle of its walls to z in degrees.
    """
    size = size or fillet / 2.5
    half = np.array([length, width]) / 2 - fillet
    profile = _profile(depth, fillet, np.radians(draft), flange, size)
    n = np.maximum(np.round(2 * half / size).astype(int), 1)
    chains, places = [], []
    for d, z in profile.T:
        chain, place = _rounded_rectangle(half, d, n, size)
        chains.append(np.vstack([chain, np.full(chain.shape[1], z)]))
        places.append(place)
    x, t = facing_up(*stitched(chains, places, closed=True))
    s, u = (np.linspace(-a, a, k + 1) for a, k in zip(half, n, strict=True))
    rows = [np.array([s, 0 * s + y, 0 * s + depth]) for y in u]
    top, of_top = facing_up(*stitched(rows, [s] * len(rows)))
    return merged(np.hstack([x, top]), np.hstack([t, of_top + x.shape[1]]))


def _rounded_rectangle(half, radius, n, size):
    """Points around a rectangle at a distance from it, and their places from 0 to 4."""
    arc = int(np.ceil(radius * np.pi / 2 / size - 1e-9))
    points, places = [], []
    for side in range(4):
        turn = np.pi / 2 * side
        out = np.array([np.sin(turn), -np.cos(turn)])
        along = np.array([np.cos(turn), np.sin(turn)])
        a, b = half[[0, 1]] if side % 2 == 0 else half[[1, 0]]
        k = n[side % 2]
        s = np.arange(k + (arc > 0)) / k
        straight = (b + radius) * out[:, None] + a * along[:, None] * (2 * s - 1)
        angles = turn - np.pi / 2 + np.pi / 2 * np.arange(1, arc) / max(arc, 1)
        corner = (b * out + a * along)[:, None]
        points += [
            straight,
            corner + radius * np.array([np.cos(angles), np.sin(angles)]),
        ]
        # The corners follow in the last hundredth of each side.
        places += [
            side + 0.99 * s,
            side + 0.99 + 0.01 * np.arange(1, arc) / max(arc, 1),
        ]
    points, places = np.hstack(points), np.concatenate(places)
    return np.hstack([points, points[:, :1]]), np.append(places, 4.0)


def _profile(height, fillet, draft, flange, size, top=None):
    """Half of a section: distance from the middle part, and height.

    From the edge of the flat middle part on; with half of its width ``top``, from its
    middle on.
    """
    drop = height - 2 * fillet + 2 * fillet * np.sin(draft)
    if drop <= 0:
        raise ValueError("the fillets are larger than the wall")
    foot = 2 * fillet * np.cos(draft) + drop * np.tan(draft)
    start = fillet * np.array([np.cos(draft), np.sin(draft)])
    end = np.array([foot, fillet]) - start
    start[1] += height - fillet
    parts = [
        _arc((0, height - fillet), fillet, np.pi / 2, draft, size),
        _line(start, end, size),
        _arc((foot, fillet), fillet, np.pi + draft, 1.5 * np.pi, size),
        _line((foot, 0), (foot + flange, 0), size),
    ]
    if top is None:
        return _joined(*parts)
    moved = [np.add(part, [[top - fillet], [0]]) for part in parts]
    return _joined(_line((0, height), (top - fillet, height), size), *moved)


def _arc(centre, radius, begin, end, size):
    n = max(int(np.ceil(abs(end - begin) * radius / size - 1e-9)), 2)
    a = np.linspace(begin, end, n + 1)
    points = np.array(centre)[:, None] + radius * np.array([np.cos(a), np.sin(a)])
    return np.where(np.abs(points) < 1e-9 * radius, 0.0, points)


def _line(begin, end, size):
    n = max(int(np.ceil(np.hypot(*np.subtract(end, begin)) / size - 1e-9)), 1)
    return np.linspace(begin, end, n + 1).T


def _joined(first, *others):
    return np.hstack([first, *(part[:, 1:] for part in others)])


# Triangles between chains of points


def stitched(chains, places, closed=False):
    """Triangles between successive chains of points, shape (3, n).

    ``places`` are the increasing coordinates of the points along each chain.  The first
    and the last point of a closed chain are the same.
    """
    starts = np.cumsum([0, *(chain.shape[1] for chain in chains)])
    triangles = []
    for (a, b), (p, q) in zip(pairwise(starts), pairwise(places), strict=False):
        mids = [(s[1:] + s[:-1]) / 2 for s in (p, q)]
        one, other = np.arange(len(p) - 1), np.arange(len(q) - 1)
        apex = np.searchsorted(mids[1], mids[0], side="left")
        triangles.append([a + one, a + one + 1, b + apex])
        apex = np.searchsorted(mids[0], mids[1], side="right")
        triangles.append([a + apex, b + other + 1, b + other])
    x, t = np.hstack(chains), np.hstack(triangles)
    return merged(x, t) if closed else (x, t)


def merged(x, triangles):
    """One vertex for points within 1e-6 mm, and triangles with three corners."""
    _, first, number = np.unique(
        np.round(x / 1e-6).T + 0.0, axis=0, return_index=True, return_inverse=True
    )
    a, b, c = t = number.reshape(-1)[triangles]
    return x[:, first], t[:, (a != b) & (b != c) & (c != a)]


def facing_up(x, triangles):
    """Triangles of which the sum of the area vectors points upwards."""
    a, b, c = x[:, triangles].swapaxes(0, 1)
    up = np.cross(b - a, c - a, axis=0)[2].sum() > 0
    return x, triangles if up else triangles[::-1]


#: Shapes with their default sizes, by name.
SHAPES = {
    "plate": plate,
    "hemisphere with flange": hemisphere_with_flange,
    "hat": hat,
    "saddle": saddle,
    "bonnet": bonnet,
    "deep box": deep_box,
    "cylinder": cylinder,
    "cone": cone,
    "torus part": torus_part,
    "double dome": double_dome,
    "ring": ring,
    "curved ring": curved_ring,
}
