"""Meshes and names in files, and data that are ignored."""

import logging
from pathlib import Path

import meshio
import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import Fabric, Ply
from skfem_textile.io import read_mesh
from skfem_textile.mesh.selection import named_nodes
from skfem_textile.scenes import bias_extension
from tests.helpers.decks import POINTS, QUADS, TRIANGLES, sets, with_lines

MESHES = Path(__file__).parent / "meshes"
BY_GMSH = sorted(path.name for path in MESHES.iterdir() if path.suffix != ".py")


@pytest.mark.parametrize("of_a_ply", [False, True])
@pytest.mark.parametrize("name", BY_GMSH)
def test_files_of_gmsh_have_every_group_once(name, of_a_ply):
    """Groups of ``meshes/make.py`` overlap, and one is between two surfaces."""
    mesh = read_mesh(MESHES / name)
    if of_a_ply:
        mesh = Ply(mesh, Fabric()).mesh
    two_sides = "two_sides" if name.endswith(".inp") else "two sides"
    x = mesh.p
    for boundary, length, on in (
        ("bottom", 2.0, lambda x, y: y == 0),
        ("inner", 2.0, lambda x, y: abs(x - 1) < 1e-12),
        (two_sides, 3.0, lambda x, y: (x == 0) | (y == 0) & (x <= 1)),
    ):
        edges = mesh.boundaries[boundary]
        assert len(np.unique(edges)) == len(edges)
        a, b = x[:, mesh.facets[:, edges]].transpose(1, 0, 2)
        assert np.linalg.norm(a - b, axis=0).sum() == pytest.approx(length)
        assert on(*a).all()
        assert on(*b).all()
    centre = x[:, mesh.t].mean(axis=1)
    half = np.flatnonzero(centre[0] < 1)
    np.testing.assert_array_equal(np.sort(mesh.subdomains["half"]), half)
    np.testing.assert_array_equal(
        np.sort(mesh.subdomains["ply"]), np.arange(mesh.nelements)
    )
    if not name.endswith(".inp"):  # Gmsh writes no points there
        (corner,) = named_nodes(mesh)["corner"]
        assert x[:, corner].tolist() == [2.0, 0.0]


CELLS = {"quads": ("quad", QUADS), "triangles": ("triangle", TRIANGLES)}


@pytest.mark.parametrize("kind", CELLS)
def test_cells_in_a_plane_are_read_unchanged(tmp_path, kind):
    """Up to round-off of the plane, which is anywhere."""
    name, cells = CELLS[kind]
    points = POINTS + np.outer(3 + 1e-16 * np.arange(6), [0, 0, 1])
    meshio.Mesh(points, {name: cells}).write(tmp_path / "m.vtu")
    mesh = read_mesh(tmp_path / "m.vtu")
    assert type(mesh) is {"quad": MeshQuad, "triangle": MeshTri}[name]
    np.testing.assert_array_equal(np.sort(mesh.t.T), np.sort(cells))
    np.testing.assert_array_equal(mesh.p, POINTS[:, :2].T)


@pytest.mark.parametrize(
    "cells",
    [
        [("triangle", TRIANGLES[:2]), ("quad", QUADS[1:])],
        [("quad", QUADS[:1]), *(("triangle", TRIANGLES[i : i + 1]) for i in (2, 3))],
    ],
)
def test_mixed_meshes_are_split(tmp_path, cells):
    meshio.Mesh(POINTS, cells).write(tmp_path / "m.vtu")
    mesh = read_mesh(tmp_path / "m.vtu")
    assert mesh.nelements == 2 * 3 + 4
    np.testing.assert_array_equal(mesh.p[:, :6], POINTS[:, :2].T)
    assert sum(c.shape[1] for c in mesh.cells) == sum(len(c) for _, c in cells)


@pytest.mark.parametrize("kind", CELLS)
def test_a_group_of_inner_edges_is_kept(tmp_path, kind):
    mesh = read_mesh(
        with_lines(tmp_path / "m.msh", POINTS, *CELLS[kind], [[1, 4], [1, 2]])
    )
    edges = mesh.p[:, mesh.facets[:, mesh.boundaries["clamp"]]]
    length = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=0)
    assert length.sum() == pytest.approx(2.0)
    assert ((edges[0] == 1).all(axis=0) | (edges[1] == 0).all(axis=0)).all()


def inp(path, more="", **types):
    path.write_text(sets(**types) + more)
    return path


