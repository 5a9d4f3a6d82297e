"""Plies in space whose answer is known: zero modes, twist, a hanging sheet."""

import numpy as np
import pytest
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Traction,
)
from tests.helpers import values_at_rest, zero_modes


def test_zero_modes_of_a_free_flat_patch():
    """As counted by another program, of 75 unknowns."""
    lines = np.linspace(0, 10, 5)
    mesh = MeshQuad.init_tensor(lines, lines)
    for formulation in (OnePoint(), OnePoint(3.0)):
        ply = Ply(mesh, Fabric(1e3, 1.0), formulation, dimension=3)
        u = ply.basis.zeros()
        lifting = ply.terms[-1]
        assert lifting.name == "out_of_plane"
        assert zero_modes(ply.tangent(u)) == 12
        p = values_at_rest(lifting)
        assert zero_modes(ply.tangent(u) - lifting.tangent(u, 1.0, p)) == 28
    halves = MeshQuad.init_tensor(lines[::2], lines[::2])
    macro = Ply(halves, Fabric(1e3, 1.0), Macro(), dimension=3)
    assert zero_modes(macro.tangent(macro.basis.zeros())) == 12


def test_an_element_resists_twist_and_no_other_motion_across_it():
    """½ C_s Σ A/4 ‖∇w(ξ_k)‖², of w = xy on a square of side 2: 4 C_s/3."""
    mesh = MeshQuad.init_tensor(np.array([-1.0, 1.0]), np.array([-1.0, 1.0]))
    ply = Ply(mesh, Fabric(10.0, 1.0), OnePoint(3.0), dimension=3)
    x, y = ply.nodes
    for motion, energy in ((x * y, 3.0 * 4 / 3), (x, 0.0), (1 + y, 0.0)):
        u = ply.basis.zeros()
        u[2::3] = 1e-3 * motion
        found = ply.energies(u)["out_of_plane"]
        assert found == pytest.approx(1e-6 * energy, rel=1e-4, abs=1e-16)


def test_fibres_that_close_up_are_met_in_the_plane_alone():
    """Where they cross at 30 degrees the grip is 1 − cos 30° = 0.134."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 10, 3), np.linspace(0, 10, 3))
    angle, grip = np.radians(60), 1 - np.cos(np.radians(30))
    tension = 1e3 * np.log(1.01) / 2 / (1 + 80 * np.sqrt(1e-3))
    for formulation, added in ((OnePoint(), 0.0), (Macro(), 3.2 * tension)):
        ply = Ply(mesh, Fabric(1e3, 1.0), formulation, dimension=3)
        x, y = ply.nodes
        u = ply.basis.zeros()
        u[0::3] = 0.01 * x + np.sin(angle) * y
        u[1::3] = (np.cos(angle) - 1) * y
        updated = ply.updated(ply.parameters_at_rest, u)
        within, across = (
            updated[name]["C_s"] for name in ("stabilisation", "out_of_plane")
        )
        np.testing.assert_allclose(across, 4.0 + added, rtol=1e-9)
        np.testing.assert_allclose(within, (4.0 + added) / grip**1.5, rtol=1e-9)


def catenary(n):
    """Relative errors of sag and horizontal force of a hanging sheet."""
    length, span, weight = 100.0, 80.0, 1e-3
    lines = np.linspace(0, length, n + 1)
    mesh = MeshQuad.init_tensor(lines, lines[::2] / 2).with_defaults()
    load = BodyForce((0.0, 0.0, -weight), factor=1.0)
    ply = Ply(mesh, Fabric(1e4, 0.1), OnePoint(), [load], dimension=3)
    conditions = {
        "left": Condition("left"),
        "right": Condition("right", (span - length, 0.0, 0.0)),
    }
    result = LoadStepper(ply, conditions, 4, solver="superlu").run()
    c = brentq(lambda c: 2 * c * np.sinh(span / 2 / c) - length, 10, 1e3)
    sag = c * (np.cosh(span / 2 / c) - 1)
    width = ply.nodes[1].max()
    x, y, z = result.states[-1].reactions["right"]
    assert z == pytest.approx(weight * length * width / 2, rel=1e-9)
    assert y == pytest.approx(0.0, abs=1e-9)
    row = result.history()[-1]
    assert row["right_reaction_z"] == z
    assert row["right_displacement_x"] == pytest.approx(span - length)
    lowest = ply.nodal(result.u)[2].min()
    return np.array([-lowest / sag, x / (weight * c * width)]) - 1


def test_a_hanging_sheet_is_a_catenary_to_second_order():
    """Found from the flat sheet, which has no stiffness across it."""
    coarse, fine = catenary(8), catenary(16)
    assert (np.abs(fine) < [2.5e-3, 1.2e-3]).all()
    assert (np.abs(coarse / fine) > 3.5).all()


def test_a_traction_across_a_taut_ply_is_carried_by_its_tension():
    """T₀ w″ = 0 with T₀ w′ = p at the pulled edge: w = p x / T₀."""
    lines = np.linspace(0, 10, 5)
    mesh = MeshQuad.init_tensor(lines, lines).with_defaults()
    loads = [Traction("right", (5.0, 0.0, 0.01))]
    ply = Ply(mesh, Fabric(1e4, 0.1), Full(), loads, dimension=3)
    result = LoadStepper(ply, {"left": Condition("left")}, 1).run()
    w = ply.nodal(result.u)[2]
    np.testing.assert_allclose(w, 0.01 / 5.0 * ply.nodes[0], rtol=2e-3)
