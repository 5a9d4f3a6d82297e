"""The command ``net``."""

import re
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
import shapely
from scipy.spatial import KDTree

from skfem_textile import drape
from skfem_textile.cli import main as cli
from skfem_textile.cli.net_report import Part, refuse_overlap, useless_darts
from skfem_textile.io import read_surface
from tests.helpers import tool_shapes
from tests.helpers.command_line import summary_in
from tests.helpers.curves import write_columns
from tests.helpers.pages import references
from tests.helpers.tools import write


@pytest.fixture(scope="module")
def tool(tmp_path_factory):
    """A cap of a sphere of 100 mm with its pole at the origin."""
    return write(tmp_path_factory.mktemp("tool") / "cap.stl", *tool_shapes.cap())


def laid(out, tool, words, code=0):
    """Summary of a net without a picture."""
    line = ["net", "--tool", str(tool), "--out", str(out), "--no-render"]
    assert cli.main([*line, *words.split()]) == code
    return summary_in(out)


@pytest.fixture(scope="module")
def net(tmp_path_factory, tool):
    """Folder and summary of a net on the cap, from its pole."""
    out = tmp_path_factory.mktemp("net")
    return out, laid(out, tool, "--point 0 0 0 --cell 5")


def test_shear_on_a_cap_agrees_with_the_exact_sphere(net):
    cells = meshio.read(net[0] / "net.vtu")
    centres = cells.points[cells.cells[0].data].mean(axis=1)
    sphere = drape.Sphere(100.0, (0.0, 0.0, -100.0))
    exact = drape.net(sphere, 5.0, (12, 12), (12, 12))
    corners = exact.positions[:, :-1, :-1], exact.positions[:, 1:, 1:]
    places = (0.5 * (corners[0] + corners[1])).reshape(3, -1).T
    away, nearest = KDTree(places).query(centres)
    expected = np.degrees(exact.shear_angle()).ravel()[nearest]
    assert away.max() < 0.2
    assert cells.cell_data["shear_angle_deg"][0] == pytest.approx(expected, abs=0.3)
    assert np.abs(expected).max() > 14.0


def test_a_net_covers_the_cap_and_its_pattern_is_larger(net):
    """The largest shear is on the part: cells that overhang the edge shear more."""
    summary = net[1]
    of_tool = summary["area_of_tool_mm2"]
    assert summary["area_of_part_mm2"] == pytest.approx(of_tool, rel=1e-3)
    assert 1.0 < summary["pattern_area_mm2"] / of_tool < 1.03
    at = [abs(summary[f"max_shear_angle_at_{axis}_mm"]) for axis in "xy"]
    assert max(at) <= 50.0 + 2.0


@pytest.fixture(scope="module")
def drawn(tmp_path_factory, tool):
    """Folder of a drawn net on the cap."""
    out = tmp_path_factory.mktemp("drawn")
    line = f"net --tool {tool} --out {out} --cell 8 --locking-angle 10"
    assert cli.main(line.split()) == 0
    return out


def test_files_and_page_are_written(drawn):
    assert {p.name for p in drawn.iterdir()} >= {
        *("fibres.vtu", "fibres.csv", "fibres.inp", "net.vtu", "net.png"),
        *("net.html", "pattern.csv", "pattern.svg", "summary.json"),
    }
    page = (drawn / "net.html").read_text(encoding="utf-8")
    assert "above the locking angle of 10°" in page
    assert page.count("data:image/") == 2
    assert references(drawn / "net.html") == []
    cells = meshio.read(drawn / "net.vtu")
    assert np.isfinite(cells.points).all()
    assert cells.cell_data["shear_angle_deg"][0].size == len(cells.cells[0].data)


def test_fibres_turn_with_the_angle(tmp_path, tool):
    laid(tmp_path, tool, "--cell 8 --fibres 30")
    rows = np.genfromtxt(tmp_path / "fibres.csv", delimiter=",", names=True)
    middle = np.hypot(rows["x"], rows["y"]) < 8
    assert middle.any()
    assert rows["warp_angle_deg"][middle] == pytest.approx(30.0, abs=1.0)


