"""What a run on a tool hands over: fibres on a part, and its flat pattern."""

import meshio
import numpy as np
import pytest

from tests.helpers.tool_files import ball, bump, command, plate, summary, write


def test_fibres_and_pattern_are_handed_over(tool, tmp_path):
    """On a tool that is flat the pattern is the part, and fibres keep their angle."""
    flat = write(tmp_path / "flat.stl", *plate(height=lambda x, y: 0 * x))
    x, t = plate(40.0, 9, lambda x, y: 0 * x)
    part, out = write(tmp_path / "part.stl", x, t), tmp_path / "out"
    options = "--fibres", "20", "--part-mesh", str(part)
    assert command(out, *options, tool=flat) == 0
    found = summary(out)
    assert found["part_covered_share_of_elements"] == 1
    assert found["pattern_area_mm2"] == pytest.approx(80 * 80, rel=1e-3)
    assert found["pattern_length_mm"] == pytest.approx(4 * 80, rel=1e-3)
    fibres = meshio.read(out / "part.vtu")
    np.testing.assert_allclose(fibres.cell_data["warp_angle_deg"][0], 20, atol=1e-6)
    for name in ("part.csv", "part.inp", "pattern.csv", "pattern.svg"):
        assert (out / name).stat().st_size > 100
    assert {f.name for f in (out / "case_files").iterdir()} == {
        "tool.stl",
        "part_mesh.stl",
    }


def test_the_area_to_cut_is_that_of_all_pieces_less_their_holes(tmp_path):
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
    rows = np.column_stack([a, x, y, bump(x, y)])
    np.savetxt(curve, rows, delimiter=",", header="angle,X,y (mm), z", comments="")
    assert command(out, "--trim", str(curve), tool=tool) == 0
    found = summary(out)
    assert np.pi * 40**2 < found["pattern_area_mm2"] < 1.3 * np.pi * 40**2
    assert not (out / "part.vtu").exists()
    # A run without it leaves none of an earlier run.
    assert command(out, tool=tool) == 0
    assert not (out / "pattern.csv").exists()


def test_what_cannot_be_handed_over_is_told_beside_all_other_results(
    tool, tmp_path, capsys
):
    x, t = plate(40.0, 9)
    far = write(tmp_path / "far.stl", x + np.array([[500], [0], [0]]), t)
    out = tmp_path / "out"
    assert command(out, "--part-mesh", str(far), tool=tool) == 1
    assert "part: none: fibres on a tool" in capsys.readouterr().err
    found = summary(out)
    assert found["converged"]
    assert found["part"].startswith("none: ")
    assert (out / "fibres.vtu").exists()
    assert not (out / "part.vtu").exists()
    # The boundary leaves the ply, the elements do not all: fibres alone.
    assert command(out, "--width", "60", "--part-mesh", str(tool), tool=tool) == 0
    found = summary(out)
    assert 0 < found["part_covered_share_of_elements"] < 1
    assert "does not lie on" in found["pattern"]
    # The curve leaves the ply.
    curve = tmp_path / "curve.csv"
    curve.write_text("x,y,z\n-95,0,0\n95,0,0\n0,95,0\n")
    assert command(out, "--trim", str(curve), tool=tool) == 1
    assert (
        "pattern: none: flat pattern: the ply does not lie" in capsys.readouterr().err
    )
    assert not (out / "pattern.csv").exists()


def test_a_closed_part_has_fibres_and_no_pattern(tmp_path):
    file, out = ball(tmp_path / "ball.stl", 900), tmp_path / "out"
    options = "--part-mesh", str(file), "--width", "100", "--height", "100"
    assert command(out, *options, tool=file) == 0
    found = summary(out)
    assert "it is closed" in found["pattern"]
    assert 0 < found["part_covered_share_of_elements"] < 0.2
