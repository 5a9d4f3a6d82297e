import numpy as np
import pytest
from skfem import Functional, MeshQuad, asm

from skfem_textile import Fabric, JumpBasis, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import distorted, random_u
from tests.helpers.intervals import without_interval

MESH = distorted(1)


def stabilisation_only(mesh=MESH, warp=(1, 0), weft=(0, 1)):
    ply = Ply(mesh, Fabric(1.0, 0.0, warp, weft), OnePoint(3.0, "continuity"))
    ply._terms = tuple(t for t in ply.terms if t.name == "stabilisation")
    return ply


def test_the_energy_depends_on_the_jumps_at_midpoints_of_interior_edges():
    mesh = MeshQuad(
        np.array([[0, 2, 3, 0, 2, 3.0], [0, 0, 0, 1, 1, 1]]),
        np.array([[0, 1, 4, 3], [1, 2, 5, 4]]).T,
    )
    ply = stabilisation_only(mesh)
    u = random_u(ply, 1, 0.1)
    whole = Ply(mesh, Fabric(1.0), OnePoint(0.0))
    right, left = (np.array([[x], [0.5]]) for x in (1.0, 0.0))
    jump = whole.shear_angle(u, right)[0, 0] - whole.shear_angle(u, left)[1, 0]
    assert abs(jump) > 0.01
    assert ply.energy(u) == pytest.approx(0.5 * 3.0 * (2 + 1) / 4 * jump**2)


def test_the_weight_of_an_edge_is_a_quarter_of_the_adjacent_areas():
    basis = JumpBasis(MESH)
    areas = Ply(MESH, Fabric(), OnePoint(0.0)).basis.dx[:, 0]
    interior = np.count_nonzero(MESH.f2t[1] >= 0)
    assert basis.dx.shape == (interior, 2)
    beside = areas[MESH.f2t[:, MESH.f2t[1] >= 0]].sum()
    assert asm(Functional(lambda w: 1 + 0 * w.x[0]), basis) == pytest.approx(beside / 4)


def test_directions_may_differ_from_element_to_element():
    """A ply with element-wise fibre directions shears without a jump."""
    angle = np.linspace(0.0, 0.5, MESH.nelements)
    warp, weft = [np.array([np.cos(a), np.sin(a)]) for a in (angle, angle + 1.5)]
    ply = stabilisation_only(MESH, warp, weft)
    u = ply.basis.zeros()
    assert ply.energy(u) < 1e-25
    u[ply.basis.nodal_dofs] = 0.2 * MESH.p
    assert ply.energy(u) < 1e-25
    u[ply.basis.nodal_dofs] = [0.2 * MESH.p[1], 0 * MESH.p[0]]
    assert ply.energy(u) > 1e-6


def test_the_hourglass_pattern_of_a_regular_mesh_has_no_energy():
    """Two motions more without energy than with the paper's stabilisation."""
    mesh = rectangle(4, 6, (4, 6), "aligned")
    for kind, modes in (("energy", 3), ("continuity", 5)):
        ply = Ply(mesh, Fabric(1.0, 1.0), OnePoint(1.0, kind))
        stiffness = np.linalg.eigvalsh(ply.tangent(ply.basis.zeros()).toarray())
        assert np.sum(stiffness < 1e-12) == modes


def test_kinks_of_the_fibres_on_a_mesh_line_have_energy():
    """A sharp bend of the weft between rows is a jump of the shear angle."""
    mesh = rectangle(2, 2, (2, 2), "aligned")
    bent = np.where(mesh.p[1] > 1, 0.3 * (mesh.p[1] - 1), 0.0)
    by_energy, by_jumps = (
        Ply(mesh, Fabric(1e-9), OnePoint(1.0, kind)).energies(
            np.stack([bent, 0 * bent]).T.ravel()
        )["stabilisation"]
        for kind in ("energy", "continuity")
    )
    assert by_energy < 1e-25
    assert by_jumps > 1e-2


def test_the_load_of_a_bias_extension_converges():
    """The shape converges with first order, and so does the load."""

    def errors(n):
        scene = bias_extension(size=(n, 2 * n))
        fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
        ply = Ply(scene.mesh, fabric, OnePoint(2.0, "continuity"))
        result = LoadStepper(ply, scene.conditions, 1).run()
        summary = scene.summary(without_interval(result))
        assert summary["stable"]
        load = abs(summary["load_over_exact"] - 1)
        return np.array([load, summary["displacement_error_rms"]])

    coarse, fine = errors(4), errors(10)
    assert fine[0] < min(coarse[0], 0.01)
    assert coarse[1] / fine[1] > 10 / 4
