"""Stiff and extreme drapes, verified by checks that do not use the solver.

- Every node is on the surface.
- Perturbations along the surface change the energy in second order only, and raise it.
- Fibres along the sides of inextensible plies agree with the kinematic net.  Each plane
  of symmetry keeps a thread straight, which makes the net unique, except for threads
  that end at a hole.
- The mirror image of a surface gives the same shear angles.
- A mesh with half the element size gives the same shear angles and positions.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    OnSurface,
    Ply,
    Quadratic,
    Surface,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.ply.builtin_terms import FibreEnd
from skfem_textile.solve.conditions import Conditions, Constraints
from skfem_textile.solve.interval import error_interval
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem
from skfem_textile.solve.result import StepError
from skfem_textile.solve.states import NoEquilibriumError, State
from skfem_textile.solve.stepper import DEFAULT_WARN_ONLY
from skfem_textile.solve.verdict import excess
from skfem_textile.surfaces.surface import distance, onto

from ...common.tables import Row
from . import cases

#: Slope of a 60° wall, and side of the quarter ply in mm.
STEEP, SIDE = np.sqrt(3.0), 100.0

# Radii of the curved regions in mm.
_TIP, _BUMP, _WAVE = 40.0, 50.0, 40.0

#: Kind of all cases.
EXTREME = "extreme"

FORMULATIONS = cases.FORMULATIONS | {"quadratic": Quadratic(80.0)}

SHEAR = 0.1

# Largest displacement of inner nodes relative to the element size.
_DISTORTION = 0.25

# Finite-difference step of positions in mm.
_STEP = 1e-3

# Number of equal steps of a growing surface.
_STEPS = 4

# Linear solver of the error intervals.
_SOLVER = "superlu"

#: Outcomes: right; inaccurate, but with a warning; refused with a reason; wrong.
RIGHT, TOLD, REFUSED, WRONG = "right", "told", "refused", "wrong"

#: Largest distance from the surface in mm.
OFF_SURFACE = 1e-8

#: Tolerances: rms difference of shear angles in degrees, difference of positions
#: relative to the working element size.
ANGLE, POSITION = 3.0, 0.25

#: Largest difference of shear angles between mirror images in degrees.
OFF_MIRROR = 1e-4

#: Rotation in degrees per unit fibre strain, for the net without strain.
ANGLE_OVER_STRAIN = 100.0

# Amplitude of test perturbations in mm, their number, and the ratio of first-order to
# second-order energy that counts as zero.
_MOTION, _MOTIONS, _FIRST_ORDER = 1e-4, 5, 1e-2

# Net cells per side.
_CELLS = 64

# E/G from which fibres are virtually inextensible.
_INEXTENSIBLE = 1e4


def _rounded_cone(x: ndarray, y: ndarray) -> drape.Height:
    """A cone with 60° walls and a rounded tip."""
    s = np.sqrt(x * x + y * y + _TIP**2)
    height = (_TIP - s, -x / s, -y / s)
    second = (x * x / s**3 - 1 / s, x * y / s**3, y * y / s**3 - 1 / s)
    return drape.Height(*(STEEP * a for a in (*height, *second)))


def _bump(x: ndarray, y: ndarray) -> drape.Height:
    """A Gaussian bump with a maximum slope of 60°."""
    s, top = _BUMP, STEEP * _BUMP * np.exp(0.5)
    h = top * np.exp(-0.5 * (x * x + y * y) / s**2)
    second = ((x * x / s**2 - 1), x * y / s**2, (y * y / s**2 - 1))
    return drape.Height(
        h - top, -x / s**2 * h, -y / s**2 * h, *(a / s**2 * h for a in second)
    )


def _waves(x: ndarray, y: ndarray) -> drape.Height:
    """Waves along x with a maximum slope of 60°; a developable surface."""
    zero, a = np.zeros_like(x), STEEP * _WAVE
    c, s = np.cos(x / _WAVE), np.sin(x / _WAVE)
    return drape.Height(a * (c - 1), -STEEP * s, zero, -a / _WAVE**2 * c, zero, zero)


def _saddle(x: ndarray, y: ndarray) -> drape.Height:
    """A saddle with a slope of 60° at the distance of the side."""
    zero, a = np.zeros_like(x), 0.5 * STEEP / SIDE
    return drape.Height(
        a * (x * x - y * y), 2 * a * x, -2 * a * y, zero + 2 * a, zero, zero - 2 * a
    )


#: Surfaces by name; the sphere and the cylinder are steeper than 60° at the corner.
SURFACES: dict[str, Surface] = {
    "sphere": drape.Sphere(100.0, (0.0, 0.0, -100.0)),
    "cylinder": drape.Cylinder(60.0, (0.0, 0.0, -60.0)),
    "cone": drape.HeightField(_rounded_cone),
    "bump": drape.HeightField(_bump),
    "waves": drape.HeightField(_waves),
    "saddle": drape.HeightField(_saddle),
    "double dome": drape.double_dome(60.0, 180.0, 75.0, 0.25, 60.0),
}


@dataclass(frozen=True, eq=False)
class Mirrored:
    """A surface mirrored in the plane z = 0, with its two sides exchanged."""

    surface: Surface

    def level(self, x: ndarray) -> ndarray:
        """φ, shape (n,)."""
        return -self.surface.level(_mirrored(x))

    def gradient(self, x: ndarray) -> ndarray:
        """∇φ, shape (3, n)."""
        return -_mirrored(self.surface.gradient(_mirrored(x)))

    def hessian(self, x: ndarray) -> ndarray:
        """∇²φ, shape (3, 3, n)."""
        H = self.surface.hessian(_mirrored(x))
        return -_mirrored(_mirrored(H).swapaxes(0, 1)).swapaxes(0, 1)


def _mirrored(v: ndarray) -> ndarray:
    """Vectors with their last component negated."""
    return np.concatenate([v[:2], -v[2:]])


@dataclass(frozen=True)
class Extreme:
    """One case.

    Attributes
    ----------
    group
        Group of extreme cases.
    surface
        Name of `SURFACES`.
    bias
        Fibres at ±45° instead of along the sides.
    stiffness
        E/G; G is 0.1 N/mm.
    formulation
        Name of `FORMULATIONS`.
    cells
        The user's elements per side.
    mesh
        Regular or distorted quadrilaterals, or triangles, or with a hole.
    bending
        D of both families in N·mm.
    tension
        Tension on the free edges in N/mm.
    mirrored
        Mirror the surface.
    growing
        Grow the surface out of the plane, instead of an initial guess along geodesics.
    kind
        `EXTREME`.
    """

    group: str
    surface: str
    bias: bool
    stiffness: float = 1e6
    formulation: str = "macro"
    cells: int = 4
    mesh: str = "regular"
    bending: float = 0.0
    tension: float = 1.0
    mirrored: bool = False
    growing: bool = False
    kind: str = EXTREME

    def __str__(self) -> str:
        words = [self.kind, self.group, self.surface, "±45" if self.bias else "0/90"]
        words += [f"E/G={self.stiffness:g}", self.formulation, f"{self.cells} cells"]
        words += [self.mesh, f"D={self.bending:g}", f"q={self.tension:g}"]
        return ", ".join(words)

    def rows(self) -> list[Row]:
        """Run the case and verify the result."""
        return [{"case": str(self), "refused": "", **asdict(self), **judged(self)}]


def all_extremes() -> Iterator[Extreme]:
    """All cases, group by group."""
    every = list(product(SURFACES, (False, True)))
    for on in every:
        for stiffness in (1e2, 1e4, 1e6, 1e8):
            yield Extreme("stiffness", *on, stiffness)
            yield Extreme("stiffness", *on, stiffness, "one point", 8)
        for mesh in ("distorted", "distorted triangles", "hole"):
            yield Extreme("mesh", *on, mesh=mesh)
        yield Extreme("mesh", *on, formulation="one point", cells=8, mesh="distorted")
        yield Extreme("mesh", *on, formulation="quadratic", mesh="triangles")
        yield Extreme("mesh", *on, formulation="quadratic", mesh="hole")
        yield Extreme("mesh", *on, formulation="2×2 points", cells=8)
        yield Extreme("coarse", *on, cells=2)
        yield Extreme("coarse", *on, formulation="one point", cells=3)
        for bending in (1.0, 1e2, 1e3):
            yield Extreme("bending", *on, bending=bending)
        yield Extreme("bending alone", *on, bending=10.0, tension=0.0)
        yield Extreme("bending alone", *on, bending=1e3, tension=0.0)
        yield Extreme("free edges", *on, tension=0.0)
        yield Extreme("mirrored", *on, mirrored=True)
        yield Extreme("growing", *on, growing=True)


class Drape(NamedTuple):
    """A ply on its surface, and the computed state."""

    ply: Ply
    conditions: Conditions
    surface: Surface
    state: State

    @property
    def positions(self) -> ndarray:
        """Positions of the nodes in mm, shape (3, n_nodes)."""
        return self.ply.positions(self.state.u)

    @property
    def angle(self) -> ndarray:
        """Mean shear angle of each of the user's elements in degrees."""
        of_parts = self.ply.shear_angle(self.state.u).mean(axis=1)
        return np.degrees(self.ply.on_users_elements(of_parts))


