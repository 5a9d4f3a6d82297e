"""Errors of the shear angle of plies on surfaces."""

import numpy as np
import pytest

from skfem_textile import LoadStepper, Macro, OnePoint, drape, equilibrium_near
from skfem_textile.scenes import double_dome, hemisphere
from skfem_textile.scenes import drape as on_tool
from skfem_textile.solve import newton
from tests.helpers import graph
from tests.helpers.tools import case_of, chebyshev, exact_shear_angle

pytestmark = pytest.mark.usefixtures("coarse_net")


def skew_bump():
    def height(x, y):
        a, b = x - 15, y - 20
        return 20 * np.exp(-(a**2 + 2 * b**2 + 0.7 * x * y) / 2500) - 0.001 * x**2

    return drape.TriangleMesh(*graph(np.linspace(-100, 100, 15), height))


def constant_angle_error(ply, u):
    """Root-mean-square error in radians of the element-wise constant angle."""
    xi = (np.indices((8, 8)).reshape(2, -1) + 0.5) / 8
    exact = exact_shear_angle(ply.basis.mapping.F(xi))
    error = ply.shear_angle(u).mean(axis=1)[:, None] - exact
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize(
    ("formulation", "cells"), [(Macro(), 4), (OnePoint(), 4), (OnePoint(), 8)], ids=repr
)
def test_the_error_of_the_shear_angle_is_estimated_on_a_sphere(formulation, cells):
    ply, conditions, start = chebyshev(formulation, cells)
    warn = ["stabilisation", "deviation"]
    state = equilibrium_near(ply, conditions, start, warn_only=warn)
    estimate = LoadStepper(ply, conditions, 1).interval("superlu", state)
    error = constant_angle_error(ply, state.u)
    assert 0.8 * error < estimate.shear_angle < 4 * error
    assert 0 < estimate.load < 0.06


@pytest.mark.parametrize("fibres", [30, 45])
def test_a_ply_without_loads_has_an_error_of_the_shear_angle(fibres):
    """At every fibre angle, with symmetry planes or a constraint at the middle."""
    scene = hemisphere(fibres=np.radians(fibres), tension=0.0, size=(3, 3))
    result = case_of(scene, 5.0).run()
    summary = result.summary()
    assert summary["load_half_width"] is None
    assert 0.1 < summary["shear_angle_error_deg"] < 20
    assert summary["error_interval"] == (
        "by the numerical stiffness and the contact between nodes; none for the load: "
        "no moving condition carries a load"
    )
    assert 0 < summary["recovered_max_shear_angle_deg_half_width"] < 5


@pytest.mark.parametrize("scene", [hemisphere, double_dome])
def test_the_interval_of_a_load_on_a_surface_contains_that_of_a_finer_mesh(scene):
    """The work of the edge tension; its error and interval decrease as h²."""
    found = []
    for n in (3, 6, 9):
        result = case_of(scene("aligned", size=(n, n)), 5.0).run()
        state = result.states[-1]
        load = result.ply.load(state.u, 1.0, state.parameters)
        found.append((float(load @ state.u), result.error.load))
    (coarse, half), (medium, of_medium), (fine, _) = found
    assert abs(coarse - fine) < half * abs(coarse) < 8 * abs(coarse - fine)
    assert abs(medium - fine) < of_medium * abs(medium)
    assert of_medium < 0.4 * half


def test_forces_at_constrained_nodes_are_not_reported(caplog, monkeypatch):
    """A point force, here of tractions without balance, affects few elements only."""
    monkeypatch.setattr(newton, "_IN_BALANCE", np.inf)
    size = {"size": (4, 4), "width": 150.0, "height": 150.0}
    scene = on_tool(skew_bump(), fibres=0.5, **size)
    result = case_of(scene).run()
    assert result.states[-1].shares["turn_left_reaction"]["deviation"] > 0.25
    assert "turn_left" not in caplog.text
    assert "turn_right" not in caplog.text


def test_forces_at_constrained_nodes_are_not_a_load():
    """They depend on the tool, and do not vanish on a tool without symmetry."""
    scene = on_tool(skew_bump(), tension=0.0, size=(3, 3), width=150.0, height=150.0)
    result = case_of(scene, 5.0).run()
    state = result.states[-1]
    held = max(
        np.abs(state.reactions[name]).max() for name in ("middle_x", "turn_left")
    )
    assert held > 1e3 * state.tolerance
    assert result.error.load is None
    assert result.error.shear_angle > 0
