"""The result of a run, and the error that ends one."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy import ndarray

from ..ply import Ply
from .conditions import Conditions
from .linear.solver import Choice
from .states import ErrorEstimate, State
from .surface import OnSurface, Surface

# States that a printed result lists at most.
_LINES = 11

# Elements that the message of an error names at most.
_ELEMENTS = 5

# Terms that every table has, in this order before others.
_TERMS = ("tension", "shear", "stabilisation", "corners")


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
        Linear solves and factorisations in all, abandoned steps included.
    steps_cut
        How often a step failed or was hard, and was halved.
    unresolved
        Load factors at which another number of steps may lead to another equilibrium.
    wall_time_s, assembly_time_s, solve_time_s
        Time of the run and its two largest parts; solutions include what ``auto`` took
        to find the fastest solver.
    solver
        Name of the linear solver, and why it was chosen.
    surfaces
        The conditions that keep nodes on surfaces, by name.
    estimate
        Finds the estimated error of a state of the ply.
    """

    ply: Ply
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
    surfaces: Mapping[str, OnSurface]
    estimate: Callable[[State], ErrorEstimate]

    @classmethod
    def of_state(cls, ply: Ply, conditions: Conditions, state: State) -> "Result":
        """The result of one state that no run has found, for pictures and files.

        Times and factorisations are 0, and its error is not estimated.

        Parameters
        ----------
        ply, conditions
            The ply and its conditions by name.
        state
            A state of it, as of `equilibrium_near`.
        """
        on = {k: c for k, c in conditions.items() if isinstance(c, OnSurface)}
        return cls(
            ply=ply,
            states=[state],
            converged=state.load_factor == 1.0,
            linear_solves=state.linear_solves,
            factorisations=0,
            steps_cut=0,
            unresolved=(),
            wall_time_s=0.0,
            assembly_time_s=0.0,
            solve_time_s=0.0,
            solver=Choice("none", "a state that no run has found"),
            surfaces=on,
            estimate=lambda _: ErrorEstimate(reason="no run has found the state"),
        )

    @property
    def path_resolved(self) -> bool:
        """Whether no step gave reason to doubt that more steps lead to the same end."""
        return not self.unresolved

    def tool(self, t: float) -> Surface | None:
        """The surface on which all nodes lie at a load factor, or None."""
        for name, condition in self.surfaces.items():
            if condition.where is None:
                return condition.at(name, t)
        return None

    @property
    def u(self) -> ndarray:
        """Displacement of the last converged state."""
        return self.states[-1].u

    @cached_property
    def estimated_error(self) -> ErrorEstimate:
        """The estimated error of the last state, computed at first use."""
        return self.estimate(self.states[-1])

    def history(self) -> list[dict[str, float | None]]:
        """One row per converged state, ready for a table.

        Columns: load_factor, linear_solves, residual (N), tolerance (N),
        negative_pivots, min_det_F, max_fibre_strain, mesh_fibre_strain; of each
        condition displacement_x and displacement_y, the mean over its nodes (mm), and
        reaction_x and reaction_y (N), in space with a z each; energy of the state in
        all and by term, potentials of the loads, and work of reactions and loads on the
        way (N·mm); shares of stabilisation and deviations in energy, work and
        reactions.
        """
        rows, work = [], 0.0
        for state in self.states:
            verdict = asdict(state.verdict)
            work += verdict.pop("work")
            row = {
                "load_factor": state.load_factor,
                "linear_solves": state.linear_solves,
                "residual": state.residuals[-1] if state.residuals else 0.0,
                "tolerance": state.tolerance,
                **verdict,
            }
            for name, reaction in state.reactions.items():
                vectors = {"displacement": state.displacements[name]}
                for what, vector in (vectors | {"reaction": reaction}).items():
                    components = zip("xyz", vector.tolist(), strict=False)
                    row |= {f"{name}_{what}_{axis}": x for axis, x in components}
            row |= _columns(state.shares) | _energies(state) | {"work": work}
            rows.append(row)
        return rows

    def summary(self) -> dict[str, str | int | float | bool | None]:
        """Figures of the last converged state and of the run, in N, mm and degrees.

        ``max_fibre_strain`` is the largest magnitude that the law of tension sees,
        ``max_fibre_tension`` and ``max_shear_angle_deg`` are those at the ply's own
        points.  ``mesh_fibre_strain`` is taken at the ply's fine points, the 2×2 points
        of quadrilaterals or six points of quadratic triangles, and ``min_det_F`` at
        the nodes of the elements too.  ``mesh_fibre_strain`` is a measure of the mesh,
        not of what fibres carry.

        ``estimated_load_error``, a share of the load, and
        ``estimated_shear_angle_error_deg`` tell what the mesh costs, as far as a finer
        one shows it (`estimated_error`).  ``error_estimate`` says how they were found;
        where both are None it begins with "none: " and says why.  A ply that a tool
        alone shapes has an error of the shear angle, and none of a load.
        """
        ply, u, state = self.ply, self.u, self.states[-1]
        verdict, shares, error = state.verdict, state.shares, self.estimated_error
        angle = error.shear_angle
        how = "none" if angle is None else "by a finer mesh"
        if error.reason:
            none = "" if angle is None else "; of the load none"
            how = f"{how}{none}: {error.reason}"
        tension = ply.fibre_tension(u, state.parameters)
        return {
            "formulation": ply.formulation.name,
            "n_elements": int(ply.mesh.nelements),
            "n_dofs": int(ply.basis.N),
            "converged": self.converged,
            "load_factor": state.load_factor,
            "load_steps": len(self.states) - 1,
            "steps_cut": self.steps_cut,
            "path_resolved": self.path_resolved,
            "linear_solves": self.linear_solves,
            "factorisations": self.factorisations,
            "stable": verdict.stable,
            "negative_pivots": verdict.negative_pivots,
            "min_det_F": verdict.min_det_F,
            **_energies(state),
            **_columns({of: shares[of] for of in ("energy", "work")}),
            "max_fibre_strain": verdict.max_fibre_strain,
            "mesh_fibre_strain": verdict.mesh_fibre_strain,
            "max_fibre_tension": float(np.abs(tension).max()),
            "max_shear_angle_deg": float(np.degrees(np.abs(ply.shear_angle(u)).max())),
            "estimated_load_error": error.load,
            "estimated_shear_angle_error_deg": (
                None if angle is None else float(np.degrees(angle))
            ),
            "error_estimate": how,
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
        for i in (chosen := np.unique(chosen)):
            state, verdict = self.states[i], self.states[i].verdict
            lines.append(
                f"{state.load_factor:11.4f}{state.linear_solves:12}"
                f"{sum(state.energies.values()):11.4g}"
                f"{verdict.max_fibre_strain:13.2e}{verdict.min_det_F:11.3f}"
                f"{'yes' if verdict.stable else 'no':>8}"
            )
        if left_out := len(self.states) - len(chosen):
            lines.append(f"          … {left_out} more states in between: see .states")
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
    quantity
        What is at the end of its law there, or past it: warp_strain, weft_strain or
        shear_angle; empty where nothing is.
    """

    def __init__(
        self, message: str, result: Result, elements: ndarray, quantity: str = ""
    ) -> None:
        super().__init__(message)
        self.result = result
        self.elements = elements
        self.quantity = quantity

    @classmethod
    def after(cls, error: Exception, result: Result) -> "StepError":
        """The error that ends a run, with what the run has found."""
        elements = getattr(error, "elements", np.empty(0, dtype=int))
        advice, state = getattr(error, "advice", ""), result.states[-1]
        lengths = {
            name: float(np.linalg.norm(u))
            for name, u in state.displacements.items()
            if name not in result.surfaces
        }
        name = max(lengths, key=lengths.__getitem__, default="")
        moved = (
            f" ({name} moved by {lengths[name]:.4g} mm)" if lengths.get(name) else ""
        )
        first = ", ".join(map(str, elements[:_ELEMENTS]))
        more = ", ..." if elements.size > _ELEMENTS else ""
        return cls(
            f"stopped at load factor {state.load_factor:.6g}{moved}: {error}"
            + (f" (element {first}{more})" if elements.size else "")
            + (f"; try {advice}" if advice else ""),
            result,
            elements,
            getattr(error, "quantity", ""),
        )


def _energies(state: State) -> dict[str, float]:
    """Internal energy in all and by term, and the potentials of loads."""
    names = dict.fromkeys((*_TERMS, *state.energies))
    by_term = {f"{term}_energy": state.energies.get(term, 0.0) for term in names}
    loads = {f"{load}_potential": value for load, value in state.potentials.items()}
    return {"energy": sum(state.energies.values())} | by_term | loads


def _columns(shares: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Shares of parts of the discretisation, by the names of their columns."""
    return {
        f"{whole}_share_of_{part}": share
        for whole, by_part in shares.items()
        for part, share in by_part.items()
    }
