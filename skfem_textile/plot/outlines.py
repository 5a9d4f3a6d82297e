"""Singular fibres over the outline of a ply."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from .curves import COLOURS
from .layout import default_width
from .picture_files import picture_path, save
from .style import figure_style

if TYPE_CHECKING:
    from ..outlines import Outline, SingularFibres

# Lines by kind, distinct in grey: by their dashes and widths in points.
_LINES: dict[str, dict[str, Any]] = {
    "warp": {"color": COLOURS[0], "lw": 1.2, "ls": "-"},
    "weft": {"color": COLOURS[1], "lw": 1.2, "ls": (0, (5, 2))},
    "weak": {"color": "0.35", "lw": 0.9, "ls": (0, (1, 1.5))},
    "border": {"color": "black", "lw": 0.8, "ls": "-."},
    "held": {"color": "black", "lw": 3.5, "ls": "-"},
}
_LABELS = {
    "warp": "warp, shear angle may jump",
    "weft": "weft, shear angle may jump",
    "weak": "its derivative may jump",
    "border": "border",
    "held": "held or driven",
}

# Colour of the ply.
_PLY = "0.93"

# Largest height over the width of the picture.
_HIGHEST = 1.6


def singular_fibres(
    outline: "Outline",
    lines: "SingularFibres",
    filename: str | os.PathLike[str] | None = None,
) -> Figure:
    """Plot singular fibres over the outline of a ply.

    Warp is solid, weft dashed; fibres across which only the derivative of the shear
    angle may jump are dotted, and held edges thick.

    Parameters
    ----------
    outline
        The outline.
    lines
        Its singular fibres.
    filename
        Output file: PNG, or vector graphics (.svg, .pdf or .eps).

    Raises
    ------
    ValueError, FileNotFoundError
        As `picture_path`.

    Examples
    --------
    >>> import skfem_textile as st
    >>> outline = st.Outline([[0, 100, 100, 0], [0, 0, 200, 200]])
    >>> fabric = st.Fabric(1e5, 0.5, warp=(1, 1), weft=(-1, 1))
    >>> lines = st.singular_fibres(outline, fabric, {"held": st.Condition("bottom")})
    >>> axes = singular_fibres(outline, lines).axes[0]
    >>> axes.get_xlabel()
    'x (mm)'
    """
    path = None if filename is None else picture_path(filename)
    drawn = [("weak", fibre.points) for fibre in lines.weak]
    drawn += [("border", line) for line in lines.borders]
    drawn += [("held", piece) for piece in lines.held]
    drawn += [(("warp", "weft")[f.family], f.points) for f in lines.fibres]
    width = default_width(1) / 25.4
    span = np.ptp(outline.polygon, axis=1)
    height = width * float(np.clip(span[1] / span[0], 0.3, _HIGHEST)) + 0.8
    with figure_style():
        figure = Figure(figsize=(width, height), layout="constrained")
        axes = figure.add_subplot()
        rings = [np.vstack([ring.T, ring.T[:1]]) for ring in outline.rings]
        ply = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(ply, facecolor=_PLY, edgecolor="black", lw=0.6))
        for kind, points in drawn:
            axes.plot(*points, solid_capstyle="butt", **_LINES[kind])
        for x, y in outline.points.values():
            axes.plot(x, y, "o", color="black", markersize=3)
        axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
        kinds = [kind for kind in _LINES if kind in {k for k, _ in drawn}]
        figure.legend(
            handles=[Line2D([], [], label=_LABELS[k], **_LINES[k]) for k in kinds],
            loc="outside lower center",
            frameon=False,
            ncols=2 if width > 5 else 1,
            handlelength=3.5,
        )
        save(figure, path)
    return figure
