"""Files that depart from their format are rejected, and all others are read."""

from base64 import b64encode
from contextlib import nullcontext
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.spatial import Delaunay

from skfem_textile import MeshError
from skfem_textile.io import read_mesh, read_surface
from skfem_textile.io.file_numbers import BinaryNumbers
from skfem_textile.io.vtk import decoded, read_uncompressed
from tests.helpers.decks import POINTS, QUADS

MESHES = Path(__file__).parent / "meshes"


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


def test_a_count_before_bytes_is_alone_on_its_line(tmp_path):
    path = written(tmp_path, "m.msh", file_format="gmsh22")
    content = path.read_bytes()
    path.write_bytes(content.replace(b"$Nodes\n6\n", b"$Nodes\n6 6\n"))
    refused(path, r"\$Nodes: it contains 1 more words")


def test_entities_without_a_group_are_read_beside_grouped_ones(tmp_path):
    path = changed(tmp_path, "quads41.msh", b"1 5 4 2 3 4 -7", b"0 4 2 3 4 -7")
    sizes = {k: len(v) for k, v in read_mesh(path).subdomains.items()}
    assert sizes == {"half": 4, "ply": 4}


def test_entities_in_a_group_with_reversed_orientation_belong_to_it(tmp_path):
    path = changed(tmp_path, "quads41.msh", b"1 5 4 2 3 4 -7", b"1 -5 4 2 3 4 -7")
    assert len(read_mesh(path).subdomains["ply"]) == 8


def written(folder, name, **how):
    path = folder / name
    meshio.Mesh(POINTS, {"quad": QUADS}).write(path, **how)
    return path


def test_small_integers_of_vtu_are_read(tmp_path):
    path = written(tmp_path, "m.vtu", binary=False)
    path.write_bytes(path.read_bytes().replace(b'"Int64"', b'"Int8"'))
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
    for data in (b64encode(count + one), b64encode(count) + b64encode(one)):
        assert read_uncompressed(BinaryNumbers(decoded(data)), header) == one


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


@pytest.mark.parametrize(("height", "text"), [(3e-10, ""), (3e-9, "in a plane z = c")])
def test_a_mesh_lies_in_a_plane_up_to_rounding(tmp_path, height, text):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, height], [0, 1, 0]])
    meshio.Mesh(points, [("quad", [[0, 1, 2, 3]])]).write(tmp_path / "a.vtu")
    with pytest.raises(MeshError, match=text) if text else nullcontext():
        read_mesh(tmp_path / "a.vtu")


@pytest.mark.parametrize(("side", "is_told"), [(30.0, True), (50.0, False)])
def test_the_assumed_unit_of_a_small_tool_is_told(tmp_path, caplog, side, is_told):
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(0, side, 7)] * 2))
    cells = [("triangle", Delaunay(np.array([x, y]).T).simplices)]
    meshio.Mesh(np.array([x, y, 0 * x]).T, cells).write(tmp_path / "tool.stl")
    read_surface(tmp_path / "tool.stl")
    assert ("the tool is assumed in mm" in caplog.text) == is_told
