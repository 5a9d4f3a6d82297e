"""Kinematic nets and exponential maps, against exact solutions and a published code."""

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.solve.surface import GrowingSurface
from skfem_textile.solve.surface.surface import geodesics
from studies.formulations.drape.chebyshev import SIDE, SPHERE, shear_angle
from studies.formulations.drape.published import (
    DRAPINGS,
    corner_shear,
    differences,
    published_net,
)

# Kinematic nets and exponential maps, against exact solutions


ANGLES = (0.3, 0.3 + np.pi / 2)
CYLINDER = drape.Cylinder(60.0, (0, 0, -60))
CONE = drape.Cone(0.4, (0, 0, 0), (1, 0, 0))


def test_the_exact_net_has_the_shear_angles_of_the_literature():
    z = np.array([0.25, 0.5, 0.75, 1.0])
    X = SIDE * np.sqrt(z) * np.ones((2, 1))
    expected = [14.2744, 28.2568, 41.6795, 54.3183]
    np.testing.assert_allclose(np.degrees(shear_angle(X)), expected, atol=1e-4)


def test_a_net_on_the_sphere_converges_to_the_chebyshev_net():
    errors = []
    for n in (16, 32):
        net = drape.net(SPHERE, SIDE / n, (0, n), (0, n))
        errors.append(np.abs(net.shear_angle() - shear_angle(net.centres())).max())
    assert np.degrees(errors[1]) < 0.003  # required at 64 cells: 0.1
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    corner = net.positions[:, -1, -1] / SIDE
    np.testing.assert_allclose(corner, [0.70662, 0.70662, -1.03700], atol=2e-4)


def test_a_net_and_its_mirror_image_agree():
    whole = drape.net(SPHERE, 5.0, (8, 8), (8, 8)).positions
    np.testing.assert_allclose(whole[0], -whole[0][::-1], atol=1e-9)
    np.testing.assert_allclose(whole[[1, 0, 2]], whole.swapaxes(1, 2), atol=1e-9)


@pytest.mark.parametrize("angles", [(0.0, np.pi / 2), ANGLES])
def test_a_net_on_a_cylinder_is_not_sheared(angles):
    net = drape.net(CYLINDER, 4.0, (10, 15), (12, 20), angles=angles)
    np.testing.assert_allclose(net.shear_angle(), 0.0, atol=1e-10)
    for axis in (1, 2):
        rods = np.linalg.norm(np.diff(net.positions, axis=axis), axis=0)
        np.testing.assert_allclose(rods, 4.0, rtol=1e-10)


@pytest.mark.parametrize(
    ("surface", "settings"),
    [
        (CONE, {"point": np.array([100.0, 0.0, 100 * np.tan(0.4)])}),
        (CYLINDER, {"angles": (0.2, 1.4)}),
        (CYLINDER, {"angles": (1.4, 0.2)}),
    ],
)
def test_the_shear_of_nets_on_developable_surfaces_converges_to_zero(surface, settings):
    shear = [
        np.abs(drape.net(surface, 60 / n, (n, n), (n, n), **settings).shear_angle())
        for n in (10, 20)
    ]
    coarse, fine = (x.max() for x in shear)
    assert fine < 5e-4
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.3)


def test_points_between_crossings_are_interpolated():
    net = drape.net(SPHERE, 5.0, (4, 8), (3, 8), angles=ANGLES, touch=(0.0, 0.0))
    flat = np.einsum("ij,jab->iab", net.directions, np.array(np.meshgrid(*net.along)))
    x = net.at(flat.reshape(2, -1)).reshape(3, *flat.shape[1:])
    np.testing.assert_allclose(x, net.positions.swapaxes(1, 2), atol=1e-9)
    with pytest.raises(ValueError, match="is outside the net, which extends from"):
        net.at(np.array([[100.0], [0.0]]))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, (0, 8), (0, 8)), "cell must be a positive length"),
        ((2.0, (0, 0.5), (0, 8)), "warp must be two whole numbers of cells"),
        ((2.0, (0, 8), (0, 0)), "weft must be two whole numbers of cells"),
    ],
)
def test_nets_that_do_not_exist_are_rejected(arguments, message):
    with pytest.raises(ValueError, match=f"net: .*{message}"):
        drape.net(SPHERE, *arguments)
    with pytest.raises(ValueError, match="must not be parallel"):
        drape.net(SPHERE, 1.0, (0, 1), (0, 1), angles=(0.3, 0.3))


