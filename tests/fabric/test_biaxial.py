"""Coupled laws of both fibre strains, including crimp interchange."""

import pickle

import numpy as np
import pytest

from skfem_textile import CrimpInterchange, CrimpToe, Fabric, Full, Locking, Ply
from skfem_textile.fabric.law import mean_slope
from tests.helpers import Coupled, distorted, refused

LAWS = {
    "balanced": CrimpInterchange(1e4, 0.01, 1.0, 2e-3, 1.0),
    "unbalanced": CrimpInterchange((1e5, 2e3), (0.02, 0.003), 0.1, 4e-3, 10.0),
    "straight warp": CrimpInterchange((1e5, 1e5), (0.0, 0.01), 0.1, 1e-3, 0.0),
    "much crimp": CrimpInterchange((1e3, 1e4), (0.2, 0.1), 5.0, 0.05, 0.0),
    "no crimp": CrimpInterchange((1e3, 1e4), 0.0, 5.0, 0.05, 2.0),
}

every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)


def strains(seed, n=3000):
    return np.random.default_rng(seed).uniform(-0.05, 0.08, (2, n))


def differences(function, at, h):
    """Central differences of a function of both strains, along each of them."""
    steps = h * np.eye(2)[:, :, None]
    return [(function(at + d) - function(at - d)) / (2 * h) for d in steps]


@every_law
def test_tensions_are_derivatives_of_the_energy(law):
    at, T = strains(1), law.value(strains(1))
    # T has a kink in its slope where a yarn becomes slack.
    rates, slack = differences(law.energy, at, 1e-5), 1e-6 * np.abs(T).max()
    np.testing.assert_allclose(rates, T, atol=slack)


@every_law
def test_the_tangent_is_symmetric_and_the_derivative_of_the_tensions(law):
    at, D = strains(2), law.tangent(strains(2))
    np.testing.assert_array_equal(D[0, 1], D[1, 0])
    error = np.abs(differences(law.value, at, 1e-7) - D) / np.abs(D).max()
    # except where a yarn becomes slack in between
    assert (np.quantile(error, 0.99, axis=(1, 2)) < 1e-6).all()
    assert error.max() < 1e-3


@every_law
def test_the_energy_is_convex(law):
    D = np.moveaxis(law.tangent(strains(3)), -1, 0)
    assert np.linalg.eigvalsh(D).min() >= -1e-9 * np.abs(D).max()


@every_law
def test_the_amplitude_minimises_the_energy(law):
    at = strains(4, 300)
    E = [CrimpToe(E, law.toe, 0.0) for E in law.stiffness]
    eta = np.sqrt(2 * np.array(law.crimp))
    least = law.energy(at)
    for w in np.linspace(-eta[1], eta[0], 50):
        shapes = np.array([(eta[0] - w) ** 2, (eta[1] + w) ** 2]) / 2 - law.crimp
        yarns = sum(y.energy(e + s) for y, e, s in zip(E, at, shapes, strict=True))
        other = yarns + law.bending * w**2 / 2
        other = other + law.initial_stiffness * (at**2).sum(axis=0) / 2
        assert np.all(other >= least * (1 - 1e-12))


def test_the_energy_at_rest_is_zero_and_a_slack_fabric_has_its_initial_stiffness():
    law, rest = LAWS["unbalanced"], np.zeros((2, 1))
    assert law.energy(rest) == 0
    assert not law.value(rest).any()
    np.testing.assert_array_equal(law.tangent(rest - 0.03)[..., 0], 10 * np.eye(2))


def test_a_law_without_crimp_is_uncoupled():
    law, at = LAWS["no crimp"], strains(5)
    for E, e, T in zip(law.stiffness, at, law.value(at), strict=True):
        np.testing.assert_allclose(T, CrimpToe(E, 0.05, 2.0).value(e), rtol=1e-14)
    assert not law.tangent(at)[0, 1].any()


def test_a_pulled_warp_straightens_by_its_crimp_and_no_further():
    """With a free weft the warp has no tension below ε = c, and E (ε − c) above."""
    c, E = 0.02, 1e5
    law = CrimpInterchange(E, c, 0.01, 1e-5, 0.0)
    slack = np.array([0.9 * c, -0.5])
    pulled = np.array([c + 0.001, -0.5])
    assert law.value(slack)[0] < 1e-3 * E * c
    # The yarn's toe is 1e-5, so that its tension is E (0.001 - 1e-5) when straight.
    assert law.value(pulled)[0] == pytest.approx(E * (0.001 - 1e-5), rel=1e-3)


