"""What is asked of an equilibrium before it counts as an answer.

An iteration that balances the forces may have found a saddle point of the energy,
folded elements, or an equilibrium that the load does not lead to.
"""

from collections.abc import Callable, Collection, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from .body import Parameters
from .problem import Start, Tangent, between, turned
from .states import Equilibrium, NoEquilibriumError, State, Verdict
from .stepping.shares import excess, shares

if TYPE_CHECKING:
    from .problem import Problem

_STIFFER = "more steps, or a larger stabilisation"

# Share of the energy that the trapezoidal rule may miss before a step stands out.  A
# smaller share marks coarse steps that end right; a larger one passes over jumps.
_MISSED_WORK = 0.01

# Of the energies of two states, what round-off leaves of their difference.
_ROUND_OFF = 64 * 2.0**-53

# Share of the energy that corners which resist may hold unremarked.  A smaller share
# warns of corners that change no figure; a larger one hides corners that do.
_CORNER_SHARE = 0.01

# Gap between an element and its surface, over its longest edge, from which a mesh does
# not follow the surface: of an arc that turns by a radian, or of a square on a sphere
# with sides of half the radius.  Measured: at a fillet with the radius of an element it
# is 0.13 to 0.15, with twice that radius 0.08 to 0.09
# (`pytest tests/drape/corners/test_between_nodes.py`).
_GAP = 0.125


