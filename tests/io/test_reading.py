"""Names in files, and data that are ignored."""

import logging
from pathlib import Path

import meshio
import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import Condition, Fabric, Full, LoadStepper, MeshError, OnePoint, Ply
from skfem_textile.io import read_mesh
from skfem_textile.mesh.selection import named_nodes
from skfem_textile.scenes import bias_extension

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


def test_a_condition_on_a_group_of_gmsh_acts_once():
    """Files of both versions give the same reactions."""
    reactions = []
    for name in ("quads22.msh", "quads41.msh"):
        mesh = read_mesh(MESHES / name)
        top = Condition(lambda X: X[1] > 1.999, 0.1, direction=(0, 1))
        held = {
            "bottom": Condition("bottom"),
            "corner": Condition("corner"),
            "top": top,
        }
        ply = Ply(mesh, Fabric(10.0, 1.0), Full())
        reactions.append(LoadStepper(ply, held, 1).run().states[-1].reactions["bottom"])
    np.testing.assert_allclose(*reactions, rtol=1e-12)


POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
TRIANGLES = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
CELLS = {"quads": ("quad", QUADS), "triangles": ("triangle", TRIANGLES)}


def with_lines(path, kind, lines):
    """A file in which these lines are the boundary ``clamp``."""
    name, cells = CELLS[kind]
    tags = [[3] * len(cells), [1] * len(lines)]
    meshio.Mesh(
        POINTS,
        [(name, cells), ("line", lines)],
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={"clamp": np.array([1, 1]), "ply": np.array([3, 2])},
    ).write(path, file_format="gmsh22")
    return path


@pytest.mark.parametrize("kind", CELLS)
@pytest.mark.parametrize("last", [[0, 2], [3, 2], [2, 2]])
def test_a_group_with_an_invalid_edge_is_rejected(tmp_path, kind, last):
    path = with_lines(tmp_path / "m.msh", kind, [[0, 1], [1, 2], last])
    a, b = sorted(last)
    message = f"m.msh: boundary 'clamp': no edge of the mesh joins nodes {a} and {b}"
    with pytest.raises(MeshError, match=message):
        read_mesh(path)


@pytest.mark.parametrize("kind", CELLS)
def test_a_group_of_inner_edges_is_kept(tmp_path, kind):
    mesh = read_mesh(with_lines(tmp_path / "m.msh", kind, [[1, 4], [1, 2]]))
    edges = mesh.p[:, mesh.facets[:, mesh.boundaries["clamp"]]]
    length = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=0)
    assert length.sum() == pytest.approx(2.0)
    assert ((edges[0] == 1).all(axis=0) | (edges[1] == 0).all(axis=0)).all()


INP = """*HEADING
*NODE, NSET=all
1, 0.0, 0.0
2, 1.0, 0.0
3, 2.0, 0.0
4, 0.0, 1.0
5, 1.0, 1.0
6, 2.0, 1.0
7, 0.0, 2.0
8, 1.0, 2.0
9, 2.0, 2.0
*ELEMENT, TYPE={quad}
1, 1, 2, 5, 4
2, 2, 3, 6, 5
3, 4, 5, 8, 7
*ELEMENT, TYPE={triangle}, ELSET=upper
4, 5, 6, 9
5, 5, 9, 8
*NSET, NSET=bottom
1, 2, 3
*NSET, NSET=point
5
*NSET, NSET=both
3, 6, 5
*NSET, NSET=row, GENERATE
4, 6, 1
*ELSET, ELSET=mixed
1, 4
"""


def inp(path, text=INP, quad="S4R", triangle="S3"):
    path.write_text(text.format(quad=quad, triangle=triangle))
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


