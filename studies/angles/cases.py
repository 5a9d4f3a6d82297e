"""Plies, methods and cases of the study of angles."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import product
from typing import ClassVar, Self

import numpy as np
from skfem import Mesh

from skfem_textile.fabric import Fabric, Law, Linear, Sin2
from skfem_textile.ply.formulations import Full, Quadratic
from skfem_textile.ply.ply import DEFAULT
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle

from ..study import Row
from .aligned_mesh import graded_mesh

#: Inclinations of the warp in degrees, and shear angles in degrees.
INCLINATIONS, ANGLES = (30.0, 37.5, 45.0, 52.5, 60.0), (10, 20, 30, 40)

#: Load steps; each of the shear angles is at the end of one.
STEPS = 8

#: Shear stiffness in N/mm, shear laws by name, and ratios E/G.
G = 0.5
LAWS: dict[str, Law] = {"linear": Linear(G), "sin²": Sin2(G)}
RATIOS = (2e4, 2e5, 2e6)

#: Numbers of element edges along the clamps after the split inside, and the mesh of
#: each kind of elements.
ACROSS = (16, 32)
MESHES = {"quads": "irregular", "triangles": "delaunay"}

#: Limits of the errors of median loads by the number of edges across, as shares, up to
#: the inclination `STEEP` in degrees; twice as much above.
LIMITS, STEEP = {16: 0.04, 32: 0.02}, 52.5

#: Largest move of a node, as a share of the spacing.
JITTER = 0.25

#: Seeds and inclinations that judge, and those by which constants are chosen.
JUDGING = (1, 2, 3, 4, 5), INCLINATIONS
CHOOSING = (11, 12, 13), (30.0, 45.0, 60.0)

#: Grading of the meshes of the references.  Chosen: the narrowest cells are 0.001 L
#: wide, where L is a side of a rhombus.  Layers are about L √(G/E) wide, from 0.007 L
#: at E/G = 2e4 to 0.0007 L at 2e6.
GRADING = 6.0

#: Formulations of the references, with cells along a side of a rhombus.  The last gives
#: the answer, the one before has cells twice as wide, the first is another formulation.
REFERENCES: tuple[tuple[Formulation, int], ...] = (
    (Full(), 16),
    (Quadratic(), 16),
    (Quadratic(), 32),
)


@dataclass(frozen=True)
class Specimen:
    """A ply of the height 2W tan θ, its warp at an inclination in degrees.

    ``law`` is the name of a shear law, and ``ratio`` is E/G.
    """

    inclination: float
    law: str
    ratio: float

    @property
    def name(self) -> str:
        """What to call it."""
        inclination, law, ratio = self.names
        return f"{inclination}, {law}, E/G = {ratio}"

    @property
    def names(self) -> tuple[str, str, str]:
        """Inclination, law and E/G as text."""
        ratio = f"{self.ratio:.0e}".replace("e+0", "e")
        return f"{self.inclination:g}°", self.law, ratio

    @property
    def row(self) -> Row:
        """What rows tell of it."""
        return asdict(self)

    @classmethod
    def of(cls, row: Row) -> Self:
        """The ply of a row."""
        return cls(row["inclination"], row["law"], row["ratio"])

    @property
    def shear_law(self) -> Law:
        """The shear law."""
        return LAWS[self.law]

    def scene(self, mesh: Mesh) -> Scene:
        """The bias extension up to the largest shear angle."""
        theta, gamma = np.radians([self.inclination, ANGLES[-1]])
        return bias_extension(mesh, warp=theta, weft=np.pi - theta, shear_angle=gamma)

    def fabric(self, scene: Scene) -> Fabric:
        """The fabric of the scene."""
        return Fabric(self.ratio * G, self.shear_law, scene.warp, scene.weft)


def limit(inclination: float, across: int) -> float:
    """Limit of the error of a median load, as a share of the reference."""
    return LIMITS[across] * (2 if inclination > STEEP else 1)


SPECIMENS = tuple(Specimen(*given) for given in product(INCLINATIONS, LAWS, RATIOS))


@dataclass(frozen=True)
class Reference:
    """A converged load: the ply on meshes along its fibres."""

    specimen: Specimen

    @property
    def name(self) -> str:
        """What to call it."""
        return self.specimen.name

    def mesh(self, cells: int) -> Mesh:
        """A mesh with so many cells along a side of a rhombus."""
        theta = float(np.radians(self.specimen.inclination))
        return graded_mesh(theta, WIDTH, cells, GRADING)


@dataclass(frozen=True)
class Judged:
    """The default formulation on an irregular mesh with so many edges across."""

    specimen: Specimen
    elements: str
    across: int
    seed: int

    formulation: ClassVar[Formulation] = DEFAULT

    @property
    def name(self) -> str:
        """What to call it."""
        mesh = f"{self.elements}, {self.across} across, seed {self.seed}"
        return f"{self.specimen.name}, {mesh}"

    def mesh(self) -> Mesh:
        """The mesh before the split inside, about square elements."""
        n, slope = self.across // 2, np.tan(np.radians(self.specimen.inclination))
        size, kind = (n, round(2 * n * slope)), MESHES[self.elements]
        return rectangle(WIDTH, 2 * WIDTH * slope, size, kind, JITTER, self.seed)


Case = Reference | Judged


def judged(seeds: tuple[int, ...], inclinations: tuple[float, ...]) -> Iterator[Judged]:
    """The cases with these seeds and inclinations."""
    for specimen in SPECIMENS:
        if specimen.inclination in inclinations:
            for given in product(MESHES, ACROSS, seeds):
                yield Judged(specimen, *given)
