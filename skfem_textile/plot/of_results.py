"""What pictures show of results: states, shapes of plies, values on one scale."""

import os
from collections.abc import Sequence
from typing import Any

from numpy import ndarray

from ..solve.result import Result
from ..solve.states import State
from .fields import Field, reach, values_of
from .on_tools.under_ply import tool_under
from .picture_files import picture_path
from .sheet import Scale, Shape, in_perspective


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
