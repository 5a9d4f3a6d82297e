"""Judge of states with friction, which does not use the library's friction.

From the displacements and normal forces of all states it evaluates Coulomb's law along
the straight slips of each contact point between two states, and balances each node and
the whole ply with the forces that follow.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.sparse import identity

from skfem_textile import Ply, State
from skfem_textile.contact.holder import HolderPressure, pressing
from skfem_textile.contact.obstacle import ToolTerm
from skfem_textile.mesh.recovery import contact_points
from skfem_textile.ply.parameters import NO_VALUES

Motion = Callable[[float], tuple[ndarray, ndarray]]

#: Deviations of a state by name, each relative to what it is compared with.
Judgement = Mapping[str, float]

# Largest deviations of an accepted state.  Forces are relative to the largest force of
# a tool, condition or load: of a residual in equilibrium, rounding leaves 1e-9.
# Penetrations are relative to the size of the ply, as `CLOSED`; works, and the part of
# the energy balance that the steps do not explain, to the sum of its terms.
LIMITS: Judgement = {
    "unbalanced": 1e-6,
    "friction force": 1e-6,
    "beyond the cone": 1e-6,
    "against sliding": 1e-6,
    "tool force": 1e-6,
    "total force": 1e-6,
    "total moment": 1e-6,
    "penetration": 1e-9,
    "open contact": 1e-9,
    "holder force": 1e-6,
    "work of sliding": 1e-6,
    "energy": 5e-3,
}


# Distance in mm of nodes on a plane of symmetry from it, a force in N that is smaller
# than any in a state, and a motion in mm whose work is round-off.
_ON_PLANE, _NO_FORCE, _MOTION = 1e-9, 1e-12, 1e-6


def still(t: float) -> tuple[ndarray, ndarray]:
    """Placement of a tool that does not move."""
    return np.eye(3), np.zeros(3)


@dataclass
class Contact:
    """Contact points of one tool, with the history of their friction.

    Attributes
    ----------
    term, motion, mu, slip
        Term of the tool, whose normal forces are judged too; its motion, coefficient of
        friction and elastic slip.
    amount
        Gap, pressure or force of a holder as a function of the load factor; None for a
        tool.
    x, s
        Last places and friction forces of the points in the axes of the tool.
    t, N
        Last load factor and normal forces.
    work
        Work of sliding in N·mm.
    """

    term: Any
    motion: Motion
    mu: Callable[[float], float]
    slip: float
    amount: Any
    x: ndarray
    s: ndarray
    N: ndarray
    t: float = 0.0
    work: float = 0.0

    def normal(self, x: ndarray, t: float) -> tuple[ndarray, ndarray]:
        """Gaps of points and unit normals towards the ply, in the axes of the ply."""
        obstacle = self.term._obstacle
        R, c = self.motion(t)
        at = R.T @ (x - c[:, None])
        with np.errstate(over="ignore"):  # far from a fillet
            gradient = obstacle.surface.gradient(at)
        size = np.linalg.norm(gradient, axis=0)
        size[size == 0] = np.inf
        distance = obstacle.surface.level(at) / size
        side = obstacle.side if obstacle.reach is None else -obstacle.side
        return side * distance + self.room(t), side * R @ (gradient / size)

    def room(self, t: float) -> float:
        """Gap of a holder that keeps one; 0 for other tools."""
        keeps = self.term._obstacle.reach and not isinstance(self.term, HolderPressure)
        return self.amount(t) if keeps else 0.0

    def slid(
        self, x: ndarray, t: float, n: ndarray, normal_force: ndarray
    ) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """Friction forces by Coulomb's law, in the axes of the ply, and slips.

        The third is the length of the slip beyond the elastic one, the last the work of
        sliding of each point in the step.

        A point that stuck is tied to its place by an elastic slip; its force is
        shortened to the bound where it exceeds it.
        """
        R, c = self.motion(t)
        at, n = R.T @ (x - c[:, None]), R.T @ n
        bound = self.mu(t) * normal_force
        chord = at - self.x
        moved = chord - n * (n * chord).sum(axis=0)
        before = self.s - n * (n * self.s).sum(axis=0)
        before = _shortened(before, bound)
        trial = before + bound / self.slip * moved
        force = _shortened(trial, bound)
        excess = np.linalg.norm(trial, axis=0) - np.linalg.norm(force, axis=0)
        stiffness = np.where(bound > 0, bound / self.slip, 1.0)
        slid = np.maximum(excess, 0.0) / stiffness
        far = np.linalg.norm(moved, axis=0) - self.slip
        slid = np.where(bound > 0, slid, np.maximum(far, 0.0))
        rounds = (slid > 0) & (bound > 0) & (self.N > 0)
        slid += np.where(rounds, self._longer(chord, moved), 0.0)
        lost = self.mean_bound(x, t, R @ n, normal_force) * slid
        self.work += float(lost.sum())
        self.x, self.s, self.t, self.N = at, force, t, normal_force
        return R @ force, R @ moved, slid, lost

    def _longer(self, chord: ndarray, moved: ndarray) -> ndarray:
        """Length of arcs with chords, less their projections on the tangent planes.

        The angle between a chord and the tangent is half the angle of its arc.
        """
        if isinstance(self.term, HolderPressure):
            return np.zeros(chord.shape[1])
        length, along = (np.linalg.norm(x, axis=0) for x in (chord, moved))
        angle = 2 * np.arccos(np.clip(along / np.maximum(length, 1e-300), 0.0, 1.0))
        bent = angle > 0
        radius = length / np.where(bent, 2 * np.sin(angle / 2), 1.0)
        return np.where(bent, radius * angle, length) - along

    def mean_bound(self, x: ndarray, t: float, n: ndarray, N: ndarray) -> ndarray:
        """Bounds averaged over the slip of a step, within which they are linear.

        A tool that leaves a point is followed by it along the normal n, at first.
        """
        # Coefficients of phases jump at their ends.
        mean = 0.5 * (self.mu(min(self.t + 1e-9, t)) * self.N + self.mu(t) * N)
        if isinstance(self.term, HolderPressure):
            return mean
        (R_0, c_0), (R, c) = self.motion(self.t), self.motion(t)
        x_0 = R_0 @ self.x + c_0[:, None]
        tool = -(n * (R @ self.x + c[:, None] - x_0)).sum(axis=0)
        point = -(n * (x - x_0)).sum(axis=0)
        tool, point = np.maximum(tool, 0.0), np.maximum(point, 0.0)
        share = np.clip((point + self.slip) / (tool + self.slip), 0.0, 1.0)
        return np.where(N > 0, mean, share * mean)

    def works(
        self,
        places: tuple[tuple[float, ndarray], tuple[float, ndarray]],
        touches: tuple["Touch", "Touch"],
    ) -> tuple[ndarray, ndarray]:
        """Work on each point in a step by the forces at its start and at its end, N·mm.

        A tool moves by its motion, and a holder with a gap also along its normal as
        the gap changes.  The pressure of a holder moves with the ply.

        Parameters
        ----------
        places
            Load factors, and positions of the points, at start and end.
        touches
            Forces there.
        """
        (t_0, x_0), (t, x) = places
        if isinstance(self.term, HolderPressure):
            one, other = ((touch.normal * (x - x_0)).sum(axis=0) for touch in touches)
            return one, other
        (R_0, c_0), (R, c) = self.motion(t_0), self.motion(t)
        closed, works = self.room(t_0) - self.room(t), []
        for place, (turn, shift), touch in zip(
            (x_0, x), ((R_0, c_0), (R, c)), touches, strict=True
        ):
            local = turn.T @ (place - shift[:, None])
            moved = (R - R_0) @ local + (c - c_0)[:, None]
            pressed = np.linalg.norm(touch.normal, axis=0) * closed
            pushed = touch.normal - touch.friction
            works.append((pushed * moved).sum(axis=0) + pressed)
        return works[0], works[1]


class Touch(NamedTuple):
    """Forces of a tool on the contact points of a state, in the axes of the ply.

    Attributes
    ----------
    normal, friction
        Normal and friction force in N, shape (3, n).
    bound
        Largest friction force in N, shape (n,).
    moved, slid
        Slip over the tool since the last state in mm, shape (3, n), and the length of
        its part beyond the elastic slip, shape (n,).
    gap
        Gaps in mm, shape (n,).
    stored, lost
        Energy of the elastic slips, and work of sliding of each point since the last
        state, in N·mm.
    """

    normal: ndarray
    friction: ndarray
    bound: ndarray
    moved: ndarray
    slid: ndarray
    gap: ndarray
    stored: float
    lost: ndarray


def _shortened(force: ndarray, bound: ndarray) -> ndarray:
    size = np.linalg.norm(force, axis=0)
    over = size > bound
    return np.where(over, force * bound / np.where(over, size, 1.0), force)


class Oracle:
    """Judge of the states of a run, in their order.

    Parameters
    ----------
    ply
        The ply.
    motions
        Motions of tools by name; the others do not move.
    frictions
        Coefficient of friction as a function of the load factor, by name.
    amounts
        Gap, pressure or force of holders as functions of the load factor, by name.
    slip
        Elastic slip of all tools in mm.
    fixed
        Unknowns that conditions keep at zero.
    whole
        False for a quarter of a ply with planes of symmetry x = 0 and y = 0.

    Attributes
    ----------
    worst
        Largest deviations of all states by name, see `LIMITS`.
    missed, excess, moved
        Energy in N·mm that is missing in the balance with works by trapezoids; the part
        of it that works by the forces at both ends of each step cannot
        explain; and the sum of all terms of the balance.
    """

    def __init__(
        self,
        ply: Ply,
        motions: Mapping[str, Motion],
        frictions: Mapping[str, Callable[[float], float]],
        amounts: Mapping[str, Callable[[float], float]],
        slip: float,
        fixed: ndarray,
        whole: bool,
    ) -> None:
        self._ply, n = ply, ply.nodes.shape[1]
        self._X, self._slip = np.vstack([ply.nodes[:2], np.zeros(n)]), slip
        self._P: Any = identity(n)
        if ply.mesh.t.shape[0] == 4:
            mirrors = getattr(ply.basis, "mirrors", ())
            self._P = contact_points(ply.mesh, mirrors)
        self._on_planes = np.zeros((3, n), dtype=bool)
        if not whole:
            self._on_planes[:2] = np.abs(self._X[:2]) < _ON_PLANE
        self._free = np.ones((n, 3), dtype=bool)
        self._free.ravel()[fixed] = False
        self.contacts = []
        for term in pressing(ply):
            motion = motions.get(term.name, still)
            R, c = motion(0.0)
            at, mu = R.T @ (self._X - c[:, None]), frictions[term.name]
            given = mu, slip, amounts.get(term.name)
            self.contacts.append(Contact(term, motion, *given, at, 0 * at, 0 * at[0]))
        self._size = float(np.ptp(self._X, axis=1).max())
        self.worst = dict.fromkeys(LIMITS, 0.0)
        self.missed = self.excess = self.moved = 0.0
        self._last: Any = None

    def judge(self, state: State) -> None:
        """Record the deviations of a state."""
        u = state.u
        x = self._points(u)
        touches = [self._touches(one, state, x) for one in self.contacts]
        pushes = [self._nodal(touch.normal - touch.friction) for touch in touches]
        load = self._load(state)
        bare = self._residual(state)
        held = np.where(self._free, 0.0, bare - sum(pushes))
        forces = [f.sum(axis=0) for f in pushes]
        scale = max(
            *(float(np.linalg.norm(f)) for f in forces),
            *(float(np.abs(touch.normal).sum()) for touch in touches),
            float(np.abs(load).sum()),
            float(np.abs(held).sum()),
            _NO_FORCE,
        )
        for one, touch, force in zip(self.contacts, touches, forces, strict=True):
            self._judge_tool(one, touch, state, force, scale)
        left = np.where(self._free, bare - sum(pushes), 0.0)
        self._record("unbalanced", np.abs(left).max() / scale)
        outer = load + sum(pushes) + held
        self._record("total force", np.linalg.norm(outer.sum(axis=0)) / scale)
        if not self._on_planes.any():  # where nodes have moments too
            moment = np.cross((self._X + u.reshape(-1, 3).T).T, outer).sum(axis=0)
            off = np.linalg.norm(moment) / (scale * self._size)
            self._record("total moment", off)
        self.moved += scale * _MOTION
        self._balance(state, x, touches)

    def broken(self) -> list[str]:
        """Names of the deviations above their limits."""
        return [name for name, off in self.worst.items() if not off <= LIMITS[name]]

    def _record(self, name: str, off: Any) -> None:
        self.worst[name] = float(np.maximum(self.worst[name], off))  # NaN stays

    def _points(self, u: ndarray) -> ndarray:
        """Contact points, on planes of symmetry without motion off them."""
        x = self._X + (self._P @ u.reshape(-1, 3)).T
        return np.where(self._on_planes, self._X, x)

    def _nodal(self, f: ndarray) -> ndarray:
        """Forces of the nodes, (n, 3), from forces of contact points, (3, n)."""
        return np.asarray(self._P.T @ f.T)

    def _residual(self, state: State) -> ndarray:
        """Nodal forces of the ply and its loads without tools, shape (n, 3)."""
        u, t, p = state.u, state.load_factor, state.parameters
        f = self._ply.residual(u, t, p)
        for one in self.contacts:
            f = f - one.term.residual(u, t, p[one.term.name])
        return np.asarray(f).reshape(-1, 3)

    def _load(self, state: State) -> ndarray:
        """Nodal forces of the loads, shape (n, 3)."""
        loads = [
            -term.residual(state.u, state.load_factor, NO_VALUES)
            for term in self._ply.terms
            if term.role == "load" and not isinstance(term, ToolTerm)
        ]
        return np.sum(loads, axis=0).reshape(-1, 3)

    def _touches(self, one: Contact, state: State, x: ndarray) -> "Touch":
        """Forces of a tool on the contact points, by Coulomb's law."""
        u, t, p = state.u, state.load_factor, state.parameters[one.term.name]
        N = one.term.forces(u, t, p)
        gap, n = one.normal(x, t)
        friction, moved, slid, lost = one.slid(x, t, n, N)
        bound = one.mu(t) * N
        size = (friction**2).sum(axis=0)
        stored = self._slip * size / np.where(bound > 0, 2 * bound, 1.0)
        return Touch(n * N, friction, bound, moved, slid, gap, stored.sum(), lost)

    def _judge_tool(
        self, one: Contact, touch: "Touch", state: State, force: ndarray, scale: float
    ) -> None:
        term, u, t = one.term, state.u, state.load_factor
        p = state.parameters[term.name]
        N = np.linalg.norm(touch.normal, axis=0)
        if isinstance(term, HolderPressure):
            # Undeformed areas: the surface is a plane.
            total = one.amount(t) * (1.0 if term.rigid else p["areas"].sum())
            if total:
                self._record("holder force", abs(N.sum() / total - 1))
        else:
            reached = np.isfinite(term.gaps(u, t))
            inside = np.where(reached, np.maximum(-touch.gap, 0.0), 0.0)
            self._record("penetration", inside.max() / self._size)
            opened = np.where(N > 0, np.abs(touch.gap), 0.0)
            self._record("open contact", opened.max() / self._size)
        pushed = -term.residual(u, t, p).reshape(-1, 3).sum(axis=0)
        for named in (pushed, state.reactions.get(term.name, pushed)):
            self._record("tool force", np.linalg.norm(named - force) / scale)
        if not term.friction:
            return
        theirs = term.friction.forces(u, t, p).T
        off = np.linalg.norm(touch.friction - theirs, axis=0)
        self._record("friction force", off.max() / scale)
        over = np.linalg.norm(theirs, axis=0) - one.mu(t) * N
        self._record("beyond the cone", over.max() / scale)
        # A slip over twice the elastic slip turns the force to its side.
        far = np.linalg.norm(touch.moved, axis=0) > 2 * self._slip
        along = (theirs * touch.moved)[:, far].sum(axis=0)
        along /= np.linalg.norm(touch.moved[:, far], axis=0)
        self._record("against sliding", (-along).max(initial=0.0) / scale)

    def _balance(self, state: State, x: ndarray, touches: list["Touch"]) -> None:
        """Add the step since the last state to the balance of energy.

        Forces that grow or fall in a step do a work between its two values with the
        forces at start and end.
        """
        t = state.load_factor
        energy = sum(state.energies.values()) + sum(touch.stored for touch in touches)
        energy += sum(
            potential
            for name, potential in state.potentials.items()
            if name.startswith("traction")
        )
        lost = sum(touch.lost.sum() for touch in touches)
        self.moved += lost
        if self._last is not None:
            t_0, x_0, earlier, energy_0 = self._last
            missed, open_to = energy - energy_0 + lost, 0.0
            self.moved += abs(energy - energy_0)
            for one, before, after in zip(self.contacts, earlier, touches, strict=True):
                works = one.works(((t_0, x_0), (t, x)), (before, after))
                work = 0.5 * float(works[0].sum() + works[1].sum())
                missed -= work
                open_to += 0.5 * np.abs(works[0] - works[1]).sum()
                turned = np.linalg.norm(after.friction - before.friction, axis=0)
                open_to += float(turned @ after.slid)
                # The stiffness of the elastic slip changes with the bound.
                open_to += 0.5 * self._slip * np.abs(after.bound - before.bound).sum()
                self.moved += abs(work)
            self.missed += missed
            self.excess += max(abs(missed) - open_to, 0.0)
        self._last = t, x, touches, energy
        self._record("energy", self.excess / self.moved)
        for one in self.contacts:
            if one.term.friction:
                off = abs(state.energy_lost[one.term.name] - one.work)
                self._record("work of sliding", off / self.moved)
