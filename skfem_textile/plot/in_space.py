"""Results in 3D: an interactive view, glTF files, and grids of pyvista."""

import json
import os
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from matplotlib.colors import to_rgb
from numpy import ndarray

from ..io.results import fields_in
from ..mesh.requirements import is_installed
from ..solve.result import Result
from ..surfaces.tool_mesh import cut_in_two
from .drawing import atomic_file, picture_path, pyvista_drawing
from .fields import (
    Drawn,
    Field,
    fibres_of,
    field_of,
    refuse_other_than_result,
    results_of,
    scale_of,
    solids_of,
    values_of,
)
from .sheet import THREAD, Shape, Tool

if TYPE_CHECKING:
    import pyvista as pv

# Distance between fibres in the flat ply, radius of their tubes, distance of these from
# the ply on both sides, at which viewers with depths of 16 bits tell them apart, and
# distance of tools behind the ply, relative to the diagonal of the ply.  Chosen by eye.
_SPACING, _RADIUS, _LIFT, _BEHIND = 0.035, 0.0016, 0.003, 0.008

# Number of corners of a tube of a fibre, and colour of tools.
_CORNERS, _STEEL = 3, "#C4C9D1"

# Deviation of a tube from its fibre, relative to its radius.  Chosen by eye.
_STRAIGHT = 0.3

# Light that does not depend on the direction, so that colours agree with their scale.
_LIT: dict[str, Any] = {"ambient": 0.45, "diffuse": 0.6}

# glTF files are in m.
_METRE = 1e-3


class Options(TypedDict, total=False):
    """Options of results in 3D; see `view`."""

    state: int
    field: str | Field
    cmap: Any
    clim: Sequence[float] | None
    fibres: bool


def view(*drawn: Drawn, **options: Unpack[Options]) -> Any:
    """Show a state in 3D, to be turned: a field, the fibres, and the tools behind.

    In Jupyter the view is interactive if trame is installed (``pip install
    "pyvista[jupyter]"``), and otherwise a static picture.  Elsewhere it opens a window.

    Parameters
    ----------
    *drawn
        Result of a run; or a basis, its DOF vector and a fabric, as for `fibre_fields`.
    state
        Index of the state in ``result.states``; -1, the default, is the last.
    field
        Name in `FIELDS`, by default ``"shear_angle"``, or a custom `Field`.
    cmap, clim
        Colour map and limits as for `field`.
    fibres
        If True, which is the default, the fibres of both families are drawn.

    Returns
    -------
    Any
        In Jupyter the view or the picture, which a cell shows; otherwise None.

    Raises
    ------
    ImportError
        If pyvista is not installed; the message gives the command.
    RuntimeError
        If off-screen drawing fails; the message names the packages to install.
    ValueError
        If there is no such state, field or colour map, or another argument is invalid.

    Examples
    --------
    >>> view(result, field="displacement")  # doctest: +SKIP
    """
    backend = None if is_installed("trame") else "static"
    plotter = _plotter(drawn, **options)
    return plotter.show(jupyter_backend=backend, return_viewer=True)


def export_gltf(
    result: Result, filename: str | os.PathLike[str], **options: Unpack[Options]
) -> None:
    """Write a state as a glTF file, which viewers, browsers and office programs show.

    Coordinates are in m with y upwards, as the format requires.  Every element has the
    colour of its value.

    Parameters
    ----------
    result
        Result of a run.
    filename
        Output file (.gltf), which contains its data.

    Other parameters and exceptions as for `view`; `ValueError` for another suffix and
    `FileNotFoundError` if the folder of the file does not exist.

    Examples
    --------
    >>> export_gltf(result, "formed.gltf")  # doctest: +SKIP
    """
    refuse_other_than_result("export_gltf", result)
    path = picture_path(filename, (".gltf",))
    plotter = _plotter([result], **options, of_file=True)
    with atomic_file(path.with_suffix(".gltf"), ".gltf") as file:
        plotter.export_gltf(str(file))
        content = json.loads(file.read_text())
        for material in content["materials"]:  # a ply is seen from both sides
            material["doubleSided"] = True
        file.write_text(json.dumps(content))
    plotter.close()


def to_pyvista(*drawn: Drawn, state: int = -1) -> "pv.UnstructuredGrid":
    """Deformed ply as a grid of pyvista, with its fields.

    Parameters
    ----------
    *drawn
        Result of a run; or a basis, its DOF vector and a fabric, as for `fibre_fields`.
    state
        Index of the state in ``result.states``; -1 is the last.

    Returns
    -------
    pyvista.UnstructuredGrid
        Vertices in mm in their order in the mesh, displaced, and the elements of the
        basis.  Point data: ``displacement`` (mm).  Cell data: ``warp_strain``,
        ``weft_strain``, ``warp_tension``, ``weft_tension`` (N/mm) and ``shear_angle``
        (degrees), the values of largest magnitude in each element, and
        ``warp_direction`` and ``weft_direction`` at its centre.  For a ply with tools,
        also the fields of its files.

    Raises
    ------
    ImportError
        If pyvista is not installed; the message gives the command.
    ValueError
        If there is no such state, or another argument is invalid (`fibre_fields`).

    Examples
    --------
    >>> from skfem import MeshQuad
    >>> from skfem_textile import CENTRE, Fabric, plot, quad_basis
    >>> basis = quad_basis(MeshQuad().refined(2), CENTRE)
    >>> grid = plot.to_pyvista(basis, basis.zeros(), Fabric(1e4))
    >>> grid.n_cells, grid.array_names[:2]
    (16, ['displacement', 'shear_angle'])
    """
    result, at = _one_of("a grid", drawn, state)
    shape = Shape.of(result.ply.mesh, result.ply.nodal(at.u))
    grid = pyvista_drawing().grid(shape.points, shape.cells)
    points, cells = fields_in(result, at)
    grid.point_data.update(points)
    grid.cell_data.update(cells)
    return grid


