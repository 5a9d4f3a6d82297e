"""Tension on the free edges of a draped ply, along the fibres that end there.

Tractions keep the directions of a kinematic net, for which the ply needs no solution.
They are those by which a larger ply would go on in the net: T e + M_s p of each family,
e along its fibres and p = λ ∂Γ/∂a across them, times the cosine between the fibres and
the normal of the edge at rest.  As the surface grows, they follow its nets.
"""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray
from skfem import CellBasis, FacetBasis, LinearForm, asm
from skfem.helpers import dot

from ...fabric.law import Law
from ...ply.term import Term, Values
from ...solve.conditions import OnSurface
from ..common.net_over import net_over

# Load factors at which nets are laid, with tractions linear in between.  Chosen:
# directions at the last are off by 1e-4.
_STATIONS = np.linspace(0.0, 1.0, 5)

# Cells that a net reaches beyond the ply.
_BEYOND = 2

# Shear angle of a net in radians that is rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class EdgeTension:
    """Tension on the edges of a ply, there from the start.

    Parameters
    ----------
    on_tool
        The surface on which the ply lies.
    tension
        T in N/mm.
    angles
        Inclination of warp and weft at rest in radians.
    shear_law
        Law of M_s; None for tractions without shear moments.
    held
        Names of boundaries without tension.
    """

    on_tool: OnSurface
    tension: float
    angles: tuple[float, float]
    shear_law: Law | None
    held: tuple[str, ...]

    def on(self, basis: CellBasis) -> "_Tractions":
        """The term on a basis of the displacement.

        Raises
        ------
        ValueError
            If a net folds or leaves the surface, or shears past what the law knows.
        """
        mesh = basis.mesh
        held = [mesh.boundaries[name] for name in self.held]
        free = np.setdiff1d(mesh.boundary_facets(), np.concatenate([[], *held]))
        edges = FacetBasis(
            *(mesh, basis.elem, basis.mapping), facets=free.astype(int), dofs=basis.dofs
        )
        X = np.asarray(edges.global_coordinates())
        forces = [
            asm(_WORK, edges, force=self._traction(X, np.asarray(edges.normals), t))
            for t in _STATIONS
        ]
        return _Tractions(np.array(forces))

    def _traction(self, X: ndarray, N: ndarray, t: float) -> ndarray:
        """Force per reference length at points, shape (3, n_edges, n_points)."""
        points = X.reshape(2, -1)
        try:
            e = self._directions(points, t)
        except ValueError as error:
            raise ValueError(
                f"edge tension: {error}; or leave the tension out and give the fibres "
                "a bending stiffness"
            ) from None
        c = (e[0] * e[1]).sum(axis=0)
        s = np.linalg.norm(np.cross(e[0], e[1], axis=0), axis=0)
        moment = self._moment(np.arctan2(s, c))
        force = np.zeros((3, points.shape[1]))
        for own, other, angle in zip(e, e[::-1], self.angles, strict=True):
            across = np.cos(angle) * N[0].ravel() + np.sin(angle) * N[1].ravel()
            force += across * (t * self.tension * own + moment * (other - c * own) / s)
        return force.reshape(3, *X.shape[1:])

    def _directions(self, points: ndarray, t: float) -> ndarray:
        """Directions of warp and weft in a net, shape (2, 3, n)."""
        laid = net_over(points, self.on_tool, t, self.angles, _BEYOND)
        return laid.tangents(points)

    def _moment(self, angle: ndarray) -> ndarray:
        """M_s where fibres are at an angle to one another."""
        if self.shear_law is None:
            return np.zeros_like(angle)
        gamma = self.angles[1] - self.angles[0] - angle
        gamma = np.where(np.abs(gamma) < _ROUNDING, 0.0, gamma)
        moment = np.asarray(self.shear_law.value(gamma))
        if not np.isfinite(moment).all():
            raise ValueError(
                f"edge tension: its net shears by {np.degrees(np.abs(gamma).max()):.3g}"
                " degrees, past what the shear law knows: leave the tension out and "
                "give the fibres a bending stiffness"
            )
        return moment


class _Tractions(Term):
    """Forces at the stations, linear in the load factor between them."""

    name, role = "edge tension", "load"

    def __init__(self, forces: ndarray) -> None:
        self._forces = forces

    def energy(self, u: ndarray, t: float, p: Values) -> float:
        """−F(t)·u."""
        return -float(self._at(t) @ u)

    def residual(self, u: ndarray, t: float, p: Values) -> ndarray:
        """−F(t)."""
        return -self._at(t)

    def tangent(self, u: ndarray, t: float, p: Values) -> None:
        """None."""

    def _at(self, t: float) -> ndarray:
        step = _STATIONS[1]
        hats = np.maximum(0.0, 1.0 - np.abs(t - _STATIONS) / step)
        return np.asarray(hats @ self._forces)


@LinearForm
def _WORK(v, w):
    return dot(w["force"], v)
