"""Specimens on meshes without edges on the singular fibres."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from time import perf_counter
from typing import Any

from skfem import Mesh

from skfem_textile import Macro, OnePoint, StepError
from skfem_textile.outlines import fitted
from skfem_textile.ply.formulations import ON_FIBRES
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.interval import work_of

from ..interval.cases import Problem
from ..singular_fibres.cases import WIDTH, Case, specimens
from ..study import Row

#: Seed of specimens and plates, with which no constant was chosen.
JUDGING = 20261130

#: Formulations on the meshes as they are, and on fitted ones, the default first.
AS_IT_IS: tuple[Formulation, ...] = Macro(), OnePoint(), ON_FIBRES
FITTED: tuple[Formulation, ...] = ON_FIBRES, Macro(), OnePoint()

# Largest displacement of the nodes relative to their spacing, and load steps.
_JITTER, _STEPS = 0.3, 4


@dataclass(frozen=True)
class OnUsersMesh:
    """A specimen on an irregular mesh.

    Attributes
    ----------
    case
        Name.
    specimen
        The specimen.
    kind
        Kind of the mesh, see `rectangle`.
    across
        Elements across the width.
    seed
        Seed of the nodes.
    """

    case: str
    specimen: Case
    kind: str
    across: int
    seed: int

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Errors and intervals of the load on the mesh as it is, and fitted."""
        problem = Problem(*self.specimen.problem(), steps=_STEPS)
        mesh = self._mesh()
        reference, spread = _converged(self.specimen)
        rows = []
        for fits, formulations in ((False, AS_IT_IS), (True, FITTED)):
            for formulation in formulations:
                if isinstance(formulation, OnePoint) and self.kind == "delaunay":
                    continue  # the element of quadrilaterals
                rows.append(
                    {
                        "case": self.case,
                        "kind": self.kind,
                        "across": self.across,
                        "mesh": "fitted" if fits else "as it is",
                        "formulation": formulation.title,
                        "reference": reference,
                        "spread": spread,
                        **_run(problem, mesh, formulation, reference, fits),
                    }
                )
        return rows

    def _mesh(self) -> Mesh:
        height = self.specimen.polygon[2][1]
        size = self.across, max(1, round(self.across * height / WIDTH))
        return rectangle(WIDTH, height, size, self.kind, _JITTER, self.seed)


@cache
def _converged(specimen: Case) -> tuple[float, float]:
    """Converged work of a specimen, and its relative uncertainty."""
    reference = Problem(*specimen.problem()).reference()
    if reference is None:
        raise ValueError(f"{specimen} has no reference")
    return reference


def _run(
    problem: Problem,
    mesh: Mesh,
    formulation: Formulation,
    reference: float,
    fits: bool,
) -> Row:
    """Error, interval and time of a run."""
    start = perf_counter()
    if fits:
        fit = fitted(mesh, problem.fabric, problem.conditions)
        fabric: Any = fit.fabric
        mesh, problem = fit.mesh, problem._replace(fabric=fabric)
    fitting = perf_counter() - start
    stepper = problem.stepper(mesh, formulation)
    row: Row = {"unknowns": int(stepper.ply.basis.N), "fit_seconds": fitting}
    try:
        result = stepper.run()
    except StepError as refusal:
        return {**row, "refused": str(refusal)}
    took = perf_counter() - start
    error = result.error
    load = work_of(stepper.problem.at(1.0), result.states[-1])
    return {
        **row,
        "error": load / reference - 1,
        "half_width": error.load,
        "reason": error.reason,
        "seconds": took,
        "refused": "",
    }


def on_users_meshes(seed: int, before: str, n: int = 12) -> Iterator[OnUsersMesh]:
    """Specimens, each on quadrilaterals and triangles of two sizes and three seeds."""
    drawn = product(specimens(seed, n), (16, 32), ("irregular", "delaunay"), (1, 2, 3))
    for specimen, across, kind, of_nodes in drawn:
        name = f"{before}{specimen}, {kind}, {across} across, {of_nodes}"
        yield OnUsersMesh(name, specimen, kind, across, of_nodes)