def test_the_exponential_map_preserves_lengths_and_directions():
    X = np.random.default_rng(1).uniform(-90, 90, (2, 50))
    r, angle = np.hypot(*X), np.arctan2(X[1], X[0])
    across = SIDE * np.sin(r / SIDE)
    expected = [
        across * np.cos(angle),
        across * np.sin(angle),
        SIDE * np.cos(r / SIDE) - SIDE,
    ]
    np.testing.assert_allclose(drape.exponential_map(SPHERE, X), expected, atol=1e-4)


def test_the_exponential_map_unrolls_a_cylinder():
    X = np.random.default_rng(1).uniform(-90, 90, (2, 50))
    x = drape.exponential_map(CYLINDER, X)
    rolled = [60 * np.sin(X[0] / 60), X[1], 60 * np.cos(X[0] / 60) - 60]
    np.testing.assert_allclose(x, rolled, atol=1e-3)
    with pytest.raises(ValueError, match="normal to the surface"):
        drape.exponential_map(SPHERE, X, first=(0, 0, 1))


@pytest.mark.parametrize("t", [0.0, 0.3, 1.0])
def test_geodesics_on_a_growing_surface_are_parts_of_those_on_the_surface(t):
    X = np.random.default_rng(1).uniform(-90, 90, (2, 50))
    grown = GrowingSurface(SPHERE, np.zeros(3), t)
    np.testing.assert_allclose(
        geodesics(SPHERE, X).on_growing(np.zeros(3), t),
        drape.exponential_map(grown, X),
        atol=1e-4,
    )


def test_a_part_of_a_net_is_the_net_over_these_points():
    X = np.array([[-31.0, 22.0, 40.0], [12.0, -18.0, 33.0]])
    counts = (10, 10), (10, 10)
    whole = drape.net(SPHERE, 5.0, *counts, angles=ANGLES)
    part = drape.net(SPHERE, 5.0, *counts, angles=ANGLES, over=X)
    expected = part.shear_angle()
    assert np.isnan(expected).any()
    assert np.isfinite(expected).any()
    np.testing.assert_allclose(whole.up_to(X).shear_angle(), expected, atol=1e-9)


def test_a_net_covers_the_given_points_only():
    """The whole net folds: threads beyond the ply do not cross."""
    sphere, half = drape.Sphere(100.0, (0, 0, -100)), np.pi / 4
    side = np.linspace(-75, 75, 31)
    ply = np.array(np.meshgrid(side, side)).reshape(2, -1)
    counts = (60, 60), (60, 60)
    angles = {"angles": (half, half + np.pi / 2)}
    laid = drape.net(sphere, 2.5, *counts, **angles, over=ply)
    assert np.isnan(laid.positions).any()
    part = drape.net(sphere, 2.5, (20, 20), (20, 20), **angles)
    inner = np.s_[:, 40:81, 40:81]
    shared = np.isfinite(laid.positions[inner])
    assert shared[:, 20].all()
    np.testing.assert_array_equal(laid.positions[inner][shared], part.positions[shared])
    assert np.isfinite(laid.at(ply)).all()
    whole = drape.net(sphere, 2.5, *counts, **angles)
    assert whole.folds.shape[1]
    with pytest.raises(drape.FoldedNetError, match="threads fold"):
        whole.at(whole.centres().reshape(2, -1))


