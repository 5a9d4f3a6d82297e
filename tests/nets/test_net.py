"""Kinematic nets and exponential maps, against exact solutions."""

import numpy as np
import pytest

from skfem_textile import drape
from skfem_textile.surfaces.surface import GrowingSurface, geodesics
from tests.helpers.tools import SIDE, SPHERE, exact_shear_angle

ANGLES = (0.3, 0.3 + np.pi / 2)
CYLINDER = drape.Cylinder(60.0, (0, 0, -60))
CONE = drape.Cone(0.4, (0, 0, 0), (1, 0, 0))


def test_a_net_on_the_sphere_converges_to_the_chebyshev_net():
    errors = []
    for n in (16, 32):
        net = drape.net(SPHERE, SIDE / n, (0, n), (0, n))
        errors.append(
            np.abs(net.shear_angle() - exact_shear_angle(net.centres())).max()
        )
    assert np.degrees(errors[1]) < 0.003  # required at 64 cells: 0.1
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    corner = net.positions[:, -1, -1] / SIDE
    np.testing.assert_allclose(corner, [0.70662, 0.70662, -1.03700], atol=2e-4)


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
    assert net.status.shape == (4 + 8 + 1, 3 + 8 + 1)
    flat = np.einsum("ij,jab->iab", net.directions, np.array(np.meshgrid(*net.along)))
    x = net.at(flat.reshape(2, -1)).reshape(3, *flat.shape[1:])
    np.testing.assert_allclose(x, net.positions.swapaxes(1, 2), atol=1e-9)


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
    counts = (6, 6), (6, 6)
    whole = drape.net(SPHERE, 10.0, *counts, angles=ANGLES)
    part = drape.net(SPHERE, 10.0, *counts, angles=ANGLES, over=X)
    expected = part.shear_angle()
    assert np.isnan(expected).any()
    assert np.isfinite(expected).any()
    np.testing.assert_allclose(whole.up_to(X).shear_angle(), expected, atol=1e-9)


def test_a_net_covers_the_given_points_only():
    """The whole net folds: threads beyond the ply do not cross."""
    sphere, half = drape.Sphere(100.0, (0, 0, -100)), np.pi / 4
    side = np.linspace(-75, 75, 31)
    ply = np.array(np.meshgrid(side, side)).reshape(2, -1)
    counts = (40, 40), (40, 40)
    angles = {"angles": (half, half + np.pi / 2)}
    laid = drape.net(sphere, 3.75, *counts, **angles, over=ply)
    assert np.isnan(laid.positions).any()
    part = drape.net(sphere, 3.75, (13, 13), (13, 13), **angles)
    inner = np.s_[:, 27:54, 27:54]
    shared = np.isfinite(laid.positions[inner])
    assert shared[:, 13].all()
    np.testing.assert_array_equal(laid.positions[inner][shared], part.positions[shared])
    assert np.isfinite(laid.at(ply)).all()
    whole = drape.net(sphere, 3.75, *counts, **angles)
    assert whole.folds.shape[1]
    with pytest.raises(drape.FoldedNetError, match="threads fold"):
        whole.at(whole.centres().reshape(2, -1))


def test_tangents_of_a_net_agree_with_its_threads():
    """A thread on a cylinder is a helix; the error is quadratic in the cell size."""
    angle, errors = 0.4, []
    X = np.array([[31.0, 7.3, -22.0], [12.0, -9.1, 15.5]])
    for cell in (8.0, 4.0):
        n = int(48 / cell)
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
