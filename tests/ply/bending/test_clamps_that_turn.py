"""Strips between clamps that turn: circles."""

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
)
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import wobble
from tests.helpers.bent_plies import SIDE, D, every_formulation, square


def arc(n, formulation, jitter, slope):
    """A strip whose clamps turn by ± slope: its last state over the circle."""
    halves = 2 if isinstance(formulation, Macro) else 1
    size = n // halves, 2 // halves
    mesh = rectangle(SIDE, 20.0, size, "irregular", jitter, 1)
    ends = {
        "left": lambda t: (0.0, -t * slope, 0.0),
        "right": lambda t: (0.0, t * slope, 0.0),
    }
    fabric = Fabric(1e4, 0.1, bending=(D, D))
    ply = Ply(mesh, fabric, formulation, dimension=3, fibre_ends=ends)
    held = {"left": Condition("left"), "right": Condition("right", (None, 0.0, 0.0))}
    result = LoadStepper(ply, held, 4, solver="superlu").run()
    assert result.path_resolved
    state = result.states[-1]
    x, _, z = ply.nodal(state.u)
    tip = x[ply.nodes[0] > SIDE - 1e-9].mean() / SIDE
    exact = 0.5 * D * (2 * slope / SIDE) ** 2 * SIDE * 20.0
    return np.array(
        [
            state.energies["bending"] / exact - 1,
            tip - (np.sin(slope) / slope - 1),
            z.max() / SIDE - (1 - np.cos(slope)) / (2 * slope),
        ]
    )


@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize("slope", [0.1, 0.5 * np.pi, 2.5])
@pytest.mark.parametrize(
    ("formulation", "off"),
    [(OnePoint(), 3e-3), (Macro(), 3e-3), (Quadratic(), 6e-3)],
    ids=["one point", "macro", "quadratic"],
)
def test_clamps_that_turn_bend_a_strip_to_a_circle(formulation, off, slope, jitter):
    """Moment 2 D φ/L: energy, end and height."""
    coarse, fine = (arc(n, formulation, jitter, slope) for n in (16, 32))
    assert np.abs(fine).max() < off
    assert np.abs(coarse).max() > 2 * np.abs(fine).max()


@every_formulation
def test_forces_of_clamps_that_turn_are_the_slope_of_the_energy(formulation):
    """In the plane, where the fibres along an edge do not end."""
    fabric = Fabric(50.0, 0.5, bending=(3.0, 1.0), twist=0.5)
    ends = {"left": "clamped", "right": lambda t: 0.5 * t, "top": "mirror"}
    mesh = square(4, 0.2, 10.0)
    ply = Ply(mesh, fabric, formulation, fibre_ends=ends)
    u, du = wobble(ply, 3, 0.1), wobble(ply, 4, 1e-4)
    for t in (0.0, 0.7):
        rise = ply.energies(u + du, t)["bending"] - ply.energies(u - du, t)["bending"]
        assert rise == pytest.approx(2 * ply.residuals(u, t)["bending"] @ du, rel=1e-8)
    assert ply.energies(u, 0.7)["bending"] != ply.energies(u, 0.0)["bending"]
    turned = Ply(mesh, fabric, formulation, fibre_ends=ends | {"right": lambda t: 0.0})
    plain = Ply(mesh, fabric, formulation, fibre_ends=ends | {"right": "clamped"})
    energies = (one.energies(u, 1.0)["bending"] for one in (turned, plain))
    assert next(energies) == pytest.approx(next(energies), rel=1e-12)


def test_a_strip_bent_in_its_plane_between_clamps_that_turn_has_the_energy_of_an_arc():
    def off(n, formulation):
        mesh = rectangle(SIDE, 20.0, (n, 4), "irregular", 0.0, 1)
        ends = {"left": lambda t: -0.5 * t, "right": lambda t: 0.5 * t}
        fabric = Fabric(1e4, 0.1, bending=(D, 0.0))
        ply = Ply(mesh, fabric, formulation, fibre_ends=ends)
        X, Y = ply.nodes
        angle = X / SIDE - 0.5
        arc = [SIDE * np.sin(angle) - X, -SIDE * np.cos(angle) + 0 * Y]
        energy = ply.energies(np.array(arc).T.ravel(), 1.0)["bending"]
        return energy / (0.5 * D * 20.0 / SIDE) - 1

    for formulation in (Full(), Quadratic()):
        assert abs(off(32, formulation)) < 1e-3
        assert abs(off(16, formulation)) > 3.5 * abs(off(32, formulation))
