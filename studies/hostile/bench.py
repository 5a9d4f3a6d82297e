"""A small ply under conditions, and whether what comes of a run is in balance."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.random import Generator
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, LoadStepper, OnePoint, Ply, Result

from .mechanics import WrongError
from .sheets import jittered, sheet

#: Fibre stiffness, shear stiffness and stabilisation in N/mm.
_E, _G, _C = 50.0, 2.0, 4.0

#: Nodes, a direction, and the displacement of each along it in mm.
Moves = Sequence[tuple[ndarray, tuple[float, float], ndarray | float]]


class Bench(NamedTuple):
    """A square of 3 mm in nine cells, and numbers from a seed."""

    mesh: MeshQuad
    rng: Generator

    @classmethod
    def of(cls, rng: Generator) -> "Bench":
        """A bench with its inner nodes moved."""
        plain = jittered(sheet(3, 3, 3.0, 3.0), rng)
        return cls(MeshQuad(plain.p, plain.t).with_defaults(), rng)

    @property
    def fabric(self) -> Fabric:
        """Of linear laws."""
        return Fabric(_E, _G, (1.0, 0.2), (0.0, 1.0))

    @property
    def formulation(self) -> Any:
        """One of two, by the seed."""
        return [Full(), OnePoint(_C)][int(self.rng.integers(2))]

    @property
    def ply(self) -> Ply:
        """The ply."""
        return Ply(self.mesh, self.fabric, self.formulation)

    @property
    def top(self) -> ndarray:
        """Nodes at the top, ascending."""
        return np.flatnonzero(self.mesh.p[1] == 3)

    @property
    def clamp(self) -> Condition:
        """Holds the bottom."""
        return Condition("bottom")

    def run(self, conditions: Any, **settings: Any) -> Result:
        """Load the ply."""
        given = {"steps": 2} | settings
        return LoadStepper(self.ply, conditions, **given).run()

    def with_clamp(self, *condition: Any) -> Result:
        """Load the ply, its bottom held, under a condition named c."""
        return self.run({"clamp": self.clamp, "c": Condition(*condition)})

    def lift(self, **settings: Any) -> Result:
        """Load the ply, its bottom held and its top lifted by 0.1 mm."""
        lifted = Condition("top", 0.1, (0, 1))
        return self.run({"clamp": self.clamp, "c": lifted}, **settings)


#: What is done with a bench; what it gives is judged if it is a result.
Act = Callable[[Bench], Any]


class Case(NamedTuple):
    """Something that a user might write.

    Parameters
    ----------
    act
        Gives it to the library.
    names
        What a refusal must name; None if it must not be refused.
    moves
        What a result must hold; none if it must be refused.
    """

    act: Act
    names: str | None = ""
    moves: Callable[[Bench], Moves] | None = None


def check_result(result: Result, moves: Moves) -> None:
    """Refuse a result that is not in balance, or does not move as asked.

    Raises
    ------
    WrongError
        If it is wrong.
    """
    ply, u = result.ply, result.ply.nodal(result.u)
    if not np.isfinite(result.u).all():
        raise WrongError("displacements that are not finite")
    for nodes, direction, value in moves:
        n = np.array(direction) / np.hypot(*direction)
        off = np.abs(n @ u[:, nodes] - value).max()
        if not off <= 1e-9 * (1 + np.abs(value).max()):
            raise WrongError(f"nodes {nodes} are off by {off} mm")
    f = ply.nodal(ply.residual(result.u))
    largest = np.abs(f).max() + 1e-6
    if not np.abs(f.sum(axis=1)).max() <= 1e-9 * largest * len(f[0]):
        raise WrongError("forces that do not sum to nothing")
    if not moves:
        return
    held = np.unique(np.concatenate([nodes for nodes, _, _ in moves]))
    free = np.setdiff1d(np.arange(u.shape[1]), held)
    if not np.abs(f[:, free]).max(initial=0.0) <= 1e-6 * largest:
        raise WrongError(f"free nodes carry {np.abs(f[:, free]).max()} N")
