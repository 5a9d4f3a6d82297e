"""Meshes of common exporters are read as they mean, and what is left out is named."""

import numpy as np
import pytest

from skfem_textile import MeshError
from skfem_textile.io import read_directions, read_fabric, read_mesh, read_surface
from skfem_textile.io.abaqus import content_of
from skfem_textile.mesh.selection import named_nodes
from tests.helpers.decks import CELLS, NODES, PART, PLY, XY
from tests.helpers.decks import mesh_deck as deck

INSTANCE = "*Instance, name=P-1, part=P"


def names(mesh):
    return {name: members.tolist() for name, members in mesh.subdomains.items()}


def msh(folder, groups):
    edges = [(1, 1, 1, 2), (1, 1, 2, 3), (1, 2, 7, 8), (1, 2, 8, 9)]
    rows = [*edges, *((3, 5, *quad) for quad in CELLS)]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    lines += ["$PhysicalNames", str(len(groups)), *groups, "$EndPhysicalNames"]
    lines += ["$Nodes", "9", *(f"{i} {x} {y} 0" for i, (x, y) in enumerate(XY, 1))]
    lines += ["$EndNodes", "$Elements", str(len(rows))]
    for i, (kind, tag, *nodes) in enumerate(rows, 1):
        lines.append(" ".join(map(str, [i, kind, 2, tag, tag, *nodes])))
    path = folder / "m.msh"
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return path


def test_unnamed_and_empty_groups_of_gmsh_are_named_in_one_line(tmp_path, caplog):
    path = msh(tmp_path, ['1 1 "bottom"', '2 5 "cloth"', '0 3 "%ü;"'])
    mesh = read_mesh(path)
    assert {k: len(v) for k, v in mesh.boundaries.items()} == {"bottom": 2}
    assert caplog.messages == [
        f"{path}: ignored: unnamed physical group 2 (2 edge(s)), empty group '%ü;'"
    ]


def test_unnamed_groups_of_gmsh_4_are_named(tmp_path, caplog, request):
    content = (request.path.parent / "meshes" / "quads41.msh").read_text()
    head, _, rest = content.partition("$PhysicalNames")
    path = tmp_path / "m.msh"
    path.write_text(head + rest.partition("$EndPhysicalNames\n")[2])
    mesh = read_mesh(path)
    assert not mesh.boundaries
    assert not mesh.subdomains
    assert len(caplog.messages) == 1
    assert "unnamed physical group" in caplog.messages[0]


def test_nodes_of_several_blocks_and_reference_points(tmp_path, caplog):
    lines = ["*Node", *NODES[:5], "*Node", *NODES[5:], *PLY, "*Node", "99, 0, 0, 50"]
    path = deck(tmp_path, *lines, "*Nset, nset=Ref", "99,")
    mesh = read_mesh(path)
    assert np.array_equal(mesh.p.T, XY)
    assert caplog.messages == [
        f"{path}: ignored: node 99 (of no element), *NSET 'Ref' (nodes of no element)"
    ]


def test_data_lines_and_keywords_in_other_files_are_read(tmp_path):
    """Relative to the deck; marks of the byte order are skipped."""
    lines = {"nœuds.txt": NODES, "elements.txt": PLY[1:]}
    lines["sets.inp"] = ["*Elset, elset=low", "1, 2"]
    for name, some in lines.items():
        (tmp_path / name).write_text("\n".join(some), encoding="utf-8-sig")
    path = deck(tmp_path, "*Node, input=nœuds.txt", PLY[0] + ", INPUT=elements.txt")
    path.write_text(path.read_text() + "*Include, input=sets.inp", encoding="utf-8-sig")
    (tmp_path / "case").mkdir()
    (tmp_path / "case" / "mesh.inp").write_bytes(content_of(path))
    for mesh in map(read_mesh, (path, tmp_path / "case" / "mesh.inp")):
        assert np.array_equal(mesh.p.T, XY)
        assert names(mesh) == {"E1": [0, 1, 2, 3], "low": [0, 1]}


