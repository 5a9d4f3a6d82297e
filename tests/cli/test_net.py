"""The command ``net``."""

import json
import re
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from scipy.spatial import KDTree

from skfem_textile import drape
from skfem_textile.cli import main as cli
from skfem_textile.cli.net_report import Part, refuse_overlap, useless_darts
from skfem_textile.io import read_surface
from tests.helpers import tool_shapes
from tests.helpers.pages import references


@pytest.fixture(scope="module")
def tool(tmp_path_factory):
    """A cap of a sphere of 100 mm with its pole at the origin."""
    x, triangles = tool_shapes.height_field(
        lambda x, y: np.sqrt(100.0**2 - x**2 - y**2) - 100.0, 100.0, 100.0, 6.0
    )
    path = tmp_path_factory.mktemp("tool") / "cap.stl"
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    return path


def laid(out, tool, *words):
    common = ("net", "--tool", str(tool), "--out", str(out))
    assert cli.main([*common, *map(str, words)]) == 0
    return json.loads((out / "summary.json").read_text())


def test_shear_on_a_cap_agrees_with_the_exact_sphere(tmp_path, tool):
    laid(tmp_path, tool, "--no-render", "--point", 0, 0, 0, "--cell", 2.0)
    cells = meshio.read(tmp_path / "net.vtu")
    centres = cells.points[cells.cells[0].data].mean(axis=1)
    sphere = drape.Sphere(100.0, (0.0, 0.0, -100.0))
    exact = drape.net(sphere, 2.0, (30, 30), (30, 30))
    corners = exact.positions[:, :-1, :-1], exact.positions[:, 1:, 1:]
    places = (0.5 * (corners[0] + corners[1])).reshape(3, -1).T
    away, nearest = KDTree(places).query(centres)
    expected = np.degrees(exact.shear_angle()).ravel()[nearest]
    assert away.max() < 0.2
    assert cells.cell_data["shear_angle_deg"][0] == pytest.approx(expected, abs=0.3)
    assert np.abs(expected).max() > 14.0


def test_net_covers_the_cap_and_the_pattern_is_larger(tmp_path, tool):
    summary = laid(tmp_path, tool, "--no-render", "--point", 0, 0, 0)
    of_tool = summary["area_of_tool_mm2"]
    assert summary["area_of_part_mm2"] == pytest.approx(of_tool, rel=1e-3)
    assert 1.0 < summary["pattern_area_mm2"] / of_tool < 1.03


def test_files_and_page_are_written(tmp_path, tool):
    laid(tmp_path, tool, "--cell", 8, "--locking-angle", 5)
    assert {p.name for p in tmp_path.iterdir()} >= {
        *("fibres.vtu", "fibres.csv", "fibres.inp", "net.vtu", "net.png"),
        *("net.html", "pattern.csv", "pattern.svg", "summary.json"),
    }
    page = (tmp_path / "net.html").read_text(encoding="utf-8")
    assert "above the locking angle of 5°" in page
    assert page.count("data:image/") == 2
    assert references(tmp_path / "net.html") == []
    cells = meshio.read(tmp_path / "net.vtu")
    assert np.isfinite(cells.points).all()
    assert cells.cell_data["shear_angle_deg"][0].size == len(cells.cells[0].data)


def test_fibres_turn_with_the_angle(tmp_path, tool):
    laid(tmp_path, tool, "--no-render", "--cell", 8, "--fibres", 30)
    rows = np.genfromtxt(tmp_path / "fibres.csv", delimiter=",", names=True)
    middle = np.hypot(rows["x"], rows["y"]) < 8
    assert middle.any()
    assert rows["warp_angle_deg"][middle] == pytest.approx(30.0, abs=1.0)


def test_a_hole_is_cut_out_of_the_pattern_and_of_the_part(tmp_path):
    x, triangles = tool_shapes.ring(inner=40.0, outer=100.0)
    path = tmp_path / "ring.stl"
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    summary = laid(
        tmp_path / "out", path, "--no-render", "--cell", 5, "--point", 70, 0, 0
    )
    area = np.pi * (100.0**2 - 40.0**2)
    for what in ("pattern_area_mm2", "area_of_part_mm2", "area_of_tool_mm2"):
        assert summary[what] == pytest.approx(area, rel=5e-3)
    assert summary["pattern_length_mm"] == pytest.approx(2 * np.pi * 140.0, rel=5e-3)


