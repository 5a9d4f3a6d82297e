"""Slip index: friction of crossings, tension handed over, figures of a run."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import Fabric, Linear, Ply, Polynomial, Quadratic, Yarns, slip_index
from skfem_textile.fabric import friction_part
from skfem_textile.io import read_fabric, write_fabric
from skfem_textile.ply.slip import slip_figures

LAW = Polynomial((0.035, 0.0, -0.108, 0.0, 0.19))


def test_lever_is_the_mean_distance_from_the_centre_of_a_crossing():
    yarns = Yarns(spacing=(6.0, 3.0), width=(4.0, 2.5))
    x, y = (w * (np.arange(400) + 0.5) / 400 - 0.5 * w for w in yarns.width)
    assert np.hypot(x[:, None], y).mean() == pytest.approx(yarns.lever, rel=1e-4)


def test_friction_part_is_the_intercept_of_the_tangent_at_the_inflection():
    _, c3, c5 = LAW.coefficients[::2]
    gamma = np.sqrt(-0.3 * c3 / c5)  # C'' = 6 c3 γ + 20 c5 γ³ = 0
    exact = LAW.value(gamma) - gamma * LAW.tangent(gamma)
    assert friction_part(LAW) == pytest.approx(exact, rel=1e-3)
    assert not friction_part(Linear(0.5)).any()


@pytest.mark.parametrize("family", [0, 1])
def test_index_is_the_gradient_of_the_tension_along_the_fibres(family):
    yarns = Yarns((2.0, 3.0), (1.0, 2.0), friction_moment=0.1)
    mesh = MeshTri().refined(5).scaled(40.0)
    ply = Ply(mesh, Fabric(1e3, 1.0, yarns=yarns), Quadratic())
    x, u = ply.nodes[family], ply.basis.zeros()
    u[: 2 * ply.nodes.shape[1]].reshape(-1, 2)[:, family] = 5e-6 * x**2
    index = slip_index(ply, u)
    far = np.abs(mesh.p[:, mesh.t].mean(axis=1) - 20).max(axis=0) < 8
    handed = 1e3 * 1e-5 * yarns.lever / 0.1
    assert index[far] == pytest.approx(handed, rel=0.01)


def test_index_beside_a_line_on_which_tension_ends_is_its_mean_over_a_spacing():
    found = []
    for n in (5, 6):
        yarns = Yarns((4.0, 4.0), (3.0, 3.0), friction_moment=0.1)
        ply = Ply(MeshQuad().refined(n).scaled(64.0), Fabric(1e3, 1.0, yarns=yarns))
        x, u = ply.nodes[0], ply.basis.zeros()
        u[ply.basis.nodal_dofs[0]] = 1e-4 * np.minimum(x, 32.0)
        found.append(slip_index(ply, u).max())
    mean = 1e3 * 1e-4 / 4.0 * yarns.lever / 0.1
    error = np.array(found) / mean - 1
    assert abs(error[1]) < abs(error[0])
    assert abs(error[1]) < 0.15


def test_figures_are_of_the_area_of_a_crossing_and_absent_without_yarns():
    mesh = MeshQuad().refined(4).scaled(16.0)
    u = np.zeros(2 * mesh.nvertices)
    assert slip_figures(Ply(mesh, Fabric(1e3, LAW)), u) == {}
    ply = Ply(mesh, Fabric(1e3, LAW, yarns=Yarns((2.0, 2.0), (1.5, 1.5))))
    u = ply.basis.zeros()
    u[ply.basis.nodal_dofs[0]] = 1e-4 * np.maximum(ply.nodes[0] - 8.0, 0.0)
    index, figures = slip_index(ply, u), slip_figures(ply, u)
    assert np.quantile(index, 0.97) < figures["max_slip_index"] < index.max()
    assert figures["slip_share_of_area"] == pytest.approx((index > 1).mean())


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"spacing": 5.0, "width": (4.0, 4.0)}, "the spacing must be a pair"),
        ({"spacing": (5.0, 5.0), "width": (4.0, -1.0)}, "the width must be a pair"),
        ({"spacing": (5.0, 3.0), "width": (4.0, 4.0)}, "the weft is 4 mm wide"),
        (
            {"spacing": (5.0, 5.0), "width": (4.0, 4.0), "friction_moment": 0.0},
            "the friction moment must be a positive number",
        ),
    ],
)
def test_invalid_yarns_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        Yarns(**given)


def test_yarns_without_friction_are_refused_before_a_run():
    yarns = Yarns((5.0, 5.0), (4.0, 4.0))
    with pytest.raises(ValueError, match="specify the friction_moment"):
        Ply(MeshQuad(), Fabric(1e3, 1.0, yarns=yarns))
    with pytest.raises(ValueError, match="requires the yarns of the fabric"):
        slip_index(Ply(MeshQuad(), Fabric(1e3, 1.0)), np.zeros(8))
    with pytest.raises(ValueError, match="yarns must be Yarns"):
        Fabric(1e3, 1.0, yarns=5.0)


def test_yarns_survive_a_fabric_file(tmp_path):
    yarns = Yarns((5.2, 5.1), (4.2, 4.0), 0.006)
    write_fabric(tmp_path / "fabric.json", Fabric(1e3, LAW, yarns=yarns))
    assert read_fabric(tmp_path / "fabric.json").fabric.yarns == yarns


def test_regions_share_their_yarns():
    mesh = MeshQuad().refined(1).with_subdomains({"a": [0, 1], "b": [2, 3]})
    yarns, other = (Yarns((5.0, 5.0), (w, w), 0.1) for w in (4.0, 3.0))
    fabrics = Fabric(1e3, 1.0, yarns=yarns), Fabric(0.0)
    ply = Ply(mesh, dict(zip("ab", fabrics, strict=True)))
    assert ply.fabric.yarns == yarns
    with pytest.raises(ValueError, match="the same yarns"):
        Ply(mesh, {"a": fabrics[0], "b": Fabric(1e3, 1.0, yarns=other)})
