"""Messages about files that cannot be read, and content that cannot be written."""

import json
import sys
from functools import partial
from pathlib import Path

import meshio
import numpy as np
import pytest
from skfem import MeshTri

from skfem_textile import Fabric, Linear, MeshError
from skfem_textile.fabric.directions import FibreDirections
from skfem_textile.io import (
    read_curve,
    read_directions,
    read_fabric,
    read_mesh,
    read_surface,
    read_tool_mesh,
    write_directions,
    write_fabric,
)
from tests.helpers import decks
from tests.helpers.command_line import rejected
from tests.helpers.decks import LAW58, PART, POINTS, QUADS, TRIANGLES, card, mesh_deck

MESHES = Path(__file__).parent / "meshes"

CELLS = {"quad": QUADS, "triangle": TRIANGLES}


def refused(path, message, read=read_mesh, **options):
    """A file is refused in one line that begins with its name."""
    with pytest.raises(MeshError, match=message) as error:
        read(path, **options)
    assert str(error.value).isprintable()
    if not message.startswith("must be one of"):
        assert str(error.value).startswith(str(path))


# Files in which one piece of text was replaced

#: Rows (old, new, message) by the name of the sound file.
CHANGED = {
    "quads22.msh": [
        ("$Nodes\n15", "$Nodes\n14", r"\$Nodes: it contains 4 more words"),
        ("$Nodes\n15", "$Nodes\n16", r"\$Nodes: 64 numbers expected, but"),
        ("Elements\n23", "Elements\n22", r"\$Elements: it contains 9 more words"),
        ("Names\n6", "Names\n5", "begin with the number of its names, 6"),
        ("$EndElements", "", r"the end of \$Elements is missing"),
        ("\n4 2 2 0", "\n3 2 2 0", "node number 3 is used twice"),
        ("\n13 3 2", "\n12 3 2", "element number 12 is used twice"),
        ("7 14 12", "7 14 99", "node 99 is used, but not defined"),
        ("5 1 2 0", "5 1 2x 0", "'2x' is not a number"),
        ("5 1 2 0", "5 1 2_0 0", "'2_0' is not a number"),
        ("2.2 0 8", "3.0 0 8", "version '3.0' .* save the mesh in version 2.2"),
        ('"bottom"', '"b\xe4"', "is not in UTF-8"),
        ("1 3 ", "1 2 ", "'inner' has the number of another"),
        ("3 2 6", "3 2 5", "share an edge with more than one other"),
    ],
    "quads41.msh": [
        ("15 15 1 15", "15 16 1 15", "the declared number is 16, but 15 are"),
        ("7 17 1 17", "7 16 1 17", "the declared number is 16, but 17 are"),
        ("2 1 3 4\n", "2 9 3 4\n", "entity 9 of dimension 2 is undefined"),
        ("2 1 3 4\n", "1 1 3 4\n", "a quad must be in an entity of dimension"),
        ('"half"', '"inner"', "two groups have the name 'inner'"),
    ],
    "quads41b.msh": [
        ("$EndNodes", "\0$EndNodes", "more than its counts"),
        ("$EndMesh", "$MeshFormat\n$EndMesh", r"\$MeshFormat contains unexpected"),
    ],
    "quads.inp": [
        ("4, 2, 2, 0", "4, 2, 2", "number and two or three coordinates"),
        ("4, 2, 2, 0", "3, 2, 2, 0", "node number 3 is used twice"),
        ("\n11, 12,", "\n10, 12,", "element number 10 is used twice"),
        ("11, 12, 14, 11, 6\n", "11, 12, 14, 11\n", "must have 5 numbers"),
        ("*NODE", "*SYSTEM\n1, 1, 1\n*NODE", r"\*SYSTEM: this keyword is not supp"),
        ("*Heading", "1, 2\n*Heading", "not begin with an Abaqus keyword"),
    ],
    "sets.inp": [
        ("*HEADING", "*NODE\n10, 3, 3, 0\n*HEADING", "same number of coordinates"),
        ("*HEADING", "*INCLUDE, INPUT=/a", "'/a', which sets.inp includes, does not"),
        ("NSET=all", "SYSTEM=C", "'SYSTEM' is not supported: list plain numbers"),
        ("NSET=point\n5", "NSET=point\nrows", "'point': the set 'ROWS' is not defined"),
        ("NSET=point", "NSET=point, ELSET=upper", "nodes with ELSET= has no data line"),
        ("NSET=point\n5", "NSET=point\n55", "'point': node 55 is used, but not defin"),
        ("4, 6, 1", "1, 999999999999, 1", "'row': this set has no members, or more m"),
        ("4, 6, 1", "4", "GENERATE requires lines"),
        ("1, 4\n", "1, 44\n", "'mixed': element 44 is used, but not defined"),
        ("NSET=point", 'NSET="all"', "two sets 'all': use unique names"),
        ("2, 3, 6, 5", "2, 3, 6, 77", "node 77 is used, but not defined"),
        ("2, 1.0, 0.0", "2, nan, 0.0", r"1 node.*not finite: 1"),
        ("S4R", "C3D\x1b8", r"C3D\\x1b8"),
    ],
    "text.vtu": [
        ('NumberOfCells="2"', 'NumberOfCells="3"', "'types': 3 numbers expected, but"),
        ('Points="6"', 'Points="5"', "'Points': it contains 3 more words"),
        ("<Piece ", "<Piece/><Piece ", "must have one Piece, found 2"),
        ('"Int64"', '"Float64"', "type 'Float64' is not supported"),
        ("</DataArray>", " x</DataArray>", "it contains 1 more words"),
        ('Name="offsets"', 'Name="types"', "two arrays of Cells have the same name"),
        ("</Piece>", "", "file is not valid XML"),
    ],
    "cloth.inp": [
        ("*FABRIC", "*ELASTIC", r"no \*FABRIC"),
        ("*FABRIC", "*FABRIC, USER", "subroutine"),
        ("COMPONENT=1", "COMPONENT=3", "COMPONENT=3"),
        ("COMPONENT=1", "COMPONENT=2", "twice"),
        ("400., 0.02", "400., -0.02", "must be larger than the previous one"),
        ("400., 0.02", "400., 0.02, 20.", "the same number of values"),
        ("0., 0.\n400., 0.02", "0., 0., 20.\n400., 0.02, 30.", "temperature"),
        ("400., 0.02", "inf, 0.02", "finite"),
        ("400., 0.02", "4e2x, 0.02", "'4e2x' is not a number"),
        ("DIRECTION=TENSION", "DIRECTION=BOTH", "BOTH"),
        ("DIRECTION=COMPRESSION", "DIRECTION=TENSION", "twice"),
        ("1., 0.1", "1., 1.1", "above -1"),
    ],
}