def test_sets_of_sets_and_nodes_of_sets_of_elements(tmp_path):
    sets = ["*Elset, elset=low", "1, 2", "*Elset, elset=three", "LOW, 3"]
    sets += ["*Elset, elset=all", "three,", "E1", "*Nset, nset=under, elset=low"]
    sets += ["*Nset, nset=more", "under, 7"]
    mesh = read_mesh(deck(tmp_path, "*Node", *NODES, *PLY, *sets))
    every = [0, 1, 2, 3]
    assert names(mesh) == {"E1": every, "low": [0, 1], "three": [0, 1, 2], "all": every}
    assert {k: len(v) for k, v in mesh.boundaries.items()} == {"under": 4, "more": 5}
    assert named_nodes(mesh)["under"].tolist() == [4]


def test_sets_of_one_name_are_joined_and_case_counts_in_quotation_marks(tmp_path):
    sets = ["*Elset, elset=low", "1", "*Elset, elset=LOW", "2", "*Elset, elset=E1", "2"]
    sets += ['*Elset, elset="A, b"', "3,", '*Elset, elset="a, B"', "4,"]
    sets += ["*Elset, elset=both", '"A, b", Low']
    mesh = read_mesh(deck(tmp_path, "*Node", *NODES, *PLY, *sets[:-2]))
    expected = {"E1": [0, 1, 2, 3], "low": [0, 1], "A, b": [2], "a, B": [3]}
    assert names(mesh) == expected


@pytest.mark.parametrize(
    ("position", "first", "last"),
    [
        ([], (0, 0), (20, 20)),
        (["100., 50., 0."], (100, 50), (120, 70)),
        (["100., 50., 0.", "100., 50., 0., 100., 50., 1., 90."], (100, 50), (80, 70)),
        (["100., 50., 0.", "0., 0., 0., 0., 0., -2., 90."], (50, -100), (70, -120)),
    ],
)
def test_an_instance_is_translated_then_rotated(tmp_path, position, first, last):
    lines = [*PART, INSTANCE, *position, "*End Instance", "*Node", "1, 0., 0., 7."]
    lines += ["*Nset, nset=RP", "1,", "*Elset, elset=up, instance=P-1", "3, 4"]
    lines += ["*Elset, elset=P, instance=P-1", "P-1.E1,", "*End Assembly"]
    mesh = read_mesh(deck(tmp_path, *lines))
    assert np.allclose(mesh.p[:, [0, 8]].T, [first, last], rtol=0, atol=1e-12)
    assert names(mesh) == {"E1": [0, 1, 2, 3], "up": [2, 3], "P": [0, 1, 2, 3]}


def test_elements_of_the_assembly_are_ignored_and_said(tmp_path, caplog):
    """Numbers and nodes as in the part, sets of them, and types without cells."""
    lines = [*PART, INSTANCE, "*End Instance", "*Node, nset=RP", "1, 50., 0., 0."]
    lines += ["*Element, type=S3, elset=more", "9, 1, 2, 3", "*Element, type=MASS"]
    lines += ["9, 1", "*Elset, elset=again", "more, 9", "*Nset, nset=RPs", "RP"]
    lines += ["*Nset, nset=b, instance=P-1", "P-1.1, 2", "*Nset, nset=c", "RP, P-1.b"]
    lines += ["*End Assembly"]
    path = deck(tmp_path, *lines)
    mesh = read_mesh(path)
    assert np.array_equal(mesh.p.T, XY)
    assert mesh.nelements == 4
    assert {k: len(v) for k, v in mesh.boundaries.items()} == {"b": 1, "c": 1}
    left = ["*NODE", "*ELEMENT", "*ELSET 'again'", "*NSET 'RPs'"]
    named = ", ".join(f"{one} of the assembly" for one in left)
    assert caplog.messages == [f"{path}: ignored: {named}"]


