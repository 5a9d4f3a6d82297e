"""Pictures of formed plies: fields and tools, sections, and forces over the travel."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Unpack

import numpy as np

from ..forming import areal_weight, contacts, tool_forces, travels
from ..io.results import cell_fields
from ..solve.result import Result
from .curves import curves
from .fields import FIELDS, Field
from .layout import PAGE
from .pictures import Picture, View
from .sheet import FAMILIES, REFUSED, Fibres, Legend, Panel

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.figure import Figure

#: Areal weight as a field.
AREAL_WEIGHT = Field("Areal weight relative to the flat ply", areal_weight, "cividis")


def formed(
    *results: Result, titles: Sequence[str] = (), **options: Unpack[View]
) -> "pv.Plotter | Figure":
    """Shear angle, fibres and areal weight of formed plies, one row per ply.

    With the tools where they stand: of each the faces towards the viewer.  Elements
    with a risk of wrinkling are marked on the shear angle.  The default width is 174
    mm.

    Parameters, returned value and exceptions as for `field`; `ValueError` for a ply
    without tools.
    """
    if not (options.get("size") or options.get("plotter")):
        options["size"] = PAGE
    picture = Picture(results, titles, **options)
    for result in results:
        _refuse_without_tools(result)
    angles, shear = picture.on_one_scale(FIELDS["shear_angle"])
    weights, weight = picture.on_one_scale(AREAL_WEIGHT)
    rows = []
    for result, at, title, shape, angle, ratio in zip(
        *(results, picture.states, picture.titles, picture.shapes, angles, weights),
        strict=True,
    ):
        fields = cell_fields(result.ply, at.u)
        names = "warp_direction", "weft_direction"
        fibres = Fibres(*(shape.seen(fields[name]) for name in names))
        panels = [
            Panel("Shear angle", shape, angle, shear),
            Panel("Fibres", shape, fibres=fibres),
            Panel("Areal weight", shape, ratio, weight),
        ]
        rows.append(
            [x._replace(title=f"{x.title}, {title}") if title else x for x in panels]
        )
    legends = Legend(0, 1, shear), Legend(1, 2, keys=FAMILIES), Legend(2, 3, weight)
    return picture.drawn(rows, *legends)


def tool_force(
    result: Result, filename: str | os.PathLike[str] | None = None
) -> "Figure":
    """Plot the force of each tool on the ply over the travel.

    The component along the motion of the tool that travels farthest, against its
    travel.

    Parameters
    ----------
    result
        Result of a run.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).

    Raises
    ------
    ValueError, FileNotFoundError
        For a ply without tools, and as `picture_path`.
    """
    _refuse_without_tools(result)
    far = travels(result)
    longest = max(far, key=lambda name: far[name][-1])
    lines = {name: (far[longest], force) for name, force in tool_forces(result).items()}
    title = "Force of the tools on the ply"
    return curves({title: lines}, f"Travel of {longest} (mm)", "Force (N)", filename)


def _refuse_without_tools(result: Result) -> None:
    if not contacts(result.ply):
        raise ValueError("a ply has no tools between which it is formed: add a Tool")
