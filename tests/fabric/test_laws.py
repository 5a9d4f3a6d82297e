"""Laws of measured fabrics: consistency of their parts, and documented properties."""

import logging
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skfem_textile import (
    Asymmetric,
    CrimpToe,
    Fabric,
    Full,
    Linear,
    LoadStepper,
    Locking,
    Ply,
    Polynomial,
    Pretensioned,
    Sin2,
    StepError,
    Tabulated,
    TensionOnly,
)
from skfem_textile.fabric.law import mean_slope
from skfem_textile.fabric.law_check import check_laws
from skfem_textile.scenes import picture_frame

ANGLES = np.radians([0.0, 10.0, 22.0, 35.0, 44.0, 50.0, 55.0])
MOMENTS = (0.0, 0.01, 0.015, 0.04, 0.2, 0.9, 4.0)
CRIMPED = CrimpToe(1e5, 0.004, 10.0)
STRAINS, TENSIONS = (-0.01, 0.0, 0.002, 0.005, 0.01), (-0.1, 0.0, 3.0, 60.0, 400.0)
ODD, LATE = (Tabulated(ANGLES[i:], MOMENTS[i:], odd=True) for i in (0, 1))
EXTRAPOLATED = Tabulated(STRAINS, TENSIONS, "linear")
SWITCHED, ASYMMETRIC = TensionOnly(CRIMPED), Asymmetric(CRIMPED, Linear(5.0), 5e-4)

# Each law, the arguments at which its parts are compared, and where it is not smooth.
LAWS = {
    "table": (Tabulated(STRAINS, TENSIONS), (-0.01, 0.01), STRAINS),
    "odd table": (ODD, (-ANGLES[-1], ANGLES[-1]), (*-ANGLES, *ANGLES)),
    "odd table that begins late": (
        LATE,
        (-ANGLES[-1], ANGLES[-1]),
        (*-ANGLES, *ANGLES),
    ),
    "extrapolated table": (EXTRAPOLATED, (-0.03, 0.03), STRAINS),
    "polynomial": (Polynomial((0.1, 0.0, 0.6, 0.0, 3.0)), (-1.3, 1.3), ()),
    "odd polynomial": (Polynomial((0.1, 0.3, 0.6), odd=True), (-1.3, 1.3), (0.0,)),
    "polynomial in the sine": (Polynomial((0.1, 0.3, 0.6), sine=True), (-1.3, 1.3), ()),
    "odd polynomial in the sine": (
        Polynomial((0.1, 0.3, 0.6, 2.0), sine=True, odd=True),
        (-1.3, 1.3),
        (0.0,),
    ),
    "crimp toe": (CRIMPED, (-0.02, 0.05), (0.0, 4e-4)),
    "tension only": (TensionOnly(Linear(1e5)), (-0.01, 0.01), (-1e-4, 1e-4)),
    "tension only of a table": (
        TensionOnly(Tabulated(STRAINS[1:], TENSIONS[1:]), 1e-3),
        (-0.01, 0.01),
        (-1e-3, 1e-3, *STRAINS[2:]),
    ),
    "asymmetric": (ASYMMETRIC, (-0.02, 0.02), (-5e-4, 5e-4)),
    "locking": (Locking(0.5, 1.0), (-0.99, 0.99), ()),
    "pretensioned": (Pretensioned(Linear(1e4), 3.0), (-0.02, 0.02), ()),
    "pretensioned crimp": (Pretensioned(SWITCHED, 3.0), (-0.01, 0.02), ()),
}
every_law = pytest.mark.parametrize(
    ("law", "ends", "kinks"), LAWS.values(), ids=list(LAWS)
)
RISING = {name: case for name, case in LAWS.items() if name != "polynomial in the sine"}
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)


def integral(function, a, b, kinks):
    """The integral, and of its absolute value, by panels between a law's kinks."""
    ends = np.unique([a, b, *np.linspace(a, b, 33), *(k for k in kinks if a < k < b)])
    middle, half = (ends[1:] + ends[:-1]) / 2, np.diff(ends) / 2
    f = function(middle[:, None] + half[:, None] * _NODES)
    return np.sum(f @ _WEIGHTS * half), np.sum(np.abs(f) @ _WEIGHTS * half)


