"""Output of draped fibres and flat patterns."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..fabric.directions import FibreDirections
from ..mesh.requirements import require
from ..mesh.user_input import printable
from ..nets.flat_pattern import FlatPattern, SeamLine
from ..nets.sheet import (
    FibresInSpace,
    Pieces,
    Sheet,
    fibres_on_ply,
)
from ..solve.result import Result
from ..surfaces.surface import SAME_AXES, Axes
from ..surfaces.tool_mesh import ToolMesh
from .abaqus import deck_of
from .directions import write_directions
from .file_numbers import by_suffix, write_table
from .results import cell_fields, on_users_elements
from .vtk import write_grid

#: Names of the files written by `write_draped`.
DRAPED = ("fibres.vtu", "fibres.csv", "fibres.inp")

_VECTORS = ("warp_direction", "weft_direction")
_MEASURES = ("warp_angle_deg", "weft_angle_deg", "shear_angle_deg")


def write_fibres(path: str | os.PathLike[str], fibres: FibresInSpace) -> None:
    """Write the fibres in elements in space.

    A .vtu has the vectors ``warp_direction``, ``weft_direction`` and ``reference``, to
    which the angles ``warp_angle_deg`` and ``weft_angle_deg`` refer,
    ``shear_angle_deg``, and ``covered``, 1 or 0.  A .csv has the angles at the centre
    of each element.  An Abaqus .inp has a distribution and an orientation for each
    family, and the sets.  Elements are numbered from 1 on.  Elements not covered by the
    ply have NaN in a .vtu, empty cells in a .csv, and form the set ``NOT_COVERED`` in a
    .inp.

    Parameters
    ----------
    path
        The file.
    fibres
        Result of `fibres_on_tool` or `fibres_on_ply`.

    Raises
    ------
    ValueError
        If the name has another suffix.
    OSError
        If the file cannot be written.
    """
    path = Path(path)
    mesh, suffix = fibres.mesh, path.suffix.lower()
    measures = *fibres.angles_deg(), np.degrees(fibres.shear_angle)
    if suffix == ".vtu":
        fields = dict(zip(_VECTORS, (fibres.warp.T, fibres.weft.T), strict=True))
        fields["reference"] = fibres.reference().T
        fields |= dict(zip(_MEASURES, measures, strict=True))
        fields["covered"] = fibres.covered.astype(int)
        write_grid(path, mesh.points, mesh.cells, fields)
    elif suffix == ".csv":
        table = np.vstack([mesh.centres(), *measures]).T.tolist()
        empty, covered = [""] * len(_MEASURES), fibres.covered.tolist()
        rows = (
            [i, *row[:3], int(known), *(row[3:] if known else empty)]
            for i, (row, known) in enumerate(zip(table, covered, strict=True), 1)
        )
        write_table(path, ("element", "x", "y", "z", "covered", *_MEASURES), rows)
    elif suffix == ".inp":
        directions = fibres.warp, fibres.weft, fibres.normal
        sets = fibres.node_sets, fibres.element_sets
        deck = deck_of(mesh.cells, mesh.points, *directions, *sets)
        path.write_text(deck, encoding="utf-8")
    else:
        raise ValueError(
            f"{printable(path)}: fibres can be written only to .vtu, .csv, .inp files"
        )


def write_draped(
    result: Result, folder: str | os.PathLike[str], axes: Axes = SAME_AXES
) -> None:
    """Write the fibres of the last state for subsequent analyses: VTU, CSV and Abaqus.

    Nodes are at their final positions, and directions are element means of the deformed
    fibres in the user's elements.

    Parameters
    ----------
    result
        The result.
    folder
        Folder for ``fibres.vtu``, ``fibres.csv`` and ``fibres.inp``.
    axes
        Axes of a ply in space in the coordinates of the files.

    Raises
    ------
    ValueError
        If the ply has not reached its tool, see `Result.not_on_tool`.
    OSError
        If a file cannot be written.
    """
    if result.not_on_tool:
        raise ValueError(f"fibres: {result.not_on_tool}")
    ply, moved = result.ply, result.ply.nodal(result.u)
    files = [Path(folder) / name for name in DRAPED]
    if len(moved) == 3:
        fibres = fibres_on_ply(ply, result.u)
        names = "normal", "warp", "weft"
        turned = {name: axes.turn @ getattr(fibres, name) for name in names}
        tool_mesh = ToolMesh(axes.of_tool(fibres.mesh.points), fibres.mesh.cells)
        for file in files:
            write_fibres(file, replace(fibres, mesh=tool_mesh, **turned))
        return
    fields = on_users_elements(
        ply, cell_fields(ply, result.u, result.states[-1].parameters)
    )
    directions = FibreDirections(*(fields[name][:, :2].T for name in _VECTORS))
    points = ply.users_points + ply.on_users_nodes(moved)
    for file in files:
        write_directions(file, ply.users_mesh, directions, points)


def write_net(path: str | os.PathLike[str], net: Pieces) -> None:
    """Write the cells of a net as quadrilaterals with their shear angle: a VTU file.

    Parameters
    ----------
    path
        The file.
    net
        The net, a net with darts, or a part of one.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    sheet = Sheet.of_net(net)
    angles = [piece.shear_angle()[cells] for piece, cells in net.pieces]
    angle = np.degrees(np.concatenate(angles))
    fields = {"shear_angle_deg": angle}
    write_grid(Path(path), sheet.positions, (sheet.elements,), fields)


