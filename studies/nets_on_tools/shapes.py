"""Nets and flat patterns on shapes of the tests."""

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from skfem_textile import drape
from tests.helpers import tool_shapes

from ..common.tables import markdown_table
from ..study import Row

#: Shapes by name, in tens of seconds at most.
SHAPES = {
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
        return f"shape, {self.name}, {self.angle:g}°"

    def rows(self) -> list[Row]:
        """One row: covered area against the area of the triangles."""
        tool = drape.TriangleMesh(*SHAPES[self.name]())
        points = tool.facets.points
        a, b, c = points[:, tool.facets.triangles()].swapaxes(0, 1)
        area = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum()
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
                "area": float(area),
                "area_error": part.area / float(area) - 1,
                "pattern_area": part.pattern.area,
                "seconds": round(laid - begin, 2),
                "pattern_seconds": round(done - laid, 2),
            }
        ]


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
    """The largest error of an area, for prose."""
    errors = [abs(row["area_error"]) for row in rows if "area_error" in row]
    known = [e for e in errors if e is not None]
    return {"areas": f"{max(known):.1%}"} if known else {}