def sound(name, tmp_path):
    """Content of a sound file."""
    if name == "sets.inp":
        return decks.sets().encode()
    if name == "cloth.inp":
        return decks.FABRIC.encode()
    if name == "text.vtu":
        meshio.Mesh(POINTS, {"quad": QUADS}).write(tmp_path / name, binary=False)
        return (tmp_path / name).read_bytes()
    return (MESHES / name).read_bytes()


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [(name, *row) for name, rows in CHANGED.items() for row in rows],
)
def test_a_changed_file_is_refused_in_one_line(tmp_path, name, old, new, message):
    content, old = sound(name, tmp_path), old.encode()
    assert old in content
    path = tmp_path / name
    path.write_bytes(content.replace(old, new.encode("latin-1"), 1))
    if name == "cloth.inp":
        refused(path, message, read_fabric, thickness=0.3)
    else:
        refused(path, message)


@pytest.mark.parametrize("name", ["quads41b.msh", "quads22.msh", "quads.inp"])
def test_files_with_duplicate_content_are_refused(tmp_path, name):
    content = (MESHES / name).read_bytes()
    (tmp_path / name).write_bytes(content + content)
    refused(tmp_path / name, "more than one|defined twice|used twice")


# Parts, instances and sets of Abaqus

INSTANCE = "*Instance, name=P-1, part=P"
LINES = [
    ([*PART, INSTANCE, "1, 2"], r"\*INSTANCE.*: the position must be a line"),
    ([*PART, INSTANCE, "0, 0, 0", "1, 1, 1, 1, 1, 1, 5"], "two points of the axis coi"),
    (
        [*PART, INSTANCE, "5, 0, 0", "*Node", "10, 0, 0, 0"],
        r"nodes within a moved \*INSTANCE",
    ),
    (
        [INSTANCE, "5, 0, 0", "*Node", *decks.NODES, *decks.PLY],
        r"\*PART with the nodes",
    ),
    ([*PART, INSTANCE, "*End Instance", INSTANCE], r"more than one \*INSTANCE"),
    (
        ["*Node", *decks.NODES, *decks.PLY, "*Elset, elset=a", "E1", *decks.PLY],
        "'E1' is extended after another set",
    ),
    ([*PART, "*Instance, name=P-1, part=Q"], "the part 'Q' is not defined"),
    ([*PART, INSTANCE, "*Nset, nset=n, instance=Q", "1"], "the instance 'Q' is not d"),
    ([*PART, INSTANCE, "*Elset, elset=e, instance=Q", "1"], "the instance 'Q' is not"),
    ([*PART, "*Instance, library=L, instance=I"], "'INSTANCE' is not supported"),
    ([*PART, INSTANCE, "*Nset, nset=n, generate", "1, 0"], "no members, or more membe"),
    (
        [*PART, INSTANCE, "*Nset, nset=n, generate", *9 * ["1, 9"]],
        "more members than lines",
    ),
]


