"""Meshes split or cut by the user or by a ply."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np
import pytest
import shapely
from scipy.spatial import Delaunay
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
from skfem_textile.mesh.checks import check_mesh, with_edges
from skfem_textile.mesh.selection import named_nodes, with_named_nodes
from skfem_textile.mesh.splitting import CutMesh, cut, split, split_cells, was_split
from skfem_textile.scenes import strip
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.verdict import CHECKS
from tests.helpers import TRIANGLE_AND_QUAD as BOTH
from tests.helpers import distorted, random_u
from tests.helpers.intervals import without_interval


def areas(mesh):
    return shapely.area(shapely.polygons(mesh.p[:, mesh.t].T))


@pytest.mark.parametrize("turn", [False, True], ids=["anticlockwise", "clockwise"])
def test_triangles_become_three_quadrilaterals_of_a_third_each(turn):
    triangles = MeshTri().refined(2)
    if turn:
        triangles = MeshTri(triangles.p, triangles.t[::-1])
    mesh = split(triangles)
    check_mesh(mesh)
    assert mesh.nelements == 3 * triangles.nelements
    np.testing.assert_allclose(areas(mesh), 1 / mesh.nelements)
    assert np.bincount(mesh.parent).tolist() == [3] * triangles.nelements


def test_boundaries_and_subdomains_keep_their_names_and_extent():
    triangles = MeshTri().refined(3).with_defaults()
    triangles = triangles.with_subdomains({"half": lambda x: x[0] < 0.5})
    mesh = split(triangles)
    for name, axis, value in (("left", 0, 0.0), ("top", 1, 1.0)):
        facets = mesh.boundaries[name]
        assert len(facets) == 2 * len(triangles.boundaries[name])
        ends = mesh.p[:, mesh.facets[:, facets]]
        np.testing.assert_array_equal(ends[axis], value)
        assert np.ptp(ends[1 - axis]) == 1.0
    half = mesh.subdomains["half"]
    assert areas(mesh)[half].sum() == pytest.approx(0.5)
    assert mesh.p[0, mesh.t[:, half]].max() == 0.5


def test_mixed_meshes_conform():
    mesh = split_cells(*BOTH, {"right": np.array([[4, 1], [2, 4]])})
    check_mesh(mesh)
    assert mesh.parent.tolist() == [0, 0, 0, 1, 1, 1, 1]
    assert areas(mesh).sum() == pytest.approx(1.5)
    assert len(mesh.boundary_facets()) == 2 * 5
    assert len(mesh.boundaries["right"]) == 4


@pytest.mark.parametrize(("prepared", "parts"), [(lambda q: q, 4), (cut, 6)])
def test_quadrilaterals_are_split_in_four_or_via_triangles_in_six(prepared, parts):
    quads = distorted(2)
    mesh = split(prepared(quads))
    check_mesh(mesh)
    assert mesh.nelements == parts * quads.nelements
    assert areas(mesh).sum() == pytest.approx(areas(quads).sum())
    assert set(mesh.boundaries) == {"left", "right", "bottom", "top"}


def test_squares_are_cut_along_one_diagonal_whatever_the_round_off():
    """From the second node to the last."""
    c, s = np.cos(0.7), np.sin(0.7)
    squares = MeshQuad().refined(2)
    squares = replace(squares, doflocs=np.array([[c, -s], [s, c]]) @ squares.p)
    triangles = cut(squares)
    for k in (1, 3):
        corner = squares.t[k, triangles.parent]
        assert (triangles.t == corner).any(axis=0).all()


def test_a_quadrilateral_that_is_not_convex_is_cut_in_two_first():
    p = np.array([[0.0, 1, 0.4, 0, 2, 2], [0.0, 0, 0.4, 1, 0, 1]])
    t = np.array([[0, 1, 2, 3], [1, 4, 5, 2]]).T
    quads = MeshQuad(p, t).with_subdomains({"dart": np.array([0])})
    quads = quads.with_boundaries({"left": lambda x: x[0] == 0})
    mesh = split(quads)
    check_mesh(mesh)
    assert mesh.nelements == 2 * 3 + 4
    assert areas(mesh).sum() == pytest.approx(areas(quads).sum())
    assert areas(mesh)[mesh.subdomains["dart"]].sum() == pytest.approx(0.4)
    assert len(mesh.subdomains["dart"]) == 6
    assert len(mesh.boundaries["left"]) == 2


def test_a_mesh_that_was_refined_is_no_longer_split(tmp_path):
    held = {"all": Condition(lambda X: X[0] >= 0, lambda X, t: 0 * X)}
    ply = Ply(split(distorted(1)).refined(), Fabric(), OnePoint())
    write_fields(LoadStepper(ply, held, steps=1).run(), tmp_path)
    assert not list(tmp_path.glob("own*"))


def test_a_changed_split_mesh_is_not_taken_for_macro_elements():
    mesh = split(MeshTri().refined(1))
    order = np.random.default_rng(1).permutation(mesh.nelements)
    sorted_too = replace(mesh, t=mesh.t[:, order], parent=mesh.parent[order])
    assert was_split(sorted_too)
    Ply(sorted_too, Fabric(), Macro())
    nodes = np.random.default_rng(2).permutation(mesh.p.shape[1])
    for changed in (
        mesh.refined(),
        mesh.restrict(np.arange(4)),
        replace(mesh, t=mesh.t[:, order]),
        replace(mesh, doflocs=mesh.p[:, np.argsort(nodes)], t=nodes[mesh.t]),
        replace(mesh, parent=mesh.parent[::-1]),
        replace(mesh, parent=mesh.parent[:-1]),
        replace(mesh, parent=mesh.parent - 1),
        replace(mesh, cells=()),
    ):
        assert not was_split(changed)
        with pytest.raises(MeshError, match="was refined, restricted or renumbered"):
            Ply(changed, Fabric(), Macro())


def test_inner_edges_keep_their_names():
    triangles = MeshTri().refined(1)
    inner = np.setdiff1d(np.arange(triangles.nfacets), triangles.boundary_facets())
    mesh = split(triangles.with_boundaries({"inner": inner}))
    middles = mesh.p[:, mesh.facets[:, mesh.boundaries["inner"]]].mean(axis=1)
    assert len(mesh.boundaries["inner"]) == 2 * len(inner)
    ends = triangles.p[:, triangles.facets[:, inner]]
    for i in (0, 1):
        quarter = 0.75 * ends[:, i] + 0.25 * ends[:, 1 - i]
        np.testing.assert_allclose(middles[:, i::2], quarter)


def test_splitting_cutting_and_moving_preserve_named_nodes():
    quads = with_named_nodes(distorted(1), {"some": np.array([2, 5])})
    corners = quads.p[:, [2, 5]]
    named = with_edges(quads)
    remaining = (quads.t == 5).any(axis=0) & ~(quads.t == 2).any(axis=0)
    part = named.restrict(np.flatnonzero(remaining))
    for mesh in (split(quads), cut(quads), split(cut(quads)), quads.refined(), named):
        np.testing.assert_array_equal(mesh.p[:, named_nodes(mesh)["some"]], corners)
    (left,) = part.p[:, named_nodes(part)["some"]].T
    np.testing.assert_array_equal(left, corners[:, 1])
    moved = split(quads).translated((1.0, 2.0))
    positions = moved.p[:, named_nodes(moved)["some"]]
    np.testing.assert_allclose(positions, corners + np.array([[1.0], [2.0]]))


def delaunay(quads):
    """The Delaunay triangulation of the nodes of a mesh."""
    mesh = MeshTri(quads.p, Delaunay(quads.p.T).simplices.T)
    return MeshTri(mesh.p, mesh.t[:, areas(mesh) > 1e-9]).with_defaults()


def test_a_strip_of_triangles_does_not_lock():
    """Triangles do not follow the fibres, and yet the load of the strip is small."""
    E = 1e6
    mesh = split(delaunay(rectangle(40, 60, (10, 15), "irregular", seed=2)))
    scene = strip(mesh)
    ply = Ply(mesh, Fabric(E), OnePoint(1e-4 * E))
    summary = scene.summary(
        without_interval(LoadStepper(ply, scene.conditions, 4).run())
    )
    assert summary["stable"]
    assert abs(summary["reaction_x"]) < 1e-5 * E
    assert summary["max_fibre_strain"] < 1e-4
    assert summary["displacement_error_rms"] < 0.01


# A ply splits or cuts the user's mesh, and averages fields on it


FABRIC = Fabric(100.0, 0.5, (1, 0.2), (-0.1, 1))
QUADS = distorted(1)
TRIANGLES = rectangle(3, 2, (3, 2), "delaunay", 0.2)

#: Two quadrilaterals, of which the second is not convex.
DART = MeshQuad(
    np.array([[0.0, 2.0, 2.0, 0.0, 4.0, 2.8], [0.0, 0.0, 2.0, 2.0, 0.0, 0.8]]),
    np.array([[0, 1, 2, 3], [1, 4, 5, 2]]).T,
)


MESHES = {"quadrilaterals": QUADS, "triangles": TRIANGLES, "not convex": DART}
every_mesh = pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
every_formulation = pytest.mark.parametrize(
    "formulation", [Macro(), OnePoint(), Quadratic()], ids=repr
)


def assert_same_ply(ply, other):
    np.testing.assert_array_equal(ply.mesh.p, other.mesh.p)
    np.testing.assert_array_equal(ply.mesh.t, other.mesh.t)
    u = random_u(ply, 1)
    assert ply.energies(u) == other.energies(u)
    np.testing.assert_array_equal(ply.residual(u), other.residual(u))
    assert (ply.tangent(u) != other.tangent(u)).nnz == 0


def in_a_file(mesh):
    """The mesh that `read_mesh` returns for a mesh or points and cells."""
    with TemporaryDirectory() as folder:
        file = Path(folder, "m.vtu")
        if isinstance(mesh, tuple):
            kinds = {3: "triangle", 4: "quad"}
            points = np.pad(mesh[0], ((0, 1), (0, 0))).T
            meshio.Mesh(points, [(kinds[len(t)], t.T) for t in mesh[1]]).write(file)
        else:
            mesh.save(file)
        return read_mesh(file)


SAVED = [rectangle(3, 2, (3, 2), kind, 0.2) for kind in ("irregular", "delaunay")]

# Given meshes, a formulation, and the mesh on which the ply works.
USED = {
    **{f"macro {i}": (m, Macro(), split(m)) for i, m in enumerate([*MESHES.values()])},
    **{f"file {i}": (in_a_file(m), Macro(), split(m)) for i, m in enumerate(SAVED)},
    "two kinds": (in_a_file(BOTH), Macro(), split_cells(*BOTH)),
    "one point": (TRIANGLES, OnePoint(1.0), split(TRIANGLES)),
    "full": (TRIANGLES, Full(), split(TRIANGLES)),
    "quadratic": (DART, Quadratic(), cut(DART)),
    "full, as it is": (QUADS, Full(), QUADS),
    "quadratic, as it is": (TRIANGLES, Quadratic(), TRIANGLES),
}


@pytest.mark.parametrize(("mesh", "formulation", "used"), USED.values(), ids=USED)
def test_a_ply_splits_or_cuts_the_mesh_as_its_formulation_needs(
    mesh, formulation, used
):
    ply = Ply(mesh, FABRIC, formulation)
    assert_same_ply(ply, Ply(used, FABRIC, formulation))
    assert Ply(used, FABRIC, formulation).mesh is used


@pytest.mark.parametrize("sides", [(1.0, 1.0), (0.1, 1.0), (0.2, 30.0)])
def test_small_plies_and_narrow_strips_are_not_taken_for_metres(tmp_path, sides):
    MeshQuad().refined(1).scaled(sides).save(tmp_path / "m.vtu")
    assert read_mesh(tmp_path / "m.vtu").nelements == 4


@pytest.mark.parametrize("formulation", [Macro(), Quadratic()], ids=repr)
def test_nodes_and_names_of_the_users_mesh_are_kept(formulation):
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
    """Centroids of polygons, shape (2, n)."""
    centroids = shapely.centroid(shapely.polygons(points[:, cells].T))
    return shapely.get_coordinates(centroids).T


def assert_averaged(ply, cells):
    """Constants and means of linear fields are exact, on any leading axes."""
    n = sum(cell.shape[1] for cell in cells)
    parts = polygon_centroids(ply.mesh.p, ply.mesh.t)
    linear = np.array([[1.0 + 0 * parts[0], 2 * parts[0] - 3 * parts[1]]])
    back = ply.on_users_elements(linear)
    assert back.shape == (1, 2, n)
    np.testing.assert_allclose(back[0, 0], 1.0, rtol=1e-15)
    points = ply.mesh.p
    x, y = np.hstack([polygon_centroids(points, cell) for cell in cells])
    np.testing.assert_allclose(back[0, 1], 2 * x - 3 * y, atol=1e-14)


@every_mesh
@every_formulation
def test_fields_are_averaged_on_the_users_elements(mesh, formulation):
    assert_averaged(Ply(mesh, FABRIC, formulation), [mesh.t])


def test_fields_are_averaged_on_elements_that_were_split_before():
    both = in_a_file(BOTH)
    assert_averaged(Ply(both, FABRIC), BOTH[1])
    for mesh in (split(DART), replace(split(DART), doflocs=2 * split(DART).p)):
        assert_averaged(Ply(mesh, FABRIC), [DART.t])


FILED = {
    "two kinds": (split_cells(*BOTH), *BOTH),
    "not convex": (DART, DART.p, [DART.t]),
    "triangles": (TRIANGLES, TRIANGLES.p, [TRIANGLES.t]),
}


@pytest.mark.parametrize(("mesh", "points", "cells"), FILED.values(), ids=FILED)
def test_files_contain_fields_averaged_on_the_users_elements(
    mesh, points, cells, tmp_path
):
    held = {"all": Condition(lambda X: X[0] >= 0, lambda X, t: 0.1 * t * X**2)}
    ply = Ply(mesh, Fabric(10.0, 1.0), Macro())
    write_fields(LoadStepper(ply, held, 1, warn_only=CHECKS).run(), tmp_path)
    fields = meshio.read(tmp_path / "own_step_0001.vtu")
    parts = meshio.read(tmp_path / "step_0001.vtu")
    np.testing.assert_array_equal(fields.points[:, :2], points.T)
    np.testing.assert_allclose(
        fields.point_data["displacement"][:, :2], 0.1 * points.T**2
    )
    for block, t in zip(fields.cells, cells, strict=True):
        np.testing.assert_array_equal(block.data, t.T)
    assert len(parts.cells_dict["quad"]) == ply.mesh.nelements
    for name in ("shear_angle", "warp_strain"):
        values, means = parts.cell_data[name][0], np.hstack(fields.cell_data[name])
        expected = ply.on_users_elements(values)
        np.testing.assert_allclose(means, expected, rtol=1e-12)
    directions = np.concatenate(fields.cell_data["weft_direction"])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert (tmp_path / "own_steps.pvd").exists()


@every_mesh
@every_formulation
def test_values_per_element_refer_to_the_users_elements(mesh, formulation):
    """Also where quadrilaterals that are not convex are cut first."""
    n = mesh.nelements
    E, G = np.linspace(100, 200, n), np.linspace(0.5, 1.0, n)
    angle = np.linspace(0, 0.5, n)
    warp = np.array([np.cos(angle), np.sin(angle)])
    ply = Ply(mesh, Fabric(E, G, warp), formulation)
    part = ply.parent
    per_part = Fabric(E[part], G[part], warp[:, part])
    assert_same_ply(ply, Ply(ply.mesh, per_part, formulation))
    for one in range(n):  # the values apply to the element for which they were given
        x, y = np.array([polygon_centroids(ply.mesh.p, ply.mesh.t[:, part == one])])[0]
        corners = mesh.p[:, mesh.t[:, one]]
        assert corners[0].min() < x.min() <= x.max() < corners[0].max()
        assert corners[1].min() < y.min() <= y.max() < corners[1].max()


@every_formulation
def test_further_terms_keep_mesh_and_fabric(formulation):
    G = np.linspace(0.5, 1.0, DART.nelements)
    ply = Ply(DART, Fabric(100.0, G), formulation)
    loaded = ply.with_terms(BodyForce((0.0, -1.0)))
    assert loaded is not ply
    assert loaded.mesh is ply.mesh
    u = random_u(ply, 2)
    assert loaded.energies(u)["shear"] == ply.energies(u)["shear"]
    assert [term.role for term in loaded.further_terms] == ["load"]
    assert ply.further_terms == ()
    np.testing.assert_array_equal(loaded.parent, ply.parent)


def test_a_cut_and_changed_mesh_has_new_elements():
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
