"""Lines along the fibres of elements, and the names of their colours."""

import numpy as np
import pyvista as pv
from numpy import ndarray

from .drawing import View, least_spacing, mean_side, seen_edges

# Chosen by eye, as all sizes and colours below.
# Width of a name in the legend of fibre directions, and its size in points.
_LEGEND_WIDTH, _LEGEND_SIZE = 60, 12  # pixels, points

# Length of the line of a fibre over the mean size of an element, and its height above
# the ply over its length, so that it is drawn in front.
_LINE_LENGTH, _LINE_HEIGHT = 0.8, 1e-3

# Colours of the ply and its edges behind fibre directions: light and middle grey.
_PLY, _EDGES = "#F4F4F4", "#B0B0B0"

# Blue and vermilion of Okabe & Ito (2008), distinct in any kind of colour vision.
_WARP, _WEFT = "#0072B2", "#D55E00"


def add_fibres(
    plotter: pv.Plotter,
    ply: pv.UnstructuredGrid,
    warp: ndarray,
    weft: ndarray,
    view: View,
) -> None:
    """Draw a ply in grey, and a line in each element along both families.

    Where elements are too small for that, some of them have lines.

    Parameters
    ----------
    plotter
        Its active panel is drawn into.
    ply
        The elements.
    warp, weft
        Unit vectors, shape (n_elements, 3).
    view
        What the panel shows.
    """
    plotter.add_mesh(ply, color=_PLY, lighting=False)
    plotter.add_mesh(seen_edges(ply, view), color=_EDGES, line_width=1)
    for direction, colour in ((warp, _WARP), (weft, _WEFT)):
        plotter.add_mesh(_segments(ply, direction, view), color=colour, line_width=3)


def add_legend(plotter: pv.Plotter) -> None:
    """Write the names of the families in their colours below the panels."""
    plotter.subplot(1, 0)
    name_width = _LEGEND_WIDTH / plotter.window_size[0]
    for name, colour, x in (
        ("Warp", _WARP, 0.5 - 1.2 * name_width),
        ("Weft", _WEFT, 0.5 + 0.2 * name_width),
    ):
        plotter.add_text(
            name, position=(x, 0.6), viewport=True, font_size=_LEGEND_SIZE, color=colour
        )


def _segments(ply: pv.UnstructuredGrid, direction: ndarray, view: View) -> pv.PolyData:
    """A line through the centre of each element, or of one in each square of a grid."""
    spacing = max(mean_side(ply), least_spacing(view))
    length = _LINE_LENGTH * spacing
    centre = ply.cell_centers().points + np.array([0, 0, _LINE_HEIGHT * length])
    if spacing > mean_side(ply):
        square = np.floor(centre[:, :2] / spacing).astype(int)
        _, some = np.unique(square, axis=0, return_index=True)
        centre, direction = centre[some], direction[some]
    half = 0.5 * length * direction
    ends = np.stack([centre - half, centre + half], axis=1).reshape(-1, 3)
    return pv.line_segments_from_points(ends)
