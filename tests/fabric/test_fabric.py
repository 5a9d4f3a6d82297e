import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import CrimpInterchange, Fabric, Full, Linear, OnePoint, Ply

POINTS = np.zeros((2, 6, 1))


def test_directions_are_normalised():
    A1, A2 = Fabric(warp=(3, 4), weft=(0, 1e-30)).directions(POINTS)
    np.testing.assert_allclose(A1.ravel(), [0.6, 0.8])
    np.testing.assert_allclose(A2.ravel(), [0.0, 1.0])


def test_a_direction_may_be_constant_a_function_or_one_per_element():
    x = np.random.default_rng(0).random((2, 6, 4))
    per_element = np.tile([[1.0], [2.0]], 6)
    fabrics = [
        Fabric(warp=(1, 2)),
        Fabric(warp=per_element),
        Fabric(warp=lambda x: np.stack([1 + 0 * x[0], 2 + 0 * x[0]])),
    ]
    for fabric in fabrics:
        A1, _ = fabric.directions(x)
        np.testing.assert_allclose(np.broadcast_to(A1, x.shape)[1], 2 / 5**0.5)


def test_tension_is_one_law_or_a_pair():
    warp, weft = Fabric(tension=(1e4, 2e4)).families
    assert (warp.tension, weft.tension) == (Linear(1e4), Linear(2e4))
    warp, weft = Fabric(tension=Linear(5.0)).families
    assert warp.tension == weft.tension == Linear(5.0)


def test_a_family_of_a_coupled_law_has_its_tension_with_the_other_unstrained():
    law = CrimpInterchange((1e4, 2e3), 0.01, 1.0, 1e-3, 5.0)
    fabric, x = Fabric(law), np.array([0.0, 0.01])
    for i, family in enumerate(fabric.families):
        alone = np.eye(2)[i][:, None] * x
        np.testing.assert_array_equal(family.tension.value(x), law.value(alone)[i])
    assert fabric.tensions is law
    assert fabric.unbounded
    assert fabric.at() is fabric


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"tension": -1.0}, "tension stiffness must be a finite number >= 0, got -1.0"),
        ({"tension": (1.0, -1.0)}, "tension stiffness"),
        ({"tension": (1.0, 1.0, 1.0)}, "a pair"),
        ({"tension": "stiff"}, "tension must be a number or a law"),
        ({"shear": -0.5}, "shear stiffness"),
        ({"shear": float("nan")}, "shear stiffness"),
        ({"warp": (0, 0)}, "warp must be a non-zero finite vector"),
        ({"weft": (np.nan, 1)}, "weft must be a non-zero finite vector"),
        ({"warp": (1, 1), "weft": (-2, -2)}, "parallel"),
        ({"warp": (1, 0, 0)}, r"vector of 2 components.* got shape \(3,\)$"),
        ({"warp": 1.0}, "warp must be a vector"),
        ({"warp": lambda x: x, "weft": (0, 0)}, "weft must be a non-zero"),
        ({"tension": Linear}, "tension must be a law: Linear is a class"),
        ({"warp": np.ones((2, 5)), "weft": np.ones((2, 4))}, "weft must be a vector"),
    ],
)
def test_invalid_fabrics_are_rejected(arguments, message):
    with pytest.raises(ValueError, match=message):
        Fabric(**arguments)


def test_parallel_directions_on_the_mesh_are_rejected():
    """They are parallel on x = 1/8 only: at the centres of some elements."""
    fabric = Fabric(warp=lambda x: np.stack([x[0] - 0.125, 1 + 0 * x[0]]))
    with pytest.raises(ValueError, match="parallel"):
        Ply(MeshQuad().refined(2), fabric, OnePoint(0.0))


def test_one_direction_per_element_must_count_the_elements():
    fabric = Fabric(warp=np.tile([[1.0], [0.0]], 5))
    with pytest.raises(ValueError, match="one vector per element"):
        Ply(MeshQuad().refined(1), fabric, Full())


@pytest.mark.parametrize(
    ("warp", "message"),
    [
        ("right", "warp must be real-valued, got 'right'"),
        ((1j, 0), "warp must be real-valued"),
        ([[1], [1, 2]], "warp must be real-valued"),
    ],
)
def test_invalid_directions_are_named(warp, message):
    with pytest.raises(ValueError, match=message):
        Fabric(1.0, warp=warp)


def test_the_missing_methods_of_a_law_are_named():
    class Half:
        def energy(self, x):
            return x**2

    line = "shear must be a number or a law .*: Half has no value and no tangent"
    with pytest.raises(ValueError, match=line):
        Fabric(1e3, Half())
