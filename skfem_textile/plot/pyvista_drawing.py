"""Pictures drawn with pyvista: off screen, or into a given plotter."""

import functools
import os
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv
from numpy import ndarray
from vtkmodules.vtkRenderingCore import vtkActor2D, vtkCoordinate, vtkPolyDataMapper2D

from .layout import (
    KEY,
    POINT,
    Bar,
    Box,
    Layout,
    PlacedLegend,
    Slot,
    Writing,
    font_file,
    lay_out,
)
from .sheet import Legend, Sheet, lines_of

_CELLS = {3: pv.CellType.TRIANGLE, 4: pv.CellType.QUAD}

# Drawing in the given colours, rendered once a picture is complete.
_FLAT: dict[str, Any] = {"lighting": False, "reset_camera": False, "render": False}

# Opacity of tools in front of the ply.  Chosen by eye.
_VEIL = 0.2

# Width in mm of the line of a key.
_STROKE = 0.5

# Distance in mm of lines in front of the surface, and in front of a tool, where
# elements are inclined.
_LIFT, _LIFT_ON_TOOL = 0.1, 1.0


class Frame(NamedTuple):
    """Part of a picture in a renderer, in mm, and its resolution in dots per mm."""

    box: Box
    dots: float

    def on(self, x: float, y: float) -> tuple[float, float]:
        """Position relative to width and height of the renderer."""
        box = self.box
        return (x - box.x) / box.width, (y - box.y) / box.height


def new_plotter(layout: Layout, dots_per_inch: float) -> pv.Plotter:
    """Empty off-screen plotter with a renderer for each panel and legend."""
    require_offscreen()
    dots = dots_per_inch / 25.4
    heights = [row[0].box.height for row in layout.panels]
    left = layout.height - sum(heights)
    columns, rows = len(layout.panels[0]), len(heights)
    cell = layout.width / columns
    spans = [
        slice(round(b.box.x / cell), round((b.box.x + b.box.width) / cell))
        for b in layout.legends
    ]
    plotter = pv.Plotter(
        off_screen=True,
        shape=(rows + 1, columns),
        row_weights=[*heights, left],
        groups=[(rows, span) for span in spans if span.stop - span.start > 1],
        border=False,
        window_size=[round(layout.width * dots), round(layout.height * dots)],
    )
    plotter.set_background("white")
    return plotter


def draw_new(plotter: pv.Plotter, sheet: Sheet, layout: Layout) -> None:
    """Draw a sheet into a plotter created for its layout."""
    dots = plotter.window_size[0] / layout.width
    for i, row in enumerate(layout.panels):
        for j, panel in enumerate(row):
            plotter.subplot(i, j)
            _draw_panel(plotter, panel, sheet, Frame(panel.box, dots))
    cell = layout.width / len(layout.panels[0])
    for legend in layout.legends:
        plotter.subplot(len(layout.panels), round(legend.box.x / cell))
        _draw_legend(plotter, legend, Frame(legend.box, dots))
    plotter.render()  # screenshots render a plotter only once


def draw_into(plotter: pv.Plotter, sheet: Sheet, width: float) -> None:
    """Draw the panels of a sheet into subplots of a plotter, from the active one on.

    Each panel has its scale and keys. The plotter window corresponds to ``width`` mm.
    """
    panels, renderers = sheet.panels, plotter.renderers
    first = renderers.active_index
    if first + len(panels) > len(renderers):
        raise ValueError(
            f"{len(panels)} panels require as many subplots of the plotter from the "
            f"active one on, which has {len(renderers) - first}"
        )
    dots = plotter.window_size[0] / width
    keys = [key for key_legend in sheet.legends for key in key_legend.keys]
    for i, panel in enumerate(panels, start=first):
        x, y, right, top = renderers[i].GetViewport()
        size = np.multiply(plotter.window_size, (right - x, top - y)) / dots
        one = Sheet(
            [[panel]],
            [Legend(0, 1, panel.scale, keys)],
            sheet.extent,
            sheet.show_edges,
        )
        layout = lay_out(one, tuple(size))
        frame = Frame(Box(0.0, 0.0, layout.width, layout.height), dots)
        plotter.subplot(*np.atleast_1d(renderers.index_to_loc(i)).tolist())
        ((slot,),), (placed,) = layout.panels, layout.legends
        _draw_panel(plotter, slot, one, frame)
        _draw_legend(plotter, placed, frame)
    plotter.render()  # screenshots render a plotter only once


def _draw_panel(plotter: pv.Plotter, slot: Slot, sheet: Sheet, frame: Frame) -> None:
    """Draw a panel into the active renderer and point its camera."""
    panel, scale = slot.panel, slot.scale_of(sheet.extent)
    look = _grey(panel.shape.greys)
    if of := panel.scale:
        look = {"scalars": panel.values, "clim": (of.low, of.high), "cmap": of.colours}
    meshes = [(grid(panel.shape.points, panel.shape.cells), look)]
    if tool := panel.shape.tool:
        meshes.append((grid(tool.points, (tool.triangles,)), _grey(tool.shades)))
    if veil := panel.shape.veil:
        look = _grey(veil.shades) | {"opacity": _VEIL}
        meshes.append((grid(veil.points, (veil.triangles,)), look))
    for elements, look in meshes:
        plotter.add_mesh(elements, show_scalar_bar=False, **_FLAT, **look)
    lift = (_LIFT_ON_TOOL if panel.shape.tool else _LIFT) / scale
    for i, lines in enumerate(lines_of(panel, scale, sheet.show_edges), start=1):
        ends, colour, width = lines
        in_front = ends.reshape(-1, 3) + np.array([0.0, 0.0, i * lift])
        plotter.add_mesh(
            pv.line_segments_from_points(in_front),
            color=colour,
            line_width=max(1.0, width * frame.dots),
            **_FLAT,
        )
    for writing in slot.title:
        _write(plotter, writing, frame)
    _point_camera(plotter, slot, sheet, frame)


