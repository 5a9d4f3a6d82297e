"""Small forming problems with friction, drawn at random."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Holder,
    Ply,
    Quadratic,
    Tool,
    Traction,
    drape,
    io,
)
from skfem_textile.contact import Compaction, Process

from ..forming import triangles
from .in_phases import Plan, opened

#: Kinds of cases: those on which the library was mended, and those that judge it.
MENDED, JUDGED = "mended", "judged"

#: Tools of a case.
HEMISPHERE, DOME, STL, DRUM, PLATE = TOOLS = (
    *("hemisphere", "double dome", "STL hemisphere", "drum", "plate"),
)

# Shares of the tools.
_SHARES = 0.27, 0.13, 0.15, 0.2, 0.25

#: Motion of a process in phases, see `Plan`, and its share.
PHASES, _SHARE_OF_PHASES = "phases", 0.35

#: Motions: paths of the travel, with sideways motion or rotation.
_PRESSED = "up", "back", "twice", "opened", "sideways", "turned"
_DRUM_MOTIONS = "up", "back", "turned", "turned back"
_PLATE_MOTIONS = "turned", "turned back", "shifted", "shaken"
#: Motions without reversal or rotation, whose states hardly depend on the steps.
MONOTONE = "up", "shifted"

# Paths of a motion over the load factor, of which each corner is the end of a step.
_PATHS: Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "up": ((0.0, 1.0), (0.0, 1.0)),
    "back": ((0.0, 0.5, 1.0), (0.0, 1.0, 0.6)),
    "twice": ((0.0, 0.5, 0.75, 1.0), (0.0, 1.0, 0.5, 1.0)),
    "opened": ((0.0, 0.5, 1.0), (0.0, 1.0, 0.0)),
    "shaken": ((0.0, 0.25, 0.75, 1.0), (0.0, 1.0, -1.0, 0.0)),
}
_HALFWAY = ((0.0, 0.5, 1.0), (0.0, 0.0, 1.0))

# Steps of a run, of which paths with corners use multiples of four.
_STEPS = 2, 3, 5, 8, 12, 20, 40
_STEPS_OF_CORNERS = 4, 4, 8, 8, 12, 20, 40

# Shares of these steps, and of 6 to 10 elements across.
_SHARES_OF_STEPS = 0.2, 0.2, 0.2, 0.15, 0.15, 0.07, 0.03
_SHARES_OF_PARTS = 0.35, 0.25, 0.2, 0.1, 0.1

# Edges of the triangles of a tool in mm.
_EDGE = 5.0

Motion = Callable[[float], tuple[ndarray, ndarray]]


class Problem(NamedTuple):
    """A ply with its conditions, and what its tools do.

    Attributes
    ----------
    ply, conditions
        The ply and its conditions.
    motions
        Motions of the tools that move, by name.
    amounts
        Gap, pressure or force of holders as functions of the load factor, by name.
    process
        The process in phases; None for other motions.
    """

    ply: Ply
    conditions: dict[str, Condition]
    motions: dict[str, Motion]
    amounts: dict[str, Callable[[float], float]]
    process: Process | None


def _path(name: str, t: float) -> float:
    return float(np.interp(t, *_PATHS.get(name, _PATHS["up"])))


def _turn(axis: int, angle: float) -> ndarray:
    """Rotation matrix about an axis of coordinates."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    R = np.eye(3)
    R[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return R


@dataclass(frozen=True)
class Drawn:
    """Input of a case.

    Attributes
    ----------
    tools, motion, holder
        Tools, motion, and holder: none, gap, pressure or force, alone or in segments.
    parts, element, whole, steps
        Elements across the computed part, their kind, if the whole ply is computed, and
        steps.
    friction, growth
        Coefficients of punch, die and holder at the load factor 0, and their factor at
        the load factor 1.
    slip
        Elastic slip in mm.
    E, G, D, tension
        Stiffness of fibres and shear in N/mm, bending stiffness in N·mm, and traction
        on free edges in N/mm.
    radius, fillet, clearance, gap, depth
        Lengths of the tools in mm; the depth is relative to the radius.
    turn, shift
        Rotation in degrees and sideways motion in mm.
    load
        Pressure of a holder in N/mm².
    plan
        Phases of the motion ``phases``; None for other motions.
    """

    tools: str
    motion: str
    holder: str
    parts: int
    element: str
    whole: bool
    steps: int
    friction: tuple[float, float, float]
    growth: float
    slip: float
    E: float
    G: float
    D: float
    tension: float
    radius: float
    fillet: float
    clearance: float
    gap: float
    depth: float
    turn: float
    shift: float
    load: float
    plan: Plan | None

    @classmethod
    def of(cls, kind: str, number: int, seed: int) -> "Drawn":
        """The input of a case."""
        rng = np.random.default_rng([seed, number, (MENDED, JUDGED).index(kind)])

        def chosen(values: Any, p: Any = None) -> Any:
            return values[int(rng.choice(len(values), p=p))]

        def between(low: float, high: float) -> float:
            return float(rng.uniform(low, high))

        def scaled(low: float, high: float) -> float:
            return float(10 ** rng.uniform(np.log10(low), np.log10(high)))

        tools = chosen(TOOLS, _SHARES)
        motions = {DRUM: _DRUM_MOTIONS, PLATE: _PLATE_MOTIONS}.get(tools, _PRESSED)
        motion = chosen(motions)
        if rng.random() < _SHARE_OF_PHASES:
            motion = PHASES
        holders = "none", "gap", "pressure", "force", "pressures", "forces"
        plan = None
        if motion == PHASES:
            kind_of = {DRUM: "drum", PLATE: "plate"}.get(tools, "punch")
            plan = Plan.of(kind_of, chosen, turns=tools != DOME)
        corners = motion in ("back", "twice", "opened", "shaken", "turned back")
        steps = chosen(_STEPS_OF_CORNERS if corners else _STEPS, _SHARES_OF_STEPS)
        asymmetric = tools in (DRUM, PLATE) or motion in ("sideways", "turned")
        asymmetric |= plan is not None and plan.turn(1.0) != 0
        ends = (0.0, 0.1, 0.2, 0.4, 0.7, 1.0)
        return cls(
            tools,
            motion,
            chosen(holders) if tools in (HEMISPHERE, DOME, STL) else "pressure",
            chosen((6, 7, 8, 9, 10), _SHARES_OF_PARTS),
            chosen(("squares", "triangles"), (0.85, 0.15)),
            bool(asymmetric or rng.random() < 0.1),
            steps if plan is None else plan.steps,
            (chosen(ends), chosen(ends), between(0.0, 1.0)),
            chosen((0.0, 0.5, 1.0), (0.15, 0.15, 0.7)),
            scaled(0.002, 0.2),
            scaled(1e3, 5e5),
            scaled(0.02, 2.0),
            scaled(1.0, 50.0),
            chosen((0.02, 0.1, 0.5)),
            between(30.0, 90.0),
            between(6.0, 20.0),
            between(3.0, 8.0),
            between(0.2, 1.0),
            between(0.2, 0.8),
            between(10.0, 90.0),
            between(0.5, 5.0),
            scaled(2e-4, 5e-3),
            plan,
        )

    def problem(self) -> Problem:
        """The ply between its tools, or on a drum or a plate."""
        make = {DRUM: self._on_drum, PLATE: self._on_plate}.get(
            self.tools, self._pressed
        )
        return make()

    def coefficients(self) -> dict[str, Callable[[float], float]]:
        """Coefficients of friction over the load factor, by the name of a tool."""
        grown = self.plan.friction if self.plan else partial(_grown, self.growth)
        mu = [partial(grown, x) for x in self.friction]
        segments = {f"segment_{i + 1}": mu[2] for i in range(4)}
        of_punch = dict.fromkeys(("punch", "drum", "plate"), mu[0])
        return {**of_punch, "die": mu[1], "holder": mu[2], **segments}

    def _rub(self, i: int) -> dict[str, Any]:
        """Arguments of a tool for its friction."""
        mu = self.friction[i]
        if self.growth == 1.0 or self.plan:
            return {"friction": mu, "elastic_slip": self.slip}
        changing = partial(_grown, self.growth, mu)
        return {"friction": changing, "elastic_slip": self.slip}

    def _problem(
        self,
        mesh: Any,
        pulls: list[Traction],
        tools: list[Any],
        held: dict[str, Condition],
        *moves: Any,
        mirrors: Sequence[str] = (),
    ) -> Problem:
        """The ply with its loads and tools, of which the first moves.

        ``moves`` are the whole travel, shape (3,), the whole rotation in radians and
        its axis, for a process in phases.
        """
        motions = {tools[0].name: tools[0].motion}
        stated = {
            tool.name: (what, value)
            for tool in tools
            for what in ("gap", "pressure", "force")
            if (value := getattr(tool, what, None)) is not None
        }
        amounts, process = {k: _function(x) for k, (_, x) in stated.items()}, None
        if self.plan:
            whole = {k: (what, _function(x)(1.0)) for k, (what, x) in stated.items()}
            rest = [_at_rest(tool, whole.get(tool.name)) for tool in tools]
            frictions = {tool.name: tool.friction for tool in tools}
            process = self.plan.process(rest, frictions, whole, *moves)
            tools = [*process.tools]
            amounts = {
                name: partial(self.plan.amount, value, what == "gap")
                for name, (what, value) in whole.items()
            }
        fabric = Fabric(self.E, self.G, bending=(self.D, self.D))
        options: dict[str, Any] = {}
        if mirrors:
            options["fibre_ends"] = dict.fromkeys(mirrors, "mirror")
        if self.element == "triangles":
            options["formulation"] = Quadratic()
        ply = Ply(mesh, fabric, terms=[*pulls, *tools], dimension=3, **options)
        return Problem(ply, held, motions, amounts, process)

    def _mesh(self, half: float) -> Any:
        parts = self.parts
        line = np.linspace(-half if self.whole else 0.0, half, parts + 1)
        mesh = MeshQuad.init_tensor(line, line)
        if self.element == "triangles":
            return mesh.to_meshtri().with_defaults()
        return mesh.with_defaults()

    def _pressed(self) -> Problem:
        """Punch from below, die and holder above."""
        opening = self.radius + self.clearance
        half = opening + self.fillet + 0.5 * self.radius
        z, travel = 0.5 * self.gap, self.depth * self.radius
        if self.tools == DOME:
            travel = min(travel, 40.0)
            half = 150.0
            punch = _raised(drape.double_dome(60.0, 90.0, 50.0), -z)
            wide = drape.double_dome(60.0, 90.0 + self.clearance, 50 + self.clearance)
            die: Any = _raised(wide, 60.0 + z)
        elif self.tools == STL:
            punch = _of_file("punch", self.radius, 0.0, -self.radius - z)
            die = _of_file("die", opening, self.fillet, z)
        else:
            punch = drape.Punch(self.radius, (0, 0, -self.radius - z))
            die = drape.Die(opening, self.fillet, (0, 0, z))
        name = self.motion if self.motion in _PATHS else "up"

        def motion(t: float) -> tuple[ndarray, ndarray]:
            if plan := self.plan:
                angle = np.radians(self.turn) * plan.turn(t)
                return _turn(2, angle), np.array([0.0, 0.0, travel * plan.travel(t)])
            late = float(np.interp(t, *_HALFWAY))
            beside = min(self.shift, 0.5 * self.clearance) * (self.motion == "sideways")
            angle = np.radians(self.turn) * (self.motion == "turned")
            if self.tools == DOME:  # which turns within the clearance
                angle *= 0.02
            R = _turn(2, angle * late)
            return R, np.array([beside * late, 0.0, travel * _path(name, t)])

        tools = [
            Tool(punch, motion, name="punch", **self._rub(0)),
            Tool(die, name="die", **self._rub(1)),
            *self._holders(z, opening + self.fillet, half),
        ]
        mesh, q = self._mesh(half), self.tension
        pulls = [
            Traction("right", (q, 0, 0), factor=1.0),
            Traction("top", (0, q, 0), factor=1.0),
        ]
        if self.whole:
            pulls += [
                Traction("left", (-q, 0, 0), factor=1.0),
                Traction("bottom", (0, -q, 0), factor=1.0),
            ]
            held, mirrors = _middles(half, self.parts), []
        else:
            held = {
                "x": Condition("left", (0.0, None, None)),
                "y": Condition("bottom", (None, 0.0, None)),
            }
            mirrors = ["left", "bottom"]
        moves = np.array([0.0, 0.0, travel]), np.radians(self.turn)
        return self._problem(mesh, pulls, tools, held, *moves, mirrors=mirrors)

    def _holders(self, z: float, hole: float, half: float) -> list[Holder]:
        """Holder around the opening, alone or in four segments."""
        flange, rub = drape.Plane((0, 0, z), (0, 0, 1.0)), self._rub(2)
        hole = hole if self.tools != DOME else 125.0
        if self.holder == "none":
            floor = drape.Plane((0, 0, -z), (0, 0, 1.0))
            return [Tool(floor, side=1, name="holder", **rub)]  # type: ignore[list-item]
        if self.holder == "gap":
            return [Holder(flange, gap=2 * z, side=-1, name="holder", **rub)]
        area = (2 * half) ** 2 / (1 if self.whole else 4)
        law = Compaction(0.3, 1e-3, 8.0)
        if self.holder in ("pressure", "force"):
            turn = np.linspace(0, 2 * np.pi, 73)
            circle = np.array([np.cos(turn), np.sin(turn)])
            ring = np.hstack([4 * half * circle, hole * circle])
            amount: dict[str, Any] = {"pressure": self.load}
            if self.holder == "force":
                amount = {"force": 0.5 * self.load * area, "compaction": law}
            return [
                Holder(flange, side=-1, outline=ring, name="holder", **amount, **rub)
            ]
        holders = []
        for i in range(4 if self.whole else 1):
            turn = np.linspace(0.05, np.pi / 2 - 0.05, 19) + i * np.pi / 2
            circle = np.array([np.cos(turn), np.sin(turn)])
            segment = np.hstack([4 * half * circle, hole * circle[:, ::-1]])
            share = self.load * (1 + 0.4 * i)
            amount = {"pressure": share}
            if self.holder == "forces":
                force = 0.1 * share * area
                amount = {"force": partial(_rising, force), "compaction": law}
            holders.append(
                Holder(
                    flange,
                    side=-1,
                    outline=segment,
                    name=f"segment_{i + 1}",
                    **amount,
                    **rub,
                )
            )
        return holders

    def _on_drum(self) -> Problem:
        """Ply over a drum that is raised and turns, clamped at one edge."""
        half, R, z = 1.2 * self.radius, self.radius, 0.01
        drum = drape.Cylinder(R, (0, 0, -R - z), (0, 1, 0))
        centre, travel = np.array([0.0, 0.0, -R - z]), 0.5 * self.depth * R

        def motion(t: float) -> tuple[ndarray, ndarray]:
            path, angle = self.motion if self.motion == "back" else "up", 0.0
            moved = travel * (self.plan.travel(t) if self.plan else _path(path, t))
            if self.plan:
                angle = np.radians(self.turn) * self.plan.turn(t)
            elif self.motion.startswith("turned"):
                back = "back" if self.motion == "turned back" else "up"
                angle = np.radians(self.turn) * _path(back, t)
            R = _turn(1, angle)
            return R, centre - R @ centre + [0, 0, moved]

        tools = [Tool(drum, motion, side=1, name="drum", **self._rub(0))]
        mesh, q = self._mesh(half), self.tension
        held = {
            "clamp": Condition("left", (0.0, 0.0, 0.0)),
            "z": Condition("right", (None, None, 0.0)),
        }
        pull = Traction("right", (q, 0, 0), factor=1.0)
        moves = np.array([0, 0, travel]), np.radians(self.turn), ((0, 1, 0), centre)
        return self._problem(mesh, [pull], tools, held, *moves)

    def _on_plate(self) -> Problem:
        """Ply held at one edge, between a plate that moves and a holder."""
        half = 50.0

        def motion(t: float) -> tuple[ndarray, ndarray]:
            if plan := self.plan:
                return _turn(2, whole * plan.turn(t)), self.shift * plan.travel(
                    t
                ) * axis
            if self.motion.startswith("turned"):
                back = "back" if self.motion == "turned back" else "up"
                return _turn(2, whole * _path(back, t)), 0 * axis
            return np.eye(3), self.shift * _path(self.motion, t) * axis

        axis, whole = np.array([0.8, 0.6, 0.0]), 0.3 * np.radians(self.turn)
        plate = Tool(drape.Plane(), motion, side=1, name="plate", **self._rub(0))
        holder = Holder(drape.Plane(), pressure=self.load, side=1, **self._rub(2))
        held = {"clamp": Condition("left", (0.0, 0.0, None))}
        mesh = self._mesh(half)
        pull = Traction("right", (self.tension, 0, 0), factor=1.0)
        moves = self.shift * axis, whole
        return self._problem(mesh, [pull], [plate, holder], held, *moves)


def _grown(growth: float, mu: float, t: float) -> float:
    return mu * (1 + (growth - 1) * t)


def _function(value: Any) -> Callable[[float], float]:
    """An amount as a function of the load factor."""
    return value if callable(value) else lambda t: value


def _at_rest(tool: Any, amount: tuple[str, float] | None) -> Any:
    """A tool before the first phase, with the whole gap, pressure or force of one."""
    if amount is None:
        return replace(tool, motion=None)
    what, value = amount
    return replace(tool, motion=None, **{what: opened(value, what == "gap")})


def _rising(force: float, t: float) -> float:
    return force * (0.2 + 0.8 * t)


def _raised(surface: Any, z: float) -> Any:
    """The same surface higher by z mm."""

    def height(x: ndarray, y: ndarray) -> Any:
        at = surface.height(x, y)
        return at._replace(h=at.h + z)

    return drape.HeightField(height)


@cache
def _of_file(kind: str, radius: float, fillet: float, z: float) -> Any:
    """Punch or die read from an STL file."""
    if kind == "punch":
        mesh = triangles.sphere(radius, np.array([0.0, 0.0, z]), _EDGE)
    else:
        mesh = triangles.die(radius, fillet, z, _EDGE)
    facets = mesh.facets
    corners = facets.points[:, facets.triangles()].T
    with TemporaryDirectory() as folder:
        file = Path(folder) / f"{kind}.stl"
        file.write_bytes(stl(np.ascontiguousarray(corners)))
        return io.read_surface(file)


def stl(corners: ndarray) -> bytes:
    """Binary STL file of triangles, shape (n, 3 corners, 3)."""
    rows = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("x", "<f4", (3, 3)), ("m", "<u2")]
    )
    rows["x"] = corners
    return b"tool".ljust(80) + np.uint32(len(corners)).tobytes() + rows.tobytes()


def _middles(half: float, parts: int) -> dict[str, Condition]:
    """Middles of the left and bottom edges, along these edges."""
    near = half / parts + 1e-6

    def left(X: ndarray) -> ndarray:
        return (X[0] < -half + 1e-6) & (np.abs(X[1]) < near)

    def bottom(X: ndarray) -> ndarray:
        return (X[1] < -half + 1e-6) & (np.abs(X[0]) < near)

    return {
        "y": Condition(left, (None, 0.0, None)),
        "x": Condition(bottom, (0.0, None, None)),
    }
