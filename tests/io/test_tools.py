"""Tools from files: formats, several solids and files, units, damage."""

import tomllib
import zipfile
from contextlib import nullcontext

import numpy as np
import pytest

from skfem_textile.cli import main as cli
from skfem_textile.io import read_surface, read_tool_mesh
from tests.helpers.decks import T, X, ascii_solid, binary_solid
from tests.helpers.intervals import no_interval  # noqa: F401
from tests.helpers.tool_shapes import plate
from tests.helpers.tools import SMALL, summary

LEFT = X[0, T].mean(axis=0) < 0


def same_surface(surface, atol=1e-4):
    facets = surface.facets
    assert facets.n_elements == T.shape[1]
    centres = np.sort(facets.points[:, facets.triangles()].mean(axis=1))
    np.testing.assert_allclose(centres, np.sort(X[:, T].mean(axis=1)), atol=atol)


def stl(folder, content, name="tool.stl"):
    (folder / name).write_bytes(content)
    return folder / name


# Formats


@pytest.mark.parametrize("solid", [ascii_solid, binary_solid])
@pytest.mark.parametrize("solids", [1, 2])
def test_all_solids_of_an_stl_file_are_sewn(tmp_path, solid, solids):
    parts = [T] if solids == 1 else [T[:, LEFT], T[:, ~LEFT]]
    content = b"".join(solid(X, part) for part in parts)
    same_surface(read_surface(stl(tmp_path, content, "tool.STL")))


def test_a_binary_file_may_begin_with_the_word_solid(tmp_path):
    content = binary_solid(X, T, b"solid made by CAD")
    same_surface(read_surface(stl(tmp_path, content)))


def test_several_files_are_sewn(tmp_path, caplog):
    shifted = X + np.array([[0], [0], [1e-3]])
    left = stl(tmp_path, binary_solid(X, T[:, LEFT]), "left.stl")
    right = stl(tmp_path, ascii_solid(shifted, T[:, ~LEFT]), "right.stl")
    same_surface(read_surface([left, right]), 1.1e-3)
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


@pytest.mark.parametrize("solid", [ascii_solid, binary_solid])
def test_a_part_is_read_as_a_tool(tmp_path, solid):
    """With the elements in the order of the file, and capitals in ASCII."""
    content = solid(X, T)
    content = content.upper() if solid is ascii_solid else content
    part = read_tool_mesh(stl(tmp_path, content))
    centres = part.points[:, part.cells[0]].mean(axis=1)
    np.testing.assert_allclose(centres, X[:, T].mean(axis=1), atol=1e-4)
    assert len(part.boundary()) == 1


@pytest.mark.parametrize("change", [lambda x: x[:-20], lambda x: x + b"xx"])
def test_a_part_of_another_length_than_declared_is_refused(tmp_path, change):
    content = change(binary_solid(X, T))
    with pytest.raises(ValueError, match="as many triangles as its header declares"):
        read_tool_mesh(stl(tmp_path, content))


def test_quadrilaterals_of_an_obj_part_with_one_normal_stay(tmp_path):
    corners = ["v 0 0 0", "v 9 0 0", "v 9 9 0", "v 0 9 0", "vn 0 0 1"]
    faces = "g a", "f 1//1 2//1 3//1 4//1", "f 1//1 2//1 3//1"
    (tmp_path / "part.obj").write_text("\n".join([*corners, *faces]))
    part = read_tool_mesh(tmp_path / "part.obj")
    assert [cell.tolist() for cell in part.cells] == [
        [[0], [1], [2], [3]],
        [[0], [1], [2]],
    ]


# Units


@pytest.mark.parametrize(
    ("unit", "scale"), [("m", 1e-3), ("cm", 0.1), ("in", 1 / 25.4)]
)
def test_a_unit_scales_the_tool(tmp_path, caplog, unit, scale):
    file = stl(tmp_path, ascii_solid(scale * X, T))
    same_surface(read_surface(file, unit=unit))
    assert not caplog.messages


def test_the_unit_of_a_3mf_file_is_used(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / "tool.3mf"
    trimesh.Trimesh(X.T / 25.4, T.T, process=False).export(file)
    with zipfile.ZipFile(file) as read:
        parts = {name: read.read(name) for name in read.namelist()}
    with zipfile.ZipFile(file, "w") as write:
        for name, part in parts.items():
            write.writestr(name, part.replace(b'"millimeter"', b'"inch"'))
    same_surface(read_surface(file))


@pytest.mark.parametrize(
    ("scale", "advice"),
    [
        (1e-3, "if the file is in m, specify this unit"),
        (0.02, "if the file is in m, specify this unit"),
        (0.25, ""),
        (90.0, ""),
        (1e3, "export it in mm if this is not so"),
        (1e-9, "export it in mm if this is not so"),
    ],
)
def test_an_extent_that_indicates_another_unit_is_reported(
    tmp_path, caplog, scale, advice
):
    file = stl(tmp_path, ascii_solid(scale * X, T))
    read_surface(file)
    assert [advice in line for line in caplog.messages] == ([True] if advice else [])
    assert all("assumed in mm" in line for line in caplog.messages)
    with pytest.raises(ValueError, match=advice) if advice else nullcontext():
        read_surface(file, certain=True)


@pytest.mark.parametrize(("scale", "unit"), [(0.1, None), (0.1, "mm"), (0.25, None)])
def test_a_small_tool_without_a_unit_is_named(tmp_path, caplog, scale, unit):
    file = stl(tmp_path, ascii_solid(scale * X, T))
    read_surface(file, unit, certain=True)
    line = "extends over 20 mm: specify its unit (--unit) if this is not so"
    told = [line in text for text in caplog.messages]
    assert told == ([True] if scale == 0.1 and unit is None else [])


def test_an_extent_beyond_tools_is_reported_with_a_given_unit_too(tmp_path, caplog):
    read_surface(stl(tmp_path, ascii_solid(X, T)), unit="m")
    assert [line.endswith("check its unit") for line in caplog.messages] == [True]


# Command line


@pytest.mark.usefixtures("no_interval")
def test_a_run_on_two_files_in_metres_is_repeated_from_its_case(tmp_path, caplog):
    x, t = plate(200.0, 200.0, 25.0)
    left = x[0, t].mean(axis=0) < 0
    parts = {"a.stl": t[:, left], "b.stl": t[:, ~left]}
    files = [stl(tmp_path, binary_solid(x / 1000, t), n) for n, t in parts.items()]
    out = tmp_path / "out"
    words = ["run", "drape", "--tool", *map(str, files), "--unit", "m", *SMALL]
    words += ["--width", "80", "--height", "80", "--size", "2x2"]
    assert cli.main([*words, "--out", str(out)]) == 0
    assert abs(summary(out)["max_shear_angle_deg"]) < 1e-6
    scene = tomllib.loads((out / "case.toml").read_text())["scene"]
    assert scene["unit"] == "m"
    assert scene["tool"] == ["case_files/tool.stl", "case_files/tool_2.stl"]
    again = tmp_path / "again"
    assert cli.main(["run", str(out / "case.toml"), "--out", str(again)]) == 0
    assert summary(again)["max_shear_angle_deg"] == summary(out)["max_shear_angle_deg"]
