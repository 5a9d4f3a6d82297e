"""Plies drawn by a seed, by class, with converged loads."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import cycle, islice
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from skfem import Mesh

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    Force,
    Full,
    Linear,
    LoadStepper,
    Locking,
    Macro,
    OnePoint,
    Outline,
    Ply,
    Quadratic,
    StepError,
    Tabulated,
    TensionOnly,
    ToleranceStepper,
    mesh_outline,
    singular_fibres,
)
from skfem_textile.io import read_mesh
from skfem_textile.outlines.meshing import FINEST, irregular
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.interval import work_of

from ..singular_fibres import cases as nets
from ..singular_fibres.cases import LAWS, WIDTH, G, box, circle, specimens
from ..singular_fibres.irregular import angle_error
from ..study import Row
from .foundation import Foundation

#: Formulation of `run` on nets, and a stiffer one for the references.
ON_NETS, OTHER = Quadratic(400.0, points=6), Quadratic(4000.0, points=6)

#: Tolerance of runs to a tolerance, and seeds of the cases that choose constants, of
#: those that are judged, and of the runs.
TOLERANCE, CHOOSING, JUDGING, RUNS = 0.01, 41, 20261127, 20261128

# Height of plies with holes in mm, and density of the references of `_plates`.
_HEIGHT, _OF_PLATES = 115.0, 2.0

# Last of the kinds of `_loaded`, from 0.
_ROLLERS = 3

_PLATES = Path(__file__).parent / "plates"


class Problem(NamedTuple):
    """An outline, its fabric, the conditions and loads, and the number of steps.

    ``fine`` is the density of the reference.
    """

    outline: Outline
    fabric: Fabric
    conditions: dict[str, Any]
    loads: tuple[Any, ...] = ()
    steps: int = 1
    fine: float = nets.FINE

    def net(self, density: float = 1.0) -> Mesh:
        """The net of a density."""
        arguments = self.outline, self.fabric, self.conditions, self.loads
        return mesh_outline(*arguments, density=density)

    def stepper(self, mesh: Mesh, formulation: Formulation) -> LoadStepper:
        """Load stepper on a mesh."""
        ply = Ply(mesh, self.fabric, formulation, self.loads)
        return LoadStepper(ply, self.conditions, self.steps)

    def reference(self) -> tuple[float, float] | None:
        """Converged work and the relative difference of two formulations.

        None if the load cannot be applied.
        """
        works, mesh = [], self.net(self.fine)
        for formulation in (ON_NETS, OTHER):
            stepper = self.stepper(mesh, formulation)
            try:
                works.append(_work(stepper))
            except StepError:
                if not works:
                    return None
        return float(np.mean(works)), float(np.ptp(works) / abs(np.mean(works)))


def _work(stepper: LoadStepper) -> float:
    return work_of(stepper.problem.at(1.0), stepper.run().states[-1])


@dataclass(frozen=True)
class Judged:
    """A ply whose interval is compared with the converged load.

    Attributes
    ----------
    case, kind
        Name and class.
    problem
        The problem.
    formulation
        The formulation.
    mesh
        The mesh; by default a net.
    sheared
        True if the error of the shear angle is measured, on plies without holes.
    """

    case: str
    kind: str
    problem: Problem
    formulation: Formulation = ON_NETS
    mesh: Mesh | None = None
    sheared: bool = False

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Error and interval of the load."""
        problem = self.problem
        row: Row = {"case": self.case, "kind": self.kind}
        row["formulation"] = self.formulation.title
        if (reference := problem.reference()) is None:
            return [{**row, "refused": "no reference"}]
        mesh = problem.net() if self.mesh is None else self.mesh
        stepper = problem.stepper(mesh, self.formulation)
        start = perf_counter()
        try:
            result = stepper.run()
        except StepError as refusal:
            return [{**row, "refused": str(refusal)}]
        ran = perf_counter()
        error = result.error
        took = perf_counter() - ran
        expected, spread = reference
        load = work_of(stepper.problem.at(1.0), result.states[-1])
        row |= {
            "unknowns": int(result.ply.basis.N),
            "load": load,
            "reference": expected,
            "spread": spread,
            "error": load / expected - 1,
            "half_width": error.load,
            "reason": error.reason,
            "run_seconds": ran - start,
            "interval_seconds": took,
            "refused": "",
        }
        if self.sheared and error.shear_angle is not None:
            fine = problem.stepper(problem.net(nets.FINE), ON_NETS).run()
            off = angle_error(result.ply, result.u, fine.ply, fine.u)
            row |= {
                "angle_error": off,
                "angle_estimate": float(np.degrees(error.shear_angle)),
            }
        return [row]


