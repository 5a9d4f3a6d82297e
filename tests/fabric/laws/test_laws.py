"""Laws of measured fabrics: their parts agree, and they are what they say."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skfem_textile import (
    Asymmetric,
    CrimpToe,
    Fabric,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)
from skfem_textile.fabric.law_check import check_laws

ANGLES = np.radians([0.0, 10.0, 22.0, 35.0, 44.0, 50.0, 55.0])
MOMENTS = (0.0, 0.01, 0.015, 0.04, 0.2, 0.9, 4.0)
CRIMPED = CrimpToe(1e5, 0.004, 10.0)
STRAINS, TENSIONS = (-0.01, 0.0, 0.002, 0.005, 0.01), (-0.1, 0.0, 3.0, 60.0, 400.0)

# Each law, the arguments at which its parts are compared, and where it is not smooth.
LAWS = {
    "table": (Tabulated(STRAINS, TENSIONS), (-0.01, 0.01), STRAINS),
    "odd table": (
        Tabulated(ANGLES, MOMENTS, odd=True),
        (-ANGLES[-1], ANGLES[-1]),
        (*-ANGLES, *ANGLES),
    ),
    "odd table that begins late": (
        Tabulated(ANGLES[1:], MOMENTS[1:], odd=True),
        (-ANGLES[-1], ANGLES[-1]),
        (*-ANGLES, *ANGLES),
    ),
    "extrapolated table": (
        Tabulated(STRAINS, TENSIONS, "linear"),
        (-0.03, 0.03),
        STRAINS,
    ),
    "polynomial": (Polynomial((0.1, 0.0, 0.6, 0.0, 3.0)), (-1.3, 1.3), ()),
    "odd polynomial": (Polynomial((0.1, 0.3, 0.6), odd=True), (-1.3, 1.3), (0.0,)),
    "polynomial in the sine": (Polynomial((0.1, 0.3, 0.6), sine=True), (-1.3, 1.3), ()),
    "odd polynomial in the sine": (
        Polynomial((0.1, 0.3, 0.6, 2.0), sine=True, odd=True),
        (-1.3, 1.3),
        (0.0,),
    ),
    "crimp toe": (CRIMPED, (-0.02, 0.05), (0.0, 4e-4)),
    "crimp toe alone": (CrimpToe(1e5, 0.01, 0.0), (-0.02, 0.5), (0.0, 1e-3)),
    "tension only": (TensionOnly(Linear(1e5)), (-0.01, 0.01), (-1e-4, 1e-4)),
    "tension only of a table": (
        TensionOnly(Tabulated(STRAINS[1:], TENSIONS[1:]), 1e-3),
        (-0.01, 0.01),
        (-1e-3, 1e-3, *STRAINS[2:]),
    ),
    "asymmetric": (
        Asymmetric(CRIMPED, Linear(5.0), 5e-4),
        (-0.02, 0.02),
        (-5e-4, 5e-4),
    ),
    "locking": (Locking(0.5, 1.0), (-0.99, 0.99), ()),
    "pretensioned": (Pretensioned(Linear(1e4), 3.0), (-0.02, 0.02), ()),
    "pretensioned crimp": (
        Pretensioned(TensionOnly(CRIMPED, 1e-4), 3.0),
        (-0.01, 0.02),
        (),
    ),
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
@settings(max_examples=60)
@given(shares=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_value_and_tangent_are_the_exact_derivatives(law, ends, kinks, shares):
    """To 1e-8 of what is integrated, and round-off of the difference."""
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
def test_the_repr_rebuilds_a_law(law, ends, kinks):
    again = eval(repr(law))
    assert again == law
    assert hash(again) == hash(law)
    assert repr(again) == repr(law)


@every_law
def test_a_law_is_the_same_in_another_process(law, ends, kinks):
    law.value(np.zeros(1))
    again, x = pickle.loads(pickle.dumps(law)), np.linspace(*ends, 50)
    assert again == law
    np.testing.assert_array_equal(again.energy(x), law.energy(x))


@every_law
def test_a_law_passes_the_check_of_a_ply(law, ends, kinks, caplog):
    fresh = eval(repr(law))  # of which no warning was logged yet
    check_laws(Fabric(fresh, fresh), (6, 4))
    assert caplog.records == []


@pytest.mark.parametrize(("law", "ends"), [(c[0], c[1]) for c in RISING.values()])
def test_these_laws_rise_and_their_energy_is_convex(law, ends):
    x = np.linspace(*ends, 2001)
    assert (law.tangent(x) >= 0).all()
    value, energy = law.value(x), law.energy(x)
    assert (np.diff(value) >= -1e-12 * np.abs(value).max()).all()
    assert (np.diff(energy, 2) >= -1e-13 * energy.max()).all()


def test_a_locking_law_has_no_value_from_its_pole_on():
    law = Locking(0.5, 1.0)
    assert law.domain == (-1.0, 1.0)
    assert np.isinf(law.energy(np.array([-1.0, 1.0]))).all()
    for part in (law.energy, law.value, law.tangent):
        assert np.isnan(part(np.array([-1.1, 2.0]))).all()


@pytest.mark.parametrize("law", [case[0] for case in LAWS.values()] + [Sin2(0.5)])
def test_the_plot_of_a_law_is_its_value_against_its_argument(law):
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


def test_any_law_is_drawn_and_a_table_with_its_points():
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot

    from skfem_textile.plot import plot_law

    axes = plot_law(Linear(2.0))
    assert axes.get_xlabel() == "fibre strain (-) or shear angle (rad)"
    pyplot.close(axes.figure)
    table = plot_law(Tabulated(ANGLES, MOMENTS), of="shear")
    np.testing.assert_allclose(table.lines[1].get_xdata(), np.degrees(ANGLES))
    pyplot.close(table.figure)
