"""A small ply under conditions, cases of use, and checks of equilibrium."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.random import Generator
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, OnePoint, Ply, Result

from ..trial import WrongAnswerError
from .sheets import jittered, sheet

#: Stiffness of fibres and in shear, and stabilisation, in N/mm.
FIBRE_STIFFNESS, SHEAR_STIFFNESS, C_S = 50.0, 2.0, 4.0

#: Nodes, a direction, and the displacements of the nodes along it in mm.
Moves = Sequence[tuple[ndarray, tuple[float, float], ndarray | float]]


NAN, INF = np.nan, np.inf


class Specimen(NamedTuple):
    """A square of 3 mm in nine cells, and a generator of random numbers."""

    mesh: MeshQuad
    rng: Generator

    @classmethod
    def of(cls, rng: Generator) -> "Specimen":
        """A specimen whose inner nodes are moved at random."""
        plain = jittered(sheet(3, 3, 3.0, 3.0), rng)
        return cls(MeshQuad(plain.p, plain.t).with_defaults(), rng)

    @property
    def fabric(self) -> Fabric:
        """A fabric of linear laws."""
        return Fabric(FIBRE_STIFFNESS, SHEAR_STIFFNESS, (1.0, 0.2), (0.0, 1.0))

    @property
    def formulation(self) -> Any:
        """One of two, chosen at random."""
        return [Full(), OnePoint(C_S)][int(self.rng.integers(2))]

    @property
    def ply(self) -> Ply:
        """The mesh with the fabric."""
        return Ply(self.mesh, self.fabric, self.formulation)

    @property
    def top(self) -> ndarray:
        """Nodes on the top, ascending."""
        return np.flatnonzero(self.mesh.p[1] == 3)

    @property
    def clamp(self) -> Condition:
        """Hold the bottom."""
        return Condition("bottom")

    def run(self, conditions: Any, **settings: Any) -> Result:
        """Load the ply."""
        return LoadStepper(self.ply, conditions, **({"steps": 2} | settings)).run()

    def with_clamp(self, *condition: Any) -> Result:
        """Load the ply, its bottom held, under a condition named c."""
        return self.run({"clamp": self.clamp, "c": Condition(*condition)})

    def lift(self, **settings: Any) -> Result:
        """Load the ply, its bottom held and its top lifted by 0.1 mm."""
        lifted = Condition("top", 0.1, (0, 1))
        return self.run({"clamp": self.clamp, "c": lifted}, **settings)


class Case(NamedTuple):
    """A use of the library.

    Parameters
    ----------
    act
        Uses the library on a specimen.
    names
        Words that the refusal must hold; None if it must not be refused.
    moves
        Displacements that the result must have; None if it must be refused.
    """

    act: Callable[[Specimen], Any]
    names: str | None = ""
    moves: Callable[[Specimen], Moves] | None = None


def fails(*_: Any) -> Any:
    """Raise an error that is not the library's."""
    return 1 / 0


def held_bottom(specimen: Specimen) -> Moves:
    """The bottom does not move."""
    bottom = np.flatnonzero(specimen.mesh.p[1] == 0)
    return [(bottom, (1, 0), 0.0), (bottom, (0, 1), 0.0)]


def lifted(by: float) -> Callable[[Specimen], Moves]:
    """The bottom does not move, and the top moves up by a distance in mm."""
    return lambda specimen: [*held_bottom(specimen), (specimen.top, (0, 1), by)]


def check_result(result: Result, moves: Moves) -> None:
    """Check equilibrium and the displacements of the conditions.

    Raises
    ------
    WrongAnswerError
        If forces are not in equilibrium or nodes do not move as asked.
    """
    ply, u = result.ply, result.ply.nodal(result.u)
    if not np.isfinite(result.u).all():
        raise WrongAnswerError("displacements that are not finite")
    for nodes, direction, value in moves:
        n = np.array(direction) / np.hypot(*direction)
        off = np.abs(n @ u[:, nodes] - value).max()
        if not off <= 1e-9 * (1 + np.abs(value).max()):
            raise WrongAnswerError(f"nodes {nodes} are off by {off} mm")
    state = result.states[-1]
    f = ply.nodal(ply.residual(state.u, state.load_factor, state.parameters))
    largest = np.abs(f).max() + 1e-6
    if not np.abs(f.sum(axis=1)).max() <= 1e-9 * largest * len(f[0]):
        raise WrongAnswerError("the sum of the forces is not zero")
    if not moves:
        return
    held = np.unique(np.concatenate([nodes for nodes, _, _ in moves]))
    free = np.setdiff1d(np.arange(u.shape[1]), held)
    if not np.abs(f[:, free]).max(initial=0.0) <= 1e-6 * largest:
        raise WrongAnswerError(f"free nodes carry {np.abs(f[:, free]).max()} N")
