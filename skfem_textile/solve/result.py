"""What a run of the load stepper tells on the way, and what it leaves behind."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy import ndarray

from .body import Body
from .linear import Choice

# States that a printed result lists at most.
_LINES = 11

#: Terms that every table has, in this order before others.
TERMS = ("tension", "shear", "stabilisation", "corners")


@dataclass(frozen=True)
class Verdict:
    """What was found of a state.

    Attributes
    ----------
    negative_pivots
        Negative eigenvalues of the consistent tangent; None where it is singular.
    min_det_F
        Smallest det F of the elements, at their nodes and at the ply's fine points: of
        quadrilaterals the 2×2 points, of quadratic triangles six points.
    max_fibre_strain
        Largest magnitude of the fibre strain that the law of tension sees.
    mesh_fibre_strain
        Largest magnitude of the fibre strain at the fine points, most of which no law
        sees: a measure of the mesh, not of what fibres carry.
    work
        Work of reactions and loads since the state before in N·mm (trapezoidal rule).
    """

    negative_pivots: int | None
    min_det_F: float
    max_fibre_strain: float
    mesh_fibre_strain: float
    work: float

    @property
    def stable(self) -> bool:
        """Whether every small motion costs energy."""
        return self.negative_pivots == 0


class Iteration(NamedTuple):
    """What ``on_iteration`` is told: an iteration on the way to a load factor.

    ``step`` is the length of the step, ``residual`` the largest free nodal force in N,
    which must fall below ``tolerance``.
    """

    load_factor: float
    step: float
    strategy: str
    number: int
    residual: float
    tolerance: float

    def __str__(self) -> str:
        return (
            f"load factor {self.load_factor:g}, {self.strategy} {self.number}: "
            f"{self.residual:.3g} N unbalanced, tolerance {self.tolerance:.3g} N"
        )


@dataclass(frozen=True, eq=False)
class State:
    """A converged state.

    Attributes
    ----------
    load_factor
        Load factor t in [0, 1]; the first state of a run, t = 0, is the
        undeformed ply.
    u
        Displacement, DOF vector of the ply's basis.
    reactions
        Force of the support on the ply in N, shape (2,), by condition: the sum
        over its nodes of the internal forces less the loads.
    displacements
        Mean displacement of the nodes of the condition in mm, shape (2,), by condition.
    energies
        Energy in N·mm by term, those of loads aside.
    linear_solves
        Linear solves since the state before, those of abandoned attempts included.
    residuals
        Largest free nodal force in N after each iteration of the last attempt.
    tolerance
        What the last of them had to fall below.
    verdict
        What was found of the state: stability, folding, strain and work.
    potentials
        Potential of each load in N·mm.
    """

    load_factor: float
    u: ndarray
    reactions: dict[str, ndarray]
    displacements: dict[str, ndarray]
    energies: dict[str, float]
    linear_solves: int
    residuals: tuple[float, ...]
    tolerance: float
    verdict: Verdict
    potentials: dict[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        stable = "stable" if self.verdict.stable else "not stable"
        return f"<State at load factor {self.load_factor:g}, {stable}>"


@dataclass(frozen=True, eq=False)
class Result:
    """Every converged state of a run, from the undeformed ply on.

    Attributes
    ----------
    ply
        The ply that was loaded.
    states
        Converged states in order of load factor.
    converged
        Whether the whole load was applied.
    linear_solves, factorisations
        Linear solves and factorisations in all, those of abandoned steps included.
    steps_cut
        How often a step failed or was hard, and was halved.
    unresolved
        Load factors at which another number of steps may lead to another equilibrium.
    wall_time_s, assembly_time_s, solve_time_s
        Time of the run and its two largest parts; solutions include what ``auto`` took
        to find the fastest solver.
    solver
        Name of the linear solver, and why it was chosen.
    """

    ply: Body
    states: list[State]
    converged: bool
    linear_solves: int
    factorisations: int
    steps_cut: int
    unresolved: tuple[float, ...]
    wall_time_s: float
    assembly_time_s: float
    solve_time_s: float
    solver: Choice

    @property
    def path_resolved(self) -> bool:
        """Whether no step gave reason to doubt that more steps lead to the same end."""
        return not self.unresolved

    @property
    def u(self) -> ndarray:
        """Displacement of the last converged state."""
        return self.states[-1].u

    def history(self) -> list[dict[str, float | None]]:
        """One row per converged state, ready for a table.

        Columns: load_factor, linear_solves, residual (N), tolerance (N),
        negative_pivots, min_det_F, max_fibre_strain, mesh_fibre_strain; of each
        condition displacement_x and displacement_y, the mean over its nodes (mm), and
        reaction_x and reaction_y (N); internal energy in all and by term, potentials
        of the loads, and work of reactions and loads so far (N·mm).
        """
        rows, work = [], 0.0
        for state in self.states:
            verdict = state.verdict
            work += verdict.work
            row = {
                "load_factor": state.load_factor,
                "linear_solves": state.linear_solves,
                "residual": state.residuals[-1] if state.residuals else 0.0,
                "tolerance": state.tolerance,
                "negative_pivots": verdict.negative_pivots,
                "min_det_F": verdict.min_det_F,
                "max_fibre_strain": verdict.max_fibre_strain,
                "mesh_fibre_strain": verdict.mesh_fibre_strain,
            }
            for name, reaction in state.reactions.items():
                row |= _components(f"{name}_displacement", state.displacements[name])
                row |= _components(f"{name}_reaction", reaction)
            rows.append(row | _energies(state) | {"work": work})
        return rows

    def summary(self) -> dict[str, str | int | float | bool | None]:
        """Figures of the last converged state and of the run, in N, mm and degrees.

        ``max_fibre_strain`` is the largest magnitude that the law of tension sees,
        ``max_fibre_tension`` and ``max_shear_angle_deg`` are those at the ply's own
        points.  ``mesh_fibre_strain`` is taken at the ply's fine points, the 2×2 points
        of quadrilaterals or six points of quadratic triangles, and ``min_det_F`` at
        the nodes of the elements too.  ``mesh_fibre_strain`` is a measure of the mesh,
        not of what fibres carry.
        """
        ply, u, verdict = self.ply, self.u, self.states[-1].verdict
        return {
            "formulation": ply.formulation.name,
            "n_elements": int(ply.mesh.nelements),
            "n_dofs": int(ply.basis.N),
            "converged": self.converged,
            "load_factor": self.states[-1].load_factor,
            "load_steps": len(self.states) - 1,
            "steps_cut": self.steps_cut,
            "path_resolved": self.path_resolved,
            "linear_solves": self.linear_solves,
            "factorisations": self.factorisations,
            "stable": verdict.stable,
            "negative_pivots": verdict.negative_pivots,
            "min_det_F": verdict.min_det_F,
            **_energies(self.states[-1]),
            "max_fibre_strain": verdict.max_fibre_strain,
            "mesh_fibre_strain": verdict.mesh_fibre_strain,
            "max_fibre_tension": _largest(ply.fibre_tension(u)),
            "max_shear_angle_deg": float(np.degrees(_largest(ply.shear_angle(u)))),
            "wall_time_s": self.wall_time_s,
            "assembly_time_s": self.assembly_time_s,
            "solve_time_s": self.solve_time_s,
            "solver": self.solver.name,
            "solver_reason": self.solver.reason,
        }

    def __repr__(self) -> str:
        end = "converged" if self.converged else "stopped early"
        return (
            f"<Result: {end} at load factor {self.states[-1].load_factor:g}, "
            f"{len(self.states) - 1} steps, {self.linear_solves} linear solves>"
        )

    def __str__(self) -> str:
        """A compact table of the states, evenly chosen where they are many."""
        lines = ["load factor      solves     energy fibre strain  min det F  stable"]
        chosen = np.linspace(0, len(self.states) - 1, _LINES).round().astype(int)
        for i in np.unique(chosen):
            state, verdict = self.states[i], self.states[i].verdict
            lines.append(
                f"{state.load_factor:11.4f}{state.linear_solves:12}"
                f"{sum(state.energies.values()):11.4g}"
                f"{verdict.max_fibre_strain:13.2e}{verdict.min_det_F:11.3f}"
                f"{'yes' if verdict.stable else 'no':>8}"
            )
        return "\n".join([*lines, repr(self)[1:-1]])


class StepError(RuntimeError):
    """No acceptable state was found.

    Attributes
    ----------
    result
        Every state before, the last good one included.
    elements
        Numbers of the elements where the last attempt failed; empty where no one
        place is to blame.
    """

    def __init__(self, message: str, result: Result, elements: ndarray) -> None:
        super().__init__(message)
        self.result = result
        self.elements = elements


def _energies(state: State) -> dict[str, float]:
    """Internal energy in all and by term, and the potentials of loads."""
    names = dict.fromkeys((*TERMS, *state.energies))
    by_term = {f"{term}_energy": state.energies.get(term, 0.0) for term in names}
    loads = {f"{load}_potential": value for load, value in state.potentials.items()}
    return {"energy": sum(state.energies.values())} | by_term | loads


def _components(name: str, vector: ndarray) -> dict[str, float]:
    x, y = vector.tolist()
    return {f"{name}_x": x, f"{name}_y": y}


def _largest(x: ndarray) -> float:
    return float(np.abs(x).max())
