"""What is measured of each case."""

from collections.abc import Callable
from time import process_time

import numpy as np
from numpy import ndarray
from scipy.spatial import ConvexHull
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    OnSurface,
    Ply,
    Surface,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.solve.conditions import Conditions
from skfem_textile.solve.states import NoEquilibriumError, State

from ...study import Row
from . import chebyshev, published
from .cases import FORMULATIONS, FROM_NET, NET, PUBLISHED, SPHERE, Case

_SHEAR = 0.1

#: Radius of the cylinder in mm, half angle of the cone in radians, and how far from its
#: tip the ply begins, in mm.
RADIUS, CONE_ANGLE, FROM_TIP = 60.0, 0.4, 150.0


def row_of(case: Case) -> Row:
    """The row of a case; one that finds no state says why."""
    if case.kind == NET:
        return _net(case.parts)
    if case.kind == PUBLISHED:
        return _published(case)
    ply, conditions, surface, start = (
        on_sphere(case) if case.kind == SPHERE else _rolled(case)
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
        "at_risk": float(drape.wrinkle_risk(ply, state.u).mean()),
        "pressure_error": _pressure_error(case, ply, surface, state.u),
    }
    if case.kind == SPHERE:
        return found | _on_net(ply, state)
    return found | _sheared(ply, state, start)


def _on_net(ply: Ply, state: State) -> Row:
    """What is off the Chebyshev net."""
    off = chebyshev.errors(ply, state.u)
    corner = ply.mesh.p[:, ply.mesh.t].mean(axis=1).sum(axis=0).argmax()
    tension = ply.fibre_tension(state.u)
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


def _rolled(case: Case) -> tuple[Ply, Conditions, Surface, ndarray]:
    """A ply on a cylinder or a cone, pulled on all sides by the same tension, or none.

    A side of it lies in a plane of symmetry along the cone, two sides on the cylinder.
    """
    s = np.linspace(0, chebyshev.SIDE, _cells(case) + 1)
    mesh = MeshQuad.init_tensor(s, s).with_defaults()
    c, a = (np.sqrt(0.5), np.sqrt(0.5)) if "45" in case.surface else (1.0, 0.0)
    surface: Surface
    if case.surface.startswith("cone"):
        tip = np.array([-FROM_TIP, 0.0, 0.0])
        axis = np.array([np.cos(CONE_ANGLE), 0.0, -np.sin(CONE_ANGLE)])
        surface, rolled = drape.Cone(CONE_ANGLE, tip, axis), _on_cone
    else:
        surface, rolled = drape.Cylinder(RADIUS, (0, 0, -RADIUS)), _on_cylinder

    def along(i: int, sign: float) -> Callable:
        return lambda X: sign * case.tension * rolled(X)[1][i]

    loads = [Traction("right", along(0, 1.0)), Traction("top", along(1, 1.0))]
    if rolled is _on_cone:
        loads.append(Traction("left", along(0, -1.0)))
        held = Condition(lambda X: np.hypot(*X) < 1e-9)
    else:
        held = Condition("left", (0.0, None, None))
    loads = loads if case.tension else []
    fabric = Fabric(case.stretch, _SHEAR, warp=(c, a), weft=(-a, c))
    ply = Ply(mesh, fabric, FORMULATIONS[case.formulation], loads, dimension=3)
    conditions: Conditions = {
        "on": OnSurface(surface),
        "held": held,
        "y": Condition("bottom", (None, 0.0, None)),
    }
    start, _ = rolled(ply.nodes)
    return ply, conditions, surface, drape.displacement(ply.nodes, start)


def _on_cylinder(X: ndarray) -> tuple[ndarray, ndarray]:
    """Positions of points of the flat ply, and the directions of its x and y."""
    angle, zero = X[0] / RADIUS, np.zeros_like(X[0])
    c, s = np.cos(angle), np.sin(angle)
    place = np.array([RADIUS * s, X[1], RADIUS * (c - 1)])
    return place, np.array([[c, zero, -s], [zero, zero + 1, zero]])


def _on_cone(X: ndarray) -> tuple[ndarray, ndarray]:
    """The same on the cone, which touches the plane of the ply along the x axis."""
    r, polar = np.hypot(X[0] + FROM_TIP, X[1]), np.arctan2(X[1], X[0] + FROM_TIP)
    c, s = np.cos(CONE_ANGLE), np.sin(CONE_ANGLE)
    angle, zero = polar / s, np.zeros_like(polar)
    cosine, sine = np.cos(angle), np.sin(angle)
    along = np.array([c * c + s * s * cosine, s * sine, -c * s + s * c * cosine])
    around = np.array([-s * sine, cosine, -c * sine])
    place = r * along + np.array([zero - FROM_TIP, zero, zero])
    first = np.cos(polar) * along - np.sin(polar) * around
    second = np.sin(polar) * along + np.cos(polar) * around
    return place, np.array([first, second])


def _pressure_error(case: Case, ply: Ply, surface: Surface, u: ndarray) -> float | None:
    """Largest relative error of the contact pressure but along the free edges.

    On the sphere it is that of the tensions found, (T₁ + T₂)/(R cos Γ); on cylinder and
    cone that of the tension q on all sides, q (κ₁ + κ₂).
    """
    if not case.tension:
        return None
    corners = ply.mesh.p[:, ply.mesh.t]
    centres = corners.mean(axis=1)
    off_edges = corners < chebyshev.SIDE
    if case.surface.startswith("cone"):  # whose left edge is free too
        off_edges[0] &= corners[0] > 0
    on_edge = ply.on_users_elements(~off_edges.all(axis=(0, 1)))
    inner = on_edge[ply.parent] == 0
    if case.kind == SPHERE:
        tension = ply.fibre_tension(u).mean(axis=2).sum(axis=0)
        angle = ply.shear_angle(u, ply.centre)[:, 0]
        exact = tension / chebyshev.RADIUS / np.cos(angle)
    else:
        radius = np.full(centres.shape[1], RADIUS)
        if case.surface.startswith("cone"):
            from_tip = np.hypot(centres[0] + FROM_TIP, centres[1])
            radius = from_tip * np.tan(CONE_ANGLE)
        exact = case.tension / radius
    found = drape.contact_pressure(ply, surface, u)[ply.mesh.t].mean(axis=0)
    return float(np.abs(found / exact - 1)[inner].max())