@every_law
@settings(max_examples=30)
@given(shares=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_value_and_tangent_are_the_exact_derivatives(law, ends, kinks, shares):
    """To 1e-8 of the integral, and round-off of the difference."""
    low, high = ends
    a, b = sorted(low + share * (high - low) for share in shares)
    if isinstance(law, Pretensioned):
        inner = (-1e-4, 0.0, 1e-4, 4e-4)
        kinks = [kink - law.strain_before for kink in inner]
    for whole, derivative in ((law.energy, law.value), (law.value, law.tangent)):
        at_a, at_b = whole(np.array([a, b]))
        change, size = integral(derivative, a, b, kinks)
        largest = np.abs(whole(np.array([low, a, b, high]))).max()
        assert abs(at_b - at_a - change) <= 1e-8 * size + 1e-14 * largest


def test_the_domain_of_a_law_is_shifted_by_the_strain_before():
    law = Pretensioned(Tabulated([-0.01, 0.0, 0.03], [-10.0, 0.0, 30.0]), 5.0)
    assert law.strain_before == pytest.approx(0.005)
    assert law.domain == pytest.approx((-0.015, 0.025))
    assert law.shown == pytest.approx((-0.015, 0.025))


@every_law
def test_a_law_is_evaluated_on_arrays_of_any_shape(law, ends, kinks):
    x = np.linspace(*ends, 24)
    for part in (law.energy, law.value, law.tangent):
        whole = part(x)
        assert np.isfinite(whole).all()
        for shape in ((4, 6), (2, 3, 4), (24, 1)):
            np.testing.assert_array_equal(part(x.reshape(shape)), whole.reshape(shape))
        assert np.shape(part(np.array(x[0]))) == ()
    assert law.energy(np.zeros(1))[0] == pytest.approx(0.0, abs=1e-15)


@every_law
def test_repr_and_pickling_rebuild_a_law(law, ends, kinks):
    law.value(np.zeros(1))
    for again in (eval(repr(law)), pickle.loads(pickle.dumps(law))):
        assert again == law
        assert hash(again) == hash(law)
        assert repr(again) == repr(law)
        x = np.linspace(*ends, 50)
        np.testing.assert_array_equal(again.energy(x), law.energy(x))


@every_law
def test_every_law_passes_the_check_of_a_ply(law, ends, kinks, caplog):
    fresh = eval(repr(law))  # for which no warning was logged yet
    check_laws(Fabric(fresh, fresh), (6, 4))
    assert caplog.records == []


@pytest.mark.parametrize(("law", "ends"), [(c[0], c[1]) for c in RISING.values()])
def test_monotone_laws_have_a_convex_energy(law, ends):
    x = np.linspace(*ends, 2001)
    assert (law.tangent(x) >= 0).all()
    value, energy = law.value(x), law.energy(x)
    assert (np.diff(value) >= -1e-12 * np.abs(value).max()).all()
    assert (np.diff(energy, 2) >= -1e-13 * energy.max()).all()


def test_a_locking_law_is_undefined_beyond_its_pole():
    law = Locking(0.5, 1.0)
    assert law.domain == (-1.0, 1.0)
    assert np.isinf(law.energy(np.array([-1.0, 1.0]))).all()
    for part in (law.energy, law.value, law.tangent):
        assert np.isnan(part(np.array([-1.1, 2.0]))).all()


@pytest.mark.parametrize("law", [case[0] for case in LAWS.values()] + [Sin2(0.5)])
def test_the_plot_of_a_law_shows_its_value_against_its_argument(law):
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    from skfem_textile.plot import plot_law

    of = "shear" if law.of is None else None
    axes = plot_law(law, Figure().subplots(), of)
    x, y = axes.lines[0].get_data()
    radians = np.radians(x) if "deg" in axes.get_xlabel() else x
    np.testing.assert_allclose(y, law.value(radians), rtol=1e-12, atol=1e-12)
    assert np.isfinite(y).all()
    assert axes.get_xlabel().endswith((" (deg)", " (-)"))
    assert "N" in axes.get_ylabel()


def test_any_law_is_plotted_and_a_table_with_its_points():
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot

    from skfem_textile.plot import plot_law

    axes = plot_law(Linear(2.0))
    label = "fibre strain (-), shear angle (rad) or curvature (1/mm)"
    assert axes.get_xlabel() == label
    pyplot.close(axes.figure)
    table = plot_law(Tabulated(ANGLES, MOMENTS), of="shear")
    np.testing.assert_allclose(table.lines[1].get_xdata(), np.degrees(ANGLES))
    pyplot.close(table.figure)


# Tables: interpolation, monotonicity, and end or linear extrapolation


def test_a_table_may_rise_by_almost_nothing():
    law = Tabulated([0.0, 0.5, 1.0], [0.0, 0.0, 5e-324])
    assert np.isfinite(law.value(np.linspace(0.0, 1.0, 9))).all()


@settings(max_examples=30)
@given(st.lists(st.floats(0.001, 0.1), min_size=1, max_size=12), st.data())
def test_a_table_is_monotone_and_interpolates_its_points(steps, data):
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


def test_a_table_ends_or_is_extrapolated_linearly_with_one_warning(caplog):
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
    assert "law tabulated from -0.3 to 0.3 is extrapolated" in caplog.text


def test_a_run_stops_where_a_table_ends():
    """A picture frame that shears to 45 degrees, by a table that ends at 40."""
    scene = picture_frame(size=(1, 1), shear_angle=np.radians(45))
    law = Tabulated(np.radians([0, 20, 40]), [0, 0.1, 0.5], odd=True)
    ply = Ply(scene.mesh, Fabric(1e4, law, scene.warp, scene.weft), Full())
    with pytest.raises(StepError, match="leaves the domain of a law") as stop:
        LoadStepper(ply, scene.conditions, steps=2, max_halvings=3).run()
    reached = [np.abs(ply.shear_angle(s.u)).max() for s in stop.value.result.states]
    assert max(reached) <= np.radians(40)
    assert stop.value.result.states[-1].load_factor > 40 / 45 - 0.2


# Tension laws: crimp, fibres without compression, pretension


@settings(max_examples=30)
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
    computed = [part(np.array([strain]))[0] for part in (law.value, law.energy)]
    exact = [float(E * toe * value), float(-E * toe**2 * -energy)]
    assert computed == pytest.approx([exact[0], abs(exact[1])], rel=1e-12)


def test_one_sided_laws_equal_the_given_ones_beyond_the_switch():
    x = np.linspace(2e-4, 0.01, 20)
    law = TensionOnly(CRIMPED, 2e-4)
    both = Asymmetric(CRIMPED, Linear(5.0), 2e-4)
    for part in ("value", "tangent"):
        expected = getattr(CRIMPED, part)(x)
        np.testing.assert_array_equal(getattr(law, part)(x), expected)
        np.testing.assert_array_equal(getattr(both, part)(x), expected)
        assert not getattr(law, part)(-x).any()
        below = getattr(Linear(5.0), part)(-x)
        np.testing.assert_array_equal(getattr(both, part)(-x), below)


@pytest.mark.parametrize(
    "law", [TensionOnly(Linear(1e4)), Asymmetric(Linear(1e4), Linear(1.0))]
)
def test_the_switch_of_a_one_sided_law_is_smooth(law):
    """The change in slope of the tangent decreases from step to step."""
    changes = []
    for n in (1000, 10_000):
        x = np.linspace(-2e-4, 2e-4, n)
        slope = np.diff(law.tangent(x)) / np.diff(x)
        changes.append(np.abs(np.diff(slope)).max() / np.abs(slope).max())
    assert changes[1] < 0.2 * changes[0] < 0.02


def test_pretensioned_fibres_lose_crimp_and_become_slack_when_shortened():
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


def test_the_mean_slope_is_that_within_one_percent_of_strain():
    law = Polynomial((0.0, 0.0, 3e6))
    rise = 1e6 * (0.03**3 - 0.01**3)
    assert mean_slope(law, np.array([0.02])) == pytest.approx([3 * rise / 0.02])


def test_elements_within_a_percent_of_the_end_of_a_law_are_named():
    fabric, angle = Fabric(1.0, Locking(0.5, 1.0)), np.array([[0.92], [0.915], [0.905]])
    end = fabric.closest_end(np.zeros((2, 3, 1)), angle)
    assert [*end.elements] == [0, 1]
    assert fabric.shear_law.shown == (-0.95, 0.95)