def test_conditions_accept_named_nodes_and_fix_all_of_a_set(tmp_path):
    mesh = read_mesh(inp(tmp_path / "m.inp"))
    ply = Ply(mesh, Fabric(10.0, 1.0), OnePoint())
    held = {
        "bottom": Condition("bottom"),
        "both": Condition("both", lambda X, t: 0.1 * t * X * X[1]),
        "row": Condition("row", lambda X, t: 0.1 * t * X * X[1]),
    }
    result = LoadStepper(ply, held, 1).run()
    u = ply.nodal(result.u)
    np.testing.assert_allclose(u[:, 3:6], 0.1 * mesh.p[:, 3:6], atol=1e-12)


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
        read_mesh(inp(tmp_path / "a\x1bb.inp", INP + more))
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


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("*HEADING", "*NODE\n9, 3, 3", "node number 9 is used twice"),
        ("*HEADING", "*NODE\n10, 3, 3, 0\n*HEADING", "same number of coordinates"),
        ("*HEADING", "*IMPERFECTION, FILE=a", r"\*IMPERFECTION: this keyword is not"),
        (
            "*HEADING",
            "*INCLUDE, INPUT=/etc/hosts",
            r"\*INCLUDE: this keyword is not supported",
        ),
        ("NSET=all", "SYSTEM=C", "'SYSTEM' is not supported: list plain numbers"),
        ("NSET=point", "NSET=bottom", r"\*NSET 'bottom': this set is defined twice"),
        (
            "NSET=point\n5",
            "NSET=point\nrows",
            "'point': the set 'ROWS' is not defined before it is used",
        ),
        (
            "NSET=point\n5",
            "NSET=point, ELSET=upper\n5",
            "'point': a set of nodes with ELSET= has no data lines",
        ),
        ("NSET=point\n5", "NSET=point\n-5", "'point': the set '-5' is not defined"),
        (
            "NSET=point\n5",
            "NSET=point\n55",
            "'point': node 55 is used, but not defined",
        ),
        (
            "4, 6, 1",
            "1, 999999999999, 1",
            "'row': this set has no members, or more members than lines in the file",
        ),
        ("4, 6, 1", "4", "GENERATE requires lines"),
        ("1, 4\n", "1, 44\n", "'mixed': element 44 is used, but not defined"),
        ("ELSET=mixed", "ELSET=upper", r"'upper' is used by \*ELSET and by \*ELEMENT"),
        ("2, 3, 6, 5", "2, 3, 6, 77", "node 77 is used, but not defined"),
        ("2, 1.0, 0.0", "2, nan, 0.0", r"1 node.*not finite: 1"),
        ("2, 1.0, 0.0", "2, inf, 0.0", r"1 node.*not finite: 1"),
        ("S4R", "C3D\x1b8", r"C3D\\x1b8"),
    ],
)
def test_ambiguous_files_are_rejected_in_one_line(tmp_path, old, new, message):
    path = inp(
        tmp_path / "m.inp", INP.format(quad="S4R", triangle="S3").replace(old, new)
    )
    with pytest.raises(MeshError, match=f"m.inp: .*{message}") as error:
        read_mesh(path)
    assert str(error.value).isprintable()


@pytest.mark.parametrize("kind", CELLS)
@pytest.mark.parametrize("number", [-1, 6, 2**40])
def test_invalid_node_numbers_are_reported(tmp_path, kind, number):
    name, cells = CELLS[kind]
    cells = cells.copy()
    cells[1, 2] = number
    meshio.Mesh(POINTS, {name: cells}).write(tmp_path / "m.vtu")
    with pytest.raises(MeshError, match=r"1 .* undefined node .* 0 to 5\): 1$"):
        read_mesh(tmp_path / "m.vtu")


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
@pytest.mark.parametrize("axis", [0, 2])
def test_invalid_positions_are_reported_without_warnings(tmp_path, bad, axis):
    points = POINTS.copy()
    points[3, axis] = bad
    meshio.Mesh(points, {"quad": QUADS}).write(tmp_path / "m.vtu")
    with pytest.raises(MeshError, match=r"m.vtu: 1 node\(s\) .*: 3$"):
        read_mesh(tmp_path / "m.vtu")


def test_file_names_are_printed_in_one_line(tmp_path):
    with pytest.raises(MeshError, match=r"a\\nb\\x1b\[2J\\x00.msh: no such file"):
        read_mesh("a\nb\x1b[2J\0.msh")
    (tmp_path / "a\nb.msh").write_text("x\x1b")
    with pytest.raises(MeshError, match=r"a Gmsh section, got 'x\\\\x1b'") as error:
        read_mesh(tmp_path / "a\nb.msh")
    assert str(error.value).isprintable()


def test_two_groups_of_gmsh_with_one_name_are_rejected(tmp_path):
    text = (MESHES / "quads41.msh").read_text().replace('"half"', '"inner"')
    (tmp_path / "m.msh").write_text(text)
    with pytest.raises(MeshError, match="two groups have the name 'inner'"):
        read_mesh(tmp_path / "m.msh")


def test_cells_repeated_under_the_same_name_are_rejected(tmp_path):
    text = (MESHES / "quads22.msh").read_text()
    line = next(x for x in text.splitlines() if x.split()[1:4] == ["3", "2", "6"])
    (tmp_path / "m.msh").write_text(
        text.replace(line, line.replace("3 2 6", "3 2 5", 1))
    )
    with pytest.raises(MeshError, match="share an edge with more than one other"):
        read_mesh(tmp_path / "m.msh")


@pytest.mark.parametrize("kind", [MeshQuad, MeshTri])
def test_names_written_by_scikit_fem_are_kept(tmp_path, kind):
    plain = kind().refined(1).with_defaults()
    inner = np.setdiff1d(np.arange(plain.nfacets), plain.boundary_facets())
    plain = plain.with_boundaries({"inner": inner}).with_subdomains({"one": [0]})
    plain.save(str(tmp_path / "m.vtu"))
    mesh = read_mesh(tmp_path / "m.vtu")
    for name, edges in plain.boundaries.items():
        np.testing.assert_array_equal(np.sort(edges), mesh.boundaries[name])
    assert mesh.subdomains["one"].tolist() == [0]
