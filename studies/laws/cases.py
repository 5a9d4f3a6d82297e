"""Materials, methods and cases of the study of laws."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np
from skfem import Mesh

from skfem_textile.fabric import CrimpToe, Fabric, Law, Linear, Tabulated, TensionOnly
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, OnePoint, Quadratic
from skfem_textile.ply.ply import DEFAULT
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.result import StepError
from skfem_textile.solve.stepper import LoadStepper

from ..angles.cases import (
    ACROSS,
    ANGLES,
    JITTER,
    JUDGING,
    STEPS,
    G,
    Specimen,
    graded_mesh,
)
from ..common.running import warnings_collected
from ..common.tables import Row

#: The specimen of the study of angles with the linear law: its meshes, references and
#: limits are those of this study.
SPECIMEN = Specimen(45.0, "linear", 2e5)

#: Sides in mm, and shear angle in radians at the end.
SIDES, ANGLE = (50.0, 100.0), np.radians(ANGLES[-1])

#: Load steps of second runs with steep shear.
MORE_STEPS = 2 * STEPS

#: Stiffness of straight fibres in N/mm.
E = SPECIMEN.ratio * G

SEEDS = JUDGING[0]


@dataclass(frozen=True)
class Material:
    """Laws of tension, of both families or of warp and weft, and of shear."""

    name: str
    tension: Law | float | tuple[float, float] = E
    shear: Law | float = G

    def fabric(self, scene: Scene) -> Fabric:
        """The fabric of the scene."""
        return Fabric(self.tension, self.shear, scene.warp, scene.weft)


def _steep_shear() -> Tabulated:
    """A table of shear whose slope rises a hundredfold from 30° to 55°."""
    low, high = np.radians([30.0, 55.0])
    angles = np.radians([*np.arange(0.0, 57.5, 2.5), 60.0, 65.0])
    rising, last = np.clip(angles, low, high), np.maximum(angles - high, 0.0)
    rise = (high - low) / np.log(100) * (100 ** ((rising - low) / (high - low)) - 1)
    values = G * (np.minimum(angles, low) + rise + 100 * last)
    return Tabulated(angles, values, odd=True, extrapolation="linear")


LINEAR = Material("linear")
TOE = Material("toe", tension=CrimpToe(E, toe=0.004, initial_stiffness=10.0))
TENSION_ONLY = Material("tension only", tension=TensionOnly(Linear(E)))
STEEP_SHEAR = Material("steep shear", shear=_steep_shear())
STIFF_WARP = Material("stiff warp", tension=(10 * E, E))
MATERIALS = (LINEAR, TOE, TENSION_ONLY, STEEP_SHEAR, STIFF_WARP)


@dataclass(frozen=True)
class Method:
    """A formulation on meshes with a number of element edges across, by seed."""

    name: str
    mesh: Callable[[int, int], Mesh]
    formulation: Formulation
    steps: int = STEPS


def _irregular(kind: str, parts: int, across: int, seed: int) -> Mesh:
    """A mesh whose edges the formulation splits into parts."""
    n = across // parts
    return rectangle(*SIDES, (n, 2 * n), kind, JITTER, seed)


def _along_fibres(cells: int, seed: int) -> Mesh:
    return graded_mesh(np.pi / 4, cells)


#: The methods that are judged, and one beside them.
QUADS = Method("default, quads", partial(_irregular, "irregular", 2), DEFAULT)
TRIANGLES = Method("default, triangles", partial(_irregular, "delaunay", 2), DEFAULT)
ONE_POINT = Method("one point, quads", partial(_irregular, "irregular", 1), OnePoint())
JUDGED = {QUADS: SEEDS, TRIANGLES: SEEDS, ONE_POINT: SEEDS[:3]}
IN_MORE_STEPS = {
    replace(m, name=f"{m.name}, {MORE_STEPS} steps", steps=MORE_STEPS): SEEDS
    for m in (QUADS, TRIANGLES)
}


def judged_methods(material: Material) -> dict[Method, tuple[int, ...]]:
    """The methods that are judged with a material, with their seeds."""
    return JUDGED | IN_MORE_STEPS if material is STEEP_SHEAR else JUDGED


#: The references with their numbers of cells along a side of a rhombus: the last is
#: the converged one.
FULL = Method("full", _along_fibres, Full())
QUADRATIC = Method("quadratic", _along_fibres, Quadratic())
REFERENCES = (FULL, 16), (QUADRATIC, 16), (QUADRATIC, 32)


@dataclass(frozen=True)
class Case:
    """A run: a material and a method, on a mesh.

    ``across`` is the number of element edges across, of references the number of cells
    along a side of a rhombus.
    """

    group: str
    material: Material
    method: Method
    across: int
    seed: int

    def __str__(self) -> str:
        seed = f", {self.seed}" if self.seed else ""
        return f"{self.material.name}: {self.method.name}, {self.across} across{seed}"

    def scene(self) -> Scene:
        """The scene, on the mesh of the method."""
        mesh = self.method.mesh(self.across, self.seed)
        return bias_extension(mesh, shear_angle=ANGLE)

    def rows(self) -> list[Row]:
        """Run the case; the load of a run that is refused is nan."""
        method, scene, refused = self.method, self.scene(), ""
        ply = Ply(scene.mesh, self.material.fabric(scene), method.formulation)
        with warnings_collected() as warnings:
            try:
                result = LoadStepper(ply, scene.conditions, method.steps).run()
                load = float(scene.reaction(result.states[-1])[1])
            except StepError as error:
                result, refused, load = error.result, str(error), np.nan
        row = {
            "group": self.group,
            "material": self.material.name,
            "method": method.name,
            "across": self.across,
            "seed": self.seed,
            "steps": method.steps,
            "unknowns": ply.basis.N,
            "load": load,
            "linear_solves": result.linear_solves,
            "seconds": result.wall_time_s,
            "warnings": " | ".join(warnings),
            "refused": refused,
        }
        return [row]


def all_cases() -> Iterator[Case]:
    """Every case."""
    for material in MATERIALS:
        for method, cells in REFERENCES:
            yield Case("reference", material, method, cells, 0)
    for material in MATERIALS:
        for method, seeds in judged_methods(material).items():
            for across, seed in product(ACROSS, seeds):
                yield Case("judged", material, method, across, seed)
