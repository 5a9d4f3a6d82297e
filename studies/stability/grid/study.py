"""Bias extension against E/G and mesh distortion, in this library and other codes.

A ply of 50 × 100 mm with fibres at 45° and linear laws is stretched until the shear
angle at its centre is 40°.  The nodes of its mesh are moved at random; seeds that
invert an element are skipped.  Each load is compared with the converged load at the
same E/G, from quadratic triangles on graded, fibre-aligned meshes.

This library starts with one load step.  The other codes take plain Newton iterations in
the smallest number of equal steps, out of 1 to 80, that gives a stable equilibrium
without inverted elements.  `soundness` verifies all final states.
"""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import count, islice, product
from statistics import median
from typing import Any, ClassVar, NamedTuple, TypeAlias

import numpy as np

from skfem_textile.fabric import Fabric, Linear
from skfem_textile.mesh.checks import MeshError
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Macro, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.stepper import LoadStepper

from ...angles.cases import Specimen
from ...common.figures import File, panels_of
from ...common.rivals.codes import Dolfinx, FElupe
from ...common.rivals.newton import STEPS, NotConvergedError
from ...common.rivals.rival import QUAD4, TRIANGLE6, Rival, Task
from ...common.running import errors_only, run
from ...common.tables import scientific
from ...study import Part, Row, Study
from ..soundness import is_sound

#: Entries ``code`` of this library and of converged loads.
OURS, REFERENCE = "this library, macro-elements", "converged"

#: Largest accepted relative load error.
LIMIT = 0.05

#: Ratios E/G, and largest displacements of nodes relative to the spacing.
RATIOS = (1e2, 1e4, 1e5, 1e6, 1e8, 1e10)
DISTORTIONS = (0.0, 0.09, 0.18, 0.27, 0.36, 0.45)

#: Number of meshes of a cell with distortion.
MESHES = 3

#: Shear stiffness in N/mm, and shear angle at the centre in degrees.
G, ANGLE = 0.5, 40.0

#: Element edges across the ply, with split macro-elements and quadratic triangles.
ACROSS = 16

#: Other codes, with the formulations of this library of the same energy.
RIVALS: tuple[tuple[Rival, Formulation], ...] = (
    (FElupe(QUAD4), Full()),
    (Dolfinx(TRIANGLE6), Quadratic()),
)

# Width and height of the figure in inches, 160 mm in print.
_SIZE = 6.3, 2.9

# Bounds of the colours: load over converged load.
_BOUNDS = (0.1, 1 - LIMIT, 1 + LIMIT, 2.0, 10.0, 100.0, 1e4, 1e8)
_COLOURS = (
    *("#CC79A7", "#0072B2", "#fee391", "#fec44f", "#fe9929", "#cc4c02", "#662506"),
)

# Colours of cells without a result, and of numbers on dark and light cells.
_NO_RESULT, _ON_DARK, _ON_LIGHT = "#d9d9d9", "white", "black"

# Luminance below which a cell is dark.
_DARK = 0.5


@dataclass(frozen=True)
class Reference:
    """The converged load at E/G, from the study of angles with linear laws."""

    ratio: float
    code: ClassVar[str] = REFERENCE

    def __str__(self) -> str:
        return f"{REFERENCE}, E/G = {self.ratio:.0e}"

    def rows(self) -> list[Row]:
        """Ratio of the load to the inextensible load."""
        *_, row = Specimen(45.0, "linear", self.ratio).converged()
        shares = {name: row[name] for name in ("load", "halving", "apart")}
        return [{"code": self.code, "ratio": self.ratio, **shares}]