def test_a_box_gets_darts_at_its_corners(tmp_path):
    x, triangles = tool_shapes.deep_box(100.0, 80.0, 30.0, flange=20.0, size=4.0)
    path = tmp_path / "box.stl"
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    words = ("--no-render", "--cell", 4, "--locking-angle", 50)
    without = laid(tmp_path / "without", path, *words)
    summary = laid(tmp_path / "darts", path, "--darts", *words)
    assert without["max_shear_angle_deg"] > 50 or "pattern" in without
    assert summary["max_shear_angle_deg"] < 50
    assert summary["darts"] == 4
    assert summary["area_of_part_mm2"] == pytest.approx(
        summary["area_of_tool_mm2"], rel=0.01
    )


def test_darts_that_do_not_lower_the_shear_are_told():
    cells = SimpleNamespace(angles=np.array([3.0, 40.0]))
    part = Part(None, darts=("a dart",), uncut_angle=40.05)
    useless = "1 without use: the shear angle is up to 40.0°, and 40.0° without darts"
    assert useless_darts(part, cells).startswith(useless)
    assert useless_darts(part._replace(uncut_angle=45.0), cells) == ""
    assert useless_darts(part._replace(uncut_angle=None), cells) == ""
    assert useless_darts(part._replace(darts=()), cells) == ""


def test_darts_are_compared_with_the_net_without_them(tmp_path, capsys):
    x, triangles = tool_shapes.height_field(
        lambda x, y: np.sqrt(100.0**2 - x**2 - y**2) - 100.0, 120.0, 120.0, 5.0
    )
    path = tmp_path / "cap.stl"
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    words = ("--no-render", "--cell", 5, "--darts", "--locking-angle")
    one = laid(tmp_path / "cut", path, *words, 15)
    without = laid(tmp_path / "none", path, *words, 30)
    uncut = one["max_shear_angle_without_darts_deg"]
    assert without["max_shear_angle_deg"] == pytest.approx(uncut)
    assert one["max_shear_angle_deg"] < 15
    out = capsys.readouterr().out
    assert "; without darts the shear angle is up to 22.2°" in out
    assert re.search("Darts +none is needed", out)


def test_a_side_of_darts_without_cells_is_told(tmp_path, capsys):
    def dome(x, y):
        return np.where(np.hypot(x, y) < 50, 30 * (1 - (x**2 + y**2) / 50**2) ** 2, 0)

    x, triangles = tool_shapes.height_field(dome, 200.0, 200.0, 10.0)
    path = tmp_path / "dome.stl"
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    words = ("--cell", "8", "--locking-angle", "15", "--darts", "--no-render")
    arguments = ("net", "--tool", str(path), "--out", str(tmp_path / "out"))
    assert cli.main([*arguments, *words]) == 1
    assert "no net can be laid on one side of the darts" in capsys.readouterr().out


def test_courses_cover_the_tool(tmp_path, tool):
    words = ("--no-render", "--cell", 5, "--roll-width", 40, "--overlap", 10)
    summary = laid(tmp_path, tool, *words)
    assert summary["courses"] == 5
    assert summary["area_of_courses_mm2"] > summary["area_of_tool_mm2"]
    rows = np.genfromtxt(tmp_path / "pattern.csv", delimiter=",", names=True)
    cut = np.isnan(rows["seam"])
    assert set(rows["curve"][cut]) == {1, 2, 3, 4, 5}
    assert set(rows["seam"][~cut]) == {1, 2, 3, 4}


def test_largest_shear_is_on_the_part(tmp_path, tool):
    """Cells that overhang the edge shear more."""
    summary = laid(tmp_path, tool, "--no-render", "--cell", 5, "--point", 0, 0, 0)
    at = [abs(summary[f"max_shear_angle_at_{axis}_mm"]) for axis in "xy"]
    assert max(at) <= 50.0 + 2.5


def curve_file(path, points):
    """A trimming curve, shape (3, n)."""
    lines = [",".join(map(str, x)) for x in np.transpose(points)]
    path.write_text("\n".join(["x,y,z", *lines]))
    return path


def test_without_a_pattern_the_exit_code_is_one(tmp_path, tool):
    """The curve is a figure of eight."""
    t = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    x, y = 30 * np.sin(t), 30 * np.sin(t) * np.cos(t)
    z = np.sqrt(1e4 - x**2 - y**2) - 100
    curve = curve_file(tmp_path / "trim.csv", [x, y, z])
    words = ("net", "--tool", str(tool), "--out", str(tmp_path / "out"), "--no-render")
    assert cli.main([*words, "--trim", str(curve), "--cell", "4"]) == 1
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "not written" in summary["pattern"]


