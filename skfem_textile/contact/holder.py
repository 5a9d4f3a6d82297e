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
from ..ply.parameters import NO_VALUES, Values
from ..solve.on_surface import CheckedSurface
from .obstacle import (
    Gaps,
    Obstacle,
    ToolContact,
    ToolParameters,
    ToolTerm,
    turned,
)
from .outline import ROUND_OFF, shares_inside

if TYPE_CHECKING:
    from .compaction import RigidHolder

#: Thicknesses at which laws of compaction are validated and compared, relative to the
#: one without pressure: plies are compacted to about half of it.
COMPARED = np.linspace(0.4, 1.0, 13)


class _Pressed(ToolParameters):
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
        super().__init__(term)
        self._points, self._rigid = term._points, term.rigid
        self._outline = obstacle.outline
        self._obstacle = replace(obstacle, outline=None)
        self._mesh, self._nodes = basis.mesh, basis.element_dofs[::3] // 3
        every = (np.asarray(basis.basis[i][0])[0] for i in range(0, basis.Nbfun, 3))
        self._basis, self._shapes = basis, np.array([*every])
        self._integrals = (self._shapes * basis.dx).sum(axis=-1)
        layers = getattr(basis, "layers", None)  # the ply that the holder touches
        self._pressed = layers.exposed(obstacle.from_below) if layers else True

    def at_rest(self) -> Values:
        """Values before the run."""
        values = self.with_friction_at_rest({})
        return self.updated(values, np.zeros(self._obstacle.X.size), 0.0)

    def _without_friction(self, values: Values, u: ndarray, t: float) -> Values:
        """Areas, and pressures of a holder with a force."""
        areas, slopes = self._areas(u, t)
        after: dict[str, Any] = {**values, "areas": areas * (1 / slopes)}
        if self._rigid:
            weight = self.weight(u)
            pressures, distance = self._rigid.pressed(t, areas / weight, weight)
            after |= {"pressures": pressures / weight, "distance": np.array(distance)}
        return Values(after)

    def _areas(self, u: ndarray, t: float) -> tuple[ndarray, ndarray]:
        """Undeformed area of each node under the holder, and ‖∇φ‖ there."""
        obstacle, areas = self._obstacle, self._integrals
        x = obstacle.X + u.reshape(-1, 3).T
        if self._outline is not None:
            rotation, translation = obstacle.placement(t)
            local = rotation.T @ (x - translation[:, None])
            corners = local[:2, : self._mesh.nvertices]
            areas = areas * shares_inside(self._outline, self._mesh, corners)
        areas, slopes = self._summed(areas) * self._pressed, np.ones(x.shape[1])
        nodes = np.flatnonzero(areas)
        at = obstacle.gaps(self._points.positions(u)[:, nodes], t)
        areas[nodes] *= np.isfinite(at.gap)
        slopes[nodes] = at.slope
        return areas, slopes

    def gaps(self, u: ndarray, t: float) -> Gaps:
        """Gaps of the contact points, without an outline."""
        return self._obstacle.gaps(self._points.in_planes(u), t)

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
    presses_by
        "force" or "pressure".
    """

    constrains = False

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
        self.presses_by = "force" if self.rigid else "pressure"
        self.idle = f"its {self.presses_by} is 0: increase it, or omit the friction"
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

    def normals(self, u: ndarray, t: float) -> ndarray:
        """See `ToolTerm.normals`; also of nodes outside of the outline."""
        return self._pressed_areas.gaps(u, t).normal

    def potential(self, u: ndarray, t: float, p: Values) -> float:
        """Pressure times the volume between the ply and the surface."""
        _, factors, _, local = self._nodes_under(u, t, p)
        return float(factors @ self._surface.level(local))

    def _blocks(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Pressure times the second derivatives of φ."""
        nodes, factors, rotation, local = self._nodes_under(u, t, p)
        K = np.zeros((3, 3, self.nodes.shape[1]))
        K[..., nodes] = turned(rotation, factors * self._surface.hessian(local))
        return K

    def forces(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Forces of the contact points towards the surface in N, shape (n_nodes,)."""
        return np.asarray(np.linalg.norm(self._on_points(u, t, p), axis=1))

    def contradictions(self, states: Sequence[Any]) -> list[str]:
        """Also a force without a ply, a law that is extrapolated, and an opening.

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
        if first := next(filter(self._misses, states), None):
            force = self.rigid.force(first.load_factor)
            lines.append(
                f"force of {what}, {force:.4g} N, does not act at load factor "
                f"{first.load_factor:.4g}, because no part of the ply is under it: its "
                "outline must cover a part of the ply while it presses"
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

    def _misses(self, state: Any) -> bool:
        """True if it has a force, but no part of the ply is under it."""
        if not self.rigid or state.parameters[self.name]["areas"].any():
            return False
        return bool(self.rigid.force(state.load_factor))

    def _thinnest(self, state: Any) -> float:
        """Smallest thickness of the ply under a holder with a force, in mm."""
        p = state.parameters[self.name]
        weight = self._pressed_areas.weight(state.u)[p["pressures"] > 0]
        return float((p["distance"] / weight).min(initial=np.inf))

    def reaches(self, u: ndarray, t: float) -> bool:
        """True if it presses on a part of the ply, whatever its pressure."""
        return bool(self._pressed_areas.updated(NO_VALUES, u, t)["areas"].any())

    def _on_points(self, u: ndarray, t: float, p: Values) -> ndarray:
        """See `ToolTerm`."""
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
    """Contacts of a ply, and holders with a pressure or a force."""
    return [term for term in ply.terms if isinstance(term, ToolTerm)]


def flat_thickness(ply: Ply) -> float:
    """Thickness of the flat ply in mm: the largest stated by a tool, or 0."""
    return max((tool.thickness for tool in contacts(ply)), default=0.0)
