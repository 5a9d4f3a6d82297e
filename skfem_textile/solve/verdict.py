"""Acceptance checks of a converged equilibrium.

A converged iteration may have found a saddle point of the energy, folded elements, or
an equilibrium off the load path.

Stabilisation and deviations from the mean stretch belong to the discretisation, not to
the fabric.  Their shares are computed in the energy, in the work of reactions and loads
during a step, and in the nodal forces that make up a reaction.  The force that drives
an edge is the derivative of the energy: the share of the work is the share of that
force, wherever in the ply it arises.  Nodal forces depend only on the elements along
the edge.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import chain, pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray

from ..mesh.user_input import printable
from ..ply.amount import SAME
from ..ply.parameters import PlyParameters
from ..ply.terms import ContactTerm
from . import active_set
from .conditions import plain, turned
from .direction import TINY
from .problem import EPSILON, HOLD, ROUNDINGS, Evaluation, Problem
from .states import Equilibrium, NoEquilibriumError, State, Verdict

#: Names of the checks, cheap ones first.
CHECKS = (
    *("folding", "crease", "strain", "stability", "work"),
    *("stabilisation", "deviation", "corners", "surface", "slack"),
)

# Motion of a support, relative to the largest displacement, that is round-off.
_ROUND_OFF = 64 * EPSILON

#: Number of velocities of a motion between two load factors at which it bends, a limit
#: of work.  They do not depend on the number of turns in between.
WITHIN_STEP = 8

# Interval over which velocities are differences, relative to the one between two bends.
_APART = 1e-5

_STIFFER = "more steps, or a larger stabilisation"

# Relative energy error of the trapezoidal rule above which a step is reported.  A
# smaller value reports coarse steps that end correctly; a larger one misses jumps.
_MISSED_WORK = 0.01

# Roles of `Ply.parts` that belong to the discretisation, and their names in warnings.
_ROLES = {
    "stabilisation": "the stabilisation contributes",
    "deviation": "deviations from the mean stretch contribute",
}

# Limits of the shares of energy and work, and of the nodal forces of a reaction, above
# which there is a warning.  Measured by `pytest tests/solve/test_shares.py`: ordinary
# runs stay below both, and at a tenth of the energy the load is more than a tenth too
# large.
_MOST, _MOST_OF_REACTION = {"energy": 0.1, "work": 0.1}, 0.25

# Energy share of the corner resistance above which there is a warning.  A smaller limit
# warns of corners that change no result; a larger one misses corners that do.
_CORNER_SHARE = 0.01

# Gap between an element and its surface, relative to its longest edge, above which the
# mesh does not resolve the surface: the gap of an arc of one radian, or of a square on
# a sphere with sides of half the radius.  Measured: at a fillet with a radius of one
# element size it is 0.13 to 0.15, with twice that radius 0.08 to 0.09 (`pytest
# tests/scenes/drape/test_between_nodes.py`).
_GAP = 0.125


# Depth of held nodes in a tool between two states, relative to the size of an element,
# up to which it passes them by: contact points are 0.04 of an element below the nodes
# at a fillet with three elements around 90°.
_GRAZED = 0.05

# Fibre strain below which a fibre counts as folded up: that at which a linear law is
# refused too.  A sinusoidal wrinkle of this length is as steep as 75°.
_FOLDED_UP = -1.0


@dataclass(frozen=True, eq=False)
class Course:
    """Motion of a ply within a step: supports by their conditions, the rest straight.

    Attributes
    ----------
    u, du, free
        Displacement at the start of the step, its change, and the change of the free
        unknowns alone, each (n_unknowns,).
    around
        Displacements and load factors just before and after the ones at which the
        motion is followed.
    weights
        Weights of the latter in integrals over the load factor, shape (n,).
    """

    u: ndarray
    du: ndarray
    free: ndarray
    around: list[tuple[tuple[ndarray, float], tuple[ndarray, float]]]
    weights: ndarray

    def sum(self, velocities: ndarray) -> ndarray:
        """Integral of velocities, shape (n, ...)."""
        return np.tensordot(self.weights, velocities, 1)

    def mean(self, velocities: ndarray) -> ndarray:
        """Mean of velocities, shape (n, ...)."""
        return self.sum(velocities) / self.weights.sum()

    def length(self, velocities: ndarray) -> ndarray:
        """Lengths of paths with velocities, shape (n, d, n_points)."""
        return self.sum(np.linalg.norm(velocities, axis=1))


@dataclass(eq=False, kw_only=True)
class Trial(Equilibrium):
    """Equilibrium to be checked.

    Attributes
    ----------
    problem
        The problem.
    start
        Last accepted state; None for a state before loading.
    energies, potentials
        Energy of the equilibrium in N·mm by term, and potentials of the loads.
    warnings
        Messages of failed checks that only warn, by name.
    converged
        True if updating the parameters at the equilibrium leaves it unchanged.
    energy_before
        Energy of the start in N·mm.
    """

    problem: Problem
    start: Evaluation | None
    energies: dict[str, float]
    potentials: dict[str, float]
    warnings: dict[str, str] = field(default_factory=dict)
    converged: bool = False
    energy_before: float = 0.0

    @classmethod
    def of(
        cls, problem: Problem, equilibrium: Equilibrium, start: Evaluation | None
    ) -> "Trial":
        """Create a trial; a start with other parameters is evaluated again."""
        u, p = equilibrium.u, equilibrium.parameters
        energies, potentials = problem.energies(u, p)
        energy_before = sum(start.energies.values()) if start else 0.0
        if start and not all(p[k].same_as(x) for k, x in start.parameters.items()):
            start = problem.at(start.load_factor).evaluation(start.u, p)
        return cls(
            **vars(equilibrium),
            problem=problem,
            start=start,
            energies=energies,
            potentials=potentials,
            energy_before=energy_before,
        )

    def after(self, start: Evaluation, parameters: PlyParameters) -> "Trial":
        """The same equilibrium after another start, and with other parameters."""
        mine = {one.name: getattr(self, one.name) for one in fields(Equilibrium)}
        equilibrium = Equilibrium(**{**mine, "parameters": parameters})
        trial = Trial.of(self.problem, equilibrium, start)
        trial.warnings, trial.converged = self.warnings, self.converged
        return trial

    @cached_property
    def move(self) -> ndarray:
        """Displacement in the step, shape (n_unknowns,); zero without a ``start``."""
        return self.u - self.start.u if self.start else np.zeros_like(self.u)

    @cached_property
    def missed_sliding(self) -> float:
        """Share of the work of sliding on tools that the step misses, see `Friction`.

        Zero without friction.
        """
        problem, u, p = self.problem, self.u, self.parameters
        t, course, missed = problem.load_factor, self._course, 0.0
        if course is None:
            return 0.0
        for x in problem.rubbing:
            at = u, t, x.forces(u, t, p[x.name])
            missed += x.friction.missed(p[x.name], course, *at)
        lost = problem.ply.energy_lost(u, t, p)
        counted = sum(lost[x.name] for x in problem.rubbing)
        return missed / max(missed + counted, TINY)

    @property
    def _course(self) -> "Course | None":
        """Motion within a step that may slide on tools; None for other ones."""
        problem, start, t = self.problem, self.start, self.problem.load_factor
        if start is None or not problem.rubbing or start.load_factor == t:
            return None
        supports, began = problem.constraints, start.load_factor
        bends = [x.load_factors for x in supports.amounts]
        bends += [x.load_factors for term in problem.rubbing for x in term.amounts]
        inner = {x for x in chain(*bends) if began + SAME < x < t - SAME}
        points, weights = np.polynomial.legendre.leggauss(WITHIN_STEP)
        around, every = list[Any](), list[float]()
        before, moves = (turned(x, supports.turn) for x in (start.u, self.move))

        def at(s: float) -> tuple[ndarray, float]:
            q = before + (s - began) / (t - began) * moves
            q[supports.prescribed] = supports.fixed_values(s)
            return plain(q, supports.turn), s

        for first, last in pairwise([began, *sorted(inner), t]):
            half = 0.5 * (last - first)
            middles = first + half * (1 + points)
            near = half * _APART
            around += [(at(s - near), at(s + near)) for s in middles.tolist()]
            every += (half * weights).tolist()
        free = moves.copy()
        free[supports.prescribed] = 0.0
        free = plain(free, supports.turn)
        return Course(start.u, self.move, free, around, np.array(every))

    @property
    def misses_sliding(self) -> bool:
        """True if this share is above the limit."""
        return self.missed_sliding > _MISSED_WORK

    @property
    def crosses_outline(self) -> bool:
        """True if nodes cross the outline of a tool in a step that is too long."""
        u, t, p = self.u, self.problem.load_factor, self.parameters
        return any(x.crosses_outline(u, t, p[x.name]) for x in self.problem.contacts)

    @property
    def waits_for_tools(self) -> bool:
        """True if the ply is still undeformed, because no tool has reached it."""
        size = float(np.ptp(self.problem.nodes, axis=1).max())
        moved = np.abs(self.u).max(initial=0.0)
        return bool(self.problem.contacts and moved <= active_set.CLOSED * size)

    @property
    def resultants(self) -> dict[str, tuple[ndarray, ndarray]]:
        """Force and travel of each tool and clamp, see `active_set.resultants`."""
        problem = self.problem
        if not (problem.contacts or problem.clamps):
            return {}
        return active_set.resultants(problem, self.u, self.parameters)

    @cached_property
    def area_ratio(self) -> ndarray:
        """Smallest area ratio of each element at its nodes and the fine points."""
        return self.problem.area_ratio(self.u)

    @cached_property
    def law_strain(self) -> ndarray:
        """Fibre strain that enters the tension law, see `Ply.law_strain`."""
        return self.problem.ply.law_strain(self.u)

    @cached_property
    def mesh_strain(self) -> ndarray:
        """Fibre strain at the fine points, shape (2, n_elements, n_points)."""
        ply = self.problem.ply
        return ply.fibre_strain(self.u, ply.fine_points)

    @cached_property
    def works(self) -> tuple[float, float]:
        """Work in N·mm of the forces at start and end of the step over its motion.

        These are the internal forces, which balance reactions and loads.
        """
        if self.start is None:
            return 0.0, 0.0
        load = self.problem.load(self.u, self.parameters)
        before, after = self.start.f + self.start.load, self.f + load
        return float(before @ self.move), float(after @ self.move)

    @cached_property
    def shares(self) -> dict[str, dict[str, float]]:
        """Shares of stabilisation and deviations, from 0 to 1, see `State.shares`.

        A total is the sum of the magnitudes of its parts (for a reaction, at each of
        its nodes), and at least the error due to the tolerance of the equilibrium.
        """
        problem, u = self.problem, self.u
        state = u, problem.load_factor, self.parameters
        parts = problem.clock.time("assembly", problem.ply.parts, *state)
        roles, *columns = zip(*parts, strict=True)
        energies, forces = map(np.array, columns)
        of_role = np.array([[x == role for x in roles] for role in _ROLES], dtype=float)
        work = (forces * self.move).sum(axis=1)
        force = self.tolerance
        # Parts of each total, shape (n_parts, n_components, n_nodes), and its lower
        # bound.
        wholes = {
            "energy": (energies[:, None, None], force * np.abs(u).sum()),
            "work": (work[:, None, None], force * np.abs(self.move).sum()),
        }
        fixed = np.array([problem.nodal(f - problem.unfixed(f, u)) for f in forces])
        for name, nodes in problem.constraints.nodes.items():
            wholes[f"{name}_reaction"] = fixed[..., nodes], force * len(nodes)
        shares: dict[str, dict[str, float]] = {}
        for name, (x, least) in wholes.items():
            total = max(float(np.sqrt((x**2).sum(axis=1)).sum()), least, TINY)
            by_role = np.sqrt(((of_role @ x.sum(axis=2)) ** 2).sum(axis=1)) / total
            shares[name] = dict(zip(_ROLES, by_role.tolist(), strict=True))
        return shares

    def apply_checks(self, warn_only: Collection[str]) -> None:
        """Apply all checks; failures of those in ``warn_only`` become ``warnings``.

        Raises an error if an energy is not finite, a law is evaluated beyond its
        domain, or another check fails.
        """
        for name, energy in (*self.energies.items(), *self.potentials.items()):
            if not np.isfinite(energy):
                raise NoEquilibriumError(
                    f"the energy of {name} is not finite",
                    advice="a smaller load, or a law that is finite there",
                )
        problem, start, u = self.problem, self.start, self.u
        for tool in problem.contacts:
            if start is None:
                break
            passed = tool.passed(start.u, start.load_factor, u, problem.load_factor)
            if not passed.size:
                passed = _grazed(problem, tool, start.load_factor)
            if passed.size:
                raise NoEquilibriumError(
                    f"{passed.size} node(s) passed through tool {tool.name!r}, the "
                    f"first is node {passed[0]}",
                    advice="more steps",
                )
        if problem.clamps:
            from .clamp_release import refuse_overload

            refuse_overload(problem, u, self.parameters)
        if not problem.in_domain(u, self.parameters):
            raise problem.beyond(
                *(u, "a law is evaluated outside its domain"),
                "a smaller load, or a law that is defined there",
            )
        checks = (
            *(_element_checks, _energy_checks, _discretisation_checks),
            *((_surface_check,) if problem.surfaces else ()),
            _slack_check,
        )
        for name, failure in chain.from_iterable(check(self) for check in checks):
            if name not in warn_only:
                raise failure
            self.warnings[name] = str(failure)

    def next_start(self) -> Evaluation:
        """Evaluation from which the next step starts, with advanced parameters."""
        problem, u, p, tangent = self.problem, self.u, self.parameters, self.tangent
        t = problem.load_factor
        advanced = problem.ply.advanced(p, u, t)
        if advanced is not p:
            return problem.evaluation(u, advanced, tangent)
        load = problem.load(u, p)
        return Evaluation(t, u, self.f, load, self.energies, p, tangent)

    def state(self, linear_solves: int) -> State:
        """The state, after a number of linear solves since the previous one."""
        problem, u, tangent = self.problem, self.u, self.tangent
        ply = problem.ply
        u.flags.writeable = False  # the run continues from it
        work = 0.5 * sum(self.works)
        if self.start and self.start.load_factor == problem.load_factor:
            # Clamps let go, with the energy lost in the energies, or conditions ended.
            work = sum(self.energies.values()) - self.energy_before
        moved, nodes = problem.nodal(u), problem.constraints.nodes.items()
        tools = self.resultants
        pushed = {name: force for name, (force, _) in tools.items()}
        return State(
            load_factor=problem.load_factor,
            u=u,
            reactions=problem.reactions(self.f, u) | pushed,
            forces=problem.forces(self.f) | pushed,
            displacements={name: moved[:, n].mean(axis=1) for name, n in nodes}
            | {name: travel for name, (_, travel) in tools.items()},
            energies=dict(self.energies),
            potentials=dict(self.potentials),
            shares=self.shares,
            verdict=Verdict(
                negative_pivots=tangent.negative_pivots if tangent else None,
                min_det_F=float(self.area_ratio.min()),
                max_fibre_strain=float(np.abs(self.law_strain).max()),
                mesh_fibre_strain=float(np.abs(self.mesh_strain).max()),
                work=work,
            ),
            linear_solves=linear_solves,
            residuals=self.residuals,
            tolerance=self.tolerance,
            parameters=self.parameters,
            warnings=dict(self.warnings),
            energy_lost=ply.energy_lost(u, problem.load_factor, self.parameters),
        )


def _grazed(problem: Problem, tool: ContactTerm, began: float) -> ndarray:
    """Numbers of held nodes that are inside a tool between two states.

    Their motion is known, so that a tool must not even graze them on its way.
    """
    supports, t = problem.constraints, problem.load_factor
    prescribed = np.zeros(problem.ply.basis.N, dtype=bool)
    prescribed[supports.prescribed] = True
    held = np.flatnonzero(problem.nodal(prescribed).all(axis=0))
    if not held.size or began == t:
        return held[:0]
    element, q = problem.element_size, np.zeros(prescribed.size)
    far = float(np.linalg.norm(tool.travel(t) - tool.travel(began)))
    depth = []
    for s in np.linspace(began, t, WITHIN_STEP + int(2 * far / element)):
        q[supports.prescribed] = supports.fixed_values(s)
        x = problem.nodal(plain(q, supports.turn))[:, held]
        x[:2] += problem.nodes[:, held]
        depth.append(-tool.gaps_at(x, s))
    ends = np.maximum(np.maximum(depth[0], depth[-1]), 0.0)
    return held[np.max(depth, axis=0) > ends + _GRAZED * element]


#: Name and error of each check that fails.
_Failures: TypeAlias = Iterator[tuple[str, NoEquilibriumError]]


def _element_checks(trial: Trial) -> _Failures:
    """Folded elements, creases between neighbours, and excessive fibre strain."""
    ply, u, ratio = trial.problem.ply, trial.u, trial.area_ratio
    folded = np.flatnonzero(~(ratio > 0))
    if folded.size:
        error = NoEquilibriumError(
            f"{folded.size} element(s) folded; the smallest det F is {ratio.min():.2g}",
            folded,
            advice="a larger stabilisation, a less distorted mesh or a smaller load",
        )
        yield "folding", error
    creased = ply.creased(u)
    if creased.size:
        error = NoEquilibriumError(
            f"{creased.size} element(s) are inclined by more than a right angle to a "
            "neighbour, a crease that the mesh cannot resolve",
            creased,
            advice="a finer mesh, or a smaller load",
        )
        yield "crease", error
    torn = np.flatnonzero(ply.beyond_peak(trial.mesh_strain))
    if torn.size:
        strain = np.abs(trial.mesh_strain[:, torn])
        warp, weft = strain.max(axis=(1, 2))
        error = NoEquilibriumError(
            f"the fibre strain reaches {strain.max():.2g} in {torn.size} element(s), "
            "beyond the maximum of the fibre force",
            torn,
            "a smaller load",
            "weft_strain" if weft > warp else "warp_strain",
        )
        yield "strain", error


def _slack_check(trial: Trial) -> _Failures:
    """Fibres without resistance to compression that shorten to a fraction."""
    strain = trial.law_strain.min(axis=(0, 2))
    short = np.flatnonzero(strain < _FOLDED_UP)
    if short.size:
        error = NoEquilibriumError(
            f"slack fibres shorten to {np.exp(strain.min()):.2g} of their length in "
            f"{short.size} element(s), where det F falls to "
            f"{trial.area_ratio[short].min():.2g}: the fabric would fold up there, "
            "which the ply does not represent",
            short,
            "a smaller load, or a law with a stiffness in compression",
        )
        yield "slack", error


def _energy_checks(trial: Trial) -> _Failures:
    """Stability, and agreement of the energy with the work done in the step.

    Both are computed for the motion alone, at a fixed load factor, because the energy
    may also change with the load factor.
    """
    problem, tangent, start = trial.problem, trial.tangent, trial.start
    if tangent is None or tangent.negative_pivots is None:
        if not trial.waits_for_tools:
            advice = HOLD if problem.contacts else _STIFFER
            yield "stability", problem.singular(" at the equilibrium", advice)
    elif tangent.negative_pivots:
        error = NoEquilibriumError(
            f"unstable equilibrium: {tangent.negative_pivots} negative pivot(s)",
            problem.around(tangent.softest()),
            advice=_STIFFER,
        )
        yield "stability", error
    if start is None:
        return
    before, works = start.energies, trial.works
    if problem.ply.follows_load_factor:
        state = start.u, start.parameters
        before, _ = problem.energies(*state)
        f = problem.residual(*state) + problem.load(*state)
        works = float(f @ trial.move), works[1]
    rise = sum(trial.energies.values()) - sum(before.values())
    low, high = sorted(works)
    margin = _MISSED_WORK * max(abs(low), abs(high), abs(rise))
    margin += trial.tolerance * float(np.abs(trial.move).sum())
    off = max(low - rise, rise - high) - margin
    if not off <= 0 and not off <= _round_off(trial):
        error = NoEquilibriumError(
            f"the energy changed by {rise:.3g} N·mm, but the work of the forces at "
            f"the ends of the step is {low:.3g} to {high:.3g} N·mm: the step is too "
            "long, or the ply jumped to another equilibrium"
        )
        yield "work", error
    if trial.misses_sliding:
        error = NoEquilibriumError(
            f"the motion turns within the step: {trial.missed_sliding:.0%} of the work "
            "of friction on tools is missed, because friction is opposite to the whole "
            "slip in a step",
            advice="more steps, one of which ends where the motion turns back",
        )
        yield "work", error


def _round_off(trial: Trial) -> float:
    """Round-off of the difference of two energies, in N·mm.

    Rounding changes stretches as in `Tangent.round_off`, and so each energy by the work
    of the internal forces over an expansion of the ply.  A ply under tension stores far
    less energy than this work.  The quadratic energy of bending has the round-off of
    nodal forces times the displacement, even of a rigid motion.
    """
    problem, u, tangent = trial.problem, trial.u, trial.tangent
    forces = problem.nodal(trial.f + problem.load(u, trial.parameters))
    x = problem.nodal(u).copy()
    x[:2] += problem.nodes
    x -= x.mean(axis=1, keepdims=True)
    work = (np.linalg.norm(forces, axis=0) * np.linalg.norm(x, axis=0)).sum()
    of_forces = tangent.round_off(u) if tangent else 0.0
    return 2 * ROUNDINGS * EPSILON * float(work) + of_forces * float(np.abs(u).sum())


def _discretisation_checks(trial: Trial) -> _Failures:
    """Shares of stabilisation and deviations, and resistance of corners."""
    cure = (
        "refine the mesh; if the stabilisation is given as a number, reduce it"
        if "shear" in trial.energies
        else "the fabric has no shear stiffness, so specify one"
    )
    supports = _point_supports(trial.problem, trial.u)
    for role, beginning in _ROLES.items():
        if carried := excess(trial.shares, role, supports):
            yield role, NoEquilibriumError(f"{beginning} {carried}: {cure}")
    corners = trial.energies.get("corners", 0.0)
    total = abs(sum(trial.energies.values()))
    if corners > _CORNER_SHARE * total:
        error = NoEquilibriumError(
            f"the corner resistance contributes {corners / total:.0%} of the energy; "
            "refine the mesh there, or increase the stabilisation"
        )
        yield "corners", error


def _surface_check(trial: Trial) -> _Failures:
    """Elements that deviate from their surface between nodes."""
    problem, basis = trial.problem, trial.problem.ply.basis
    assert problem.surfaces
    try:
        gaps = problem.surfaces.gaps(trial.u, problem.load_factor, basis)
    except NoEquilibriumError as failure:  # raised by a user's surface
        yield "surface", failure
        return
    off = np.flatnonzero(gaps.share > _GAP)
    if off.size:
        area = basis.dx.sum(axis=1)
        share = 100 * area[off].sum() / area.sum()
        worst = off[gaps.share[off].argmax()]
        place = problem.surfaces.place(gaps.position[:, worst])
        error = NoEquilibriumError(
            f"{off.size} element(s), {share:.2g} % of the area, deviate from the "
            f"surface between nodes, by up to {gaps.gap[worst]:.2g} mm at {place}: "
            "the elements are large compared with the radius of the surface; refine "
            "the mesh there",
            off,
        )
        yield "surface", error


def _point_supports(problem: Problem, u: ndarray) -> list[str]:
    """Conditions on a single node, fixed at its initial position or on a surface.

    The node may move with a growing surface.  Shares of their reactions depend only on
    the elements around the node.
    """
    constraints = problem.constraints
    values = np.abs(turned(u, constraints.turn)[constraints.prescribed])
    moved = constraints.prescribed[values > _ROUND_OFF * np.abs(u).max(initial=0.0)]
    moved_nodes = moved // len(problem.nodal(u))
    if problem.surfaces:
        moved_nodes = np.setdiff1d(moved_nodes, problem.surfaces.nodes)
    return [
        name
        for name, nodes in constraints.nodes.items()
        if len(nodes) == 1 and nodes[0] not in moved_nodes
    ]


def excess(
    shares: Mapping[str, Mapping[str, float]], role: str, supports: Collection[str] = ()
) -> str:
    """Message on the shares of a role that exceed their limits; empty if none do.

    The role is ``stabilisation`` or ``deviation``.  Reactions of the conditions
    ``supports`` are excluded.
    """
    passed = {f"{name}_reaction" for name in supports}
    return ", ".join(
        f"{share[role]:.0%} of {printable(total)}"
        for total, share in shares.items()
        if total not in passed and share[role] > _MOST.get(total, _MOST_OF_REACTION)
    )