@every_law
def test_repr_rebuilds_the_law_and_any_shape_is_accepted(law):
    again, at = eval(repr(law)), strains(6, 24)
    assert again == law == pickle.loads(pickle.dumps(law))
    for shape in ((2, 6, 4), (2, 2, 3, 4)):
        value, tangent = (
            part(at.reshape(shape)) for part in (again.value, law.tangent)
        )
        np.testing.assert_array_equal(value.reshape(2, -1), law.value(at))
        np.testing.assert_array_equal(tangent.reshape(2, 2, -1), law.tangent(at))
    assert law.energy(np.zeros(2)).shape == ()


def test_plots_have_a_line_of_each_family_for_each_ratio():
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    from skfem_textile.plot import plot_law, plot_tensions

    law = LAWS["unbalanced"]
    axes = plot_law(law, Figure().subplots())
    x, y = axes.lines[4].get_data()  # the warp, at half of its strain in the weft
    np.testing.assert_allclose(y, law.value(np.array([x, 0.5 * x]))[0])
    assert len(axes.lines) == 8
    assert axes.get_ylabel().startswith("tension T (N/mm)")
    warp, weft = plot_tensions(law, Figure().subplots(), ratios=[2.0]).lines
    for i, line in enumerate((warp, weft)):
        x, y = line.get_data()
        np.testing.assert_allclose(y, law.value(np.array([x, 2.0 * x]))[i])


# The check of laws


class Wrong(Coupled):
    """One part belongs to another coupling; ``skew`` moves it across the diagonal."""

    def __init__(self, part, by=1.0, skew=0.0):
        super().__init__(100.0, 60.0)
        other = getattr(Coupled(100.0, 60.0 + by), part)
        skewed = np.array([[0.0, skew], [-skew, 0.0]])

        def changed(strain):
            shape = strain.shape[1:]
            return other(strain) + np.multiply.outer(skewed, np.ones(shape))

        setattr(self, part, changed if skew else other)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        (Wrong("energy"), "^.* law, energy: at ε = "),
        (Wrong("tangent"), "^.* law, tangent: at ε = "),
        (Wrong("tangent", 0.0, 1.0), "^tension law, tangent: .*differs from ∂T₂/∂ε₁"),
    ],
    ids=["energy", "tangent", "symmetry"],
)
def test_inconsistent_parts_are_rejected(law, message):
    refused(lambda: Ply(distorted(1), Fabric(law, 0.5), Full()), message)


# Plies


def test_the_fixed_stiffness_of_a_family_assumes_constant_strain_of_the_other():
    law, at = Coupled(100.0, 60.0), np.array([[0.02], [-0.05]])
    for i in range(2):
        step, strains = 0.01 * np.eye(2)[i][:, None], at.copy()
        strains[i] = np.maximum(at[i], 0.0)  # a slack family has its stiffness at rest
        slope = (law.value(strains + step) - law.value(strains - step))[i] / 0.02
        stiffness = mean_slope(law.of_family(i, at), at[i])
        np.testing.assert_allclose(stiffness, slope, rtol=1e-12)


class Bounded(Coupled):
    domain = (-0.1, 0.2)


def test_states_outside_the_domain_are_rejected():
    ply = Ply(distorted(1), Fabric(Bounded(10.0, 5.0), 0.5), Full())
    for stretch, inside in ((0.0, True), (0.15, True), (0.3, False), (-0.15, False)):
        u = ply.basis.zeros()
        u[ply.basis.nodal_dofs[1]] = stretch * ply.mesh.p[1]
        assert ply.in_domain(u) is inside


def test_every_region_has_its_domain():
    mesh = distorted(1).with_subdomains({"left": [0, 1], "right": [2, 3, 4, 5]})
    regions = {
        "left": Fabric(Coupled(10.0, 5.0)),
        "right": Fabric((Locking(2e3, 0.5), 1.0)),
    }
    low, high = Ply(mesh, regions, Full()).fabric.at().tensions.domain
    assert (low.min(), high.max()) == (-np.inf, np.inf)
    assert high[0].min() == 0.5
