"""Cases of the study: plies on a sphere, nets, rolled plies.

Each case measures errors against the exact solution.  Formulations and initial guesses
on the sphere are also timed.
"""

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from itertools import product
from time import process_time

import numpy as np
from numpy import ndarray
from scipy.spatial import ConvexHull
from skfem import CellBasis

from skfem_textile import (
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    OnSurface,
    Ply,
    Quadratic,
    Surface,
    drape,
    equilibrium_near,
)
from skfem_textile.ply.terms import Formulation, Term
from skfem_textile.solve.conditions import Conditions
from skfem_textile.solve.result import StepError
from skfem_textile.solve.states import NoEquilibriumError, State

from ...common.tables import Row
from . import chebyshev, published, rolled
from .published import DRAPINGS
from .rolled import BIAS, CYLINDER, FAN, SQUARES


class Flat(Macro):
    """Macro-elements with in-plane stabilisation only."""

    def stabilising_terms(self, basis: CellBasis, fabric: Fabric) -> list[Term]:
        """The stabilising terms without the out-of-plane term."""
        every = super().stabilising_terms(basis, fabric)
        return [term for term in every if term.name != "out_of_plane"]


#: Name of the formulation with in-plane stabilisation only.
FLAT = "macro, no C_s out of plane"

FORMULATIONS: dict[str, Formulation] = {
    "macro": Macro(),
    "one point": OnePoint(),
    FLAT: Flat(),
    "2×2 points": Full(),
    "quadratic triangles": Quadratic(80.0),
    "split triangles": Macro(),
}

#: Kinds of cases: ply on the sphere, timed ply on the sphere, net, net compared with a
#: published method, rolled ply.
SPHERE, TIME, NET = "sphere", "time", "net"
PUBLISHED, ROLLED = "published", "rolled"

#: Initial guesses.
EXPONENTIAL, FROM_NET, GROWTH = "exponential map", "net", "growth"

# Shear stiffness in N/mm.
_SHEAR = 0.1

# Timed runs, of which the fastest counts, and total time in s after which to stop.
_RUNS, _ENOUGH = 5, 2.0

_WARN_ONLY = "stabilisation", "deviation", "work"


@dataclass(frozen=True)
class Case:
    """One case.

    Attributes
    ----------
    kind
        One of `SPHERE`, `TIME`, `NET`, `PUBLISHED` and `ROLLED`.
    parts
        Node spacings per side; macro-elements and quadratic triangles span two.  For a
        published net, the number of cells per side that replace one cell.
    formulation
        Name of `FORMULATIONS`.
    stretch, tension
        E and the tension on the free edges in N/mm; G is 0.1 N/mm.
    bending
        D of both families in N·mm.
    distortion
        Largest displacement of mesh nodes relative to the element size.
    halvings
        Number of uniform refinements after the nodes are moved.
    surface
        Representation of the sphere, analytic or as 5000 triangles; the surface of a
        rolled ply; the name of a published draping.
    start
        `EXPONENTIAL`, `FROM_NET` or `GROWTH`.
    """

    kind: str
    parts: int
    formulation: str = "one point"
    stretch: float = 1e5
    tension: float = 2.0
    bending: float = 0.0
    distortion: float = 0.0
    halvings: int = 0
    surface: str = "analytic"
    start: str = EXPONENTIAL

    def __str__(self) -> str:
        words = [self.kind, f"{self.parts} parts"]
        if self.kind == PUBLISHED:
            words.append(self.surface)
        elif self.kind != NET:
            words += [self.formulation, f"E={self.stretch:g}", f"q={self.tension:g}"]
            words += [
                f"D={self.bending:g}",
                f"moved {self.distortion:g}",
                f"halved {self.halvings}",
            ]
            words += [self.surface, self.start]
        return ", ".join(words)

    def rows(self) -> list[Row]:
        """Run the case; the row of a failed run contains the reason."""
        measure = {NET: _net, PUBLISHED: _published, TIME: _timed}
        head: Row = {"case": str(self), "refused": "", **asdict(self)}
        try:
            return [head | measure.get(self.kind, _draped)(self)]
        except (NoEquilibriumError, StepError) as error:
            return [head | {"refused": str(error)}]


def _draped(case: Case) -> Row:
    """Results of a ply on its surface."""
    ply, conditions, surface, start = (
        on_sphere(case) if case.kind == SPHERE else _on_developable(case)
    )
    began = process_time()
    warn_only = "stabilisation", "deviation"
    state = equilibrium_near(ply, conditions, start, warn_only=warn_only)
    seconds = process_time() - began
    row: Row = {
        "unknowns": ply.basis.N,
        "solves": state.linear_solves,
        "seconds": seconds,
        "stable": state.verdict.stable,
        "fibre_strain": state.verdict.max_fibre_strain,
        "at_risk": float(drape.wrinkle_risk(ply, state.u, state.parameters).mean()),
        "pressure_error": _pressure_error(case, ply, surface, state),
    }
    if case.kind == SPHERE:
        return row | _on_net(ply, state)
    return row | _sheared(ply, state, start)


