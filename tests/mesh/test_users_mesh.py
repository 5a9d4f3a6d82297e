"""A ply takes the user's mesh, splits or cuts it inside, and gives fields back."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    MeshError,
    OnePoint,
    Ply,
    Quadratic,
)
from skfem_textile.io import read_mesh, write_fields
from skfem_textile.mesh.selection import with_named_nodes
from skfem_textile.mesh.splitting import CutMesh, SplitMesh, cut, split, split_cells
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import TRIANGLE_AND_QUAD, distorted, wobble

FABRIC = Fabric(100.0, 0.5, (1, 0.2), (-0.1, 1))
QUADS = distorted(1)
TRIANGLES = rectangle(3, 2, (3, 2), "delaunay", 0.2)

#: Two quadrilaterals, of which the second is not convex.
DART = MeshQuad(
    np.array([[0.0, 2.0, 2.0, 0.0, 4.0, 2.8], [0.0, 0.0, 2.0, 2.0, 0.0, 0.8]]),
    np.array([[0, 1, 2, 3], [1, 4, 5, 2]]).T,
)


def mixed(folder):
    """What `read_mesh` makes of a file with a triangle and a quadrilateral."""
    points, cells = TRIANGLE_AND_QUAD
    kinds = {3: "triangle", 4: "quad"}
    blocks = [(kinds[len(cell)], cell.T) for cell in cells]
    meshio.Mesh(np.pad(points, ((0, 1), (0, 0))).T, blocks).write(folder / "m.vtu")
    return read_mesh(folder / "m.vtu")


def assert_same_ply(ply, other):
    np.testing.assert_array_equal(ply.mesh.p, other.mesh.p)
    np.testing.assert_array_equal(ply.mesh.t, other.mesh.t)
    u = wobble(ply, 1)
    assert ply.energies(u) == other.energies(u)
    np.testing.assert_array_equal(ply.residual(u), other.residual(u))
    assert (ply.tangent(u) != other.tangent(u)).nnz == 0


#: A bias-extension specimen of 100 mm × 200 mm whose file is in metres.
IN_METRES = rectangle(100, 200, (3, 6), "irregular", 0.2).scaled(1e-3)


def test_a_file_in_metres_is_refused(tmp_path):
    points = np.pad(IN_METRES.p, ((0, 1), (0, 0))).T
    meshio.Mesh(points, {"quad": IN_METRES.t.T}).write(tmp_path / "m.vtu")
    with pytest.raises(MeshError, match=r"m\.vtu: the mesh is 0\.1 mm wide .* metres"):
        read_mesh(tmp_path / "m.vtu")


@pytest.mark.parametrize("sides", [(1.0, 1.0), (0.1, 1.0), (0.2, 30.0)])
def test_small_plies_and_narrow_strips_are_not_taken_for_metres(tmp_path, sides):
    MeshQuad().refined(1).scaled(sides).save(tmp_path / "m.vtu")
    assert read_mesh(tmp_path / "m.vtu").nelements == 4


@pytest.mark.parametrize("mesh", [QUADS, TRIANGLES, DART])
def test_a_ply_is_one_of_macro_elements_on_the_split_mesh(mesh):
    assert_same_ply(Ply(mesh, FABRIC), Ply(split(mesh), FABRIC, Macro()))


def test_a_ply_of_a_file_of_triangles_and_quadrilaterals_is_one_too(tmp_path):
    explicit = Ply(split_cells(*TRIANGLE_AND_QUAD), FABRIC, Macro())
    assert_same_ply(Ply(mixed(tmp_path), FABRIC), explicit)


@pytest.mark.parametrize("kind", ["irregular", "delaunay"])
def test_a_file_is_split_as_the_mesh_that_was_saved(tmp_path, kind):
    saved = rectangle(3, 2, (3, 2), kind, 0.2)
    saved.save(tmp_path / "m.vtu")
    read = read_mesh(tmp_path / "m.vtu")
    assert isinstance(read, MeshTri if kind == "delaunay" else MeshQuad)
    assert_same_ply(Ply(read, FABRIC), Ply(split(saved), FABRIC, Macro()))


@pytest.mark.parametrize("formulation", [OnePoint(1.0), Full()], ids=repr)
def test_other_formulations_split_triangles_alone(formulation):
    explicit = Ply(split(TRIANGLES), FABRIC, formulation)
    assert_same_ply(Ply(TRIANGLES, FABRIC, formulation), explicit)
    assert Ply(QUADS, FABRIC, formulation).mesh is QUADS


def test_quadratic_triangles_are_cut_from_quadrilaterals():
    explicit = Ply(cut(DART), FABRIC, Quadratic())
    assert_same_ply(Ply(DART, FABRIC, Quadratic()), explicit)
    assert Ply(TRIANGLES, FABRIC, Quadratic()).mesh is TRIANGLES


def test_a_mesh_that_was_split_or_cut_is_taken_as_it_is():
    for mesh, formulation in ((split(QUADS), Macro()), (cut(DART), Quadratic())):
        assert Ply(mesh, FABRIC, formulation).mesh is mesh


@pytest.mark.parametrize("formulation", [Macro(), Quadratic()], ids=repr)
def test_nodes_and_names_of_the_users_mesh_stay(formulation):
    quads = QUADS.with_subdomains({"part": np.array([1, 4])})
    mesh = with_named_nodes(quads, {"pin": np.array([5])})
    ply = Ply(mesh, FABRIC, formulation)
    n = mesh.p.shape[1]
    np.testing.assert_array_equal(ply.nodes[:, :n], mesh.p)
    assert ply.mesh.named_nodes["pin"] == [5]
    assert set(np.unique(ply.parent[ply.mesh.subdomains["part"]])) == {1, 4}
    at = {name: Condition(name).nodes(name, ply.basis) for name in mesh.boundaries}
    for axis, side, name in ((0, 0, "left"), (0, 3, "right"), (1, 2, "top")):
        expected = np.flatnonzero(ply.nodes[axis] == side)
        np.testing.assert_array_equal(np.sort(at[name]), expected)


def test_a_condition_moves_the_users_nodes_by_their_numbers():
    numbers = np.array([5, 6])
    conditions = {
        "clamp": Condition("bottom"),
        "moved": Condition(numbers, (0.02, 0.03)),
    }
    result = LoadStepper(Ply(QUADS, FABRIC), conditions, 1).run()
    moved = result.ply.nodal(result.u)[:, numbers]
    np.testing.assert_allclose(moved, [[0.02, 0.02], [0.03, 0.03]], rtol=1e-12)
    held = result.ply.nodes[1] == 0
    assert held.sum() > (QUADS.p[1] == 0).sum()
    assert np.abs(result.ply.nodal(result.u)[:, held]).max() == 0


def polygon_centroids(points, cells):
    """Centroids of polygons, by the formula of Bourke: shape (2, n)."""
    x, y = points[:, cells]
    x2, y2 = np.roll(x, -1, axis=0), np.roll(y, -1, axis=0)
    cross = x * y2 - x2 * y
    moments = np.array([((x + x2) * cross).sum(0), ((y + y2) * cross).sum(0)])
    return moments / (3 * cross.sum(axis=0))


def assert_given_back(ply, cells):
    """Constants and the means of linear fields are exact, on any leading axes."""
    n = sum(cell.shape[1] for cell in cells)
    parts = polygon_centroids(ply.mesh.p, ply.mesh.t)
    linear = np.array([[1.0 + 0 * parts[0], 2 * parts[0] - 3 * parts[1]]])
    back = ply.on_users_elements(linear)
    assert back.shape == (1, 2, n)
    np.testing.assert_allclose(back[0, 0], 1.0, rtol=1e-15)
    points = ply.mesh.p
    x, y = np.hstack([polygon_centroids(points, cell) for cell in cells])
    np.testing.assert_allclose(back[0, 1], 2 * x - 3 * y, atol=1e-14)


@pytest.mark.parametrize("mesh", [QUADS, TRIANGLES, DART])
@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic()], ids=repr)
def test_fields_are_brought_back_to_the_users_elements(mesh, formulation):
    assert_given_back(Ply(mesh, FABRIC, formulation), [mesh.t])


def test_fields_are_brought_back_to_elements_of_two_kinds(tmp_path):
    assert_given_back(Ply(mixed(tmp_path), FABRIC), TRIANGLE_AND_QUAD[1])


def test_a_mesh_that_was_split_remembers_the_users_elements():
    for mesh in (split(DART), replace(split(DART), doflocs=2 * split(DART).p)):
        assert_given_back(Ply(mesh, FABRIC), [DART.t])


def test_a_field_of_another_mesh_is_not_brought_back():
    ply = Ply(QUADS, FABRIC)
    for shape in ((6,), (24, 1), ()):
        with pytest.raises(ValueError, match=r"each of the 24 elements of ply\.mesh"):
            ply.on_users_elements(np.zeros(shape))


@pytest.mark.parametrize("mesh", [QUADS, TRIANGLES, DART])
@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic()], ids=repr)
def test_values_per_element_are_those_of_the_users_elements(mesh, formulation):
    """Also where quadrilaterals that are not convex are cut first."""
    n = mesh.nelements
    E, G = np.linspace(100, 200, n), np.linspace(0.5, 1.0, n)
    angle = np.linspace(0, 0.5, n)
    warp = np.array([np.cos(angle), np.sin(angle)])
    ply = Ply(mesh, Fabric(E, G, warp), formulation)
    part = ply.parent
    per_part = Fabric(E[part], G[part], warp[:, part])
    assert_same_ply(ply, Ply(ply.mesh, per_part, formulation))
    for one in range(n):  # the values reach the element in which they were given
        x, y = np.array([polygon_centroids(ply.mesh.p, ply.mesh.t[:, part == one])])[0]
        corners = mesh.p[:, mesh.t[:, one]]
        assert corners[0].min() < x.min() <= x.max() < corners[0].max()
        assert corners[1].min() < y.min() <= y.max() < corners[1].max()


@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic()], ids=repr)
def test_further_terms_keep_mesh_and_fabric(formulation):
    G = np.linspace(0.5, 1.0, DART.nelements)
    ply = Ply(DART, Fabric(100.0, G), formulation)
    loaded = ply.with_terms(BodyForce((0.0, -1.0)))
    assert loaded is not ply
    assert loaded.mesh is ply.mesh
    u = wobble(ply, 2)
    assert loaded.energies(u)["shear"] == ply.energies(u)["shear"]
    assert [term.role for term in loaded.further_terms] == ["load"]
    assert ply.further_terms == ()
    np.testing.assert_array_equal(loaded.parent, ply.parent)


def test_a_node_in_the_middle_of_an_edge_is_refused():
    """Beside a split edge it would pass for a cut."""
    points = np.array([[0, 2, 2, 0, 4, 4, 2, 4], [0, 0, 2, 2, 0, 1, 1, 2.0]])
    cells = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [6, 5, 7, 2]]).T
    with pytest.raises(MeshError, match=r"1 node\(s\) lie on an edge .*: 6"):
        Ply(MeshQuad(points, cells), FABRIC)


def test_a_mesh_that_was_cut_and_changed_has_elements_of_its_own():
    mesh = cut(QUADS)
    assert isinstance(mesh, CutMesh)
    assert Ply(mesh, FABRIC, Quadratic()).on_users_elements(np.ones(12)).shape == (6,)
    nodes = np.random.default_rng(1).permutation(mesh.p.shape[1])
    for changed in (
        mesh.refined(),
        mesh.restrict(np.arange(5)),
        replace(mesh, doflocs=mesh.p[:, np.argsort(nodes)], t=nodes[mesh.t]),
        replace(mesh, parent=mesh.parent[::-1]),
        replace(mesh, parent=mesh.parent + 1),
    ):
        ply = Ply(changed, FABRIC, Quadratic())
        n = changed.nelements
        np.testing.assert_array_equal(ply.parent, np.arange(n))
        assert ply.on_users_elements(np.ones(n)).shape == (n,)


def test_files_have_the_users_elements(tmp_path):
    held = {"all": Condition(lambda X: X[0] >= 0, lambda X, t: 0.1 * t * X)}
    for mesh, kind in ((DART, "quad"), (TRIANGLES, "triangle")):
        write_fields(LoadStepper(Ply(mesh, FABRIC), held, 1).run(), tmp_path)
        own = meshio.read(tmp_path / "own_step_0001.vtu")
        np.testing.assert_array_equal(own.cells_dict[kind], mesh.t.T)
        np.testing.assert_array_equal(own.points[:, :2], mesh.p.T)
        parts = meshio.read(tmp_path / "step_0001.vtu")
        assert isinstance(split(mesh), SplitMesh)
        assert len(parts.cells_dict["quad"]) == split(mesh).nelements
