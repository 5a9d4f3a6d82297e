"""Pictures and grids of a displacement on a user's basis."""

import re
from pathlib import Path

import numpy as np
import pytest
from skfem import (
    Basis,
    ElementQuad1,
    ElementTriP2,
    ElementVector,
    MeshQuad,
    MeshTri,
)

from skfem_textile import Fabric, MacroBasis, OnePoint, Ply, fibre_fields
from tests.plot.conftest import own

pv = pytest.importorskip("pyvista")
plot = pytest.importorskip("skfem_textile.plot")

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "for-scikit-fem.md"

#: Arrays of a grid.
CELLS = {
    *("warp_strain", "weft_strain", "warp_tension", "weft_tension"),
    *("shear_angle", "warp_direction", "weft_direction"),
}


def test_twelve_lines_draw_the_fibre_strain_of_an_own_newton_loop(
    tmp_path, monkeypatch, sheets
):
    monkeypatch.chdir(tmp_path)
    script = re.search(r"^```python\n(.*?)^```", PAGE.read_text(), re.M | re.S)[1]
    assert len(list(filter(None, script.splitlines()))) <= 12
    variables = {}
    exec(compile(script, PAGE.name, "exec"), variables)
    mesh, fabric, u, fixed = (variables[x] for x in ("mesh", "fabric", "u", "fixed"))
    ply = Ply(mesh, fabric, OnePoint(0.5, "energy"))
    f = ply.residual(u)
    free = ply.basis.complement_dofs(fixed)
    assert np.abs(f[free]).max() < 1e-9 * np.abs(f).max()
    ((sheet, _),) = sheets
    (warp, weft), strain = sheet.panels, ply.law_strain(u)[..., 0]
    np.testing.assert_allclose([warp.values, weft.values], 100 * strain, atol=1e-10)


@pytest.mark.parametrize("name", ["fibre_strain", "shear_angle", "contact_sheet"])
def test_a_displacement_on_a_basis_is_drawn_like_a_result(result, sheets, name):
    for arguments in ((result,), own(result)):
        getattr(plot, name)(*arguments)
    (of_result, _), (of_basis, _) = sheets
    for one, other in zip(of_result.panels, of_basis.panels, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
        np.testing.assert_array_equal(one.shape.points, other.shape.points)
        assert one[0] == other[0]
        assert one.scale.label == other.scale.label


def test_only_the_elements_of_a_part_are_drawn_and_its_vertices_count(result, sheets):
    basis, u, fabric = own(result)
    elements = np.arange(basis.nelems // 2, basis.nelems)
    part = basis.with_elements(elements)
    plot.field(part, u, fabric, field="area_ratio", fibres=True)
    ((sheet, _),) = sheets
    (panel,) = sheet.panels
    vertices = np.unique(basis.mesh.t[:, elements])
    moved = (basis.mesh.p + result.ply.nodal(u))[:, vertices]
    np.testing.assert_allclose(panel.shape.points[:, :2], moved.T)
    expected = result.ply.least_area_ratio(u)[elements]
    np.testing.assert_allclose(panel.values, expected)
    np.testing.assert_allclose(sheet.extent[0][:2], moved.min(axis=1))
    grid = plot.to_pyvista(part, u, fabric)
    assert (grid.n_cells, grid.n_points) == (elements.size, vertices.size)


def test_a_basis_with_a_second_field_is_drawn_in_space(sheets):
    mesh = MeshQuad().refined(2)
    basis = Basis(mesh, ElementVector(ElementQuad1(), 3) * ElementQuad1())
    u = basis.zeros()
    displacement, temperature = basis.split_indices()
    u[displacement] = (mesh.p[0] * np.array([[0.0], [0.0], [1.0]])).T.ravel()
    u[temperature] = 20.0
    plot.fibre_strain(basis, u, Fabric(1e3))
    ((sheet, _),) = sheets
    warp, weft = sheet.panels
    np.testing.assert_allclose(warp.values, 100 * np.log(np.sqrt(2)))
    np.testing.assert_allclose(weft.values, 0.0, atol=1e-12)
    grid = plot.to_pyvista(basis, u, Fabric(1e3))
    np.testing.assert_allclose(grid.points[:, 2], mesh.p[0])
    assert grid["warp_direction"][0] == pytest.approx(np.array([1, 0, 1]) / np.sqrt(2))


def test_a_grid_has_the_deformed_mesh_and_its_fields(result):
    of_result, of_basis = plot.to_pyvista(result), plot.to_pyvista(*own(result))
    ply, u = result.ply, result.u
    for grid in (of_result, of_basis):
        assert {*grid.cell_data} == CELLS | {"slip_index"}  # the fabric has yarns
        moved = ply.mesh.p + ply.nodal(u)
        np.testing.assert_allclose(grid.points[:, :2], moved.T)
        np.testing.assert_allclose(grid["displacement"][:, :2], ply.nodal(u).T)
        strain = np.abs(ply.law_strain(u)[0]).max(axis=1)
        np.testing.assert_allclose(np.abs(grid["warp_strain"]), strain, atol=1e-15)
    assert not plot.to_pyvista(result, state=0)["displacement"].any()


def test_values_at_nodes_belong_to_the_points_of_a_grid():
    mesh = MeshTri().refined(2)
    basis = Basis(mesh, ElementVector(ElementTriP2()))
    u = basis.project(lambda x: np.array([0.1 * x[1], 0 * x[0]]))
    grid = plot.to_pyvista(basis, u, Fabric(1e3))
    nodal = fibre_fields(basis, u, Fabric(1e3), at="nodes")
    grid.point_data["strain"] = nodal.strain[1]
    assert grid.n_points == mesh.nvertices
    moved = mesh.p[0] + 0.1 * mesh.p[1]
    np.testing.assert_allclose(grid.points[:, 0], moved, atol=1e-12)
    np.testing.assert_allclose(grid["strain"], grid["weft_strain"][0])


def test_macro_elements_are_drawn_with_the_mean_strain():
    ply = Ply(MeshQuad().refined(2), Fabric(1e3, 0.5, (1, 1), (-1, 1)))
    u = 1e-3 * np.random.default_rng(1).standard_normal(ply.basis.N)
    grid = plot.to_pyvista(MacroBasis(ply.mesh), u, ply.fabric)
    np.testing.assert_allclose(grid["weft_strain"], ply.law_strain(u)[1, :, 0])