def draped(case: Extreme, halvings: int = 0) -> Drape:
    """Drape a ply on a mesh refined a number of times.

    Raises
    ------
    NoEquilibriumError, StepError
        If no equilibrium is found.
    """
    surface = SURFACES[case.surface]
    surface = Mirrored(surface) if case.mirrored else surface
    mesh = mesh_of(case)
    mesh = mesh.refined(halvings).with_defaults() if halvings else mesh
    names = ("right", "top") if case.tension else ()
    loads = [
        Traction(name, _outwards(surface, i, case.tension), factor=lambda t: t)
        for i, name in enumerate(names)
    ]
    c, s = (np.sqrt(0.5), np.sqrt(0.5)) if case.bias else (1.0, 0.0)
    fabric = Fabric(
        *(case.stiffness * SHEAR, SHEAR),
        warp=(c, s),
        weft=(-s, c),
        bending=(case.bending, case.bending),
    )
    formulation = FORMULATIONS[case.formulation]
    ends: dict[str, FibreEnd] = {}
    if case.bending:
        ends = {"left": "mirror", "bottom": "mirror"}
    ply = Ply(mesh, fabric, formulation, loads, dimension=3, fibre_ends=ends)
    conditions: Conditions = {
        "on": OnSurface(surface),
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
    }
    if case.growing:
        run = LoadStepper(ply, conditions, _STEPS).run()
        return Drape(ply, conditions, surface, run.states[-1])
    start = drape.displacement(ply.nodes, drape.exponential_map(surface, ply.nodes))
    state = equilibrium_near(ply, conditions, start, warn_only=DEFAULT_WARN_ONLY)
    return Drape(ply, conditions, surface, state)


