"""Files that depart from their format are rejected, and all others are read."""

from base64 import b64encode
from pathlib import Path

import meshio
import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import MeshError
from skfem_textile.io import read_mesh
from skfem_textile.io.vtk import Base64Data, read_uncompressed

MESHES = Path(__file__).parent / "meshes"

POINTS = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0.0]])
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])


def changed(folder, name, old, new):
    """A file of ``meshes`` with the first occurrence of some bytes replaced."""
    content = (MESHES / name).read_bytes()
    assert old in content
    (folder / name).write_bytes(content.replace(old, new, 1))
    return folder / name


def refused(path, message):
    with pytest.raises(MeshError, match=message) as error:
        read_mesh(path)
    assert str(error.value).isprintable()


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        (
            "quads22.msh",
            b"$Nodes\n15",
            b"$Nodes\n14",
            r"\$Nodes: it contains 4 more words",
        ),
        (
            "quads22.msh",
            b"$Nodes\n15",
            b"$Nodes\n16",
            r"\$Nodes: 64 numbers expected, but",
        ),
        (
            "quads22.msh",
            b"Elements\n23",
            b"Elements\n22",
            r"\$Elements: it contains 9 more words",
        ),
        (
            "quads22.msh",
            b"Names\n6",
            b"Names\n5",
            "begin with the number of its names, 6",
        ),
        ("quads22.msh", b"$EndElements", b"", r"the end of \$Elements is missing"),
        ("quads22.msh", b"\n4 2 2 0", b"\n3 2 2 0", "node number 3 is used twice"),
        ("quads22.msh", b"\n13 3 2", b"\n12 3 2", "element number 12 is used twice"),
        ("quads22.msh", b"7 14 12", b"7 14 99", "node 99 is used, but not defined"),
        ("quads22.msh", b"5 1 2 0", b"5 1 2x 0", "'2x' is not a number"),
        ("quads22.msh", b"5 1 2 0", b"5 1 2_0 0", "'2_0' is not a number"),
        (
            "quads22.msh",
            b"2.2 0 8",
            b"3.0 0 8",
            "version '3.0' .* save the mesh in version 2.2",
        ),
        ("quads22.msh", b'"bottom"', b'"b\xe4"', "is not in UTF-8"),
        ("quads22.msh", b"1 3 ", b"1 2 ", "'inner' has the number of another"),
        (
            "quads41.msh",
            b"15 15 1 15",
            b"15 16 1 15",
            "the declared number is 16, but 15 are",
        ),
        (
            "quads41.msh",
            b"7 17 1 17",
            b"7 16 1 17",
            "the declared number is 16, but 17 are",
        ),
        (
            "quads41.msh",
            b"2 1 3 4\n",
            b"2 9 3 4\n",
            "entity 9 of dimension 2 is undefined",
        ),
        (
            "quads41.msh",
            b"2 1 3 4\n",
            b"1 1 3 4\n",
            "a quad must be in an entity of dimension",
        ),
        ("quads41b.msh", b"$EndNodes", b"\0$EndNodes", "more than its counts"),
        (
            "quads41b.msh",
            b"$EndMesh",
            b"$MeshFormat\n$EndMesh",
            r"\$MeshFormat contains unexpected",
        ),
        ("quads.inp", b"4, 2, 2, 0", b"4, 2, 2", "number and two or three coordinates"),
        ("quads.inp", b"4, 2, 2, 0", b"3, 2, 2, 0", "node number 3 is used twice"),
        ("quads.inp", b"\n11, 12,", b"\n10, 12,", "element number 10 is used twice"),
        (
            "quads.inp",
            b"11, 12, 14, 11, 6\n",
            b"11, 12, 14, 11\n",
            "must have 5 numbers",
        ),
        (
            "quads.inp",
            b"*NODE",
            b"*SYSTEM\n1, 1, 1\n*NODE",
            r"\*SYSTEM: this keyword is not supported",
        ),
        (
            "quads.inp",
            b"*Heading",
            b"1, 2\n*Heading",
            "not begin with an Abaqus keyword",
        ),
        (
            "quads.inp",
            b"ELSET=ply",
            b"ELSET=HALF",
            r"\*ELSET 'half': this set is defined twice",
        ),
    ],
)
def test_damaged_gmsh_and_abaqus_files_are_rejected(tmp_path, name, old, new, message):
    refused(changed(tmp_path, name, old, new), message)


def test_a_count_before_bytes_is_alone_on_its_line(tmp_path):
    path = written(tmp_path, "m.msh", file_format="gmsh22")
    content = path.read_bytes()
    path.write_bytes(content.replace(b"$Nodes\n6\n", b"$Nodes\n6 6\n"))
    refused(path, r"\$Nodes: it contains 1 more words")


@pytest.mark.parametrize("name", ["quads41b.msh", "quads22.msh", "quads.inp"])
def test_files_with_duplicate_content_are_rejected(tmp_path, name):
    content = (MESHES / name).read_bytes()
    (tmp_path / name).write_bytes(content + content)
    refused(tmp_path / name, "more than one|defined twice")


def test_entities_without_a_group_are_read_beside_grouped_ones(tmp_path):
    path = changed(tmp_path, "quads41.msh", b"1 5 4 2 3 4 -7", b"0 4 2 3 4 -7")
    sizes = {k: len(v) for k, v in read_mesh(path).subdomains.items()}
    assert sizes == {"half": 4, "ply": 4}


def test_entities_in_a_group_with_reversed_orientation_belong_to_it(tmp_path):
    path = changed(tmp_path, "quads41.msh", b"1 5 4 2 3 4 -7", b"1 -5 4 2 3 4 -7")
    assert len(read_mesh(path).subdomains["ply"]) == 8


