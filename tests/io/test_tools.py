"""Tools from files: formats, several solids and files, units, damage."""

import struct
import sys
import tomllib

import numpy as np
import pytest

from skfem_textile.cli import main as cli
from skfem_textile.io import read_mesh, read_surface, read_tool_mesh
from skfem_textile.mesh.checks import MeshError
from tests.helpers.intervals import no_interval  # noqa: F401
from tests.helpers.tool_shapes import bonnet, plate
from tests.helpers.tools import SMALL, summary

X, T = bonnet(length=200.0, width=150.0, crown=30.0)
LEFT = X[0, T].mean(axis=0) < 0


def ascii_solid(x, t, name="part"):
    lines = [f"solid {name}"]
    for corners in x[:, t].transpose(2, 1, 0):
        lines += ["facet normal 0 0 0", " outer loop"]
        lines += [f"  vertex {a:.9e} {b:.9e} {c:.9e}" for a, b, c in corners]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""]).encode()


def binary_solid(x, t, header=b"made by CAD"):
    rows = np.zeros(
        t.shape[1], dtype=[("normal", "<f4", 3), ("x", "<f4", (3, 3)), ("mark", "<u2")]
    )
    rows["x"] = x[:, t].transpose(2, 1, 0)
    return header.ljust(80) + struct.pack("<I", t.shape[1]) + rows.tobytes()


def same_surface(surface, atol=1e-4):
    facets = surface.facets
    assert facets.n_elements == T.shape[1]
    centres = np.sort(facets.points[:, facets.triangles()].mean(axis=1))
    np.testing.assert_allclose(centres, np.sort(X[:, T].mean(axis=1)), atol=atol)


# Formats


@pytest.mark.parametrize("solid", [ascii_solid, binary_solid])
@pytest.mark.parametrize("solids", [1, 2])
def test_all_solids_of_an_stl_file_are_sewn(tmp_path, solid, solids):
    file = tmp_path / "tool.STL"
    parts = [T] if solids == 1 else [T[:, LEFT], T[:, ~LEFT]]
    file.write_bytes(b"".join(solid(X, part) for part in parts))
    same_surface(read_surface(file))


def test_a_binary_file_may_begin_with_the_word_solid(tmp_path):
    file = tmp_path / "tool.stl"
    file.write_bytes(binary_solid(X, T, b"solid made by CAD"))
    same_surface(read_surface(file))


def test_several_files_are_sewn(tmp_path, caplog):
    files = tmp_path / "left.stl", tmp_path / "right.stl"
    shifted = X + np.array([[0], [0], [1e-3]])
    files[0].write_bytes(binary_solid(X, T[:, LEFT]))
    files[1].write_bytes(ascii_solid(shifted, T[:, ~LEFT]))
    same_surface(read_surface(files), 1.1e-3)
    (line,) = caplog.messages
    assert "left.stl" in line
    seam = np.intersect1d(T[:, LEFT], T[:, ~LEFT]).size
    assert f"right.stl: sewn: {seam} copies of vertices merged" in line


@pytest.mark.parametrize("suffix", ["ply", "obj", "3mf"])
def test_formats_of_trimesh(tmp_path, suffix):
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / f"tool.{suffix}"
    trimesh.Trimesh(X.T, T.T, process=False).export(file)
    same_surface(read_surface(file))


def test_quadrilaterals_of_an_obj_file_are_cut(tmp_path):
    pytest.importorskip("trimesh")
    s = np.linspace(0, 100, 6)
    x, y = (a.ravel() for a in np.meshgrid(s, s))
    k = np.add.outer(6 * np.arange(5), np.arange(5)).ravel() + 1
    lines = [f"v {a} {b} 0" for a, b in zip(x, y, strict=True)]
    lines += [f"f {i} {i + 1} {i + 7} {i + 6}" for i in k]
    file = tmp_path / "tool.obj"
    file.write_text("\n".join(lines))
    assert read_surface(file).facets.n_elements == 50