def mesh_of(case: Extreme) -> Mesh:
    """The user's mesh."""
    s = np.linspace(0, SIDE, case.cells + 1)
    of = MeshTri if "triangles" in case.mesh else MeshQuad
    mesh = of.init_tensor(s, s)
    if "distorted" in case.mesh:
        inner = ((mesh.p > 0) & (mesh.p < SIDE)).all(axis=0)
        moves = np.random.default_rng(1).uniform(-1, 1, mesh.p.shape)
        moves *= _DISTORTION * SIDE / case.cells
        mesh = replace(mesh, doflocs=mesh.p + inner * moves)
    if case.mesh == "hole":
        centres = mesh.p[:, mesh.t].mean(axis=1)
        hole = (np.abs(centres / SIDE - 0.625) < 0.13).all(axis=0)
        mesh = mesh.remove_elements(np.flatnonzero(hole))
    return mesh.with_defaults()


def _outwards(surface: Surface, side: int, tension: float) -> Callable:
    """Dead traction along the geodesics normal to a side of the ply."""

    def at(X: ndarray) -> ndarray:
        points = X.reshape(2, -1)
        step = np.zeros((2, 1))
        step[side] = _STEP
        ahead, back = (
            drape.exponential_map(surface, points + sign * step) for sign in (1, -1)
        )
        along = (ahead - back) / np.linalg.norm(ahead - back, axis=0)
        return tension * along.reshape(3, *X.shape[1:])

    return at


def judged(case: Extreme) -> Row:
    """Run a case and verify the result."""
    try:
        final = draped(case)
    except (NoEquilibriumError, StepError) as error:
        return {"outcome": REFUSED, "reason": str(error)}
    row: Row = {
        "solves": final.state.linear_solves,
        "strain": final.state.verdict.max_fibre_strain,
        "at_risk": float(
            drape.wrinkle_risk(final.ply, final.state.u, final.state.parameters).mean()
        ),
        "element_size": float(final.ply.element_size),
        "off_surface": float(np.abs(distance(final.surface, final.positions)).max()),
        "first_order": _first_order(case, final),
    }
    row |= _against_net(case, final) | _against_finer(case, final)
    if case.mirrored:
        other = draped(replace(case, mirrored=False))
        row["off_mirror"] = float(np.abs(final.angle - other.angle).max())
    complaints = _complaints(row)
    notes = "" if _is_unsound(row) else _warnings(final)
    outcome = WRONG if complaints else RIGHT
    if complaints and notes:
        outcome = TOLD
    return {"outcome": outcome, "reason": "; ".join(complaints), "told": notes, **row}


