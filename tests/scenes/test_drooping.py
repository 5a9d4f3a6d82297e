"""Cantilevers of bending laws: the elastica, differential equations, the scene."""

import numpy as np
import pytest

from skfem_textile import Bilinear, Fabric, Polynomial
from skfem_textile.scenes import Case, cantilever
from skfem_textile.scenes.elastica import chord_angles, drooping, hanging
from studies.bending.study import LAWS, tip


@pytest.mark.parametrize("number", [1e-2, 10.0, 1000.0])
def test_straight_laws_are_the_elastica(number):
    exact, found = hanging(number), drooping(np.ones_like, [1.0], number)
    error = np.hypot(found.x[0] - exact.x[-1], found.drop[0] + exact.z[-1])
    assert error < 3e-6


@pytest.mark.slow
@pytest.mark.parametrize("law", ["stiffening", "bilinear", "binder fabric"])
def test_laws_droop_as_an_initial_value_problem_from_the_clamp(law):
    found = drooping(LAWS[law].tangent, [250.0], 13.6e-6, 2000)
    exact = tip(LAWS[law], 250.0, 13.6e-6)
    assert np.hypot(found.x[0] - exact[0], found.drop[0] - exact[1]) < 1e-4 * 250


def test_the_published_droop_of_the_binder_fabric():
    """102 mm by the curve, 54 mm by the stiffness at small curvatures."""
    for law, drop in (("binder fabric", 101.99), ("linear", 53.64)):
        found = drooping(LAWS[law].tangent, [250.0], 13.6e-6)
        assert found.drop[0] == pytest.approx(drop, abs=0.25)


@pytest.mark.parametrize(
    ("law", "bound"),
    [
        (Polynomial((100.0,)), 1e-4),
        (Polynomial((100.0, 0.0, 1e6)), 1e-4),
        (Bilinear(119.0, 2.4e-3, 20.0), 4e-3),
    ],
)
def test_chord_angles_of_a_fit_are_close(law, bound):
    lengths = np.linspace(120.0, 240.0, 7)
    exact = drooping(law.tangent, lengths, 13.6e-6, 300).chord_angle
    found = chord_angles(law.tangent, lengths, 13.6e-6)
    assert np.abs(found / exact - 1).max() < bound


@pytest.mark.slow
def test_the_scene_compares_its_tip_with_that_of_the_law():
    """A law of which only the side of negative curvatures is reached."""
    scene = cantilever("irregular", (8, 1), 0.0, 1, length=200.0, weight=6e-6)
    law = Polynomial((6.0, -20.0, 200.0))
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(law, 0.0))
    summary = scene.summary(Case(scene=scene, fabric=fabric, steps=2).run())
    assert summary["tip_error_over_length"] < 5e-3
