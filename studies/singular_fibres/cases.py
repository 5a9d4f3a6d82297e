"""Specimens drawn by a seed, and plies with holes, notches and corners."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import cycle, islice, product
from time import perf_counter
from typing import Any

import numpy as np

from skfem_textile import (
    Condition,
    Fabric,
    Linear,
    LoadStepper,
    Locking,
    Macro,
    Outline,
    Ply,
    Quadratic,
    Sin2,
    StepError,
    Tabulated,
    mesh_outline,
)
from skfem_textile.fabric.law import Law
from skfem_textile.ply.terms import Formulation

from ..study import Row

#: Seed and number of the specimens.
SEED, SPECIMENS = 2026, 100

#: Width of all plies in mm, and shear stiffness in N/mm.
WIDTH, G = 50.0, 0.5

#: Formulations on nets in the order of the tables: the default of `run`, and without
#: the mean stretch.
FORMULATIONS = Quadratic(400.0, points=6), Quadratic()

#: Formulations among which the first of these was chosen.
CANDIDATES: tuple[Formulation, ...] = (
    *FORMULATIONS,
    *(Quadratic(deviation, points=6) for deviation in (None, 100.0, 1600.0)),
    Quadratic(400.0),
    Macro(),
)

#: Density of the reference nets, and the formulations on them, the second stiffer.
FINE, REFERENCE = 3.0, (Quadratic(400.0, points=6), Quadratic(4000.0, points=6))

#: Angle in degrees of fibres to the clamps, at the end, from which on they are steep.
STEEP = 72.0

# Seeds of specimens that choose constants: any, and steep ones.
_OTHER_SEED, _STEEP_SEED = 5, 7

# Height over the height at which a fibre connects the clamps, at least.
_FREE = 1.1

_ANGLES = np.radians([0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0])
_MOMENTS = np.array([0.0, 0.08, 0.13, 0.18, 0.25, 0.4, 0.8, 1.8])

#: Shear laws by name.
LAWS: Mapping[str, Law] = {
    "linear": Linear(G),
    "sin²": Sin2(G),
    "locking": Locking(G, np.radians(62.0)),
    "table": Tabulated(_ANGLES, _MOMENTS, extrapolation="linear"),
}


@dataclass(frozen=True)
class Case:
    """A ply pulled at its top edge, on a net of a given density.

    Attributes
    ----------
    case
        Name.
    degrees, law, ratio
        Fibres at ± this angle to the clamps, name of the shear law, and E/G.
    travel
        Displacement of the top in mm.
    polygon, holes
        The outline, corners as pairs.
    densities, formulations
        Densities of the nets that are judged, and formulations on them.
    """

    case: str
    degrees: float
    law: str
    ratio: float
    travel: float
    polygon: tuple[tuple[float, float], ...]
    holes: tuple[tuple[tuple[float, float], ...], ...] = ()
    densities: tuple[float, ...] = (1.0,)
    formulations: tuple[Formulation, ...] = FORMULATIONS

    def __str__(self) -> str:
        return self.case

    @property
    def end_degrees(self) -> float:
        """Angle to the clamps at which inextensible fibres end."""
        theta, height = np.radians(self.degrees), max(y for _, y in self.polygon)
        free = (height / np.sin(theta) - WIDTH / np.cos(theta)) / 2
        sine = np.sin(theta) + self.travel / (2 * free)
        return float(np.degrees(np.arcsin(min(sine, 1.0))))

    def rows(self) -> list[Row]:
        """Load at the top on each net, against the mean of two on the finest."""
        # Cases differ in cost, so that one run is timed, after a first one.
        self.load(FORMULATIONS[0], min(self.densities))
        fine = [self.load(formulation, FINE)[0] for formulation in REFERENCE]
        known = [load for load in fine if load is not None]
        reference = float(np.mean(known)) if len(known) == len(fine) else None
        height = max(y for _, y in self.polygon)
        return [
            {
                "case": self.case,
                "formulation": formulation.title,
                "degrees": self.degrees,
                "height_over_width": height / WIDTH,
                "law": self.law,
                "ratio": self.ratio,
                "density": density,
                "unknowns": unknowns,
                "load": load,
                "reference": reference,
                "error": load / reference - 1 if load and reference else None,
                "spread": float(np.ptp(known)) / reference if reference else None,
                "half_width": half_width,
                "mesh_seconds": meshing,
                "seconds": seconds,
                "refused": refused,
            }
            for formulation, density in product(self.formulations, self.densities)
            for load, half_width, unknowns, meshing, seconds, refused in [
                self.load(formulation, density)
            ]
        ]

    def problem(self) -> tuple[Outline, Fabric, dict[str, Condition]]:
        """The outline, the fabric and the conditions."""
        holes = [np.transpose(hole) for hole in self.holes]
        outline = Outline(np.transpose(self.polygon), holes)
        angle = np.radians(self.degrees)
        warp = np.cos(angle), np.sin(angle)
        fabric = Fabric(self.ratio * G, LAWS[self.law], warp, (-warp[0], warp[1]))
        conditions = {
            "bottom": Condition("bottom"),
            "top": Condition("top", (0.0, self.travel)),
        }
        return outline, fabric, conditions

    def load(
        self, formulation: Formulation, density: float
    ) -> tuple[float | None, float | None, int, float, float, str]:
        """Load in N, half-width, unknowns, seconds of mesh and in all, and an error."""
        outline, fabric, conditions = self.problem()
        start = perf_counter()
        try:
            mesh = mesh_outline(outline, fabric, conditions, density=density)
            meshing = perf_counter() - start
            ply = Ply(mesh, fabric, formulation)
            result = LoadStepper(ply, conditions, steps=1).run()
        except (StepError, ValueError) as error:
            return None, None, 0, 0.0, perf_counter() - start, str(error)
        seconds, load = (
            perf_counter() - start,
            float(result.states[-1].reactions["top"][1]),
        )
        half_width = result.error.load if density < FINE else None
        return load, half_width, int(ply.basis.N), meshing, seconds, ""


def specimens(seed: int = SEED, n: int = SPECIMENS) -> Iterator[Case]:
    """Bias extensions in which fibres are free at both ends, drawn by a seed."""
    random = np.random.default_rng(seed)
    count = 0
    while count < n:
        degrees, ratio = random.uniform(30, 60), random.uniform(1.3, 4)
        gamma, stiffness = random.uniform(15, 47), 10 ** random.uniform(3, 6)
        law = str(random.choice(list(LAWS)))
        if ratio > _FREE * np.tan(np.radians(degrees)):
            count += 1
            yield specimen(f"specimen {count}", degrees, law, stiffness, ratio, gamma)


def specimen(
    name: str,
    degrees: float,
    law: str,
    ratio: float,
    sides: float,
    gamma: float,
    **more: Any,
) -> Case:
    """A bias extension of a given height over width and shear angle in degrees."""
    theta, half = np.radians(degrees), np.radians(gamma) / 2
    free = WIDTH / 2 * (sides / np.sin(theta) - 1 / np.cos(theta))
    travel = 2 * free * (np.sin(theta + half) - np.sin(theta))
    return Case(name, degrees, law, ratio, float(travel), box(sides * WIDTH), **more)


def box(height: float) -> tuple[tuple[float, float], ...]:
    """Corners of a ply of the usual width."""
    return (0.0, 0.0), (WIDTH, 0.0), (WIDTH, height), (0.0, height)


def circle(x: float, y: float, radius: float) -> tuple[tuple[float, float], ...]:
    """Corners of a circular hole."""
    angles = 2 * np.pi * np.arange(64) / 64
    points = zip(x + radius * np.cos(angles), y + radius * np.sin(angles), strict=True)
    return tuple((float(a), float(b)) for a, b in points)


def shapes() -> Iterator[Case]:
    """Plies with holes, notches and corners, for two fibre angles and laws."""
    H = 115.0
    notch = (WIDTH, 50.0), (WIDTH - 8, 55.0), (WIDTH, 60.0)
    outlines = {
        "hole": (box(H), (circle(22, 55, 10),)),
        "two holes": (box(H), (circle(15, 40, 6), circle(35, 72, 7))),
        "square hole": (box(H), (((18, 48), (32, 48), (32, 62), (18, 62)),)),
        "notch": ((*box(H)[:2], *notch, *box(H)[2:]), ()),
        "L": ((*box(H)[:2], (WIDTH, 60.0), (30.0, 60.0), (30.0, H), (0.0, H)), ()),
    }
    for (name, (polygon, holes)), (degrees, law, ratio, travel) in product(
        outlines.items(), ((41.0, "linear", 2e5, 12.0), (50.0, "sin²", 1e5, 9.0))
    ):
        yield Case(f"{name}, {degrees:g}°", degrees, law, ratio, travel, polygon, holes)


def chosen() -> Iterator[Case]:
    """Cases with which constants were chosen, other than those above."""
    others = (
        *((45.0, "linear", 1e5), (35.0, "locking", 5e5)),
        *((52.0, "sin²", 3e4), (47.0, "linear", 1e6)),
    )
    for case, (degrees, law, ratio) in zip(shapes(), cycle(others), strict=False):
        yield replace(
            case,
            case=f"chosen {case.case.partition(',')[0]}, {degrees:g} degrees",
            degrees=degrees,
            law=law,
            ratio=ratio,
            travel=7.0,
            formulations=CANDIDATES,
        )
    for i, case in enumerate(specimens(_OTHER_SEED, 24)):
        yield replace(case, case=f"chosen specimen {i}", formulations=CANDIDATES)
    steep = (case for case in specimens(_STEEP_SEED, 160) if case.end_degrees > STEEP)
    for i, case in enumerate(islice(steep, 12)):
        yield replace(case, case=f"chosen steep {i}", formulations=CANDIDATES)


def convergence() -> Iterator[Case]:
    """Bias extensions at four fibre stiffnesses, on four nets each."""
    for ratio, degrees in product((1e3, 1e5, 1e7, 1e9), (40.0, 55.0)):
        name = f"convergence, E/G = {ratio:.0e}, fibres at {degrees:g} degrees"
        yield specimen(
            name, degrees, "linear", ratio, 3.0, 30.0, densities=(0.25, 0.5, 1.0, 2.0)
        )
