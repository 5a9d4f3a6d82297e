"""What a run of the load stepper leaves behind."""

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from .elements import GAUSS
from .ply import Ply

TERMS = ("tension", "shear", "stabilisation")


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
        of the internal forces over the nodes of the condition.
    energies
        Energy in N·mm by term.
    iterations
        Linear solves since the state before, those of abandoned attempts included.
    residuals
        Largest free nodal force in N after each iteration of the last attempt.
    tolerance
        What the last of them had to fall below.
    """

    load_factor: float
    u: ndarray
    reactions: dict[str, ndarray]
    energies: dict[str, float]
    iterations: int
    residuals: tuple[float, ...]
    tolerance: float


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
    newton_iterations
        Linear solves in all, those of abandoned steps included.
    wall_time_s, assembly_time_s, solve_time_s
        Time of the run and its two largest parts.
    """

    ply: Ply
    states: list[State]
    converged: bool
    newton_iterations: int
    wall_time_s: float
    assembly_time_s: float
    solve_time_s: float

    @property
    def u(self) -> ndarray:
        """Displacement of the last converged state."""
        return self.states[-1].u

    def history(self) -> list[dict[str, float]]:
        """One row per converged state, ready for a table.

        Columns: load_factor, iterations, residual (N), tolerance (N), reaction_x
        and reaction_y of each condition (N), energy in all and by term (N·mm).
        """
        rows = []
        for state in self.states:
            row = {
                "load_factor": state.load_factor,
                "iterations": state.iterations,
                "residual": state.residuals[-1] if state.residuals else 0.0,
                "tolerance": state.tolerance,
            }
            for name, reaction in state.reactions.items():
                row[f"{name}_reaction_x"], row[f"{name}_reaction_y"] = reaction.tolist()
            rows.append(row | _energies(state))
        return rows

    def summary(self) -> dict[str, str | int | float | bool]:
        """Figures of the last converged state and of the run, in N, mm and degrees.

        ``max_fibre_strain``, ``max_fibre_tension`` and ``max_shear_angle_deg`` are
        the largest magnitudes at the ply's own points, ``max_fibre_strain_2x2`` and
        ``min_det_F`` those at the 2×2 points, for every formulation.
        """
        ply, u = self.ply, self.u
        gauss, _ = GAUSS
        return {
            "formulation": ply.formulation.name,
            "n_elements": int(ply.mesh.nelements),
            "n_dofs": int(ply.basis.N),
            "converged": self.converged,
            "load_factor": self.states[-1].load_factor,
            "load_steps": len(self.states) - 1,
            "newton_iterations": self.newton_iterations,
            **_energies(self.states[-1]),
            "max_fibre_strain": _largest(ply.fibre_strain(u)),
            "max_fibre_strain_2x2": _largest(ply.fibre_strain(u, gauss)),
            "max_fibre_tension": _largest(ply.fibre_tension(u)),
            "max_shear_angle_deg": float(np.degrees(_largest(ply.shear_angle(u)))),
            "min_det_F": float(ply.area_ratio(u, gauss).min()),
            "wall_time_s": self.wall_time_s,
            "assembly_time_s": self.assembly_time_s,
            "solve_time_s": self.solve_time_s,
        }

    def __repr__(self) -> str:
        end = "converged" if self.converged else "stopped early"
        return (
            f"<Result: {end} at load factor {self.states[-1].load_factor:g}, "
            f"{len(self.states) - 1} steps, {self.newton_iterations} iterations>"
        )


def _energies(state: State) -> dict[str, float]:
    by_term = {f"{term}_energy": state.energies.get(term, 0.0) for term in TERMS}
    return {"energy": sum(state.energies.values())} | by_term


def _largest(x: ndarray) -> float:
    return float(np.abs(x).max())