@pytest.mark.parametrize(
    ("quad", "triangle"),
    [("M3D4", "M3D3"), ("M3D4R", "M3D3"), ("S4", "S3"), ("S4R", "S3")],
)
def test_shells_and_membranes_of_abaqus_are_read(tmp_path, quad, triangle):
    mesh = read_mesh(inp(tmp_path / "m.inp", quad=quad, triangle=triangle))
    assert mesh.nelements == 3 * 4 + 2 * 3
    sizes = {name: len(parts) for name, parts in mesh.subdomains.items()}
    assert sizes == {"upper": 6, "mixed": 7}
    upper = mesh.p[:, mesh.t[:, mesh.subdomains["upper"]]]
    assert upper.reshape(2, -1).min(axis=1).tolist() == [1, 1]


def test_node_sets_without_edges_are_named_nodes(tmp_path):
    mesh = read_mesh(inp(tmp_path / "m.inp"))
    assert {k: len(v) for k, v in mesh.boundaries.items()} == {
        "bottom": 4,
        "both": 2,
        "all": 16,
    }
    named = {k: v.tolist() for k, v in named_nodes(mesh).items()}
    assert named == {"point": [4], "both": [4], "row": [3, 4, 5], "all": [4]}


def test_the_rotation_of_a_scene_preserves_names(tmp_path):
    mesh = read_mesh(inp(tmp_path / "m.inp"))
    turned = bias_extension(mesh.scaled((25.0, 50.0))).rotated(0.3)
    assert named_nodes(turned.mesh)["point"].tolist() == [4]


def test_ignored_data_are_named_in_one_warning(tmp_path, caplog):
    more = (
        "*ORIENTATION, NAME=o\n1., 0., 0., 0., 1., 0.\n*Distribution, name=d\n, 1.\n"
        "** a comment\n*MATERIAL, NAME=a\x07b\n*Orientation, name=p\n1., 0., 0.\n"
    )
    with caplog.at_level(logging.WARNING):
        read_mesh(inp(tmp_path / "a\x1bb.inp", more))
    (record,) = caplog.records
    assert record.name.startswith("skfem_textile")
    end = r"a\x1bb.inp: ignored: *ORIENTATION, *DISTRIBUTION, *MATERIAL"
    assert record.getMessage().endswith(end)


def test_ignored_fields_are_named(tmp_path, caplog):
    """A field of the whole file, such as the time in ParaView, is not a group."""
    fields = {"thickness": [np.ones(2)], "warp": [np.ones((2, 3))]}
    meshio.Mesh(
        POINTS, {"quad": QUADS}, point_data={"u": np.zeros(6)}, cell_data=fields
    ).write(tmp_path / "m.vtu", binary=False)
    text = (tmp_path / "m.vtu").read_text()
    time = (
        '<FieldData><DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" '
        'format="ascii">0.5</DataArray></FieldData><Piece'
    )
    (tmp_path / "m.vtu").write_text(text.replace("<Piece", time, 1))
    with caplog.at_level(logging.WARNING):
        read_mesh(tmp_path / "m.vtu")
    (record,) = caplog.records
    message = record.getMessage()
    assert message.partition("ignored: ")[2] == "u, thickness, warp, TimeValue"


def test_a_file_read_completely_causes_no_warning(tmp_path, caplog):
    read_mesh(inp(tmp_path / "m.inp"))
    for name in BY_GMSH:
        read_mesh(MESHES / name)
    assert not caplog.records


@pytest.mark.parametrize("suffix", ["vtu", "vtk"])
@pytest.mark.parametrize(
    "plain", [MeshQuad().refined(1), MeshTri().refined(1).oriented()]
)
def test_names_written_by_scikit_fem_are_kept(tmp_path, plain, suffix):
    """Edges are counted in the order of the file, which may descend."""
    inner = np.setdiff1d(np.arange(plain.nfacets), plain.boundary_facets())
    plain = plain.with_boundaries({"in:ner": inner, "some": inner[:3]}).with_defaults()
    plain = plain.with_subdomains({"one": [0]})
    plain.save(str(tmp_path / f"m.{suffix}"))
    mesh = read_mesh(tmp_path / f"m.{suffix}")
    assert set(mesh.boundaries) == set(plain.boundaries)
    for name, edges in plain.boundaries.items():
        read, expected = (
            np.unique(np.sort(m.facets[:, of], axis=0), axis=1)
            for m, of in ((mesh, mesh.boundaries[name]), (plain, edges))
        )
        np.testing.assert_array_equal(read, expected)
    assert mesh.subdomains["one"].tolist() == [0]
