"""Tension on the free edges of a draped ply, along the fibres that end there.

The tractions have the directions of a kinematic net, which requires no solution for the
ply.  They equal the forces in a larger ply that continues in the net: T e + M_s p for
each family, with e along its fibres and p = λ ∂Γ/∂a normal to them, times the cosine of
the angle between the fibres and the normal of the edge at rest.

These tractions are in equilibrium only if the net is.  Else they displace a whole ply
along the tool, and the nodes that prevent this have a reaction.  The smallest traction
without reactions, on average square over the edges, is added: a sum of the motions of
the edges that belong to displacements of these nodes (`_Tractions.balanced`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_matrix
from skfem import BilinearForm, CellBasis, FacetBasis, LinearForm, Mesh, asm
from skfem.helpers import dot

from ..fabric.law import Law
from ..nets.crossings import Net, NetError
from ..nets.kinematic_net import net
from ..ply.parameters import TermParameters, Values
from ..ply.terms import Term
from ..solve.on_surface import OnSurface
from .rectangle import free_edges

#: Number of cells of a net along the longer side of the ply.  Chosen: the error of the
#: thread directions at the edges is 1e-4.
CELLS = 64

# Number of cells of the net beyond the ply, from which directions at its edges follow.
_BEYOND = 2

#: Number of cells beyond the ply that contain every point between two of its edge.
AROUND = 1

# Shear angle of a net in radians below which it is round-off.
_ROUNDING = 1e-9


def net_over(
    points: ndarray,
    on_tool: OnSurface,
    angles: tuple[float, float],
    beyond: int = 0,
) -> Net:
    """Net that covers the points of a ply.

    Parameters
    ----------
    points
        Points of the flat ply in mm, shape (2, n).
    on_tool
        The surface.
    angles
        Inclination of warp and weft at rest in radians.
    beyond
        Number of cells beyond the points.

    Raises
    ------
    ValueError
        See `net`.
    """
    cell = float(np.ptp(points, axis=1).max()) / CELLS
    flat, touch = np.array([np.cos(angles), np.sin(angles)]), on_tool.touch
    ends = np.linalg.solve(flat, points - np.array(touch)[:, None]) / cell
    further = [[[i], [j]] for i in (-beyond, beyond) for j in (-beyond, beyond)]
    over = np.hstack([ends + np.array(step) for step in further])
    reach = np.array([np.maximum(-over.min(axis=1), 0), over.max(axis=1)])
    warp, weft = np.ceil(reach).astype(int).T.tolist()
    return net(
        *(on_tool.surface, cell, tuple(warp), tuple(weft)),
        angles=angles,
        touch=touch,
        over=cell * flat @ over + np.array(touch)[:, None],
        past_edges=True,
    )


def edge_net(
    mesh: Mesh,
    on_tool: OnSurface,
    angles: tuple[float, float],
    held: tuple[str, ...] = (),
    beyond: int = _BEYOND,
) -> Net:
    """Net of the tool over a ply and beyond it.

    Parameters
    ----------
    mesh
        Mesh of the ply.
    on_tool, angles, held
        See `EdgeTension`.
    beyond
        Number of cells beyond the ply.

    Raises
    ------
    ValueError
        If the net folds or leaves the surface.
    """
    start, end = mesh.p[:, mesh.facets[:, free_edges(mesh, held)]].swapaxes(0, 1)
    most = np.hypot(*(end - start)).max() / np.ptp(mesh.p, axis=1).max()
    shares = np.linspace(0.0, 1.0, 1 + int(np.ceil(CELLS * most)))[:, None, None]
    X = np.hstack([*(start + shares * (end - start))])
    return net_over(np.hstack([mesh.p, X]), on_tool, angles, beyond)


@dataclass(frozen=True, eq=False)
class EdgeTension:
    """Tension on the edges of a ply on its tool, in proportion to the load factor.

    Parameters
    ----------
    on_tool
        Surface on which the ply lies.
    tension
        T in N/mm.
    angles
        Inclination of warp and weft at rest in radians.
    shear_law
        Law of M_s; None for tractions without shear moments.
    held
        Names of boundaries without tension.
    net
        Function that returns the `edge_net` of a ply of which the ply of the term may
        be a refinement.
    """

    on_tool: OnSurface
    tension: float
    angles: tuple[float, float]
    shear_law: Law | None
    held: tuple[str, ...]
    net: Callable[[], Net]

    def on(self, basis: CellBasis) -> "_Tractions":
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If the net folds or leaves the surface, or shears beyond the domain of the
            law.
        """
        mesh = basis.mesh
        free = free_edges(mesh, self.held)
        edges = FacetBasis(
            *(mesh, basis.elem, basis.mapping), facets=free, dofs=basis.dofs
        )
        X = np.asarray(edges.global_coordinates()).reshape(2, -1)
        try:
            directions = self.net().tangents(X)
        except NetError as error:
            raise ValueError(self._not_covered(error.position)) from None
        traction = self._traction(np.asarray(edges.normals), directions)
        return _Tractions(edges, traction, not self.held)

    def _not_covered(self, position: ndarray) -> str:
        return (
            "edge tension: the kinematic net folds or leaves the tool at "
            f"{self.on_tool.place(position)}, and does not reach all edges of the ply: "
            "use a smaller ply, or omit the tension and give the fibres a bending "
            "stiffness"
        )

    def _traction(self, N: ndarray, e: ndarray) -> ndarray:
        """Force per reference length at points, shape (3, n_edges, n_points).

        Parameters
        ----------
        N
            Normals of the edges at points, shape (2, n_edges, n_points).
        e
            Directions of warp and weft in space there, shape (2, 3, n).
        """
        c = (e[0] * e[1]).sum(axis=0)
        s = np.linalg.norm(np.cross(e[0], e[1], axis=0), axis=0)
        moment = self._moment(c, s)
        force = np.zeros_like(e[0])
        for a, other, angle in zip(e, e[::-1], self.angles, strict=True):
            across = np.cos(angle) * N[0].ravel() + np.sin(angle) * N[1].ravel()
            force += across * (self.tension * a + moment * (other - c * a) / s)
        return force.reshape(3, *N.shape[1:])

    def _moment(self, c: ndarray, s: ndarray) -> ndarray:
        """M_s for fibres at an angle of given cosine and sine."""
        if self.shear_law is None:
            return np.zeros_like(c)
        gamma = self.angles[1] - self.angles[0] - np.arctan2(s, c)
        gamma = np.where(np.abs(gamma) < _ROUNDING, 0.0, gamma)
        moment = np.asarray(self.shear_law.value(gamma))
        if not np.isfinite(moment).all():
            raise ValueError(
                "edge tension: the kinematic net shears by "
                f"{np.degrees(np.abs(gamma).max()):.3g} degrees, beyond the domain of "
                "the shear law: omit the tension and give the fibres a bending "
                "stiffness"
            )
        return moment


