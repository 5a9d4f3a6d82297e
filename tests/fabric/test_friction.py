"""Laws with friction: Masing's rules, energy lost, and refused parameters."""

import numpy as np
import pytest

from skfem_textile import (
    CrimpInterchange,
    Linear,
    Locking,
    TensionOnly,
    WithFriction,
)
from skfem_textile.fabric import along

ELASTIC = Locking(0.5, np.radians(65))
LAW = WithFriction(ELASTIC, [0.02, 0.03, 0.05], [0.02, 0.1, 0.4])


def first_loading(x):
    """Friction part of the first loading of `LAW`, written out."""
    parts = (0.02, 0.02), (0.03, 0.1), (0.05, 0.4)
    return sum(np.sign(x) * f * min(abs(x) / y, 1.0) for f, y in parts)


def by_masing(path):
    """Friction part along a path by Masing's rules alone, from its reversals.

    A branch from a reversal is the first loading scaled by two.  Where it reaches the
    last but one reversal, the loop is closed and the earlier branch goes on; without
    one, where it reaches the mirrored reversal, the first loading goes on.
    """
    reversals, values, x, M, rising = [], [], 0.0, 0.0, None
    for target in path:
        if target != x:
            if rising is not None and rising != (target > x):
                reversals.append((x, M))
            rising = target > x
        while reversals:
            x_r, M_r = reversals[-1]
            end = reversals[-2][0] if len(reversals) > 1 else -x_r
            if (target > end) != rising or target == end:
                M = M_r + 2 * first_loading((target - x_r) / 2)
                break
            del reversals[-2:]
        else:
            M = first_loading(target)
        x = target
        values.append(M)
    return np.array(values)


@pytest.mark.parametrize("seed", range(8))
def test_random_cycles_follow_masings_rules(seed):
    path = np.random.default_rng(seed).uniform(-0.9, 0.9, 60)
    values, _ = along(LAW, path)
    np.testing.assert_allclose(
        values - ELASTIC.value(path), by_masing(path), atol=1e-13
    )


def test_steps_do_not_matter_between_reversals():
    coarse = np.array([0.8, -0.3, 0.5])
    fine = np.concatenate(
        [np.linspace(0.0, 0.8, 9), np.linspace(0.7, -0.3, 7), np.linspace(-0.1, 0.5, 5)]
    )
    (few, lost), (many, lost_too) = along(LAW, coarse), along(LAW, fine)
    np.testing.assert_allclose(many[[8, 15, 20]], few, rtol=1e-12)
    assert lost_too == pytest.approx(lost, rel=1e-12)


def test_the_energy_lost_in_a_cycle_is_the_area_of_its_loop():
    there = np.linspace(0.0, 0.9, 2001)
    path = np.concatenate([there, there[::-1], -there, there - 0.9, there])
    values, lost = along(LAW, path)
    loop = slice(2000, None)
    _, lost_before = along(LAW, path[:2001])
    area = np.trapezoid(values[loop], path[loop])
    assert lost - lost_before == pytest.approx(area, rel=1e-3)


def test_energy_value_and_tangent_are_derivatives_after_any_slip():
    slip = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 1))
    held, x, h = LAW.with_slip(slip), np.linspace(-0.9, 0.9, 400), 1e-6
    slope = (held.energy(x + h) - held.energy(x - h)) / (2 * h)
    np.testing.assert_allclose(slope, held.value(x), atol=1e-7)
    slope = (held.value(x + h) - held.value(x - h)) / (2 * h)
    np.testing.assert_allclose(slope, held.tangent(x), rtol=1e-6)


def test_energy_rises_by_the_work_in_a_step():
    slip, x = np.array([[0.1], [0.0], [-0.2]]), np.linspace(0.1, 0.8, 20001)
    held = LAW.with_slip(slip)
    work = np.trapezoid(held.value(x), x)
    rise = held.energy(x[-1:]) - held.energy(x[:1])
    assert rise[0] == pytest.approx(work, rel=1e-7)
    after = LAW.slip_after(x[-1:], slip)
    stored = LAW.with_slip(after).energy(x[-1:]) - held.energy(x[:1])
    assert (stored + LAW.loss(after - slip))[0] == pytest.approx(rise[0], rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((Linear(1.0), [], []), "a limit and an onset for each element"),
        ((Linear(1.0), [0.1], [0.1, 0.2]), "1 limit.* and 2 onset"),
        ((Linear(1.0), [-0.1], [0.1]), "limit must be a finite number > 0, got -0.1"),
        ((Linear(1.0), [0.1], [0.0]), "onset must be a finite number > 0"),
        ((ELASTIC, [0.1], [10.0]), "onset: 10 rad exceeds a right angle"),
        ((LAW, [0.1], [0.1]), "law must not have friction"),
        ((Linear(np.ones(4)), [0.1], [0.1]), "law must be uniform"),
        (
            (CrimpInterchange(1e3, 0.1, 1.0, 0.01, 1.0), [0.1], [0.1]),
            "law of one strain",
        ),
    ],
)
def test_invalid_friction_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        WithFriction(*arguments)


def test_friction_is_added_to_the_whole_law():
    with pytest.raises(ValueError, match="add it to the whole law"):
        TensionOnly(WithFriction(Linear(1e4), [1.0], [1e-3]))


def test_an_element_at_its_onset_slips():
    law = WithFriction(Linear(2.0), (1.0,), (0.1,))
    below = 0.1 * (1 - np.array([3e-9, 3e-10]))
    assert law.tangent(below) == pytest.approx([12.0, 2.0])
