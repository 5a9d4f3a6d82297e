"""Tension on the free edges of a draped ply, along the fibres that end there.

The tractions have the directions of a kinematic net, which requires no solution for the
ply.  They equal the forces in a larger ply that continues in the net: T e + M_s p for
each family, with e along its fibres and p = λ ∂Γ/∂a normal to them, times the cosine of
the angle between the fibres and the normal of the edge at rest.

They follow the nets of the growing surface.  The surface at the load factor t is the
tool enlarged by 1/t about the point X₀ where it touches the ply, and so is its net. The
net of the tool at X₀ + t(X − X₀) has the directions at X: one net suffices.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy import ndarray
from skfem import CellBasis, FacetBasis, LinearForm, Mesh, asm
from skfem.helpers import dot

from ..drape import Net
from ..fabric.law import Law
from ..ply.parameters import Values
from ..ply.terms import Term
from ..solve.surface import OnSurface
from .on_tool import CELLS, net_over

# Number of cells of the net beyond the ply.
_BEYOND = 2

# Load factors for which the net covers the points of the edges, in steps of at most 1.5
# cells apart, and at which the shear law is checked before draping.
_LOAD_FACTORS = np.linspace(0.0, 1.0, CELLS + 1)

# Shear angle of a net in radians below which it is round-off.
_ROUNDING = 1e-9


def edge_net(
    mesh: Mesh,
    on_tool: OnSurface,
    angles: tuple[float, float],
    held: tuple[str, ...] = (),
) -> Net:
    """Net of the tool over a ply and beyond it, for all load factors.

    Parameters
    ----------
    mesh
        Mesh of the ply.
    on_tool, angles, held
        See `EdgeTension`.

    Raises
    ------
    ValueError
        If the net folds or leaves the surface.
    """
    start, end = mesh.p[:, mesh.facets[:, _free_edges(mesh, held)]].swapaxes(0, 1)
    most = np.hypot(*(end - start)).max() / np.ptp(mesh.p, axis=1).max()
    shares = np.linspace(0.0, 1.0, 1 + int(np.ceil(CELLS * most)))[:, None, None]
    X = np.hstack([*(start + shares * (end - start))])
    touch = np.array(on_tool.touch)[:, None]
    path = np.hstack([touch + t * (X - touch) for t in _LOAD_FACTORS])
    return net_over(path, on_tool, 1.0, angles, _BEYOND)


def _free_edges(mesh: Mesh, held: tuple[str, ...]) -> ndarray:
    """Numbers of the edges of a ply on none of the held boundaries."""
    fixed = [mesh.boundaries[name] for name in held]
    free = np.setdiff1d(mesh.boundary_facets(), np.concatenate([[], *fixed]))
    return free.astype(int)


@dataclass(frozen=True, eq=False)
class EdgeTension:
    """Tension on the edges of a ply, acting from the start.

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
        be a refinement; by default it is laid for each ply.
    """

    on_tool: OnSurface
    tension: float
    angles: tuple[float, float]
    shear_law: Law | None
    held: tuple[str, ...]
    net: Callable[[], Net] | None = None

    def on(self, basis: CellBasis) -> "_Tractions":
        """Term on a basis of the displacement.

        Raises
        ------
        ValueError
            If the net folds or leaves the surface, or shears beyond the domain of the
            law.
        """
        mesh = basis.mesh
        free = _free_edges(mesh, self.held)
        edges = FacetBasis(
            *(mesh, basis.elem, basis.mapping), facets=free, dofs=basis.dofs
        )
        X = np.asarray(edges.global_coordinates()).reshape(2, -1)
        try:
            if self.net is None:
                net = edge_net(mesh, self.on_tool, self.angles, self.held)
            else:
                net = self.net()
            path = [self._in_net(X, t) for t in _LOAD_FACTORS]
            directions = net.tangents(np.hstack(path))
        except ValueError as error:
            raise ValueError(
                f"edge tension: {error}; or omit the tension and give the fibres a "
                "bending stiffness"
            ) from None
        self._moment(*_cosine_and_sine(directions))
        return _Tractions(self, edges, net)

    def traction(self, X: ndarray, N: ndarray, net: Net, t: float) -> ndarray:
        """Force per reference length at points, shape (3, n_edges, n_points).

        Parameters
        ----------
        X, N
            Points of the edges in mm and normals there, shape (2, n_edges, n_points).
        net
            Net of the tool.
        t
            The load factor.
        """
        e = net.tangents(self._in_net(X.reshape(2, -1), t))
        c, s = _cosine_and_sine(e)
        moment = self._moment(c, s)
        force = np.zeros_like(e[0])
        for a, other, angle in zip(e, e[::-1], self.angles, strict=True):
            across = np.cos(angle) * N[0].ravel() + np.sin(angle) * N[1].ravel()
            force += across * (t * self.tension * a + moment * (other - c * a) / s)
        return force.reshape(3, *X.shape[1:])

    def _in_net(self, X: ndarray, t: float) -> ndarray:
        """The points X₀ + t(X − X₀) of the net of the tool, shape (2, n)."""
        touch = np.array(self.on_tool.touch)[:, None]
        return touch + t * (X - touch)

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
    """Forces of the tractions at a load factor, cached for the last one."""

    name, role = "edge tension", "load"

    def __init__(self, tension: EdgeTension, edges: FacetBasis, net: Net) -> None:
        X = np.asarray(edges.global_coordinates())
        N = np.asarray(edges.normals)

        @lru_cache(maxsize=1)
        def at(t: float) -> ndarray:
            return asm(_WORK, edges, force=tension.traction(X, N, net, t))

        self._at = at

    def energy(self, u: ndarray, t: float, p: Values) -> float:
        """−F(t)·u."""
        return -float(self._at(t) @ u)

    def residual(self, u: ndarray, t: float, p: Values) -> ndarray:
        """−F(t)."""
        return -self._at(t)

    def tangent(self, u: ndarray, t: float, p: Values) -> None:
        """None."""


def _cosine_and_sine(e: ndarray) -> tuple[ndarray, ndarray]:
    """Cosine and sine of the angles between warp and weft directions, shape (n,)."""
    c = (e[0] * e[1]).sum(axis=0)
    return c, np.linalg.norm(np.cross(e[0], e[1], axis=0), axis=0)


@LinearForm
def _WORK(v, w):
    return dot(w["force"], v)
