"""Punch and die as triangles of about one length."""

import numpy as np
from numpy import ndarray

from skfem_textile import drape


def sphere(radius: float, centre: ndarray, edge: float) -> drape.TriangleMesh:
    """Upper half of a sphere, and a quarter of the lower one.

    Squares around the pole are mapped to parallels, so that triangles have similar
    sizes.
    """
    most = 0.625 * np.pi
    n = 2 * round(most * radius / edge / 2)
    s = np.linspace(-1.0, 1.0, 2 * n + 1)
    a, b = (x.ravel() for x in np.meshgrid(s, s))
    larger = np.abs(a) >= np.abs(b)
    rho = np.where(larger, np.abs(a), np.abs(b))
    share = np.where(larger, b, a) / np.where(rho > 0, np.where(larger, a, b), 1.0)
    turn = np.pi / 4 * share
    x = np.where(larger, np.sign(a) * np.cos(turn), np.sign(b) * np.sin(turn))
    y = np.where(larger, np.sign(a) * np.sin(turn), np.sign(b) * np.cos(turn))
    polar = most * rho
    points = radius * np.array([np.sin(polar) * x, np.sin(polar) * y, np.cos(polar)])
    return drape.TriangleMesh(points + centre[:, None], _grid(2 * n, 2 * n))


def die(radius: float, fillet: float, z: float, edge: float) -> drape.TriangleMesh:
    """Wall of a hole, the fillet, and the plane at a height below the wall."""
    outer = 2.6 * radius
    turn = np.linspace(0, np.pi / 2, max(4, round(np.pi / 2 * fillet / edge)))
    wall = np.arange(radius, 0, -edge)[:-1]
    r = np.hstack([0 * wall + radius, radius + fillet * (1 - np.cos(turn))])
    h = np.hstack([fillet + wall, fillet * (1 - np.sin(turn))])
    plane = np.linspace(r[-1], outer, max(2, round((outer - r[-1]) / edge)))[1:]
    r, h = np.hstack([r, plane]), np.hstack([h, 0 * plane])
    n = round(2 * np.pi * radius / edge)
    angle = np.linspace(0, 2 * np.pi, n + 1)
    points = np.array(
        [
            np.outer(np.cos(angle), r).ravel(),
            np.outer(np.sin(angle), r).ravel(),
            np.tile(h + z, n + 1),
        ]
    )
    return drape.TriangleMesh(points, _grid(len(r) - 1, n))


def _grid(columns: int, rows: int) -> ndarray:
    """Triangles of a grid of quadrilaterals, row by row."""
    k = np.add.outer((columns + 1) * np.arange(rows), np.arange(columns)).ravel()
    a, b, c, d = k, k + 1, k + columns + 2, k + columns + 1
    return np.hstack([[a, b, c], [a, c, d]])