@pytest.mark.parametrize(("lines", "message"), LINES)
def test_positions_and_sets_are_refused_in_one_line(tmp_path, lines, message):
    refused(mesh_deck(tmp_path, *lines), message)


# Whole files, by the function that reads them

AXES, AT_3 = "*ORIENTATION, NAME=A\n1,0,0,0,1,0\n", "3,0\n"
ANGLES = "element,warp_angle_deg,weft_angle_deg\n"
TABLE = "*DISTRIBUTION TABLE, NAME=T\nANGLE\n*DISTRIBUTION, NAME=D, LOCATION=ELEMENT"
NO_UNIT = "both decimal points and commas"
NOT_NAMED = "must name the columns x, y and z"

UNCLEAR = [
    ({}, "specify the thickness"),
    ({"thickness": 0.0}, "positive"),
    ({"thickness": 0.3, "units": "lb in"}, "units"),
    ({"thickness": 0.3, "material": "SILK"}, "SILK"),
]
THICK = {"thickness": 1.0}
RADIOSS = [
    ([], {}, "no /MAT/LAW58"),
    (LAW58, {}, "specify the thickness"),
    (LAW58[:4], THICK, "2 lines follow the title, but at least 5"),
    ([*LAW58[:3], "1O00", *LAW58[4:]], THICK, "E1: '1O00'"),
    ([*LAW58[:3], card((0, "-5")), *LAW58[4:]], THICK, "stiffness"),
    ([*LAW58, card((0, 9))], THICK, "no /FUNCT/9"),
    ([*LAW58[:6], card((0, 3))], THICK, "N1 = 3"),
    ([*LAW58, *LAW58], THICK, "several"),
    (LAW58, {"thickness": 1.0, "material": "8"}, "number 8"),
]
BINARY, ASCII = (
    decks.binary_solid(decks.X, decks.T),
    decks.ascii_solid(decks.X, decks.T),
)
STL = [
    (b"", "neither an ASCII STL file nor a binary one"),
    (b"nothing", "neither an ASCII STL file nor a binary one"),
    (BINARY[:-7], "as many triangles as its header declares"),
    (BINARY + b"more", "as many triangles as its header declares"),
    (ASCII[:-2000], "ends early or is damaged"),
    (ASCII.replace(b"vertex -1.0", b"vertex -1,0", 1), "number"),
    (b"solid empty\nendsolid\n", "contains no triangles"),
    (ASCII.replace(b"e+00", b"e+99", 1), "far from all others"),
]

