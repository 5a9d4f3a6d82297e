"""Cells of crimped yarns, as in OpenRadioss: least energy, derivatives and limits."""

import numpy as np
import pytest
from scipy.optimize import minimize

from skfem_textile import Fabric, Tabulated
from skfem_textile.fabric import CrimpedYarns, Softening, TangentShear
from skfem_textile.fabric.law_check import check_laws

YARNS = Softening(400.0, 200.0), Softening(300.0)
TOUCHING = CrimpedYarns(YARNS, (0.05, 0.1), (0.1, 0.3))
COUPLED = CrimpedYarns(YARNS, (0.05, 0.1), (0.1, 0.3), coupling=2.0)
every_law = pytest.mark.parametrize(
    "law", [TOUCHING, COUPLED], ids=["touching", "coupled"]
)
TABLE = Tabulated([-0.01, 0.0, 0.01, 0.1], [-1.0, 0.0, 1.0, 100.0], "linear")


def energy(law, L, y):
    """The energy of the docstring, written out for one state."""
    rest, k = 1 + np.array(law.crimp), np.array(law.springs)
    H = np.sqrt(rest**2 - 1)
    d = np.sqrt(L**2 + (H + y) ** 2) - rest
    yarns = sum(float(yarn.energy(x)) for yarn, x in zip(law.yarns, d, strict=True))
    if law.coupling is None:
        return yarns + 0.5 * k @ np.square(y)
    e = y / H
    springs = k @ (H * ((1 + e) * np.log(np.maximum(1 + e, 1e-9)) - e))
    return yarns + springs + 0.5 * law.coupling * np.sum(y) ** 2 / H.sum()


@every_law
def test_the_energy_is_the_minimum_of_a_search(law):
    apart = [{"type": "ineq", "fun": lambda y: y.sum()}] if law is TOUCHING else []
    for strain in np.random.default_rng(3).uniform(-0.08, 0.12, (12, 2)):
        L = np.exp(strain)
        least = min(
            minimize(
                lambda y, L=L: energy(law, L, y),
                start,
                method="SLSQP",
                constraints=apart,
                options={"ftol": 1e-15, "maxiter": 500},
            ).fun
            for start in ([0.0, 0.0], [0.05, -0.05], [-0.05, 0.05])
        )
        assert law.energy(strain) == pytest.approx(least, rel=1e-7, abs=1e-9)


@every_law
def test_energy_tension_and_tangent_are_consistent(law):
    check_laws(Fabric(law, TangentShear(0.3, 2.0, 0.9)), (1, 1))
    tangent = law.tangent(np.random.default_rng(1).uniform(-0.05, 0.1, (2, 40)))
    assert np.allclose(tangent, tangent.swapaxes(0, 1), rtol=1e-9)


def test_tension_vanishes_at_rest_and_a_fixed_weft_loads_the_warp():
    assert np.abs(TOUCHING.value(np.zeros((2, 1)))).max() == 0
    held, free = TOUCHING.value(np.array([[0.04, 0.04], [0.0, -0.04]]))[0]
    assert held > 1.5 * free


def test_a_long_pull_has_the_stiffness_of_straight_yarns():
    law = CrimpedYarns((Softening(400.0), Softening(400.0)), 0.05, 0.1)
    strain = np.log(np.array([[1.5], [1.0]]))
    straight = 400.0 * (1.5 - 1.05) * 1.5  # T = L F, the yarn without crimp
    assert law.value(strain)[0, 0] == pytest.approx(straight, rel=1e-2)


def test_yarns_of_tables_are_solved_at_all_strains():
    law = CrimpedYarns((TABLE, TABLE), 0.02, 0.05)
    strain = np.random.default_rng(2).uniform(-0.1, 0.1, (2, 200))
    assert np.isfinite(law.value(strain)).all()


def test_shear_beyond_the_locking_angle_is_continuous_with_its_slope():
    law = TangentShear(0.5, 4.0, np.radians(40))
    below, above = law.value(np.radians([40 - 1e-9, 40 + 1e-9]))
    assert below == pytest.approx(0.5 * np.tan(np.radians(40)))
    assert above == pytest.approx(below, abs=1e-8)
    x = np.linspace(-1.4, 1.4, 57)
    step = 1e-6
    slope = (law.energy(x + step) - law.energy(x - step)) / (2 * step)
    assert np.allclose(slope, law.value(x), rtol=1e-6, atol=1e-9)
    assert not np.isfinite(law.energy(np.array([1.6]))).any()
