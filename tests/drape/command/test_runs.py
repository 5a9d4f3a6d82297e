"""A ply on a tool of a file, from the command line: its files and its case."""

import meshio
import numpy as np
import pytest

from skfem_textile.cli import main as cli
from skfem_textile.io import read_tool_mesh
from tests.helpers.tool_files import bump, command, plate, summary, write


def test_a_ply_beyond_the_edges_of_its_tool_is_told(tmp_path):
    """The share of area, a sentence, and a field; flat, so that it is known."""
    flat = write(tmp_path / "flat.stl", *plate(60.0, 13, lambda x, y: 0 * x))
    out = tmp_path / "out"
    assert command(out, "--width", "150", "--height", "100", tool=flat) == 0
    found = summary(out)
    assert found["beyond_tool_share_of_area"] == pytest.approx(1 - 120 / 150, abs=0.06)
    assert "take a smaller ply or a larger tool" in found["beyond_tool"]
    fields = meshio.read(out / "fields" / "step_0002.vtu")
    beyond = fields.cell_data["beyond_tool"][0]
    middle = fields.points[fields.cells[0].data].mean(axis=1)
    np.testing.assert_array_equal(beyond, np.abs(middle[:, 0]) > 60)


def test_files_are_in_the_axes_of_the_tool(tool, tmp_path):
    shifted = read_tool_mesh(tool)
    file = write(
        tmp_path / "t.stl",
        shifted.points + np.array([[300], [0], [9]]),
        shifted.triangles(),
    )
    out = tmp_path / "out"
    assert command(out, "--fibres", "25", "--width", "120", tool=file) == 0
    last = meshio.read(out / "fields" / "step_0002.vtu")
    for x in (
        last.points + last.point_data["displacement"],
        meshio.read(out / "fibres.vtu").points,
    ):
        z = bump(x[:, 0] - 300, x[:, 1]) + 9
        assert np.abs(x[:, 2] - z).max() < 0.1
    warp = last.cell_data["warp_direction"][0]
    assert np.abs(warp[:, 2]).max() > 0.2
    np.testing.assert_allclose(np.linalg.norm(warp, axis=1), 1)


def test_the_case_beside_the_results_says_the_same(tool, tmp_path):
    x, t = plate(40.0, 9)
    part = write(tmp_path / "part.stl", x, t)
    options = "--fibres", "35", "--point", "-4", "3", "29", "--part-mesh", str(part)
    out, again = tmp_path / "out", tmp_path / "again"
    assert command(out, *options, tool=tool) == 0
    line = "run", str(out / "case.toml"), "--no-render", "--out", str(again)
    assert cli.main(line) == 0
    one, other = summary(out), summary(again)
    for key in ("energy", "touches_at_x_mm", "pattern_area_mm2"):
        assert one[key] == other[key]
    assert (again / "case.toml").read_text() == (out / "case.toml").read_text()
    for name in ("tool.stl", "part_mesh.stl"):
        assert (again / "case_files" / name).read_bytes() == (
            out / "case_files" / name
        ).read_bytes()


def test_a_run_on_a_tool_goes_on_from_its_checkpoint(tool, tmp_path, capsys):
    out = tmp_path / "out"
    assert command(out, "--checkpoint", tool=tool) == 0
    assert command(out, "--resume", tool=tool) == 0
    other = write(tmp_path / "other.stl", *plate(height=lambda x, y: 0.9 * bump(x, y)))
    assert command(out, "--resume", tool=other) == 2
    assert "checkpoint" in capsys.readouterr().err


def test_init_writes_a_case_that_asks_for_its_tool(tool, tmp_path, capsys):
    file = tmp_path / "new.toml"
    assert cli.main(["init", str(file), "--scene", "drape"]) == 0
    text = file.read_text()
    assert "# tool is not given" in text
    assert cli.main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "scene.tool is missing: name an STL file" in capsys.readouterr().err
