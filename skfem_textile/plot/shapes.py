"""Shapes of plies and tools for pictures, and values on one scale."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from ..drape import triangles_on
from ..solve.result import Result
from ..solve.states import State
from ..solve.surface import Grown, Surface
from .fields import Field, reach, values_of
from .picture_files import picture_path
from .sheet import Scale, Shape, Tool, eye_axes, in_perspective

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


def chosen(
    results: Sequence[Result],
    titles: Sequence[str],
    state: int,
    filename: str | os.PathLike[str] | None,
) -> tuple[Sequence[str], list[Shape], list[State]]:
    """Titles, shapes and states of results; they and the file's name are checked."""
    if filename is not None:
        picture_path(filename)
    if not results:
        raise ValueError("nothing to draw: give at least one result")
    for result in results:
        if not hasattr(result, "states"):
            raise ValueError(
                f"a picture is of a Result, not of a {type(result).__name__}: of a "
                "state of equilibrium_near give Result.of_state(ply, conditions, state)"
            )
    several = [result.ply.formulation.title for result in results]
    titles = titles or (several if len(results) > 1 else [""])
    if len(titles) != len(results):
        raise ValueError(f"{len(results)} results need as many titles: {len(titles)}")
    fewest = min(len(result.states) for result in results)
    if not -fewest <= state < fewest:
        raise ValueError(f"there is no state {state}: a result has {fewest} states")
    states = [result.states[state] for result in results]
    return titles, shapes_of(results, states), states


def shapes_of(results: Sequence[Result], states: Sequence[State]) -> list[Shape]:
    """The plies of results in a state each, with straight edges between the vertices.

    In perspective if one of them is in space, and with the tools on which they lie.
    """
    shapes = []
    for result, at in zip(results, states, strict=True):
        shape = Shape.of(result.ply.mesh, result.ply.nodal(at.u))
        if surface := result.tool(at.load_factor):
            shape = shape._replace(tool=tool_under(shape.points, surface))
        shapes.append(shape)
    in_space = any(len(result.ply.nodal(result.u)) == 3 for result in results)
    return in_perspective(shapes) if in_space else shapes


def on_one_scale(
    results: Sequence[Result],
    states: Sequence[State],
    field: Field,
    cmap: Any = None,
    clim: Sequence[float] | None = None,
) -> tuple[list[ndarray], Scale]:
    """The values of a field of each result, and the scale of them all."""
    pairs = zip(results, states, strict=True)
    shown = [values_of(field, result.ply, at.u) for result, at in pairs]
    found = reach(shown, field.symmetric)
    return shown, Scale.of(field.label, found, cmap or field.cmap, clim)
