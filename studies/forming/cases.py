"""Cases: the reference hemisphere, its tools as triangles, and random plies."""

from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any, TypeAlias

import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial import KDTree

from skfem_textile import Fabric, Macro, OnePoint, Ply, equilibrium_near
from skfem_textile.contact import contacts
from skfem_textile.contact.shape import draw_in
from skfem_textile.scenes import (
    Case,
    Scene,
    double_dome_forming,
    hemisphere_forming,
)
from skfem_textile.solve.result import Result, StepError
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.verdict import CHECKS

from ..study import Row
from . import triangles
from .outlines import Outlined, outline_cases

#: Kinds of cases.
REFERENCE, PEAK = "reference", "peak"
RANDOM, SLACK, DEEP = "random", "slack", "deep"
CHOSEN, JUDGED = "chosen", "judged"

# Numbers that seed the kinds drawn at random.
_SEEDS = {RANDOM: 0, SLACK: 1, DEEP: 2, CHOSEN: 3, JUDGED: 4}

# Travel over the radius of deep cups, whose walls touch the shaft of the punch, and of
# the others.
_DEEP, _SHALLOW = (1.0, 1.5), (0.3, 1.0)

# Refinement of a mesh whose result counts as converged: odd, so that the centre of an
# element is one of the finer mesh.
_FINER = 3

# Shares of plies of 12, 16, 20 and 24 parts a side.
_SHARES_OF_CELLS = 0.5, 0.3, 0.1, 0.1

# Share of double domes, and displacement of the nodes of irregular meshes relative to
# the elements.
_SHARE_OF_DOMES, _JITTER = 0.25, 0.2

# Compared quantities: names in rows, and keys of summaries.
_COMPARED = {"force": "punch_force_N", "angle": "recovered_max_shear_angle_deg"}

# Elements a side of the field with which coarser ones are compared.
_CELLS_OF_FIELD = 48

# Length of the edges of tools as triangles in mm.
_EDGE = 1.0


@dataclass(frozen=True)
class Reference:
    """Hemisphere of R 75 mm, formed to 75 mm: elements a side, steps, and tools."""

    cells: int
    steps: int
    triangles: bool = False

    def __str__(self) -> str:
        tools = ", tools of triangles" if self.triangles else ""
        return f"{REFERENCE}, {2 * self.cells} parts, {self.steps} steps{tools}"

    def rows(self) -> list[Row]:
        """One row of figures of the last state."""
        scene = hemisphere_forming("aligned", size=(self.cells, self.cells))
        if self.triangles:
            scene = _of_triangles(scene)
        fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
        result, refused = _run(scene, fabric, self.steps)
        given = {"kind": REFERENCE, "parts": 2 * self.cells, "steps": self.steps}
        tools = {"triangles": self.triangles}
        return [
            {
                "case": str(self),
                **given,
                **tools,
                **_figures(result),
                "refused": refused,
            }
        ]


@dataclass(frozen=True)
class Drawn:
    """Hemisphere drawn at random."""

    radius: float
    fillet: float
    stiffness: float
    bending: float
    tension: float
    fibres: int
    travel: float
    cells: int
    steps: int

    @classmethod
    def of(cls, kind: str, number: int, seed: int) -> "Drawn":
        """The hemisphere of a case."""
        rng = np.random.default_rng([seed, number, _SEEDS[kind]])
        radius, fillet = float(rng.uniform(40, 120)), float(rng.uniform(5, 20))
        stiffness = float(10 ** rng.uniform(3, 6))
        low, high = (0.0, 1.0) if kind == SLACK else (5.0, 50.0)
        bending = float(rng.uniform(low, high))
        tension = 0.0 if kind == SLACK else float(rng.choice([0.05, 0.2, 1.0]))
        fibres = int(rng.choice([0, 45]))
        travel = float(rng.uniform(*(_DEEP if kind == DEEP else _SHALLOW)) * radius)
        cells, steps = int(rng.choice([6, 8, 10])), int(rng.choice([2, 4, 8]))
        return cls(
            *(radius, fillet, stiffness, bending, tension),
            *(fibres, travel, cells, steps),
        )

    def run(self, steps: int, formulation: Any = None) -> tuple[Result, str]:
        """The result, and the reason why a run stopped."""
        width = 4 * self.radius + 2 * max(self.travel - self.radius, 0.0)
        scene = hemisphere_forming(
            *("aligned", self.radius, self.fillet, self.travel),
            size=(self.cells,) * 2,
            width=width,
            height=width,
            fibres=float(np.radians(self.fibres)),
            tension=self.tension,
        )
        fabric = Fabric(
            *(self.stiffness, 0.1, scene.warp, scene.weft), bending=(self.bending,) * 2
        )
        return _run(scene, fabric, steps, formulation)