def test_a_hole_is_cut_out_of_the_pattern_and_of_the_part(tmp_path):
    ring = write(tmp_path / "ring.stl", *tool_shapes.ring(inner=40.0, outer=100.0))
    words = "--cell 16 --point 70 0 0 --pattern csv"
    summary = laid(tmp_path / "out", ring, words)
    assert [file.name for file in tmp_path.glob("out/pattern.*")] == ["pattern.csv"]
    area = np.pi * (100.0**2 - 40.0**2)
    for what in ("pattern_area_mm2", "area_of_part_mm2", "area_of_tool_mm2"):
        assert summary[what] == pytest.approx(area, rel=5e-3)
    assert summary["pattern_length_mm"] == pytest.approx(2 * np.pi * 140.0, rel=5e-3)


@pytest.mark.dear("the only box that gets darts")
def test_a_box_gets_darts_at_its_corners(tmp_path, capsys):
    box = tool_shapes.deep_box(60.0, 50.0, 20.0, flange=14.0, size=5.0)
    tool = write(tmp_path / "box.stl", *box)
    summary = laid(tmp_path / "out", tool, "--cell 5 --locking-angle 50 --darts")
    uncut = summary["max_shear_angle_without_darts_deg"]
    assert uncut > 50
    told = f"; without darts the shear angle is up to {uncut:.1f}°"
    assert told in capsys.readouterr().out
    assert summary["max_shear_angle_deg"] < 50
    assert summary["darts"] == 4
    covered = summary["area_of_tool_mm2"] - summary["area_not_covered_mm2"]
    assert summary["area_of_part_mm2"] == pytest.approx(covered, rel=0.01)


def test_darts_that_do_not_lower_the_shear_are_told():
    cells = SimpleNamespace(angles=np.array([3.0, 40.0]))
    part = Part(None, darts=("a dart",), uncut_angle=40.05)
    useless = "1 without use: the shear angle is up to 40.0°, and 40.0° without darts"
    assert useless_darts(part, cells).startswith(useless)
    assert useless_darts(part._replace(uncut_angle=45.0), cells) == ""
    assert useless_darts(part._replace(uncut_angle=None), cells) == ""
    assert useless_darts(part._replace(darts=()), cells) == ""


def test_a_net_within_the_locking_angle_gets_no_darts(tmp_path, tool, capsys):
    laid(tmp_path, tool, "--cell 8 --darts --locking-angle 30")
    assert re.search("Darts +none is needed", capsys.readouterr().out)


def test_a_side_of_darts_without_cells_is_told(tmp_path, capsys):
    def dome(x, y):
        return np.where(np.hypot(x, y) < 50, 30 * (1 - (x**2 + y**2) / 50**2) ** 2, 0)

    shape = tool_shapes.height_field(dome, 200.0, 200.0, 10.0)
    tool = write(tmp_path / "dome.stl", *shape)
    words = "--cell 10 --locking-angle 15 --darts"
    laid(tmp_path / "out", tool, words, code=1)
    assert "no net can be laid on one side of the darts" in capsys.readouterr().out


@pytest.mark.dear("the only courses of the command that cover a tool")
def test_courses_cover_the_tool(tmp_path, tool):
    summary = laid(tmp_path, tool, "--cell 8.5 --roll-width 40 --overlap 10")
    assert summary["courses"] == 4
    assert summary["area_of_courses_mm2"] > summary["area_of_tool_mm2"]
    rows = np.genfromtxt(tmp_path / "pattern.csv", delimiter=",", names=True)
    cut = np.isnan(rows["seam"])
    assert set(rows["curve"][cut]) == {1, 2, 3, 4}
    assert set(rows["seam"][~cut]) == {1, 2, 3}


def trim(path, x, y):
    """A trimming curve on the cap."""
    z = np.sqrt(1e4 - x**2 - y**2) - 100
    return write_columns(path, "x,y,z", x, y, z)


def trim_box(path, *sides):
    """A trimming curve along a rectangle between x, y and x, y."""
    ring = shapely.segmentize(shapely.box(*sides), 4.0).exterior
    return trim(path, *np.array(ring.xy)[:, :-1])


