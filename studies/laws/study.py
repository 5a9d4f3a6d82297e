"""Load error of the bias extension with five constitutive laws.

The references use fibre-aligned quadratic triangles, as in the study of angles.  The
default formulation is tested on irregular quadrilaterals and Delaunay triangles.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from skfem import Mesh

from skfem_textile.fabric import CrimpToe, Fabric, Law, Linear, Tabulated, TensionOnly
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, OnePoint, Quadratic
from skfem_textile.ply.ply import DEFAULT
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.stepper import LoadStepper

from ..angles.cases import (
    ACROSS,
    AGREEMENT,
    ANGLES,
    JITTER,
    JUDGING,
    LIMITS,
    STEPS,
    G,
    Specimen,
    graded_mesh,
)
from ..common.figures import File, legend, panels_of, style_of
from ..common.running import run, warnings_collected
from ..common.tables import furthest, having, markdown_table, median, percent
from ..study import Part, Row, Study

#: The specimen of the study of angles with the linear law, whose meshes, references and
#: limits this study uses.
SPECIMEN = Specimen(45.0, "linear", 2e5)

#: Sides in mm, and final shear angle in radians.
SIDES, ANGLE = (50.0, 100.0), np.radians(ANGLES[-1])

#: Load steps of the second runs with steep shear.
MORE_STEPS = 2 * STEPS

#: Stiffness of straightened fibres in N/mm.
E = SPECIMEN.ratio * G

SEEDS = JUDGING[0]


@dataclass(frozen=True)
class Material:
    """Tension law, for both families or for warp and weft, and shear law."""

    name: str
    tension: Law | float | tuple[float, float] = E
    shear: Law | float = G

    def fabric(self, scene: Scene) -> Fabric:
        """The fabric of the scene."""
        return Fabric(self.tension, self.shear, scene.warp, scene.weft)


def _steep_shear() -> Tabulated:
    """A tabulated shear law whose slope rises a hundredfold from 30° to 55°."""
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
    """A formulation on meshes with given element edges across, by seed."""

    name: str
    mesh: Callable[[int, int], Mesh]
    formulation: Formulation
    steps: int = STEPS


def _irregular(kind: str, parts: int, across: int, seed: int) -> Mesh:
    """A mesh whose edges the formulation divides into parts."""
    n = across // parts
    return rectangle(*SIDES, (n, 2 * n), kind, JITTER, seed)


def _along_fibres(cells: int, seed: int) -> Mesh:
    return graded_mesh(np.pi / 4, cells)


#: The tested methods, and one for comparison.
QUADS = Method("default, quads", partial(_irregular, "irregular", 2), DEFAULT)
TRIANGLES = Method("default, triangles", partial(_irregular, "delaunay", 2), DEFAULT)
ONE_POINT = Method("one point, quads", partial(_irregular, "irregular", 1), OnePoint())
JUDGED = {QUADS: SEEDS, TRIANGLES: SEEDS, ONE_POINT: SEEDS[:3]}
IN_MORE_STEPS = {
    replace(m, name=f"{m.name}, {MORE_STEPS} steps", steps=MORE_STEPS): SEEDS
    for m in (QUADS, TRIANGLES)
}


def judged_methods(material: Material) -> dict[Method, tuple[int, ...]]:
    """The methods tested with a material, and their seeds."""
    return JUDGED | IN_MORE_STEPS if material is STEEP_SHEAR else JUDGED


#: References with numbers of cells along a rhombus side; the last is the converged one.
FULL = Method("full", _along_fibres, Full())
QUADRATIC = Method("quadratic", _along_fibres, Quadratic())
REFERENCES = (FULL, 16), (QUADRATIC, 16), (QUADRATIC, 32)


@dataclass(frozen=True)
class Case:
    """A run with a material and a method on a mesh.

    ``across`` is the number of element edges across; for references, the number of
    cells along a rhombus side.
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
        """Run the case; the load is nan if the run fails."""
        method, scene = self.method, self.scene()
        ply = Ply(scene.mesh, self.material.fabric(scene), method.formulation)
        with warnings_collected() as warnings:
            result, refused = run(LoadStepper(ply, scene.conditions, method.steps))
        load = float(scene.reaction(result.states[-1])[1])
        row = {
            "group": self.group,
            "material": self.material.name,
            "method": method.name,
            "across": self.across,
            "seed": self.seed,
            "steps": method.steps,
            "unknowns": ply.basis.N,
            "load": np.nan if refused else load,
            "linear_solves": result.linear_solves,
            "seconds": result.wall_time_s,
            "warnings": " | ".join(warnings),
            "refused": refused,
        }
        return [row]


def all_cases() -> Iterator[Case]:
    """All cases."""
    for material in MATERIALS:
        for method, cells in REFERENCES:
            yield Case("reference", material, method, cells, 0)
    for material in MATERIALS:
        for method, seeds in judged_methods(material).items():
            for across, seed in product(ACROSS, seeds):
                yield Case("judged", material, method, across, seed)


# Horizontal offset between methods in the figure.
_SPREAD = 0.25


def of(rows: Sequence[Row], material: Material, method: Method, n: int) -> list[Row]:
    """Rows of the cases with a material, a method and n edges across."""
    return having(rows, material=material.name, method=method.name, across=n)


def converged(rows: Sequence[Row], material: Material) -> float:
    """Load of the finest reference in N; nan if missing."""
    return _loads(rows, material)[-1]


def errors(
    rows: Sequence[Row], material: Material, method: Method, across: int
) -> np.ndarray:
    """Relative load errors of the seeds; nan if a run fails."""
    end = converged(rows, material)
    selected = of(rows, material, method, across)
    return np.array([row["load"] / end - 1 for row in selected])


