"""Triangles on a surface within a box, for pictures."""

from itertools import permutations

import numpy as np
from numpy import ndarray

from ..solve.surface import Surface

# Corners of a cube, and the six tetrahedra into which its paths from the first corner
# to the last cut it.
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_TETRAHEDRA = np.array(
    [
        np.cumsum([np.zeros(3, int), *np.eye(3, dtype=int)[list(path)]], axis=0)
        @ np.array([4, 2, 1])
        for path in permutations(range(3))
    ]
)

# Steps of Newton's method by which corners come onto the surface.
_STEPS = 3


def triangles_on(
    surface: Surface, low: ndarray, high: ndarray, cells: int
) -> tuple[ndarray, ndarray]:
    """Triangles on a surface within a box, by marching tetrahedra.

    Parameters
    ----------
    surface
        The surface.
    low, high
        Corners of the box in mm, shape (3,).
    cells
        Number of cubes along its longest side.

    Returns
    -------
    tuple
        Corners of the triangles in mm, shape (3, n), and their numbers, (3,
        n_triangles); none where the surface is not in the box.

    Examples
    --------
    >>> import numpy as np
    >>> from skfem_textile import drape
    >>> box = np.full(3, -1.1), np.full(3, 1.1)
    >>> x, t = drape.triangles_on(drape.Sphere(1.0), *box, 24)
    >>> a, b, c = x[:, t[0]], x[:, t[1]], x[:, t[2]]
    >>> area = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum()
    >>> bool(abs(area / (4 * np.pi) - 1) < 0.01)
    True
    """
    spacing = float((high - low).max()) / cells
    counts = np.maximum(np.ceil((high - low) / spacing - 1e-9).astype(int), 1)
    grid = np.meshgrid(
        *(np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)),
        indexing="ij",
    )
    points = np.array(grid).reshape(3, -1)
    with np.errstate(all="ignore"):  # what is not finite is on no side
        level = surface.level(points)
    strides = np.array([(counts[1] + 1) * (counts[2] + 1), counts[2] + 1, 1])
    first = np.array(np.meshgrid(*map(np.arange, counts), indexing="ij"))
    cubes = strides @ first.reshape(3, -1)
    corners = (cubes[:, None] + _CORNERS @ strides).T
    above = level[corners] > 0
    crossed = (above != above[0]).any(axis=0) & np.isfinite(level[corners]).all(axis=0)
    tetrahedra = corners[:, crossed][_TETRAHEDRA].transpose(1, 0, 2).reshape(4, -1)
    edges = _crossed_edges(tetrahedra, level)
    pairs, inverse = np.unique(
        np.sort(edges.reshape(2, -1), axis=0), axis=1, return_inverse=True
    )
    share = level[pairs[0]] / (level[pairs[0]] - level[pairs[1]])
    x = points[:, pairs[0]] * (1 - share) + points[:, pairs[1]] * share
    for _ in range(_STEPS):
        gradient = surface.gradient(x)
        x = x - surface.level(x) / (gradient**2).sum(axis=0) * gradient
    return x, inverse.reshape(3, -1)


def _crossed_edges(tetrahedra: ndarray, level: ndarray) -> ndarray:
    """Ends of the edges on which corners of triangles lie, shape (2, 3, n)."""
    above = level[tetrahedra] > 0
    order = np.argsort(above, axis=0, kind="stable")  # those below first
    a, b, c, d = np.take_along_axis(tetrahedra, order, axis=0)
    n = above.sum(axis=0)
    one, two, three = (np.flatnonzero(n == k) for k in (1, 2, 3))
    found = [
        ([d, d, d], [a, b, c], one),
        ([a, a, a], [b, c, d], three),
        ([a, a, b], [c, d, c], two),
        ([b, b, a], [d, c, d], two),
    ]
    edges = [np.array(ends)[:, :, of] for *ends, of in found]
    return np.concatenate(edges, axis=2)
