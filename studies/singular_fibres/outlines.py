"""Meshes of outlines drawn at random, some of them invalid."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy import ndarray
from scipy.spatial import KDTree
from skfem import Mesh

from skfem_textile import Condition, Fabric, Outline, mesh_outline, singular_fibres
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.outlines.meshing import FINEST, SINGULAR, irregular

from ..study import Row

#: Seed and number of the outlines.
SEED, OUTLINES = 4711, 500

# Every so many outlines one has curved fibres, and one is invalid.
_CURVED, _INVALID = 4, 10

# Corners of a circular hole, whose short sides the mesh joins.
_CIRCLE = 40

# Angle in degrees between given edges below which they force small angles beside them.
_SHARP = 15.0

#: Ways in which outlines are invalid.
FAULTS = "self-crossing", "touching holes", "hole outside", "point outside"


@dataclass(frozen=True)
class Drawn:
    """An outline drawn by a seed.

    Attributes
    ----------
    number
        Number of the outline, added to the seed.
    """

    number: int

    def __str__(self) -> str:
        return f"outline {self.number}"

    @property
    def fault(self) -> str:
        """Why it is invalid, one of `FAULTS`; empty if it is valid."""
        invalid, rest = divmod(self.number, _INVALID)
        return FAULTS[invalid % len(FAULTS)] if rest == _INVALID - 1 else ""

    def rows(self) -> list[Row]:
        """Smallest angles of the mesh and of its input, or the error."""
        row: Row = {
            "case": str(self),
            "fault": self.fault,
            "kind": "",
            "triangles": 0,
            "smallest": None,
            "elsewhere": None,
            "input": None,
            "corner": None,
            "circles": None,
            "area_error": None,
            "missing": "",
            "refused": "",
        }
        polygon, holes, n, fields, share = self._drawn()
        try:
            outline = Outline(
                polygon,
                holes,
                {"fixed": [0], "pulled": [n // 2]},
                points={"stitch": (1e3, 0.0)} if self.fault == FAULTS[3] else None,
            )
            held = {
                "fixed": Condition("fixed"),
                "pulled": Condition("pulled", (1.0, 0.0)),
            }
            fabric = Fabric(1e5, 0.5, *fields)
            size = float(np.sqrt(outline.shape().area)) * share
            lines = singular_fibres(outline, fabric, held, finest=FINEST * size)
            straight = not callable(fields[0])
            net = straight and self.number % 2 == 0
            if net:
                mesh = mesh_outline(outline, fabric, held)
            else:
                mesh = irregular(outline, lines, size)
            check_mesh(mesh)
        except ValueError as error:
            return [row | {"refused": str(error)}]
        row["kind"] = "net" if net else "straight" if straight else "curved"
        return [row | _measured(mesh, outline, [f.points for f in lines.fibres], size)]

    def _drawn(self) -> tuple[ndarray, list[ndarray], int, tuple[Any, Any], float]:
        """Corners, holes, number of corners, fields, and size relative to √area."""
        random = np.random.default_rng(SEED + self.number)
        n = int(random.integers(4, 10))
        at = 2 * np.pi * (np.arange(n) + random.uniform(-0.3, 0.3, n)) / n
        radius = 100 * random.uniform(0.6, 1.3, n)
        polygon = radius * np.array([np.cos(at), np.sin(at)])
        shape, holes = shapely.Polygon(polygon.T), []
        for x in random.uniform(-60, 60, (3, 2)):
            r = 0.5 * shape.boundary.distance(shapely.Point(x))
            if shape.contains(shapely.Point(x)) and r > 5:
                k = int(random.choice([3, 4, 12, _CIRCLE]))
                corners = 2 * np.pi * np.arange(k) / k
                ring = r * np.array([np.cos(corners), np.sin(corners)])
                holes.append(x[:, None] + ring)
                shape = shape.difference(shapely.Polygon(holes[-1].T))
        angle, between = random.uniform(0, np.pi), random.uniform(0.6, np.pi - 0.6)
        bend = random.uniform(-0.008, 0.008, 2)
        share = 1 / random.uniform(8, 24)
        if self.fault == FAULTS[0]:
            polygon = np.hstack([polygon, 0.9 * polygon])
        elif self.fault == FAULTS[1]:
            square = np.array([[-9.0, 9.0, 9.0, -9.0], [-9.0, -9.0, 9.0, 9.0]])
            holes = [square, square + np.array([[18.0], [0.0]])]
        elif self.fault == FAULTS[2]:
            square = np.array([[-9.0, 9.0, 9.0, -9.0], [-9.0, -9.0, 9.0, 9.0]])
            holes = [square + 300.0]
        curved = self.number % _CURVED == _CURVED - 1

        def direction(shift: float) -> Any:
            if not curved:
                return float(np.cos(angle + shift)), float(np.sin(angle + shift))

            def along(x: ndarray) -> ndarray:
                a = angle + shift + np.tensordot(bend, x, 1)
                return np.stack([np.cos(a), np.sin(a)])

            return along

        return polygon, holes, n, (direction(0.0), direction(between)), share


def drawn() -> Iterator[Drawn]:
    """All outlines."""
    return map(Drawn, range(OUTLINES))


def _measured(mesh: Mesh, outline: Outline, lines: list[ndarray], size: float) -> Row:
    """Measures of a mesh and of its outline."""
    x = mesh.p[:, mesh.t]
    u, v = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    area = 0.5 * np.abs(u[0, 0] * v[1, 0] - u[1, 0] * v[0, 0])
    angles = np.degrees(np.arctan2(np.abs(u[0] * v[1] - u[1] * v[0]), (u * v).sum(0)))
    exact = outline.shape().area
    missing = [name for name in outline.boundaries if not _covers(mesh, outline, name)]
    return {
        "triangles": mesh.nelements,
        "smallest": float(angles.min()),
        "elsewhere": float(angles[:, ~_beside_sharp(mesh, size)].min(initial=90.0)),
        "input": _smallest_between(outline, lines),
        "corner": _smallest_corner(outline),
        "circles": any(hole.shape[1] == _CIRCLE for hole in outline.holes),
        "area_error": float(area.sum() / exact - 1),
        "missing": ", ".join(missing),
    }


def _covers(mesh: Mesh, outline: Outline, name: str) -> bool:
    """True if the named edges of a mesh have the length of its outline.

    Chords of a circular hole are up to 1 % shorter.
    """
    edges = (mesh.boundaries or {}).get(name)
    if edges is None:
        return False
    start, end = outline.edges()
    on = outline.boundaries[name]
    x = mesh.p[:, mesh.facets[:, edges]]
    length = np.hypot(*(x[:, 1] - x[:, 0])).sum()
    return bool(abs(length / np.hypot(*(end - start)[:, on]).sum() - 1) < 0.01)


def _smallest_corner(outline: Outline) -> float:
    """Smallest angle of the corners of an outline, inside of it, in degrees."""
    angles = []
    for ring in outline.rings:
        u, v = np.roll(ring, -1, axis=1) - ring, np.roll(ring, 1, axis=1) - ring
        inside = np.arctan2(u[0] * v[1] - u[1] * v[0], (u * v).sum(axis=0))
        angles.append(np.degrees(inside % (2 * np.pi)).min())
    return float(min(angles))


def _beside_sharp(mesh: Mesh, size: float) -> ndarray:
    """True for triangles within three sizes of a small angle between given edges."""
    singular = (mesh.boundaries or {}).get(SINGULAR, np.empty(0, dtype=int))
    ends = mesh.facets[:, np.union1d(mesh.boundary_facets(), singular)]
    node, gap, _ = _gaps(ends, mesh.p)
    sharp = mesh.p[:, node[gap < _SHARP]]
    centre = mesh.p[:, mesh.t].mean(axis=1)
    if not sharp.size:
        return np.zeros(mesh.nelements, dtype=bool)
    return np.asarray(KDTree(sharp.T).query(centre.T)[0] < 3 * size)


def _gaps(ends: ndarray, p: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Angles between neighbouring edges at nodes: node, angle and its bisector.

    The angles are in degrees.
    """
    ends = np.hstack([ends, ends[::-1]])
    along = p[:, ends[1]] - p[:, ends[0]]
    angle = np.degrees(np.arctan2(along[1], along[0]))
    order = np.lexsort([angle, ends[0]])
    node, angle = ends[0, order], angle[order]
    first = np.searchsorted(node, node)
    at_last = np.append(node[1:] != node[:-1], True)
    after = np.where(at_last, angle[first] + 360, np.roll(angle, -1))
    return node, after - angle, (angle + after) / 2


def _smallest_between(outline: Outline, lines: list[ndarray]) -> float:
    """Smallest angle in degrees at which lines and edges of an outline meet."""
    near = 1e-7 * outline.size
    parts = [shapely.linestrings(line.T) for line in lines]
    noded = shapely.union_all([outline.shape().boundary, *parts], grid_size=near)
    x, of = shapely.get_coordinates(shapely.get_parts(noded), return_index=True)
    x, number = np.unique(x, axis=0, return_inverse=True)
    same = np.diff(of) == 0
    ends = np.stack([number[:-1][same], number[1:][same]])
    ends = np.unique(np.sort(ends, axis=0), axis=1)
    node, gap, middle = _gaps(ends, x.T)
    middle = np.radians(middle)
    # Angles outside of the outline do not count.
    step = 1e-4 * outline.size * np.stack([np.cos(middle), np.sin(middle)])
    inside = shapely.contains_xy(outline.shape(), *(x[node].T + step))
    return float(gap[inside & (gap > 1e-3)].min(initial=360.0))