@pytest.mark.parametrize("suffix", ["ply", "obj", "3mf"])
def test_a_missing_package_is_named(tmp_path, monkeypatch, suffix):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    file = tmp_path / f"tool.{suffix}"
    file.write_text("")
    with pytest.raises(
        MeshError, match=rf"{suffix} file requires trimesh: pip install"
    ):
        read_surface(file)


@pytest.mark.parametrize("suffix", ["step", "STP", "igs"])
def test_exact_surfaces_are_to_be_converted(tmp_path, suffix):
    with pytest.raises(MeshError, match=r"exact surfaces: convert it .*gmsh"):
        read_surface(tmp_path / f"tool.{suffix}")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "neither an ASCII STL file nor a binary one"),
        (b"nothing", "neither an ASCII STL file nor a binary one"),
        (binary_solid(X, T)[:-7], "as many triangles as its header declares"),
        (binary_solid(X, T) + b"more", "as many triangles as its header declares"),
        (ascii_solid(X, T)[:-2000], "ends early or is damaged"),
        (ascii_solid(X, T).replace(b"vertex -1.0", b"vertex -1,0", 1), "number"),
        (b"solid empty\nendsolid\n", "contains no triangles"),
        (ascii_solid(X, T).replace(b"e+00", b"e+99", 1), "far from all others"),
    ],
)
def test_damaged_stl_files_are_rejected(tmp_path, content, message):
    file = tmp_path / "tool.stl"
    file.write_bytes(content)
    with pytest.raises(MeshError, match=message) as caught:
        read_surface(file)
    assert str(caught.value).startswith(str(file))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", ["ply", "obj", "3mf", "vtk"])
def test_damaged_files_of_other_formats_are_rejected(tmp_path, suffix):
    pytest.importorskip("trimesh")
    file = tmp_path / f"tool.{suffix}"
    file.write_bytes(b"nothing of use\n")
    with pytest.raises(MeshError, match=f"tool.{suffix}: ") as caught:
        read_surface(file)
    assert "\n" not in str(caught.value)


DAMAGED = "the file is damaged, or is not a {} file: export it again"
UNKNOWN = "{} are not supported: export the mesh as .stl, .obj, .msh, .inp or .vtu"


@pytest.mark.parametrize("read", [read_surface, read_tool_mesh, read_mesh])
@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.glb", b"glTF", UNKNOWN.format(".glb files")),
        ("a.rad", b"/NODE\n", UNKNOWN.format(".rad files")),
        ("a", b"solid\n", UNKNOWN.format("files without suffix")),
        ("a.off", b"OFF\n8 6 0\n\xf6", DAMAGED.format(".off")),
        ("a.off", b"OFF\n8 6 0\n1 2 3\n", DAMAGED.format(".off")),
        ("a.bdf", b"", DAMAGED.format(".bdf")),
        ("a.mesh", b"\x87", DAMAGED.format(".mesh")),
        ("a.ugrid", b"1 2", DAMAGED.format(".ugrid")),
        ("a.vol", b"mesh3d\nsurfaceelements\n2\n1 2 3\n", DAMAGED.format(".vol")),
        ("a.xdmf", b"<Xdmf>", DAMAGED.format(".xdmf")),
        ("a.vtk", b"# vtk", "the file does not begin with the header of a VTK file"),
        ("a.vtu", b"", "the file is not valid XML: no element found"),
    ],
)
def test_no_words_of_other_packages(tmp_path, capfd, read, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeshError) as caught:
        read(tmp_path / name)
    assert str(caught.value).startswith(f"{tmp_path / name}: {message}")
    assert str(caught.value).isprintable()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("content", [b"PK\x03\x04", b"", b"\xff" * 99])
