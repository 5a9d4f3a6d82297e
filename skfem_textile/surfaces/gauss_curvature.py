"""Gauss curvature of triangulated tools."""

import numpy as np
from numpy import ndarray

from ..mesh.graph import boundary_edges
from .triangle_mesh import TriangleMesh
from .triangles import unit


class GaussCurvature:
    """Gauss curvature of a tool, at the vertices of its triangles."""

    def __init__(self, tool: TriangleMesh) -> None:
        self.points = tool.facets.points
        self.defects = _defects(self.points, tool.facets.triangles())

    def within(self, x: ndarray, radius: float) -> ndarray:
        """Integral of the curvature over balls around points, in radians, (n,)."""
        from scipy.spatial import KDTree

        near = np.flatnonzero(self.defects)
        pairs = KDTree(x.T).query_ball_tree(KDTree(self.points[:, near].T), radius)
        return np.array([self.defects[near[of]].sum() for of in pairs])


def _defects(points: ndarray, triangles: ndarray) -> ndarray:
    """Curvature of vertices: 2π minus their angles in radians, shape (n,)."""
    angles = np.zeros(points.shape[1])
    for k in range(3):
        a, b, c = (points[:, triangles[(k + m) % 3]] for m in range(3))
        cosine = (unit(b - a) * unit(c - a)).sum(axis=0)
        np.add.at(angles, triangles[k], np.arccos(np.clip(cosine, -1.0, 1.0)))
    defect = 2 * np.pi - angles
    defect[np.unique(boundary_edges([triangles]))] = 0.0
    return defect
