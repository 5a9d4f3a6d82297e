"""Plies, meshes, converged loads and cases of the study of angles.

Converged loads come from fibre-aligned meshes, graded towards stretched fibres.  The
fibres through the corners of the clamps divide a ply of height 2W tan θ into equal
rhombi and half-rhombi.  The shear angle jumps at these fibres; their tension is
distributed over narrow layers by fibre stretch.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
import shapely
from numpy import ndarray
from skfem import Mesh, MeshTri

from skfem_textile.fabric import Fabric, Law, Linear, Sin2
from skfem_textile.mesh.checks import with_edges
from skfem_textile.outlines.net import cut_cells
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Quadratic
from skfem_textile.ply.ply import DEFAULT
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.result import Result
from skfem_textile.solve.stepper import LoadStepper

from ..common.running import errors_only, run, warnings_collected
from ..common.tables import Row

#: Inclinations of the warp in degrees, and shear angles in degrees.
INCLINATIONS, ANGLES = (30.0, 37.5, 45.0, 52.5, 60.0), (10, 20, 30, 40)

#: Load steps; each shear angle is reached at the end of a step.
STEPS = 8

#: Shear stiffness in N/mm, shear laws by name, and ratios E/G.
G = 0.5
LAWS: dict[str, Law] = {"linear": Linear(G), "sin²": Sin2(G)}
RATIOS = (2e4, 2e5, 2e6)

#: Numbers of element edges along the clamps after internal splitting, and the mesh of
#: each element shape.
ACROSS = (16, 32)
MESHES = {"quads": "irregular", "triangles": "delaunay"}

#: Limits of the relative error of median loads by edges across, up to the inclination
#: `STEEP` in degrees; twice as large above.
LIMITS, STEEP = {16: 0.04, 32: 0.02}, 52.5

#: Largest displacement of a node relative to the spacing.
JITTER = 0.25

#: Seeds and inclinations for validation, and for the choice of constants.
JUDGING = (1, 2, 3, 4, 5), INCLINATIONS
CHOOSING = (11, 12, 13), (30.0, 45.0, 60.0)

#: Grading of the reference meshes.  The narrowest cells are 0.001 L wide, with the
#: rhombus side L.  Layers are about L √(G/E) wide: 0.007 L at E/G = 2e4 to 0.0007 L at
#: 2e6.
GRADING = 6.0

#: Formulations of the references, with cells along a rhombus side.  The last gives the
#: result, the second has cells twice as wide, the first uses another formulation.
REFERENCES: tuple[tuple[Formulation, int], ...] = (
    (Full(), 16),
    (Quadratic(), 16),
    (Quadratic(), 32),
)

#: File of the converged loads.
FILE = Path(__file__).parents[2] / "docs" / "angles" / "references.json"

#: Largest relative load difference between two formulations, and on halving the cells.
AGREEMENT = 0.005

# Number of stored decimals, far finer than the agreement.
_DIGITS = 6


def graded_mesh(theta: float, cells: int) -> Mesh:
    """Fibre-aligned triangles, graded towards the fibres through the corners.

    Parameters
    ----------
    theta
        Inclination of the fibres in radians.
    cells
        Even number of cells along a rhombus side.
    """
    lines = np.concatenate([i + _graded(cells) for i in range(3)] + [[3.0]])
    c, t = WIDTH / 2, WIDTH / 2 * np.tan(theta)
    outline, A = shapely.box(0, 0, 2 * c, 4 * t), np.array([[c, -c], [t, t]])
    return with_edges(MeshTri(*cut_cells(outline, A, lines, lines - 1)))


def _graded(cells: int) -> ndarray:
    """Points in [0, 1), denser at both ends."""
    share = np.arange(cells) / cells
    from_end = np.minimum(share, 1 - share)
    moved = np.sinh(2 * GRADING * from_end) / np.sinh(GRADING) / 2
    return np.where(share <= 0.5, moved, 1 - moved)


@dataclass(frozen=True)
class Specimen:
    """A ply of height 2W tan θ, with the inclination of its warp in degrees.

    ``law`` is the name of a shear law, and ``ratio`` is E/G.
    """

    inclination: float
    law: str
    ratio: float

    def __str__(self) -> str:
        inclination, law, ratio = self.names
        return f"{inclination}, {law}, E/G = {ratio}"

    @property
    def names(self) -> tuple[str, str, str]:
        """Inclination, law and E/G as text."""
        ratio = f"{self.ratio:.0e}".replace("e+0", "e")
        return f"{self.inclination:g}°", self.law, ratio

    @property
    def row(self) -> Row:
        """Entries of the ply in rows."""
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

    def along_fibres(self, cells: int) -> Scene:
        """The scene on a fibre-aligned mesh with given cells along a rhombus side."""
        return self.scene(graded_mesh(float(np.radians(self.inclination)), cells))

    def stepper(self, scene: Scene, formulation: Formulation) -> LoadStepper:
        """The load stepper of the ply in a scene."""
        ply = Ply(scene.mesh, self.fabric(scene), formulation)
        return LoadStepper(ply, scene.conditions, STEPS)

    def loads(self, scene: Scene, result: Result) -> dict[int, float]:
        """Ratio of the load to the inextensible load, by shear angle in degrees.

        Values beyond the end of a failed run are nan.
        """
        assert scene.load is not None
        loads = dict.fromkeys(ANGLES, np.nan)
        for state in result.states[1:]:
            t = state.load_factor
            reached = [angle for angle in ANGLES if abs(angle - t * ANGLES[-1]) < 1e-9]
            for angle in reached:
                load = scene.reaction(state)[1] / scene.load(self.shear_law, t)
                loads[angle] = float(load)
        return loads

    def converged(self) -> Iterator[Row]:
        """Ratio of the converged to the inextensible load at each shear angle.

        ``apart`` is the difference to another formulation, ``halving`` the change on
        halving the cells, both relative to the load.  ``lost`` is the estimated
        fraction of the load lost to fibre stretch.

        Raises
        ------
        StepError
            If a run fails.
        """
        loads = []
        for formulation, cells in REFERENCES:
            scene = self.along_fibres(cells)
            result = self.stepper(scene, formulation).run()
            loads.append(self.loads(scene, result))
        other, coarse, answer = loads
        assert scene.load_lost is not None
        for angle in ANGLES:
            yield {
                "shear_angle": angle,
                "load": answer[angle],
                "apart": other[angle] / answer[angle] - 1,
                "halving": answer[angle] / coarse[angle] - 1,
                "lost": scene.load_lost(result.ply.fabric, angle / ANGLES[-1]),
            }


def limit(inclination: float, across: int) -> float:
    """Limit of the relative error of a median load."""
    return LIMITS[across] * (2 if inclination > STEEP else 1)


def agree(row: Row) -> bool:
    """Return True if formulations and meshes of a reference agree."""
    return max(abs(row["apart"]), abs(row["halving"])) <= AGREEMENT


@cache
def stored() -> dict[tuple[Specimen, int], Row]:
    """Stored converged loads by ply and shear angle.

    Raises
    ------
    FileNotFoundError
        If the file is missing.
    """
    rows = json.loads(FILE.read_text(encoding="utf-8"))
    return {(Specimen.of(row), row["shear_angle"]): row for row in rows}


SPECIMENS = tuple(Specimen(*given) for given in product(INCLINATIONS, LAWS, RATIOS))


@dataclass(frozen=True)
class Reference:
    """Computation of a converged load."""

    specimen: Specimen

    def __str__(self) -> str:
        return str(self.specimen)

    @errors_only()
    def rows(self) -> list[Row]:
        """A row for each shear angle."""
        return [
            self.specimen.row | {k: round(x, _DIGITS) for k, x in row.items()}
            for row in self.specimen.converged()
        ]


@dataclass(frozen=True)
class Judged:
    """The default formulation on an irregular mesh with given edges across."""

    specimen: Specimen
    elements: str
    across: int
    seed: int

    formulation: ClassVar[Formulation] = DEFAULT

    def __str__(self) -> str:
        mesh = f"{self.elements}, {self.across} across, seed {self.seed}"
        return f"{self.specimen}, {mesh}"

    def mesh(self) -> Mesh:
        """The mesh before internal splitting, of nearly square elements."""
        n, slope = self.across // 2, np.tan(np.radians(self.specimen.inclination))
        size, kind = (n, round(2 * n * slope)), MESHES[self.elements]
        return rectangle(WIDTH, 2 * WIDTH * slope, size, kind, JITTER, self.seed)

    def rows(self) -> list[Row]:
        """A row for each shear angle; loads beyond the end of a failed run are nan."""
        specimen = self.specimen
        scene = specimen.scene(self.mesh())
        with warnings_collected() as warnings:
            result, refused = run(specimen.stepper(scene, self.formulation))
        return [
            {
                **specimen.row,
                "elements": self.elements,
                "across": self.across,
                "seed": self.seed,
                "shear_angle": angle,
                "load": load,
                "load_over_reference": load / stored()[specimen, angle]["load"],
                "unknowns": result.ply.basis.N,
                "linear_solves": result.linear_solves,
                "seconds": result.wall_time_s,
                "warnings": " | ".join(warnings),
                "refused": refused,
            }
            for angle, load in specimen.loads(scene, result).items()
        ]


Case = Reference | Judged


def judged(seeds: tuple[int, ...], inclinations: tuple[float, ...]) -> Iterator[Judged]:
    """The cases with these seeds and inclinations."""
    for specimen in SPECIMENS:
        if specimen.inclination in inclinations:
            for options in product(MESHES, ACROSS, seeds):
                yield Judged(specimen, *options)