@pytest.mark.parametrize("capitals", [str.lower, str.upper])
def test_abaqus_keywords_are_case_insensitive(tmp_path, capitals):
    path = tmp_path / "m.inp"
    path.write_text(capitals((MESHES / "quads.inp").read_text()))
    mesh = read_mesh(path)
    assert mesh.nelements == 8
    assert len(mesh.boundaries[capitals("bottom")]) == 4


def written(folder, name, **how):
    path = folder / name
    meshio.Mesh(POINTS, {"quad": QUADS}).write(path, **how)
    return path


@pytest.mark.parametrize("exponent", [-300, -160, -101])
def test_meshes_of_too_small_size_are_rejected(tmp_path, exponent):
    points = POINTS * 10.0**exponent
    meshio.Mesh(points, {"quad": QUADS}).write(tmp_path / "m.vtu")
    refused(tmp_path / "m.vtu", r"2 quadrilateral\(s\) are inverted or degenerate")


VTU = [
    (b'NumberOfCells="2"', b'NumberOfCells="3"', "'types': 3 numbers expected, but 2"),
    (
        b'NumberOfPoints="6"',
        b'NumberOfPoints="5"',
        "'Points': it contains 3 more words",
    ),
    (b"<Piece ", b"<Piece/><Piece ", "must have one Piece, found 2"),
    (b'"Int64"', b'"Int8"', None),
    (b'"Int64"', b'"Float64"', "type 'Float64' is not supported"),
    (b"</DataArray>", b" x</DataArray>", "it contains 1 more words"),
    (b'Name="offsets"', b'Name="types"', "two arrays of Cells have the same name"),
    (b"</Piece>", b"", "file is not valid XML"),
]


@pytest.mark.parametrize(("old", "new", "message"), VTU)
def test_damaged_text_of_vtu_is_rejected(tmp_path, old, new, message):
    path = written(tmp_path, "m.vtu", binary=False)
    content = path.read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new, 1))
    if message:
        refused(path, message)
    else:
        assert read_mesh(path).nelements == 2


@pytest.mark.parametrize("compression", [None, "zlib", "lzma"])
def test_every_character_of_encoded_arrays_is_checked(tmp_path, compression):
    path = written(tmp_path, "m.vtu", compression=compression)
    content = path.read_bytes()
    np.testing.assert_array_equal(read_mesh(path).t, QUADS.T)
    start = content.index(b">", content.index(b"<DataArray")) + 1
    end = content.index(b"</DataArray>")
    for position in (start + 8, (start + end) // 2, end - 4):
        path.write_bytes(content[:position] + content[position + 1 :])
        refused(path, "array 'Points'")


def test_one_byte_after_its_count_is_read():
    """Together they end with padding, like the count alone."""
    header = np.dtype("<u4")
    one, count = b"\x09", np.array(1, header).tobytes()
    assert read_uncompressed(Base64Data(b64encode(count + one)), header) == one
    assert (
        read_uncompressed(Base64Data(b64encode(count) + b64encode(one)), header) == one
    )


def test_appended_data_start_with_their_marker(tmp_path):
    path = tmp_path / "m.vtu"
    path.write_text(
        '<VTKFile type="UnstructuredGrid"><AppendedData encoding="raw">\n$_1'
        "</AppendedData></VTKFile>"
    )
    refused(path, "appended data must begin with '_'")


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("version", ["vtk42", "vtk"])
def test_legacy_files_of_vtk_are_read_or_rejected(tmp_path, version, binary):
    path = written(tmp_path, "m.vtk", file_format=version, binary=binary)
    content = path.read_bytes()
    np.testing.assert_array_equal(read_mesh(path).t, QUADS.T)
    for old, new in (
        (b"POINTS 6", b"POINTS 5"),
        (b"POINTS 6", b"POINTS 7"),
        (b"CELL_TYPES 2", b"CELL_TYPES 1"),
        (b"CELLS", b"CELLS 1\nCELLS"),
        (b"double", b"duble"),
    ):
        path.write_bytes(content.replace(old, new, 1))
        refused(path, "m.vtk: ")


def test_boundaries_of_oriented_triangles_agree_with_scikit_fem(tmp_path):
    """Edges are counted in the order of the file, which may descend."""
    plain = MeshTri().refined(1).oriented()
    inner = np.setdiff1d(np.arange(plain.nfacets), plain.boundary_facets())
    plain = plain.with_boundaries({"a:b": inner[:3]})
    plain.save(str(tmp_path / "m.vtu"))
    mesh = read_mesh(tmp_path / "m.vtu")
    read, expected = (
        np.sort(m.facets[:, np.sort(m.boundaries["a:b"])], axis=0)
        for m in (mesh, plain)
    )
    np.testing.assert_array_equal(read, expected)


def test_names_by_scikit_fem_without_valid_edge_numbers_are_rejected(tmp_path):
    data = {"skfem:b:left": [np.array([16, 0])]}
    meshio.Mesh(POINTS, {"quad": QUADS}, cell_data=data).write(tmp_path / "m.vtu")
    refused(tmp_path / "m.vtu", "name 'left' written by scikit-fem are not valid")


def test_legacy_files_of_vtk_keep_names_by_scikit_fem(tmp_path):
    MeshQuad().refined(1).with_defaults().save(str(tmp_path / "m.vtk"))
    assert set(read_mesh(tmp_path / "m.vtk").boundaries) == {
        *("left", "right", "bottom", "top")
    }
