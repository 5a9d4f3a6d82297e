"""Rigid tools that move with the load factor, in contact with a ply.

A tool is an obstacle: a surface φ = 0, moved rigidly, and the side of it on which the
ply lies.  The gap of a point x is g = ±φ/‖∇φ‖ less half the thickness, the distance to
first order.  Contact is enforced at the contact points of the nodes (`contact_points`),
by forces that are multipliers of g ≥ 0, see `ContactTerm`.  Each node counts with the
integral of its shape function: the corners of quadratic triangles, whose integral
vanishes, touch no tool.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from skfem import CellBasis, LinearForm, Mesh, asm

from ..mesh.bases import components, node_positions
from ..mesh.recovery import ContactPoints
from ..mesh.user_input import coords, real_numbers, refuse_in_files
from ..ply.parameters import NO_VALUES, TermParameters, Values
from ..ply.terms import ContactTerm, ElementTerm
from ..solve.on_surface import CheckedSurface, SurfaceError, check_surface
from ..surfaces.surface import Surface, triangle_sums
from .motion import Motion, angle_turned, placement, travelled
from .outline import ROUND_OFF, corners_of, inside

# Extent of a tool relative to the size of the ply above which its unit is wrong.
# Metres in place of millimetres are 1000.
_LARGEST = 100.0

# Elastic slip relative to the size of an element above which it is a warning.  Chosen:
# with 0.05 of an element of 10 mm the force of a hemispherical punch is 0.5 % smaller,
# and the energy lost 35 %.
_ELASTIC = 0.05

# Number of intermediate positions of a node that are checked for being inside a tool, a
# limit of work.
_INTERMEDIATE = 8


class Gaps(NamedTuple):
    """Gaps at points, infinite out of reach, shape (n,), and their gradients, (3, n).

    ``distance`` is φ/‖∇φ‖, ``local`` are the points in the axes of the surface, and
    ``slope`` is ‖∇φ‖.
    """

    gap: ndarray
    normal: ndarray
    distance: ndarray
    local: ndarray
    slope: ndarray


def no_reach(t: float) -> float:
    """Reach of an `Obstacle` of zero."""
    return 0.0


@dataclass(frozen=True, eq=False)
class Obstacle:
    """Moving surface with the side of the ply, and the gap of points from it.

    Attributes
    ----------
    what, surface, motion
        Name in messages, surface and motion of a tool.
    X
        Nodes of the undeformed ply in mm, shape (3, n_nodes).
    side
        Side of the surface on which the ply lies.
    half
        Half of the thickness in mm.
    outline
        See `Tool`.
    reach
        Function of the load factor: largest distance of the ply from the surface, for a
        holder; None for a tool, which keeps the ply away from the surface.
    stated
        See `Tool`.
    """

    what: str
    surface: Surface
    motion: Motion | None
    X: ndarray
    side: int
    half: float
    outline: ndarray | None
    reach: Callable[[float], float] | None
    stated: Callable[[ndarray], ndarray]

    def place(self, position: ndarray) -> str:
        """Position in a message, given in the axes of the ply, shape (3,)."""
        return f"{coords(self.stated(position[:, None])[:, 0], 4)} mm"

    @classmethod
    def of(
        cls, tool: Any, basis: CellBasis, reach: Callable[[float], float] | None = None
    ) -> "Obstacle":
        """Obstacle of a tool or holder; a ValueError if it is not valid."""
        what = f"tool {tool.name!r}"
        if components(basis) != 3:
            raise ValueError(
                f"{what}: a tool requires a ply in space: use Ply(..., dimension=3)"
            )
        refuse_extent(what, tool.surface, basis.mesh)
        layers = getattr(basis, "layers", None)
        if not layers:
            return cls.near(tool, node_positions(basis), reach)
        if tool.thickness:
            raise ValueError(
                f"{what}: the plies of a stack have their own thickness: omit the "
                f"thickness {tool.thickness:g} mm of the tool"
            )
        thinnest = replace(tool, thickness=float(layers.thickness.min()))
        return cls.near(thinnest, layers.X, reach)

    @classmethod
    def near(
        cls, tool: Any, nodes: ndarray, reach: Callable[[float], float] | None = None
    ) -> "Obstacle":
        """Obstacle near the nodes of a flat ply, shape (2 or 3, n), of any size."""
        what = f"tool {tool.name!r}"
        refuse_in_files(what, tool.name)
        if tool.side not in (None, 1, -1):
            raise ValueError(f"{what}: side must be 1, -1 or None, got {tool.side!r}")
        half = 0.5 * float(real_numbers(f"{what}: thickness", tool.thickness))
        if not 0 <= half < np.inf:
            raise ValueError(
                f"{what}: the thickness must not be negative, got {2 * half:g} mm"
            )
        X = np.pad(nodes, ((0, 3 - len(nodes)), (0, 0)))
        check_surface(what, tool.surface, X)
        outline = corners_of(what, tool.outline)
        side = tool.side or 1
        obstacle = cls(
            *(what, tool.surface, tool.motion, X, side, half, outline, reach),
            tool.stated,
        )
        for t in (0.0, 1.0):
            obstacle.placement(t)
        if tool.side is None:
            return replace(obstacle, side=obstacle._side_at_rest())
        return obstacle

    def placement(self, t: float) -> tuple[ndarray, ndarray]:
        """Rotation matrix and translation at a load factor, see `placement`."""
        return placement(self.what, self.motion, t)

    @property
    def from_below(self) -> int:
        """−1 if it touches the ply from below, 1 from above; 0 if it is vertical."""
        return -int(np.sign(np.round(self.at_rest[0][2], 6)))

    @cached_property
    def at_rest(self) -> tuple[ndarray, float]:
        """Normal and gap of the nearest node of the undeformed ply.

        The gap is infinite if no node is within reach.
        """
        at = self.gaps(self.X, 0.0)
        nearest = int(
            np.where(np.isfinite(at.gap), np.abs(at.distance), np.inf).argmin()
        )
        return at.normal[:, nearest], float(at.gap[nearest])

    def travel(self, t: float) -> ndarray:
        """Translation from the initial position in mm, see `travelled`."""
        return travelled(self.what, self.motion, t)

    def closed(self, t: float) -> float:
        """Distance in mm by which it has moved towards the undeformed ply.

        Along its normal at the nearest node; of a holder also by the change of its gap.
        """
        reach = self.reach or no_reach
        return float(self.at_rest[0] @ self.travel(t)) + reach(0.0) - reach(t)

    def depth(self, t: float) -> float:
        """Depth in mm that it has reached beyond the plane of the undeformed ply."""
        return max(self.closed(t) - self.at_rest[1], 0.0)

    def gaps(self, x: ndarray, t: float) -> Gaps:
        """Gaps of points, shape (3, n).

        Raises
        ------
        SurfaceError
            If level or gradient of the surface is not finite at a point that the tool
            may touch.
        """
        rotation, translation = self.placement(t)
        local = rotation.T @ (x - translation[:, None])
        near, unit = self._near(local)
        if first_order := getattr(self.surface, "first_order", None):
            level, gradient = first_order(local[:, near])
        else:
            checked = CheckedSurface(self.what, self.surface)
            level = checked.level(local[:, near])
            gradient = checked.gradient(local[:, near])
        within = self._within(local[:, near], local[:, near])
        values = np.vstack([level, gradient])[:, within]
        self._refuse_undefined("level or gradient", values, x[:, near[within]])
        slope = np.linalg.norm(gradient, axis=0)
        regular = slope > 0  # it vanishes where a point has no closest one
        near, slope, within = near[regular], slope[regular], within[regular]
        distance, slopes = np.full((2, x.shape[1]), np.inf)
        distance[near], slopes[near] = level[regular] / slope, slope
        unit[:, near] = gradient[:, regular] / slope
        gap = self._gap(distance, near[within], t)
        return Gaps(gap, self._sign * rotation @ unit, distance, local, slopes)

    def _gap(self, distance: ndarray, touched: ndarray, t: float) -> ndarray:
        """Gaps of the points that the tool may touch; infinite for the others."""
        gap = np.full(len(distance), np.inf)
        room = 0.0 if self.reach is None else self.reach(t)
        gap[touched] = self._sign * distance[touched] + (room - self.half)
        return gap

    def gap_of(self, at: Gaps, x: ndarray, t: float) -> ndarray:
        """Gaps of points that are within the outline if others, shape (3, n), are."""
        rotation, moved = self.placement(t)
        within = self._within(at.local, rotation.T @ (x - moved[:, None]))
        return self._gap(at.distance, within & np.isfinite(at.distance), t)

    def _refuse_undefined(self, method: str, values: ndarray, x: ndarray) -> None:
        """Refuse values of the surface, shape (m, n), not finite at points (3, n)."""
        defined = np.isfinite(values).all(axis=0)
        if not defined.all():
            raise SurfaceError(
                f"{self.what}: {method} of the surface is not finite at "
                f"{self.place(x[:, defined.argmin()])}",
                advice="a surface that is finite beyond the ply, or an outline",
            )

    def _near(self, x: ndarray) -> tuple[ndarray, ndarray]:
        """Indices of points near the surface, and normals at the other points."""
        far_away = getattr(self.surface, "far_away", None)
        if far_away is None or self.reach is not None:
            return np.arange(x.shape[1]), np.zeros(x.shape)
        side, normals = far_away(x)
        return np.flatnonzero(side != self.side), normals.copy()

    def derivatives(
        self, at: Gaps, nodes: ndarray, t: float
    ) -> tuple[ndarray, ndarray]:
        """∇g and ∇²g at some points, to leading order in the distance.

        Shapes (3, n) and (3, 3, n).
        """
        rotation, translation = self.placement(t)
        surface, local = CheckedSurface(self.what, self.surface), at.local[:, nodes]
        H = surface.hessian(local)
        x = rotation @ local + translation[:, None]
        self._refuse_undefined("hessian", H.reshape(9, -1), x)
        H = H * (self._sign / at.slope[nodes])
        H = turned(rotation, H)
        n = at.normal[:, nodes]
        turn = np.einsum("ijn,jn->in", H, n)  # zero if φ is a distance
        both = n[:, None] * turn + turn[:, None] * n
        along = turn - n * (n * turn).sum(axis=0)
        return n - self._sign * at.distance[nodes] * along, H - both

    @property
    def _sign(self) -> int:
        return self.side if self.reach is None else -self.side

    def _within(self, x: ndarray, outlined: ndarray) -> ndarray:
        """True for points that the tool may touch, by other ones in its outline."""
        within = np.ones(x.shape[1], dtype=bool)
        if self.outline is not None:
            within &= inside(self.outline, outlined[:2])
        beyond = getattr(self.surface, "beyond_edges", None)
        if beyond is not None and within.any():
            within[within] = beyond(x[:, within]) == 0
        return within

    def _side_at_rest(self) -> int:
        """Side of the surface on which the undeformed ply lies."""
        at = replace(self, reach=no_reach).gaps(self.X, 0.0)
        distance = np.where(np.isfinite(at.gap), at.distance, 0.0)
        size = float(np.ptp(self.X, axis=1).max())
        if not np.isfinite(at.gap).any():
            raise ValueError(
                f"{self.what}: no node of the undeformed ply is within its edges or "
                "outline, so that its side is not known: check the positions and units "
                "of tool and ply, or specify side=1 or side=-1"
            )
        above, below = float(distance.max()), -float(distance.min())
        if max(above, below) <= ROUND_OFF * size:
            raise ValueError(
                f"{self.what}: the surface is in the plane of the undeformed ply, so "
                "that its side is not known: specify side=1 or side=-1"
            )
        side = 1 if above > below else -1
        if (depth := min(above, below)) > ROUND_OFF * size:
            node = int((side * distance).argmin())
            raise ValueError(
                f"{self.what} crosses the undeformed ply: node {node} at "
                f"{self.place(self.X[:, node])} is {depth:.3g} mm inside it: move the "
                "tool, or specify its side"
            )
        return side


def turned(rotation: ndarray, H: ndarray) -> ndarray:
    """Second derivatives in turned axes, shape (3, 3, n)."""
    return np.einsum("ai,ijn,bj->abn", rotation, H, rotation)


def refuse_extent(what: str, surface: Surface, mesh: Mesh) -> None:
    """Refuse tools that pass between the nodes of a ply, or in another unit.

    Parameters
    ----------
    what
        The tool, at the beginning of messages.
    surface
        Its surface; one with neither ``facets``, as of `drape.TriangleMesh`, nor a
        ``diameter``, as of spheres and punches, is valid.
    mesh
        Mesh of the ply.

    Raises
    ------
    ValueError
        If the triangles extend over less than two elements, or over more than 100 times
        the size of the ply, or a diameter is less than half the size of an element.
    """
    least, few, each, most = 0.5, "half an element", "", np.inf
    extent = getattr(surface, "diameter", None)
    if hasattr(surface, "facets"):
        least, few, each, most = 2, "two elements", " each", _LARGEST
        extent = float(np.ptp(surface.facets.points, axis=1).max())
    if extent is None:
        return
    edges = np.diff(mesh.p[:, mesh.facets], axis=1)
    element, size = float(np.hypot(*edges).max()), float(np.ptp(mesh.p, axis=1).max())
    if extent < least * element:
        off = f"less than {few} of the ply, {element:.3g} mm{each}"
    elif extent > most * size:
        off = f"over {_LARGEST:g} times the size of the ply, {size:.3g} mm"
    else:
        return
    raise ValueError(f"{what} extends over {extent:.3g} mm, {off}: check its unit")


class ToolTerm(ElementTerm):
    """Term of a tool, whose forces act on the contact points of a ply.

    Attributes
    ----------
    nodes
        Numbers of the nodes on which each contact point depends, shape (n, n_nodes).
    amounts
        Motion, friction, and gap, pressure or force of the tool, as stated.
    constrains
        See `Friction`.
    idle
        Why friction has no effect if it presses in no state, for messages.
    """

    role = "load"
    friction: Any = None
    constrains = True
    idle = (
        "no free node presses on it: check its position, motion and unit of length, "
        "and conditions along its normal"
    )
    amounts: tuple[Any, ...] = ()

    def __init__(self, name: str, obstacle: Obstacle, basis: CellBasis) -> None:
        self.name, self._obstacle = name, obstacle
        self._points = ContactPoints(obstacle.X, basis)
        self._element = basis.mesh.param()
        self.nodes = self._points.nodes

    @property
    def what(self) -> str:
        """Name in messages."""
        return self._obstacle.what

    def with_friction(self, coefficient: Callable[[float], float], slip: float) -> None:
        """Add Coulomb friction, see `Friction`."""
        from .friction import Friction

        place, at = self._obstacle.placement, self._points.in_planes
        self.friction = Friction(coefficient, slip, place, at, self.constrains)

    def amounts_at(self, t: float) -> dict[str, ndarray]:
        """Placement, gap, friction and slip at a load factor, for checkpoints."""
        values: dict[str, Any] = {"motion": np.vstack(self._obstacle.placement(t))}
        if self._obstacle.reach:
            values["gap"] = self._obstacle.reach(t)
        if self.friction:
            values["friction"] = self.friction.bound(t, np.ones(()))
            values["elastic slip"] = np.array(self.friction.slip)
        return values

    def identity(self) -> dict[str, ndarray]:
        """Surface, outline, side and thickness, for checkpoints."""
        obstacle = self._obstacle
        rotation, translation = obstacle.placement(0.0)
        surface, outline = triangle_sums(obstacle.surface), obstacle.outline
        if not surface.size:
            checked = CheckedSurface(obstacle.what, obstacle.surface)
            surface = checked.level(rotation.T @ (obstacle.X - translation[:, None]))
        return {
            "surface": surface,
            "outline": np.empty(0) if outline is None else outline,
            "side and thickness": np.array([obstacle.side, obstacle.half]),
        }

    def forces(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Normal forces on the contact points in N, shape (n_nodes,)."""
        raise NotImplementedError

    def normals(self, u: ndarray, t: float) -> ndarray:
        """Unit normals of the tool at the contact points, shape (3, n_nodes)."""
        raise NotImplementedError

    def potential(self, u: ndarray, t: float, p: Values) -> float:
        """Energy without friction in N·mm."""
        raise NotImplementedError

    def _on_points(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Derivative of the potential by the contact points, shape (n_nodes, 3)."""
        raise NotImplementedError

    def _blocks(self, u: ndarray, t: float, p: Values) -> ndarray | None:
        """Its second derivative, shape (3, 3, n_nodes); None if it is zero."""
        raise NotImplementedError

    def energy(self, u: ndarray, t: float, p: Values = NO_VALUES) -> float:
        """The potential, and the incremental potential of friction."""
        energy = self.potential(u, t, p)
        return energy + self.friction.energy(u, t, p) if self.friction else energy

    def residual(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """Normal forces and friction."""
        f = self._on_points(u, t, p)
        if self.friction:
            f = f + self.friction.forces(u, t, p)
        return self._points.nodal(f) if f.any() else f.ravel()

    def matrices(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray | None:
        """Derivative of the residual with the parameters held fixed."""
        K = self._blocks(u, t, p)
        if self.friction:
            of_friction = self.friction.stiffness(u, t, p)
            of_friction = self._points.along_planes(of_friction)
            K = of_friction if K is None else K + of_friction
        return None if K is None else self._points.matrices(K)

    def contradictions(self, states: Sequence[Any]) -> list[str]:
        """Friction without effect, elastic only, or in long steps."""
        complete = states[-1].load_factor == 1
        if not any(self.rubs(x.load_factor) for x in states):
            return []
        slip, most = self.friction.slip, _ELASTIC * self._element
        if slip > most:
            return [
                f"friction of {self._obstacle.what} is elastic up to a slip of {slip:g}"
                f" mm, its elastic_slip, over {_ELASTIC:.0%} of the size of an element,"
                f" {self._element:.3g} mm: it restrains the ply too little: use 0.02 to"
                " 0.1 mm"
            ]
        if complete and not any(map(self._presses, states)):
            return [f"friction of {self._obstacle.what} has no effect: {self.idle}"]
        warnings: list[str] = self.friction.warnings(self, states)
        return warnings

    def rubs(self, t: float) -> bool:
        """True if its coefficient of friction is above zero at a load factor."""
        return bool(self.friction and self.friction.bound(t, np.ones(())) > 0)

    def _presses(self, state: Any) -> bool:
        """True if it presses on a node in a state."""
        p = state.parameters[self.name]
        return bool(self.forces(state.u, state.load_factor, p).any())

    def travel(self, t: float) -> ndarray:
        """Translation from the initial position in mm, see `travelled`."""
        return self._obstacle.travel(t)

    def rotation(self, t: float) -> float:
        """Angle from the initial position in radians, see `angle_turned`."""
        return angle_turned(self._obstacle.what, self._obstacle.motion, t)


class ToolParameters(TermParameters):
    """Parameters of a tool, and of its friction if there is any."""

    def __init__(self, term: Any) -> None:
        self._term = term

    def with_friction_at_rest(self, values: dict[str, Any]) -> Values:
        """Values of a ply at rest, and of its friction."""
        if friction := self._term.friction:
            values |= friction.at_rest(np.zeros(3 * self._term._points.matrix.shape[0]))
        return Values(values)

    def updated(
        self, values: Values, u: ndarray, t: float, tension: ndarray | None = None
    ) -> Values:
        """Values at a displacement."""
        term, after = self._term, self._without_friction(values, u, t)
        if term.friction:
            state = u, t, term.normals(u, t), term.forces(u, t, after)
            after = term.friction.updated(after, *state)
        return after

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """See `Friction.advanced`."""
        friction, force = self._term.friction, self._term.forces
        if not friction:
            return values
        after: Values = friction.advanced(values, u, t, force(u, t, values))
        return after

    def _without_friction(self, values: Values, u: ndarray, t: float) -> Values:
        raise NotImplementedError


class _ContactForces(ToolParameters):
    """Contact forces and stiffnesses; no contact at rest."""

    def at_rest(self) -> Values:
        """No contact."""
        zero = np.zeros(self._term.nodes.shape[1])
        values = {"force": zero, "stiffness": zero}
        values |= self._outlined(np.zeros(3 * zero.size))
        return self.with_friction_at_rest(values)

    def advanced(self, values: Values, u: ndarray, t: float) -> Values:
        """Also positions in an outline."""
        values, outlined = super().advanced(values, u, t), self._outlined(u)
        return Values({**values, **outlined}) if outlined else values

    def _outlined(self, u: ndarray) -> dict[str, ndarray]:
        """Positions by which nodes are within an outline in the next step, if any.

        By their own, nodes on it are pushed out where they touch, and fall back else.
        """
        if self._term._obstacle.outline is None:
            return {}
        return {"outlined": self._term._points.positions(u)}

    def _without_friction(self, values: Values, u: ndarray, t: float) -> Values:
        """Multipliers max(λ − κ g, 0)."""
        return Values({**values, "force": self._term.forces(u, t, values)})


class ToolContact(ToolTerm, ContactTerm):
    """Contact of a ply with a `Tool`.

    Attributes
    ----------
    areas
        Integral of the shape function of each node in mm², shape (n_nodes,).
    """

    def __init__(self, name: str, obstacle: Obstacle, basis: CellBasis) -> None:
        super().__init__(name, obstacle, basis)
        self.points = self._points.matrix
        self.areas = asm(LinearForm(lambda v, w: v[0]), basis)[::3]
        self._takes_part, self._thicker = self.areas > ROUND_OFF * self.areas.max(), 0.0
        if layers := getattr(basis, "layers", None):
            self._takes_part &= layers.exposed(obstacle.from_below)
            self._thicker = 0.5 * layers.thickness[layers.ply] - obstacle.half
        self.parameters = _ContactForces(self)
        self._last: tuple[ndarray, float, Gaps | None] = np.empty(0), 0.0, None

    def stated(self, x: ndarray) -> ndarray:
        """Positions, shape (3, n), in the axes of messages, see `Tool`."""
        return self._obstacle.stated(x)

    @property
    def thickness(self) -> float:
        """Thickness of the ply in mm that is stated for the tool."""
        return 2 * self._obstacle.half

    def gaps(self, u: ndarray, t: float, p: Values = NO_VALUES) -> ndarray:
        """See `ContactTerm.gaps`."""
        at = self._at(u, t)
        gap = self._obstacle.gap_of(at, p["outlined"], t) if "outlined" in p else at.gap
        return np.where(self._takes_part, gap - self._thicker, np.inf)

    def contradictions(self, states: Sequence[Any]) -> list[str]:
        """Nodes that cross its outline, else see `ToolTerm`."""
        crosses = [
            x
            for x in states
            if self.crosses_outline(x.u, x.load_factor, x.parameters[self.name])
        ]
        if not crosses:
            return super().contradictions(states)
        t, what = crosses[0].load_factor, self._obstacle.what
        return [
            f"load factor {t:g}: nodes that touch {what} cross its outline by over "
            "half an element in the step; they count as within it or not by their "
            "position before: use more steps"
        ]

    def crosses_outline(self, u: ndarray, t: float, p: Values) -> bool:
        """True if a node that touches moves by over half an element across it."""
        if "outlined" not in p:
            return False
        gaps = np.array([self.gaps(u, t, p), self.gaps(u, t)])
        crosses = np.isfinite(gaps[0]) != np.isfinite(gaps[1])
        touches = gaps.min(axis=0) <= ROUND_OFF * self._element
        moved = np.linalg.norm(self._points.positions(u) - p["outlined"], axis=0)
        return bool((crosses & touches & (moved > 0.5 * self._element)).any())

    def reaches(self, u: ndarray, t: float) -> bool:
        """True if a node of the ply is within the edges and outline of the tool."""
        return bool(np.isfinite(self.gaps(u, t)).any())

    def gaps_at(self, x: ndarray, t: float) -> ndarray:
        """See `ContactTerm.gaps_at`."""
        return self._obstacle.gaps(x, t).gap

    def normals_at(self, x: ndarray, t: float) -> ndarray:
        """Unit normals of the tool at points, shape (3, n)."""
        return self._obstacle.gaps(x, t).normal

    def normals(self, u: ndarray, t: float) -> ndarray:
        """See `ContactTerm.normals`."""
        return self._at(u, t).normal

    def curved(self, u: ndarray, t: float, forces: ndarray) -> tuple[ndarray, ndarray]:
        """See `ContactTerm.curved`."""
        nodes = np.flatnonzero(forces)
        _, H = self._obstacle.derivatives(self._at(u, t), nodes, t)
        return nodes, forces[nodes] * H

    def forces(self, u: ndarray, t: float, p: Values) -> ndarray:
        """See `ContactTerm.forces`."""
        kappa = p["stiffness"]
        if not kappa.any():
            return np.zeros(len(kappa))
        gap = self.gaps(u, t, p)
        reached = np.isfinite(gap)
        return np.where(
            reached, np.maximum(p["force"] - kappa * np.where(reached, gap, 0), 0), 0.0
        )

    def potential(self, u: ndarray, t: float, p: Values) -> float:
        """Σ (max(λ − κ g, 0)² − λ²)/2κ."""
        kappa = p["stiffness"]
        if not kappa.any():
            return 0.0
        force = self.forces(u, t, p)
        return float(((force**2 - p["force"] ** 2) / (2 * kappa)).sum())

    def _on_points(self, u: ndarray, t: float, p: Values) -> ndarray:
        """−max(λ − κ g, 0) ∇g."""
        force = self.forces(u, t, p)
        f = np.zeros((len(force), 3))
        if (nodes := np.flatnonzero(force)).size:
            normal, _ = self._obstacle.derivatives(self._at(u, t), nodes, t)
            f[nodes] = -(force[nodes] * normal).T
        return f

    def _blocks(self, u: ndarray, t: float, p: Values) -> ndarray | None:
        """κ ∇g∇gᵀ − λ∇²g of the points that touch."""
        kappa = p["stiffness"]
        if not kappa.any():
            return None
        force = self.forces(u, t, p)
        K = np.zeros((3, 3, len(force)))
        if (nodes := np.flatnonzero(force)).size:
            normal, H = self._obstacle.derivatives(self._at(u, t), nodes, t)
            K[..., nodes] = kappa[nodes] * normal[:, None] * normal
            K[..., nodes] -= p["force"][nodes] * H
        return self._points.along_planes(K)

    def passed(self, u_0: ndarray, t_0: float, u: ndarray, t: float) -> ndarray:
        """See `ContactTerm.passed`.

        Seen from the tool, a node moves straight from one side of it to another, with
        an opposite normal, through the inside of the tool.
        """
        before, after = self._at(u_0, t_0), self._at(u, t)
        places = map(self._obstacle.placement, (t_0, t))
        (earlier, _), (rotation, translation) = places
        normals = rotation @ earlier.T @ before.normal, after.normal
        opposite = (normals[0] * normals[1]).sum(axis=0) < 0
        nodes = np.flatnonzero(opposite & self._takes_part)
        if not nodes.size:
            return nodes
        depth = np.zeros(nodes.size)
        for share in np.linspace(0, 1, _INTERMEDIATE + 2)[1:-1]:
            local = (1 - share) * before.local + share * after.local
            x = rotation @ local[:, nodes] + translation[:, None]
            depth = np.maximum(depth, -self._obstacle.gaps(x, t).gap)
        return nodes[depth > ROUND_OFF * np.ptp(self._obstacle.X)]

    def _at(self, u: ndarray, t: float) -> Gaps:
        """Gaps of the contact points at a displacement; the last one is kept."""
        last_u, last_t, last = self._last
        if last is not None and t == last_t and np.array_equal(u, last_u):
            return last
        gaps = self._obstacle.gaps(self._points.in_planes(u), t)
        self._last = u.copy(), t, gaps
        return gaps
