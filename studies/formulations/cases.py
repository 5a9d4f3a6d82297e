"""Methods, problems and cases of the study of formulations."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from skfem import Mesh

from skfem_textile import Condition
from skfem_textile.fabric import Fabric, Law, Linear, Sin2
from skfem_textile.mesh.splitting import split
from skfem_textile.ply import Ply
from skfem_textile.ply.formulations import Full, Kind, Macro, OnePoint, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension, picture_frame, strip, trellis
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.scenes.strip import HEIGHT, WIDTH
from skfem_textile.scenes.trellis import SIDE
from skfem_textile.solve.result import Result
from skfem_textile.solve.stepper import LoadStepper

from ..common.running import errors_only, run
from ..common.tables import Row

#: Shear stiffness in N/mm and shear angles in degrees of the bias extension.
G, ANGLES = 0.5, (10, 20, 30, 40, 50)

#: Refinements: element edges across the scene, after any splitting.
ACROSS = (8, 16, 32)

#: The finest refinement, for the remaining load error.
RESOLVED = 64

SEEDS = (1, 2, 3, 4, 5)


@dataclass(frozen=True)
class Method:
    """An element and a kind of mesh.

    ``mesh`` is ``quads`` or ``triangles``.  ``parts`` is the number of parts of a split
    edge, 2 for quadratic triangles.  The stabilisation of a ``scaled`` method is a
    multiple of C, eight times the initial shear stiffness.
    """

    name: str
    mesh: str
    parts: int
    unscaled: Any
    scaled: bool = False

    def formulation(self, C: float) -> Formulation:
        """The formulation."""
        made: Formulation = self.unscaled
        if self.scaled:
            made = replace(self.unscaled, stabilisation=C * self.unscaled.stabilisation)
        return made


def _scaled(name: str, k: float, kind: Kind = "energy") -> Method:
    return Method(name, "quads", 1, OnePoint(k, kind), scaled=True)


MACRO = Method("macro, quads", "quads", 2, Macro())
MACRO_TRIANGLES = Method("macro, triangles", "triangles", 2, Macro())
AUTO = Method("one point, auto", "quads", 1, OnePoint())
PAPER = Method("one point, C_s = 1 N/mm", "quads", 1, OnePoint(1.0))
MEAN_QUADRATIC = Method(
    "quadratic, mean stretch", "triangles", 2, Quadratic(deviation=80.0)
)

QUADRATIC = Method("quadratic", "triangles", 2, Quadratic())
SPLIT_ONE_POINT = Method("one point, triangles", "triangles", 2, OnePoint())
FULL = Method("2×2 points", "quads", 1, Full())

#: Methods that lock at jumps of the shear angle, at any E/G.
LOCKING = QUADRATIC, FULL

#: One or two methods of each formulation, parameter-free ones first.
METHODS = (
    *(MACRO, MACRO_TRIANGLES, AUTO, SPLIT_ONE_POINT, MEAN_QUADRATIC, QUADRATIC),
    *(PAPER, Method("rates, C_s = 1 N/mm", "quads", 1, OnePoint(1.0, "rate"))),
    _scaled("continuity, C_j = C", 1.0, "continuity"),
    _scaled("isotropic, κ = C", 1.0, "isotropic"),
    _scaled("isotropic, κ = C/8", 1 / 8, "isotropic"),
    FULL,
)

#: Other constants: C_s of one-point elements, and the deviation stiffness.
STABILISATIONS = (
    *(_scaled(f"C_s = {k:g} C", k) for k in (1 / 32, 1 / 8, 1 / 4, 1 / 2, 2, 4, 8, 32)),
    *(
        Method(f"macro, C_s = {k:g} C", "quads", 2, Macro(k), scaled=True)
        for k in (1 / 8, 1 / 4, 1 / 2, 2, 4, 8)
    ),
)
DEVIATIONS = tuple(
    Method(f"{mesh}, {c:g}", mesh, 2, Macro(deviation=(c, c)))
    for mesh, chosen in zip(("triangles", "quads"), Macro().deviation, strict=True)
    for c in (chosen / 4, chosen / 2, chosen * 2, chosen * 4)
)


@dataclass(frozen=True)
class Specimen:
    """A scene and a material.

    The load is applied in ``steps`` steps; results are evaluated after step ``last``.
    ``exact_load`` is the expected load: zero in N, or one relative to the exact load.
    """

    name: str
    scene: Callable[[Mesh], Scene]
    sides: tuple[float, float]
    jitter: float
    E: float
    law: Law
    steps: int
    last: int
    exact_load: float = 0.0

    @property
    def stabilisation(self) -> float:
        """C of the methods in N/mm: 8 G, or 10⁻⁴ E without shear stiffness."""
        initial = float(self.law.tangent(np.zeros(1))[0])
        return 8 * initial if initial else 1e-4 * self.E

    def fabric(self, scene: Scene) -> Fabric:
        """The fabric of the scene."""
        return Fabric(self.E, self.law, scene.warp, scene.weft)

    def mesh(self, cells: str, n: int, seed: int) -> Mesh:
        """A mesh of ``quads`` or ``triangles``, n edges wide."""
        W, H = self.sides
        kind = {"quads": "irregular", "triangles": "delaunay"}[cells]
        return rectangle(W, H, (n, round(n * H / W)), kind, self.jitter, seed)


def _bias_extension(mesh: Mesh) -> Scene:
    return bias_extension(mesh, shear_angle=np.radians(ANGLES[-1]))


def _bias(ratio: float, law: Law) -> Specimen:
    name = f"bias extension, {'linear' if isinstance(law, Linear) else 'sin²'}"
    return Specimen(
        f"{name}, E/G = {ratio:.0e}".replace("e+0", "e"),
        *(_bias_extension, (50.0, 100.0), 0.25, ratio * G, law, 5, 4, 1.0),
    )


RATIOS = (2e4, 2e5, 2e6)
STRIP = Specimen("strip", strip, (WIDTH, HEIGHT), 0.3, 1e4, Linear(0.0), 5, 5)
TRELLIS = Specimen("trellis", trellis, (SIDE, SIDE), 0.3, 1e4, Linear(0.0), 5, 5)
SHEARED = replace(TRELLIS, name="trellis, E/G = 2e5", E=2e5 * G, law=Linear(G))
FRAME = Specimen(
    "picture frame", picture_frame, (SIDE, SIDE), 0.3, 1e4, Linear(0.5), 5, 5
)
BIAS = tuple(_bias(ratio, Linear(G)) for ratio in RATIOS)
BIAS_SIN2 = tuple(_bias(ratio, Sin2(G)) for ratio in RATIOS)

#: The methods with a limit for the load error.
FOR_LOAD = (MACRO, MACRO_TRIANGLES, AUTO, MEAN_QUADRATIC)


@dataclass(frozen=True)
class Case:
    """A run of a method on a problem, with a number of edges across and a seed."""

    group: str
    problem: Specimen
    method: Method
    across: int
    seed: int

    def __str__(self) -> str:
        names = f"{self.group}: {self.problem.name}, {self.method.name}"
        return f"{names}, {self.across} across, {self.seed}"

    def scene(self) -> Scene:
        """The scene, on the mesh of the method."""
        method, formulation = self.method, self.method.formulation(1.0)
        mesh = self.problem.mesh(method.mesh, self.across // method.parts, self.seed)
        if method.parts == 2 and not isinstance(formulation, Quadratic):
            mesh = split(mesh)
        return self.problem.scene(mesh)

    @errors_only()
    def rows(self) -> list[Row]:
        """Run the case; its row contains nan for results beyond a failed step."""
        problem, scene = self.problem, self.scene()
        formulation = self.method.formulation(problem.stabilisation)
        ply = Ply(scene.mesh, problem.fabric(scene), formulation)
        result, refused = run(LoadStepper(ply, scene.conditions, problem.steps))
        row = {
            "group": self.group,
            "problem": problem.name,
            "method": self.method.name,
            "across": self.across,
            "seed": self.seed,
            "elements": ply.mesh.nelements,
            "unknowns": ply.basis.N,
            **_figures(scene, result, problem.last / problem.steps),
            **_loads(scene, result, problem.steps),
            "seconds": result.wall_time_s,
            "refused": refused,
        }
        return [row]


_FIGURES = (
    *("load", "position", "angle", "strain", "mesh_fibre_strain", "min_det_F"),
    *("negative_pivots", "stabilisation_share", "linear_solves"),
)


def _figures(scene: Scene, result: Result, t: float) -> Row:
    """Results of the state at the load factor t."""
    reached = [s for s in result.states if s.load_factor <= t + 1e-9]
    if reached[-1].load_factor < t - 1e-9:
        return dict.fromkeys(_FIGURES, np.nan)
    summary: Row = scene.summary(replace(result, states=reached))
    driven = scene.conditions[scene.driven]
    assert isinstance(driven, Condition)
    led = driven.direction  # None: magnitude of the force
    force = np.array([summary["reaction_x"], summary["reaction_y"]])
    values = (
        float(np.linalg.norm(force if led is None else force @ np.asarray(led)))
        if scene.load is None
        else summary["load_over_exact"],
        summary["displacement_error_rms"],
        summary["shear_angle_error_rms_deg"],
        summary["max_fibre_strain"],
        summary["mesh_fibre_strain"],
        summary["min_det_F"],
        summary["negative_pivots"],
        summary["stabilisation_energy"] / summary["energy"],
        sum(state.linear_solves for state in reached),
    )
    return dict(zip(_FIGURES, values, strict=True))


def _loads(scene: Scene, result: Result, steps: int) -> dict[str, float]:
    """Ratio of the load to the exact load at each shear angle, if known."""
    ratios = {f"load_{angle}": np.nan for angle in ANGLES}
    if scene.load is None:
        return ratios
    for state in result.states[1:]:
        step = state.load_factor * steps
        if abs(step - round(step)) < 1e-9:
            exact = scene.load(result.ply.fabric.shear_law, state.load_factor)
            angle = ANGLES[round(step) - 1]
            ratios[f"load_{angle}"] = scene.reaction(state)[1] / exact
    return ratios


def all_cases() -> Iterator[Case]:
    """All cases; one table per group."""
    every = (STRIP, TRELLIS, FRAME, *BIAS)
    yield from _grid("methods", every, METHODS, ACROSS)
    yield from _grid("methods", BIAS_SIN2, FOR_LOAD, ACROSS)
    yield from _grid("methods", [SHEARED], (*FOR_LOAD, PAPER), ACROSS[:2])
    for problem, method in product(BIAS, (MACRO, AUTO)):
        yield Case("resolved", problem, method, RESOLVED, SEEDS[0])
    tuned = (STRIP, TRELLIS, *BIAS)
    yield from _grid("stabilisation", tuned, STABILISATIONS, ACROSS[1:2])
    yield from _grid("deviation", (*BIAS, *BIAS_SIN2), DEVIATIONS, ACROSS[:2])
    for seed, n in enumerate((12, 14, 17, 20, 22, 25, 28, 31, 34, 36), start=1):
        for E in (1e4, 1e6):
            problem = replace(
                STRIP, name=f"strip, E = {E:.0e}".replace("e+0", "e"), E=E
            )
            yield Case("triangulations", problem, MACRO_TRIANGLES, 2 * n, seed)


def _grid(
    group: str,
    problems: Iterable[Specimen],
    methods: Iterable[Method],
    across: Iterable[int],
) -> Iterator[Case]:
    for problem, method, n, seed in product(problems, methods, across, SEEDS):
        yield Case(group, problem, method, n, seed)
