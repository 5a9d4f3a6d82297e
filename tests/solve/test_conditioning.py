"""Reactions that depend on the mesh: along stiff fibres, and of compressed fibres."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    Fabric,
    Linear,
    LoadStepper,
    Ply,
    Quadratic,
    TensionOnly,
    mesh_outline,
)
from skfem_textile.outlines import Outline
from skfem_textile.scenes import bias_extension, picture_frame, strip
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.conditioning import buckling_warning
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent

WIDTH, HEIGHT, TRAVEL = 40.0, 60.0, 25.0  # mm

LINEAR = Fabric(1e4, 0.5)
SLACK = Fabric(TensionOnly(Linear(1e4)), 0.5)
BENT = Fabric(1e4, 0.5, bending=(5.0, 5.0))


def on_circle(X, t):
    """Displacement of the upper clamp on the circle of the unstretched weft."""
    fall = HEIGHT * (np.sqrt(1 - (TRAVEL * t / HEIGHT) ** 2) - 1)
    return np.stack([TRAVEL * t + 0 * X[0], fall + 0 * X[0]])


CLAMPS = {"bottom": Condition("bottom"), "top": Condition("top", on_circle)}


def run_of(mesh, fabric, conditions, formulation=None, steps=2):
    ply = Ply(mesh, fabric, *[formulation] if formulation else [])
    return LoadStepper(ply, conditions, steps).run()


@cache
def sheared(fabric, n=4, density=None):
    """Simple shear between clamps, of fibres along the edges."""
    if density is None:
        mesh = rectangle(WIDTH, HEIGHT, (n, n * 3 // 2), "irregular")
        return run_of(mesh, fabric, CLAMPS)
    outline = Outline([[0, WIDTH, WIDTH, 0], [0, 0, HEIGHT, HEIGHT]])
    mesh = mesh_outline(outline, fabric, CLAMPS, density=density)
    return run_of(mesh, fabric, CLAMPS, Quadratic(400, points=6))


@pytest.mark.parametrize(
    ("fabric", "right"),
    [(LINEAR, 7.9), pytest.param(SLACK, 17.9, marks=pytest.mark.slow), (BENT, 7.8)],
    ids=["linear", "slack", "bent"],
)
def test_the_interval_of_a_reaction_along_fibres_contains_that_of_a_fine_net(
    fabric, right
):
    result = sheared(fabric)
    x = result.states[-1].reactions["top"][0]
    half = result.error.reactions["top"][0]
    assert abs(x - right) < half
    assert bool(result.error.warnings) == (not fabric.bends)
    assert not fabric.bends or half < 0.1 * x


@pytest.mark.parametrize(
    ("fabric", "right"), [(LINEAR, 8.50), (BENT, 8.57)], ids=["linear", "bent"]
)
def test_the_interval_of_the_load_contains_that_of_a_fine_mesh(fabric, right):
    """Fibres along free sides, and bent ones, leave one of the two errors."""
    result = sheared(fabric)
    n = np.array([np.cos(np.arcsin(TRAVEL / HEIGHT)), -TRAVEL / HEIGHT])
    load = n @ result.states[-1].reactions["top"]
    error = abs(right / load - 1)
    assert 0.4 * result.error.load < error < result.error.load


def test_warnings_name_the_edges_the_fibres_and_the_direction_to_use():
    result = sheared(LINEAR)
    warnings = result.summary()["warnings"]
    assert [x.split("'")[1] for x in warnings] == ["bottom", "top"]
    assert all("along nearly inextensible fibres" in x for x in warnings)
    assert "along the motion, (0.909, -0.416), or give" in warnings[1]
    n = np.array([0.909, -0.416])
    along = [
        n @ r.states[-1].reactions["top"]
        for r in (result, sheared(LINEAR, density=0.5))
    ]
    assert along[0] == pytest.approx(along[1], rel=0.02)


def test_the_stiffness_in_the_warning_is_that_of_a_shifted_clamp():
    """A difference of two equilibria with the clamp shifted along the fibres."""
    result, h = sheared(LINEAR), 1e-6
    state, ply = result.states[-1], result.ply
    problem = Problem(ply, Constraints(ply.basis, CLAMPS), solver_named("superlu"))
    problem = problem.at(1.0)
    n = np.array([0.416, 0.909])

    def force(distance):
        u = state.u.copy()
        top = problem.constraints.nodes["top"]
        problem.nodal(u)[:, top] += distance * n[:, None]
        for _ in range(3):
            f = problem.residual(u, state.parameters)
            u = u + Tangent.at(problem, u, state.parameters).equilibrated(f)[0]
        f = problem.residual(u, state.parameters)
        return n @ problem.reactions(f, u)["top"]

    stiffness = (force(h) - force(-h)) / (2 * h)
    warning = result.error.warnings[1]
    found = float(warning.split("change it by ")[1].split(" N")[0])
    assert found == pytest.approx(0.01 * stiffness, rel=0.01)
    half = result.error.reactions["top"]
    assert half / half[1] == pytest.approx(n / n[1], rel=0.01)


@cache
def inclined(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    fabric = Fabric(1e4, 0.5, (c, s), (-s, c))
    conditions = {"bottom": Condition("bottom"), "top": Condition("top", (6.0, -0.3))}
    mesh = rectangle(WIDTH, HEIGHT, (2, 3), "irregular")
    return run_of(mesh, fabric, conditions, steps=1)


@pytest.mark.parametrize("degrees", [30, -20])
def test_fibres_compressed_beyond_the_shear_stiffness_are_a_warning(degrees):
    (warning,) = [x for x in inclined(degrees).warnings if "compressed" in x]
    assert "below -G, -0.5 N/mm" in warning
    assert "bending stiffness" in warning
    assert inclined(degrees).error.load is None
    assert "buckle" in inclined(degrees).error.reason


def test_bending_stiffness_must_be_resolved_by_the_elements():
    """Its layers are √(5/(0.5 + |T|)) < 3 mm wide; elements have 20 mm."""
    result = inclined(30)
    fabric = replace(result.ply.fabric, bending=(5.0, 5.0))
    ply, state = Ply(result.ply.mesh, fabric), result.states[-1]
    assert buckling_warning(ply, state) == ""
    bent = replace(state, energies={"tension": 3.0, "bending": 1.0})
    assert buckling_warning(ply, bent).startswith("25 % of the energy are in bending")
    fabric = replace(fabric, bending=(1e6, 1e6))
    assert buckling_warning(Ply(result.ply.mesh, fabric), bent) == ""


@pytest.mark.parametrize(
    ("scene", "kind"),
    [(strip, "irregular"), (bias_extension, "delaunay"), (picture_frame, "irregular")],
)
def test_tests_whose_load_converges_have_no_such_warning(scene, kind):
    scene = scene(kind, (4, 6))
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    result = run_of(scene.mesh, fabric, scene.conditions)
    error = result.error
    assert error.reactions
    assert error.warnings == []
    assert buckling_warning(result.ply, result.states[-1]) == ""


def test_a_pull_along_fibres_has_no_such_warning():
    mesh = rectangle(50, 100, (4, 8), "irregular")
    conditions = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 0.1))}
    result = run_of(mesh, LINEAR, conditions, steps=1)
    assert result.warnings == []
