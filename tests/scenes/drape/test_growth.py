"""Surfaces that develop out of the plane of a ply."""

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Locking,
    Macro,
    Newton,
    OnePoint,
    OnSurface,
    StepError,
    drape,
    equilibrium_near,
)
from skfem_textile.scenes import double_dome
from skfem_textile.solve import problem as tangent_module
from skfem_textile.solve import search
from skfem_textile.solve.continuation import surface_predictor
from skfem_textile.solve.problem import Tangent
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers.tools import (
    SYMMETRY,
    case_of,
    chebyshev,
    geodesic_u,
    problem_of,
    square,
)


def test_a_ply_grows_with_the_surface():
    sphere = drape.Sphere(100.0, (0, 0, -100))
    c = np.sqrt(0.5)
    ply = square(100.0, 4, Fabric(1e5, 0.1, warp=(c, c), weft=(-c, c)))
    conditions = {"on": OnSurface(sphere)} | SYMMETRY
    result = LoadStepper(ply, conditions, 2).run()
    assert result.converged
    for state, radius in zip(result.states, (np.inf, 200.0, 100.0), strict=True):
        x = ply.positions(state.u)
        sagitta = x[2] + (x**2).sum(axis=0) / (2 * radius)
        np.testing.assert_allclose(sagitta, 0.0, atol=1e-8)
    assert "no moving condition" in result.summary()["error_interval"]


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_the_chebyshev_net_needs_one_step_of_a_few_solves(formulation):
    ply, conditions, start = chebyshev(formulation, 4)
    result = LoadStepper(ply, conditions, 1).run()
    assert len(result.states) == 2
    assert result.linear_solves <= 8
    along = equilibrium_near(ply, conditions, start, warn_only=["stabilisation"])
    np.testing.assert_allclose(result.u, along.u, atol=1e-3)


@pytest.mark.usefixtures("coarse_net", "no_interval")
@pytest.mark.parametrize(("fibres", "stretch"), [(0, 1e5), (45, 1e4)])
def test_a_double_dome_needs_one_step_of_a_few_solves(fibres, stretch):
    scene = double_dome(size=(5, 3), fibres=float(np.radians(fibres)))
    result = case_of(scene, stretch=stretch).run()
    assert result.converged
    assert len(result.states) == 2
    assert result.linear_solves <= 12  # 44 if each step starts from the previous one


def problem_and_start(ply, surface, **which):
    """The problem at the end of growth, and the ply at rest."""
    conditions = {"on": OnSurface(surface, **which)} | SYMMETRY
    problem = problem_of(ply, conditions)
    at_rest = ply.basis.zeros(), ply.parameters_at_rest
    return problem.at(1.0), problem.evaluation(*at_rest)


def test_the_initial_guess_on_a_grown_cylinder_is_the_rolled_ply():
    """From any earlier state, because a cylinder unrolls without strain."""
    ply = square(60.0, 4, Fabric(1e4, 0.1))
    cylinder = drape.Cylinder(40.0, (0, 0, -40))
    problem, rest = problem_and_start(ply, cylinder)
    u = surface_predictor(problem.at(0.5), rest).u
    half = problem.at(0.5).evaluation(u, rest.parameters)
    exact = geodesic_u(ply, cylinder)
    assert np.abs(half.u - exact).max() > 1.0
    for start in (rest, half):
        error = np.abs(surface_predictor(problem, start).u - exact).max()
        assert error < 1e-3 * 40  # as a share of the radius


@pytest.mark.parametrize(
    ("surface", "fabric", "which"),
    [
        (drape.Sphere(10.0, (0, 0, -10)), Fabric(1e4, 0.1), {}),
        (
            drape.Sphere(50.0, (0, 0, -50)),
            Fabric(1e4, Locking(0.1, 0.2)),
            {},
        ),
        (
            drape.Sphere(100.0, (0, 0, -100)),
            Fabric(1e4, 0.1),
            {"where": lambda X: X[0] < 40},
        ),
    ],
    ids=["folded", "past a law", "some nodes"],
)
def test_the_previous_state_is_the_guess_without_geodesics(surface, fabric, which):
    ply = square(60.0, 4, fabric)
    problem, rest = problem_and_start(ply, surface, **which)
    assert surface_predictor(problem, rest) is rest


