import numpy as np
import pytest

from skfem_textile import Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import assert_derivatives, distorted, wobble
from tests.helpers.unestimated import unestimated


def only_stabilised(kind, seed=1):
    ply = Ply(distorted(seed), Fabric(1.0), OnePoint(3.0, kind))
    ply._terms = tuple(t for t in ply.terms if t.name == "stabilisation")
    return ply


@pytest.mark.parametrize("seed", [1, 2])
def test_residual_and_tangent_are_derivatives(seed):
    ply = only_stabilised("isotropic", seed)
    assert_derivatives(ply, wobble(ply, 1), wobble(ply, 2, 1.0))


def test_it_resists_no_homogeneous_motion_and_turns_with_the_ply():
    ply = only_stabilised("isotropic")
    X = ply.mesh.p
    homogeneous = ply.basis.zeros()
    homogeneous[ply.basis.nodal_dofs] = np.array([[0.3, -0.2], [0.5, 0.1]]) @ X
    assert ply.energy(homogeneous) < 1e-25
    u, c, s = wobble(ply, 3), np.cos(1.1), np.sin(1.1)
    turned = ply.basis.zeros()
    Q = np.array([[c, -s], [s, c]])
    turned[ply.basis.nodal_dofs] = Q @ (X + ply.nodal(u)) - X
    assert ply.energy(turned) == pytest.approx(ply.energy(u), rel=1e-10)


def test_it_reads_the_load_of_a_bias_extension():
    """The load converges from above, of first order in the element size or better."""
    too_much = []
    for n in (4, 8, 16):
        scene = bias_extension(rectangle(50, 100, (n, 2 * n), "aligned"))
        fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
        ply = Ply(scene.mesh, fabric, OnePoint(5.0, "isotropic"))
        summary = scene.summary(
            unestimated(LoadStepper(ply, scene.conditions, 4).run())
        )
        assert summary["stable"]
        too_much.append(summary["load_over_exact"] - 1)
    assert 0 < too_much[-1] < 0.03
    assert np.log(too_much[0] / too_much[-1]) / np.log(16 / 4) > 1.0
