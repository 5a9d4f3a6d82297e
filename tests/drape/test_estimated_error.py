"""Error estimates of plies on surfaces, and adaptive refinement."""

import numpy as np
import pytest

from skfem_textile import (
    AdaptiveStepper,
    Fabric,
    Macro,
    OnePoint,
    drape,
    equilibrium_near,
)
from skfem_textile.scenes import Case, hemisphere
from skfem_textile.scenes import drape as on_tool
from skfem_textile.solve import error_estimate
from skfem_textile.solve.error_estimate import estimated_error, problem_at
from skfem_textile.solve.states import NoEquilibriumError
from studies.formulations.drape import chebyshev
from tests.helpers import graph
from tests.helpers.tools import positions


def skew_bump():
    def height(x, y):
        a, b = x - 15, y - 20
        return 20 * np.exp(-(a**2 + 2 * b**2 + 0.7 * x * y) / 2500) - 0.001 * x**2

    return drape.TriangleMesh(*graph(np.linspace(-100, 100, 29), height))


def constant_angle_error(ply, u):
    """Root-mean-square error in radians of the element-wise constant angle."""
    xi = (np.indices((8, 8)).reshape(2, -1) + 0.5) / 8
    exact = chebyshev.shear_angle(ply.basis.mapping.F(xi))
    error = ply.shear_angle(u).mean(axis=1)[:, None] - exact
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_the_error_is_estimated_on_a_surface(formulation):
    cells = 8
    ply, conditions, start = chebyshev.problem(formulation, cells)
    state = equilibrium_near(ply, conditions, start)
    estimate = estimated_error(
        problem_at(ply, conditions, "superlu", 1.0), conditions, "superlu", state
    )
    error = constant_angle_error(ply, state.u)
    assert 0.8 * error < estimate.shear_angle < 1.6 * error
    assert estimate.load < 0.1


def test_the_estimate_uses_a_finer_ply_on_the_surface():
    ply, conditions, start = chebyshev.problem(OnePoint(), 4)
    state = equilibrium_near(ply, conditions, start, warn_only=["stabilisation"])
    finer = ply.finer()
    fine = problem_at(finer.ply, conditions, "superlu", 1.0)
    carried = finer.carry(state.u, state.parameters)
    assert not fine.surfaces.are_on(carried[0], 1.0)
    trial = error_estimate._Trial(fine, *carried)
    u, _ = error_estimate._update(trial, np.zeros(2), loaded=True)
    assert fine.surfaces.are_on(u, 1.0)


@pytest.mark.parametrize(
    ("shortened", "reason"),
    [(False, "not positive definite"), (True, "leaves the domain of a law")],
)
def test_a_run_without_load_explains_its_lack_of_estimate(
    shortened, reason, monkeypatch
):
    ply, conditions, start = chebyshev.problem(OnePoint(), 4)
    state = equilibrium_near(ply, conditions, start, warn_only=["stabilisation"])
    finer = ply.finer()
    fine = problem_at(finer.ply, conditions, "superlu", 1.0)
    made, find = [], error_estimate.definite

    def altered(*arguments):
        tangent = find(*arguments)
        tangent.projected = not shortened
        return tangent

    def within(problem, u, du, parameters):
        made.append(du)
        return du / 2 if shortened else du

    monkeypatch.setattr(error_estimate, "definite", altered)
    monkeypatch.setattr(error_estimate, "within_laws", within)
    trial = error_estimate._Trial(fine, *finer.carry(state.u, state.parameters))
    with pytest.raises(NoEquilibriumError, match=reason):
        error_estimate._update(trial, np.zeros(2), loaded=False)
    assert len(made) == 1


def test_a_run_to_a_tolerance_refines_on_a_surface():
    ply, conditions, _ = chebyshev.problem(Macro(), 4)
    result = AdaptiveStepper(
        ply, conditions, 0.06, steps=2, warn_only=["stabilisation", "deviation"]
    ).run()
    assert result.tolerance_met
    assert len(result.rounds) > 3
    assert result.ply.basis.N > ply.basis.N
    x = positions(result.ply, result.u)
    np.testing.assert_allclose(chebyshev.SPHERE.level(x), 0.0, atol=1e-8)


@pytest.mark.parametrize("fibres", [0, 30, 45])
def test_a_ply_without_loads_has_an_error_of_the_shear_angle(fibres):
    """At every fibre angle, with symmetry planes or a constraint at the middle."""
    scene = hemisphere(fibres=np.radians(fibres), tension=0.0, size=(4, 4))
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    summary = Case(scene=scene, fabric=fabric, steps=1).run().summary()
    assert summary["estimated_load_error"] is None
    assert 0.1 < summary["estimated_shear_angle_error_deg"] < 20
    message = "by a finer mesh; none for the load: no moving condition carries a load"
    assert summary["error_estimate"] == message


def test_forces_at_constrained_nodes_are_not_reported(caplog):
    """They depend on the tool; a point force affects the elements around it only."""
    size = {"size": (6, 6), "width": 150.0, "height": 150.0}
    scene = on_tool(skew_bump(), fibres=0.5, **size)
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft)
    result = Case(scene=scene, fabric=fabric, steps=1).run()
    assert result.states[-1].shares["turn_left_reaction"]["deviation"] > 0.25
    assert "turn_left" not in caplog.text
    assert "turn_right" not in caplog.text


def test_forces_at_constrained_nodes_are_not_a_load():
    """They depend on the tool, and do not vanish on a tool without symmetry."""
    scene = on_tool(skew_bump(), tension=0.0, size=(4, 4), width=150.0, height=150.0)
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    result = Case(scene=scene, fabric=fabric, steps=1).run()
    state = result.states[-1]
    held = max(
        np.abs(state.reactions[name]).max() for name in ("middle_x", "turn_left")
    )
    assert held > 1e3 * state.tolerance
    assert result.estimated_error.load is None
    assert result.estimated_error.shear_angle > 0
