"""Plies on tools from files, from the command line."""

import meshio
import numpy as np
import pytest

from skfem_textile.cli import main as cli
from skfem_textile.io import read_tool_mesh
from tests.helpers.command_line import rejected
from tests.helpers.tools import (
    bump_height,
    command,
    plate,
    run_words,
    summary,
    write,
    write_sphere,
)

pytestmark = pytest.mark.usefixtures("coarse_net", "no_interval")

# A ply on a tool of a file, from the command line: its files and its case


def test_a_ply_beyond_the_edges_of_its_tool_is_reported(tmp_path):
    """The flat tool has a known share of area, a sentence and a field."""
    flat = write(tmp_path / "flat.stl", *plate(60.0, 13, lambda x, y: 0 * x))
    out = tmp_path / "out"
    assert command(out, "--width", "150", "--height", "100", tool=flat) == 0
    result = summary(out)
    assert result["beyond_tool_share_of_area"] == pytest.approx(1 - 120 / 150, abs=0.06)
    assert "use a smaller ply or a larger tool" in result["beyond_tool"]
    fields = meshio.read(out / "fields" / "step_0001.vtu")
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
    last = meshio.read(out / "fields" / "step_0001.vtu")
    for x in (
        last.points + last.point_data["displacement"],
        meshio.read(out / "fibres.vtu").points,
    ):
        z = bump_height(x[:, 0] - 300, x[:, 1]) + 9
        assert np.abs(x[:, 2] - z).max() < 0.1
    warp = last.cell_data["warp_direction"][0]
    assert np.abs(warp[:, 2]).max() > 0.2
    np.testing.assert_allclose(np.linalg.norm(warp, axis=1), 1)


def test_the_written_case_describes_the_same_tool(tool, tmp_path):
    x, t = plate(40.0, 9)
    part = write(tmp_path / "part.stl", x, t)
    options = "--fibres", "35", "--point", "-4", "3", "29", "--part-mesh", str(part)
    out, again = tmp_path / "out", tmp_path / "again"
    assert command(out, *options, tool=tool) == 0
    run_words = "run", str(out / "case.toml"), "--no-render", "--out", str(again)
    assert cli.main(run_words) == 0
    one, other = summary(out), summary(again)
    for key in ("energy", "touches_at_x_mm", "pattern_area_mm2"):
        assert one[key] == other[key]
    assert (again / "case.toml").read_text() == (out / "case.toml").read_text()
    for name in ("tool.stl", "part_mesh.stl"):
        assert (again / "case_files" / name).read_bytes() == (
            out / "case_files" / name
        ).read_bytes()


def test_a_run_on_a_tool_is_resumed_from_its_checkpoint(tool, tmp_path, capsys):
    out = tmp_path / "out"
    assert command(out, "--checkpoint", tool=tool) == 0
    assert command(out, "--resume", tool=tool) == 0
    other = write(
        tmp_path / "other.stl", *plate(height=lambda x, y: 0.9 * bump_height(x, y))
    )
    assert command(out, "--resume", tool=other) == 2
    assert "checkpoint" in capsys.readouterr().err


def test_init_writes_a_case_that_requires_a_tool(tool, tmp_path, capsys):
    file = tmp_path / "new.toml"
    assert cli.main(["init", str(file), "--scene", "drape"]) == 0
    text = file.read_text()
    assert "# tool is not given" in text
    assert cli.main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "scene.tool is missing: name an STL file" in capsys.readouterr().err


# Export of a run on a tool: fibres on a part, and its flat pattern


