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
    test = BiasTest(width, height, theta, share)
    given = forces(0 * gamma, pulled), forces(0 * gamma, np.array(pull))
    displacement, F = test.measured(*given)
    assert displacement == pytest.approx(pulled)
    assert pytest.approx(np.array(pull) / share) == F
    assert test.shear_angle(displacement) == pytest.approx(gamma, abs=1e-12)
    expected = law.value(gamma) / np.cos(gamma)
    found = test.normalised(gamma, F)
    assert found == pytest.approx(expected, abs=1e-4 * expected.max())


def test_a_pull_beyond_what_inextensible_fibres_reach_has_no_angle():
    """Nor has a row that lacks its force, or whose angle falls, a shear force."""
    test, force = BiasTest(50.0, 100.0), np.array([0.0, 1.0, np.nan, 3.0])
    angle = test.shear_angle(np.array([0.0, 5.0, 1e3, 1e4]))
    assert np.isfinite(angle).tolist() == [True, True, False, False]
    rising = np.isfinite(test.normalised(np.array([0.0, 0.1, 0.2, 0.05]), force))
    assert rising.tolist() == [True, True, False, False]
    assert np.isnan(FrameTest(100.0, 100.0).shear_angle(np.array([1e3]))).all()


def test_a_picture_frame_gives_its_law_back():
    law = Sin2(0.5)
    scene = picture_frame(size=(4, 4), jitter=0.0)
    assert scene.shear_test == FrameTest(100.0, 100.0)
    fabric = Fabric(1e6, law, scene.warp, scene.weft)
    result = Case(scene=scene, fabric=fabric, steps=4).run()
    moved = np.array([scene.driven_displacement(s) for s in result.states])
    force = np.array([scene.reaction(s) for s in result.states])
    displacement, F = scene.shear_test.measured(moved, force)
    gamma = np.linspace(0, np.pi / 4, 5)
    assert scene.shear_test.shear_angle(displacement) == pytest.approx(gamma, abs=1e-12)
    C = law.value(gamma)
    found = scene.shear_test.normalised(gamma, F)
    assert found == pytest.approx(C / np.cos(gamma), rel=1e-4, abs=1e-9)
    pull = 100 * C / np.sin(np.pi / 4 - gamma / 2)
    assert pytest.approx(pull, rel=1e-4, abs=1e-9) == F
    diagonal = 2 * 100 * np.cos(np.pi / 4 - gamma / 2)
    assert displacement == pytest.approx(diagonal - diagonal[0])


def test_the_scenes_know_their_tests():
    whole, half = (bias_extension(part=part).shear_test for part in ("whole", "half"))
    assert astuple(whole) == pytest.approx((50.0, 100.0, np.pi / 4, 1.0))
    assert astuple(half) == pytest.approx((50.0, 100.0, np.pi / 4, 0.5))
    pulled = specimen(moves=[("bottom", (0, 0)), ("top", (0, 5))])
    assert pulled.shear_test == BiasTest(50.0, 100.0)


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