def _loads(rows: Sequence[Row], material: Material) -> list[float]:
    """Loads of the references in N; nan if missing."""
    groups = (of(rows, material, *reference) for reference in REFERENCES)
    return [group[0]["load"] if group else np.nan for group in groups]


def _differences(loads: Sequence[float]) -> tuple[float, float]:
    """Relative differences: other formulation to finest, and last halving."""
    other, coarse, finest = loads
    return other / finest - 1, finest / coarse - 1


def references(rows: Sequence[Row]) -> str:
    """Loads of the references and their differences."""
    lines = []
    for material in MATERIALS:
        loads = _loads(rows, material)
        off = _differences(loads)
        texts = [f"{x:.2f}" if np.isfinite(x) else "-" for x in loads]
        agree = "yes" if max(map(abs, off)) <= AGREEMENT else "no"
        lines.append([material.name, *texts, *map(percent, off), agree])
    head = [f"{method.name}, {cells} cells: N" for method, cells in REFERENCES]
    head += ["apart", "last halving", f"within {100 * AGREEMENT:g} %"]
    return markdown_table(["material", *head], lines)


def judged(rows: Sequence[Row]) -> str:
    """Load errors: medians and worst seeds."""
    lines = [
        [
            *(material.name, method.name),
            *(text for n in ACROSS for text in _cells(rows, material, method, n)),
        ]
        for material in MATERIALS
        for method in judged_methods(material)
    ]
    head = ["material", "method"]
    for across in ACROSS:
        limit = f"within {100 * LIMITS[across]:g} %"
        head += [f"{across} across: median", "worst", limit, "warned"]
    return markdown_table(head, lines)


def _cells(
    rows: Sequence[Row], material: Material, method: Method, across: int
) -> list[str]:
    """Median, worst error, check of the median against the limit, and warnings."""
    off, limit = errors(rows, material, method, across), LIMITS[across]
    known = off[np.isfinite(off)]
    if not known.size:
        return ["-"] * 4
    middle, passed = np.median(known), np.sum(np.abs(known) <= limit)
    refused = off.size - known.size
    return [
        percent(middle) + (f" ({refused} refused)" if refused else ""),
        percent(furthest(known)),
        f"{'yes' if abs(middle) <= limit else 'no'}, {passed} of {off.size}",
        warned(of(rows, material, method, across)),
    ]


def warned(rows: Sequence[Row]) -> str:
    """Subjects of warnings, each with the number of runs.

    Examples
    --------
    >>> path = "the path was not resolved"
    >>> texts = (path, f"load factor 1: deviations contribute 12% | {path}", None)
    >>> warned([{"warnings": text} for text in texts])
    'deviations 1, path 2'
    """
    counts = Counter(
        subject
        for row in rows
        for subject in {_subject(x) for x in (row["warnings"] or "").split(" | ") if x}
    )
    return ", ".join(f"{subject} {n}" for subject, n in sorted(counts.items())) or "-"


def _subject(warning: str) -> str:
    """The first noun of a warning."""
    text = warning.partition(": ")[2] if warning.startswith("load factor") else warning
    return text.removeprefix("the ").split()[0]


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results quoted on pages, by name."""
    medians = {
        key: median(errors(rows, *key))
        for key in product(MATERIALS, (QUADS, TRIANGLES), ACROSS)
    }
    passed = (
        sum(abs(x) <= share * LIMITS[across] for (*_, across), x in medians.items())
        for share in (1.0, 0.5)
    )
    words = dict(zip(_MET, (f"{n} of {len(medians)}" for n in passed), strict=True))
    for across in ACROSS:
        quads, triangles = (
            {m: abs(medians[m, method, across]) for m in MATERIALS}
            for method in (QUADS, TRIANGLES)
        )
        steep = triangles.pop(STEEP_SHEAR)
        words |= {
            f"quads_{across}": percent(max(quads.values()), ".1f"),
            f"triangles_{across}_steep": percent(steep, ".1f"),
            f"triangles_{across}_others": percent(max(triangles.values()), ".1f"),
        }
    return words


_MET = "met", "met_half"


def draw_errors(rows: Sequence[Row], file: File = None) -> Any:
    """Draw load errors: a panel for each refinement, a point for each mesh."""
    methods = judged_methods(LINEAR)
    styles = [style_of(i, markersize=4.0, linestyle="") for i in range(len(methods))]
    titles = [f"{across} across" for across in LIMITS]
    labels = ["Error of the load (%)"]
    with panels_of((8.0, 3.8), file, 9, titles, labels, sharey=True) as (figure, grid):
        for axes, (across, limit) in zip(grid[0], LIMITS.items(), strict=True):
            axes.axhspan(-100 * limit, 100 * limit, color="0.9")
            for position, material in enumerate(MATERIALS):
                for i, (method, style) in enumerate(zip(methods, styles, strict=True)):
                    off = 100 * errors(rows, material, method, across)
                    x = np.full(len(off), position + _SPREAD * (i - 1))
                    axes.plot(x, off, alpha=0.7, **style)
            names = [material.name for material in MATERIALS]
            axes.set_xticks(range(len(names)), names, rotation=20)
            axes.grid(alpha=0.3, axis="y")
        named = zip((method.name for method in methods), styles, strict=True)
        legend(figure, dict(named), len(methods))
    return figure


class Laws(Study[Case]):
    """All materials with all methods."""

    parts = (
        Part(
            "laws.csv",
            {"references.md": references, "judged.md": judged},
            {"laws.png": draw_errors},
        ),
    )
    shown = "{load:.3f} N, {linear_solves} solves, {seconds:.1f} s"
    sample = "linear: default, quads, 16 across, 1"

    def cases(self, options: argparse.Namespace) -> list[Case]:
        return list(all_cases())

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)


STUDY = Laws()