def _one_of(what: str, drawn: Sequence[Drawn], state: int) -> tuple[Any, Any]:
    """The only result, and its state that is drawn."""
    results, states = results_of(drawn, state)
    if len(results) > 1:
        raise ValueError(f"{what} shows one result, got {len(results)}")
    return results[0], states[0]


def _linear(colour: str) -> ndarray:
    """Linear intensities of an sRGB colour (IEC 61966-2-1), as of solids in glTF."""
    rgb = np.array(to_rgb(colour))
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def _plotter(
    drawn: Sequence[Drawn],
    state: int = -1,
    field: str | Field = "shear_angle",
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    fibres: bool = True,
    of_file: bool = False,
) -> "pv.Plotter":
    """Plotter with a ply in 3D; of a glTF file in m, with linear colours of solids."""
    size, solid = (_METRE, _linear) if of_file else (1.0, to_rgb)
    quantity = field_of(field)
    result, at = _one_of("a view", drawn, state)
    values = values_of(quantity, result.ply, at.u)
    scale = scale_of(quantity, [values], cmap, clim)
    pyvista_drawing().require_offscreen()
    import pyvista as pv

    (shape,) = solids_of([result], [at])
    shape = shape._replace(points=size * shape.points)
    diagonal = float(np.linalg.norm(np.ptp(shape.points, axis=0)))
    plotter = pv.Plotter(title="skfem_textile")
    plotter.set_background("white")
    plotter.add_mesh(
        _surface(shape, values),
        scalars="values",
        clim=(scale.low, scale.high),
        cmap=scale.colours,
        color="white",  # by which files multiply the colours of the scale
        scalar_bar_args={"title": scale.label, "color": "black"},
        **_LIT,
    )
    if fibres:
        spacing, lift = _SPACING * diagonal / size, _LIFT * diagonal
        lines, normals = fibres_of(result.ply), _normals(shape)
        for family, side in product((0, 1), (lift, -lift)):
            ends = lines.lines(shape.points + side * normals, family, spacing)
            tubes = _tubes(ends, _RADIUS * diagonal)
            plotter.add_mesh(tubes, color=solid(THREAD), **_LIT)
    if tool := shape.tool:
        faces = _behind(tool, size, _BEHIND * diagonal)
        plotter.add_mesh(faces, color=solid(_STEEL), **_LIT)
    plotter.view_isometric()
    return plotter


def _surface(shape: Shape, values: ndarray) -> "pv.PolyData":
    """Elements with separate corners, which have the value of the element.

    Quadrilaterals are cut in two as for the fibres, which then lie on the surface.
    """
    own, first = [], 0
    for cell in shape.cells:
        own.append(first + np.arange(cell.size).reshape(cell.shape, order="F"))
        first += cell.size
    corners = np.concatenate([cell.T.ravel() for cell in shape.cells])
    sizes = np.concatenate([np.full(c.shape[1], len(c)) for c in shape.cells])
    surface = _of_triangles(shape.points[corners], cut_in_two(tuple(own)))
    surface.point_data["Normals"] = _normals(shape)[corners]
    surface.point_data["values"] = np.repeat(values, sizes)
    return surface


def _normals(shape: Shape) -> ndarray:
    """Normals at the corners of the elements, of the shape of the points."""
    surface = _with_normals(shape.points, cut_in_two(shape.cells))
    return np.asarray(surface.point_data["Normals"])


def _of_triangles(points: ndarray, triangles: ndarray) -> "pv.PolyData":
    import pyvista as pv

    return pv.PolyData(points, np.insert(triangles, 0, 3, axis=0).T.ravel())


def _with_normals(
    points: ndarray, triangles: ndarray, oriented: bool = True
) -> "pv.PolyData":
    """Triangles with normals at their corners, about which they are oriented or not."""
    return _of_triangles(points, triangles).compute_normals(
        split_vertices=False,
        consistent_normals=not oriented,
        auto_orient_normals=False,
    )


def _tubes(ends: ndarray, radius: float) -> "pv.PolyData":
    """Tubes along lines with ends of shape (n, 2, 3), straight where they can be."""
    import pyvista as pv
    from vtkmodules.vtkFiltersCore import vtkDecimatePolylineFilter

    lines = pv.line_segments_from_points(ends.reshape(-1, 3))
    joined = lines.clean(tolerance=0.1 * radius, absolute=True).strip()
    fewer = vtkDecimatePolylineFilter()
    fewer.SetInputData(joined)
    fewer.SetTargetReduction(1.0)
    fewer.SetMaximumError((_STRAIGHT * radius) ** 2)
    fewer.Update()
    curves = pv.wrap(fewer.GetOutput())
    return curves.tube(radius=radius, n_sides=_CORNERS, capping=False)


def _behind(tool: Tool, size: float, distance: float) -> "pv.PolyData":
    """Faces of a tool, moved by a distance away from the ply in front of them."""
    surface = _with_normals(size * tool.points, tool.triangles, tool.one_sided)
    normals = surface.point_data["Normals"]
    surface.points -= distance * np.sign(normals[:, 2].sum()) * normals
    return surface
