"""Flat patterns in files: CSV, SVG and DXF, all in mm."""

import csv
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy import ndarray

from ...drape import FlatPattern
from ...mesh.user_input import printable

_COLUMNS = (
    *("curve", "point", "x", "y", "along", "warp_angle_deg", "weft_angle_deg"),
    *("tool_x", "tool_y", "tool_z"),
)

# Length of an axis, and height of letters, as shares of the pattern's smaller extent.
_AXIS, _LETTERS = 0.25, 0.04

# Margin and width of lines of an SVG, as shares of the larger extent.
_MARGIN, _LINE = 0.05, 0.002

# Layers of a DXF and colours of an SVG.
_CUT, _FAMILIES = ("CUT", "black"), (("WARP", "#c0392b"), ("WEFT", "#2464a4"))

_MILLIMETRES = 4  # of the variable $INSUNITS of a DXF


def write_pattern(
    path: str | os.PathLike[str], patterns: FlatPattern | Sequence[FlatPattern]
) -> None:
    """Write the outlines of a flat pattern.

    A .csv has the points of each curve, the length along it up to each point, the
    angles of the fibres in the flat ply to its x axis, and the point on the tool.  A
    .svg and a .dxf have the outlines at full size and the mean directions of warp and
    weft.  A .dxf has them on the layers ``CUT``, ``WARP`` and ``WEFT``.

    Parameters
    ----------
    path
        The file.
    patterns
        The outline, or the outline and holes.

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
    curves = [patterns] if isinstance(patterns, FlatPattern) else list(patterns)
    writers = {".csv": _write_csv, ".svg": _write_svg, ".dxf": _write_dxf}
    if path.suffix.lower() not in writers:
        raise ValueError(
            f"{printable(path)}: patterns are written to {', '.join(writers)}"
        )
    if not curves:
        raise ValueError(f"{printable(path)}: there is no pattern to write")
    writers[path.suffix.lower()](path, curves)


def _write_csv(path: Path, curves: list[FlatPattern]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_COLUMNS)
        for number, curve in enumerate(curves, 1):
            steps = np.linalg.norm(np.diff(curve.outline, axis=1), axis=0)
            along = np.concatenate([[0.0], np.cumsum(steps)])
            angles = [
                np.degrees(np.arctan2(y, x)) + 0.0 for x, y in (curve.warp, curve.weft)
            ]
            table = np.vstack([curve.outline, along, *angles, curve.on_tool])
            writer.writerows(
                [number, i, *row] for i, row in enumerate(table.T.tolist(), 1)
            )


def _axes(curves: list[FlatPattern]) -> tuple[ndarray, ndarray]:
    """Middle of a pattern, and arrows along warp and weft, shapes (2,) and (2, 2)."""
    low, high = _extent(curves)
    families = [
        np.hstack(of) for of in zip(*((c.warp, c.weft) for c in curves), strict=True)
    ]
    means = np.array([family.mean(axis=1) for family in families])
    length = _AXIS * (high - low).min()
    arrows = length * means / np.linalg.norm(means, axis=1, keepdims=True)
    return curves[0].outline.mean(axis=1), arrows


def _extent(curves: list[FlatPattern]) -> tuple[ndarray, ndarray]:
    points = np.hstack([curve.outline for curve in curves])
    return points.min(axis=1), points.max(axis=1)


def _write_svg(path: Path, curves: list[FlatPattern]) -> None:
    low, high = _extent(curves)
    size = high - low
    margin, line, letters = (
        _MARGIN * size.max(),
        _LINE * size.max(),
        _LETTERS * size.min(),
    )
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
            f'<polygon points="{points}" fill="none" stroke="{_CUT[1]}" '
            f'stroke-width="{line:g}"/>'
        )
    middle, arrows = _axes(curves)
    for (name, colour), arrow in zip(_FAMILIES, arrows, strict=True):
        (x, y), (x_end, y_end) = middle, middle + arrow
        lines += [
            f'<line x1="{x:g}" y1="{-y:g}" x2="{x_end:g}" y2="{-y_end:g}" '
            f'stroke="{colour}" stroke-width="{2 * line:g}"/>',
            f'<text x="{x_end:g}" y="{-y_end:g}" font-size="{letters:g}" '
            f'font-family="sans-serif" fill="{colour}">{name.lower()}</text>',
        ]
    path.write_text("\n".join([*lines, "</svg>", ""]), encoding="utf-8")


def _write_dxf(path: Path, curves: list[FlatPattern]) -> None:
    try:
        import ezdxf
    except ImportError:
        raise ImportError(
            "a .dxf needs ezdxf: pip install 'skfem-textile[dxf]', or write a .svg"
        ) from None
    drawing = ezdxf.new("R2000", units=_MILLIMETRES)
    space = drawing.modelspace()
    for name in (_CUT[0], *(name for name, _ in _FAMILIES)):
        drawing.layers.add(name)
    for curve in curves:
        layer = {"layer": _CUT[0]}
        space.add_lwpolyline(curve.outline.T.tolist(), close=True, dxfattribs=layer)
    low, high = _extent(curves)
    letters = _LETTERS * (high - low).min()
    middle, arrows = _axes(curves)
    for (name, _), arrow in zip(_FAMILIES, arrows, strict=True):
        layer, end = {"layer": name}, (middle + arrow).tolist()
        space.add_line(middle.tolist(), end, dxfattribs=layer)
        text = space.add_text(name, height=letters, dxfattribs=layer)
        text.set_placement(end)
    drawing.saveas(path)
