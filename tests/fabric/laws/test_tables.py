"""Tables: they meet their points, rise between them, and end or go on straight."""

import logging

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skfem_textile import Fabric, Full, Linear, LoadStepper, Ply, StepError, Tabulated
from skfem_textile.scenes import picture_frame


def test_a_table_may_rise_by_almost_nothing():
    law = Tabulated([0.0, 0.5, 1.0], [0.0, 0.0, 5e-324])
    assert np.isfinite(law.value(np.linspace(0.0, 1.0, 9))).all()


@given(st.lists(st.floats(0.001, 0.1), min_size=1, max_size=12), st.data())
def test_a_table_is_monotone_between_its_points_and_meets_them(steps, data):
    n = len(steps)
    rises = data.draw(st.lists(st.floats(0.0, 10.0), min_size=n, max_size=n))
    x = np.concatenate([[0.0], np.cumsum(steps)])
    y = np.concatenate([[0.0], np.cumsum(rises)])
    law, between = Tabulated(x, y), np.linspace(0.0, x[-1], 200)
    np.testing.assert_allclose(law.value(x), y, atol=1e-12)
    size = np.max(rises) / np.min(steps)
    assert (law.tangent(between) >= -1e-12 * size).all()
    cell = np.clip(np.searchsorted(x, between, "right") - 1, 0, n - 1)
    rounding = 1e-12 * y[-1] + np.finfo(float).tiny
    assert (law.value(between) >= y[cell] - rounding).all()
    assert (law.value(between) <= y[cell + 1] + rounding).all()


@pytest.mark.parametrize("extrapolation", ["refuse", "linear"])
def test_a_table_of_a_linear_law_is_the_linear_law(extrapolation):
    x = np.array([-0.02, -0.011, 0.0, 0.001, 0.03])
    law, line = Tabulated(x, 1e4 * x, extrapolation), Linear(1e4)
    at = np.linspace(-0.02, 0.03, 77)
    for part in ("energy", "value", "tangent"):
        expected = getattr(line, part)(at)
        np.testing.assert_allclose(getattr(law, part)(at), expected, rtol=1e-9)


def test_a_table_ends_its_domain_or_goes_on_straight_with_one_warning(caplog):
    refused, further = (
        Tabulated([0.0, 0.1, 0.3], [0.0, 1.0, 5.0], extrapolation, odd=True)
        for extrapolation in ("refuse", "linear")
    )
    outside = np.array([-0.4, 0.4])
    assert refused.domain == (-0.3, 0.3)
    assert further.domain == (-np.inf, np.inf)
    for part in (refused.energy, refused.value, refused.tangent):
        assert np.isnan(part(outside)).all()
    slope = further.tangent(np.array([0.3]))[0]
    np.testing.assert_allclose(
        further.value(outside), [-5 - 0.1 * slope, 5 + 0.1 * slope]
    )
    assert not Fabric(1.0, refused).in_domain(np.zeros((2, 1)), outside)
    assert caplog.records == []
    further.energy(0.5 * outside)
    assert caplog.records == []
    further.energy(outside), further.energy(2 * outside)
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
    assert "a tabulated law of -0.3 to 0.3 is extrapolated" in caplog.text


def test_a_run_stops_where_a_table_ends():
    """A picture frame that shears to 45 degrees, by a table that ends at 40."""
    scene = picture_frame(size=(1, 1), shear_angle=np.radians(45))
    law = Tabulated(np.radians([0, 20, 40]), [0, 0.1, 0.5], odd=True)
    ply = Ply(scene.mesh, Fabric(1e4, law, scene.warp, scene.weft), Full())
    with pytest.raises(StepError, match=r"beyond its domain|end of a law") as stop:
        LoadStepper(ply, scene.conditions, steps=2, max_halvings=3).run()
    reached = [np.abs(ply.shear_angle(s.u)).max() for s in stop.value.result.states]
    assert max(reached) <= np.radians(40)
    assert stop.value.result.states[-1].load_factor > 40 / 45 - 0.2