def _on_net(ply: Ply, state: State) -> Row:
    """Errors against the Chebyshev net."""
    off = chebyshev.errors(ply, state.u)
    corner = ply.mesh.p[:, ply.mesh.t].mean(axis=1).sum(axis=0).argmax()
    tension = ply.fibre_tension(state.u, state.parameters)
    largest, rms = chebyshev.error(ply, state.u)
    return {
        "largest": largest,
        "rms": rms,
        "but_corner": float(np.abs(np.delete(off, corner)).max()),
        "in_corner": float(off[corner]),
        "corner_angle": float(
            np.degrees(ply.shear_angle(state.u, ply.centre)[corner, 0])
        ),
        "median": float(np.median(np.abs(off))),
        "least_tension": float(tension.min()),
        "largest_tension": float(tension.max()),
        "shear_energy": state.energies["shear"],
        "energy": float(sum(state.energies.values())),
    }


def _sheared(ply: Ply, state: State, exact: ndarray) -> Row:
    """Spurious shear of the state and of the exact positions."""
    largest, interpolated = (
        float(np.degrees(np.abs(ply.shear_angle(u)).max())) for u in (state.u, exact)
    )
    moved = float(np.linalg.norm(ply.nodal(state.u - exact), axis=0).max())
    return {"largest": largest, "interpolated": interpolated, "moved": moved}


def sphere_of_triangles(vertices: int = 2502) -> drape.TriangleMesh:
    """The sphere of `chebyshev` as triangles between points of a spiral."""
    k = np.arange(vertices) + 0.5
    polar, around = np.arccos(1 - 2 * k / vertices), np.pi * (1 + 5**0.5) * k
    across = np.sin(polar)
    p = np.array([np.cos(around) * across, np.sin(around) * across, np.cos(polar)])
    t = ConvexHull(p.T).simplices.T.copy()
    a, b, c = p[:, t[0]], p[:, t[1]], p[:, t[2]]
    inwards = (np.cross(b - a, c - a, axis=0) * a).sum(axis=0) < 0
    t[1:, inwards] = t[:0:-1, inwards]
    centre = np.asarray(chebyshev.SPHERE.centre)[:, None]
    return drape.TriangleMesh(chebyshev.RADIUS * p + centre, t)


def _net(case: Case) -> Row:
    began, cells = process_time(), case.parts
    side = chebyshev.SIDE
    net = drape.net(chebyshev.SPHERE, side / cells, (0, cells), (0, cells))
    seconds = process_time() - began
    off = np.degrees(net.shear_angle() - chebyshev.shear_angle(net.centres()))
    rms = float(np.sqrt(np.mean(off**2)))
    return {"seconds": seconds, "largest": float(np.abs(off).max()), "rms": rms}


def _published(case: Case) -> Row:
    began = process_time()
    shear, off = published.differences(case.surface, case.parts)
    return {
        "seconds": process_time() - began,
        "cells": " × ".join(map(str, shear.shape)),
        "largest": float(np.abs(off).max()),
        "mean": float(np.abs(off).mean()),
        "largest_shear": float(shear.max()),
    }


def _cells(case: Case) -> int:
    """The user's elements per side, before refinement."""
    large = case.formulation not in ("one point", "2×2 points")
    return case.parts // (2 if large else 1) // 2**case.halvings


def on_sphere(case: Case) -> tuple[Ply, Conditions, Surface, ndarray]:
    """Ply, conditions, surface and initial guess."""
    ply, conditions, start = chebyshev.problem(
        FORMULATIONS[case.formulation],
        _cells(case),
        *(case.stretch, _SHEAR, case.tension, case.bending),
        *(case.distortion, case.halvings),
        triangles="triangles" in case.formulation,
    )
    surface: Surface = chebyshev.SPHERE
    if case.surface == "triangles":
        surface = sphere_of_triangles()
        conditions = conditions | {"sphere": OnSurface(surface)}
    if case.start == FROM_NET:
        side, n = chebyshev.SIDE, case.parts
        net = drape.net(surface, side / n, (0, n), (0, n))
        start = drape.displacement(ply.nodes, net.at(ply.nodes))
    return ply, conditions, surface, start


def _on_developable(case: Case) -> tuple[Ply, Conditions, Surface, ndarray]:
    formulation = FORMULATIONS[case.formulation]
    cells, stiffness = _cells(case), (case.tension, case.stretch, _SHEAR)
    return rolled.problem(case.surface, formulation, cells, case.parts, *stiffness)


