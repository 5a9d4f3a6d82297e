"""Twist: its stiffness, and what is free without it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skfem import MeshQuad

from skfem_textile import Fabric, Full, Macro, OnePoint, Ply, Quadratic
from tests.helpers import zero_modes
from tests.helpers.bent_plies import SIDE, every_formulation, inclined, square


def test_twist_goes_with_elements_and_regions():
    mesh = square(8, side=8.0).with_subdomains({"all": np.arange(64)})
    given = np.where(mesh.p[0, mesh.t].mean(axis=0) < 4, 1.0, 3.0)
    fabric = Fabric(twist=given)
    for chosen in (fabric, {"all": fabric}):
        for formulation in (Full(), Macro()):
            ply = Ply(mesh, chosen, formulation, dimension=3)
            u = ply.basis.zeros()
            u[2::3] = 0.1 * ply.nodes.prod(axis=0)
            energy = ply.energies(u)["bending"]
            assert energy == pytest.approx(64 * 0.5 * 2.0 * 0.01, rel=1e-12)
    with pytest.raises(ValueError, match="twist must be a finite number"):
        Fabric(twist=-1.0)
    with pytest.raises(ValueError, match="twist: 3 values for 64 elements"):
        Ply(mesh, Fabric(twist=np.ones(3)))


def test_zero_modes_of_a_free_flat_patch_that_bends():
    """Rigid motions and z = xy, which a small stiffness against twist removes."""
    lines = np.linspace(0, 10, 5)
    mesh = MeshQuad.init_tensor(lines, lines)
    for formulation, modes in (
        (OnePoint(0.0), 7),
        (Full(), 7),
        (Quadratic(), 7),
        (OnePoint(), 6),
    ):
        fabric = Fabric(1e3, 1.0, bending=(1.0, 1.0))
        ply = Ply(mesh, fabric, formulation, dimension=3)
        assert zero_modes(ply.tangent(ply.basis.zeros())) == modes


@every_formulation
@pytest.mark.parametrize("degrees", [0, 45])
def test_twist_of_a_saddle_is_half_of_its_stiffness_times_its_square(
    formulation, degrees
):
    """½ D_t c² per area of z = c x y, turned with the fibres and in space."""
    fabric = Fabric(50.0, **inclined(degrees), twist=3.0)
    ply = Ply(square(8, side=8.0), fabric, formulation, dimension=3)
    turn = Rotation.from_rotvec((0.3, -1.0, 0.7)).as_matrix()
    s, t = np.array([fabric.warp, fabric.weft]) @ ply.nodes
    u = turn @ [*ply.nodes, 0.1 * s * t] - [*ply.nodes, 0 * s]
    energy = ply.energies(u.T.ravel())["bending"]
    assert energy == pytest.approx(64 * 0.5 * 3.0 * 0.01, rel=1e-10)


@pytest.mark.parametrize("degrees", [15, 30])
@pytest.mark.parametrize(
    "formulation", [Full(), Quadratic()], ids=["quadrilaterals", "triangles"]
)
def test_twist_that_varies_is_of_second_order_on_irregular_meshes(formulation, degrees):
    angle, k = np.radians(degrees), np.pi / SIDE

    def off(n):
        fabric = Fabric(50.0, **inclined(degrees), twist=3.0)
        ply = Ply(square(n, 0.2), fabric, formulation, dimension=3)
        u = ply.basis.zeros()
        u[2::3] = np.sin(k * ply.nodes).prod(axis=0)
        # The twist is k² cos 2α cos kx cos ky, with this mean of its square:
        mean = 0.25 * np.cos(2 * angle) ** 2 * k**4
        return ply.energies(u)["bending"] / (0.5 * 3.0 * SIDE**2 * mean) - 1

    coarse, fine = off(16), off(32)
    assert abs(fine) < 0.02
    assert abs(coarse) > 2.5 * abs(fine)


@every_formulation
def test_with_a_twist_stiffness_rigid_motions_alone_are_free(formulation):
    fabric = Fabric(1e3, 1.0, bending=(1.0, 1.0), twist=0.1)
    made = OnePoint(0.0) if isinstance(formulation, OnePoint) else formulation
    halves = 2 if isinstance(formulation, Macro) else 1
    ply = Ply(square(4 // halves, 0.2, 10.0), fabric, made, dimension=3)
    assert zero_modes(ply.tangent(ply.basis.zeros())) == 6
