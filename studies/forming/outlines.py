"""Plies with user-defined outlines on meshes of several kinds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh

from skfem_textile import Fabric, Outline
from skfem_textile.mesh.splitting import split
from skfem_textile.outlines.fibres import SingularFibres
from skfem_textile.outlines.meshing import irregular, quadrilaterals
from skfem_textile.scenes import Case, hemisphere_forming
from skfem_textile.scenes.rectangle import rectangle

from ..common.tables import markdown_table
from ..study import Row

#: Kind of these cases.
OUTLINE = "outline"

#: Meshes: of the rectangle around the outline, of the outline as in a run, the same
#: with rows along the fibres, and irregular triangles with as many nodes.
_AROUND, _RUN, _ALONG, _TRIANGLES = MESHES = (
    *("rectangle around it", "quadrilaterals", "quadrilaterals along the fibres"),
    "triangles",
)

# Elements across, of the compared meshes and of the reference.
_ACROSS, _FINE = 14, 28

# Size of triangles relative to quadrilaterals, for as many nodes.
_OF_TRIANGLES = 1.25


def _shapes() -> dict[str, Outline]:
    """Outlines of about 300 mm."""
    t = 2 * np.pi * np.arange(120) / 120
    lobes = [155 * np.cos(t) + 20 * np.cos(4 * t), 145 * np.sin(t)]
    cut = [[-150, 100, 150, 150, -110, -150], [-150, -150, -100, 140, 150, 90]]
    hole = [115 + 12 * np.cos(t[::4]), 90 + 12 * np.sin(t[::4])]
    square = [[-150, 150, 150, -150], [-150, -150, 150, 150]]
    return {
        "square": Outline(square),
        "four lobes": Outline(lobes),
        "corners cut, a hole": Outline(cut, [hole]),
    }


SHAPES = _shapes()


@dataclass(frozen=True)
class Outlined:
    """Hemisphere of R 75 mm formed to 75 mm: outline, fibre angle in degrees, mesh."""

    name: str
    fibres: float
    mesh: str

    def __str__(self) -> str:
        return f"{OUTLINE}, {self.name}, fibres {self.fibres:g}°, {self.mesh}"

    def rows(self) -> list[Row]:
        """One row of figures, and the force and angle on a fine mesh."""
        run = self._run(self.mesh, _ACROSS)
        fine = self._run(_RUN, _FINE)
        figures = {f"{key}_of_fine_mesh": fine[key] for key in ("force", "angle")}
        return [
            {"kind": OUTLINE, "name": self.name, "mesh": self.mesh, **run, **figures}
        ]

    def _run(self, kind: str, across: int) -> dict[str, Any]:
        angle = np.radians(self.fibres)
        mesh = _mesh(SHAPES[self.name], kind, across, angle)
        scene = hemisphere_forming(mesh, part="whole", fibres=angle)
        fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
        result = Case(scene=scene, fabric=fabric, steps=5).run()
        summary = result.summary()
        return {
            "nodes": result.ply.mesh.nvertices,
            "solves": result.linear_solves,
            "force": float(summary["punch_force_N"]),
            "half_width": float(summary["punch_force_N_half_width"] or np.nan),
            "angle": float(summary["recovered_max_shear_angle_deg"]),
        }


def _mesh(outline: Outline, kind: str, across: int, angle: float) -> Mesh:
    low, high = outline.polygon.min(axis=1), outline.polygon.max(axis=1)
    size = across, across
    if kind == _AROUND:
        width, height = (high - low).tolist()
        return rectangle(width, height, size, "aligned").translated(low)
    if kind == _RUN:
        return quadrilaterals(outline, size)
    if kind == _TRIANGLES:
        side = _OF_TRIANGLES * float(np.ptp(outline.polygon)) / across
        return irregular(outline, SingularFibres([], [], [], [], 0, 0.0), side)
    turn = _rotation(-angle)
    turned = Outline(turn @ outline.polygon, [turn @ hole for hole in outline.holes])
    mesh = quadrilaterals(turned, size)
    mesh = mesh if hasattr(mesh, "cells") else split(mesh)
    return replace(mesh, doflocs=turn.T @ mesh.p)


def _rotation(angle: float) -> ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def outline_cases() -> list[Outlined]:
    """All cases."""
    return [
        Outlined(name, fibres, mesh)
        for name in SHAPES
        for fibres in (0.0, 30.0)
        for mesh in MESHES
    ]


def outline_table(rows: Sequence[Row]) -> str:
    """Nodes, solves and errors by mesh."""
    heads = [
        *("outline", "fibres", "mesh", "nodes", "solves", "punch force (N)"),
        *("on a fine mesh (N)", "largest shear angle", "on a fine mesh"),
    ]
    lines = []
    for row in (row for row in rows if row["kind"] == OUTLINE):
        other = row["mesh"] == _AROUND
        lines.append(
            [
                row["name"],
                str(row["case"]).split(", fibres ")[1].split(",")[0],
                row["mesh"],
                f"{row['nodes']}",
                f"{row['solves']}",
                f"{row['force']:.1f} ± {row['half_width']:.1f}",
                "" if other else f"{row['force_of_fine_mesh']:.1f}",
                f"{row['angle']:.1f}°",
                "" if other else f"{row['angle_of_fine_mesh']:.1f}°",
            ]
        )
    return markdown_table(heads, lines) if lines else ""
