"""Nets against nets by the method of KinDrape, implemented in the study."""

import numpy as np
import pytest

from studies.formulations.drape.published import (
    DRAPINGS,
    corner_shear,
    differences,
    published_net,
)

POLE = DRAPINGS["hemisphere, from the pole"]


@pytest.fixture(scope="module")
def x():
    return published_net(POLE, np.array([-4.0, -4.0, np.sqrt(1e4 - 32)]))


def test_cells_have_sides_of_one_length_on_the_mould(x):
    for axis in (1, 2):
        sides = np.linalg.norm(np.diff(x, axis=axis), axis=0)
        np.testing.assert_allclose(sides, POLE.cell, rtol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(x, axis=0), 100.0, rtol=1e-12)


def test_generator_cells_are_square_on_a_sphere(x):
    """The net is symmetric about the diagonals of its first cell."""
    for strip in (x[:, 11:13], x[:, :, 11:13].swapaxes(1, 2)):
        corners = np.stack(
            [strip[:, 0, :-1], strip[:, 1, :-1], strip[:, 1, 1:], strip[:, 0, 1:]], 1
        )
        assert np.degrees(corner_shear(corners).max()) < 1e-5
    np.testing.assert_allclose(x[[1, 0, 2]], x.swapaxes(1, 2), atol=1e-5)


@pytest.mark.parametrize("name", DRAPINGS)
def test_shear_angles_of_both_nets_converge_to_each_other(name):
    """First threads and generator cells agree to second order in the cell size."""
    means = []
    for finer in (1, 2):
        shear, error = differences(name, finer)
        assert shear.max() > 20
        assert np.abs(error).max() < 1.0
        means.append(np.abs(error).mean())
    assert means[0] < 0.05
    assert np.log2(means[0] / means[1]) > 1.7


def test_derivatives_of_the_cubic_mould_are_consistent():
    surface = DRAPINGS["double-curved mould"].surface
    x = np.random.default_rng(1).uniform(50, 450, (3, 20))
    for i, h in enumerate(1e-3 * np.eye(3)):
        one, other = x + h[:, None], x - h[:, None]
        slope = (surface.level(one) - surface.level(other)) / 2e-3
        np.testing.assert_allclose(surface.gradient(x)[i], slope, atol=1e-6)
        bend = (surface.gradient(one) - surface.gradient(other)) / 2e-3
        np.testing.assert_allclose(surface.hessian(x)[i], bend, atol=1e-8)
