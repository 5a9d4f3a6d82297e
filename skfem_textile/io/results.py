"""Output of results: fields, tools where they stand, history and summary."""

import contextlib
import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from ..contact.risks import (
    beyond_edges,
    bridging,
    contact_pressure,
    wrinkle_risk,
)
from ..forms.fields import FabricOnBasis
from ..mesh.splitting import at_nodes
from ..ply import Ply
from ..ply.parameters import PlyParameters
from ..ply.terms import ContactTerm
from ..solve.result import Result
from ..solve.states import State
from ..surfaces.surface import SAME_AXES, Axes, Surface
from .file_numbers import word_of, write_table
from .vtk import in_space, write_grid, write_series

if TYPE_CHECKING:
    from ..contact import PlacedTool, Process

# Changes fields of vertices or elements, by name.
_Map = Callable[[dict[str, ndarray]], dict[str, ndarray]]


def point_fields(ply: FabricOnBasis, u: ndarray) -> dict[str, ndarray]:
    """``displacement`` of the vertices in mm, shape (n_vertices, 3)."""
    return {"displacement": in_space(ply.nodal(u)[:, : ply.mesh.nvertices].T)}


def cell_fields(
    ply: FabricOnBasis, u: ndarray, parameters: PlyParameters | None = None
) -> dict[str, ndarray]:
    """Fibre strains, tensions and directions, and the shear angle, per element.

    Strains are the arguments of the tension law (`Ply.law_strain`); tensions are from
    `Ply.fibre_tension`. The value of largest magnitude in each element is used, so that
    the extremes of a field equal the extremes of the ply.  Directions are evaluated at
    the centre, in the current configuration.

    Returns
    -------
    dict
        ``warp_strain``, ``weft_strain``, ``warp_tension``, ``weft_tension`` (N/mm) and
        ``shear_angle`` (degrees), shape (n_elements,); ``warp_direction`` and
        ``weft_direction``, shape (n_elements, 3); ``slip_index``, shape (n_elements,),
        of a fabric with yarns.
    """
    strain, tension = ply.law_strain(u), ply.fibre_tension(u, parameters)
    direction = ply.fibre_direction(u, ply.centre)[..., 0]
    fields = {"shear_angle": np.degrees(_extreme(ply.shear_angle(u)))}
    for i, family in enumerate(("warp", "weft")):
        fields[f"{family}_strain"] = _extreme(strain[i])
        fields[f"{family}_tension"] = _extreme(tension[i])
        fields[f"{family}_direction"] = in_space(direction[i].T)
    if ply.fabric.yarns is not None:
        from ..ply.slip import slip_index

        fields["slip_index"] = slip_index(ply, u, parameters)
    return fields


def fields_on_tool(
    ply: Ply, surface: Surface, state: State
) -> tuple[dict[str, ndarray], dict[str, ndarray]]:
    """Fields of a ply on a tool in a state, at its vertices and elements.

    At vertices ``contact_pressure`` (N/mm²); for elements ``wrinkle_risk`` and
    ``bridging``, 0 or 1, and on a triangulated tool ``beyond_tool``, 1 beyond its
    edges.
    """
    u = state.u
    pressure = contact_pressure(ply, surface, u, state.load_factor, state.parameters)
    of_elements = {
        "wrinkle_risk": wrinkle_risk(ply, u, state.parameters).astype(float),
        "bridging": bridging(ply, u, pressure).astype(float),
    }
    beyond = beyond_edges(ply, surface, u)
    if beyond is not None:
        of_elements["beyond_tool"] = beyond.astype(float)
    return {"contact_pressure": pressure[: ply.mesh.nvertices]}, of_elements


def on_users_nodes(ply: Ply, fields: dict[str, ndarray]) -> dict[str, ndarray]:
    """Fields of vertices at the user's nodes, linear between the vertices."""
    mesh: Any = ply.mesh
    matrix = at_nodes(ply.users_points, ply.cells, mesh.p, mesh.t, ply.parent)
    return {name: matrix @ x for name, x in fields.items()}


def on_users_elements(ply: Ply, fields: dict[str, ndarray]) -> dict[str, ndarray]:
    """Means of element fields over the user's elements.

    For directions the direction of the mean.
    """
    means = {name: ply.on_users_elements(x.T).T for name, x in fields.items()}
    return {
        name: x if x.ndim == 1 else x / np.linalg.norm(x, axis=1, keepdims=True)
        for name, x in means.items()
    }


def _extreme(x: ndarray) -> ndarray:
    """Value of largest magnitude over the points of each element."""
    largest = np.abs(x).argmax(axis=-1)
    return np.take_along_axis(x, largest[:, None], axis=-1)[:, 0]