CONTENTS = [
    *(
        (read_directions, "deck.inp", decks.DIRECTIONS + text, message)
        for text, message in (
            ("", r"must contain \*ORIENTATION"),
            ("*ORIENTATION, NAME=A\n1,0,0,2,0,0\n3,0\n", "'A': .* lie on a line"),
            (f"{AXES}1,0\n", "direction 1 must be normal"),
            ("*ORIENTATION, NAME=A\n1,0,0,0,1,1e-4\n3,0\n", "3 must be normal"),
            ("*ORIENTATION, NAME=A\nD\n3,0\n", r"\*DISTRIBUTION 'D' is not defined"),
            ("*ORIENTATION, NAME=A, SYSTEM=CYLINDRICAL\n1,0,0,0,1,0\n", "CYLINDRICAL"),
            ("*ORIENTATION, NAME=A\n1,0,0,0,nan,0\n3,0\n", "points must be finite"),
            (f"{AXES}3,0\n*SHELL SECTION, ELSET=LAST, ORIENTATION=A\n1\n", "ment 11"),
            (f"{AXES}3,D\n{TABLE}, TABLE=T\n11, 1.\n", "element 7 has no value"),
            (f"{AXES}3,D\n{TABLE}, TABLE=T\n,1.\n,3.\n", "two lines without an elem"),
            (f"{AXES}3,D\n{TABLE}, TABLE=T\n11,1.,\n7,2.,3.\n", "'7, 2., 3.' must"),
        )
    ),
    *(
        (read_directions, "a.csv", text, message)
        for text, message in (
            ("", "the file is empty"),
            ("element,warp_angle_deg\n1,2\n", "row 1: the header must name"),
            (ANGLES, "no elements"),
            (f"{ANGLES}1,0\n", "row 2"),
            (f"{ANGLES}2,0,90\n", "from 1 to"),
            (f"{ANGLES}1,0,90\n1,0,90\n", "row 3: element 1 already has a row"),
            (f"{ANGLES}1,0,nan\n", "finite"),
        )
    ),
    (read_directions, "a.msh", "", "can be read only from"),
    *((read_mesh, name, "hello 1 2", name) for name in ("text.msh", "mesh.xyzzy")),
    (read_mesh, "empty.vtu", "", "empty.vtu"),
    (
        read_mesh,
        "m.vtu",
        '<VTKFile type="UnstructuredGrid"><AppendedData encoding="raw">\n$_1'
        "</AppendedData></VTKFile>",
        "appended data must begin with '_'",
    ),
    *(
        (read_fabric, "fabric.json", text, r"fabric\.json: ")
        for text in ("", "[]", "[" * 100_000, "{", '{"a": NaN}', "\xff")
    ),
    *((partial(read_fabric, **more), "a.inp", decks.FABRIC, m) for more, m in UNCLEAR),
    *(
        (partial(read_fabric, **more), "a.rad", decks.radioss(*lines), message)
        for lines, more, message in RADIOSS
    ),
    *((read_surface, "tool.stl", content, message) for content, message in STL),
    *(
        (read_surface, f"tool.{suffix}", "", r"exact surfaces: convert it .*gmsh")
        for suffix in ("step", "STP", "igs")
    ),
]


@pytest.mark.parametrize(
    ("read", "name", "content", "message"), CONTENTS, ids=range(len(CONTENTS))
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path, read, name, content, message):
    content = content.encode() if isinstance(content, str) else content
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, message, read)


CURVES = [
    ("# exported\nx,y,z\n1.5,2,3\n", NOT_NAMED),
    ("# 1,2,3\n4,5,6\n7,8,9\n", NOT_NAMED),
    ("x,y\n1,2\n", NOT_NAMED),
    ("x (ft),y,z\n1,2,3\n", "the unit must be one of mm, cm, m, in, got 'ft'"),
    ("x;y;z\n1,5;2.5;0\n", NO_UNIT),
    ("x y z\n1,5 2.5 0\n", NO_UNIT),
    ("x,y,z\n1,2,3\n1,2,a\n", "row 3: expected three finite coordinates"),
    ("x,y,z\n1,2,3\n1,2,3\n", "the curve has 1 different points"),
    ("", "the file is empty"),
]


@pytest.mark.parametrize(("text", "message"), CURVES)
def test_tables_without_a_curve_are_refused(tmp_path, text, message):
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(ValueError, match=message) as error:
        read_curve(tmp_path / "curve.csv")
    assert str(error.value).startswith(str(tmp_path))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [("curve.csv", "Is a directory"), ("none.csv", "No such file or directory")],
)
def test_a_trim_that_is_no_file_is_named(tmp_path, capsys, name, message):
    (tmp_path / "curve.csv").mkdir()
    tool = tmp_path / "tool.stl"
    tool.write_bytes(decks.binary_solid(decks.X, decks.T))
    words = ("--tool", str(tool), "--out", str(tmp_path / "out"))
    line = rejected(capsys, "net", *words, "--trim", str(tmp_path / name))
    assert line.endswith(f"error: {tmp_path / name}: {message}\n")


# Meshes that other programs write

