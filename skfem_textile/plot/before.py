"""The picture of a mesh and its fibres before a run."""

import os

import numpy as np
import pyvista as pv
from numpy import ndarray
from skfem import Mesh

from ..fabric.directions.per_element import FibreDirections
from ..mesh.splitting import original_elements
from .drawing import View, decorate, empty_panels, write_png
from .fibres import add_fibres, add_legend
from .offscreen import require_offscreen
from .picture_files import picture_path

_CELLS = {3: pv.CellType.TRIANGLE, 4: pv.CellType.QUAD}


def mesh_and_fibres(
    mesh: Mesh,
    directions: FibreDirections,
    filename: str | os.PathLike[str] | None = None,
) -> pv.Plotter:
    """A mesh with warp (blue) and weft (red) in each element, before any run.

    Parameters
    ----------
    mesh
        The mesh; of a split or cut mesh the user's elements are drawn.
    directions
        Directions in these elements.
    filename
        Where to write a PNG.

    Returns
    -------
    pyvista.Plotter
        The plotter, off screen, for further drawing.

    Raises
    ------
    RuntimeError
        If nothing can be drawn off screen here; the message says what to install.
    ValueError
        If there is not one direction for each element, or the name has another suffix
        than .png.
    FileNotFoundError
        If the folder of the file does not exist.
    """
    path = None if filename is None else picture_path(filename)
    cells, _ = original_elements(mesh)
    n_elements, n = sum(cell.shape[1] for cell in cells), directions.warp.shape[1]
    if n != n_elements:
        raise ValueError(f"{n} directions for {n_elements} elements")
    require_offscreen()
    ply = _grid(cells, mesh.p)
    view = View.of([ply])
    plotter = empty_panels(view, 1, 1, slice(None))
    plotter.subplot(0, 0)
    unit = [v / np.hypot(*v) for v in (directions.warp, directions.weft)]
    warp, weft = (np.pad(v, ((0, 1), (0, 0))).T for v in unit)
    add_fibres(plotter, ply, warp, weft, view)
    decorate(plotter, f"Mesh and fibres, {n} elements", view)
    add_legend(plotter)
    if path is not None:
        write_png(plotter, path)
    return plotter


def _grid(cells: tuple[ndarray, ...], p: ndarray) -> pv.UnstructuredGrid:
    """Elements in their order."""
    rows = [np.pad(cell, ((1, 0), (0, 0)), constant_values=len(cell)) for cell in cells]
    kinds = [np.full(cell.shape[1], _CELLS[len(cell)]) for cell in cells]
    listed = np.concatenate([row.T.ravel() for row in rows])
    points = np.pad(p, ((0, 1), (0, 0))).T
    return pv.UnstructuredGrid(listed, np.concatenate(kinds), points)