@dataclass(frozen=True)
class Random:
    """Hemisphere drawn at random, in two numbers of steps and two formulations."""

    kind: str
    number: int
    seed: int

    def __str__(self) -> str:
        return f"{self.kind}, {self.number}"

    def rows(self) -> list[Row]:
        """One row with the input, and the results of the three runs."""
        drawn = Drawn.of(self.kind, self.number, self.seed)
        given: Row = {"case": str(self), "kind": self.kind} | asdict(drawn)
        result, refused = drawn.run(drawn.steps)
        row = given | _figures(result) | {"refused": refused}
        again, refused = drawn.run(2 * drawn.steps)
        off = np.abs(_centres(result) - _centres(again)).max()
        row |= {
            "refused_of_more_steps": refused,
            "off_in_more_steps": float(off),
            "force_in_more_steps": _force(again),
        }
        one, refused = drawn.run(drawn.steps, OnePoint())
        row |= {
            "refused_of_one_point": refused,
            "rms_of_one_point": _rms(_centres(result) - _centres(one)),
            "interval": _interval(result) + _interval(one),
            "force_of_one_point": _force(one),
        }
        return [row]


@dataclass(frozen=True)
class Formed:
    """Quarter of a ply between tools drawn at random, of 12 to 24 parts a side."""

    tools: str
    radius: float
    fillet: float
    clearance: float
    gap: float
    stiffness: float
    shear: float
    bending: float
    tension: float
    fibres: float
    travel: float
    size: float
    mesh: str
    cells: int

    @classmethod
    def of(cls, kind: str, number: int, seed: int) -> "Formed":
        """The ply of a case."""
        rng = np.random.default_rng([seed, number, _SEEDS[kind]])
        radius, fillet = float(rng.uniform(40, 120)), float(rng.uniform(5, 20))
        clearance, gap = float(rng.uniform(3, 8)), float(rng.uniform(0.2, 0.6))
        stiffness = float(10 ** rng.uniform(3, 6))
        shear = float(10 ** rng.uniform(-2, 0))
        bending, tension = float(rng.uniform(5, 50)), float(rng.choice([0.3, 1.0]))
        angle = float(rng.choice([0.0, 45.0]))
        depth, size = float(rng.uniform(0.3, 0.8)), float(rng.uniform(0.9, 1.1))
        mesh = str(rng.choice(["aligned", "irregular"]))
        cells = int(rng.choice([6, 8, 10, 12], p=_SHARES_OF_CELLS))
        dome = bool(rng.random() < _SHARE_OF_DOMES)
        return cls(
            *("double dome" if dome else "hemisphere", radius, fillet, clearance, gap),
            *(stiffness, shear, bending, tension, angle),
            *(depth * 60.0 if dome else depth * radius, size, mesh),
            cells,
        )

    def case(self, finer: int = 1) -> Case:
        """The case; on aligned elements of a part of the size if it is ``finer``."""
        n, mesh = finer * self.cells, self.mesh if finer == 1 else "aligned"
        options: dict[str, Any] = {
            "jitter": _JITTER if mesh == "irregular" else 0.0,
            "fibres": float(np.radians(self.fibres)),
            "tension": self.tension,
            "travel": self.travel,
            "gap": self.gap,
            "clearance": self.clearance,
        }
        if self.tools == "hemisphere":
            options |= {"radius": self.radius, "fillet": self.fillet, "size": (n, n)}
            options |= dict.fromkeys(("width", "height"), 4 * self.radius * self.size)
            scene = hemisphere_forming(mesh, **options)
        else:
            options |= {"width": 470 * self.size, "height": 300 * self.size}
            scene = double_dome_forming(mesh, size=(n, 2 * n // 3), **options)
        bending = (self.bending, self.bending)
        fabric = Fabric(
            self.stiffness, self.shear, scene.warp, scene.weft, bending=bending
        )
        return Case(scene=scene, fabric=fabric, steps=4)


@dataclass(frozen=True)
class Compared:
    """Ply between tools drawn at random, with elements of a third of the size."""

    kind: str
    number: int
    seed: int

    def __str__(self) -> str:
        return f"{self.kind}, {self.number}"

    def rows(self) -> list[Row]:
        """One row with the input, and force, angle and field with their intervals."""
        drawn = Formed.of(self.kind, self.number, self.seed)
        row: Row = {"case": str(self), "kind": self.kind} | asdict(drawn)
        case, finer = drawn.case(), drawn.case(_FINER)
        try:
            result = case.run()
            ply, conditions = finer.ply(), finer.scene.conditions
            guess = _on_finer(result, ply)
            state = equilibrium_near(ply, conditions, guess, warn_only=tuple(CHECKS))
        except (StepError, NoEquilibriumError) as error:
            return [row | {"refused": str(error)}]
        fine = Result.of_state(ply, conditions, state)
        nearest = KDTree(_places(fine)).query(_places(result))[1]
        off = _centres(result) - _centres(fine)[nearest]
        summary, other = result.summary(), fine.summary()
        row |= {"refused": "", "solves": result.linear_solves}
        row |= {"error": _rms(off), "interval": _interval(result)}
        for name, key in _COMPARED.items():
            row |= {
                name: summary[key],
                f"half_width_of_{name}": summary.get(f"{key}_half_width"),
                f"{name}_on_finer": other[key],
            }
        return [row]


@dataclass(frozen=True)
class Peak:
    """Field and largest angle of the reference hemisphere, with its interval."""

    cells: int

    def __str__(self) -> str:
        return f"{PEAK}, {2 * self.cells} parts"

    def rows(self) -> list[Row]:
        """One row with the last state, its intervals, and the error of the field."""
        result = _hemisphere(self.cells)
        summary = result.summary()
        keys = {"raw": "max_shear_angle_deg"} | _COMPARED
        row: Row = {"case": str(self), "kind": PEAK, "parts": 2 * self.cells}
        fine = _hemisphere(_CELLS_OF_FIELD)
        field = CloughTocher2DInterpolator(_places(fine), _centres(fine))
        row["unknowns"] = result.u.size
        row["field"] = _rms(_centres(result) - field(_places(result)))
        row |= {name: summary[key] for name, key in keys.items()}
        return [
            row
            | {
                f"half_width_of_{name}": summary[f"{key}_half_width"]
                for name, key in _COMPARED.items()
            }
        ]


@cache
def _hemisphere(cells: int) -> Result:
    """The reference hemisphere with aligned elements, in five steps."""
    scene = hemisphere_forming("aligned", size=(cells, cells))
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    return _run(scene, fabric, 5)[0]


#: Any case.
AnyCase: TypeAlias = Reference | Random | Compared | Peak | Outlined


def all_cases(seed: int) -> list[AnyCase]:
    """All cases; the random ones from a seed."""
    return [
        *(Reference(cells, 5) for cells in (6, 12, 18, 24)),
        *(Reference(12, steps) for steps in (1, 2, 10, 20)),
        Reference(12, 5, triangles=True),
        *(Random(RANDOM, i, seed) for i in range(150)),
        *(Random(SLACK, i, seed) for i in range(40)),
        *(Random(DEEP, i, seed) for i in range(12)),
        *(Peak(cells) for cells in (6, 12, 14, 18, 20, 24)),
        *outline_cases(),
        *(Compared(JUDGED, i, seed) for i in range(30)),
        *(Compared(CHOSEN, i, seed) for i in range(8)),
    ]


def _run(
    scene: Scene, fabric: Fabric, steps: int, formulation: Any = None
) -> tuple[Result, str]:
    """The result, and the reason why a run stopped."""
    case = Case(
        scene=scene, fabric=fabric, steps=steps, formulation=formulation or Macro()
    )
    try:
        return case.run(), ""
    except StepError as error:
        return error.result, str(error)


def _figures(result: Result) -> Row:
    """Largest angle, force, draw-in, balance, gap and solves of the last state."""
    ply, state = result.ply, result.states[-1]
    inwards = draw_in(ply, state.u)
    tools = contacts(ply)
    gaps = [tool.gaps(state.u, state.load_factor).min() for tool in tools]
    forces = np.array([state.reactions[tool.name] for tool in tools])
    load = ply.nodal(ply.load(state.u, state.load_factor, state.parameters))
    held = [state.reactions[k][i] for i, k in enumerate(("left", "bottom"))]
    off = load.sum(axis=1) + np.array([*held, 0.0])
    return {
        "load_factor": state.load_factor,
        "shear": float(np.degrees(np.abs(ply.shear_angle(state.u, ply.centre)).max())),
        "force": _force(result),
        "draw_in_axis": inwards.at(0.0),
        "draw_in_diagonal": inwards.at(np.pi / 4),
        "unbalanced": float(np.abs(off).max() / max(np.abs(forces).max(), 1e-300)),
        "gap": float(min(gaps)),
        "negative_pivots": state.verdict.negative_pivots,
        "path_resolved": result.path_resolved,
        "solves": result.linear_solves,
        "seconds": result.wall_time_s,
    }


def _force(result: Result) -> float:
    return float(result.states[-1].reactions["punch"][2])


def _centres(result: Result) -> np.ndarray:
    """Shear angles of the user's elements in degrees."""
    ply = result.ply
    angle = ply.on_users_elements(ply.shear_angle(result.u, ply.centre)[:, 0])
    return np.degrees(angle)


def _places(result: Result) -> np.ndarray:
    """Centres of the user's elements in the flat ply, shape (n, 2)."""
    points, cells = result.ply.mesh.p, result.ply.cells
    return np.hstack([points[:, cell].mean(axis=1) for cell in cells]).T


def _on_finer(result: Result, ply: Ply) -> np.ndarray:
    """Displacement interpolated smoothly to the nodes of a ply on a finer mesh."""
    X, values = result.ply.mesh.p.T, result.ply.nodal(result.u).T
    spline = CloughTocher2DInterpolator(X, values)
    at = spline(ply.nodes[:2].T)
    outside = np.isnan(at).any(axis=1)  # by round-off at edges
    at[outside] = values[KDTree(X).query(ply.nodes[:2].T[outside])[1]]
    return at.ravel()


def _rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(difference**2)))


def _interval(result: Result) -> float:
    """Estimated root mean square error of the shear angle in degrees."""
    angle = result.error.shear_angle
    return np.nan if angle is None else float(np.degrees(angle))


def _of_triangles(scene: Scene) -> Scene:
    """The same tools, punch and die as triangles."""
    punch, die, holder = scene.tools
    end: Any = punch.surface
    hole: Any = die.surface
    of_die = triangles.die(hole.radius, hole.fillet, float(hole.point[2]), _EDGE)
    tools = (
        replace(punch, surface=triangles.sphere(end.radius, end.point, _EDGE)),
        replace(die, surface=of_die),
        holder,
    )
    return replace(scene, tools=tools)
