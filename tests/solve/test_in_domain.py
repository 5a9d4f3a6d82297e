"""Increments keep to the domains of laws, even where a law has values beyond."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, Full, Ply
from skfem_textile.solve.globalisation import within_laws
from tests.helpers import Locking, Pretensioned
from tests.helpers.tools import problem_of


class Measured(Pretensioned):
    """A law that is defined in a range, with values beyond it."""

    domain = (-0.02, 0.01)


def stretched(ply, strain):
    """Uniform stretch along x."""
    u = ply.basis.zeros()
    u[0::2] = ply.nodes[0] * np.expm1(strain)
    return u


def sheared(ply, angle):
    """Rotation of the fibres along y by the shear angle."""
    u = ply.basis.zeros()
    u[0::2] = ply.nodes[1] * np.sin(angle)
    u[1::2] = ply.nodes[1] * (np.cos(angle) - 1)
    return u


@pytest.mark.parametrize(
    ("fabric", "moved", "low", "high"),
    [
        (Fabric((Measured(1e3, 0.0), 1e3), 1.0), stretched, -0.02, 0.01),
        (Fabric(1e3, Measured(1e3, 0.0)), sheared, -0.02, 0.01),
        (Fabric(1e3, Locking(0.5, 0.3)), sheared, -0.3, 0.3),  # no domain is stated
    ],
)
def test_an_increment_ends_within_the_domain(fabric, moved, low, high):
    mesh = MeshQuad().refined(1).with_defaults()
    ply = Ply(mesh, fabric, Full())
    problem = problem_of(ply, {"clamp": Condition("bottom")}).at(1.0)
    zero, p = ply.basis.zeros(), ply.parameters_at_rest
    for end in (low, high):
        inside, outside = (moved(ply, share * end) for share in (0.99, 1.01))
        assert problem.in_domain(inside, p)
        np.testing.assert_array_equal(within_laws(problem, zero, inside, p), inside)
        with np.errstate(invalid="ignore"):
            assert not problem.in_domain(outside, p)
            halved = within_laws(problem, zero, outside, p)
        np.testing.assert_array_equal(halved, 0.5 * outside)
