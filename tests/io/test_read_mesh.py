"""Meshes of every kind are read with their names, or rejected by name."""

import meshio
import numpy as np
import pytest
from skfem import MeshTri

from skfem_textile import MeshError
from skfem_textile.io import read_mesh
from skfem_textile.mesh.splitting import split

POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])

INP = """*HEADING
*NODE
1, 0.0, 0.0
2, 1.0, 0.0
3, 2.0, 0.0
4, 0.0, 1.0
5, 1.0, 1.0
6, 2.0, 1.0
*ELEMENT, TYPE=CPS4, ELSET=PLY
1, 1, 2, 5, 4
2, 2, 3, 6, 5
*NSET, NSET=bottom
1, 2, 3
*NSET, NSET=right
3, 6
*NSET, NSET=corner
1
"""


def save(path, cells, points=POINTS, **more):
    meshio.Mesh(points, cells, **more).write(path)
    return path


def test_a_plane_in_any_position_is_read_up_to_round_off(tmp_path):
    points = POINTS + np.outer(3 + 1e-16 * np.arange(6), [0, 0, 1])
    assert read_mesh(save(tmp_path / "m.vtu", {"quad": QUADS}, points)).nelements == 2


def test_vtu_is_read(tmp_path):
    mesh = read_mesh(save(tmp_path / "m.vtu", {"quad": QUADS}))
    np.testing.assert_array_equal(mesh.t, QUADS.T)
    np.testing.assert_array_equal(mesh.p, POINTS[:, :2].T)


def test_abaqus_node_sets_become_boundaries(tmp_path):
    (tmp_path / "m.inp").write_text(INP)
    mesh = read_mesh(tmp_path / "m.inp")
    assert set(mesh.boundaries) == {"bottom", "right"}
    bottom = mesh.p[1, mesh.facets[:, mesh.boundaries["bottom"]]]
    assert bottom.shape == (2, 2)
    assert np.all(bottom == 0)


def by_gmsh(path, kind, elements, groups):
    """Elements in the groups 3, ply, and 4, patch; edges in bottom and right."""
    meshio.Mesh(
        POINTS,
        [(kind, elements), ("line", [[0, 1], [1, 2], [2, 5]])],
        cell_data={
            "gmsh:physical": [groups, [1, 1, 2]],
            "gmsh:geometrical": [[1] * len(groups), [1, 1, 2]],
        },
        field_data={
            "bottom": np.array([1, 1]),
            "right": np.array([2, 1]),
            "ply": np.array([3, 2]),
            "patch": np.array([4, 2]),
        },
    ).write(path, file_format="gmsh22")


def test_gmsh_physical_groups_become_boundaries(tmp_path):
    by_gmsh(tmp_path / "m.msh", "quad", QUADS, [3, 3])
    boundaries = read_mesh(tmp_path / "m.msh").boundaries
    assert {k: len(v) for k, v in boundaries.items()} == {"bottom": 2, "right": 1}


TRIANGLES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])


@pytest.mark.parametrize(
    ("cells", "count"),
    [
        ([("triangle", TRIANGLES[:2]), ("quad", QUADS[1:])], 10),
        (
            [
                ("quad", QUADS[:1]),
                ("triangle", TRIANGLES[2:3]),
                ("triangle", TRIANGLES[3:]),
            ],
            10,
        ),
    ],
)
def test_mixed_meshes_are_split(tmp_path, cells, count):
    mesh = read_mesh(save(tmp_path / "m.vtu", cells))
    assert mesh.nelements == count
    np.testing.assert_array_equal(mesh.p[:, :6], POINTS[:, :2].T)
    assert sum(c.shape[1] for c in mesh.cells) == sum(len(c) for _, c in cells)


