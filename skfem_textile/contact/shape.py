"""Shape of a formed ply: draw-in, areal weight, thickness and curvature of fibres."""

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from ..fabric import kinematics as kin
from ..ply import Ply
from .outline import ROUND_OFF


class DrawIn(NamedTuple):
    """Draw-in along the outline of a ply and along its holes.

    Attributes
    ----------
    nodes
        Numbers of the nodes on the outline, shape (n,).
    inwards
        Their displacement in the x-y plane towards the interior in mm, shape (n,).
    edges
        Ends of the edges of the outline as indices into ``nodes``, shape (2, n_edges).
    x
        Positions of the nodes in the flat ply in mm, shape (2, n).
    """

    nodes: ndarray
    inwards: ndarray
    edges: ndarray
    x: ndarray

    def at(self, angle: float) -> float | None:
        """Draw-in in mm where a ray from the origin leaves the ply, or None.

        Parameters
        ----------
        angle
            Angle of the ray to the x axis of the flat ply in radians.
        """
        ray = np.array([np.cos(angle), np.sin(angle)])
        ends = self.x[:, self.edges]
        left = ray[0] * ends[1] - ray[1] * ends[0]
        crossed = np.flatnonzero((left[0] * left[1] <= 0) & (left[0] != left[1]))
        a, b = left[:, crossed]
        share = a / (a - b)
        begin, end = np.einsum("i,ijn->jn", ray, ends[..., crossed])
        far = begin + share * (end - begin)
        if not (far > ROUND_OFF * np.ptp(self.x)).any():
            return None
        last = int(far.argmax())
        one, other = self.inwards[self.edges[:, crossed[last]]]
        return float(one + share[last] * (other - one))


def draw_in(ply: Ply, u: ndarray) -> DrawIn:
    """Draw-in of a ply: displacement of its outline towards the interior.

    At a node between two edges the direction is the mean of their normals, in the flat
    ply.  Edges that do not move normal to themselves, such as those on planes of
    symmetry, have no part in it.

    Parameters
    ----------
    ply
        The ply.
    u
        Displacement.

    Examples
    --------
    The edges of a square shrink towards the origin by 1 %:

    >>> from skfem import MeshQuad
    >>> from skfem_textile import Fabric, Ply
    >>> from skfem_textile.contact import draw_in
    >>> mesh = MeshQuad().refined(2).translated((-0.5, -0.5)).scaled(100.0)
    >>> ply = Ply(mesh, Fabric())
    >>> round(draw_in(ply, -0.01 * ply.nodes.T.ravel()).at(0.0), 9)
    0.5
    """
    mesh, facets = ply.mesh, ply.mesh.boundary_facets()
    ends = mesh.facets[:, facets]
    along = mesh.p[:, ends[1]] - mesh.p[:, ends[0]]
    normal = np.array([-along[1], along[0]]) / np.linalg.norm(along, axis=0)
    middle = mesh.p[:, mesh.t[:, mesh.f2t[0, facets]]].mean(axis=1)
    normal *= np.sign((normal * (middle - mesh.p[:, ends[0]])).sum(axis=0))
    on_edges = ends
    if ply.nodes.shape[1] > mesh.nvertices:
        on_edges = np.vstack([ends, mesh.nvertices + facets])
    moved = ply.nodal(u)[:2]
    across = np.einsum("ikn,in->kn", moved[:, on_edges], normal)
    size = float(np.ptp(ply.nodes, axis=1).max())
    normal = normal * (np.abs(across).max(axis=0) > ROUND_OFF * size)
    inwards = np.zeros_like(ply.nodes)
    for nodes in on_edges:
        np.add.at(inwards.T, nodes, normal.T)
    nodes, edges = np.unique(on_edges, return_inverse=True)
    length = np.linalg.norm(inwards[:, nodes], axis=0)
    unit = inwards[:, nodes] / np.where(length > 0, length, 1.0)
    drawn = (moved[:, nodes] * unit).sum(axis=0)
    edges = edges.reshape(on_edges.shape)[:2]
    return DrawIn(nodes, drawn, edges, ply.nodes[:, nodes])


def areal_weight(ply: Ply, u: ndarray, flat: float = 1.0) -> ndarray:
    """Areal weight m₀/(λ₁ λ₂ cos Γ) of each element, shape (n_elements,).

    The mean over the element for families at right angles at rest; for other angles the
    mass of the element over its current area.  The thickness at constant fibre volume
    fraction and the fibre volume fraction at constant thickness are proportional to it.

    Parameters
    ----------
    ply
        The ply.
    u
        Displacement.
    flat
        Areal weight m₀ of the flat ply, in the unit of the result; by default the
        result is relative to it.  With the thickness of the flat ply the result is the
        thickness at constant fibre volume fraction; with its fibre volume fraction, the
        fraction at constant thickness, which is impossible where it exceeds 1.
    """
    area = ply.basis.dx
    current = (np.abs(ply.area_ratio(u)) * area).sum(axis=1)
    return np.asarray(flat * area.sum(axis=1) / current)


def fibre_curvature(ply: Ply, u: ndarray) -> ndarray:
    """Normal curvature along warp and weft in 1/mm, shape (2, n_elements).

    The change of the normal of the ply along a fibre, −t·∂n/∂s, at the centre of each
    element.  Normals at nodes are means over the adjacent elements; along the edges of
    the ply, where these are on one side, the curvature is underestimated.

    Parameters
    ----------
    ply
        A ply in space.
    u
        Displacement.
    """
    mesh, centre = ply.mesh, ply.centre
    F = ply.deformation_gradient(u, centre)[..., 0]
    area = ply.basis.dx.sum(axis=1)
    at_nodes = np.zeros((mesh.nvertices, 3))
    for corner in mesh.t:
        np.add.at(at_nodes, corner, (kin.area_vector(F) * area).T)
    at_nodes /= np.linalg.norm(at_nodes, axis=1, keepdims=True)
    if ply.nodes.shape[1] > mesh.nvertices:
        at_nodes = np.vstack([at_nodes, at_nodes[mesh.facets].mean(axis=0)])
    slope = ply.gradient(at_nodes.ravel(), centre)[..., 0]
    curvatures = []
    for A in ply.directions(centre):
        A = np.broadcast_to(A, (2, mesh.nelements, 1))[..., 0]
        a, change = kin.fibre(F, A), kin.fibre(slope, A)
        curvatures.append(-(a * change).sum(axis=0) / (a**2).sum(axis=0))
    return np.array(curvatures)