@dataclass(frozen=True)
class ToTolerance:
    """A run to a tolerance, against one on the net of its last density."""

    case: str
    problem: Problem

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Outcome of the run, and the true error."""
        problem = self.problem
        row: Row = {"case": self.case}
        if (reference := problem.reference()) is None:
            return [{**row, "refused": "no reference"}]

        def at(density: float) -> LoadStepper:
            return problem.stepper(problem.net(density), ON_NETS)

        start = perf_counter()
        stepper, refused = ToleranceStepper(at, TOLERANCE), ""
        try:
            stepper.run()
        except StepError as error:
            refused = str(error)
        took, result = perf_counter() - start, stepper.result
        rounds = result.rounds
        start = perf_counter()
        fixed = at(rounds[-1].density)
        load = _work(fixed)
        return [
            {
                **row,
                "met": result.tolerance_met,
                "error": load / reference[0] - 1,
                "spread": reference[1],
                "half_width": result.error.load,
                "meshes": len(rounds),
                "density": rounds[-1].density,
                "unknowns": rounds[-1].unknowns,
                "seconds": took,
                "fixed_seconds": perf_counter() - start,
                "refused": refused,
            }
        ]


def judged(seed: int, before: str, share: float = 1.0) -> Iterator[Judged]:
    """A share of the cases of every class."""
    for i, (draw, n) in enumerate(_CLASSES.items()):
        kind = (draw.__doc__ or "").partition(".")[0].lower()
        random = np.random.default_rng([seed, i])
        for j, (problem, *more) in enumerate(
            islice(draw(random), round(share * n)), start=1
        ):
            options = more[0] if more else {}
            yield Judged(f"{before}{kind} {j}", kind, problem, **options)


def to_tolerance(n: int = 100) -> Iterator[ToTolerance]:
    """Runs of specimens, and of plies with holes, notches and corners."""
    random = np.random.default_rng(RUNS)
    drawn = _drawn(random), _holes(random), _crimped(random), _loaded(random)
    for i, draw in enumerate(islice(cycle(drawn), n), start=1):
        problem, *_ = next(draw)
        yield ToTolerance(f"tolerance {i}", problem)


# Drawn problem, and the options of its `Judged`.
_Drawn = Iterator[tuple[Any, ...]]


def _specimens(random: Any) -> Iterator[nets.Case]:
    """Endless specimens."""
    while True:
        yield from specimens(int(random.integers(1 << 31)), 50)


def _of(case: nets.Case, steps: int = 1, **fabric: Any) -> Problem:
    """Problem of a case, with other laws of its fabric."""
    outline, plain, conditions = case.problem()
    return Problem(outline, replace(plain, **fabric), conditions, (), steps)


def _drawn(random: Any) -> _Drawn:
    """Specimens of all laws."""
    for case, law in zip(_specimens(random), cycle(LAWS), strict=False):
        yield _of(replace(case, law=law)), {"sheared": True}


def _linear(random: Any) -> _Drawn:
    """Linear shear law."""
    yield from _with_law(random, "linear")


def _sine(random: Any) -> _Drawn:
    """Shear law sin²."""
    yield from _with_law(random, "sin²")


def _locking(random: Any) -> _Drawn:
    """Locking shear law."""
    yield from _with_law(random, "locking")


def _table(random: Any) -> _Drawn:
    """Tabulated shear law."""
    yield from _with_law(random, "table")


def _with_law(random: Any, law: str) -> _Drawn:
    for case in _specimens(random):
        yield _of(replace(case, law=law)), {"sheared": True}


def _crimped(random: Any) -> _Drawn:
    """Crimped fibres."""
    for case in _specimens(random):
        E, toe = 10 ** random.uniform(3, 5), random.uniform(0.001, 0.01)
        initial = E * 10 ** random.uniform(-3, -1)
        yield (_of(case, 4, tension=CrimpToe(E, toe=toe, initial_stiffness=initial)),)


def _slack(random: Any) -> _Drawn:
    """Fibres without compression."""
    for case in _specimens(random):
        law = TensionOnly(Linear(G * 10 ** random.uniform(3, 5)))
        yield (_of(case, 4, tension=law),)


def _unbalanced(random: Any) -> _Drawn:
    """Different families."""
    for case in _specimens(random):
        turned = np.radians(case.degrees + random.uniform(-6, 6, 2))
        warp = tuple(np.array([np.cos(turned[0]), np.sin(turned[0])]))
        weft = tuple(np.array([-np.cos(turned[1]), np.sin(turned[1])]))
        E = G * case.ratio
        weaker = E * 10 ** random.uniform(-1, 0)
        yield (_of(case, tension=(E, weaker), warp=warp, weft=weft),)


def _loaded(random: Any) -> _Drawn:
    """Forces and rollers.

    A ply on rollers is half of a symmetric one, and twice as high, so that no fibre
    connects the clamps.
    """
    for i, case in enumerate(_specimens(random)):
        if i % (_ROLLERS + 1) == _ROLLERS:
            height, travel = 2 * case.polygon[2][1], 2 * case.travel
            case = replace(case, polygon=box(height), travel=travel)
        outline, fabric, conditions = case.problem()
        force, clamp = random.uniform(2, 40), {"bottom": Condition("bottom")}
        loads: tuple[Any, ...] = (Force("top", (0, force)),)
        match i % (_ROLLERS + 1):
            case 0:
                conditions = clamp
            case 1:
                conditions = {**clamp, "top": Condition("top", 0.0, direction=(1, 0))}
            case 2:
                loads = (Force("left", (-force / 3, 0)),)
            case _:
                rollers = Condition("left", 0.0, direction=(1, 0))
                conditions, loads = {**conditions, "left": rollers}, ()
        yield (Problem(outline, fabric, conditions, loads, 2),)


def _holes(random: Any) -> _Drawn:
    """Holes, notches and corners."""
    for i in range(1_000_000):
        y, d = random.uniform(40, 70), random.uniform(5, 12)
        polygon: Any = box(_HEIGHT)
        holes: Any = ()
        match i % 4:
            case 0:
                holes = (circle(random.uniform(18, 32), y, random.uniform(4, 10)),)
            case 1:
                x = random.uniform(12, 22)
                holes = (((x, y), (x + 2 * d, y), (x + 2 * d, y + d), (x, y + d)),)
            case 2:
                notch = (WIDTH, y - 5), (WIDTH - d, y), (WIDTH, y + 5)
                polygon = *box(_HEIGHT)[:2], *notch, *box(_HEIGHT)[2:]
            case 3:
                x = random.uniform(25, 40)
                step = (WIDTH, y), (x, y), (x, _HEIGHT), (0.0, _HEIGHT)
                polygon = *box(_HEIGHT)[:2], *step
        law, ratio = str(random.choice(list(LAWS))), 10 ** random.uniform(3.5, 6)
        travel, degrees = random.uniform(3, 12), random.uniform(35, 56)
        yield (_of(nets.Case("", degrees, law, ratio, travel, polygon, holes)),)


def _terms(random: Any) -> _Drawn:
    """Terms of a user."""
    for case in _specimens(random):
        outline, fabric, conditions = case.problem()
        foundation = Foundation(10 ** random.uniform(-4, -2))
        yield (Problem(outline, fabric, conditions, (foundation,)),)


def _mesh(case: nets.Case, random: Any, kind: str) -> Mesh:
    height, n = case.polygon[2][1], int(random.integers(6, 17))
    size = n, max(1, round(n * height / WIDTH))
    jitter, seed = random.uniform(0.1, 0.35), int(random.integers(1000))
    return rectangle(WIDTH, height, size, kind, jitter, seed)


def _quadrilaterals(random: Any) -> _Drawn:
    """Free quadrilaterals."""
    for case, kind in zip(
        _specimens(random), cycle(("irregular", "horizontal")), strict=False
    ):
        mesh = _mesh(case, random, kind)
        yield _of(case, 6), {"formulation": Macro(), "mesh": mesh, "sheared": True}


def _triangles(random: Any) -> _Drawn:
    """Free triangles."""
    formulations = Macro(), Quadratic(80.0), Macro(), Quadratic(60.0, points=6)
    for case, formulation in zip(_specimens(random), cycle(formulations), strict=False):
        mesh = _mesh(case, random, "delaunay")
        yield _of(case, 6), {"formulation": formulation, "mesh": mesh, "sheared": True}


def _conforming(random: Any) -> _Drawn:
    """Conforming triangles."""
    for case, formulation in zip(
        _specimens(random), cycle((ON_NETS, ON_NETS, Macro())), strict=False
    ):
        problem = _of(case)
        size = WIDTH / int(random.integers(8, 25))
        arguments = problem.outline, problem.fabric, problem.conditions
        fibres = singular_fibres(*arguments, finest=FINEST * size)
        mesh = irregular(problem.outline, fibres, size, random.uniform(0, 0.7))
        yield problem, {"formulation": formulation, "mesh": mesh, "sheared": True}


def _others(random: Any) -> _Drawn:
    """Other formulations."""
    formulations: tuple[tuple[Formulation, str], ...] = (
        *((OnePoint(), "irregular"), (Quadratic(), ""), (OnePoint(4.0), "irregular")),
        *((ON_NETS, "delaunay"), (Full(), ""), (Quadratic(), "delaunay")),
    )
    for case, (formulation, kind) in zip(
        _specimens(random), cycle(formulations), strict=False
    ):
        mesh = _mesh(case, random, kind) if kind else None
        steps = 6 if kind else 1
        yield _of(case, steps), {"formulation": formulation, "mesh": mesh}


def _plates(random: Any) -> _Drawn:
    """Meshes of Gmsh."""
    bottom, pull = Condition("bottom"), Condition("top", (0, 8))
    roller = Condition("left", 0.0, direction=(1, 0))
    slide = Condition("right", 0.0, direction=(1, 0))
    crimped = CrimpToe(2e4, toe=0.004, initial_stiffness=200.0)
    both, up = {"bottom": bottom, "top": pull}, {"bottom": bottom, "right": slide}
    problems: Any = (
        ("hole", 1e4, "sin²", both, ()),
        ("two_holes", 5e4, "linear", {**both, "left": roller}, ()),
        ("notch", 2e4, "locking", {"bottom": bottom}, (Force("top", (0, 25)),)),
        ("corner", crimped, "table", both, ()),
        ("window", 3e4, "linear", up, (Force("top", (0, 30)),)),
    )
    for name, tension, law, conditions, loads in problems:
        mesh = read_mesh(_PLATES / f"{name}.msh")
        fabric = Fabric(tension, LAWS[law], (1, 1.1), (-1.1, 1))
        problem = Problem(
            Outline.of_mesh(mesh), fabric, conditions, loads, 4, _OF_PLATES
        )
        yield problem, {"formulation": Macro(), "mesh": mesh}


def _examples(random: Any) -> _Drawn:
    """Examples of the documentation."""
    angles = np.radians([0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0])
    moments = np.array([0.0, 0.008, 0.018, 0.034, 0.075, 0.21, 0.7])
    fibres = CrimpToe(7e3, toe=0.003, initial_stiffness=10.0)
    law = Tabulated(angles, moments, odd=True)
    fabric = Fabric(fibres, law, (1, 1), (-1, 1))
    conditions = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 25))}
    outline = Outline(np.transpose(box(3 * WIDTH)))
    yield (Problem(outline, fabric, conditions, (), 5),)
    scene = bias_extension(size=(24, 48))
    crimped = TensionOnly(CrimpToe(5e4, toe=0.004, initial_stiffness=10.0))
    fabric = Fabric(crimped, 0.2, scene.warp, scene.weft)
    outline = Outline.of_mesh(scene.mesh)
    problem = Problem(outline, fabric, dict(scene.conditions), (), 4, _OF_PLATES)
    yield problem, {"formulation": Macro(), "mesh": scene.mesh}


def _beside_pole(random: Any) -> Iterator[tuple[nets.Case, Locking]]:
    """Endless specimens whose shear angle is 80 to 97 % of the pole of their law."""
    while True:
        degrees, law = random.uniform(35, 58), Locking(G, random.uniform(0.78, 1.13))
        sides = np.tan(np.radians(degrees)) * random.uniform(1.2, 1.8)
        gamma = np.degrees(law.angle) * random.uniform(0.8, 0.97)
        ratio = 10 ** random.uniform(3.5, 5.3)
        yield nets.specimen("", degrees, "linear", ratio, sides, gamma), law


def _near_pole(random: Any) -> _Drawn:
    """Locking shear law near its angle."""
    for case, law in _beside_pole(random):
        yield (_of(case, shear=law),)


def _near_pole_on_free_meshes(random: Any) -> _Drawn:
    """Free meshes near the locking angle."""
    options = cycle(
        (formulation, kind)
        for kind in ("irregular", "delaunay")
        for formulation in (OnePoint(), Macro())
    )
    for (case, law), (formulation, kind) in zip(
        _beside_pole(random), options, strict=False
    ):
        mesh = _mesh(case, random, kind)
        yield _of(case, 4, shear=law), {"formulation": formulation, "mesh": mesh}


def _steep(random: Any) -> _Drawn:
    """Steep fibres, which end at 78° to 87° to the clamps."""
    while True:
        degrees = random.uniform(58, 70)
        sides = np.tan(np.radians(degrees)) * random.uniform(1.1, 1.6)
        gamma = 2 * (random.uniform(78, 87) - degrees)
        law, ratio = (
            str(random.choice(["linear", "sin²"])),
            10 ** random.uniform(3.5, 5.3),
        )
        yield (_of(nets.specimen("", degrees, law, ratio, sides, gamma)),)


def _one_point(random: Any) -> _Drawn:
    """One point on triangles."""
    for i, case in enumerate(_specimens(random)):
        mesh = None if i % 3 == 2 else _mesh(case, random, "delaunay")
        yield _of(case, 1), {"formulation": OnePoint(), "mesh": mesh}


# Classes with the number of cases.
_CLASSES: dict[Any, int] = {
    **dict.fromkeys((_linear, _sine, _locking, _table), 15),
    **dict.fromkeys((_crimped, _loaded, _holes), 24),
    **dict.fromkeys((_slack, _unbalanced), 15),
    _terms: 10,
    **dict.fromkeys((_quadrilaterals, _triangles, _conforming), 24),
    _others: 18,
    _plates: 5,
    _examples: 2,
    **dict.fromkeys((_near_pole, _steep, _one_point, _near_pole_on_free_meshes), 24),
}
