import numpy as np

from skfem_textile import CrimpInterchange, Fabric
from tests.helpers import refused

POINTS = np.zeros((2, 6, 1))


def test_directions_are_normalised():
    A1, A2 = Fabric(warp=(3, 4), weft=(0, 1e-30)).directions(POINTS)
    np.testing.assert_allclose(A1.ravel(), [0.6, 0.8])
    np.testing.assert_allclose(A2.ravel(), [0.0, 1.0])


def test_a_family_of_a_coupled_law_has_its_tension_with_the_other_unstrained():
    law = CrimpInterchange((1e4, 2e3), 0.01, 1.0, 1e-3, 5.0)
    fabric, x = Fabric(law), np.array([0.0, 0.01])
    for i, family in enumerate(fabric.families):
        alone = np.eye(2)[i][:, None] * x
        np.testing.assert_array_equal(family.tension.value(x), law.value(alone)[i])
    assert fabric.tensions is law
    assert fabric.unbounded
    assert fabric.at() is fabric


def test_the_missing_methods_of_a_law_are_named():
    class Half:
        def energy(self, x):
            return x**2

    line = "shear must be a number or a law .*: Half has no value and no tangent"
    refused(lambda: Fabric(1e3, Half()), line)


def test_fibres_may_cross_at_a_millionth_of_a_radian_and_no_less():
    A1, A2 = Fabric(warp=(1, 0), weft=(1, 3e-6)).directions(POINTS)
    np.testing.assert_allclose(A2[1] - A1[1], 3e-6)
    refused(lambda: Fabric(warp=(1, 0), weft=(1, 3e-7)), "parallel")
