"""Moving pictures of a run."""

import os
from collections.abc import Sequence
from typing import Any

from ..solve.result import Result
from .fields import Field, field_of, reach, values_of
from .layout import lay_out
from .picture_files import picture_path, write
from .renderers.drawing import new_plotter, pixels, pyvista_renderer
from .shapes import shapes_of
from .sheet import Legend, Panel, Scale, Sheet, extent

# Dots per inch: of a picture for a screen.
_DOTS = 150

# Duration of a frame and of the last one, in ms.
_FRAME, _LAST = 125, 1125


def animation(
    result: Result,
    filename: str | os.PathLike[str],
    field: str | Field = "shear_angle",
    cmap: Any = None,
    clim: Sequence[float] | None = None,
    show_edges: bool | None = None,
    size: float | tuple[float, float] | None = None,
) -> None:
    """Write a field on the moving ply as a GIF, one frame per state, on one scale.

    Parameters
    ----------
    result
        The result whose states are drawn.
    filename
        Where to write the GIF.
    field, cmap, clim, show_edges, size
        As for `field`; an mm has 6 pixels.

    Raises
    ------
    ImportError, RuntimeError, FileNotFoundError
        As for `field`.
    ValueError
        As for `field`, or if the name has another suffix than .gif.
    """
    from PIL import Image

    path = picture_path(filename, (".gif",))
    shown, states = field_of(field), result.states
    shapes = shapes_of([result] * len(states), states)
    values = [values_of(shown, result.ply, state.u) for state in states]
    found = reach(values, shown.symmetric)
    scale = Scale.of(shown.label, found, cmap or shown.cmap, clim)
    sheets = [
        Sheet(
            [[Panel(f"Load factor {state.load_factor:.2f}", shape, each, scale)]],
            [Legend(0, 1, scale)],
            extent(shapes),
            show_edges,
        )
        for state, shape, each in zip(states, shapes, values, strict=True)
    ]
    layouts = [lay_out(sheet, size) for sheet in sheets]
    frames = []
    for sheet, layout in zip(sheets, layouts, strict=True):
        plotter = new_plotter(layout, _DOTS)  # one that drew before loses its text
        pyvista_renderer().draw_new(plotter, sheet, layout)
        frames.append(Image.fromarray(pixels(plotter)))
        plotter.close()
    first, *others = [frame.quantize(dither=Image.Dither.NONE) for frame in frames]
    write(
        path,
        ".gif",
        lambda file: first.save(
            file,
            save_all=True,
            append_images=others,
            duration=[_FRAME] * len(others) + [_LAST],
            loop=0,
        ),
    )