@dataclass(frozen=True)
class Ours:
    """The default formulation of this library on quadrilaterals."""

    ratio: float
    distortion: float
    seed: int
    code: ClassVar[str] = OURS

    def __str__(self) -> str:
        return _name(self)

    def rows(self) -> list[Row]:
        """Load, linear solves including abandoned steps, and soundness."""
        scene = _scene("irregular", ACROSS // 2, self.distortion, self.seed)
        ply = _ply(scene, self.ratio, Macro())
        result, note = run(LoadStepper(ply, scene.conditions, 1))
        last = result.states[-1]
        sound = is_sound(ply, scene, last.u, last.parameters)
        row = {
            "load": _load(scene, scene.reaction(last)),
            "steps": len(result.states) - 1,
            "linear_solves": result.linear_solves,
            "sound": result.converged and sound,
            "note": note,
        }
        return [_head(self) | row]


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

    def __str__(self) -> str:
        return _name(self)

    def rows(self) -> list[Row]:
        """Load, linear solves and soundness of the run with fewest steps."""
        return [_head(self) | self._run()]

    def _run(self) -> Row:
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
                end = rival.run(task, steps, repeats=0)
            except NotConvergedError as error:
                note = note or str(error)
                continue
            row = {
                "load": _load(scene, task.reaction(end.f)),
                "steps": steps,
                "linear_solves": end.linear_solves,
            }
            if is_sound(ply, scene, end.u):
                return row | {"sound": True, "note": ""}
            note = "not stable, or folded"
        return row | {"sound": False, "note": note}


Case: TypeAlias = Reference | Ours | Theirs


def _name(case: Ours | Theirs) -> str:
    mesh = f"{case.distortion:g}, seed {case.seed}"
    return f"{case.code}, E/G = {case.ratio:.0e}, {mesh}"


def _head(case: Ours | Theirs) -> Row:
    return {x: getattr(case, x) for x in ("code", "ratio", "distortion", "seed")}


def mesh_of(rival: Rival) -> tuple[str, int]:
    """Kind of mesh, and number of spacings across the ply."""
    kind = {"quads": "irregular", "triangles": "delaunay"}[rival.shape.mesh]
    return kind, ACROSS // rival.shape.parts


@cache
def seeds(kind: str, across: int, distortion: float) -> tuple[int, ...]:
    """The first seeds without inverted elements; one seed if meshes are regular."""
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
    """Ratio of the load to the inextensible load."""
    assert scene.load is not None
    return float(reaction[1] / scene.load(Linear(G), 1.0))


class Cell(NamedTuple):
    """Medians over meshes with different seeds.

    Attributes
    ----------
    load
        Load over converged load; None if most meshes have no result.
    solves
        Linear solves.
    """

    load: float | None = None
    solves: float | None = None


#: Cells of each code by E/G and distortion.
Cells: TypeAlias = dict[str, dict[tuple[float, float], Cell]]


def cells(rows: Sequence[Row]) -> Cells:
    """The cells of all codes, except cells without a converged load."""
    converged = {r["ratio"]: r["load"] for r in rows if r["code"] == REFERENCE}
    groups: dict[str, dict[tuple[float, float], list[Row]]] = {}
    for row in rows:
        if row.get("sound") is not None and row["ratio"] in converged:
            of_code = groups.setdefault(row["code"], {})
            of_code.setdefault((row["ratio"], row["distortion"]), []).append(row)
    return {
        code: {at: _cell(group, converged[at[0]]) for at, group in of_code.items()}
        for code, of_code in groups.items()
    }


def _cell(rows: list[Row], converged: float) -> Cell:
    sound = [row for row in rows if row["sound"]]
    if 2 * len(sound) <= len(rows):
        return Cell()
    loads = [row["load"] / converged for row in sound]
    solves = median(row["linear_solves"] for row in sound)
    return Cell(median(loads), solves)


def draw_grid(cells: Cells, file: File = None) -> Any:
    """Draw a panel for each code: colours are loads, numbers are linear solves."""
    import matplotlib as mpl
    from matplotlib.colors import BoundaryNorm, ListedColormap, to_rgb

    ratios = sorted({at[0] for of_code in cells.values() for at in of_code})
    distortions = sorted({at[1] for of_code in cells.values() for at in of_code})
    colours = ListedColormap(list(_COLOURS))
    norm = BoundaryNorm(_BOUNDS, len(_COLOURS))
    names = [code.replace(", ", "\n", 1) for code in cells]
    with panels_of(_SIZE, file, 8, names, ["E/G"], sharey=True) as (figure, grid):
        for axes, name, of_code in zip(grid[0], names, cells.values(), strict=True):
            axes.set_title(name, fontsize=9)
            pixels = np.ones((len(ratios), len(distortions), 3))
            for i, j in np.ndindex(pixels.shape[:2]):
                cell = of_code.get((ratios[i], distortions[j]), Cell())
                colour = _NO_RESULT if cell.load is None else colours(norm(cell.load))
                pixels[i, j] = to_rgb(colour)
                dark = np.dot(pixels[i, j], (0.299, 0.587, 0.114)) < _DARK
                text = "–" if cell.solves is None else f"{cell.solves:.0f}"
                style = {"ha": "center", "va": "center"}
                axes.text(j, i, text, color=_ON_DARK if dark else _ON_LIGHT, **style)
            axes.imshow(pixels, aspect="auto", origin="lower")
            axes.set_xticks(
                range(len(distortions)), [f"{x:g}"[-3:] for x in distortions]
            )
            axes.set_xticks(np.arange(0.5, len(distortions) - 1), minor=True)
            axes.set_yticks(np.arange(0.5, len(ratios) - 1), minor=True)
            axes.grid(which="minor", color="white", linewidth=0.8)
            axes.spines[:].set_visible(False)
            axes.tick_params(which="both", length=0)
        grid[0, 0].set_yticks(range(len(ratios)), map(scientific, ratios))
        grid[0, len(cells) // 2].set_xlabel("Largest move of a node / spacing")
        scale = mpl.cm.ScalarMappable(norm, colours)
        bar = figure.colorbar(scale, ax=list(grid[0]), pad=0.01, spacing="uniform")
        labels = f"{1 - LIMIT:g}", f"{1 + LIMIT:g}", "2", "10", "100", "10⁴"
        bar.set_ticks(_BOUNDS[1:-1], labels=labels)
        bar.set_label("Load / converged load")
    return figure


class Grid(Study[Case]):
    """All codes at all E/G and distortions."""

    parts = (
        Part(
            "grid.csv",
            pictures={
                "grid.png": lambda rows, file: draw_grid(cells(rows), file),
                "grid.svg": lambda rows, file: draw_grid(cells(rows), file),
            },
        ),
    )
    folder = "stability"
    sample = f"{OURS}, E/G = 1e+05, 0.45, seed 1"

    def cases(self, options: argparse.Namespace) -> list[Case]:
        """References, then this library, then other codes."""
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

    @errors_only()
    def examine(self, case: Case) -> list[Row]:
        """Run one case; loads are relative to the inextensible load."""
        return case.rows()

    def line(self, rows: list[Row]) -> str:
        (row,) = rows
        load = f"{row['load']:.4g}" if row.get("load") else row["note"]
        return f"{row['case']}: {load}"


STUDY = Grid()
