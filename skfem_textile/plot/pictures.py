"""Pictures of the deformed ply: strain, shear angle, fibres and an animation."""

import os
from collections.abc import Sequence

import numpy as np
import pyvista as pv
from numpy import ndarray

from ..io.fields import cell_fields
from ..solve.result import Result
from ..solve.states import State
from .drawing import (
    Picture,
    View,
    check_arguments,
    decorate,
    deformed,
    draw,
    empty_panels,
    panel,
    scale_bar,
    write_png,
)
from .fibres import add_fibres, add_legend
from .offscreen import require_offscreen
from .picture_files import picture_path

# Least limit of a scale, in per cent or degrees.  Chosen: above the rounding of zero.
_LEAST_LIMIT = 1e-8

# Chosen by eye, as all sizes and colours below.
_FRAMES_PER_SECOND = 8

# Height of a panel of a contact sheet, in pixels.
_SHEET_PANEL_HEIGHT = 300


def fibre_strain(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
) -> pv.Plotter:
    """Fibre strain of warp (above) and weft (below), one column per result.

    The strain is that which the law of tension sees.  All panels share one diverging
    scale, symmetric about zero.

    Parameters
    ----------
    *results
        Results whose last state is drawn.
    titles
        One short title per result; their formulations if not given.
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
        If there is no result, not one title per result, or the name has another suffix
        than .png.
    FileNotFoundError
        If the folder of the file does not exist.
    """
    return draw(results, titles, filename, _strain_picture(results))


def shear_angle(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
) -> pv.Plotter:
    """Shear angle in degrees, one panel per result, on a shared scale.

    Parameters, returned value and errors as for `fibre_strain`.
    """
    return draw(results, titles, filename, _shear_picture(results))


def contact_sheet(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
) -> pv.Plotter:
    """Warp strain, weft strain and shear angle in columns, one row per result.

    Parameters, returned value and errors as for `fibre_strain`.
    """
    path, titles = check_arguments(results, titles, filename)
    strain, shear = _strain_picture(results), _shear_picture(results)
    columns = [(strain, *row) for row in strain.rows.items()]
    columns += [(shear, *row) for row in shear.rows.items()]
    plies = [deformed(result, result.states[-1]) for result in results]
    view = View.of(plies, height=_SHEET_PANEL_HEIGHT)
    plotter = empty_panels(view, len(results), len(columns), slice(0, 2))
    for column, (picture, name, fields) in enumerate(columns):
        for row, values in enumerate(fields):
            plotter.subplot(row, column)
            title = f"{name}, {titles[row]}"
            actor = panel(plotter, plies[row], values, picture, title, view)
        if column != 1:  # the scale of the strains spans two columns
            plotter.subplot(len(results), column)
            scale_bar(plotter, picture, actor)
    if path is not None:
        write_png(plotter, path)
    return plotter


def fibre_directions(
    *results: Result,
    titles: Sequence[str] = (),
    filename: str | os.PathLike[str] | None = None,
) -> pv.Plotter:
    """Directions of warp (blue) and weft (red): a line per element and family.

    Where elements are too small for that, some of them have lines.

    Parameters, returned value and errors as for `fibre_strain`.
    """
    path, titles = check_arguments(results, titles, filename)
    plies = [deformed(result, result.states[-1]) for result in results]
    view = View.of(plies)
    plotter = empty_panels(view, 1, len(results), slice(None))
    for column, (result, ply) in enumerate(zip(results, plies, strict=True)):
        plotter.subplot(0, column)
        fields = cell_fields(result.ply, result.u)
        warp, weft = (fields[f"{family}_direction"] for family in ("warp", "weft"))
        add_fibres(plotter, ply, warp, weft, view)
        decorate(plotter, f"Fibre directions, {titles[column]}", view)
    add_legend(plotter)
    if path is not None:
        write_png(plotter, path)
    return plotter


def animation(result: Result, filename: str | os.PathLike[str]) -> None:
    """Write the shear angle on the moving ply as a GIF, one frame per state.

    Parameters
    ----------
    result
        The result whose states are drawn.
    filename
        Where to write the GIF.

    Raises
    ------
    RuntimeError
        If nothing can be drawn off screen here; the message says what to install.
    ValueError
        If the name has another suffix than .gif.
    FileNotFoundError
        If the folder of the file does not exist.
    """
    path = picture_path(filename, ".gif")
    require_offscreen()
    plies = [deformed(result, state) for state in result.states]
    fields = [_degrees(result, state) for state in result.states]
    picture = _shear_picture([result], result.states)
    view = View.of(plies)
    plotter = empty_panels(view, 1, 1)
    unfinished = path.with_name(f".unfinished-{path.stem}.gif")
    plotter.open_gif(str(unfinished), fps=_FRAMES_PER_SECOND)
    for state, ply, values in zip(result.states, plies, fields, strict=True):
        plotter.subplot(0, 0)
        title = f"Shear angle at load factor {state.load_factor:.2f}"
        actor = panel(plotter, ply, values, picture, title, view)
        if state is result.states[0]:
            plotter.subplot(1, 0)
            scale_bar(plotter, picture, actor)
        plotter.write_frame()
    for _ in range(_FRAMES_PER_SECOND):  # show the last state for one more second
        plotter.write_frame()
    plotter.close()
    unfinished.replace(path)


def _strain_picture(results: Sequence[Result]) -> Picture:
    fields = [cell_fields(r.ply, r.u) for r in results]
    rows = {
        f"{family} strain": [100 * f[f"{family.lower()}_strain"] for f in fields]
        for family in ("Warp", "Weft")
    }
    largest = max((np.abs(x).max() for row in rows.values() for x in row), default=0.0)
    scale = max(largest, _LEAST_LIMIT)
    return Picture(rows, "Fibre strain (%)", (-scale, scale), "RdBu_r")


def _shear_picture(results: Sequence[Result], states: Sequence[State] = ()) -> Picture:
    """Shear angle of the last states, on a scale that covers ``states`` too."""
    row = [_degrees(result, result.states[-1]) for result in results]
    angles = row + [_degrees(results[0], state) for state in states]
    low = min((x.min() for x in angles), default=0.0)
    high = max((x.max() for x in angles), default=0.0)
    limits = min(low, 0.0), max(high, _LEAST_LIMIT)
    return Picture({"Shear angle": row}, "Shear angle (degrees)", limits, "viridis")


def _degrees(result: Result, state: State) -> ndarray:
    return cell_fields(result.ply, state.u)["shear_angle"]