def test_physical_groups_of_triangles_keep_their_names(tmp_path):
    by_gmsh(tmp_path / "m.msh", "triangle", TRIANGLES, [3, 3, 4, 4])
    mesh = split(read_mesh(tmp_path / "m.msh"))
    assert {k: len(v) for k, v in mesh.boundaries.items()} == {"bottom": 4, "right": 2}
    bottom = mesh.p[:, mesh.facets[:, mesh.boundaries["bottom"]]]
    assert np.all(bottom[1] == 0)
    assert {k: len(v) for k, v in mesh.subdomains.items()} == {"ply": 6, "patch": 6}
    assert mesh.p[0, mesh.t[:, mesh.subdomains["patch"]]].min() == 1.0


TRIANGLES_INP = INP.replace("CPS4", "CPS3").replace(
    "1, 1, 2, 5, 4\n2, 2, 3, 6, 5\n",
    "1, 1, 2, 5\n2, 1, 5, 4\n3, 2, 3, 6\n4, 2, 6, 5\n",
)


def test_triangles_are_read_unchanged(tmp_path):
    (tmp_path / "m.inp").write_text(TRIANGLES_INP)
    mesh = read_mesh(tmp_path / "m.inp")
    assert isinstance(mesh, MeshTri)
    np.testing.assert_array_equal(np.sort(mesh.t.T), np.sort(TRIANGLES))
    np.testing.assert_array_equal(mesh.p, POINTS[:, :2].T)
    boundaries = {k: mesh.facets[:, v].T.tolist() for k, v in mesh.boundaries.items()}
    assert boundaries == {"bottom": [[0, 1], [1, 2]], "right": [[2, 5]]}


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([("triangle", TRIANGLES + 1)], r"2 triangle.* refer to an undefined node"),
        ([("triangle", TRIANGLES[:2])], r"2 node.*belong to no triangle.*: 2, 5"),
    ],
)
def test_invalid_triangles_are_rejected_by_name(tmp_path, cells, message):
    path = save(tmp_path / "bad.vtu", cells)
    with pytest.raises(MeshError, match=f"bad.vtu: .*{message}"):
        read_mesh(path)


@pytest.mark.parametrize(
    ("cells", "points", "message"),
    [
        ({"triangle": [[0, 1, 4]]}, POINTS, "node.*belong to no triangle.*: 2, 3"),
        ({"triangle": [[0, 1, 9]]}, POINTS, "node numbers range from 0 to 5"),
        ({"triangle": [[0, 1, 2]]}, POINTS[:3], "inverted or degenerate"),
        (
            [("quad", QUADS[:1]), ("tetra", [[1, 2, 5, 3]])],
            POINTS,
            "triangles and four-node quadrilaterals are supported, found quad, tetra",
        ),
        ({"quad": QUADS[:, [0, 2, 1, 3]]}, POINTS, r"2 quad.* inverted or degenerate"),
        ({"quad": QUADS[:1]}, POINTS, r"2 node.*belong to no quadrilateral.*: 2, 5"),
        (
            {"quad": QUADS},
            POINTS + np.outer(np.arange(6), [0, 0, 1]),
            "plane z = const",
        ),
        ({"line": [[0, 1]]}, POINTS, "found none"),
        ({"quad": QUADS + 1}, POINTS, r"1 quad.* refer to an undefined node .*: 1"),
    ],
    ids=[
        *("unused corner", "triangle index", "flat triangle", "solids"),
        *("inverted", "unused", "space", "lines", "index"),
    ],
)
def test_invalid_meshes_are_rejected_by_name(tmp_path, cells, points, message):
    path = save(tmp_path / "bad.vtu", cells, points)
    with pytest.raises(MeshError, match=f"bad.vtu: .*{message}"):
        read_mesh(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [("no.vtu", None), ("empty.vtu", ""), ("text.msh", "hello"), ("mesh.xyzzy", "1 2")],
)
def test_unreadable_files_are_rejected_in_one_line(tmp_path, capfd, name, content):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(MeshError, match=name) as error:
        read_mesh(tmp_path / name)
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")
