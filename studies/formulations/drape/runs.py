"""What is measured of each case."""

from time import process_time

import numpy as np
from numpy import ndarray
from scipy.spatial import ConvexHull

from skfem_textile import OnSurface, Ply, Surface, drape, equilibrium_near
from skfem_textile.solve.conditions import Conditions
from skfem_textile.solve.states import NoEquilibriumError, State

from ...study import Row
from . import chebyshev, published, rolled
from .cases import FORMULATIONS, FROM_NET, NET, PUBLISHED, SPHERE, Case
from .rolled import FAN

_SHEAR = 0.1


def row_of(case: Case) -> Row:
    """The row of a case; one that finds no state says why."""
    if case.kind == NET:
        return _net(case.parts)
    if case.kind == PUBLISHED:
        return _published(case)
    ply, conditions, surface, start = (
        on_sphere(case) if case.kind == SPHERE else _on_developable(case)
    )
    began = process_time()
    try:
        state = equilibrium_near(
            ply, conditions, start, warn_only=("stabilisation", "deviation")
        )
    except NoEquilibriumError as error:
        return {"refused": str(error)}
    seconds = process_time() - began
    found: Row = {
        "unknowns": ply.basis.N,
        "solves": state.linear_solves,
        "seconds": seconds,
        "stable": state.verdict.stable,
        "fibre_strain": state.verdict.max_fibre_strain,
        "at_risk": float(drape.wrinkle_risk(ply, state.u, state.parameters).mean()),
        "pressure_error": _pressure_error(case, ply, surface, state),
    }
    if case.kind == SPHERE:
        return found | _on_net(ply, state)
    return found | _sheared(ply, state, start)


def _on_net(ply: Ply, state: State) -> Row:
    """What is off the Chebyshev net."""
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
    """Shear where there ought to be none, that of the exact positions too."""
    largest, interpolated = (
        float(np.degrees(np.abs(ply.shear_angle(u)).max())) for u in (state.u, exact)
    )
    off = np.linalg.norm(ply.nodal(state.u - exact), axis=0)
    moved = float(off.max())
    return {"largest": largest, "interpolated": interpolated, "moved": moved}


def sphere_of_triangles(vertices: int = 2502) -> drape.TriangleMesh:
    """The sphere of `chebyshev` from triangles between points of a spiral."""
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


def _net(cells: int) -> Row:
    began = process_time()
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
    """The user's elements a side, before they are halved."""
    large = case.formulation not in ("one point", "2×2 points")
    return case.parts // (2 if large else 1) // 2**case.halvings


def on_sphere(case: Case) -> tuple[Ply, Conditions, Surface, ndarray]:
    """Ply, conditions, surface and start."""
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
    cells, given = _cells(case), (case.tension, case.stretch, _SHEAR)
    return rolled.problem(case.surface, formulation, cells, case.parts, *given)


def _pressure_error(
    case: Case, ply: Ply, surface: Surface, state: State
) -> float | None:
    """Largest error of the mean contact pressure of an element, as a share.

    That of elements along edges that are pulled is left out.  On the sphere the exact
    one is that of the tensions found, (T₁ + T₂)/(R cos Γ).
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
    place = u, state.load_factor, state.parameters
    found = drape.contact_pressure(ply, surface, *place)[ply.mesh.t].mean(axis=0)
    return float(np.abs(found / exact - 1)[inner].max())
