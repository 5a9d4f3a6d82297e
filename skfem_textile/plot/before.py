"""The picture of a mesh and its fibres before a run."""

import os
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..fabric.directions.per_element import FibreDirections
from ..mesh.splitting import original_elements
from .lines import WARP, WEFT
from .renderers.drawing import draw
from .sheet import Fibres, Legend, Panel, Shape, Sheet, extent

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.figure import Figure


def mesh_and_fibres(
    mesh: Mesh,
    directions: FibreDirections,
    filename: str | os.PathLike[str] | None = None,
    plotter: "pv.Plotter | None" = None,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> "pv.Plotter | Figure":
    """A mesh with warp (blue) and weft (red) in each element, before any run.

    Of elements that are closer than 2.5 mm on the picture some have lines.

    Parameters
    ----------
    mesh
        The mesh; of a split or cut mesh the user's elements are drawn.
    directions
        Directions in these elements.
    filename, plotter, show_edges, size
        As for `skfem_textile.plot.field`.

    Returns
    -------
    pyvista.Plotter or matplotlib.figure.Figure
        As `skfem_textile.plot.field`.

    Raises
    ------
    ImportError, RuntimeError, FileNotFoundError
        As `skfem_textile.plot.field`.
    ValueError
        As `skfem_textile.plot.field`, or if there is not one direction for each
        element.
    """
    cells, _ = original_elements(mesh)
    directions.refuse_other(cells)
    n = directions.warp.shape[1]
    shape = Shape(np.pad(mesh.p, ((0, 1), (0, 0))).T, cells)
    fibres = Fibres(_unit(directions.warp), _unit(directions.weft))
    panel = Panel(f"Mesh and fibres, {n} elements", shape, fibres=fibres)
    keys = [("Warp", WARP), ("Weft", WEFT)]
    sheet = Sheet([[panel]], [Legend(0, 1, keys=keys)], extent([shape]), show_edges)
    return draw(sheet, filename, plotter, size)


def _unit(vectors: ndarray) -> ndarray:
    """Columns of plane vectors as rows of unit vectors in space."""
    return np.pad(vectors / np.hypot(*vectors), ((0, 1), (0, 0))).T
