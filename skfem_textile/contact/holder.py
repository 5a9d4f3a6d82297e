"""Pressure of holders, and the contacts of a ply with tools and holders."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis

from ..fabric.kinematics import area_ratio, deformation_gradient
from ..mesh.bases import displacement_gradient
from ..ply import Ply
from ..ply.parameters import NO_VALUES, TermParameters, Values
from ..solve.on_surface import CheckedSurface
from .obstacle import Obstacle, ToolContact, ToolTerm, turned
from .outline import ROUND_OFF, shares_inside

if TYPE_CHECKING:
    from .compaction import RigidHolder

#: Thicknesses at which laws of compaction are validated and compared, relative to the
#: one without pressure: plies are compacted to about half of it.
COMPARED = np.linspace(0.4, 1.0, 13)


class _Pressed(TermParameters):
    """Areas and pressures of the nodes under a holder.

    ``areas`` are undeformed areas over ‖∇φ‖, 0 at nodes out of reach of the surface. An
    element contributes the integrals of its shape functions, times the share of its
    undeformed area that is within the outline at its present position.

    With a force ``pressures`` are those on the undeformed areas in N/mm², and
    ``distance`` is H in mm, see `Holder`.
    """

    def __init__(
        self, term: "HolderPressure", obstacle: Obstacle, basis: CellBasis
    ) -> None:
        self._term, self._points = term, term._points
        self._outline = obstacle.outline
        self._obstacle = replace(obstacle, outline=None)
        self._mesh, self._nodes = basis.mesh, basis.element_dofs[::3] // 3
        every = (np.asarray(basis.basis[i][0])[0] for i in range(0, basis.Nbfun, 3))
        self._basis, self._shapes = basis, np.array([*every])
        self._integrals = (self._shapes * basis.dx).sum(axis=-1)

    def at_rest(self) -> Values:
        """Values before the run."""
        values = self._term.values_at_rest({})
        return self.updated(values, np.zeros(self._obstacle.X.size), 0.0)

    def updated(
        self, values: Values, u: ndarray, t: float, tension: ndarray | None = None
    ) -> Values:
        """Values at a displacement."""
        term, (areas, slopes) = self._term, self._areas(u, t)
        after: dict[str, Any] = {**values, "areas": areas * (1 / slopes)}
        if term.rigid:
            weight = self.weight(u)
            pressures, distance = term.rigid.pressed(t, areas / weight, weight)
            after |= {"pressures": pressures / weight, "distance": np.array(distance)}
        values = Values(after)
        if term.friction:
            normals = self._obstacle.gaps(self._points.in_planes(u), t).normal
            state = u, t, normals, term.forces(u, t, values)
            values = term.friction.updated(values, *state)
        return values

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """See `Friction.advanced`."""
        friction = self._term.friction
        return friction.advanced(values, u, t) if friction else values

    def _areas(self, u: ndarray, t: float) -> tuple[ndarray, ndarray]:
        """Undeformed area of each node under the holder, and ‖∇φ‖ there."""
        obstacle, areas = self._obstacle, self._integrals
        x = obstacle.X + u.reshape(-1, 3).T
        if self._outline is not None:
            rotation, translation = obstacle.placement(t)
            local = rotation.T @ (x - translation[:, None])
            corners = local[:2, : self._mesh.nvertices]
            areas = areas * shares_inside(self._outline, self._mesh, corners)
        areas, slopes = self._summed(areas), np.ones(x.shape[1])
        nodes = np.flatnonzero(areas)
        at = obstacle.gaps(self._points.positions(u)[:, nodes], t)
        areas[nodes] *= np.isfinite(at.gap)
        slopes[nodes] = at.slope
        return areas, slopes

    def weight(self, u: ndarray) -> ndarray:
        """Undeformed over current area at each node: its relative areal weight.

        Infinite at corners of quadratic triangles, whose area vanishes.
        """
        ratios = area_ratio(deformation_gradient(displacement_gradient(self._basis, u)))
        current = (self._shapes * ratios * self._basis.dx).sum(axis=-1)
        flat = self._summed(self._integrals)
        weight, counts = np.full_like(flat, np.inf), flat > ROUND_OFF * flat.max()
        weight[counts] = flat[counts] / self._summed(current)[counts]
        return weight

    def _summed(self, of_elements: ndarray) -> ndarray:
        """Sums over the elements of each node."""
        n_nodes = self._obstacle.X.shape[1]
        return np.bincount(self._nodes.ravel(), of_elements.ravel(), n_nodes)


class HolderPressure(ToolTerm):
    """Pressure of a holder towards a surface; see `Holder`.

    The energy is Σ p A φ/‖∇φ‖ over the contact points of the nodes, with the areas A of
    the nodes under the holder.

    Parameters
    ----------
    name, obstacle, basis
        See `ToolTerm`.
    pressure
        The pressure as a function of the load factor; or a `RigidHolder` with a force.

    Attributes
    ----------
    rigid
        The latter, or None.
    """

    def __init__(
        self,
        name: str,
        pressure: "Callable[[float], float] | RigidHolder",
        obstacle: Obstacle,
        basis: CellBasis,
    ) -> None:
        super().__init__(name, obstacle, basis)
        self._pressure: Any = pressure
        self._basis = basis
        self.rigid: Any = None if callable(pressure) else pressure
        self._surface = CheckedSurface(obstacle.what, obstacle.surface)
        self.parameters = self._pressed_areas = _Pressed(self, obstacle, basis)

    def amounts_at(self, t: float) -> dict[str, ndarray]:
        """See `ToolTerm.amounts_at`; also pressure, or force and law of compaction."""
        values = super().amounts_at(t)
        if not self.rigid:
            return values | {"pressure": np.asarray(self._pressure(t))}
        law = self.rigid.law
        thickness = law.free * COMPARED
        curve = np.array([thickness, law.pressure_at(thickness)])
        return values | {
            "force": np.asarray(self.rigid.force(t)),
            "law of compaction": curve,
        }

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """Pressure times the volume between the ply and the surface."""
        _, factors, _, local = self._nodes_under(u, t, p)
        of_friction = self.friction.energy(u, t, p) if self.friction else 0.0
        return float(factors @ self._surface.level(local)) + of_friction

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Forces towards the surface."""
        f = self._on_points(u, t, p)
        if self.friction:
            f = f + self.friction.forces(u, t, p)
        return self._points.nodal(f)

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Their derivative, see `Pattern.sum`."""
        nodes, factors, rotation, local = self._nodes_under(u, t, p)
        K = np.zeros((3, 3, self.nodes.shape[1]))
        H = factors * self._surface.hessian(local)
        K[..., nodes] = turned(rotation, H)
        if self.friction:
            K += self._points.along_planes(self.friction.stiffness(u, t, p))
        return self._points.matrices(K)

    def forces(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Forces of the contact points towards the surface in N, shape (n_nodes,)."""
        return np.asarray(np.linalg.norm(self._on_points(u, t, p), axis=1))

    def contradictions(self, states: Sequence[Any]) -> list[str]:
        """Also a law of compaction that is extrapolated, and pressure over an opening.

        A node that is beyond the surface by more than the size of an element is over an
        opening: it has passed through the surface.
        """
        lines, what = super().contradictions(states), self._obstacle.what
        thinnest = getattr(self.rigid and self.rigid.law, "thinnest", 0.0)
        least = min(map(self._thinnest, states)) if thinnest else np.inf
        if least < (1 - ROUND_OFF) * thinnest:
            lines.append(
                f"force of {what} compresses the ply to {least:.4g} mm: its law of "
                f"compaction ends at {thinnest:g} mm and is extrapolated"
            )
        last = states[-1]
        *_, local = self._nodes_under(
            last.u, last.load_factor, last.parameters[self.name]
        )
        level, gradient = self._surface.level(local), self._surface.gradient(local)
        heights = self._obstacle.side * level / np.linalg.norm(gradient, axis=0)
        if (beyond := -float(heights.min(initial=0.0))) > self._basis.mesh.param():
            lines.append(
                f"{what} also presses on a part of the ply that is beyond its surface, "
                f"by up to {beyond:.3g} mm: it is over an opening, and needs an outline"
            )
        return lines

    def _thinnest(self, state: Any) -> float:
        """Smallest thickness of the ply under a holder with a force, in mm."""
        p = state.parameters[self.name]
        weight = self._pressed_areas.weight(state.u)[p["pressures"] > 0]
        return float((p["distance"] / weight).min(initial=np.inf))

    def reaches(self, u: ndarray, t: float) -> bool:
        """True if it presses on a part of the ply, whatever its pressure."""
        return bool(self._pressed_areas.updated(NO_VALUES, u, t)["areas"].any())

    def _on_points(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Derivative of the energy by the contact points, shape (n_nodes, 3)."""
        nodes, factors, rotation, local = self._nodes_under(u, t, p)
        f = np.zeros((self.nodes.shape[1], 3))
        f[nodes] = (factors * (rotation @ self._surface.gradient(local))).T
        return f

    def _nodes_under(
        self, u: ndarray, t: float, p: Values
    ) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """Nodes under the holder, factors of φ, rotation, and nodes in its axes."""
        obstacle, nodes = self._obstacle, np.flatnonzero(p["areas"])
        pressure: Any = p["pressures"][nodes] if self.rigid else self._pressure(t)
        factors = obstacle.side * pressure * p["areas"][nodes]
        rotation, translation = obstacle.placement(t)
        x = self._points.positions(u)[:, nodes]
        return nodes, factors, rotation, rotation.T @ (x - translation[:, None])


def contacts(ply: Ply) -> list[ToolContact]:
    """Contacts of a ply with tools, and with holders that keep a gap."""
    return [term for term in ply.terms if isinstance(term, ToolContact)]


def pressing(ply: Ply) -> list[ToolTerm]:
    """Contacts of a ply, and holders with a prescribed pressure."""
    return [term for term in ply.terms if isinstance(term, ToolTerm)]


def flat_thickness(ply: Ply) -> float:
    """Thickness of the flat ply in mm: the largest stated by a tool, or 0."""
    return max((tool.thickness for tool in contacts(ply)), default=0.0)