def test_fibres_and_pattern_are_exported(tool, tmp_path, capsys):
    """On a flat tool the pattern equals the part, and fibres keep their angle."""
    flat = write(tmp_path / "flat.stl", *plate(height=lambda x, y: 0 * x))
    x, t = plate(40.0, 9, lambda x, y: 0 * x)
    part, out = write(tmp_path / "part.stl", x, t), tmp_path / "out"
    options = "--fibres", "20", "--part-mesh", str(part)
    assert command(out, *options, tool=flat) == 0
    result = summary(out)
    assert result["part_covered_share_of_elements"] == 1
    assert result["pattern_area_mm2"] == pytest.approx(80 * 80, rel=1e-3)
    assert result["pattern_length_mm"] == pytest.approx(4 * 80, rel=1e-3)
    area = f"Flat pattern            {result['pattern_area_mm2']:.4g} mm²"
    assert area in capsys.readouterr().out
    fibres = meshio.read(out / "part.vtu")
    np.testing.assert_allclose(fibres.cell_data["warp_angle_deg"][0], 20, atol=1e-6)
    for name in ("part.csv", "part.inp", "pattern.csv", "pattern.svg"):
        assert (out / name).stat().st_size > 100
    assert {f.name for f in (out / "case_files").iterdir()} == {
        "tool.stl",
        "part_mesh.stl",
    }


def test_the_cut_area_is_the_area_of_all_pieces_without_their_holes(tmp_path):
    flat = write(tmp_path / "flat.stl", *plate(height=lambda x, y: 0 * x))
    x, t = plate(40.0, 9, lambda x, y: 0 * x)
    middle = x[:, t].mean(axis=1)
    gap = np.abs(middle[0]) < 10
    hole = (np.abs(middle[0] + 25) < 5) & (np.abs(middle[1]) < 10)
    part = write(tmp_path / "part.stl", x, t[:, ~(gap | hole)])
    out = tmp_path / "out"
    assert command(out, "--part-mesh", str(part), tool=flat) == 0
    area = 80 * 80 - 20 * 80 - 10 * 20
    assert summary(out)["pattern_area_mm2"] == pytest.approx(area, rel=1e-3)


def test_a_curve_trims_the_pattern(tool, tmp_path):
    a = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    x, y = 5 + 40 * np.cos(a), 40 * np.sin(a)
    curve, out = tmp_path / "curve.csv", tmp_path / "out"
    rows = np.column_stack([a, x, y, bump_height(x, y)])
    np.savetxt(curve, rows, delimiter=",", header="angle,X,y (mm), z", comments="")
    assert command(out, "--trim", str(curve), tool=tool) == 0
    result = summary(out)
    assert np.pi * 40**2 < result["pattern_area_mm2"] < 1.3 * np.pi * 40**2
    assert not (out / "part.vtu").exists()
    # A run without it removes the one of an earlier run.
    assert command(out, tool=tool) == 0
    assert not (out / "pattern.csv").exists()


def test_a_failed_export_is_reported_beside_other_results(tool, tmp_path, capsys):
    x, t = plate(40.0, 9)
    far = write(tmp_path / "far.stl", x + np.array([[500], [0], [0]]), t)
    out = tmp_path / "out"
    assert command(out, "--part-mesh", str(far), tool=tool) == 1
    assert "part: not written: fibres on a tool" in capsys.readouterr().err
    result = summary(out)
    assert result["converged"]
    assert result["part"].startswith("not written: ")
    assert (out / "fibres.vtu").exists()
    assert not (out / "part.vtu").exists()
    # The boundary leaves the ply, but not all elements do: only fibres are exported.
    assert command(out, "--width", "60", "--part-mesh", str(tool), tool=tool) == 0
    result = summary(out)
    assert 0 < result["part_covered_share_of_elements"] < 1
    assert "does not lie on" in result["pattern"]
    # The curve leaves the ply.
    curve = tmp_path / "curve.csv"
    curve.write_text("x,y,z\n-95,0,0\n95,0,0\n0,95,0\n")
    assert command(out, "--trim", str(curve), tool=tool) == 1
    assert (
        "pattern: not written: flat pattern: the ply does not lie"
        in capsys.readouterr().err
    )
    assert not (out / "pattern.csv").exists()


def test_a_closed_part_has_fibres_and_no_pattern(tmp_path, capsys):
    file, out = write_sphere(tmp_path / "ball.stl", 900), tmp_path / "out"
    options = "--part-mesh", str(file), "--width", "100", "--height", "100"
    assert command(out, *options, tool=file) == 0
    result = summary(out)
    assert "is closed" in result["pattern"]
    assert f"Flat pattern            {result['pattern']}" in capsys.readouterr().out
    assert 0 < result["part_covered_share_of_elements"] < 0.2