FAR = 1e4


def far_ply():
    """A quarter ply that touches its sphere far from the origin."""
    ply = square(60.0, 2, Fabric(1e5, 0.1), Macro(), corner=(FAR, -FAR))
    sphere = drape.Sphere(100.0, (FAR, -FAR, -100.0))
    return ply, {"on": OnSurface(sphere, touch=(FAR, -FAR))} | SYMMETRY


def test_the_residual_far_from_the_origin_is_limited_by_rounding_of_positions():
    near = square(60.0, 2, Fabric(1e5, 0.1), Macro())
    sphere = drape.Sphere(100.0, (0, 0, -100.0))
    result = LoadStepper(near, {"on": OnSurface(sphere)} | SYMMETRY, 1).run()
    ply, conditions = far_ply()
    far = LoadStepper(ply, conditions, 1).run()
    np.testing.assert_allclose(far.u, result.u, atol=1e-6)


def test_the_residual_without_surfaces_is_limited_by_rounding_of_displacements():
    """The distance from the origin has no effect."""
    residuals = []
    for corner in (0.0, FAR):
        ply = square(60.0, 4, Fabric(1e5, 0.1), corner=(corner, corner))
        problem = problem_of(ply, {"flat": Condition("left")})
        u = ply.basis.zeros()
        p, pulled = ply.parameters_at_rest, np.ones_like(ply.fibre_tension(u))
        tangent = Tangent.at(problem, u, p, pulled)
        residuals.append(tangent.tolerance(u, problem.residual(u, p), p))
    assert residuals[1] == pytest.approx(residuals[0], rel=1e-6)


def test_a_failure_due_to_rounding_is_reported_as_such(monkeypatch):
    monkeypatch.setattr(tangent_module, "ROUNDINGS", 0.01)
    ply, conditions = far_ply()
    start = geodesic_u(ply, conditions["on"].surface, touch=(FAR, -FAR))
    with pytest.raises(NoEquilibriumError, match="the residual is") as error:
        equilibrium_near(ply, conditions, start, method=Newton(most=2))
    assert "closer to the origin" in error.value.advice


def test_a_failure_at_rest_is_attributed_to_rounding(monkeypatch):
    """The initial plane of the ply deviates slightly from a surface from a file."""
    monkeypatch.setattr(tangent_module, "ROUNDINGS", 0.01)
    ply, conditions = far_ply()
    plane = drape.Plane((FAR, -FAR, 0.0), (5e-5, 0.0, 1.0))
    tilted = conditions | {"on": OnSurface(plane, touch=(FAR, -FAR))}
    monkeypatch.setattr(search, "_SHORTEST_AT_REST", (0.5, 0.5))
    stepper = LoadStepper(ply, tilted, 1, method=Newton(most=1))
    stepper.max_halvings = 0
    with pytest.raises(StepError, match="closer to the origin"):
        stepper.run()


@pytest.mark.usefixtures("coarse_net", "no_interval")
@pytest.mark.parametrize("tension", [0.0, 2.0])
def test_a_rotation_by_half_a_turn_leaves_a_draped_ply_unchanged(tension):
    """The double dome has equal constraint forces on both sides of its middle."""
    kwargs = {"width": 160.0, "height": 110.0, "size": (4, 4), "part": "whole"}
    scene = double_dome(fibres=np.radians(30), tension=tension, **kwargs)
    result = case_of(scene, 5.0).run()
    ply, angle = result.ply, result.ply.shear_angle(result.u).mean(axis=1)
    centre = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    across = np.linalg.norm(centre[:, :, None] + centre[:, None], axis=0).argmin(axis=0)
    assert np.degrees(np.abs(angle).max()) > 0.5
    assert np.degrees(np.abs(angle - angle[across]).max()) < 1e-8
