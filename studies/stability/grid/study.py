"""Bias extension by E/G and distortion of the mesh, in this library and other codes.

A ply of 50 × 100 mm with its fibres at 45° is pulled until its middle has sheared by
40°, with linear laws.  The nodes of its mesh are moved at random; seeds that invert an
element of a code's mesh are passed over.  Each load is
compared with the converged load at the same E/G, from quadratic triangles on graded
meshes along the fibres.

This library begins with one load step.  The other codes take plain Newton iterations
in the smallest number of equal steps, out of 1 to 80, that ends on a stable, unfolded
equilibrium; `soundness` judges every end.
"""

import argparse
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import count, islice, product
from pathlib import Path
from typing import ClassVar, TypeAlias

import numpy as np

from skfem_textile.fabric import Fabric, Linear
from skfem_textile.mesh.checks import MeshError
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Macro, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.result import StepError
from skfem_textile.solve.stepper import LoadStepper

from ...angles.aligned_mesh import graded_mesh
from ...common.log import errors_only
from ...common.rivals.newton import STEPS, NotConvergedError
from ...common.rivals.rival import QUAD4, TRIANGLE6, Rival
from ...common.rivals.task import Task
from ...common.rivals.with_dolfinx import Dolfinx
from ...common.rivals.with_felupe import FElupe
from ...common.tables import csv_table
from ...study import Row, Study
from ..soundness import is_sound
from .tables import OURS, REFERENCE, cells, figures, markdown

#: Ratios E/G, and the largest moves of nodes as shares of the spacing.
RATIOS = (1e2, 1e4, 1e5, 1e6, 1e8, 1e10)
DISTORTIONS = (0.0, 0.09, 0.18, 0.27, 0.36, 0.45)

#: Number of meshes of a cell, unless its meshes are all the same.
MESHES = 3

#: Shear stiffness in N/mm, and shear angle of the middle in degrees.
G, ANGLE = 0.5, 40.0

#: Element edges across the ply, after macro-elements and quadratic triangles are split.
ACROSS = 16

#: Other codes, each with the formulation of this library that has the same energy.
RIVALS: tuple[tuple[Rival, Formulation], ...] = (
    (FElupe(QUAD4), Full()),
    (Dolfinx(TRIANGLE6), Quadratic()),
)

#: Formulations of the references, with cells along a side of a rhombus.  The last gives
#: the load, the one before has cells twice as wide, the first is another formulation.
REFERENCES: tuple[tuple[Formulation, int], ...] = (
    (Full(), 16),
    (Quadratic(), 16),
    (Quadratic(), 32),
)

# Grading of the meshes of the references, as in the study of angles, and load steps.
_GRADING, _REFERENCE_STEPS = 6.0, 8


@dataclass(frozen=True)
class Reference:
    """The converged load at E/G."""

    ratio: float

    @property
    def name(self) -> str:
        """A name that no other case has."""
        return f"{REFERENCE}, E/G = {self.ratio:.0e}"

    def row(self) -> Row:
        """The load over that of fibres that do not stretch.

        ``halving`` and ``apart`` are the changes of the load when cells are halved and
        with another formulation, as shares of the load.
        """
        loads = []
        for formulation, n in REFERENCES:
            mesh = graded_mesh(np.pi / 4, WIDTH, n, _GRADING)
            scene = bias_extension(mesh, shear_angle=np.radians(ANGLE))
            ply = _ply(scene, self.ratio, formulation)
            result = LoadStepper(ply, scene.conditions, _REFERENCE_STEPS).run()
            loads.append(_load(scene, scene.reaction(result.states[-1])))
        other, coarse, load = loads
        return {
            "code": REFERENCE,
            "ratio": self.ratio,
            "load": load,
            "halving": load / coarse - 1,
            "apart": other / load - 1,
        }