# Invalid tools, curves and options of a run on a tool


EMPTY = "solid nothing\nendsolid nothing\n"


def invalid_tools(folder):
    """Invalid files of tools, the expected messages, and the numbers of warnings."""
    x, t = plate()
    both = np.hstack([x, x - [[0], [0], [2]]])
    shell = np.hstack([t, t[::-1] + x.shape[1]])
    yield folder / "no.stl", "no.stl: no such file", 0
    empty = folder / "empty.stl"
    empty.write_text(EMPTY)
    yield empty, "empty.stl: the file contains no triangles", 0
    yield write(folder / "few.stl", x[:, :], t[:, :3]), "vertices, but at least", 0
    yield write(folder / "shell.stl", both, shell), "only the side that is draped", 0
    bad = x.copy()
    bad[2, 5] = np.nan
    yield write(folder / "nan.stl", bad, t), "far from all others", 0
    steep = plate(height=lambda x, y: 0.3 * x)
    yield write(folder / "steep.stl", *steep), "is at its edge or on a slope", 0
    hollow = plate(height=lambda x, y: -bump_height(x, y))
    yield write(folder / "hollow.stl", *hollow), "is at its edge or on a slope", 0
    yield (
        write(folder / "metres.stl", 1e-3 * x, t),
        "use a smaller ply, or specify the unit of the tool file",
        1,
    )
    for scale in (1e3, 1e30):
        large = write(folder / f"{scale:g}.stl", scale * x, t)
        yield large, "use a larger ply, or specify the unit of the tool file", 1


def test_invalid_tools_are_rejected_in_one_line(tmp_path, capsys):
    for file, reason, warnings in invalid_tools(tmp_path):
        words = run_words(tmp_path / "out", tool=file)
        assert reason in rejected(capsys, *words, warnings=warnings)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--point", "0", "0", "nan"), "scene.point_mm must be a finite number"),
        (("--point", "0", "0", "90"), "specify a point on the tool"),
        (("--point", "0", "0", "1e306"), "specify a point on the tool"),
        (("--point", "130", "0", "0"), "the contact point of the ply, (129.8"),
        (("--point", "0", "0"), "expected 3 arguments"),
        (("--part-mesh", "none.stl"), "output.part_mesh none.stl: no such file"),
        (("--trim", "none.csv"), "output.trim none.csv: no such file"),
        (("--width", "-5"), "the width must be positive"),
    ],
)
def test_bad_options_are_rejected_in_one_line(tool, options, reason, tmp_path, capsys):
    assert reason in rejected(capsys, *run_words(tmp_path / "out", *options, tool=tool))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("x,y\n0,0\n", "row 1: the header must name the columns x, y and z"),
        (
            "x,y,z\n0,0,0\n1,0,0\n1,nan,0\n",
            "row 4: expected three finite coordinates, got '1,nan,0'",
        ),
        ("x,y,z\n0,0,0\n1,0\n", "row 3: expected three finite coordinates, got '1,0'"),
        ("x,y,z\n0,0,0\n1,0,0\n0,0,0\n", "at least 3 are required"),
        ("", "the file is empty"),
    ],
)
def test_invalid_curves_are_rejected_in_one_line(tool, text, reason, tmp_path, capsys):
    curve = tmp_path / "curve.csv"
    curve.write_text(text)
    words = run_words(tmp_path / "out", "--trim", str(curve), tool=tool)
    assert reason in rejected(capsys, *words)


def test_a_bending_stiffness_is_required_without_a_net(tmp_path, capsys, monkeypatch):
    monkeypatch.undo()  # a coarse net would miss the fold
    file = write_sphere(tmp_path / "ball.stl", 900)
    large = "--width", "330", "--height", "330", "--tension", "2"
    words = run_words(tmp_path / "out", *large, tool=file)
    _, warning, message = rejected(capsys, *words, warnings=2).splitlines()
    assert "their net folds at" in warning
    assert "give the fibres a bending stiffness" in message
