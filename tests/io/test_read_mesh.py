"""Meshes of every kind are read with their names, or rejected by name."""

import meshio
import numpy as np
import pytest
from skfem import MeshTri

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
