"""What machines of shear tests measure, by loads that are known."""

from dataclasses import astuple

import numpy as np
import pytest

from skfem_textile import Fabric, Linear, Sin2
from skfem_textile.scenes import Case, bias_extension, picture_frame, specimen
from skfem_textile.scenes.bias_extension import force
from skfem_textile.scenes.shear_test import BiasTest, FrameTest


def forces(x, y):
    return np.stack([x, y], axis=1)


@pytest.mark.parametrize("law", [Linear(0.5), Sin2(0.5)])
@pytest.mark.parametrize(("theta", "height"), [(45.0, 100.0), (40.0, 120.0)])
@pytest.mark.parametrize("share", [1.0, 0.5])
def test_the_exact_pull_of_a_bias_test_gives_its_law_back(law, theta, height, share):
    """To the error of straight lines between a hundred states."""
    theta, width = np.radians(theta), 50.0
    gamma = np.linspace(0.0, np.radians(50), 101)
    pull = [share * force(law, g, width, height, theta) for g in gamma]
    L = (height / np.sin(theta) - width / np.cos(theta)) / 2
    pulled = 2 * L * (np.sin(theta + gamma / 2) - np.sin(theta))
    test = BiasTest(theta, width, height, share)
    found = test.measured(forces(0 * gamma, pulled), forces(0 * gamma, np.array(pull)))
    assert found.angle == pytest.approx(gamma, abs=1e-12)
    assert found.displacement == pytest.approx(pulled)
    assert found.force == pytest.approx(np.array(pull) / share)
    expected = law.value(gamma) / np.cos(gamma)
    assert found.normalised == pytest.approx(expected, abs=1e-4 * expected.max())


def test_a_pull_beyond_what_inextensible_fibres_reach_has_no_angle():
    pulled = np.array([0.0, 5.0, 1e3, 1e4])
    force = forces(0 * pulled, np.array([0.0, 1.0, 2.0, 3.0]))
    found = BiasTest(np.pi / 4, 50.0, 100.0).measured(forces(0 * pulled, pulled), force)
    assert np.isfinite(found.angle).tolist() == [True, True, False, False]
    assert np.isfinite(found.normalised).tolist() == [True, True, False, False]


def test_a_picture_frame_gives_its_law_back():
    law = Sin2(0.5)
    scene = picture_frame(size=(4, 4), jitter=0.0)
    assert scene.shear_test == FrameTest(100.0)
    fabric = Fabric(1e6, law, scene.warp, scene.weft)
    result = Case(scene=scene, fabric=fabric, steps=4).run()
    moved = np.array([scene.driven_displacement(s) for s in result.states])
    force = np.array([scene.reaction(s) for s in result.states])
    found = scene.shear_test.measured(moved, force)
    gamma = np.linspace(0, np.pi / 4, 5)
    assert found.angle == pytest.approx(gamma, abs=1e-12)
    C = law.value(gamma)
    assert found.normalised == pytest.approx(C / np.cos(gamma), rel=1e-4, abs=1e-9)
    pull = 100 * C / np.sin(np.pi / 4 - gamma / 2)
    assert found.force == pytest.approx(pull, rel=1e-4, abs=1e-9)
    back = np.pi / 2 - 2 * np.arccos(np.sqrt(0.5) + found.displacement / 200)
    assert back == pytest.approx(gamma, abs=1e-12)


def test_the_scenes_know_their_tests():
    whole, half = (bias_extension(part=part).shear_test for part in ("whole", "half"))
    assert astuple(whole) == pytest.approx((np.pi / 4, 50.0, 100.0, 1.0))
    assert astuple(half) == pytest.approx((np.pi / 4, 50.0, 100.0, 0.5))
    pulled = specimen(moves=[("bottom", (0, 0)), ("top", (0, 5))])
    assert pulled.shear_test == BiasTest(np.pi / 4, 50.0, 100.0)


@pytest.mark.parametrize(
    "other",
    [
        {"weft": np.pi / 2},
        {"height": 90.0},
        {"moves": [("bottom", (0, 0)), ("top", (1, 5))]},
        {"moves": [("bottom", (0, 0)), ("top", ("free", 5))]},
        {"moves": [("bottom", ("free", 0)), ("top", (0, 5))]},
        {"moves": [("bottom", (0, 0)), ("top", (0, "free")), ("left", (0, 0))]},
        {"moves": [("bottom", (0, 0)), ("top", (0, 5)), ("left", (0, "free"))]},
    ],
)
def test_a_specimen_that_is_no_bias_test_is_none(other):
    assert specimen(**other).shear_test is None
