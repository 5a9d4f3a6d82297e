"""Flat patterns, and tools at each state, in files."""

import csv
import re
from types import SimpleNamespace

import meshio
import numpy as np

from skfem_textile import contact
from skfem_textile.contact import placed
from skfem_textile.drape import Axes, FlatPattern
from skfem_textile.io import write_pattern
from skfem_textile.io.results import write_tools
from skfem_textile.nets.flat_pattern import SeamLine

OUTLINE = np.array([[10.0, 50.0, 50.0, 10.0], [0.0, 0.0, 30.0, 30.0]])
ON_TOOL = np.vstack([OUTLINE[::-1], np.arange(4.0)])
WARP = np.tile([[0.8], [0.6]], 4)
WEFT = np.tile([[0.0], [2.0]], 4)
SEAM = SeamLine(3, np.array([[5.0, 9.0, 9.0], [7.0, 7.0, 10.0]]), np.eye(3))
PATTERN = FlatPattern(OUTLINE, ON_TOOL, WARP, WEFT, seams=(SEAM,))


def test_a_table_has_arc_lengths_angles_and_seams(tmp_path):
    write_pattern(tmp_path / "a.csv", PATTERN)
    with open(tmp_path / "a.csv", newline="") as file:
        header, *rows = csv.reader(file)
    assert header[4:7] == ["along", "warp_angle_deg", "weft_angle_deg"]
    assert [row[-1] for row in rows] == [""] * 4 + ["3"] * 3
    values = np.array([row[:-1] for row in rows], dtype=float)
    assert values[:, 0].tolist() == [1] * 4 + [2] * 3
    assert values[:, 1].tolist() == [1, 2, 3, 4, 1, 2, 3]
    np.testing.assert_allclose(values[:, 2:4].T, np.hstack([OUTLINE, SEAM.flat]))
    assert values[:, 4].tolist() == [0, 40, 70, 110, 0, 4, 7]
    np.testing.assert_allclose(values[:, 5], np.degrees(np.arctan2(0.6, 0.8)))
    np.testing.assert_allclose(values[:, 6], 90.0)
    np.testing.assert_allclose(values[:, 7:].T, np.hstack([ON_TOOL, SEAM.on_tool]))


def test_a_drawing_has_the_outline_seams_and_axes_at_full_size(tmp_path):
    """Axes are a quarter of the smaller extent long; y points upwards."""
    write_pattern(tmp_path / "a.svg", PATTERN)
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert 'width="44mm" height="34mm" viewBox="8 -32 44 34"' in text
    assert '<polygon points="10,-0 50,-0 50,-30 10,-30"' in text
    assert '<polyline points="5,-7 9,-7 9,-10"' in text
    assert '<text x="9" y="-7" font-size="1.2"' in text
    ends = re.findall(r'<line x1="(\S+)" y1="(\S+)" x2="(\S+)" y2="(\S+)"', text)
    expected = [[30, -15, 36, -19.5], [30, -15, 30, -22.5]]
    np.testing.assert_allclose(np.array(ends, dtype=float), expected)


def test_tools_of_a_state_are_in_one_file_with_their_numbers(tmp_path, monkeypatch):
    triangle = np.array([[0.0, 1, 0], [0, 0, 1], [0, 0, 0]])
    tools = [
        SimpleNamespace(name=name, points=triangle + z, triangles=np.arange(3)[:, None])
        for name, z in (("punch", 5.0), ("die", 0.0))
    ]
    names = [SimpleNamespace(name=name) for name in ("die", "punch")]
    states = [SimpleNamespace(load_factor=x) for x in (0.0, 1.0)]
    monkeypatch.setattr(placed, "standing", lambda ply: names)
    monkeypatch.setattr(contact, "box_of", lambda *_: ())
    monkeypatch.setattr(contact, "placed_tools", lambda *_: [[], tools])
    result = SimpleNamespace(ply=None, states=states)
    write_tools(result, tmp_path, Axes())
    assert {path.name for path in tmp_path.iterdir()} == {"tools.pvd", "tools_0001.vtu"}
    assert 'timestep="1.0"' in (tmp_path / "tools.pvd").read_text()
    read = meshio.read(tmp_path / "tools_0001.vtu")
    assert read.cells[0].data.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert read.cell_data["tool"][0].tolist() == [1, 0]
    np.testing.assert_allclose(read.points[:3], triangle.T + 5.0)
