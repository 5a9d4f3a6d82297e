"""Boundary edges at which fibres end, and how they are held there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import Mesh

# Fibres at a smaller angle (radians) to a boundary do not end there.  A larger angle
# forgets the slope of fibres across it, a smaller one takes round-off for an angle.
_ALONG = 1e-6


@dataclass(frozen=True, eq=False)
class EndEdges:
    """Boundary edges that fibres meet.

    Attributes
    ----------
    facets
        Their numbers, shape (n,).
    A
        Unit direction of the fibres at each, shape (2, n).
    N
        Unit normal out of the ply, shape (2, n).
    """

    facets: ndarray
    A: ndarray
    N: ndarray

    @property
    def across(self) -> ndarray:
        """A·N, shape (n,)."""
        return (self.A * self.N).sum(axis=0)


@dataclass(frozen=True, eq=False)
class Clamps:
    """Boundary edges at which fibres keep their direction, or turn as they are told.

    Attributes
    ----------
    edges
        The edges.
    turned
        What prescribes A·∇u (A·N) there, shape (n, 2 m): of each of m clamps that
        turn by R the columns of R − I that belong to x and y at rest, as unknowns.
    """

    edges: EndEdges
    turned: csr_matrix


def clamps(edges: EndEdges, turning: Sequence[ndarray]) -> Clamps:
    """Clamped edges, and which of them turn.

    Parameters
    ----------
    edges
        The edges.
    turning
        Numbers of the edges of each clamp that turns.
    """
    columns = [
        np.isin(edges.facets, facets) * (edges.A * edges.across) for facets in turning
    ]
    shape = edges.facets.size, 2 * len(turning)
    return Clamps(edges, csr_matrix(np.reshape(columns, shape[::-1]).T))


def boundary_edges(mesh: Mesh, A: ndarray, facets: ndarray) -> EndEdges:
    """Some boundary edges, with the directions of fibres there.

    Parameters
    ----------
    mesh
        The mesh.
    A
        Unit direction of the fibres in each element, shape (2, n_elements).
    facets
        Numbers of boundary edges.
    """
    ends = mesh.p[:, mesh.facets[:, facets]]
    along = ends[:, 1] - ends[:, 0]
    N = np.array([along[1], -along[0]]) / np.hypot(*along)
    elements = mesh.f2t[0, facets]
    out = ends.mean(axis=1) - mesh.p[:, mesh.t[:, elements]].mean(axis=1)
    N = N * np.sign((N * out).sum(axis=0))
    return EndEdges(facets, A[:, elements], N)


def end_edges(mesh: Mesh, A: ndarray, facets: ndarray) -> EndEdges:
    """Those of `boundary_edges` that fibres do not follow; the same parameters."""
    edges = boundary_edges(mesh, A, facets)
    meets = np.abs(edges.across) > _ALONG
    return EndEdges(facets[meets], edges.A[:, meets], edges.N[:, meets])
