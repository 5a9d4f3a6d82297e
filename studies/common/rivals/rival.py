"""The protocol of rivals."""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Protocol

from numpy import ndarray
from skfem import Element, ElementQuad1, ElementQuad2, ElementTriP2
from skfem.quadrature import get_quadrature

from skfem_textile.mesh.bases import GAUSS, THREE

from .newton import RivalSystem, Run, iterations, timed
from .task import Task


@dataclass(frozen=True, eq=False)
class Shape:
    """An element with its rule, as scikit-fem has them.

    ``mesh`` is ``quads`` or ``triangles``.  ``parts`` is the number of parts into which
    nodes divide an edge.
    """

    name: str
    mesh: str
    parts: int
    element: Element
    rule: tuple[ndarray, ndarray]


QUAD4 = Shape("Q4, 2×2", "quads", 1, ElementQuad1(), GAUSS)
TRIANGLE6 = Shape("P2, 3 points", "triangles", 2, ElementTriP2(), THREE)
QUAD9 = Shape("Q9, 3×3", "quads", 2, ElementQuad2(), get_quadrature(ElementQuad2, 5))
QUAD9_REDUCED = Shape("Q9, 2×2", "quads", 2, ElementQuad2(), GAUSS)


class Rival(Protocol):
    """A code with an element and a solver, that loads a ply by plain Newton."""

    @property
    def code(self) -> str:
        """The code, and the solver if there is a choice."""
        ...

    @property
    def solver(self) -> str:
        """The linear solver."""
        ...

    @property
    def shape(self) -> Shape:
        """The element."""
        ...

    def missing(self) -> str:
        """Packages to install first; empty if nothing is missing."""
        ...

    def run(self, task: Task, steps: int, repeats: int) -> Run:
        """Load a ply in equal steps, once to warm up, then with a clock.

        Parameters
        ----------
        task
            The task, with the element of `shape`.
        steps
            Number of load steps.
        repeats
            Runs on the clock, from mesh and fabric in memory to the end of the load.

        Raises
        ------
        NotConvergedError
            If a step does not converge.
        """
        ...

    def iterations(
        self, task: Task, u: ndarray, repeats: int
    ) -> list[tuple[float, float]]:
        """Seconds of assembly and of solution in Newton iterations at ``u``."""
        ...


class InProcess:
    """A rival that runs in this process."""

    @property
    def packages(self) -> dict[str, str]:
        """Packages beside this library: how to import and to install them."""
        return {}

    def missing(self) -> str:
        """Packages that are not installed."""
        needed = self.packages.items()
        return ", ".join(name for module, name in needed if find_spec(module) is None)

    def system(self, task: Task) -> RivalSystem:
        """The discretised ply."""
        raise NotImplementedError

    def run(self, task: Task, steps: int, repeats: int) -> Run:
        """Load a ply in equal steps; see `Rival`."""
        return timed(lambda: self.system(task), task.values(steps), repeats)

    def iterations(
        self, task: Task, u: ndarray, repeats: int
    ) -> list[tuple[float, float]]:
        """Time Newton iterations; see `Rival`."""
        return iterations(self.system(task), u, repeats)
