from functools import partial

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from skfem_textile.fabric import kinematics as kin
from tests.helpers import derivative

seeds = st.integers(0, 2**32 - 1)

WARP, WEFT = np.array([1.0, 0.0]), np.array([0.5, 0.75**0.5])


def some_F(seed):
    return np.eye(2) + 0.3 * np.random.default_rng(seed).standard_normal((2, 2))


def some_F_in_space(seed):
    """A plane state of the ply, rotated at random and moved out of its plane."""
    rng = np.random.default_rng(seed)
    return random_turn(rng)[:, :2] @ some_F(seed) + 0.1 * rng.standard_normal((3, 2))


def random_turn(rng):
    Q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return Q * np.sign(np.linalg.det(Q))


def in_space(F):
    return np.vstack([F, np.zeros((1, 2))])


STATES = {"plane": some_F, "space": some_F_in_space}


def measure(value, *directions):
    """A measure of fibres, and its first and second derivatives, as functions of F."""
    parts = (getattr(kin, value + order) for order in ("", "_d", "_dd"))
    return tuple(partial(_at, part, directions) for part in parts)


def _at(part, directions, F):
    return part(F, *directions)


MEASURES = {
    "fibre strain": measure("fibre_strain", WEFT),
    "shear angle": measure("shear_angle", WARP, WEFT),
    "shear angle, clockwise": measure("shear_angle", WEFT, WARP),
}


@pytest.mark.parametrize("state", STATES.values(), ids=STATES)
@pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)
@settings(max_examples=20)
@given(seed=seeds)
def test_derivatives_are_exact(measure, state, seed):
    value, first, second = measure
    F = state(seed)
    assume(kin.area_ratio(F) > 0.1)
    dF = np.random.default_rng(seed + 1).standard_normal(F.shape)
    along = np.sum(first(F) * dF)
    np.testing.assert_allclose(derivative(value, F, dF, 1e-6), along, atol=1e-6)
    twice = np.einsum("iJkL,kL->iJ", second(F), dF)
    np.testing.assert_allclose(
        derivative(first, F, dF, 1e-6), twice, atol=1e-5 * np.abs(second(F)).max()
    )


@pytest.mark.parametrize("state", STATES.values(), ids=STATES)
@given(seed=seeds)
def test_derivatives_of_the_area_ratio_are_exact(state, seed):
    F = state(seed)
    assume(kin.area_ratio(F) > 0.1)
    H, K = np.random.default_rng(seed + 1).standard_normal((2, *F.shape))
    first, second = kin.area_ratio_d(F, H), kin.area_ratio_dd(F, H, K)
    assert derivative(kin.area_ratio, F, H, 1e-6) == pytest.approx(first, abs=1e-5)
    numerical = derivative(lambda x: kin.area_ratio_d(x, H), F, K, 1e-6)
    assert numerical == pytest.approx(second, rel=1e-5, abs=1e-4)


@given(seed=seeds)
def test_a_rotation_in_space_changes_nothing(seed):
    F, Q = some_F_in_space(seed), random_turn(np.random.default_rng(seed + 1))
    assume(kin.area_ratio(F) > 0.1)
    for measure in (kin.area_ratio, *(value for value, _, _ in MEASURES.values())):
        assert measure(Q @ F) == pytest.approx(measure(F), rel=1e-12, abs=1e-12)


@given(seed=seeds)
def test_a_flat_ply_in_space_agrees_with_the_plane(seed):
    F = some_F(seed)
    assume(np.linalg.det(F) > 0.1)
    assert kin.area_ratio(in_space(F)) == pytest.approx(kin.area_ratio(F))
    crossing = np.pi / 3 - kin.shear_angle(F, WARP, WEFT)
    for either in (F, in_space(F)):
        cosine = kin.cos_angle(either, WARP, WEFT)
        assert cosine == pytest.approx(np.cos(crossing), abs=1e-12)
    for value, first, second in MEASURES.values():
        assert value(in_space(F)) == pytest.approx(value(F), abs=1e-12)
        plane, space = first(F), first(in_space(F))
        np.testing.assert_allclose(space[:2], plane, atol=1e-11 * np.abs(plane).max())
        plane, space = second(F), second(in_space(F))[:2, :, :2]
        np.testing.assert_allclose(space, plane, atol=1e-11 * np.abs(plane).max())


@given(angle=st.floats(-1.0, 1.5))
def test_the_shear_angle_is_the_decrease_of_the_fibre_angle(angle):
    A1, A2 = np.eye(2)
    F = np.array([[1.0, np.sin(angle)], [0.0, np.cos(angle)]])
    assert kin.shear_angle(F, A1, A2) == pytest.approx(angle, abs=1e-12)
    assert kin.fibre_strain(F, A2) == pytest.approx(0.0, abs=1e-12)


def test_shear_rate_agrees_with_the_paper():
    """Γ̇ = f²·L·f₁ + f¹·L·f₂, at any state (§3.2)."""
    F, L = some_F(3), some_F(4)
    f = [F @ A / np.linalg.norm(F @ A) for A in (WARP, WEFT)]
    # f¹ ⟂ f₂ and f² ⟂ f₁, each towards its family
    f1_up = np.array([f[1][1], -f[1][0]])
    f2_up = np.array([-f[0][1], f[0][0]])
    rate = f2_up @ L @ f[0] + f1_up @ L @ f[1]
    assert np.sum(kin.shear_angle_d(F, WARP, WEFT) * (L @ F)) == pytest.approx(rate)
