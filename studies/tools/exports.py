"""Exports of tools with scatter, patches, flipped faces, shells, holes and copies."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.spatial import KDTree

from skfem_textile import drape
from skfem_textile.drape import NetError
from skfem_textile.io import read_surface
from skfem_textile.mesh.checks import MeshError
from skfem_textile.mesh.graph import boundary_edges
from skfem_textile.surfaces.surface import onto
from tests.helpers import tool_shapes

from ..common.running import errors_only
from ..common.tables import Row

#: Seed of the first export, and number of exports of each shape.
SEED, EACH = 5000, 16

# Cells of a net to each side of its first point.
_CELLS = 12


class Shape(NamedTuple):
    """A tool, a point near it at which a net starts, and half of its width in mm."""

    build: Callable[[], tuple[ndarray, ndarray]]
    point: tuple[float, float, float]
    reach: float


SHAPES = {
    "plate": Shape(tool_shapes.plate, (0, 0, 0), 50),
    "hemisphere with flange": Shape(tool_shapes.hemisphere_with_flange, (0, 0, 50), 45),
    "hat": Shape(lambda: tool_shapes.hat(bow=400.0), (0, 0, 40), 60),
    "saddle": Shape(tool_shapes.saddle, (0, 0, 0), 70),
    "bonnet": Shape(lambda: tool_shapes.bonnet(askew=True), (0, 0, 69), 110),
    "deep box": Shape(
        lambda: tool_shapes.deep_box(100.0, 60.0, 30.0, flange=20.0, size=2.5),
        (0, 0, 30),
        25,
    ),
    "cylinder": Shape(tool_shapes.cylinder, (0, 0, 0), 70),
    "cone": Shape(tool_shapes.cone, (0, 0, 0), 35),
    "torus part": Shape(tool_shapes.torus_part, (0, 0, 0), 60),
    "double dome": Shape(tool_shapes.double_dome, (0, 0, 31), 70),
    "ring": Shape(tool_shapes.ring, (70, 0, 0), 20),
    "curved ring": Shape(tool_shapes.curved_ring, (70, 0, 97), 20),
}

# Shapes of which the other side of a thick part does not fold.
_THICK = "plate", "saddle", "bonnet", "cylinder"


@dataclass(frozen=True)
class Export:
    """Properties of an export.

    Attributes
    ----------
    shape, seed
        Name of the shape, and seed of the export.
    scatter_mm, scatter
        Largest scatter of a coordinate, in mm and relative to the mean edge.
    of
        Scattered parts: each triangle, each face as a whole, or the vertices.
    faces
        Number of faces that are tessellated separately.
    flipped
        Triangles that are reversed: none, faces, or single ones.
    thickness
        Thickness of a shell relative to the mean edge; 0 for none.
    rim, hole, twice
        True if a shell is closed, a hole is cut, and all triangles are listed twice.
    """

    shape: str
    seed: int
    scatter_mm: float
    scatter: float
    of: str
    faces: int
    flipped: str
    thickness: float
    rim: bool
    hole: bool
    twice: bool

    @classmethod
    def drawn(cls, shape: str, seed: int) -> "Export":
        """Properties drawn by a seed."""
        rng = np.random.default_rng(seed)
        edge = clean(shape)[1]
        limits = 0, 1e-4, 1e-3 * edge, float(10 ** rng.uniform(-3, np.log10(0.5))), 0.5
        scatter = float(rng.choice(limits, p=[0.15, 0.25, 0.25, 0.25, 0.1]))
        thick = shape in _THICK and rng.random() < 0.5
        thickness = 4.0 if thick else float(rng.uniform(0.2, 1.2))
        shell = rng.random() < 0.2
        return cls(
            *(shape, seed, scatter, scatter / edge),
            str(rng.choice(["triangles", "faces", "vertices"], p=[0.45, 0.4, 0.15])),
            int(rng.integers(2, 9)),
            str(rng.choice(["none", "faces", "triangles"], p=[0.5, 0.25, 0.25])),
            thickness if shell else 0.0,
            bool(rng.random() < 0.5) and shell,
            bool(rng.random() < 0.15) and not shell,
            bool(rng.random() < 0.15),
        )

    def name(self) -> str:
        """Shape and seed."""
        return f"{self.shape} {self.seed}"

    def triangles(self) -> tuple[ndarray, bool]:
        """Corners of the triangles, (n, 3, 3), and whether some are flipped."""
        rng = np.random.default_rng([self.seed, 1])
        x, t = SHAPES[self.shape].build()
        edge = clean(self.shape)[1]
        centres = x[:, t].mean(axis=1).T
        if self.hole:
            t = np.delete(t, _around(x, t, self.shape), axis=1)
            centres = x[:, t].mean(axis=1).T
        face = KDTree(centres[rng.choice(len(centres), self.faces)]).query(centres)[1]
        reverse = np.zeros(len(centres), dtype=bool)
        if self.flipped == "triangles":
            reverse = rng.random(len(centres)) < rng.uniform(0.01, 0.35)
        elif self.flipped == "faces":
            sizes = np.bincount(face, minlength=self.faces)
            for one in rng.permutation(self.faces):
                if (reverse.sum() + sizes[one]) < 0.35 * len(face):
                    reverse |= face == one
        x, t, face, reverse = self._with_sides(x, t, face, reverse, edge)
        if self.of == "vertices":
            x = x + self.scatter_mm * rng.uniform(-1, 1, x.shape)
        corners = x[:, t].transpose(2, 1, 0)
        if self.of == "triangles":
            corners = corners + self.scatter_mm * rng.uniform(-1, 1, corners.shape)
        elif self.of == "faces":
            steps = self.scatter_mm * rng.uniform(-1, 1, (2 * self.faces + 1, 3))
            corners = corners + steps[face][:, None]
        corners[reverse] = corners[reverse, ::-1]
        if self.twice:
            corners = np.concatenate([corners, corners])
        return corners, bool(reverse.any())

    def _with_sides(
        self, x: ndarray, t: ndarray, face: ndarray, reverse: ndarray, edge: float
    ) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """Points, triangles, and their faces and sides, of a shell if there is one."""
        if not self.thickness:
            return x, t, face, reverse
        normals = _normals(x, t)
        n, inside = x.shape[1], x - self.thickness * edge * normals
        parts, faces = [t, t[::-1] + n], [face, face + self.faces]
        if self.rim:
            a, b = boundary_edges([t])
            parts.append(np.hstack([[b, a, a + n], [b, a + n, b + n]]))
            faces.append(np.full(2 * len(a), 2 * self.faces))
        face = np.concatenate(faces)
        reverse = np.pad(reverse, (0, len(face) - len(reverse)))
        return np.hstack([x, inside]), np.hstack(parts), face, reverse

    def rows(self) -> list[Row]:
        """Read the export from an STL file, and judge the result."""
        corners, flipped = self.triangles()
        row: Row = {"case": self.name(), **asdict(self)}
        with TemporaryDirectory() as folder:
            file = Path(folder) / "tool.stl"
            file.write_bytes(_stl(corners))
            try:
                with errors_only():
                    tool = read_surface(file)
            except MeshError as error:
                line = str(error).removeprefix(f"{file}: ")
                true = self._is_true(line, flipped)
                outcome = "refused" if true else "wrong line"
                return [{**row, "outcome": outcome, "lines": line}]
        errors = _errors(tool, self.shape, self.rim)
        lines = " | ".join(tool.remarks)
        false = [one for one in tool.remarks if not self._is_true(one, flipped)]
        if false:
            return [{**row, **errors, "outcome": "wrong line", "lines": false[0]}]
        outcome = "right"
        limits = {**TOLERANCE}
        limits["level_error"] += float(np.sqrt(3)) * self.scatter
        if not all(errors[key] <= limit for key, limit in limits.items()):
            outcome = "warned" if "errors of shear angles" in lines else "silent"
        return [{**row, **errors, "outcome": outcome, "lines": lines}]

    def _is_true(self, line: str, flipped: bool) -> bool:
        """Return True if a line is right for this export."""
        of_single = "ring" in self.shape
        return {
            "sewn": self.scatter_mm > 0 and self.of != "vertices",
            "duplicate": self.twice,
            "turned": flipped,
            "hole(s)": self.hole or of_single,
            "separate parts": (self.thickness > 0 and not self.rim)
            or (self.of == "faces" and self.scatter > 0.1),
            "is closed": self.rim,
            "opposite sides": 0 < self.thickness < 2,
            "do not meet": self.scatter > 0.05 and self.of != "vertices",
            "scatter by": self.scatter > 0.01,
            "away from the smooth": self.scatter > 0.05 or self.rim,
            "more than two triangles": self.scatter > 0.05,
        }.get(next((word for word in _WORDS if word in line), ""), False)


# Words of the lines, the more specific first.
_WORDS = (
    *("do not meet", "opposite sides", "scatter by", "away from the smooth"),
    *("more than two triangles", "duplicate", "turned", "separate parts"),
    *("is closed", "hole(s)", "sewn"),
)

#: Tolerances against the clean tool: level at points within a fifth of an edge from it,
#: relative to the mean edge, in addition to the scatter of the export; angle of the
#: normal there, and largest error of the shear angle of a net, in degrees.
TOLERANCE = {"level_error": 0.02, "normal_error_deg": 2.0, "shear_error_deg": 1.0}


@cache
def clean(shape: str) -> tuple[drape.TriangleMesh, float, ndarray, ndarray]:
    """Clean tool, its mean edge in mm, points near it, and the shear of a net there."""
    x, t = SHAPES[shape].build()
    edge = float(np.linalg.norm(x[:, t[0]] - x[:, t[1]], axis=0).mean())
    tool = drape.TriangleMesh(x, t)
    rng = np.random.default_rng(0)
    some = rng.choice(t.shape[1], 400)
    shares = rng.dirichlet(np.ones(3), 400).T
    points = (x[:, t[:, some]] * shares).sum(axis=1)
    points += rng.uniform(-0.2, 0.2, 400) * edge * tool.gradient(points)
    away = np.ones(400, dtype=bool)
    away[
        KDTree(x[:, t[:, _around(x, t, shape)]].mean(axis=1).T).query(points.T)[0]
        < 2 * edge
    ] = False
    return tool, edge, points[:, away], _net(tool, shape)


def _errors(tool: drape.TriangleMesh, shape: str, rim: bool) -> dict[str, float]:
    expected, edge, points, shear = clean(shape)
    if rim:  # its sharp edge is rounded
        outline = KDTree(np.hstack(expected.facets.boundary()).T)
        points = points[:, outline.query(points.T)[0] > 3 * edge]
    one, other = tool.gradient(points), expected.gradient(points)
    cosine = (one * other).sum(axis=0)
    cosine /= np.linalg.norm(one, axis=0) * np.linalg.norm(other, axis=0)
    level = np.abs(tool.level(points) - expected.level(points)).max()
    try:
        angles = _net(tool, shape)
        of_net = np.degrees(np.abs(angles - shear).max())
        energy = float((angles**2).sum() / max((shear**2).sum(), 1e-6))
    except NetError:
        of_net, energy = 90.0, 0.0
    return {
        "level_error": float(level / edge),
        "normal_error_deg": float(np.degrees(np.arccos(cosine.clip(-1, 1))).max()),
        "shear_error_deg": float(of_net),
        "energy_ratio": energy,
    }


def _net(tool: drape.TriangleMesh, shape: str) -> ndarray:
    """Shear angles of a net."""
    _, point, reach = SHAPES[shape]
    foot = onto(tool, np.array(point, dtype=float)[:, None])[:, 0]
    surface = tool.moved(*drape.Axes.at(tool, foot))
    cells = _CELLS, _CELLS
    net = drape.net(surface, reach / _CELLS, cells, cells, past_edges=True)
    return net.shear_angle()


def _around(x: ndarray, t: ndarray, shape: str) -> ndarray:
    """Numbers of the triangles of a hole: far from the net and from the edges."""
    edge = np.linalg.norm(x[:, t[0]] - x[:, t[1]], axis=0).mean()
    centres = x[:, t].mean(axis=1).T
    outline = KDTree(x[:, np.unique(boundary_edges([t]))].T).query(centres)[0]
    away = np.linalg.norm(centres - np.array(SHAPES[shape].point), axis=1)
    middle = np.where(outline > 4 * edge, away, 0).argmax()
    return np.flatnonzero(np.linalg.norm(centres - centres[middle], axis=1) < 2 * edge)


def _normals(x: ndarray, t: ndarray) -> ndarray:
    """Unit normals at the vertices, shape (3, n)."""
    a, b, c = x[:, t].swapaxes(0, 1)
    area, normals = np.cross(b - a, c - a, axis=0), np.zeros_like(x)
    for corner in t:
        np.add.at(normals.T, corner, area.T)
    return normals / np.linalg.norm(normals, axis=0)


def _stl(corners: ndarray) -> bytes:
    """Binary STL file of triangles, shape (n, 3, 3)."""
    rows = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("x", "<f4", (3, 3)), ("m", "<u2")]
    )
    rows["x"] = corners
    return b"CAD".ljust(80) + np.uint32(len(corners)).tobytes() + rows.tobytes()