# Length of an axis, and height of letters, relative to the smaller extent of the
# pattern.
_AXIS, _LETTERS = 0.25, 0.04

# Margin and line width of an SVG, relative to the larger extent.
_MARGIN, _LINE = 0.05, 0.002

# Colours of both families in an SVG, as in pictures.
_COLOURS = {"warp": "#0072B2", "weft": "#D55E00"}

# Colour of seam lines.
_SEAM = "#009E73"

_MILLIMETRES = 4  # of the variable $INSUNITS of a DXF


def write_pattern(
    path: str | os.PathLike[str], patterns: FlatPattern | Sequence[FlatPattern]
) -> None:
    """Write the outlines of a flat pattern and of its holes, and its seam lines.

    A .csv has the points of each curve, the arc length up to each point, the angles of
    the fibres in the flat ply to its x axis, the point on the tool, and for seam lines
    the number of the seam.  A .svg and a .dxf have the outlines and numbered seam lines
    at full size, and the mean directions of warp and weft.  A .dxf has them on the
    layers ``CUT``, ``SEAM``, ``WARP`` and ``WEFT``.

    Parameters
    ----------
    path
        The file.
    patterns
        The pattern, or several.

    Raises
    ------
    ValueError
        If the name has another suffix.
    ImportError
        If a .dxf is to be written and ezdxf is not installed.
    OSError
        If the file cannot be written.
    """
    path = Path(path)
    several = [patterns] if isinstance(patterns, FlatPattern) else patterns
    curves = [curve for pattern in several for curve in (pattern, *pattern.holes)]
    writers = {".csv": _write_outline_csv, ".svg": _write_svg, ".dxf": _write_dxf}
    what = f"{printable(path)}: patterns can be written only to"
    write = by_suffix(path, writers, what)
    if not curves:
        raise ValueError(f"{printable(path)}: there is no pattern to write")
    seams = [seam for pattern in several for seam in pattern.seams]
    write(path, curves, seams)


def _write_outline_csv(
    path: Path, curves: list[FlatPattern], seams: list[SeamLine]
) -> None:
    warp, weft = (way[:, :1] for way in (curves[0].warp, curves[0].weft))
    lines = [
        *((one.outline, one.on_tool, one.warp, one.weft, "") for one in curves),
        *((seam.flat, seam.on_tool, warp, weft, seam.number) for seam in seams),
    ]
    rows = []
    for number, (flat, on_tool, *fibres, seam) in enumerate(lines, 1):
        n = flat.shape[1]
        steps = np.linalg.norm(np.diff(flat, axis=1), axis=0)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        angles = [
            np.broadcast_to(np.degrees(np.arctan2(y, x)) + 0.0, n) for x, y in fibres
        ]
        table = np.vstack([flat, along, *angles, on_tool])
        rows += [[number, i, *row, seam] for i, row in enumerate(table.T.tolist(), 1)]
    header = (
        *("curve", "point", "x", "y", "along", "warp_angle_deg"),
        *("weft_angle_deg", "tool_x", "tool_y", "tool_z", "seam"),
    )
    write_table(path, header, rows)