def _point_camera(plotter: pv.Plotter, slot: Slot, sheet: Sheet, frame: Frame) -> None:
    """View from above, with the middle of the extent in the middle of the ply's box."""
    scale, (low, high) = slot.scale_of(sheet.extent), sheet.extent
    seen = np.array([frame.box.x, frame.box.y]) + 0.5 * np.array(frame.box[2:])
    centre = 0.5 * (low + high)
    centre[:2] -= (slot.middle - seen) / scale
    reach = 0.5 * frame.box.height / scale
    eye = centre + np.array([0.0, 0.0, reach + high[2] - low[2]])
    plotter.camera_position = [eye, centre, (0.0, 1.0, 0.0)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = reach
    plotter.renderer.reset_camera_clipping_range()


def _grey(levels: ndarray) -> dict[str, Any]:
    return {"scalars": levels, "clim": (0.0, 1.0), "cmap": "gray"}


def grid(points: ndarray, cells: tuple[ndarray, ...]) -> pv.UnstructuredGrid:
    """Grid of triangles and quadrilaterals, arrays of shape (3, n) and (4, n)."""
    return pv.UnstructuredGrid({_CELLS[len(cell)]: cell.T for cell in cells}, points)


def _draw_legend(plotter: pv.Plotter, legend: PlacedLegend, frame: Frame) -> None:
    """Draw a legend into the active renderer."""
    for bar in legend.bars:
        _draw_bar(plotter, bar, frame)
    for colour, x, y in legend.strokes:
        corners = _corners(Box(x, y - _STROKE / 2, KEY, _STROKE))
        _draw_flat(plotter, corners[None], [pv.Color(colour).float_rgb], frame)
    for writing in legend.writings:
        _write(plotter, writing, frame)


def _draw_bar(plotter: pv.Plotter, bar: Bar, frame: Frame) -> None:
    (x, y, width, height), colours = bar.box, bar.colours[:, :3]
    step = width / len(colours)
    boxes = [Box(x + i * step, y, step, height) for i in range(len(colours))]
    _draw_flat(plotter, np.array([_corners(box) for box in boxes]), colours, frame)
    for tip, colour in zip(bar.tips, (colours[0], colours[-1]), strict=True):
        if len(tip):
            _draw_flat(plotter, np.array([tip]), [colour], frame)
    for mark in bar.zero:
        _draw_flat(plotter, _corners(mark)[None], [(0.0, 0.0, 0.0)], frame)


def _corners(box: Box) -> ndarray:
    x, y, width, height = box
    return np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * (width, height) + (x, y)


def _draw_flat(
    plotter: pv.Plotter, polygons: ndarray, colours: Any, frame: Frame
) -> None:
    """Draw polygons in front of everything, shape (n, n_corners, 2), in mm."""
    n, k, _ = polygons.shape
    x, y = frame.on(*polygons.reshape(-1, 2).T)
    faces = np.column_stack([np.full(n, k), np.arange(n * k).reshape(n, k)])
    flat = pv.PolyData(np.column_stack([x, y, 0 * x]), faces.ravel())
    flat.cell_data["colours"] = np.round(255 * np.asarray(colours)).astype(np.uint8)
    flat.set_active_scalars("colours", preference="cell")
    viewport = vtkCoordinate()
    viewport.SetCoordinateSystemToNormalizedViewport()
    mapper = vtkPolyDataMapper2D()
    mapper.SetInputData(flat)
    mapper.SetTransformCoordinate(viewport)
    actor = vtkActor2D()
    actor.SetMapper(mapper)
    plotter.renderer.AddViewProp(actor)


def _write(plotter: pv.Plotter, writing: Writing, frame: Frame) -> None:
    actor = plotter.add_text(
        writing.text,
        position=frame.on(writing.x, writing.y),
        viewport=True,
        color="black",
        font_file=font_file(),
        name=f"{writing.text} {writing.x:g} {writing.y:g}",
        render=False,
    )
    actor.prop.font_size = round(writing.size * POINT * frame.dots)
    actor.prop.justification_horizontal = writing.align
    actor.prop.justification_vertical = "center"


_WINDOW = "VTK_DEFAULT_OPENGL_WINDOW"

_DRAW = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.Render()
"""


@functools.cache
def require_offscreen() -> None:
    """Select an OpenGL window class with which VTK can draw off screen.

    Without a suitable window VTK ends the process with a segmentation fault, so each
    class is tried in a child process. The environment variable of VTK is set to the
    first class that works: EGL, then OSMesa, then the default of VTK.
    """
    preset = [os.environ[_WINDOW]] if _WINDOW in os.environ else []
    kinds = ["vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow"]
    for kind in preset + (kinds if sys.platform == "linux" else []):
        if _can_draw({_WINDOW: kind}):
            os.environ[_WINDOW] = kind
            return
    if not _can_draw({}):
        raise RuntimeError(
            "VTK cannot draw off screen on this system: install the Debian packages "
            "libegl1 and libgl1-mesa-dri"
        )


def _can_draw(environment: dict[str, str]) -> bool:
    child = subprocess.run(
        [sys.executable, "-c", _DRAW],
        env={**os.environ, **environment},
        capture_output=True,
        check=False,
    )
    return child.returncode == 0
