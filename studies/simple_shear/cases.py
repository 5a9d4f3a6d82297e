"""Plies in simple shear on irregular meshes, and their converged loads."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy import ndarray

from skfem_textile import (
    Fabric,
    Linear,
    LoadStepper,
    Ply,
    Quadratic,
    StepError,
    TensionOnly,
)
from skfem_textile.outlines import fitted
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, simple_shear
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.interval import work_of

from ..study import Row

#: Motion of the upper clamp across itself.
Motion: TypeAlias = Literal["tension", "circle"]

_MOTIONS: tuple[Motion, ...] = "tension", "circle"

#: Seed of the nodes.
JUDGING = 20261130

#: Fabrics by name: stiffnesses in N/mm, bending stiffness in N·mm.
FABRICS = {
    "linear": Fabric(1e4, 0.5),
    "bending": Fabric(1e4, 0.5, bending=(5.0, 5.0)),
    "no compression": Fabric(TensionOnly(Linear(1e4)), 0.5),
}

# Sides in mm, shear angle, jitter and load steps.
_WIDTH, _HEIGHT, _ANGLE, _JITTER, _STEPS = 40.0, 60.0, np.radians(20.0), 0.3, 5

# Elements across the meshes.
_ACROSS = 6, 10, 16, 24

# Part of the width that a trapezium loses on each side from bottom to top.
_TAPER = 0.15

# Elements across the references, and their stiffer formulation: the default one has
# deviations of 400.
_FINE, _STIFFER = 32, Quadratic(4000.0, points=6)


@dataclass(frozen=True)
class Problem:
    """Motion across the clamps, outline, inclination of the warp in degrees, fabric."""

    across: Motion
    outline: str
    degrees: int
    fabric: str

    def scene(self, n: int, seed: int, jitter: float = _JITTER) -> Scene:
        """The scene with n elements across."""
        mesh = rectangle(_WIDTH, _HEIGHT, (n, 3 * n // 2), "irregular", jitter, seed)
        if self.outline == "trapezium":
            x, y = mesh.p
            x = x - 2 * _TAPER * (x - _WIDTH / 2) * y / _HEIGHT
            mesh = replace(mesh, doflocs=np.stack([x, y]))
        warp = np.radians(self.degrees)
        angles = {"warp": warp, "weft": warp + np.pi / 2, "shear_angle": _ANGLE}
        return simple_shear(mesh, across=self.across, **angles)

    def stepper(self, scene: Scene, formulation: Formulation | None) -> LoadStepper:
        """Load stepper on the fitted mesh of a scene; by default its formulation."""
        fabric = replace(FABRICS[self.fabric], warp=scene.warp, weft=scene.weft)
        fit = fitted(scene.mesh, fabric, scene.conditions, scene.loads)
        of_fit: Any = fit.fabric
        ply = Ply(fit.mesh, of_fit, formulation or fit.formulation, scene.loads)
        return LoadStepper(ply, scene.conditions, _STEPS)


@dataclass(frozen=True)
class Sheared:
    """A problem on a mesh.

    Attributes
    ----------
    case
        Name.
    problem
        The problem.
    n, seed
        Elements across, and seed of the nodes.
    """

    case: str
    problem: Problem
    n: int
    seed: int

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Errors and intervals of the load and its components."""
        problem = self.problem
        row: Row = {
            "case": self.case,
            "across": problem.across,
            "outline": problem.outline,
            "fibres": problem.degrees,
            "fabric": problem.fabric,
            "elements": self.n,
        }
        scene = problem.scene(self.n, self.seed)
        stepper = problem.stepper(scene, None)
        try:
            result = stepper.run()
        except StepError as refusal:
            return [{**row, "refused": str(refusal)}]
        error, force = result.error, scene.reaction(result.states[-1])
        row |= {
            "unknowns": int(result.ply.basis.N),
            "solves": result.linear_solves,
            "work": work_of(stepper.problem.at(1.0), result.states[-1]),
            "half_width": error.load,
            "reason": error.reason,
            "F_x": float(force[0]),
            "F_y": float(force[1]),
            "refused": "",
        }
        if error.load is None:
            return [row]
        work, spread, x, y = _converged(problem)
        halves = error.reactions["top"]
        return [
            {
                **row,
                "half_x": float(halves[0]),
                "half_y": float(halves[1]),
                "reference": work,
                "spread": spread,
                "x": x,
                "y": y,
                "error": row["work"] / work - 1,
            }
        ]


@cache
def _converged(problem: Problem) -> tuple[float, float, float, float]:
    """Converged work, its relative uncertainty, and components of the force in N."""
    works: list[float] = []
    forces: list[ndarray] = []
    scene = problem.scene(_FINE, 0, 0.0)
    for formulation in (None, _STIFFER):
        stepper = problem.stepper(scene, formulation)
        state = stepper.run().states[-1]
        works.append(work_of(stepper.problem.at(1.0), state))
        forces.append(scene.reaction(state))
    mean = float(np.mean(works))
    x, y = np.mean(forces, axis=0)
    return mean, float(np.ptp(works) / abs(mean)), float(x), float(y)


def sheared() -> Iterator[Sheared]:
    """Every problem on several meshes."""
    random = np.random.default_rng(JUDGING)
    outlines, degrees = ("rectangle", "trapezium"), (0, 20, 45)
    problems = product(_MOTIONS, outlines, degrees, FABRICS)
    for across, outline, warp, fabric in problems:
        problem = Problem(across, outline, warp, fabric)
        for n in _sizes(problem):
            seed = int(random.integers(1 << 31))
            name = f"{across}, {outline}, {warp}°, {fabric}, {n} across"
            yield Sheared(name, problem, n, seed)


def _sizes(problem: Problem) -> tuple[int, ...]:
    """Elements across: few where the load does not converge, which takes long."""
    inclined = problem.across == "circle" and problem.degrees > 0
    buckles = problem.fabric == "no compression" or problem.degrees == 45
    return (6, 10) if buckles or (inclined and problem.fabric == "linear") else _ACROSS
