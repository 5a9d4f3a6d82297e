"""Coulomb friction between a ply and its tools, as the energy of a step.

A contact point slips by D over the tool since the last state: the tangential part of
its motion in the axes of the tool.  Sliding begins after an elastic slip of the length
ε.  With the normal n and the bound b = μN of the friction force held fixed, the force

    f = b y/max(ε, |y|),   y = ε s/b + D,   D = (I − n⊗n)(Rᵀ(x − c) − X₀)

is the derivative of b h(|y|), where h(y) = y²/2ε up to ε and y − ε/2 beyond: a convex
energy.  s is the force at the last state, not above b, and X₀ the place on the tool.
n and b are updated within an iteration, near the equilibrium; s, X₀ and the work once a
step.  The work is the slip beyond ε, along an arc on the tool, times the mean of the
bounds at both ends of the step, because the bound changes within it.  A point that the
tool leaves in the step rubs only while both touch: its mean is multiplied by its own
motion along the normal over the one of the tool, both with ε.

Newton's method converges slowly at the kink between sticking and sliding.  The tangent
therefore contains the force σ that the previous increment predicts, which is linear in
it, as in primal-dual methods (Hintermüller & Stadler 2006):

    (b I − σ⊗m)/|y|,   m = y/|y|,  if |y| > ε,   else b I/ε,

with its symmetric part, which is positive semi-definite for |σ| ≤ b.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from ..ply.amount import SAME
from ..ply.parameters import Values
from ..solve.direction import TINY
from ..solve.states import State
from ..solve.verdict import Course

# Estimated error of the work of sliding on a tool, relative to all energy lost, above
# which there is a warning.  Measured (`python -m studies friction --case "steps, *"`):
# the estimate is at least twice the error, which is thus up to 5 %.
_UNCERTAIN = 0.1


class Friction:
    """Friction of the contact points of a ply on one tool.

    All vectors are in the axes of the tool, shape (3, n_nodes).  Its values among the
    parameters of the tool are ``bound``, b in N; ``normal``, n; ``slips_from``, X₀ in
    mm; ``shear``, s in N; ``predicted``, σ in N; ``work``, the work of sliding in N·mm;
    and of the last state ``pressed``, the normal forces in N, and ``since``, its load
    factor.

    Parameters
    ----------
    coefficient
        μ as a function of the load factor.
    slip
        Elastic slip ε in mm.
    placement
        Rotation R and translation c of the tool at a load factor.
    positions
        Positions x of the contact points at a displacement in mm.
    constrains
        True if the tool keeps points off its surface; False if its normal forces are
        prescribed.
    """

    def __init__(
        self,
        coefficient: Callable[[float], float],
        slip: float,
        placement: Callable[[float], tuple[ndarray, ndarray]],
        positions: Callable[[ndarray], ndarray],
        constrains: bool = True,
    ) -> None:
        self._coefficient, self.slip = coefficient, slip
        self._placement, self._positions = placement, positions
        self._constrains = constrains

    def at_rest(self, u: ndarray) -> dict[str, Any]:
        """Values of a ply at rest, which touches nothing."""
        x = self._local(u, 0.0)
        none = np.zeros_like(x)
        return {
            "bound": none[0],
            "normal": none,
            "slips_from": x,
            "shear": none,
            "predicted": none,
            "work": np.zeros(()),
            "pressed": none[0],
            "since": np.zeros(()),
        }

    def bound(self, t: float, force: ndarray) -> ndarray:
        """Bounds μN in N at normal forces, shape (n_nodes,)."""
        return self._coefficient(t) * force

    def _over(self, motion: ndarray, p: Values) -> ndarray:
        """Motion over the other body in its axes, for motions in them, (3, n_nodes)."""
        return motion

    def bounded(
        self, p: Values, u: ndarray, t: float, normals: ndarray, bound: ndarray
    ) -> Values:
        """Values with other bounds, and normals in the axes of the ply."""
        rotation, _ = self._placement(t)
        return Values({**p, "bound": bound, "normal": rotation.T @ normals})

    def updated(
        self, p: Values, u: ndarray, t: float, normals: ndarray, force: ndarray
    ) -> Values:
        """Values at a displacement, by the normals and normal forces there."""
        after = self.bounded(p, u, t, normals, self.bound(t, force))
        return Values({**after, "predicted": self._force(u, t, after)})

    def predicted(self, p: Values, u: ndarray, du: ndarray, t: float) -> Values:
        """Values with the forces after an increment, to first order."""
        y, size = self._slipped(u, t, p)
        moved = self._over(self._local(u + du, t) - self._local(u, t), p)
        dy = self._tangential(moved, p)
        slides, m = size > self.slip, y / np.maximum(size, TINY)
        turned = np.where(slides, p["predicted"] * (m * dy).sum(axis=0), 0.0)
        force = (p["bound"] * (y + dy) - turned) / np.maximum(size, self.slip)
        return Values({**p, "predicted": _bounded(force, p["bound"])})

    def advanced(self, p: Values, u: ndarray, t: float, force: ndarray) -> Values:
        """Values after a step, at its converged displacement and normal forces."""
        lost = self._mean_bound(p, u, t, force) @ self._slid(p, u, t, force)
        after = {
            "slips_from": self._local(u, t),
            "shear": self._force(u, t, p),
            "work": p["work"] + lost,
            "pressed": force,
            "since": np.array(t),
        }
        return Values({**p, **after})

    def errors(self, term: Any, states: Sequence[State]) -> ndarray:
        """Estimated errors of the work of sliding in steps in N·mm, shape (n_states,).

        The difference from the work with the bounds at the ends of the steps, which is
        of lower order.  Of points that a step brings into contact, or out of it, only
        one bound is known.

        Parameters
        ----------
        term
            The term of the tool.
        states
            States of a run from its beginning.
        """
        differences = []
        for x in states:
            u, t, p = x.u, x.load_factor, x.parameters[term.name]
            force = term.forces(u, t, p)
            mean = self._mean_bound(p, u, t, force)
            differences.append((mean - p["bound"]) @ self._slid(p, u, t, force))
        return np.abs(differences)

    def warnings(self, term: Any, states: Sequence[State]) -> list[str]:
        """Warning of a work of sliding that depends on the steps, if there is one."""
        lost, error = states[-1].energy_lost, float(self.errors(term, states).sum())
        if error <= _UNCERTAIN * sum(lost.values()):
            return []
        work = f"{term.what}, {lost[term.name]:.4g} N·mm, has an estimated"
        return [
            f"work of friction on {work} error of up to {error:.2g} N·mm in the "
            "computed part, because contact forces change within steps: use more steps"
        ]

    def _slid(self, p: Values, u: ndarray, t: float, force: ndarray) -> ndarray:
        """Lengths of the slips of a step beyond the elastic slip, shape (n_nodes,).

        A point that touches at both ends slips along an arc on the tool.
        """
        _, size = self._slipped(u, t, p)
        slid = np.maximum(size - self.slip, 0.0)
        moved = self._over(self._local(u, t) - p["slips_from"], p)
        along = np.linalg.norm(self._tangential(moved, p), axis=0)
        longer = self._arcs(moved, p) - along
        touches = (p["bound"] * p["pressed"] > 0) & (force > 0)
        return slid + np.where((slid > 0) & touches, longer, 0.0)

    def _arcs(self, chords: ndarray, p: Values) -> ndarray:
        """Lengths of arcs on the tool with chords, that end along the surface."""
        along = np.linalg.norm(self._tangential(chords, p), axis=0)
        if not self._constrains:
            return along
        chord = np.linalg.norm(chords, axis=0)
        half = np.arccos(np.minimum(along / np.maximum(chord, TINY), 1.0))
        return chord / np.sinc(half / np.pi)

    def _mean_bound(self, p: Values, u: ndarray, t: float, force: ndarray) -> ndarray:
        """Bounds in N averaged over the slip of a step, shape (n_nodes,).

        They change linearly.  A point that the tool leaves follows it along the normal
        while both touch: for the share of the motion of the tool that it moves itself.
        """
        began, x = float(p["since"]), p["slips_from"]
        # A coefficient may jump at the start of the step.
        before = self._coefficient(min(began + SAME, t)) * p["pressed"]
        mean = 0.5 * (before + p["bound"])
        if not self._constrains:
            return mean
        (first, start), (last, end) = map(self._placement, (began, t))
        x_0, normal = first @ x + start[:, None], last @ p["normal"]
        ends = last @ x + end[:, None], self._positions(u)
        tool, point = (np.maximum(((x_0 - y) * normal).sum(axis=0), 0) for y in ends)
        share = np.minimum((point + self.slip) / (tool + self.slip), 1.0)
        return np.where(force > 0, mean, share * mean)

    def energy(self, u: ndarray, t: float, p: Values) -> float:
        """Σ b (h(|y|) − h(|y|) at the last state), in N·mm."""
        _, size = self._slipped(u, t, p)
        start = np.linalg.norm(self._elastic(p), axis=0)
        return float(p["bound"] @ (self._height(size) - self._height(start)))

    def missed(
        self, p: Values, course: Course, u: ndarray, t: float, force: ndarray
    ) -> float:
        """Work in N·mm that a step misses, because the motion turns within it.

        The bounds over the paths of the points on the tool, less the bounds over the
        straight connections or arcs along which the step counts slip.

        A free point may follow the tool, or a support, instead of moving straight.  As
        much as it moves in space is not counted, nor is a path shorter than the elastic
        slip.  Of supports that turn the whole ply is assumed to follow the one that
        turns most, in proportion to the slips.

        Parameters
        ----------
        p, u, t, force
            Values, displacement, load factor and normal forces at the end of the step.
        course
            Motion of the ply within the step.
        """
        x, over, net = self._velocities(course, p)
        normal = self._placement(t)[0] @ p["normal"]
        path = course.length(over - normal * (over * normal).sum(axis=1)[:, None])
        counted = np.maximum(self._arcs(net, p), self.slip)
        start = self._positions(course.u)
        followed, moved = (
            np.linalg.norm(self._positions(course.u + du) - start, axis=0)
            for du in (course.free, course.du)
        )
        detour = self._detours(course, x, over)
        most = int(detour.argmax())
        share = np.minimum(counted / max(float(moved[most]), self.slip), 1.0)
        missed = np.maximum(path - counted - followed, share * detour[most])
        return float(self._mean_bound(p, u, t, force) @ missed)

    def _detours(self, course: Course, x: ndarray, over: ndarray) -> ndarray:
        """Paths of points beyond straight ones and the elastic slip, (n_nodes,).

        They are relative to the tool without its mean motion.
        """
        over = over + course.mean(x - over)
        straight = over - x + course.mean(x)
        longer = course.length(over) - course.length(straight)
        return np.maximum(longer - self.slip, 0.0)

    def _velocities(
        self, course: Course, p: Values
    ) -> tuple[ndarray, ndarray, ndarray]:
        """Velocities of the points in a step, and over the tool; and the slip.

        Both in the axes of the ply, shape (n, 3, n_nodes); the slip is in the axes of
        the tool, (3, n_nodes).
        """
        x, over, local = [], [], []
        for first, last in course.around:
            dt = last[1] - first[1]
            x.append((self._positions(last[0]) - self._positions(first[0])) / dt)
            local.append(self._over(self._local(*last) - self._local(*first), p) / dt)
            over.append(self._placement(first[1])[0] @ local[-1])
        return np.array(x), np.array(over), course.sum(np.array(local))

    def stored(self, u: ndarray, t: float, p: Values) -> float:
        """Energy of the elastic slips, Σ b h of their lengths, in N·mm."""
        _, size = self._slipped(u, t, p)
        return float(p["bound"] @ self._height(np.minimum(size, self.slip)))

    def forces(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Derivative of the energy by the contact points in N, shape (n_nodes, 3)."""
        return (self._placement(t)[0] @ self._force(u, t, p)).T

    def stiffness(self, u: ndarray, t: float, p: Values) -> ndarray:
        """Its derivative with σ, in N/mm, shape (3, 3, n_nodes)."""
        y, size = self._slipped(u, t, p)
        slides, m = size > self.slip, y / np.maximum(size, TINY)
        sigma = np.where(slides, _bounded(p["predicted"], p["bound"]), 0)
        n = p["normal"]
        along = np.eye(3)[:, :, None] - n[:, None] * n
        turned = sigma[:, None] * m
        K = p["bound"] * along - 0.5 * (turned + turned.swapaxes(0, 1))
        rotation, _ = self._placement(t)
        K = K / np.maximum(size, self.slip)
        return np.einsum("ai,ijn,bj->abn", rotation, K, rotation)

    def _force(self, u: ndarray, t: float, p: Values) -> ndarray:
        y, size = self._slipped(u, t, p)
        return p["bound"] * y / np.maximum(size, self.slip)

    def _slipped(self, u: ndarray, t: float, p: Values) -> tuple[ndarray, ndarray]:
        """Slip y and its magnitude in mm."""
        moved = self._over(self._local(u, t) - p["slips_from"], p)
        moved = self._tangential(moved, p)
        y = self._elastic(p) + moved
        return y, np.linalg.norm(y, axis=0)

    def _elastic(self, p: Values) -> ndarray:
        """Elastic slip ε s/b at the last state."""
        shear, bound = self._tangential(p["shear"], p), p["bound"]
        return self.slip * _bounded(shear, bound) / np.where(bound > 0, bound, 1.0)

    def _height(self, size: ndarray) -> ndarray:
        """Huber's function h of the magnitude of a slip."""
        elastic = np.minimum(size, self.slip)
        return elastic**2 / (2 * self.slip) + size - elastic

    def _local(self, u: ndarray, t: float) -> ndarray:
        rotation, translation = self._placement(t)
        return rotation.T @ (self._positions(u) - translation[:, None])

    def _tangential(self, x: ndarray, p: Values) -> ndarray:
        return x - p["normal"] * (p["normal"] * x).sum(axis=0)


def _bounded(force: ndarray, bound: ndarray) -> ndarray:
    """Forces, shape (3, n), shortened to the bound."""
    size = np.linalg.norm(force, axis=0)
    return force * np.minimum(1.0, bound / np.maximum(size, TINY))