class Trial:
    """An equilibrium that is judged.

    Parameters
    ----------
    problem
        The problem.
    equilibrium
        The equilibrium.
    start
        The last good state; None for a state before the load.
    energies, potentials
        Energy of the equilibrium in N·mm by term, and potentials of the loads.
    """

    def __init__(
        self,
        problem: "Problem",
        equilibrium: Equilibrium,
        start: Start | None = None,
        energies: Mapping[str, float] | None = None,
        potentials: Mapping[str, float] | None = None,
    ) -> None:
        self.problem, self.equilibrium = problem, equilibrium
        self.start = start
        self.energies, self.potentials = energies or {}, potentials or {}
        self.warnings: dict[str, str] = {}

    @property
    def tangent(self) -> Tangent | None:
        """The consistent tangent; None where it is singular."""
        return self.equilibrium.tangent

    @cached_property
    def area_ratio(self) -> ndarray:
        """Smallest area ratio of each element at its nodes and the fine points."""
        return self.problem.least_area_ratio(self.equilibrium.u)

    @cached_property
    def strains(self) -> ndarray:
        """Fibre strain at the ply's fine points, shape (2, n_elements, n_points)."""
        ply = self.problem.ply
        return ply.fibre_strain(self.equilibrium.u, ply.fine_points)

    @property
    def strain(self) -> ndarray:
        """Largest magnitude of the fibre strain of each element."""
        return np.abs(self.strains).max(axis=(0, 2))

    @property
    def move(self) -> ndarray:
        """Displacement in the step."""
        return self.equilibrium.u - self.start.u if self.start else np.zeros(1)

    @cached_property
    def works(self) -> tuple[float, float]:
        """Work that the internal forces at either end of the step do in it.

        They balance reactions and loads.
        """
        start, end = self.start, self.equilibrium
        if start is None:
            return 0.0, 0.0
        load = self.problem.load(end.u, end.parameters)
        forces = start.f + start.load, end.f + load
        before, after = (float(f @ self.move) for f in forces)
        return before, after

    @property
    def of_move(self) -> tuple[float, tuple[float, float]]:
        """Rise of the energy and `works` of the move alone, the load factor held.

        In N·mm.  The energy may change with the load factor too.
        """
        problem, start, works = self.problem, self.start, self.works
        if start is None:
            return 0.0, works
        before = start.energies
        if problem.ply.follows_load_factor:
            place = start.u, start.parameters
            before, _ = problem.energies(*place)
            f = problem.residual(*place) + problem.load(*place)
            works = float(f @ self.move), works[1]
        return sum(self.energies.values()) - sum(before.values()), works

    @cached_property
    def shares(self) -> dict[str, dict[str, float]]:
        """What the discretisation carries of energy, work and reactions: `shares`."""
        problem, u = self.problem, self.equilibrium.u
        place = u, problem.load_factor, self.equilibrium.parameters
        arguments = problem.ply.parts, *place
        parts = problem.clock.time("assembly", *arguments)
        held_forces = partial(problem.held_forces, u)
        return shares(parts, self.equilibrium, self.move, held_forces)

    @property
    def point_supports(self) -> list[str]:
        """Conditions of one node that is held where it was at rest, or on a surface.

        A surface that grows takes the node along.  How a force at a point spreads to
        the elements around it tells of these alone.
        """
        constraints, u = self.problem.constraints, self.equilibrium.u
        held = np.abs(turned(u, constraints.turn)[constraints.prescribed])
        moved = constraints.prescribed[held > _ROUND_OFF * np.abs(u).max(initial=0.0)]
        moved_nodes = moved // len(self.problem.ply.nodal(u))
        if surfaces := self.problem.surfaces:
            moved_nodes = np.setdiff1d(moved_nodes, surfaces.nodes)
        return [
            name
            for name, nodes in constraints.nodes.items()
            if len(nodes) == 1 and nodes[0] not in moved_nodes
        ]

    def carried(self, role: str) -> str:
        """Words for what a role carries too much of; empty if there is nothing."""
        return excess(self.shares, role, self.point_supports)

    def apply_checks(self, warn_only: Collection[str]) -> None:
        """Apply every check; ``warnings`` are what those in ``warn_only`` say.

        Raises
        ------
        NoEquilibriumError
            If an energy is not finite, or another check has a complaint.
        """
        for name, energy in (*self.energies.items(), *self.potentials.items()):
            if not np.isfinite(energy):
                raise NoEquilibriumError(
                    f"the energy of {name} is not finite",
                    advice="a smaller load, or a law that is finite there",
                )
        if not self.problem.in_domain(self.equilibrium.u, self.equilibrium.parameters):
            end = self.problem.ply.closest_end(self.equilibrium.u)
            raise NoEquilibriumError(
                "a law is asked beyond its domain" + (f": {end}" if end else ""),
                end.elements if end else (),
                "a smaller load, or a law that holds there",
                end.quantity if end else "",
            )
        for name, check in CHECKS.items():
            try:
                check(self)
            except NoEquilibriumError as complaint:
                if name not in warn_only:
                    raise
                self.warnings[name] = str(complaint)

    def next_start(self) -> Start:
        """The equilibrium as the start of a step, its parameters advanced."""
        problem, (u, f, parameters, *_) = self.problem, self.equilibrium
        t = problem.load_factor
        advanced = problem.ply.advanced(parameters, u, t)
        if advanced is not parameters:
            return problem.start(u, advanced, self.tangent)
        load = problem.load(u, parameters)
        return Start(t, u, f, load, self.energies, parameters, self.tangent)

    def start_with(self, parameters: Parameters, share: float) -> Start:
        """The equilibrium as a start, a share of the way to other parameters."""
        u, old = self.equilibrium.u, self.equilibrium.parameters
        if share < 1.0:
            parameters = between(old, parameters, share)
        return self.problem.start(u, parameters, self.tangent)

    def verdict(self) -> Verdict:
        """What was found."""
        ply = self.problem.ply
        return Verdict(
            negative_pivots=self.tangent.negative_pivots if self.tangent else None,
            min_det_F=float(self.area_ratio.min()),
            max_fibre_strain=float(np.abs(ply.law_strain(self.equilibrium.u)).max()),
            mesh_fibre_strain=float(self.strain.max()),
            work=0.5 * sum(self.works),
        )

    def state(self, load_factor: float, linear_solves: int) -> State:
        """The state that it becomes.

        Parameters
        ----------
        load_factor
            Load factor.
        linear_solves
            Linear solves since the state before.
        """
        problem, equilibrium = self.problem, self.equilibrium
        return State(
            load_factor=load_factor,
            u=equilibrium.u,
            reactions=problem.reactions(equilibrium.f),
            displacements=problem.displacements(equilibrium.u),
            energies=dict(self.energies),
            potentials=dict(self.potentials),
            shares=self.shares,
            verdict=self.verdict(),
            linear_solves=linear_solves,
            residuals=equilibrium.residuals,
            tolerance=equilibrium.tolerance,
            parameters=equilibrium.parameters,
        )


def _folding(trial: Trial) -> None:
    folded = np.flatnonzero(~(trial.area_ratio > 0))
    if folded.size:
        raise NoEquilibriumError(
            f"{folded.size} element(s) folded, det F down to "
            f"{trial.area_ratio.min():.2g}",
            folded,
            advice="a larger stabilisation, a less distorted mesh or a smaller load",
        )


