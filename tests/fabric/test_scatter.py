"""Random laws of further specimens, from the laws of single specimens."""

import numpy as np
import pytest
from scipy import stats

from skfem_textile import CrimpToe, Fabric, Linear, Locking, Polynomial
from skfem_textile.fabric.origin import Origin, SpecimenLaw
from skfem_textile.fabric.scatter import band_of_law, sampled, sampled_laws
from tests.helpers import refused

ANGLES = np.radians([2.0, 20.0, 38.0])
STIFFNESSES = 0.5, 0.7, 0.8, 1.3


def origin(**parts):
    """Origin with the laws of specimens by part."""
    return Origin(
        specimens={
            part: tuple(SpecimenLaw(f"no {i}", law) for i, law in enumerate(laws))
            for part, laws in parts.items()
        },
        ranges={"shear": np.radians(40.0)},
    )


def quintics(seed, n):
    """Polynomials whose coefficients scatter."""
    c = np.exp(0.2 * np.random.default_rng(seed).standard_normal((n, 2)))
    return [Polynomial((0.03 * a, 0.0, 0.0, 0.0, 0.1 * b)) for a, b in c]


def test_a_further_stiffness_has_the_t_distribution_of_the_logarithms():
    """Predictive distribution about the geometric mean, with the factor √(1 + 1/m)."""
    laws = sampled_laws(origin(shear=map(Linear, STIFFNESSES)), 2000)
    drawn = np.sort(np.log([one["shear"].stiffness for one in laws]))
    logs, m = np.log(STIFFNESSES), len(STIFFNESSES)
    spread = logs.std(ddof=1) * np.sqrt(1 + 1 / m)
    exact = stats.t(m - 1, logs.mean(), spread).cdf(drawn)
    assert np.abs(exact - (np.arange(2000) + 0.5) / 2000).max() < 1e-3


def test_the_band_of_a_law_contains_its_samples_as_often_as_it_says():
    known = origin(shear=quintics(1, 5))
    laws = [one["shear"] for one in sampled_laws(known, 200)]
    low, high = band_of_law(known.specimens["shear"], ANGLES, 0.9)
    moments = np.array([law.value(ANGLES) for law in laws])
    inside = np.mean((low <= moments) & (moments <= high), axis=0)
    assert inside == pytest.approx(np.full(3, 0.9), abs=0.03)


def test_specimens_that_differ_by_a_factor_have_samples_of_the_same_shape():
    """The table of a polynomial follows it between its points."""
    c = np.array([0.03, 0.0, -0.05, 0.0, 0.15])
    known = origin(shear=[Polynomial(tuple(f * c)) for f in (0.7, 1.0, 1.2)])
    x = np.radians(np.linspace(0.5, 60.0, 200))
    for one in sampled_laws(known, 5):
        ratio = one["shear"].value(x) / Polynomial(tuple(c)).value(x)
        assert np.ptp(ratio) < 1e-3 * ratio.mean()


def test_samples_of_few_specimens_never_decrease():
    """Between specimens with and without a plateau, products of powers decrease."""
    coefficients = (0.035, -0.108, 0.19), (0.03, 0.0, 0.02), (0.02, -0.03, 0.05)
    laws = [Polynomial((a, 0.0, b, 0.0, c)) for a, b, c in coefficients]
    x = np.linspace(0.0, 1.5, 300)
    for one in sampled_laws(origin(shear=laws), 40):
        assert one["shear"].tangent(x).min() > 0


def test_the_first_samples_do_not_depend_on_their_number():
    known = origin(shear=quintics(2, 4), warp=map(Linear, STIFFNESSES))
    few, many = sampled_laws(known, 3), sampled_laws(known, 30)
    assert few == many[:3]
    assert few != sampled_laws(known, 3, seed=2)


def test_parts_are_drawn_independently_and_few_samples_fill_their_ranges():
    parts = dict.fromkeys(("warp", "shear"), STIFFNESSES)
    laws = sampled_laws(origin(**{k: map(Linear, x) for k, x in parts.items()}), 60)
    levels = [[np.log(one[part].stiffness) for one in laws] for part in parts]
    assert abs(stats.spearmanr(*levels).statistic) < 0.15


def test_samples_replace_the_laws_of_a_fabric_that_scatter():
    toes = [CrimpToe(E, 0.01, 1.0) for E in (900.0, 1000.0, 1200.0)]
    known = origin(warp=toes, shear=[Linear(0.5), Linear(0.6)])
    fabric = Fabric((500.0, 700.0), 0.1, warp=(1, 1), weft=(-1, 1))
    (one,) = sampled(fabric, known, 1)
    warp, weft = (family.tension for family in one.families)
    assert (warp.toe, warp.initial_stiffness) == (0.01, 1.0)
    assert warp.stiffness not in (900.0, 1000.0, 1200.0)
    assert weft == Linear(700.0)
    assert one.shear_law == Linear(0.1)  # two specimens
    assert one.warp == fabric.warp


def test_samples_of_laws_with_a_pole_have_one():
    known = origin(shear=[Locking(0.1 * k, 1.0 + 0.02 * k) for k in (1, 2, 3)])
    for one in sampled_laws(known, 10):
        assert one["shear"].domain[1] < 0.5 * np.pi


@pytest.mark.parametrize(
    ("laws", "message"),
    [
        ([Linear(0.1), Linear(0.2)], "requires the laws of 3 specimens"),
        ([Linear(0.1), Linear(0.2), Linear(0.0)], "specimen no 2 has parameters that"),
        ([Linear(0.1), Linear(0.2), Locking(0.1, 1.0)], "different shear laws: Linear"),
    ],
)
def test_laws_whose_scatter_is_unknown_are_refused(laws, message):
    refused(lambda: sampled_laws(origin(shear=laws), 2), message)


def test_a_fabric_without_specimens_and_no_samples_are_refused():
    refused(lambda: sampled_laws(None, 2), "but the fabric contains none")
    refused(lambda: sampled_laws(origin(shear=quintics(1, 3)), 0), "at least 1, got 0")