class _Tractions(Term):
    """Forces of the tractions, and of the correction that balances them.

    The correction is a parameter, the nodal forces ``balance`` in N.  It is zero in
    planes of symmetry, whose reactions are forces of the other half.
    """

    name, role = "edge tension", "load"

    def __init__(self, edges: FacetBasis, traction: ndarray, balances: bool) -> None:
        self._edges, self.balances = edges, balances
        self._force = asm(_WORK, edges, force=traction)
        self.parameters = _Balance(edges.N)

    def balanced(self, p: Values, motions: ndarray, work: ndarray) -> Values:
        """See `Term`; the correction with the smallest root mean square over the edges.

        It is independent of the previous one.
        """
        along_edges, work = self._mass @ motions.T, work + motions @ p["balance"]
        share = np.linalg.solve(motions @ along_edges, work)
        return Values({"balance": along_edges @ share})

    @cached_property
    def _mass(self) -> csr_matrix:
        """Matrix of the scalar product of displacements over the edges."""
        return asm(_PRODUCT, self._edges).tocsr()

    def energy(self, u: ndarray, t: float, p: Values) -> float:
        """−F·u."""
        return float(self.residual(u, t, p) @ u)

    def residual(self, u: ndarray, t: float, p: Values) -> ndarray:
        """−F."""
        return -(t * self._force + p["balance"])

    def tangent(self, u: ndarray, t: float, p: Values) -> None:
        """None."""


class _Balance(TermParameters):
    """Correction of the tractions, zero until it is computed."""

    def __init__(self, n_unknowns: int) -> None:
        self._n_unknowns = n_unknowns

    def at_rest(self) -> Values:
        """No correction."""
        return Values({"balance": np.zeros(self._n_unknowns)})


@LinearForm
def _WORK(v, w):
    return dot(w["force"], v)


@BilinearForm
def _PRODUCT(u, v, w):
    return dot(u, v)
