"""Curved fibres on meshes whose straight edges replace the singular fibres.

The stretch of a fibre at an angle δ to an edge along which the shear angle jumps by Δγ
jumps by about δ Δγ, with opposite signs at both ends of the edge.  The elements beside
the edge cannot follow it, and are too stiff.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from numpy import ndarray
from skfem import MeshTri

from ..fabric import Fabric, unit_vectors
from ..mesh.selection import SINGULAR
from .cells import cross

# Angle in radians between an edge and a fibre at its ends above which the edge does not
# follow the fibre.  Edges of the default size turn by 0.02.
_MOST = 0.25


@dataclass(frozen=True, eq=False)
class _Straightened:
    """Directions in triangles with curved edges, mapped to straight edges.

    ``corners`` belong to the triangles, and ``bows`` the vectors by which the curved
    edges, from each corner to the next, deviate from the straight ones in the middle,
    both of shape (2, 3, n).
    """

    name: str
    direction: Any
    corners: ndarray
    bows: ndarray
    tree: shapely.STRtree

    def __call__(self, x: ndarray) -> ndarray:
        points = x.reshape(2, -1)
        vectors = np.array(np.broadcast_to(self._at(points), points.shape))
        i, of = self.tree.query(shapely.points(points.T), "intersects")
        corners, bows, points = self.corners[..., of], self.bows[..., of], points[:, i]
        e = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
        twice = cross(e[:, 1], e[:, 2])
        at = cross(e, points[:, None] - np.roll(corners, -1, axis=1)) / twice
        slope = np.stack([-e[1], e[0]]) / twice
        after, slope_after = np.roll(at, -1, axis=0), np.roll(slope, -1, axis=1)
        curved = points + (4 * at * after * bows).sum(axis=1)
        F = 4 * np.einsum("ijn,kjn->ikn", bows, after * slope + at * slope_after)
        F[0, 0] += 1
        F[1, 1] += 1
        v = self._at(curved)
        # The inverse of F times v, up to its length.
        vectors[:, i] = np.stack([cross(v, F[:, 1]), -cross(v, F[:, 0])])
        return vectors.reshape(x.shape)

    def _at(self, x: ndarray) -> ndarray:
        return unit_vectors(self.name, self.direction, x)


def along_edges(mesh: MeshTri, fabric: Fabric) -> Fabric:
    """Straighten a fabric so that its singular fibres coincide with mesh edges.

    Triangles with an edge on a singular fibre are mapped from triangles with a curved
    edge, and the fibre directions are mapped with them, so that the edge is a fibre.

    Parameters
    ----------
    mesh
        Triangles, such as of `mesh_outline`, with the edges `SINGULAR`.
    fabric
        The fabric; straight fibres stay.

    Returns
    -------
    Fabric
        For a `Ply` on this mesh.

    Examples
    --------
    Circular arcs about the origin: the edges are chords, and fibres.

    >>> from skfem_textile import Condition, Outline, mesh_outline
    >>> outline = Outline([[50, 90, 90, 50], [0, 0, 70, 90]])
    >>> arcs = Fabric(1e4, 0.5, lambda x: np.stack([-x[1], x[0]]), lambda x: x)
    >>> held = {"held": Condition("bottom"), "corner": Condition(lambda x: x[1] > 89)}
    >>> mesh = mesh_outline(outline, arcs, held)
    >>> edges = mesh.facets[:, mesh.boundaries["singular fibres"]]
    >>> along = mesh.p[:, edges[1]] - mesh.p[:, edges[0]]
    >>> quarter = mesh.p[:, edges[0]] + 0.25 * along
    >>> def follow(fabric):
    ...     d = fabric.directions(quarter[:, :, None])
    ...     sine = [abs(cross(v[:, :, 0], along)) / np.hypot(*along) for v in d]
    ...     return bool(np.median(np.minimum(*sine)) < 1e-4)
    >>> follow(arcs), follow(along_edges(mesh, arcs))
    (False, True)
    """
    curved = [family for family in fabric.families if callable(family.direction)]
    edges = np.asarray((mesh.boundaries or {}).get(SINGULAR, ()), dtype=int)
    if not curved or not edges.size:
        return fabric
    bow = np.zeros((2, mesh.nfacets))
    bow[:, edges] = _bows(mesh.p[:, mesh.facets[:, edges]], fabric)
    # scikit-fem's edges of a triangle join corners 0 and 1, 1 and 2, 0 and 2.
    bows = bow[:, mesh.t2f]
    some = (bows != 0).any(axis=(0, 1))
    corners = mesh.p[:, mesh.t[:, some]]
    tree = shapely.STRtree(shapely.polygons(corners.transpose(2, 1, 0)))
    warp, weft = (
        _Straightened(f.name, f.direction, corners, bows[:, :, some], tree)
        for f in fabric.families
    )
    return replace(fabric, warp=warp, weft=weft)


def _bows(ends: ndarray, fabric: Fabric) -> ndarray:
    """Middles of fibres relative to the middles of their chords, shape (2, n).

    ``ends`` of the chords have shape (2, 2, n).
    """
    chord = ends[:, 1] - ends[:, 0]
    bows, closest = np.zeros_like(chord), np.full(chord.shape[1], _MOST)
    for family in fabric.families:
        v = unit_vectors(family.name, family.direction, ends)
        v = np.broadcast_to(v, ends.shape)
        angle = np.arctan(cross(chord[:, None], v) / (chord[:, None] * v).sum(axis=0))
        most = np.abs(angle).max(axis=0)
        normal = np.stack([-chord[1], chord[0]])
        # A parabola deviates in the middle by an eighth of its turn times the chord.
        bows = np.where(most < closest, (angle[0] - angle[1]) / 8 * normal, bows)
        closest = np.minimum(closest, most)
    return bows
