"""Equilibria, states and the errors of failed attempts."""

import sysconfig
from dataclasses import dataclass, field
from pathlib import Path
from traceback import extract_tb
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..mesh.user_input import CopiedError
from ..ply.parameters import PlyParameters

# Folders of library code: of this package, and of installed packages.
_INSTALLED = (
    str(Path(__file__).parents[1]),
    *{sysconfig.get_path(name) for name in ("purelib", "platlib", "stdlib")},
)


class Overload(NamedTuple):
    """End of a refused step, at which a clamp carries a multiple of its release."""

    load_factor: float
    name: str
    load: float


class NoEquilibriumError(Exception):
    """Failed attempt at a load factor.

    Attributes
    ----------
    elements
        Numbers of the elements where it failed; empty if the failure is not local.
    advice
        Suggested remedy.
    quantity
        Quantity at or beyond the end of its law's domain: warp_strain, weft_strain or
        shear_angle; empty if there is none.
    overload
        Clamp that would have let go before, or None.
    """

    def __init__(
        self,
        message: str,
        elements: Any = (),
        advice: str = "",
        quantity: str = "",
        overload: Overload | None = None,
    ) -> None:
        super().__init__(message)
        self.elements = np.asarray(elements, dtype=int)
        self.advice, self.quantity, self.overload = advice, quantity, overload


class CheckpointError(ValueError):
    """Checkpoint that cannot be used; the message gives the reason and the remedy."""


class UserError(CopiedError):
    """Exception raised by a user's function: a term, law, condition or callback.

    The message contains type and text of the exception, and the function and line
    outside installed packages that raised it.

    Parameters
    ----------
    error
        The exception.
    """

    def __init__(self, error: Exception) -> None:
        text = " ".join(str(error).split())
        message = f"{type(error).__name__}: {text}" if text else type(error).__name__
        frames = extract_tb(error.__traceback__)
        users = [x for x in frames if not x.filename.startswith(_INSTALLED)]
        for at in users[-1:]:
            message += f" ({at.name}, line {at.lineno} of {Path(at.filename).name})"
        super().__init__(message)


@dataclass(eq=False)
class Equilibrium:
    """Converged iteration, with its convergence history.

    Attributes
    ----------
    u, f, parameters
        Displacement, nodal forces, and parameters of the terms with which they balance.
    residuals, tolerance
        Largest free nodal force in N after each iteration, and tolerance of the last.
    projected
        Number of projected tangents.
    tangent
        The consistent tangent; None if it is singular.
    """

    u: ndarray
    f: ndarray
    parameters: PlyParameters
    residuals: tuple[float, ...]
    tolerance: float
    projected: int = 0
    tangent: Any = None


@dataclass(frozen=True)
class Verdict:
    """Quantities for the acceptance checks of a state.

    Attributes
    ----------
    negative_pivots
        Negative eigenvalues of the consistent tangent; None where it is singular.
    min_det_F
        Smallest det F of the elements, at their nodes and at the fine points of the
        ply: the 2×2 points of quadrilaterals, six points of quadratic triangles.  In
        space the area ratio, negative if the normal at a point opposes the normal of
        its element.
    max_fibre_strain
        Largest magnitude of the fibre strain in the tension law.
    mesh_fibre_strain
        Largest magnitude of the fibre strain at the fine points, most of which do not
        enter a law: a measure of element distortion, not of fibre load.
    work
        Work of reactions and loads since the previous state in N·mm (trapezoidal rule).
    """

    negative_pivots: int | None
    min_det_F: float
    max_fibre_strain: float
    mesh_fibre_strain: float
    work: float

    @property
    def stable(self) -> bool:
        """True if the consistent tangent is positive definite."""
        return self.negative_pivots == 0


class Iteration(NamedTuple):
    """Information passed to ``on_iteration``: one iteration towards a load factor.

    ``step`` is the step length, ``residual`` the largest free nodal force in N, which
    must fall below ``tolerance``.
    """

    load_factor: float
    step: float
    method: str
    number: int
    residual: float
    tolerance: float

    def __str__(self) -> str:
        return (
            f"load factor {self.load_factor:g}, {self.method} iteration "
            f"{self.number}: residual {self.residual:.3g} N, tolerance "
            f"{self.tolerance:.3g} N"
        )


@dataclass(frozen=True, eq=False)
class State:
    """Converged state.

    Attributes
    ----------
    load_factor
        Load factor t in [0, 1]; the first state of a run, t = 0, is the undeformed ply.
    u
        Displacement, DOF vector of the ply's basis.
    reactions
        Force of the support on the ply in N, shape (d,), by condition, tool and clamp.
        Of a condition the internal
        forces less the loads at its nodes, along the directions that it fixes.  Where
        conditions share a node, its force is divided among them, a component that two
        of them fix equally, so that the reactions sum to the opposite of the loads.
    displacements
        Mean displacement of the nodes of the condition in mm, shape (d,), by condition;
        of the edge of a clamp, and travel of a tool.
    energies
        Energy in N·mm by term, without loads; energy lost by friction of laws and by
        clamps that let go is included.
    linear_solves
        Linear solves since the previous state, including abandoned attempts.
    residuals
        Largest free nodal force in N after each iteration of the last attempt.
    tolerance
        Tolerance in N of the last residual.
    verdict
        Stability, smallest det F, strains and work of the state.
    potentials
        Potential of each load in N·mm.
    shares
        Shares of ``stabilisation`` and ``deviation``, from 0 to 1, in ``energy``,
        ``work`` and, for each condition, ``CONDITION_reaction``.
    forces
        Sum of the forces of all supports over the nodes of the condition in N, shape
        (d,), by condition: forces of nodes that conditions share are counted for each.
    parameters
        Parameters of the terms at which the forces balance, such as stabilisation
        stiffnesses: an immutable mapping, see `Ply.parameters_at_rest`.  The forces are
        ``ply.residual(state.u, state.load_factor, state.parameters)``.
    warnings
        Messages of the checks of `CHECKS` that failed but only warn, by name.
    energy_lost
        Energy lost so far in N·mm, by term: of laws with friction (`WithFriction`), of
        tools with friction, and of clamps that let go.
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
    shares: dict[str, dict[str, float]] = field(default_factory=dict)
    forces: dict[str, ndarray] = field(default_factory=dict)
    parameters: PlyParameters = field(default_factory=dict)
    warnings: dict[str, str] = field(default_factory=dict)
    energy_lost: dict[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        stable = "stable" if self.verdict.stable else "not stable"
        return f"<State at load factor {self.load_factor:g}, {stable}>"