def test_tangents_of_a_net_agree_with_its_threads():
    """A thread on a cylinder is a helix; the error is quadratic in the cell size."""
    angle, errors = 0.4, []
    X = np.array([[31.0, 7.3, -22.0], [12.0, -9.1, 15.5]])
    for cell in (4.0, 2.0):
        n = int(80 / cell)
        net = drape.net(
            drape.Cylinder(50.0, (0, 0, -50)),
            *(cell, (n, n), (n, n)),
            angles=(angle, angle + np.pi / 2),
        )
        turn, c, s = X[0] / 50, np.cos(angle), np.sin(angle)
        around = np.array([np.cos(turn), 0 * turn, -np.sin(turn)])
        along = np.array([[0.0], [1.0], [0.0]])
        exact = np.array([c * around + s * along, -s * around + c * along])
        errors.append(np.abs(net.tangents(X) - exact).max())
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 3


def test_geodesics_take_shorter_steps_where_a_surface_is_uneven():
    """The ripples are shorter than the steps on smooth surfaces."""
    h, k = 0.3, 2 * np.pi / 6.0

    def ripples(x, y):
        c, s, zero = h * np.cos(k * x), h * k * np.sin(k * x), np.zeros_like(x)
        return drape.Height(c - h, -s, zero, -k * k * c, zero, zero)

    X = np.array([[99.0, 60.0, 80.0], [0.0, 30.0, -55.0]])
    surface = drape.HeightField(ripples)
    x = drape.exponential_map(surface, X)
    # On a surface that can be unrolled along x, arc length replaces x.
    s = np.linspace(0, 100, 100_001)
    slope = np.hypot(1, h * k * np.sin(k * s))
    arc = np.concatenate([[0], np.cumsum((slope[1:] + slope[:-1]) / 2 * s[1])])
    exact = np.array([np.interp(X[0], arc, s), X[1]])
    assert np.abs(x[:2] - exact).max() < 1e-3 * np.linalg.norm(X, axis=0).max()


class Counted:
    """A surface that counts the points of its curvature evaluations."""

    def __init__(self, surface):
        self.level, self.gradient, self._of = surface.level, surface.gradient, surface
        self.points = 0

    def hessian(self, x):
        self.points += x.shape[1]
        return self._of.hessian(x)


def test_geodesics_end_at_their_length():
    """Short ones take fewer steps than the longest, which takes 32."""
    side = np.linspace(0, 100, 9)
    X = np.array(np.meshgrid(side, side)).reshape(2, -1)
    surface = Counted(SPHERE)
    drape.exponential_map(surface, X)
    assert surface.points < 0.6 * 3 * 32 * X.shape[1]


def test_a_geodesic_through_the_tip_of_a_cone_is_rejected_with_its_end():
    cone = drape.Cone(0.4, (0, 0, 0), (1, 0, 0))
    start = np.array([64.0, 0.0, 64 * np.tan(0.4)])
    length = np.linalg.norm(start)
    X = np.array([[-2 * length, 10.0], [0.0, 5.0]])
    x = drape.exponential_map(cone, X[:, 1:], point=start)
    assert np.isfinite(x).all()
    with pytest.raises(ValueError, match="cannot be projected onto the surface"):
        drape.exponential_map(cone, X, point=start)


# Nets against nets by the method of KinDrape, implemented in the studies


POLE = DRAPINGS["hemisphere, from the pole"]


def test_cells_of_the_published_net_have_sides_of_one_length_on_the_mould():
    x = published_net(POLE, np.array([-4.0, -4.0, np.sqrt(1e4 - 32)]))
    for axis in (1, 2):
        sides = np.linalg.norm(np.diff(x, axis=axis), axis=0)
        np.testing.assert_allclose(sides, POLE.cell, rtol=1e-10)
    np.testing.assert_allclose(np.linalg.norm(x, axis=0), 100.0, rtol=1e-12)


def test_generator_cells_of_the_published_net_are_square_on_a_sphere():
    """The net is symmetric about the diagonals of its first cell."""
    x = published_net(POLE, np.array([-4.0, -4.0, np.sqrt(1e4 - 32)]))
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