def test_generated_sets_of_several_lines_without_a_step(tmp_path):
    sets = ["*Nset, nset=ends, generate", "1, 3", "7, 9, 2,"]
    mesh = read_mesh(deck(tmp_path, "*Node", *NODES, *PLY, *sets))
    assert len(mesh.boundaries["ends"]) == 2
    assert named_nodes(mesh)["ends"].tolist() == [6, 8]


def test_cells_and_nodes_of_a_tool_that_are_not_read_are_said(tmp_path, caplog):
    points, faces = grid()
    lines = ["*Node", *(f"{i}, {x}, {y}, {z}" for i, (x, y, z) in enumerate(points, 1))]
    lines += ["*Element, type=R3D3"]
    lines += [f"{i}, {a + 1}, {b + 1}, {c + 1}" for i, (a, b, c) in enumerate(faces, 1)]
    more = ["*Element, type=T3D2", "999, 1, 2", "*Node", "999, 0., 0., 90."]
    path = deck(tmp_path, *lines, *more)
    assert read_surface(path).facets.points.shape[1] == len(points)
    named = "node 999 (of no element), 1 edge(s)"
    assert caplog.messages == [f"{path}: ignored: {named}"]


def test_directions_in_a_rotated_instance_are_refused(tmp_path):
    lines = [*PART, INSTANCE, "0, 0, 0", "0, 0, 0, 0, 0, 1, 30", "*End Instance"]
    axes = ["*Orientation, name=O", "1., 0., 0., 0., 1., 0.", "3, 0."]
    with pytest.raises(MeshError, match="directions in a rotated instance"):
        read_directions(deck(tmp_path, *lines, *axes))


def test_parameters_of_a_fabric_that_are_not_read_are_named(tmp_path):
    lines = ["*Material, name=C", "*Fabric, stress free initial slack=YES"]
    for component in ("1", "2", "SHEAR"):
        lines += [f"*Uniaxial, component={component}", "*Loading Data", "0, 0", "1, 1"]
    ignored = read_fabric(deck(tmp_path, *lines), 0.2).ignored
    named = [line for line in ignored if line.startswith("*FABRIC")]
    assert named == [
        "*FABRIC, STRESS FREE INITIAL SLACK=YES: this parameter is ignored"
    ]


def grid():
    s = np.linspace(-70, 70, 9)
    x, y = (a.ravel() for a in np.meshgrid(s, s))
    k = np.add.outer(9 * np.arange(8), np.arange(8)).ravel()
    faces = np.vstack([np.c_[k, k + 1, k + 10], np.c_[k, k + 10, k + 9]])
    return np.c_[x, y, 20 * np.exp(-(x**2 + y**2) / 2500)], faces


def test_a_missing_texture_is_not_reported(tmp_path, caplog, capfd):
    pytest.importorskip("trimesh")
    points, faces = grid()
    head = ["ply", "format ascii 1.0", "comment TextureFile photo.png"]
    head += [f"element vertex {len(points)}"]
    head += [f"property float {name}" for name in "xyzst"]
    head += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    rows = [f"{x} {y} {z} 0 0" for x, y, z in points]
    rows += [f"3 {a} {b} {c}" for a, b, c in faces]
    path = tmp_path / "scan.ply"
    path.write_text("\n".join([*head, "end_header", *rows, ""]))
    assert read_surface(path).facets.points.shape[1] == len(points)
    assert not caplog.messages
    assert capfd.readouterr() == ("", "")


@pytest.mark.filterwarnings("error")
def test_a_separate_part_without_area_is_left_out(tmp_path, caplog):
    pytest.importorskip("trimesh")
    points, faces = grid()
    rows = [f"v {x} {y} {z}" for x, y, z in points]
    rows += [f"v {x} 0 0" for x in (200, 210, 220)]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path = tmp_path / "part.obj"
    path.write_text("\n".join([*rows, "f 82 83 84", ""]))
    assert read_surface(path).facets.points.shape[1] == len(points)
    assert "1 triangle(s) of parts without area removed" in caplog.text
