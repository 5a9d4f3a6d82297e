"""Plies that slide on tools, with exact forces where they are known."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import diags
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    MatrixTerm,
    OnePoint,
    Ply,
    Result,
    State,
    StepError,
    Tool,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.contact import Compaction, pressing
from skfem_textile.contact import holder as holders
from skfem_textile.contact.outline import inside
from skfem_textile.ply.parameters import NO_VALUES, Values
from skfem_textile.scenes import Case, hemisphere_forming

from ..common.rivals.nodes import contact_at_nodes
from ..study import Row

# Checks that warn only, in strips of a few elements.
_COARSE = "stabilisation", "deviation", "corners", "surface", "slack"


def grid(length: float, width: float, nx: int, ny: int) -> Any:
    """Rectangle of nx × ny elements with named sides."""
    x, y = np.linspace(0, length, nx + 1), np.linspace(0, width, ny + 1)
    return MeshQuad.init_tensor(x, y).with_defaults()


def lost(result: Result) -> ndarray:
    """Work of sliding on all tools in N·mm, shape (n_states,)."""
    return np.array([sum(state.energy_lost.values()) for state in result.states])


# Radius of the drum, width of the belt, in mm, and the tension of its free end in N/mm.
_DRUM, _BELT, _FREE = 30.0, 2.0, 1.0


@dataclass(frozen=True)
class Belt:
    """Belt on a drum: angle of contact in degrees, and elements along it."""

    friction: float
    wrap: int
    elements: int

    def __str__(self) -> str:
        return f"belt, μ {self.friction:g}, {self.wrap}°, {self.elements} elements"

    def rows(self) -> list[Row]:
        """Tension over the one of a polygon with the same corners, and its product."""
        mu, wrap = self.friction, np.radians(self.wrap)
        mesh = grid(_DRUM * wrap, _BELT, self.elements, 1)
        drum = Tool(
            drape.Cylinder(_DRUM, (0, 0, -_DRUM), (0, 1, 0)),
            side=1,
            friction=mu,
            elastic_slip=0.01,
            name="drum",
        )
        free = Traction("left", (-_FREE, 0, 0), factor=1.0)
        fabric = Fabric(1e4, 1.0, bending=(1e-3, 1e-3))
        ply = Ply(mesh, fabric, OnePoint(), [free, drum], dimension=3)
        angle, y = ply.nodes[0] / _DRUM, ply.nodes[1]
        x = np.array([_DRUM * np.sin(angle), y, _DRUM * (np.cos(angle) - 1)])
        ahead = np.array([np.cos(wrap), 0.0, -np.sin(wrap)])
        end = np.flatnonzero(angle > wrap - 1e-9)
        u = drape.displacement(ply.nodes, x)
        pulled = u.reshape(-1, 3)[end[0]] + ahead
        conditions = {
            "rest": Condition(np.flatnonzero(angle <= wrap - 1e-9), (None, 0.0, None)),
            "end": Condition(end, (pulled[0], 0.0, pulled[2])),
        }
        at_rest = ply.parameters_at_rest
        start = {**at_rest, "drum": Values({**at_rest["drum"], "slips_from": x})}
        state = equilibrium_near(
            *(ply, conditions, u), parameters=start, warn_only=("work", *_COARSE)
        )
        tension = ply.fibre_tension(state.u, state.parameters)[0].mean(axis=1)
        last = float(tension[ply.mesh.p[0, ply.mesh.t].mean(axis=0).argmax()])
        corners = ply.positions(state.u)[:, y < 1e-9]
        corners = corners[:, np.argsort(angle[y < 1e-9])]
        exact = _FREE * _of_polygon(corners, mu)
        product = _FREE * _of_kinks(corners, mu)
        return [
            {
                "case": str(self),
                "mu": mu,
                "wrap": self.wrap,
                "elements": self.elements,
                "force": last,
                "exact": exact,
                "off": last / exact - 1,
                "product": product,
                "off_product": last / product - 1,
                "solves": state.linear_solves,
            }
        ]


def _of_polygon(x: ndarray, mu: float) -> float:
    """Ratio of the tensions of the last and first side, with nodes x on the drum.

    At a corner the friction is along the drum and the contact force across it.
    """
    out = x[:, :-1] - [[0.0], [0.0], [-_DRUM]]
    out[1] = 0.0
    n = out / np.linalg.norm(out, axis=0)
    along = np.array([n[2], 0 * n[0], -n[0]])
    before, tension = np.array([-1.0, 0.0, 0.0]), 1.0
    for side, pulls in zip(np.diff(x, axis=1).T, (along + mu * n).T, strict=True):
        ahead = side / np.linalg.norm(side)
        tension *= float(-(before @ pulls) / (ahead @ pulls))
        before = -ahead
    return tension


def _of_kinks(x: ndarray, mu: float) -> float:
    """Product of (1 + μ tan δ/2)/(1 − μ tan δ/2) over the kinks δ of a polygon.

    The first kink is between the pull of the free end and the first side.
    """
    sides = np.diff(x, axis=1)
    sides = np.hstack([[[1.0], [0.0], [0.0]], sides / np.linalg.norm(sides, axis=0)])
    kinks = np.arccos(np.clip((sides[:, 1:] * sides[:, :-1]).sum(axis=0), -1, 1))
    grip = mu * np.tan(0.5 * kinks)
    return float(np.prod((1 + grip) / (1 - grip)))


# Strip between plates: length and width in mm, fibre stiffness in N/mm, coefficients of
# friction and pressure in N/mm².
_LENGTH, _WIDTH, _FIBRES = 50.0, 10.0, 1e4
_BELOW, _ABOVE, _PRESSURE = 0.2, 0.35, 0.01
_BOUND = (_BELOW + _ABOVE) * _PRESSURE * _LENGTH * _WIDTH


@dataclass(frozen=True)
class Strip:
    """Strip between two plates that is pulled, or moved back and forth.

    Attributes
    ----------
    cycles
        Number of cycles with an amplitude of 2 mm; 0 for a pull of 2 mm.
    steps
        Number of steps.
    slip
        Elastic slip in mm.
    """

    cycles: int
    steps: int
    slip: float = 0.02

    def __str__(self) -> str:
        moved = f"{self.cycles} cycles" if self.cycles else "pull"
        return f"strip, {moved}, {self.steps} steps, slip {self.slip:g}"

    def rows(self) -> list[Row]:
        """Force over the sum of both bounds; work of the last cycle."""
        options: Any = {"side": 1, "elastic_slip": self.slip}
        plate = Tool(drape.Plane(), friction=_BELOW, name="plate", **options)
        holder = Holder(drape.Plane(), pressure=_PRESSURE, friction=_ABOVE, **options)
        fabric = Fabric(_FIBRES, 1.0, bending=(1.0, 1.0))
        ply = Ply(
            grid(_LENGTH, _WIDTH, 10, 2), fabric, terms=[plate, holder], dimension=3
        )
        conditions = {
            "pull": Condition(
                "right", lambda X, t: self._path(t) + 0 * X[0], (1, 0, 0)
            ),
            "y": Condition("right", (None, 0.0, None)),
        }
        stepper = LoadStepper(ply, conditions, steps=self.steps, warn_only=_COARSE)
        result = stepper.run()
        x = np.array([self._path(state.load_factor) for state in result.states])
        force = np.array([state.reactions["pull"][0] for state in result.states])
        work = lost(result)
        row: Row = {
            "case": str(self),
            "force": float(np.abs(force).max()),
            "exact": _BOUND,
            "off": float(np.abs(force).max()) / _BOUND - 1,
            "solves": result.linear_solves,
        }
        if not self.cycles:
            return [row]
        last = len(x) - 1 - self.steps // self.cycles
        elastic = self.slip + _BOUND * _LENGTH / (3 * _FIBRES * _WIDTH)
        exact = _BOUND * (8.0 - 4 * elastic)
        means = 0.5 * (force[last + 1 :] + force[last:-1])
        area = float(means @ np.diff(x[last:]))
        return [
            {
                **row,
                "work": float(work[-1] - work[last]),
                "exact_work": exact,
                "off_work": float(work[-1] - work[last]) / exact - 1,
                "off_area": area / exact - 1,
            }
        ]

    def _path(self, t: float) -> float:
        return 2 * float(np.sin(2 * np.pi * self.cycles * t)) if self.cycles else 2 * t


class _Guide:
    """Springs that hold a ply across its motion along x."""

    def on(self, basis: Any) -> MatrixTerm:
        stiffness = np.tile([1e-3, 1e4, 1e4], basis.N // 3)
        return MatrixTerm("guide", diags(stiffness).tocsr())


@dataclass(frozen=True)
class Wedge:
    """Guided ply that is pushed up an incline, by its slope."""

    slope: float
    friction: float = 0.2

    def __str__(self) -> str:
        return f"wedge, μ/slope {self.friction / self.slope:.2f}"

    def rows(self) -> list[Row]:
        """Contact force over the exact one, N = F/(sin a + μ cos a)."""
        a = float(np.arctan(self.slope))
        surface = drape.Plane((10.0, 0.0, -1e-9), (-np.sin(a), 0.0, np.cos(a)))
        incline = Tool(
            surface,
            side=1,
            friction=self.friction,
            elastic_slip=1e-5,
            name="incline",
        )
        terms: list[Any] = [_Guide(), incline, Traction("left", (1.0, 0, 0))]
        fabric = Fabric(1e4, 10.0, bending=(10.0, 10.0))
        ply = Ply(grid(10.0, 10.0, 2, 2), fabric, terms=terms, dimension=3)
        held = {"y": Condition("bottom", (None, 0.0, None))}
        stepper = LoadStepper(ply, held, steps=2, max_halvings=2)
        try:
            result = stepper.run()
        except StepError as refusal:
            return [{"case": str(self), "refused": str(refusal)}]
        state = result.states[-1]
        pushed = 10.0 - 1e-3 * float(state.u[::3].sum())
        exact = pushed / (np.sin(a) + self.friction * np.cos(a))
        force = float(state.parameters["incline"]["force"].sum())
        return [
            {
                "case": str(self),
                "force": force,
                "exact": float(exact),
                "off": float(force / exact - 1),
                "solves": result.linear_solves,
                "refused": "",
            }
        ]


# Side of the square ply on a turning plate in mm, its coefficient of friction, and the
# angle of the plate in radians.
_TURNED, _RUBBING, _ANGLE = 20.0, 0.3, 2.0


@dataclass(frozen=True)
class Turning:
    """Plate that turns under a ply, which is held in its plane, by steps."""

    steps: int

    def __str__(self) -> str:
        return f"turning plate, {self.steps} steps"

    def rows(self) -> list[Row]:
        """Work of sliding over the bounds times the arcs, less the elastic slip."""
        half, slip = 0.5 * _TURNED, 0.02
        mesh = grid(_TURNED, _TURNED, 4, 4).translated((-half, -half))
        rub: Any = {"side": 1, "friction": _RUBBING, "elastic_slip": slip}
        plate = Tool(drape.Plane(), _turn, name="plate", **rub)
        weight = Holder(drape.Plane(), pressure=0.01, side=1, name="weight")
        ply = Ply(mesh, Fabric(_FIBRES, 1.0), terms=[plate, weight], dimension=3)
        held = {"held": Condition(lambda X: X[0] == X[0], (0.0, 0.0, None))}
        stepper = LoadStepper(ply, held, self.steps, warn_only=("work", *_COARSE))
        result = stepper.run()
        bound = result.states[-1].parameters["plate"]["bound"]
        radius = np.linalg.norm(ply.nodes, axis=0)
        exact = float(bound @ np.maximum(_ANGLE * radius - slip, 0.0))
        work = float(lost(result)[-1])
        warnings = (state.warnings.get("work", "") for state in result.states)
        return [
            {
                "case": str(self),
                "steps": self.steps,
                "work": work,
                "exact": exact,
                "off": work / exact - 1,
                "warned": any("turns within the step" in text for text in warnings),
                "resolved": result.path_resolved,
            }
        ]


def _turn(t: float) -> tuple[ndarray, ndarray]:
    c, s = np.cos(_ANGLE * t), np.sin(_ANGLE * t)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.zeros(3)


# Side of the square ply under a rigid holder in mm; its thickness in mm, pressure in
# N/mm² and exponent of the power law of compaction.
_SIDE, _THICKNESS, _STIFF, _EXPONENT = 20.0, 0.3, 1e-3, 8.0


@dataclass(frozen=True)
class Compacted:
    """Ply that shears without friction below a rigid holder, by force in N and angle.

    Of the ply at the shear angle γ in degrees the area A is cos γ times the flat one,
    and the areal weight 1/cos γ times.
    """

    force: float
    angle: float

    def __str__(self) -> str:
        return f"rigid holder, {self.force:g} N, shear {self.angle:g}°"

    def rows(self) -> list[Row]:
        """Force on the plate, and distance over t₀/cos γ (1 + F/PA)^(−1/B)."""
        law = Compaction(_THICKNESS, _STIFF, _EXPONENT)
        plate = Tool(drape.Plane(), side=1, name="plate")
        holder = Holder(drape.Plane(), side=1, force=self.force, compaction=law)
        fabric, mesh = Fabric(_FIBRES, 1.0), grid(_SIDE, _SIDE, 4, 4)
        ply = Ply(mesh, fabric, terms=[plate, holder], dimension=3)
        edge = ply.mesh.boundary_nodes()

        def turned(component: int, X: ndarray, t: float) -> ndarray:
            angle = np.radians(self.angle) * t
            return X[1] * (np.sin(angle), np.cos(angle) - 1)[component]

        conditions = {
            "x": Condition(edge, partial(turned, 0), (1, 0, 0)),
            "y": Condition(edge, partial(turned, 1), (0, 1, 0)),
        }
        result = LoadStepper(ply, conditions, steps=3, warn_only=_COARSE).run()
        state, share = result.states[-1], np.cos(np.radians(self.angle))
        force = float(state.reactions["plate"][2])
        pressure = self.force / (_SIDE**2 * share)
        distance = _THICKNESS / share * (1 + pressure / _STIFF) ** (-1 / _EXPONENT)
        found = float(state.parameters["holder"]["distance"])
        return [
            {
                "case": str(self),
                "force": force,
                "exact": self.force,
                "off": force / self.force - 1,
                "off_distance": found / distance - 1,
                "solves": result.linear_solves,
            }
        ]


# Quarter of a ply of 300 mm, radius of the punch, fillet of the die, and gap, in mm.
_HALF, _PUNCH, _FILLET, _GAP = 150.0, 75.0, 10.0, 0.3


@dataclass(frozen=True)
class Hemisphere:
    """Hemisphere whose holder presses the ply on the die with 0.002 N/mm².

    Attributes
    ----------
    parts
        Elements across the whole ply.
    steps
        Number of steps.
    friction
        Coefficient of all tools.
    slip
        Elastic slip in mm.
    at_nodes
        True for contact at the nodes, instead of the contact points of macro-elements.
    whole_areas
        True for a holder that presses on the whole area of nodes within its outline,
        instead of the part of each element there.
    same_total
        True if these areas are scaled to the sum of the areas of the parts.
    """

    parts: int
    steps: int
    friction: float = 0.2
    slip: float = 0.02
    at_nodes: bool = False
    whole_areas: bool = False
    same_total: bool = False

    def __str__(self) -> str:
        where = ", contact at the nodes" if self.at_nodes else ""
        where += ", whole nodal areas" if self.whole_areas else ""
        where += " of the same total" if self.same_total else ""
        return (
            f"hemisphere, {self.parts} parts, {self.steps} steps, μ {self.friction:g}, "
            f"slip {self.slip:g}{where}"
        )

    def ply(self) -> Ply:
        """Quarter of the ply between its tools."""
        with contact_at_nodes() if self.at_nodes else nullcontext():
            return self._ply()

    def _ply(self) -> Ply:
        rub: Any = {"friction": self.friction, "elastic_slip": self.slip}
        turn, hole = np.linspace(0, 2 * np.pi, 181), _PUNCH + 5 + _FILLET
        circle = np.array([np.cos(turn), np.sin(turn)])
        ring = np.hstack([400.0 * circle, hole * circle])
        flange = drape.Plane((0, 0, _GAP / 2), (0, 0, 1.0))
        punch = drape.Punch(_PUNCH, (0, 0, -_PUNCH - _GAP / 2))
        die = drape.Die(_PUNCH + 5, _FILLET, (0, 0, _GAP / 2))
        tools = (
            Tool(punch, (0, 0, 75.0), name="punch", **rub),
            Tool(die, name="die", **rub),
            Holder(flange, pressure=0.002, side=-1, outline=ring, **rub),
        )
        pulls = (
            Traction("right", (0.05, 0, 0), factor=1.0),
            Traction("top", (0, 0.05, 0), factor=1.0),
        )
        mesh = grid(_HALF, _HALF, self.parts // 2, self.parts // 2)
        fabric, ends = Fabric(1e4, 0.1, bending=(5.0, 5.0)), ("left", "bottom")
        mirrors: Any = dict.fromkeys(ends, "mirror")
        terms: list[Any] = [*pulls, *tools]
        return Ply(mesh, fabric, terms=terms, dimension=3, fibre_ends=mirrors)

    def stepper(self) -> LoadStepper:
        """Its load stepper."""
        held = {
            "x": Condition("left", (0.0, None, None)),
            "y": Condition("bottom", (None, 0.0, None)),
        }
        return LoadStepper(self.ply(), held, steps=self.steps)

    def rows(self) -> list[Row]:
        """Force, largest angle, draw-in, work of sliding and balance of energy."""
        areas = whole_nodal_areas(self.same_total)
        with areas if self.whole_areas else nullcontext():
            result = self.stepper().run()
        ply, state = result.ply, result.states[-1]
        x, X = ply.positions(state.u), ply.nodes
        side = np.flatnonzero((X[0] > _HALF - 1e-9) & (X[1] < 1e-9))[0]
        corner = np.flatnonzero((X > _HALF - 1e-9).all(axis=0))[0]
        angle = np.degrees(np.abs(ply.shear_angle(state.u, ply.centre)).max())
        force = np.array([one.reactions["punch"][2] for one in result.states])
        travel = np.array([75.0 * one.load_factor for one in result.states])
        pressed = -work_of(result, "holder")
        work = float(np.trapezoid(force, travel)) + pressed
        stabilised = state.energies["stabilisation"] - work_of(result, "stabilisation")
        slid = float(lost(result)[-1])
        return [
            {
                "case": str(self),
                "force": float(force[-1]),
                "angle": float(angle),
                "draw_in": _HALF - float(x[0, side]),
                "corner": float(np.hypot(*(_HALF - x[:2, corner]))),
                "work": slid,
                "holder_work": pressed,
                "beyond": _beyond(result),
                "balance": (_stored(result, self.slip) + slid) / work - 1,
                "of_stabilisation": stabilised / work,
                "solves": result.linear_solves,
                "resolved": result.path_resolved,
                "parts": self.parts,
                "steps": self.steps,
                "mu": self.friction,
                "slip": self.slip,
                "at_nodes": self.at_nodes,
            }
        ]


@dataclass(frozen=True)
class Steps:
    """Hemisphere in a number of steps, by its holder, with a pressure or a gap."""

    holder: str
    steps: int

    def __str__(self) -> str:
        return f"steps, {self.holder}, {self.steps}"

    def rows(self) -> list[Row]:
        """Work of sliding, and its estimated error."""
        if self.holder == "pressure":
            stepper = Hemisphere(12, self.steps).stepper()
        else:
            scene = hemisphere_forming(friction=0.2)
            fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
            stepper = Case(scene=scene, fabric=fabric, steps=self.steps).stepper()
        result = stepper.run()
        rubbing: list[Any] = pressing(result.ply)
        errors = [tool.friction.errors(tool, result.states) for tool in rubbing]
        return [
            {
                "case": str(self),
                "holder": self.holder,
                "steps": self.steps,
                "work": float(lost(result)[-1]),
                "error": float(np.sum(errors)),
                "warned": any("work of friction" in x for x in result.warnings),
            }
        ]


@contextmanager
def whole_nodal_areas(same_total: bool) -> Iterator[None]:
    """Holders press on the whole area of each node within their outline.

    With ``same_total`` times a factor, so that the sum equals the one of the parts of
    elements within the outline.
    """
    kind: Any = holders._Pressed
    before = kind._areas

    def whole(self: Any, u: ndarray, t: float) -> tuple[ndarray, ndarray]:
        x = self._points.positions(u)
        areas = self._summed(self._integrals) * inside(self._outline, x[:2])
        if same_total:
            areas *= before(self, u, t)[0].sum() / areas.sum()
        return areas, np.ones(x.shape[1])

    kind._areas = whole
    try:
        yield
    finally:
        kind._areas = before


def work_of(result: Result, name: str) -> float:
    """Work against the forces of a term, by trapezoids, in N·mm.

    Friction of a holder, which is in the plane of the flange, is left out.
    """
    term = next(term for term in result.ply.terms if term.name == name)

    def forces(state: State) -> ndarray:
        p = state.parameters.get(name, NO_VALUES)
        f = np.array(term.residual(state.u, state.load_factor, p))
        if name == "holder":
            f.reshape(-1, 3)[:, :2] = 0.0
        return f

    return sum(
        0.5 * float((forces(one) + forces(other)) @ (other.u - one.u))
        for one, other in pairwise(result.states)
    )


def _beyond(result: Result) -> float:
    """Largest distance in mm by which the holder presses beyond its surface."""
    state = result.states[-1]
    term: Any = next(term for term in result.ply.terms if term.name == "holder")
    under = state.parameters["holder"]["areas"] > 0
    return float((term._points.positions(state.u)[2, under] - _GAP / 2).max())


def _stored(result: Result, slip: float) -> float:
    """Rise of the energy of ply, tractions and elastic slips in N·mm."""

    def of(state: State) -> float:
        pulled = (x for k, x in state.potentials.items() if k.startswith("traction"))
        elastic = sum(_of_slips(term, state, slip) for term in pressing(result.ply))
        return sum(state.energies.values()) + sum(pulled) + elastic

    return of(result.states[-1]) - of(result.states[0])


def _of_slips(term: Any, state: State, slip: float) -> float:
    """Energy of the elastic slips on a tool in N·mm."""
    if not term.friction:
        return 0.0
    p = state.parameters[term.name]
    squares = (term.friction.forces(state.u, state.load_factor, p) ** 2).sum(axis=1)
    under = p["bound"] > 0
    return 0.5 * slip * float((squares[under] / p["bound"][under]).sum())


# Elements across the hemisphere, and steps.
_RESOLUTIONS = (12, 10), (12, 20), (12, 40), (24, 10), (24, 20), (48, 20)

# Angles of contact of belts in degrees, and elements along them.
_BELTS = tuple((wrap, elements) for wrap in (30, 90, 180) for elements in (30, 60, 240))


def problems() -> Iterator[Any]:
    """Every problem with an exact force, and the hemisphere."""
    for mu in (0.1, 0.2, 0.3, 0.4):
        for wrap, elements in _BELTS:
            yield Belt(mu, wrap, elements)
    yield from (Strip(0, 1), Strip(0, 20), Strip(2, 40), Strip(2, 80))
    yield from (Strip(2, 80, 0.1), Strip(0, 20, 0.1))
    yield from (Compacted(10.0, 0.0), Compacted(10.0, 30.0), Compacted(400.0, 30.0))
    for slope in (1.0, 0.5, 0.3, 0.25, 0.2, 0.15, 0.12, 0.1):
        yield Wedge(slope)
    yield from map(Turning, (1, 2, 4, 5, 8, 16))
    for holder in ("pressure", "gap"):
        yield from (Steps(holder, steps) for steps in (3, 6, 12, 24, 48))
    for parts, steps in _RESOLUTIONS:
        yield Hemisphere(parts, steps)
    yield from (Hemisphere(24, 20, 0.2, slip) for slip in (0.1, 0.005, 0.001))
    for parts, steps in _RESOLUTIONS:
        yield Hemisphere(parts, steps, 0.0)
    for parts, steps in _RESOLUTIONS[:-1]:
        yield Hemisphere(parts, steps, at_nodes=True)
        yield Hemisphere(parts, steps, at_nodes=True, whole_areas=True)
    for whole in (False, True):
        yield Hemisphere(24, 20, 0.0, at_nodes=True, whole_areas=whole)
    for mu in (0.2, 0.0):
        yield Hemisphere(24, 20, mu, at_nodes=True, whole_areas=True, same_total=True)