def _warnings(result: Drape) -> str:
    """Warnings of a state about its accuracy; empty without warnings."""
    ply, state = result.ply, result.state
    constraints = Constraints(ply.basis, result.conditions)
    problem = Problem(ply, constraints, solver_named(_SOLVER))
    error = error_interval(problem, result.conditions, _SOLVER, state).shear_angle
    reasons = {
        "wrinkles": drape.wrinkle_risk(ply, state.u, state.parameters).any(),
        "stabilisation": excess(state.shares, "stabilisation"),
        "deviations": excess(state.shares, "deviation"),
        "estimated error": np.degrees(error or 0.0) > ANGLE,
    }
    return ", ".join(reason for reason, applies in reasons.items() if applies)


def _is_unsound(row: Row) -> bool:
    """Return True if a state is off its surface, or not a stable equilibrium."""
    return not (
        row["off_surface"] <= OFF_SURFACE and 0 <= row["first_order"] <= _FIRST_ORDER
    )


def _complaints(row: Row) -> list[str]:
    """Failed checks of a state."""
    texts = []
    if _is_unsound(row):
        texts.append("no stable equilibrium on the surface")
    if row.get("off_net", 0.0) > ANGLE + ANGLE_OVER_STRAIN * row["strain"]:
        texts.append(f"differs from the net by {row['off_net']:.1f}°")
    if row.get("off_finer", 0.0) > ANGLE:
        texts.append(f"differs from the finer mesh by {row['off_finer']:.1f}°")
    if row.get("off_mirror", 0.0) > OFF_MIRROR:
        texts.append(f"differs from the mirror image by {row['off_mirror']:.1e}°")
    if row.get("moved", 0.0) > POSITION * row["element_size"]:
        texts.append(f"differs from the finer mesh by {row['moved']:.1f} mm")
    return texts


def _first_order(case: Extreme, result: Drape) -> float:
    """Ratio of first-order to second-order energy of perturbations along the surface.

    The maximum over a few smooth symmetric perturbations; −1 if one lowers the energy.
    Perturbed positions are projected onto the surface.
    """
    ply, x = result.ply, result.positions
    rng, largest = np.random.default_rng(0), 0.0
    free = np.ones_like(x, dtype=bool)
    for i, name in enumerate(("left", "bottom")):
        nodes = result.conditions["xy"[i]].nodes(name, ply.basis)
        free[i, nodes] = False
    projectors = np.array([np.diag(f) for f in free.T.astype(float)])
    for _ in range(_MOTIONS):
        phase, waves = rng.uniform(0, 6, (3, 1)), rng.uniform(-4, 4, (3, 2)) / SIDE
        v = _MOTION * np.sin(waves @ ply.nodes + phase) * free
        ends = [onto(result.surface, x + sign * v, projectors) for sign in (1, -1)]
        energies = [_energy(result, end) for end in (*ends, x)]
        first = abs(energies[0] - energies[1]) / 2
        second = (energies[0] + energies[1]) / 2 - energies[2]
        round_off = 1e-12 * sum(abs(e) for e in result.state.energies.values())
        if second < -round_off - first:
            return -1.0
        largest = max(largest, first / max(second, round_off, 1e-300))
    return float(largest)


def _energy(result: Drape, x: ndarray) -> float:
    u = drape.displacement(result.ply.nodes, x)
    return result.ply.energy(u, result.state.load_factor, result.state.parameters)


def _against_net(case: Extreme, result: Drape) -> Row:
    """Rms difference of the shear angles from the kinematic net."""
    inextensible = case.stiffness >= _INEXTENSIBLE and case.tension and not case.bending
    if case.bias or not inextensible or case.mesh == "hole":
        return {}
    cells = (0, _CELLS)
    try:
        net = drape.net(result.surface, SIDE / _CELLS, cells, cells)
    except ValueError:
        return {}
    element = result.ply.users_mesh.element_finder()(*net.centres().reshape(2, -1))
    angle = np.degrees(net.shear_angle().ravel())
    off = result.angle - np.bincount(element, angle) / np.bincount(element)
    return {"off_net": float(np.sqrt(np.mean(off**2)))}


def _against_finer(case: Extreme, result: Drape) -> Row:
    """Differences of shear angles and positions from a refined mesh."""
    try:
        finer = draped(case, halvings=1)
    except (NoEquilibriumError, StepError):
        return {}
    off = result.angle - finer.angle.reshape(4, -1).mean(axis=0)
    n = result.ply.users_mesh.p.shape[1]
    moved = np.linalg.norm((result.positions[:, :n] - finer.positions[:, :n]), axis=0)
    return {"off_finer": float(np.sqrt(np.mean(off**2))), "moved": float(moved.max())}