class _Drawing(NamedTuple):
    """Extent of a pattern, its centre, and arrows along warp and weft by colour."""

    low: ndarray
    high: ndarray
    middle: ndarray
    arrows: dict[str, ndarray]

    @classmethod
    def of(cls, curves: list[FlatPattern]) -> "_Drawing":
        points = np.hstack([curve.outline for curve in curves])
        low, high = points.min(axis=1), points.max(axis=1)
        length, arrows = _AXIS * (high - low).min(), {}
        for name in _COLOURS:
            family = np.hstack([getattr(curve, name) for curve in curves])
            mean = family.mean(axis=1)
            arrows[name] = length * mean / np.linalg.norm(mean)
        return cls(low, high, curves[0].outline.mean(axis=1), arrows)


def _write_svg(path: Path, curves: list[FlatPattern], seams: list[SeamLine]) -> None:
    low, high, (x, y), arrows = _Drawing.of(curves)
    size = high - low
    margin, line = _MARGIN * size.max(), _LINE * size.max()
    width, height = size + 2 * margin
    left, top = low[0] - margin, -high[1] - margin
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}mm" '
        f'height="{height:g}mm" viewBox="{left:g} {top:g} {width:g} {height:g}">',
        f"<title>Flat pattern, {size[0]:.2f} mm × {size[1]:.2f} mm</title>",
    ]
    for curve in curves:
        points = " ".join(f"{x:.6g},{-y:.6g}" for x, y in curve.outline.T)
        lines.append(
            f'<polygon points="{points}" fill="none" stroke="black" '
            f'stroke-width="{line:g}"/>'
        )
    letters = _LETTERS * size.min()
    for seam in seams:
        points = " ".join(f"{x:.6g},{-y:.6g}" for x, y in seam.flat.T)
        left, top = seam.flat[:, seam.flat.shape[1] // 2]
        lines += [
            f'<polyline points="{points}" fill="none" stroke="{_SEAM}" '
            f'stroke-width="{2 * line:g}" stroke-dasharray="{6 * line:g}"/>',
            f'<text x="{left:g}" y="{-top:g}" font-size="{letters:g}" '
            f'font-family="sans-serif" fill="{_SEAM}">{seam.number}</text>',
        ]
    for name, arrow in arrows.items():
        x_end, y_end = x + arrow[0], y + arrow[1]
        lines += [
            f'<line x1="{x:g}" y1="{-y:g}" x2="{x_end:g}" y2="{-y_end:g}" '
            f'stroke="{_COLOURS[name]}" stroke-width="{2 * line:g}"/>',
            f'<text x="{x_end:g}" y="{-y_end:g}" font-size="{letters:g}" '
            f'font-family="sans-serif" fill="{_COLOURS[name]}">{name}</text>',
        ]
    path.write_text("\n".join([*lines, "</svg>", ""]), encoding="utf-8")


def _write_dxf(path: Path, curves: list[FlatPattern], seams: list[SeamLine]) -> None:
    require("writing a .dxf file", "dxf", "ezdxf")
    import ezdxf

    low, high, middle, arrows = _Drawing.of(curves)
    file = ezdxf.new("R2000", units=_MILLIMETRES)
    space = file.modelspace()
    for name in ("CUT", "SEAM", "WARP", "WEFT"):
        file.layers.add(name)
    for curve in curves:
        layer = {"layer": "CUT"}
        space.add_lwpolyline(curve.outline.T.tolist(), close=True, dxfattribs=layer)
    letters = _LETTERS * (high - low).min()
    layer = {"layer": "SEAM"}
    for seam in seams:
        space.add_lwpolyline(seam.flat.T.tolist(), dxfattribs=layer)
        text = space.add_text(str(seam.number), height=letters, dxfattribs=layer)
        text.set_placement(seam.flat[:, seam.flat.shape[1] // 2].tolist())
    for family, arrow in arrows.items():
        name, end = family.upper(), (middle + arrow).tolist()
        space.add_line(middle.tolist(), end, dxfattribs={"layer": name})
        text = space.add_text(name, height=letters, dxfattribs={"layer": name})
        text.set_placement(end)
    file.saveas(path)