def test_without_a_pattern_the_exit_code_is_one(tmp_path, tool):
    """The curve is a figure of eight."""
    t = np.linspace(0, 2 * np.pi, 80, endpoint=False)
    x, y = 30 * np.sin(t), 30 * np.sin(t) * np.cos(t)
    curve = trim(tmp_path / "trim.csv", x, y)
    summary = laid(tmp_path / "out", tool, f"--trim {curve} --cell 4", code=1)
    assert "not written" in summary["pattern"]


@pytest.mark.dear("the only tool that courses do not cover")
def test_courses_that_do_not_cover_the_tool_are_told(tmp_path):
    """Three quarters of a flat ring: threads do not come back to its end."""

    def sector(s, t):
        turn, r = np.radians(270 * s), 60 + 80 * t
        return np.array([r * np.cos(turn), r * np.sin(turn), 0 * r])

    shape = tool_shapes.patch(sector, 480.0, 80.0, 16.0)
    tool = write(tmp_path / "sector.stl", *shape)
    words = "--point 100 0 0 --cell 10 --fibres 90 --roll-width 40"
    summary = laid(tmp_path / "out", tool, words, code=1)
    bare = summary["area_not_covered_mm2"] / summary["area_of_tool_mm2"]
    assert bare > 0.1
    verdict = (tmp_path / "out" / "net.html").read_text(encoding="utf-8")
    shown = re.search(r"([\d.]+) % of the tool, but not", verdict)[1]
    assert 0 <= 100 * (1 - bare) - float(shown) < 0.1


@pytest.mark.parametrize(("fibres", "warp"), [("", 0), ("--fibres 30", 30)])
def test_the_best_start_is_searched_over_the_trimmed_part(
    tmp_path, tool, monkeypatch, fibres, warp
):
    """In the given direction, if any; the net starts there."""
    searched = {}

    def best_start(*_, **settings):
        searched.update(settings)
        (default,) = settings["others"]
        start = default._replace(point=(-25.0, 5.0, -3.3))
        measures = {"measure": 0.1, "measures": [0.1], "others": np.array([0.2])}
        return SimpleNamespace(start=start, **measures)

    monkeypatch.setattr(drape, "best_start", best_start)
    curve = trim_box(tmp_path / "trim.csv", -40, -30, -10, 30)
    words = f"--cell 6 --trim {curve} {fibres} --best largest"
    summary = laid(tmp_path / "best", tool, words)
    assert searched["measure"] == "largest"
    assert searched["fixed_direction"] == bool(fibres)
    assert searched["angles"] == pytest.approx(np.radians([warp, warp + 90]))
    low, high = searched["points"].min(axis=1), searched["points"].max(axis=1)
    assert low[:2] == pytest.approx([-40, -30], abs=1)
    assert high[:2] == pytest.approx([-10, 30], abs=1)
    assert summary["start_at_x_mm"] == pytest.approx(-25, abs=0.1)
    assert summary["fibres_deg"] == pytest.approx(warp)
    page = (tmp_path / "best" / "net.html").read_text(encoding="utf-8")
    assert "largest shear angle 5.7°, 11.5° from the default start" in page
    assert summary["area_of_part_mm2"] == pytest.approx(30 * 60 * 1.05, rel=0.05)


@pytest.mark.dear("the only darts without a pattern")
def test_without_a_pattern_with_darts_the_uncut_one_is_given(
    tmp_path, tool, drawn, monkeypatch
):
    def crossing(*of, **settings):
        raise ValueError("the outline crosses itself")

    monkeypatch.setattr(drape, "pattern_with_darts", crossing)
    uncut, out = summary_in(drawn), tmp_path / "out"
    summary = laid(out, tool, "--cell 8 --locking-angle 10 --darts", code=1)
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
    bowl = tool_shapes.height_field(
        lambda x, y: (x**2 + y**2) / 200.0, 100.0, 30.0, 8.0
    )
    tool = write(tmp_path / "bowl.stl", *bowl)
    summary = laid(tmp_path / "out", tool, "")
    assert summary["cell_mm"] == pytest.approx(1.05, abs=0.01)  # of the diagonal
    start = [summary[f"start_at_{axis}_mm"] for axis in "xy"]
    assert np.hypot(*start) < 10


