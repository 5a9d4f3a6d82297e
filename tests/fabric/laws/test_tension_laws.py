"""Laws of tension: crimp that straightens, fibres without compression, pretension."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skfem_textile import Asymmetric, CrimpToe, Linear, Pretensioned, TensionOnly

CRIMPED = CrimpToe(1e5, 0.004, 10.0)


@given(
    E=st.floats(1.0, 1e8),
    toe=st.floats(1e-4, 0.1),
    k=st.floats(0.0, 1e4),
    at=st.floats(-0.2, 0.2),
    further=st.floats(0.0, 0.1),
)
def test_a_crimp_toe_is_convex_and_never_softer_than_at_rest(E, toe, k, at, further):
    law = CrimpToe(E, toe, k)
    softer, stiffer = law.tangent(np.array([at, at + further]))
    assert k <= softer <= stiffer <= E + k
    if at < 0:
        assert law.value(np.array([at]))[0] == k * at


@pytest.mark.parametrize("strain", [1e-7, 1e-5, 3.9e-4, 4.1e-4, 0.01])
def test_a_crimp_toe_is_as_exact_in_its_toe_as_beyond(strain):
    """Against sums of the exponential's series in exact fractions."""
    from fractions import Fraction

    E, toe = Fraction(100_000), Fraction(1, 250)
    z = Fraction(strain) / toe
    term, value, energy = z, Fraction(0), Fraction(0)
    for n in range(2, 40):
        term *= -z / n
        value, energy = value - term, energy + term * z / (n + 1)
    law = CrimpToe(1e5, 0.004, 0.0)
    found = [part(np.array([strain]))[0] for part in (law.value, law.energy)]
    exact = [float(E * toe * value), float(-E * toe**2 * -energy)]
    assert found == pytest.approx([exact[0], abs(exact[1])], rel=1e-12)


def test_one_sided_laws_are_the_given_ones_beyond_the_switch():
    x = np.linspace(2e-4, 0.01, 20)
    law = TensionOnly(CRIMPED, 2e-4)
    both = Asymmetric(CRIMPED, Linear(5.0), 2e-4)
    for part in ("value", "tangent"):
        given = getattr(CRIMPED, part)(x)
        np.testing.assert_array_equal(getattr(law, part)(x), given)
        np.testing.assert_array_equal(getattr(both, part)(x), given)
        assert not getattr(law, part)(-x).any()
        below = getattr(Linear(5.0), part)(-x)
        np.testing.assert_array_equal(getattr(both, part)(-x), below)


@pytest.mark.parametrize(
    "law", [TensionOnly(Linear(1e4)), Asymmetric(Linear(1e4), Linear(1.0))]
)
def test_the_switch_of_a_one_sided_law_is_smooth(law):
    """The slope of the tangent changes by less and less from step to step."""
    changes = []
    for n in (1000, 10_000):
        x = np.linspace(-2e-4, 2e-4, n)
        slope = np.diff(law.tangent(x)) / np.diff(x)
        changes.append(np.abs(np.diff(slope)).max() / np.abs(slope).max())
    assert changes[1] < 0.2 * changes[0] < 0.02


def test_pretensioned_fibres_lose_crimp_and_go_slack_where_they_have_shortened():
    law = Pretensioned(TensionOnly(CRIMPED), 20.0)
    before = law.strain_before
    assert CRIMPED.value(np.array([before]))[0] == pytest.approx(20.0)
    assert law.value(np.zeros(1))[0] == pytest.approx(20.0, rel=1e-13)
    assert law.tangent(np.zeros(1))[0] > 100 * CRIMPED.tangent(np.zeros(1))[0]
    assert law.value(np.array([-before - 2e-4]))[0] == 0.0
    line = Pretensioned(Linear(1e4), 5.0)
    x = np.linspace(-0.01, 0.01, 9)
    np.testing.assert_allclose(line.value(x), 5.0 + 1e4 * x, atol=1e-11)
    np.testing.assert_allclose(line.energy(x), 5.0 * x + 5e3 * x**2, atol=1e-13)
    assert Pretensioned(Linear(1e4), 0.0).strain_before == 0.0
