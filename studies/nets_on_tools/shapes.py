"""Nets and flat patterns on shapes of the tests."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from skfem_textile import drape
from tests.helpers import tool_shapes

from ..common.tables import markdown_table
from ..study import Row

SHAPE, BOX = "shape", "box"

#: Cells of the nets on the deep box in mm, and inclinations of the warp in degrees.
CELLS_OF_BOX, ANGLES_ON_BOX = (5.0, 3.0, 2.0), (0.0, 30.0, 45.0)

# Locking angle on the box in degrees.
_LOCKING = 55.0

#: Shapes by name.
SHAPES: dict[str, Callable[[], Any]] = {
    "hemisphere with flange": tool_shapes.hemisphere_with_flange,
    "hat": tool_shapes.hat,
    "saddle": tool_shapes.saddle,
    "bonnet": tool_shapes.bonnet,
    "askew bonnet": lambda: tool_shapes.bonnet(askew=True),
}

# Cells along the longest side of a shape.
_CELLS = 60


@dataclass(frozen=True)
class Shape:
    """A shape, and the inclination of the warp in degrees."""

    name: str
    angle: float

    def __str__(self) -> str:
        return f"{SHAPE}, {self.name}, {self.angle:g}°"

    def rows(self) -> list[Row]:
        """One row: covered area against the area of the triangles."""
        tool = drape.TriangleMesh(*SHAPES[self.name]())
        points, area = tool.facets.points, _area(tool)
        middle = points[:, np.hypot(*points[:2]).argmin()]
        angles = np.radians(self.angle) + np.array([0.0, 0.5 * np.pi])
        begin = process_time()
        net = drape.net(
            tool,
            float(np.ptp(points, axis=1).max()) / _CELLS,
            angles=(angles[0], angles[1]),
            point=middle,
        )
        laid = process_time()
        (outline, *_) = tool.facets.boundary()
        part = drape.trimmed(net, outline)
        done = process_time()
        return [
            {
                "shape": self.name,
                "angle": self.angle,
                "cells": int(net.cells.sum()),
                "folds": net.folds.shape[1],
                "shear_angle": float(np.degrees(np.nanmax(np.abs(part.shear_angle())))),
                "area": area,
                "area_error": part.area / area - 1,
                "pattern_area": part.pattern.area,
                "seconds": round(laid - begin, 2),
                "pattern_seconds": round(done - laid, 2),
            }
        ]


def _area(tool: drape.TriangleMesh) -> float:
    """Area of the triangles in mm²."""
    points = tool.facets.points
    a, b, c = points[:, tool.facets.triangles()].swapaxes(0, 1)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum())


@dataclass(frozen=True)
class Box:
    """A deep box with fillets of 5 mm, the cell in mm, and the warp in degrees."""

    cell: float
    angle: float

    def __str__(self) -> str:
        return f"{BOX}, {self.cell:g} mm, {self.angle:g}°"

    def rows(self) -> list[Row]:
        """One row: net and pattern with darts at the corners."""
        tool = drape.TriangleMesh(*tool_shapes.deep_box())
        area = _area(tool)
        top = np.array([0.0, 0.0, float(tool.facets.points[2].max())])
        warp = float(np.radians(self.angle))
        start: dict[str, Any] = {"point": top, "angles": (warp, warp + np.pi / 2)}
        without = drape.net(tool, self.cell, **start).shear_angle()
        begin = process_time()
        locking = float(np.radians(_LOCKING))
        laid = drape.net_with_darts(tool, self.cell, locking, **start)
        (outline,) = tool.facets.boundary()
        pattern = drape.pattern_with_darts(laid, outline)
        seconds = process_time() - begin
        lengths = np.array([dart.lengths for dart in pattern.darts])
        edges = np.abs(lengths[:, 0] - lengths[:, 1]) / lengths.mean(axis=1)
        return [
            {
                "cell": self.cell,
                "angle": self.angle,
                "darts": len(pattern.darts),
                "without_darts": float(np.degrees(np.nanmax(np.abs(without)))),
                "shear_angle": float(np.degrees(pattern.shear_angle)),
                "beside_spots": float(np.degrees(pattern.shear_angle_beside_spots)),
                "area": area,
                "area_error": pattern.area_on_tool / area - 1,
                "pattern_area": pattern.pattern.area,
                "pattern_error": pattern.pattern.area / area - 1,
                "dart_area": float(np.mean([dart.area for dart in pattern.darts])),
                "edges_differ": float(edges.max()),
                "seconds": round(seconds, 1),
            }
        ]


def box_table(rows: list[Row]) -> str:
    """A line for each cell."""
    head = [
        *("cell, mm", "fibres", "darts", "largest angle without darts"),
        *("with darts", "of it beside the spots", "area covered"),
        *("flat pattern, mm²", "its error", "area of a dart, mm²"),
        *("difference of its edges", "seconds"),
    ]
    return markdown_table(
        head,
        [
            [
                *(f"{row['cell']:g}", f"{row['angle']:g}°", row["darts"]),
                *(f"{row['without_darts']:.0f}°", f"{row['shear_angle']:.0f}°"),
                *(f"{row['beside_spots']:.1f}°", f"{1 + row['area_error']:.2%}"),
                *(f"{row['pattern_area']:.5g}", f"{row['pattern_error']:+.2%}"),
                *(f"{row['dart_area']:.4g}", f"{row['edges_differ']:.1%}"),
                f"{row['seconds']:.1f}",
            ]
            for row in rows
        ],
    )


def shape_table(rows: list[Row]) -> str:
    """A line for each shape and angle."""
    head = [
        *("shape", "warp", "cells", "largest angle, °", "area covered"),
        *("flat pattern, mm²", "net, s", "pattern, s"),
    ]
    return markdown_table(
        head,
        [
            [
                *(row["shape"], f"{row['angle']:g}°", row["cells"]),
                *(f"{row['shear_angle']:.1f}", f"{1 + row['area_error']:.2%}"),
                f"{row['pattern_area']:.5g}",
                *(f"{row['seconds']:.2f}", f"{row['pattern_seconds']:.2f}"),
            ]
            for row in rows
        ],
    )


def shapes_in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The largest errors of areas, for prose."""
    words = {}
    for name, kind in (("areas", SHAPE), ("areas_of_boxes", BOX)):
        errors = [
            abs(row["area_error"]) for row in rows if row["case"].startswith(kind)
        ]
        if errors:
            words[name] = f"{max(errors):.1%}"
    boxes = [row for row in rows if row["case"].startswith(BOX)]
    if boxes:
        for name in ("pattern_error", "edges_differ"):
            words[f"box_{name}"] = f"{max(abs(row[name]) for row in boxes):.1%}"
        largest = max(row["beside_spots"] for row in boxes)
        words["box_beside_spots"] = f"{largest:.0f}°"
    return words
