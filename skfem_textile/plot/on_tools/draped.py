"""The picture of plies on tools: shear, risks and contact pressure."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...io.fields import fields_on_tool
from ...solve.result import Result
from ...solve.states import State
from ..fields import FIELDS, reach
from ..layout import PAGE
from ..lines import REFUSED
from ..of_results import chosen, on_one_scale
from ..renderers.drawing import draw
from ..sheet import Legend, Panel, Scale, Sheet, extent

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.figure import Figure

# What is marked is drawn in this colour, and named so.
_RISK = [("Fibres may wrinkle", REFUSED)]


def draped(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    state: int = -1,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """Shear angle and contact pressure of plies on tools, a row for each.

    Elements in which fibres may wrinkle are marked on the shear angle.  A pressure
    below zero is a pull: there the ply bridges the tool.

    Parameters
    ----------
    *results
        Results of runs of plies that lie on tools.
    titles, filename, plotter, state, show_edges, size
        As for `field`; 174 mm wide if no size is given.

    Returns
    -------
    pyvista.Plotter or matplotlib.figure.Figure
        As `field`.

    Raises
    ------
    ImportError, RuntimeError, FileNotFoundError
        As `field`.
    ValueError
        As `field`, or if a ply is on no tool.
    """
    titles, shapes, states = chosen(results, titles, state, filename)
    pairs = list(zip(results, states, strict=True))
    found = [_found(result, at) for result, at in pairs]
    angles, shear = on_one_scale(results, states, FIELDS["shear_angle"])
    pressures = [pressure for pressure, _ in found]
    label = "Contact pressure (N/mm²)"
    scale = Scale.of(label, reach(pressures, symmetric=True), "RdBu_r", None)
    rows = [
        [
            Panel(_named("Shear angle", title), shape, angle, shear, marked=at_risk),
            Panel(_named("Contact pressure", title), shape, pressure, scale),
        ]
        for title, shape, angle, (pressure, at_risk) in zip(
            titles, shapes, angles, found, strict=True
        )
    ]
    keys = _RISK if any(at_risk.size for _, at_risk in found) else []
    legends = [Legend(0, 1, shear, keys), Legend(1, 2, scale)]
    sheet = Sheet(rows, legends, extent(shapes), show_edges)
    return draw(sheet, filename, plotter, size or (None if plotter else PAGE))


def _named(name: str, title: str) -> str:
    return f"{name}, {title}" if title else name


def _found(result: Result, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Contact pressure of elements, and numbers of those at risk of wrinkles."""
    ply, surface = result.ply, result.tool(state.load_factor)
    if surface is None:
        raise ValueError("a ply is on no tool: it needs a condition OnSurface")
    points, cells = fields_on_tool(ply, surface, state)
    pressure = points["contact_pressure"][ply.mesh.t].mean(axis=0)
    return pressure, np.flatnonzero(cells["wrinkle_risk"])