#: Names of the files written by `write_fields`.
FIELDS = (
    *("step_[0-9]*.vtu", "steps.pvd", "own_step_[0-9]*.vtu", "own_steps.pvd"),
    *("tools_[0-9]*.vtu", "tools.pvd"),
)


@contextlib.contextmanager
def _name_path(path: str | os.PathLike[str]) -> Iterator[None]:
    """Add the path to exceptions without one, such as on a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            error.filename = os.fspath(path)
        raise


def write_fields(
    result: Result, folder: str | os.PathLike[str], axes: Axes = SAME_AXES
) -> None:
    """Write each state, from ``step_0000.vtu`` on, and ``steps.pvd`` into a folder.

    The points belong to the undeformed ply; warping by ``displacement`` shows the
    deformed ply.  The fields come from `point_fields` and `cell_fields`, and from
    `fields_on_tool` for a ply on its tool, at the load factor 1, or from
    `fields_between_tools`; then ``tools_0000.vtu``, ... and ``tools.pvd`` contain the
    tools where they stand at each step.  A .pvd file lists
    the steps by load factor and opens in ParaView as one series.  If the user's
    elements were split or cut there is a second series, ``own_steps.pvd``, with the
    mean of each field over them, except for a stack. Existing steps in the folder are
    removed.  Points and vectors are converted to the coordinates in which the ply has
    the ``axes``.
    """
    folder = Path(folder)
    with _name_path(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for pattern in FIELDS:
            for old_file in folder.glob(pattern):
                old_file.unlink()
        ply, mesh = result.ply, result.ply.mesh
        at_rest = ply.at_rest[:, : mesh.nvertices]
        _write_series(result, folder, axes, "", at_rest, [mesh.t])
        own = sum(cell.shape[1] for cell in ply.cells) < mesh.nelements
        if own and not hasattr(ply, "plies"):
            maps = partial(on_users_nodes, ply), partial(on_users_elements, ply)
            points = ply.users_points
            _write_series(result, folder, axes, "own_", points, ply.cells, *maps)
        if has_tools(ply):
            write_tools(result, folder, axes)


def _write_series(
    result: Result,
    folder: Path,
    axes: Axes,
    prefix: str,
    nodes: ndarray,
    cells: Sequence[ndarray],
    on_points: _Map = dict,
    on_cells: _Map = dict,
) -> None:
    """Write a file per state, and the .pvd file that lists them.

    ``on_points`` and ``on_cells`` map fields to the nodes and cells of the file.
    """
    points_on_tool = axes.of_tool(np.pad(nodes, ((0, 3 - len(nodes)), (0, 0))))
    files = {}
    for i, state in enumerate(result.states):
        name = f"{prefix}step_{i:04d}.vtu"
        points, fields = fields_in(result, state, axes)
        of_file = on_cells(fields), on_points(points)
        write_grid(folder / name, points_on_tool, cells, *of_file)
        # Default fields of a viewer for colour and warp; meshio cannot set them.
        text = (folder / name).read_bytes()
        text = text.replace(b"<PointData>", b'<PointData Vectors="displacement">', 1)
        text = text.replace(b"<CellData>", b'<CellData Scalars="shear_angle">', 1)
        (folder / name).write_bytes(text)
        files[name] = state.load_factor
    write_series(folder / f"{prefix}steps.pvd", files)


def fields_in(
    result: Result, state: State, axes: Axes = SAME_AXES
) -> tuple[dict[str, ndarray], dict[str, ndarray]]:
    """Fields of the vertices and of the elements in a state."""
    ply, u = result.ply, state.u
    points, cells = point_fields(ply, u), cell_fields(ply, u, state.parameters)
    surface = result.tool(state.load_factor)
    if surface is not None and state.load_factor == 1:
        on_points, on_cells = fields_on_tool(ply, surface, state)
        points, cells = points | on_points, cells | on_cells
    if has_tools(ply):
        on_points, on_cells = fields_between_tools(ply, state)
        points, cells = points | on_points, cells | on_cells
    turned = [
        {name: x if x.ndim == 1 else x @ axes.turn.T for name, x in fields.items()}
        for fields in (points, cells)
    ]
    return turned[0], turned[1]


def has_tools(ply: FabricOnBasis) -> bool:
    """True for a ply between tools, whose modules are imported only then."""
    terms = ply.terms if isinstance(ply, Ply) else ()
    return any(isinstance(term, ContactTerm) for term in terms)


def write_history(
    result: Result,
    path: str | os.PathLike[str],
    axes: Axes = SAME_AXES,
    process: "Process | None" = None,
) -> None:
    """Write the history of a run as CSV, one row per converged state.

    Vectors of a ply in space are converted to the coordinates in which the ply has the
    ``axes``.  A ply between tools adds the columns of `contact.tool_history`, and the
    ``process`` of a run the column ``phase``.
    Numbers have 12 significant digits; `Result.history` has full precision.
    """
    in_space = len(result.ply.nodal(result.u)) == 3
    rows: list[dict[str, Any]] = result.history(axes.turn if in_space else None)
    if has_tools(result.ply):
        from ..contact import tool_history

        of_tools = tool_history(result)
        for i, row in enumerate(rows):
            row |= {name: column[i].item() for name, column in of_tools.items()}
    if process:
        rows = [{"phase": process.phase_at(x["load_factor"])} | x for x in rows]
    with _name_path(path):
        write_table(path, rows[0], (map(_cell, row.values()) for row in rows))


def _cell(value: float | str | None) -> str:
    return value if isinstance(value, str) else word_of(value)


def write_phases(
    result: Result, path: str | os.PathLike[str], process: "Process"
) -> None:
    """Write the `contact.phase_table` of a run as CSV, if a phase has begun."""
    from ..contact import phase_table

    if rows := phase_table(result, process):
        with _name_path(path):
            write_table(path, rows[0], (map(_cell, row.values()) for row in rows))


def write_summary(summary: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write a summary as JSON; null represents a number that is not finite."""
    with _name_path(path):
        Path(path).write_text(json.dumps(_finite(summary), indent=2) + "\n")