FOURTH = np.eye(6)[:, 3:4]
MESH_CELLS = [
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
    *(
        ({"quad": QUADS}, POINTS + np.outer(k * np.arange(6), [0, 0, 1]), "plane z = ")
        for k in (1.0, 1e-8)
    ),
    ({"line": [[0, 1]]}, POINTS, "found none"),
    ({"quad": QUADS + 1}, POINTS, r"1 quad.* refer to an undefined node .*: 1"),
    *(
        ({"quad": QUADS}, POINTS * 10.0**exponent, r"2 quadrilateral\(s\) are inverted")
        for exponent in (-300, -160, -101)
    ),
    *(
        (
            {"quad": QUADS},
            np.where(FOURTH * at, bad, POINTS),
            r"m.vtu: 1 node\(s\) .*: 3$",
        )
        for bad in (np.nan, np.inf, -np.inf, 1e300)
        for at in ([[1, 0, 0]], [[0, 0, 1]])
    ),
    *(
        (
            {kind: np.where(np.arange(cells.size).reshape(cells.shape) == 5, n, cells)},
            POINTS,
            r"1 .* undefined node .* 0 to 5\): 1$",
        )
        for kind, cells in CELLS.items()
        for n in (-1, 6, 2**40)
    ),
]


@pytest.mark.parametrize(("cells", "points", "message"), MESH_CELLS)
def test_invalid_meshes_are_refused_by_name(tmp_path, cells, points, message):
    meshio.Mesh(points, cells).write(tmp_path / "m.vtu")
    refused(tmp_path / "m.vtu", message)


@pytest.mark.parametrize("kind", CELLS)
@pytest.mark.parametrize("last", [[0, 2], [3, 2], [2, 2]])
def test_a_group_with_an_invalid_edge_is_refused(tmp_path, kind, last):
    path = decks.with_lines(
        tmp_path / "m.msh", POINTS, kind, CELLS[kind], [[0, 1], [1, 2], last]
    )
    a, b = sorted(last)
    refused(path, f"boundary 'clamp': no edge of the mesh joins nodes {a} and {b}")


def test_names_by_scikit_fem_without_valid_edge_numbers_are_refused(tmp_path):
    data = {"skfem:b:left": [np.array([16, 0])]}
    meshio.Mesh(POINTS, {"quad": QUADS}, cell_data=data).write(tmp_path / "m.vtu")
    refused(tmp_path / "m.vtu", "name 'left' written by scikit-fem are not valid")


def test_file_names_are_printed_in_one_line(tmp_path):
    with pytest.raises(MeshError, match=r"a\\nb\\x1b\[2J\\x00.msh: no such file"):
        read_mesh("a\nb\x1b[2J\0.msh")
    (tmp_path / "a\nb.msh").write_text("x\x1b")
    with pytest.raises(MeshError, match=r"a Gmsh section, got 'x\\\\x1b'") as error:
        read_mesh(tmp_path / "a\nb.msh")
    assert str(error.value).isprintable()


# Fabrics


JSON = [
    ({"format": "other"}, "format"),
    ({"density": 1.0}, "the keys must be tension"),
    ({"bending": 1.0}, "bending must be a pair"),
    ({"bending": [1.0, -1.0]}, "bending of weft"),
    ({"twist": -1.0}, "twist must be"),
    ({"wrinkling_angle": 2.0}, "wrinkling angle: 2"),
    ({"shear": {"kind": "Fabric"}}, "unknown law 'Fabric'"),
    ({"shear": {"kind": "Linear", "stiffness": -1.0}}, "stiffness"),
    ({"shear": {"kind": "Linear", "stiff": 1.0}}, "no parameter 'stiff'"),
    ({"shear": {"kind": ["Linear"]}}, "unknown law"),
    ({"shear": "soft"}, "shear"),
    ({"tension": {"warp": 1.0}}, "tension"),
    ({"warp": [0.0, 0.0]}, "warp"),
    ({"warp": [[1.0], [1.0, 2.0]]}, r"fabric\.json: "),
    ({"tension": 10**400}, r"fabric\.json: "),
]


@pytest.mark.parametrize(("change", "message"), JSON)
def test_a_file_without_a_fabric_is_refused(tmp_path, change, message):
    path = tmp_path / "fabric.json"
    write_fabric(path, Fabric())
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    refused(path, message, read_fabric)