# Plies with a user-defined outline, and meshes of the part

OUTLINE = "x,y", "5,5", "45,5", "45,35", "25,45", "5,35"


def test_a_ply_with_an_outline_covers_its_own_area(tmp_path, tool):
    """Its pattern is the outline, its middle is at the start; the part has fibres."""
    (tmp_path / "ply.csv").write_text("\n".join(OUTLINE))
    outline = f"--outline {tmp_path / 'ply.csv'} --fibres 30 --cell 3 --point 0 0 0"
    summary = laid(tmp_path / "out", tool, f"{outline} --part-mesh {tool}")
    assert summary["pattern_area_mm2"] == pytest.approx(40 * 30 + 200, rel=1e-3)
    assert summary["area_of_part_mm2"] == pytest.approx(40 * 30 + 200, rel=0.03)
    assert summary["area_not_covered_mm2"] == 0
    part = meshio.read(tmp_path / "out" / "part.vtu")
    x = part.points[part.cells[0].data].mean(axis=1)
    covered = part.cell_data["covered"][0].astype(bool)
    assert np.abs(x[covered]).max(axis=0)[:2] == pytest.approx([20, 20], abs=4)
    assert covered.mean() == summary["part_covered_share_of_elements"]


def test_curves_in_the_wrong_order_are_refused(tmp_path, tool, capsys):
    hole, rim = (trim_box(tmp_path / f"{n}.csv", -n, -n, n, n) for n in (8, 30))
    line = f"net --tool {tool} --cell 5 --out {tmp_path / 'out'} --trim {hole} {rim}"
    assert cli.main(line.split()) == 2
    assert "specify the outline first, then its holes" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("side", "text"),
    [
        (400, "ply.csv: outline of 400 x 400 mm: net: "),
        (2500, "ply.csv: the outline extends over 2500 mm, the tools over "),
        (1.2, "over 1.2 mm: if it is in m, specify this unit (--outline-unit)"),
    ],
)
def test_an_outline_of_another_size_than_the_tool_is_told(
    tmp_path, tool, capsys, caplog, side, text
):
    x, y = side * np.array([[0, 1, 1, 0], [0, 0, 1, 1]])
    outline = str(write_columns(tmp_path / "ply.csv", "x,y", x, y))
    words = ["net", "--tool", str(tool), "--cell", "8", "--outline", outline]
    cli.main([*words, "--no-render", "--out", str(tmp_path / "out")])
    assert text in "".join(capsys.readouterr()) + caplog.text


def test_a_ply_that_runs_off_the_tool_is_told_where(tmp_path, tool):
    (tmp_path / "ply.csv").write_text("\n".join(OUTLINE))
    edge = np.ptp(read_surface(tool).facets.points[0]) / 2
    x, z = edge - 10, (100**2 - (edge - 10) ** 2) ** 0.5 - 100
    outline = f"--outline {tmp_path / 'ply.csv'} --cell 5 --point {x} 0 {z}"
    reason = laid(tmp_path / "out", tool, outline, code=1)["pattern"]
    found = re.search(r"runs off the edge of the tool at \((.*)\) mm: move", reason)
    place = np.array(found[1].split(","), dtype=float)
    assert read_surface(tool).from_triangles(place[:, None]) < 0.01
    assert np.abs(place[:2]).max() == pytest.approx(edge)
    assert "--point" in reason


def test_a_ply_that_is_too_small_does_not_cover_the_trimmed_part(tmp_path, tool):
    (tmp_path / "ply.csv").write_text("\n".join(OUTLINE))
    curve = trim_box(tmp_path / "trim.csv", -30, -10, 30, 10)
    outline = f"--outline {tmp_path / 'ply.csv'} --cell 3 --point 0 0 0 --trim {curve}"
    summary = laid(tmp_path / "out", tool, outline, code=1)
    assert summary["area_not_covered_mm2"] == pytest.approx(2 * 10 * 20, rel=0.2)
    assert "the ply does not lie on" in summary["pattern"]