@pytest.mark.parametrize("suffix", [".ply", ".3mf"])
def test_no_words_of_trimesh(tmp_path, suffix, content):
    pytest.importorskip("trimesh")
    (tmp_path / f"a{suffix}").write_bytes(content)
    with pytest.raises(MeshError, match=f": {DAMAGED.format(suffix)}$"):
        read_surface(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("read", [read_surface, read_tool_mesh, read_mesh])
def test_folders_are_no_files(tmp_path, read):
    with pytest.raises(MeshError, match="this is a folder"):
        read(tmp_path)


# Units


@pytest.mark.parametrize(
    ("unit", "scale"), [("m", 1e-3), ("cm", 0.1), ("in", 1 / 25.4)]
)
def test_a_unit_scales_the_tool(tmp_path, caplog, unit, scale):
    file = tmp_path / "tool.stl"
    file.write_bytes(ascii_solid(scale * X, T))
    same_surface(read_surface(file, unit=unit))
    assert not caplog.messages


def test_the_unit_of_a_3mf_file_is_used(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / "tool.3mf"
    mesh = trimesh.Trimesh(X.T / 25.4, T.T, process=False)
    mesh.units = "inch"
    mesh.export(file)
    data = _replaced(file, b'unit="millimeter"', b'unit="inch"')
    file.write_bytes(data)
    same_surface(read_surface(file))


def _replaced(file, old, new):
    """Content of a zip archive with text replaced in its files."""
    import io
    import zipfile

    written = io.BytesIO()
    with zipfile.ZipFile(file) as read, zipfile.ZipFile(written, "w") as write:
        for name in read.namelist():
            write.writestr(name, read.read(name).replace(old, new))
    return written.getvalue()


@pytest.mark.parametrize(
    ("scale", "advice"),
    [
        (1e-3, "if the file is in m, specify this unit"),
        (0.02, "if the file is in m, specify this unit"),
        (0.1, ""),
        (90.0, ""),
        (1e3, "export it in mm if this is not so"),
        (1e-9, "export it in mm if this is not so"),
    ],
)
def test_an_extent_that_indicates_another_unit_is_reported(
    tmp_path, caplog, scale, advice
):
    file = tmp_path / "tool.stl"
    file.write_bytes(ascii_solid(scale * X, T))
    read_surface(file)
    assert [advice in line for line in caplog.messages] == ([True] if advice else [])
    assert all("assumed in mm" in line for line in caplog.messages)


def test_an_extent_beyond_tools_is_reported_with_a_given_unit_too(tmp_path, caplog):
    file = tmp_path / "tool.stl"
    file.write_bytes(ascii_solid(X, T))
    read_surface(file, unit="m")
    assert [line.endswith("check its unit") for line in caplog.messages] == [True]


def test_an_unknown_unit_is_rejected(tmp_path):
    with pytest.raises(ValueError, match="must be one of mm, cm, m, in, got 'ft'"):
        read_surface(tmp_path / "tool.stl", unit="ft")


# Command line


@pytest.mark.usefixtures("no_interval")
def test_a_run_on_two_files_in_metres_is_repeated_from_its_case(tmp_path, caplog):
    x, t = plate(200.0, 200.0, 12.0)
    left = x[0, t].mean(axis=0) < 0
    files = []
    for name, part in (("a.stl", t[:, left]), ("b.stl", t[:, ~left])):
        files.append(tmp_path / name)
        files[-1].write_bytes(binary_solid(x / 1000, part))
    out = tmp_path / "out"
    words = ["run", "drape", "--tool", *map(str, files), "--unit", "m", *SMALL]
    assert cli.main([*words, "--width", "80", "--height", "80", "--out", str(out)]) == 0
    assert abs(summary(out)["max_shear_angle_deg"]) < 1e-6
    scene = tomllib.loads((out / "case.toml").read_text())["scene"]
    assert scene["unit"] == "m"
    assert scene["tool"] == ["case_files/tool.stl", "case_files/tool_2.stl"]
    again = tmp_path / "again"
    assert cli.main(["run", str(out / "case.toml"), "--out", str(again)]) == 0
    assert summary(again)["max_shear_angle_deg"] == summary(out)["max_shear_angle_deg"]
