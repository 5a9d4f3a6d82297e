"""Output of formed plies: fields of contact, and tools where they stand."""

from pathlib import Path

import numpy as np
from numpy import ndarray

from ..contact import (
    areal_weight,
    box_of,
    contacts,
    draw_in,
    placed_tools,
    pressing,
    tool_pressure,
)
from ..contact.holder import flat_thickness
from ..contact.risks import wrinkle_risk
from ..ply import Ply
from ..solve.result import Result
from ..solve.states import State
from ..surfaces.surface import Axes
from .vtk import write_grid, write_series


def fields_between_tools(
    ply: Ply, state: State
) -> tuple[dict[str, ndarray], dict[str, ndarray]]:
    """Fields of a ply between tools in a state, at its vertices and elements.

    At vertices ``NAME_pressure`` (N/mm²) of each tool and, except for holders with a
    prescribed pressure, ``NAME_gap`` (mm), NaN where it does not reach, and ``draw_in``
    (mm), NaN off the outline; for elements
    ``areal_weight_ratio``, relative to the flat ply, ``wrinkle_risk``, 0 or 1, and if a
    tool states the thickness of the ply ``thickness_at_constant_fibre_fraction`` (mm).
    """
    u, t, n = state.u, state.load_factor, ply.mesh.nvertices
    x = ply.positions(u)[:, :n]
    points = {
        f"{tool.name}_pressure": tool_pressure(ply, tool, state)[:n]
        for tool in pressing(ply)
    }
    for tool in contacts(ply):
        gap = tool.gaps_at(x, t)
        points[f"{tool.name}_gap"] = np.where(np.isfinite(gap), gap, np.nan)
    drawn = draw_in(ply, u)
    corners = drawn.nodes < n
    points["draw_in"] = np.full(n, np.nan)
    points["draw_in"][drawn.nodes[corners]] = drawn.inwards[corners]
    risk = wrinkle_risk(ply, u, state.parameters).astype(float)
    cells = {"areal_weight_ratio": areal_weight(ply, u), "wrinkle_risk": risk}
    if thickness := flat_thickness(ply):
        of_ply = areal_weight(ply, u, thickness)
        cells["thickness_at_constant_fibre_fraction"] = of_ply
    return points, cells


def write_tools(result: Result, folder: Path, axes: Axes) -> None:
    """Write the tools at each state as ``tools_0000.vtu``, ..., and ``tools.pvd``.

    The field ``tool`` is the number of the tool in the order of the terms of the ply.
    """
    ply, states = result.ply, result.states
    names = [tool.name for tool in contacts(ply)]
    factors = [state.load_factor for state in states]
    files = {}
    for i, tools in enumerate(placed_tools(ply, factors, *box_of(ply, states))):
        if not tools:
            continue
        first = np.cumsum([0, *(tool.points.shape[1] for tool in tools)])
        triangles = [
            tool.triangles + n for tool, n in zip(tools, first[:-1], strict=True)
        ]
        numbers = [names.index(tool.name) for tool in tools]
        counts = [tool.triangles.shape[1] for tool in tools]
        files[f"tools_{i:04d}.vtu"] = factors[i]
        write_grid(
            folder / f"tools_{i:04d}.vtu",
            axes.of_tool(np.hstack([tool.points for tool in tools])),
            [np.hstack(triangles)],
            {"tool": np.repeat(numbers, counts)},
        )
    write_series(folder / "tools.pvd", files)