@dataclass(frozen=True)
class Ours:
    """The default formulation of this library on quadrilaterals."""

    ratio: float
    distortion: float
    seed: int
    code: ClassVar[str] = OURS

    @property
    def name(self) -> str:
        """A name that no other case has."""
        return _name(self.code, self.ratio, self.distortion, self.seed)

    def row(self) -> Row:
        """Load, linear solves with those of abandoned steps, and soundness."""
        scene = _scene("irregular", ACROSS // 2, self.distortion, self.seed)
        ply = _ply(scene, self.ratio, Macro())
        try:
            result, note = LoadStepper(ply, scene.conditions, 1).run(), ""
        except StepError as error:
            result, note = error.result, str(error)
        last = result.states[-1]
        sound = is_sound(ply, scene, last.u, last.parameters)
        return {
            "load": _load(scene, scene.reaction(last)),
            "steps": len(result.states) - 1,
            "linear_solves": result.linear_solves,
            "sound": result.converged and sound,
            "note": note,
        }


@dataclass(frozen=True)
class Theirs:
    """Another code, by its number in `RIVALS`."""

    rival: int
    ratio: float
    distortion: float
    seed: int

    @property
    def code(self) -> str:
        """The code and its element."""
        rival, _ = RIVALS[self.rival]
        return f"{rival.code}, {rival.shape.name}"

    @property
    def name(self) -> str:
        """A name that no other case has."""
        return _name(self.code, self.ratio, self.distortion, self.seed)

    def row(self) -> Row:
        """Load, linear solves and soundness of the run with the fewest steps."""
        rival, formulation = RIVALS[self.rival]
        if missing := rival.missing():
            return {"note": f"skipped, not installed: {missing}"}
        scene = _scene(*mesh_of(rival), self.distortion, self.seed)
        shape, E = rival.shape, self.ratio * G
        task = Task(scene, shape.element, shape.rule, E, G)
        ply = _ply(scene, self.ratio, formulation)
        row: Row = {"load": None, "steps": None, "linear_solves": None}
        note = ""
        for steps in STEPS:
            try:
                run = rival.run(task, steps, repeats=0)
            except NotConvergedError as error:
                note = note or str(error)
                continue
            row = {
                "load": _load(scene, task.reaction(run.f)),
                "steps": steps,
                "linear_solves": run.linear_solves,
            }
            if is_sound(ply, scene, run.u):
                return row | {"sound": True, "note": ""}
            note = "not stable, or folded"
        return row | {"sound": False, "note": note}


Case: TypeAlias = Reference | Ours | Theirs


class Grid(Study[Case]):
    """Every code at every E/G and distortion."""

    files = ("grid.csv", "grid.md")
    pictures = ("grid.png", "grid.svg")
    folder = "stability"
    sample = f"{OURS}, E/G = 1e+05, 0.45, seed 1"

    def cases(self, options: argparse.Namespace) -> list[Case]:
        """The references first."""
        cells = list(product(RATIOS, DISTORTIONS))
        ours = [
            Ours(ratio, distortion, seed)
            for ratio, distortion in cells
            for seed in seeds("irregular", ACROSS // 2, distortion)
        ]
        theirs = [
            Theirs(i, ratio, distortion, seed)
            for (i, (rival, _)), (ratio, distortion) in product(
                enumerate(RIVALS), cells
            )
            for seed in seeds(*mesh_of(rival), distortion)
        ]
        return [*map(Reference, RATIOS), *ours, *theirs]

    def name(self, case: Case) -> str:
        return case.name

    @errors_only()
    def examine(self, case: Case) -> list[Row]:
        """Run one case; loads are shares of the load of fibres that do not stretch."""
        if isinstance(case, Reference):
            return [case.row()]
        of_case = "code", "ratio", "distortion", "seed"
        return [{name: getattr(case, name) for name in of_case} | case.row()]

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        mesh = f", {row['distortion']:g}, seed {row['seed']}" if "seed" in row else ""
        load = f"{row['load']:.4g}" if row.get("load") else row["note"]
        return f"{row['code']}, E/G = {row['ratio']:.0e}{mesh}: {load}"

    def tables(self, rows: list[Row]) -> dict[str, str]:
        return {"grid.csv": csv_table(rows), "grid.md": markdown(rows)}

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return figures(rows)

    def draw(self, rows: list[Row], folder: Path) -> None:
        from .figure import draw_grid

        for name in self.pictures:
            draw_grid(cells(rows), folder / name)


STUDY = Grid()


def _name(code: str, ratio: float, distortion: float, seed: int) -> str:
    return f"{code}, E/G = {ratio:.0e}, {distortion:g}, seed {seed}"


def mesh_of(rival: Rival) -> tuple[str, int]:
    """Kind of the mesh, and number of spacings across the ply."""
    kind = {"quads": "irregular", "triangles": "delaunay"}[rival.shape.mesh]
    return kind, ACROSS // rival.shape.parts


@cache
def seeds(kind: str, across: int, distortion: float) -> tuple[int, ...]:
    """The first seeds that invert no element; one if all meshes are the same."""
    return tuple(islice(_valid(kind, across, distortion), MESHES if distortion else 1))


def _valid(kind: str, across: int, distortion: float) -> Iterator[int]:
    for seed in count(1):
        with suppress(MeshError):
            _scene(kind, across, distortion, seed)
            yield seed


def _scene(kind: str, across: int, distortion: float, seed: int) -> Scene:
    size = across, 2 * across
    mesh = rectangle(WIDTH, 2 * WIDTH, size, kind, distortion, seed)
    return bias_extension(mesh, shear_angle=np.radians(ANGLE))


def _ply(scene: Scene, ratio: float, formulation: Formulation) -> Ply:
    fabric = Fabric(ratio * G, G, scene.warp, scene.weft)
    return Ply(scene.mesh, fabric, formulation)


def _load(scene: Scene, reaction: np.ndarray) -> float:
    """The load over that of fibres that do not stretch."""
    assert scene.load is not None
    return float(reaction[1] / scene.load(Linear(G), 1.0))