def _crease(trial: Trial) -> None:
    creased = trial.problem.ply.creased(trial.equilibrium.u)
    if creased.size:
        raise NoEquilibriumError(
            f"{creased.size} element(s) turn by more than a right angle against a "
            "neighbour, a crease that no mesh resolves",
            creased,
            advice="a finer mesh, or a smaller load",
        )


def _strain(trial: Trial) -> None:
    torn = np.flatnonzero(trial.problem.ply.past_peak(trial.equilibrium.u))
    if torn.size:
        warp, weft = np.abs(trial.strains[:, torn]).max(axis=(1, 2))
        raise NoEquilibriumError(
            f"fibre strain up to {trial.strain[torn].max():.2g} in {torn.size} "
            "element(s), past the largest force of a fibre",
            torn,
            "a smaller load",
            "weft_strain" if weft > warp else "warp_strain",
        )


def _stability(trial: Trial) -> None:
    tangent = trial.tangent
    if tangent is None or tangent.negative_pivots is None:
        raise NoEquilibriumError(
            "an equilibrium, but some motion meets no stiffness", advice=_STIFFER
        )
    if tangent.negative_pivots:
        raise NoEquilibriumError(
            f"an equilibrium, but not stable: {tangent.negative_pivots} negative "
            "pivot(s)",
            trial.problem.around(tangent.softest()),
            advice=_STIFFER,
        )


def _work(trial: Trial) -> None:
    if trial.start is None:
        return
    rise, works = trial.of_move
    low, high = sorted(works)
    margin = _MISSED_WORK * max(abs(low), abs(high), abs(rise))
    margin += trial.equilibrium.tolerance * float(np.abs(trial.move).sum())
    stored = (*trial.energies.values(), *trial.potentials.values())
    margin += _ROUND_OFF * sum(map(abs, stored))
    if not low - margin <= rise <= high + margin:
        raise NoEquilibriumError(
            f"the energy changed by {rise:.3g} N·mm, where the forces at the "
            f"two ends of the step do {low:.3g} to {high:.3g}: the step is long, or "
            "the ply went over to another equilibrium"
        )


def _stabilisation(trial: Trial) -> None:
    if carried := trial.carried("stabilisation"):
        raise NoEquilibriumError(f"the stabilisation carries {carried}: {_cure(trial)}")


def _deviation(trial: Trial) -> None:
    if carried := trial.carried("deviation"):
        raise NoEquilibriumError(
            f"deviations from the mean stretch carry {carried}: {_cure(trial)}"
        )


def _cure(trial: Trial) -> str:
    """What to do about what the discretisation carries."""
    if "shear" not in trial.energies:
        return "the fabric has no shear stiffness, give it one"
    return (
        "take a finer mesh; if you gave the stabilisation as a number, give a smaller "
        "one"
    )


def _corners(trial: Trial) -> None:
    held = trial.energies.get("corners", 0.0)
    whole = abs(sum(trial.energies.values()))
    if held > _CORNER_SHARE * whole:
        raise NoEquilibriumError(
            f"corners that resist before they close hold {held / whole:.0%} of the "
            "energy: the mesh is coarse there, or the stabilisation small"
        )


def _surface(trial: Trial) -> None:
    problem, surfaces = trial.problem, trial.problem.surfaces
    if surfaces is None:
        return
    basis = problem.ply.basis
    found = surfaces.gaps(trial.equilibrium.u, problem.load_factor, basis)
    off = np.flatnonzero(found.share > _GAP)
    if off.size:
        area = basis.dx.sum(axis=1)
        share = 100 * area[off].sum() / area.sum()
        worst = off[found.share[off].argmax()]
        place = ", ".join(f"{x:.3g}" for x in found.place[:, worst])
        raise NoEquilibriumError(
            f"{off.size} element(s), {share:.2g} % of the area, leave their surface "
            f"between nodes, by {found.gap[worst]:.2g} mm at ({place}): they are "
            "large against its radius there; take a finer mesh there",
            off,
        )


#: Checks of a state by name, the cheap ones first.
CHECKS: dict[str, Callable[[Trial], None]] = {
    "folding": _folding,
    "crease": _crease,
    "strain": _strain,
    "stability": _stability,
    "work": _work,
    "stabilisation": _stabilisation,
    "deviation": _deviation,
    "corners": _corners,
    "surface": _surface,
}