def _pressure_error(
    case: Case, ply: Ply, surface: Surface, state: State
) -> float | None:
    """Largest relative error of the mean contact pressure of an element.

    Elements along loaded edges are excluded.  On the sphere the exact pressure follows
    from the computed tensions, (T₁ + T₂)/(R cos Γ).
    """
    if not case.tension:
        return None
    mesh, u = ply.users_mesh, state.u
    pulled = ("right", "top", "left") if case.surface == FAN else ("right", "top")
    edges = np.hstack([mesh.boundaries[name] for name in pulled])
    on_edge = np.isin(mesh.t, mesh.facets[:, edges])
    inner = ~on_edge[:, ply.parent].any(axis=0)
    if case.kind == SPHERE:
        tension = ply.fibre_tension(u, state.parameters).mean(axis=2).sum(axis=0)
        angle = ply.shear_angle(u, ply.centre)[:, 0]
        exact = tension / chebyshev.RADIUS / np.cos(angle)
    else:
        centres = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
        exact = rolled.pressure(case.surface, case.tension, centres)
    arguments = u, state.load_factor, state.parameters
    pressure = drape.contact_pressure(ply, surface, *arguments)[ply.mesh.t].mean(axis=0)
    return float(np.abs(pressure / exact - 1)[inner].max())


def _timed(case: Case) -> Row:
    """The fastest of a few runs: initial guess, set-up and solution."""
    seconds: list[float] = []
    while len(seconds) < _RUNS and sum(seconds) < _ENOUGH:
        run = _run_of(case)
        began = process_time()
        u, solves = run()
        seconds.append(process_time() - began)
    ply, *_ = on_sphere(case)
    largest, rms = chebyshev.error(ply, u)
    return {
        "unknowns": ply.basis.N,
        "solves": solves,
        "seconds": min(seconds),
        "largest": largest,
        "rms": rms,
    }


def _run_of(case: Case) -> Callable[[], tuple[ndarray, int]]:
    """A run with a new ply, without cached data."""
    ply, conditions, surface, _ = on_sphere(case)

    def grown() -> tuple[ndarray, int]:
        result = LoadStepper(ply, conditions, 1, warn_only=_WARN_ONLY).run()
        return result.u, result.linear_solves

    def started() -> tuple[ndarray, int]:
        if case.start == FROM_NET:
            n = case.parts
            x = drape.net(surface, chebyshev.SIDE / n, (0, n), (0, n)).at(ply.nodes)
        else:
            x = drape.exponential_map(surface, ply.nodes)
        start = drape.displacement(ply.nodes, x)
        state = equilibrium_near(ply, conditions, start, warn_only=_WARN_ONLY)
        return state.u, state.linear_solves

    return grown if case.start == GROWTH else started


def all_cases() -> Iterator[Case]:
    """All cases, grouped by table."""
    both = "macro", "one point"
    for name, parts in product(both, (8, 16, 32, 64, 128)):
        yield Case(SPHERE, parts, name)
    for parts in (32, 64, 128):
        yield Case(SPHERE, parts, FLAT)
    for name, parts in product((*both, FLAT), (32, 64, 128)):
        yield Case(SPHERE, parts, name, stretch=1e6)
    for name in both:
        for parts in (16, 32, 64, 128):
            yield Case(SPHERE, parts, name, distortion=0.2)
        for halvings in (1, 2, 3):
            parts = 16 * 2**halvings
            yield Case(SPHERE, parts, name, distortion=0.2, halvings=halvings)
        for stretch in (1e3, 1e4):
            yield Case(SPHERE, 32, name, stretch)
        yield Case(SPHERE, 32, name, start=FROM_NET)
        yield Case(SPHERE, 32, name, surface="triangles")
        for parts, start in product((16, 32), (EXPONENTIAL, FROM_NET)):
            yield Case(SPHERE, parts, name, tension=0.0, start=start)
    for parts, bending in product((16, 32), (5.0, 10.0)):
        yield Case(SPHERE, parts, "macro", tension=0.0, bending=bending)
    for parts in (16, 32):
        yield Case(SPHERE, parts, "macro", tension=0.05)
    for parts in (16, 32, 64):
        yield Case(NET, parts)
    for name in DRAPINGS:
        for parts in (1, 2):
            yield Case(PUBLISHED, parts, surface=name)
    for how, q in (*product((CYLINDER, BIAS, FAN), (0.0, 1.0)), (SQUARES, 0.0)):
        for name, parts in product(both, (16, 32, 64)):
            yield Case(ROLLED, parts, name, tension=q, surface=how)
    timed = *both, "2×2 points", "quadratic triangles", "split triangles"
    starts = EXPONENTIAL, FROM_NET, GROWTH
    for name, start, parts in product(timed, starts, (8, 16, 32, 64)):
        yield Case(TIME, parts, name, start=start)
