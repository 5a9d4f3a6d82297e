"""Tools that are drawn under plies."""

import numpy as np
from numpy import ndarray

from ...drape import triangles_on
from ...solve.surface import Grown, Surface
from ..sheet import Tool, eye_axes

# Chosen by eye: how far a tool is drawn beyond the ply, over the diagonal of the ply's
# box; cubes along the longest side of that box; the darkest and the lightest grey; and
# from where light comes: to the right, up and towards the eye.
_BEYOND, _CUBES, _GREYS, _LIGHT = 0.17, 56, (0.58, 0.93), (-0.35, 0.65, 0.67)


def tool_under(points: ndarray, surface: Surface) -> Tool:
    """The part of a tool that is near a ply.

    Parameters
    ----------
    points
        Corners of the ply's elements in mm, shape (n, 3).
    surface
        The surface of the tool.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    beyond = _BEYOND * np.linalg.norm(high - low)
    x, triangles, normal = _triangles(surface, low - beyond, high + beyond)
    normal = eye_axes(on_tool=True) @ normal
    normal = normal / np.linalg.norm(normal, axis=0)
    light = np.array(_LIGHT) / np.linalg.norm(_LIGHT)
    lit = np.clip(light @ (normal * np.copysign(1.0, normal[2])), 0.0, 1.0)
    return Tool(x.T, triangles, _GREYS[0] + (_GREYS[1] - _GREYS[0]) * lit)


def _triangles(
    surface: Surface, low: ndarray, high: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Triangles of a tool in a box: corners, their numbers, and normals.

    Those of a tool of triangles are its own: nothing is drawn beyond its edges.
    """
    whole = surface.surface if isinstance(surface, Grown) else surface
    facets = getattr(whole, "facets", None)  # of a `TriangleMesh`
    if facets is None or getattr(surface, "t", 1.0) == 0:
        x, triangles = triangles_on(surface, low, high, _CUBES)
        return x, triangles, surface.gradient(x[:, triangles].mean(axis=1))
    x, triangles = facets.points, facets.triangles()
    if isinstance(surface, Grown):
        point = surface.point[:, None]
        x = point + (x - point) / surface.t
    inside = (np.clip(x.T, low, high) == x.T).all(axis=1)
    triangles = triangles[:, inside[triangles].any(axis=0)]
    a, b, c = x[:, triangles].swapaxes(0, 1)
    return np.clip(x.T, low, high).T, triangles, np.cross(b - a, c - a, axis=0)