def test_courses_that_do_not_cover_the_tool_are_told(tmp_path):
    """Three quarters of a flat ring: threads do not come back to its end."""

    def sector(s, t):
        turn, r = np.radians(270 * s), 60 + 80 * t
        return np.array([r * np.cos(turn), r * np.sin(turn), 0 * r])

    x, triangles = tool_shapes.patch(sector, 480.0, 80.0, 8.0)
    path = tmp_path / "sector.stl"
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    words = ("net", "--tool", str(path), "--out", str(tmp_path / "out"), "--no-render")
    point = ("--point", "100", "0", "0", "--cell", "4", "--fibres", "90")
    assert cli.main([*words, *point, "--roll-width", "40"]) == 1
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["area_not_covered_mm2"] > 0.1 * summary["area_of_tool_mm2"]
    verdict = (tmp_path / "out" / "net.html").read_text(encoding="utf-8")
    assert "% of the tool, but not" in verdict


def test_a_given_direction_is_kept_by_the_search(tmp_path, tool):
    words = ("--no-render", "--cell", 8, "--best", "--fibres", 30)
    summary = laid(tmp_path, tool, *words)
    assert summary["fibres_deg"] == pytest.approx(30.0)
    default = laid(tmp_path / "default", tool, *words[:3], "--fibres", 30)
    assert summary["max_shear_angle_deg"] <= default["max_shear_angle_deg"] + 1e-9


def test_without_a_pattern_with_darts_the_uncut_one_is_given(
    tmp_path, tool, monkeypatch
):
    def crossing(*of, **settings):
        raise ValueError("the outline crosses itself")

    words = ("--no-render", "--cell", 5, "--locking-angle", 10)
    uncut = laid(tmp_path / "uncut", tool, *words)
    monkeypatch.setattr(drape, "pattern_with_darts", crossing)
    out = tmp_path / "out"
    common = ("net", "--tool", str(tool), "--out", str(out))
    assert cli.main([*common, "--darts", *map(str, words)]) == 1
    summary = json.loads((out / "summary.json").read_text())
    assert summary["darts"] == "not found: the outline crosses itself"
    same = ("pattern_area_mm2", "area_of_part_mm2", "max_shear_angle_deg")
    assert [summary[key] for key in same] == [uncut[key] for key in same]
    page = (out / "net.html").read_text(encoding="utf-8")
    assert "no pattern with darts was found" in page


def test_a_pattern_whose_darts_overlap_on_the_tool_is_refused(tool):
    part = Part(read_surface(tool))
    twice = SimpleNamespace(area_on_tool=1.05 * part.area())
    with pytest.raises(ValueError, match="both sides of the darts cover"):
        refuse_overlap(part, twice)


def test_a_concave_tool_has_a_start_near_its_middle(tmp_path):
    bowl = tmp_path / "bowl.stl"
    x, triangles = tool_shapes.height_field(
        lambda x, y: (x**2 + y**2) / 200.0, 100.0, 100.0, 6.0
    )
    meshio.write_points_cells(bowl, x.T, [("triangle", triangles.T)])
    summary = laid(tmp_path / "out", bowl, "--no-render", "--cell", 5)
    start = [summary[f"start_at_{axis}_mm"] for axis in "xy"]
    assert np.hypot(*start) < 10


def test_the_best_start_of_a_trimmed_part_is_on_it(tmp_path):
    """A high bump beside the part folds nets and does not count."""
    x, triangles = tool_shapes.height_field(
        lambda x, y: (
            15 * np.exp(-(((x + 60) / 30) ** 2) - (y / 30) ** 2)
            + 70 * np.exp(-(((x - 70) / 20) ** 2) - (y / 20) ** 2)
        ),
        *(260.0, 140.0, 7.0),
    )
    path, curve = tmp_path / "bumps.stl", tmp_path / "trim.csv"
    meshio.write_points_cells(path, x.T, [("triangle", triangles.T)])
    lines = [f"{x},{y},0" for x, y in ((-115, -55), (0, -55), (0, 55), (-115, 55))]
    curve.write_text("\n".join(["x,y,z", *lines]))
    words = ("--no-render", "--trim", curve, "--cell", 6)
    best = laid(tmp_path / "best", path, *words, "--best", "largest")
    other = laid(tmp_path / "other", path, *words, "--point", -20, 40, 0)
    assert best["max_shear_angle_deg"] < 0.6 * other["max_shear_angle_deg"]
    assert -115 <= best["start_at_x_mm"] <= 0
    assert best["area_of_part_mm2"] == pytest.approx(115 * 110 * 1.05, rel=0.05)
