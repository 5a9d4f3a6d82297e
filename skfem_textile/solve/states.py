"""Equilibria, states with their figures, and the errors on the way to them."""

import sysconfig
from dataclasses import dataclass, field
from pathlib import Path
from traceback import extract_tb
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from ..ply.parameters import PlyParameters

# Folders of code that is not the user's: of this package, and of installed ones.
_INSTALLED = (
    str(Path(__file__).parents[1]),
    *{sysconfig.get_path(name) for name in ("purelib", "platlib", "stdlib")},
)


class NoEquilibriumError(Exception):
    """An attempt at a load factor failed.

    Attributes
    ----------
    elements
        Numbers of the elements where it failed; empty where no one place is to blame.
    advice
        What to try.
    quantity
        What is at the end of its law, or past it: warp_strain, weft_strain or
        shear_angle; empty where nothing is.
    """

    def __init__(
        self, message: str, elements: Any = (), advice: str = "", quantity: str = ""
    ) -> None:
        super().__init__(message)
        self.elements = np.asarray(elements, dtype=int)
        self.advice, self.quantity = advice, quantity


class UserError(Exception):
    """An error that a user's function raised: a term, law, condition or callback.

    The message has the type and the text of the error, and the function and line
    outside installed packages that raised it.

    Parameters
    ----------
    error
        The error.
    """

    def __init__(self, error: Exception) -> None:
        text = " ".join(str(error).split())
        message = f"{type(error).__name__}: {text}" if text else type(error).__name__
        frames = extract_tb(error.__traceback__)
        users = [x for x in frames if not x.filename.startswith(_INSTALLED)]
        for at in users[-1:]:
            message += f" ({at.name}, line {at.lineno} of {Path(at.filename).name})"
        super().__init__(message)


class Equilibrium(NamedTuple):
    """The end of an iteration, and how it converged.

    ``parameters`` of the ply's terms balance the forces, ``altered`` is the number of
    tangents that were projected, ``tangent`` is the consistent tangent, None where it
    is singular.
    """

    u: ndarray
    f: ndarray
    parameters: PlyParameters
    residuals: tuple[float, ...]
    tolerance: float
    altered: int = 0
    tangent: Any = None


@dataclass(frozen=True)
class Verdict:
    """Figures of a state that tell whether it is an answer.

    Attributes
    ----------
    negative_pivots
        Negative eigenvalues of the consistent tangent; None where it is singular.
    min_det_F
        Smallest det F of the elements, at their nodes and at the ply's fine points: of
        quadrilaterals the 2×2 points, of quadratic triangles six points.  In space the
        area ratio, negative where a point faces the other way than its element.
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
    """An iteration on the way to a load factor, as ``on_iteration`` is given it.

    ``step`` is the length of the step, ``residual`` the largest free nodal force in N,
    which must fall below ``tolerance``.
    """

    load_factor: float
    step: float
    method: str
    number: int
    residual: float
    tolerance: float

    def __str__(self) -> str:
        return (
            f"load factor {self.load_factor:g}, {self.method} {self.number}: "
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
        Force of the support on the ply in N, shape (d,), by condition: the sum
        over its nodes of the internal forces less the loads.
    displacements
        Mean displacement of the nodes of the condition in mm, shape (d,), by condition.
    energies
        Energy in N·mm by term, without loads.
    linear_solves
        Linear solves since the state before, abandoned attempts included.
    residuals
        Largest free nodal force in N after each iteration of the last attempt.
    tolerance
        Force in N that the last of them had to fall below.
    verdict
        Stability, folding, strain and work of the state.
    potentials
        Potential of each load in N·mm.
    shares
        Shares of ``stabilisation`` and ``deviation``, from 0 to 1, in each whole:
        ``energy``, ``work`` and, for each condition, ``CONDITION_reaction``.
    parameters
        Parameters of the ply's terms with which the forces balance, such as stiffnesses
        of the discretisation: an immutable mapping, see `Ply.parameters_at_rest`.
        ``ply.residual(state.u, state.load_factor, state.parameters)`` has these forces.
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
    parameters: PlyParameters = field(default_factory=dict)

    def __repr__(self) -> str:
        stable = "stable" if self.verdict.stable else "not stable"
        return f"<State at load factor {self.load_factor:g}, {stable}>"


@dataclass(frozen=True)
class ErrorEstimate:
    """An estimated error of a state, or why there is none.

    Attributes
    ----------
    load
        As a share of the load: of the force of the conditions that move along their
        motion, and of the work of loads.  None if there is none.
    shear_angle
        Root of the mean square over the ply, in radians; None if there is none.
    reason
        Why there is none, or none of a load; else empty.
    """

    load: float | None = None
    shear_angle: float | None = None
    reason: str = ""