class Own(Linear):
    """A law without a file format."""


TWO, THREE = (
    (MeshTri(), FibreDirections.of_angles([0.0] * n, [90.0] * n)) for n in (2, 3)
)
WRITTEN = [
    (
        lambda: write_fabric("a.json", Fabric(warp=lambda x: x + 1)),
        "warp is a function",
    ),
    (lambda: write_fabric("a.json", Fabric(shear=Own(1.0))), "shear: Own is not a law"),
    (lambda: write_fabric("a.txt", Fabric()), "be written only to"),
    (lambda: write_fabric("a.inp", Fabric()), "thickness"),
    (lambda: write_fabric("a.inp", decks.WEAVE, 0.3), "both fibre strains"),
    (
        lambda: write_fabric("a.inp", Fabric(wrinkling_angle=0.9), 0.3),
        "wrinkling angle",
    ),
    (lambda: write_directions("a.vtu", *THREE), "3 fibre directions for 2 elements"),
    (lambda: write_directions("a.txt", *TWO), "can be written only to"),
]


@pytest.mark.parametrize(("call", "message"), WRITTEN)
def test_what_has_no_file_format_is_not_written(tmp_path, monkeypatch, call, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=message):
        call()
    assert list(tmp_path.iterdir()) == []


# Tools


DAMAGED = "the file is damaged, or is not a {} file: export it again"
UNKNOWN = "{} are not supported: export the mesh as .stl, .obj, .msh, .inp or .vtu"
FOREIGN = [
    ("a.glb", b"glTF", UNKNOWN.format(".glb files")),
    ("a.rad", b"/NODE\n", UNKNOWN.format(".rad files")),
    ("a", b"solid\n", UNKNOWN.format("files without suffix")),
    ("a.off", b"OFF\n8 6 0\n\xf6", DAMAGED.format(".off")),
    ("a.bdf", b"", DAMAGED.format(".bdf")),
    ("a.ugrid", b"1 2", DAMAGED.format(".ugrid")),
    ("a.vol", b"mesh3d\nsurfaceelements\n2\n1 2 3\n", DAMAGED.format(".vol")),
    ("a.xdmf", b"<Xdmf>", DAMAGED.format(".xdmf")),
    ("a.vtk", b"# vtk", "the file does not begin with the header of a VTK file"),
    ("a.vtu", b"", "the file is not valid XML: no element found"),
]
READERS = pytest.mark.parametrize("read", [read_surface, read_tool_mesh, read_mesh])


@READERS
@pytest.mark.parametrize(("name", "content", "message"), FOREIGN)
def test_no_words_of_other_packages(tmp_path, capfd, read, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError) as caught:
        read(tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name}: {message}")
    assert str(caught.value).isprintable()
    assert capfd.readouterr() == ("", "")


@READERS
def test_folders_are_no_files(tmp_path, read):
    with pytest.raises(MeshError, match="this is a folder"):
        read(tmp_path)


@pytest.mark.parametrize("content", [b"PK\x03\x04", b"", b"\xff" * 99, b"nothing\n"])
@pytest.mark.parametrize("suffix", [".ply", ".3mf", ".obj"])
def test_no_words_of_trimesh(tmp_path, capfd, suffix, content):
    pytest.importorskip("trimesh")
    (tmp_path / f"a{suffix}").write_bytes(content)
    refused(tmp_path / f"a{suffix}", f"a{suffix}: ", read_surface)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", ["ply", "obj", "3mf"])
def test_a_missing_trimesh_is_named(tmp_path, monkeypatch, suffix):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    (tmp_path / f"tool.{suffix}").write_text("")
    message = rf"{suffix} file requires trimesh: pip install"
    refused(tmp_path / f"tool.{suffix}", message, read_surface)


@pytest.mark.parametrize("name", ["a.med", "a.h5m", "a.cgns"])
@pytest.mark.parametrize("read", [read_mesh, read_surface])
def test_a_missing_h5py_is_named(tmp_path, name, read, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    (tmp_path / name).write_bytes(b"\x89HDF\r\n")
    refused(tmp_path / name, f"this .{name[2:]} file requires h5py", read)


def test_an_unknown_unit_is_refused(tmp_path):
    with pytest.raises(ValueError, match="must be one of mm, cm, m, in, got 'ft'"):
        read_surface(tmp_path / "tool.stl", unit="ft")
