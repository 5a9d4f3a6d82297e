"""Small sheets in plain numpy, and ways to move and renumber them."""

from typing import NamedTuple

import numpy as np


class Sheet(NamedTuple):
    """Positions, shape (2, n_nodes), and nodes of cells, shape (3 or 4, n_cells)."""

    p: np.ndarray
    t: np.ndarray


def sheet(nx=4, ny=4, width=4.0, height=4.0):
    """A rectangle in equal quadrilaterals, its lower left corner at the origin."""
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1))
    node = np.arange(x.size).reshape(x.shape)
    corners = node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]
    p = np.stack([x.ravel(), y.ravel()])
    return Sheet(p, np.stack([c.ravel() for c in corners]))


def jittered(base, rng):
    """A rectangle of unit cells, its inner nodes moved at random by up to 0.2."""
    low, high = base.p.min(axis=1)[:, None], base.p.max(axis=1)[:, None]
    inner = ((base.p > low) & (base.p < high)).all(axis=0)
    return base._replace(p=base.p + rng.uniform(-0.2, 0.2, base.p.shape) * inner)


def in_triangles(base):
    """Each quadrilateral in two triangles."""
    t = base.t
    return base if len(t) == 3 else Sheet(base.p, np.hstack([t[:3], t[[0, 2, 3]]]))


def joined(first, second):
    """Two sheets as one without common nodes."""
    t = np.hstack([first.t, second.t + first.p.shape[1]])
    return Sheet(np.hstack([first.p, second.p]), t)


def shifted(base, x, y, scale=1.0):
    """The sheet scaled about its origin, then shifted."""
    return base._replace(p=scale * base.p + np.array([[x], [y]]))


def opened(base, low, high, by=0.0):
    """The sheet cut along x = 2 at its nodes with low ≤ y ≤ high.

    The side right of the cut is moved to the right by ``by``.
    """
    x, y = base.p
    along = (abs(x - 2) < 1e-9) & (y >= low - 1e-9) & (y <= high + 1e-9)
    doubled, twin = np.flatnonzero(along), np.arange(len(x))
    twin[doubled] = len(x) + np.arange(len(doubled))
    right = x[base.t].mean(axis=0) > 2
    p = np.column_stack([base.p, base.p[:, doubled] + [[by], [0.0]]])
    return Sheet(p, np.where(right, twin[base.t], base.t))


def rolled(turn, pitch, n=60):
    """A strip of width 1 rolled up by an angle; a turn adds a pitch to the radius."""
    flat = sheet(n, 1, turn, 1.0)
    angle, radius = flat.p[0], 3.0 + flat.p[1] + pitch * flat.p[0] / (2 * np.pi)
    return flat._replace(p=radius * np.stack([np.cos(angle), np.sin(angle)]))


def fans(*sectors):
    """Cells that share the origin, by first and last angle in degrees, and size."""
    p, t = [np.zeros((2, 1))], []
    for i, (begin, end, size) in enumerate(sectors):
        angle = np.radians([begin, (begin + end) / 2, end])
        arms = np.array([1, 1.4, 1]) * np.stack([np.cos(angle), np.sin(angle)])
        p.append(size * arms)
        t.append([0, *(3 * i + np.arange(1, 4))])
    return Sheet(np.hstack(p), np.array(t).T)


def moved(base, rng):
    """The sheet rotated, shifted and perhaps mirrored."""
    a = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    mirror = np.diag([1.0, rng.choice([-1.0, 1.0])])
    with np.errstate(all="ignore"):  # some positions are not finite
        p = turn @ mirror @ base.p + rng.uniform(-5, 5, (2, 1))
    return base._replace(p=p)


def renumbered(base, rng):
    """Other numbers of nodes and cells, and another first node of each cell."""
    (k, n_cells), n = base.t.shape, base.p.shape[1]
    order, first = rng.permutation(n), rng.integers(0, k, n_cells)
    turned = np.take_along_axis(base.t, (np.arange(k)[:, None] + first) % k, axis=0)
    backwards = rng.random(n_cells) < rng.choice([0.0, 0.5, 1.0])
    turned = np.where(backwards, turned[::-1], turned)
    cells = turned[:, rng.permutation(n_cells)]
    return Sheet(base.p[:, order], np.argsort(order)[cells])