def _finite(value: Any) -> Any:
    """Replace numbers that are not finite by null, at any depth."""
    if isinstance(value, Mapping):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def fields_between_tools(
    ply: Ply, state: State
) -> tuple[dict[str, ndarray], dict[str, ndarray]]:
    """Fields of a ply between tools in a state, at its vertices and elements.

    At vertices ``NAME_pressure`` (N/mm²) of each tool and, except for holders with a
    prescribed pressure, ``NAME_gap`` (mm), NaN where it does not reach, and ``draw_in``
    (mm), NaN off the outline; for elements
    ``areal_weight_ratio``, relative to the flat ply, ``wrinkle_risk``, 0 or 1, and if a
    tool states the thickness of the ply ``thickness_at_constant_fibre_fraction`` (mm).
    Of a stack also ``ply``, the number of the ply, and at vertices
    ``gap_to_ply_above``, ``slip_to_ply_above`` (mm) and ``pressure_to_ply_above``
    (N/mm²), NaN where none is above.
    """
    from ..contact import areal_weight, contacts, draw_in, pressing, tool_pressure
    from ..contact.holder import flat_thickness

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
    if plies := getattr(ply, "plies", ()):
        stack: Any = ply
        numbers = range(1, len(plies) + 1)
        for name in ("gap", "slip", "pressure"):
            of_plies = [getattr(stack, name)(state, i) for i in numbers]
            points[f"{name}_to_ply_above"] = np.concatenate(of_plies)[:n]
        cells["ply"] = np.repeat(numbers, [x.mesh.nelements for x in plies]).astype(
            float
        )
    return points, cells


def joined(tools: Sequence["PlacedTool"]) -> tuple[ndarray, ndarray]:
    """Points and triangles of tools as of a single one, shapes (3, n) and (3, m)."""
    first = np.cumsum([0, *(tool.points.shape[1] for tool in tools[:-1])])
    triangles = [tool.triangles + n for tool, n in zip(tools, first, strict=True)]
    return np.hstack([tool.points for tool in tools]), np.hstack(triangles)


def write_tools(result: Result, folder: Path, axes: Axes) -> None:
    """Write the tools at each state as ``tools_0000.vtu``, ..., and ``tools.pvd``.

    The field ``tool`` is the number of the tool in the order of the terms of the ply.
    """
    from ..contact import box_of, placed_tools
    from ..contact.placed import standing

    ply, states = result.ply, result.states
    names = [tool.name for tool in standing(ply)]
    factors = [state.load_factor for state in states]
    files = {}
    for i, tools in enumerate(placed_tools(ply, states, *box_of(ply, states))):
        if not tools:
            continue
        points, triangles = joined(tools)
        numbers = [names.index(tool.name) for tool in tools]
        counts = [tool.triangles.shape[1] for tool in tools]
        files[f"tools_{i:04d}.vtu"] = factors[i]
        write_grid(
            folder / f"tools_{i:04d}.vtu",
            axes.of_tool(points),
            [triangles],
            {"tool": np.repeat(numbers, counts)},
        )
    write_series(folder / "tools.pvd", files)
