"""A ply on a tool of a file, from the command line: claims and refusals."""

import json

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from skfem_textile import Fabric, Result, drape, equilibrium_near
from skfem_textile.cli import main as cli
from skfem_textile.io import read_surface, read_tool_mesh
from skfem_textile.scenes import Case, hemisphere
from skfem_textile.scenes import drape as on_tool

meshio = pytest.importorskip("meshio")

SMALL = "--size", "6x6", "--steps", "2", "--no-render"

#: Fibres that resist bending, without tension: no net takes time.
BENT = "--tension", "0", "--bending-warp", "5", "--bending-weft", "5"


def write(file, x, triangles):
    meshio.write_points_cells(file, np.transpose(x), [("triangle", triangles.T)])
    return file


def ball(file, n=2502, radius=100.0, centre=(13.0, -7.0, 40.0)):
    """A sphere of 2n − 4 triangles, as an STL file."""
    k = np.arange(n) + 0.5
    z, around = 1 - 2 * k / n, np.pi * (1 + 5**0.5) * k
    x = np.array([np.cos(around), np.sin(around), np.ones(n)])
    x[:2] *= np.sqrt(1 - z * z)
    x[2] = z
    t = ConvexHull(x.T).simplices.T.copy()
    a, b, c = x[:, t[0]], x[:, t[1]], x[:, t[2]]
    inwards = (np.cross(b - a, c - a, axis=0) * a).sum(axis=0) < 0
    t[1:, inwards] = t[:0:-1, inwards]
    return write(file, radius * x + np.array(centre)[:, None], t)


def bump(x, y):
    return 30 * np.exp(-((x - 5) ** 2 + 1.5 * y**2) / 3200)


def plate(side=100.0, n=29, height=bump):
    """Points and triangles of a tool z = h(x, y) over a square."""
    s = np.linspace(-side, side, n)
    x, y = (a.ravel() for a in np.meshgrid(s, s))
    k = np.add.outer(n * np.arange(n - 1), np.arange(n - 1)).ravel()
    t = np.hstack([[k, k + 1, k + n + 1], [k, k + n + 1, k + n]])
    return np.array([x, y, height(x, y) + 0 * x]), t


@pytest.fixture(scope="module")
def tool(tmp_path_factory):
    return write(tmp_path_factory.mktemp("tool") / "bump.stl", *plate())


def run(scene):
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    case = Case(scene=scene, fabric=fabric, steps=2)
    result = case.run()
    return result, case.summary(result)


def command(out, *options, tool):
    line = "run", "drape", "--tool", str(tool), *SMALL, *BENT, *options
    return cli.main([*line, "--out", str(out)])


def summary(out):
    return json.loads((out / "summary.json").read_text())


@pytest.mark.parametrize(("fibres", "tension"), [(17.0, 2.0), (63.0, 0.0)])
def test_triangles_of_a_sphere_shear_a_ply_as_the_sphere_does(
    tmp_path, fibres, tension
):
    """5000 triangles, and none of the angles at which a quarter is enough."""
    file, angle = ball(tmp_path / "ball.stl"), np.radians(fibres)
    mesh = read_surface(file)
    assert mesh.facets.n_elements == 5000
    given = {"size": (8, 8), "fibres": angle, "tension": tension}
    own, found = run(on_tool(mesh, **given))
    exact, _ = run(hemisphere(part="whole", **given))
    off = own.ply.shear_angle(own.u) - exact.ply.shear_angle(exact.u)
    assert np.degrees(np.abs(off).max()) < 0.001
    assert np.degrees(np.abs(exact.ply.shear_angle(exact.u)).max()) > 20
    top = [found[f"touches_at_{axis}_mm"] for axis in "xyz"]
    assert top == pytest.approx([13, -7, 140], abs=0.02)
    assert found["beyond_tool_share_of_area"] == 0
    assert "beyond_tool" not in found


def test_a_shell_with_both_its_sides_and_a_tool_turned_inside_out_are_told():
    """Sides of a shell that are 3 mm apart, where triangles have edges of 7 mm."""
    x, t = plate(height=lambda x, y: -(x**2 + y**2) / 400)
    given = {"size": (4, 4), "width": 100.0, "height": 100.0}
    _, plain = run(on_tool(drape.TriangleMesh(x, t), **given))
    assert "off_triangles" not in plain
    assert "faces_away" not in plain
    _, away = run(on_tool(drape.TriangleMesh(x, t[::-1]), **given))
    assert "faces down where the ply touches it" in away["faces_away"]
    bumped = plate(height=lambda x, y: bump(x, y) - bump(x - 60, y))
    _, both_ways = run(on_tool(drape.TriangleMesh(bumped[0], bumped[1][::-1]), **given))
    assert both_ways["min_contact_pressure_N_per_mm2"] < 0
    assert both_ways["max_contact_pressure_N_per_mm2"] > 0
    assert "faces down where the ply touches it" in both_ways["faces_away"]
    assert away["max_shear_angle_deg"] == pytest.approx(plain["max_shear_angle_deg"])
    both = np.hstack([x, x - np.array([[0], [0], [3]])])
    shell = drape.TriangleMesh(both, np.hstack([t, t[::-1] + x.shape[1]]))
    _, off = run(on_tool(shell, **given))
    assert "give one side of a shell" in off["off_triangles"]


def test_a_ply_on_a_flat_tool_bridges_nothing():
    """However it is inclined; round-off presses and pulls by 1e-8 N/mm²."""
    x, t = plate(height=lambda x, y: 0.3 * x - 0.2 * y)
    tool, middle = drape.TriangleMesh(x, t), np.zeros(3)
    _, found = run(on_tool(tool, point=middle, size=(6, 6), width=120.0, height=120.0))
    assert 0 < abs(found["min_contact_pressure_N_per_mm2"]) < 1e-7
    assert found["bridging_share_of_area"] == 0


def test_a_tool_that_is_moved_as_a_whole_shears_the_ply_alike(tool):
    """About y, in whose plane the normal is: x of the ply goes with the tool."""
    mesh = read_tool_mesh(tool)
    c, s = np.cos(0.6), np.sin(0.6)
    Q, shift = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]), np.array([40.0, 9.0, -7.0])
    moved = Q @ mesh.points + shift[:, None]
    surface = drape.TriangleMesh(mesh.points, mesh.triangles())
    other = drape.TriangleMesh(moved, mesh.triangles())
    given = {"size": (6, 6), "width": 150.0, "fibres": 0.4, "tension": 0.0}
    place = np.array([-10.0, 0.0, bump(-10.0, 0.0)])
    (one, found), (two, after) = (
        run(on_tool(surface, point=place, **given)),
        run(on_tool(other, point=Q @ place + shift, **given)),
    )
    off = one.ply.shear_angle(one.u) - two.ply.shear_angle(two.u)
    assert np.degrees(np.abs(off).max()) < 0.01
    assert found["max_shear_angle_deg"] > 10
    at, then = (
        np.array([it[f"max_shear_angle_at_{axis}_mm"] for axis in "xyz"])
        for it in (found, after)
    )
    np.testing.assert_allclose(then, Q @ at + shift, atol=0.1)


@pytest.mark.parametrize(
    ("height", "top"),
    [
        (bump, (5, 0, 30)),
        (lambda x, y: 0 * x + 4, (0, 0, 4)),  # flat
        (lambda x, y: np.sqrt(200**2 - x**2), (0, 0, 200)),  # a ridge along y
        (lambda x, y: bump(np.abs(x) - 35, y), (40, 0, 30)),  # two
    ],
)
def test_a_ply_touches_the_highest_point_nearest_to_the_middle(height, top):
    scene = on_tool(drape.TriangleMesh(*plate(height=height)))
    found = scene.axes.origin * (np.sign(scene.axes.origin[0]), 1, 1)
    assert found == pytest.approx(top, abs=0.1)
    np.testing.assert_allclose(scene.axes.turn, np.eye(3), atol=0.01)


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


def test_a_hole_of_the_tool_is_beyond_it():
    x, t = plate(height=lambda x, y: 0 * x)
    kept = np.hypot(*x[:2, t].mean(axis=1) - [[50], [0]]) > 20
    scene = on_tool(drape.TriangleMesh(x, t[:, kept]), size=(12, 12), tension=0.0)
    _, found = run(scene)
    share = np.pi * 20**2 / 180**2
    assert found["beyond_tool_share_of_area"] == pytest.approx(share, rel=0.3)


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
    assert "scene.tool is not given: name an STL file" in capsys.readouterr().err


EMPTY = "solid nothing\nendsolid nothing\n"


def refused_tools(folder):
    """Files that are no tool, and what is said of them."""
    x, t = plate()
    facing = np.hstack([t, t[::-1]])
    yield folder / "no.stl", "no.stl: no such file"
    empty = folder / "empty.stl"
    empty.write_text(EMPTY)
    yield empty, "empty.stl: it has no triangles"
    yield write(folder / "few.stl", x[:, :], t[:, :3]), "vertices are too few"
    yield write(folder / "facing.stl", x, facing), "orient them alike"
    bad = x.copy()
    bad[2, 5] = np.nan
    yield write(folder / "nan.stl", bad, t), "must be finite"
    steep = plate(height=lambda x, y: 0.3 * x)
    yield write(folder / "steep.stl", *steep), "is at its edge or on a slope"
    hollow = plate(height=lambda x, y: -bump(x, y))
    yield write(folder / "hollow.stl", *hollow), "is at its edge or on a slope"
    yield write(folder / "metres.stl", 1e-3 * x, t), "a smaller ply, or a file in mm"
    for scale in (1e3, 1e30):
        large = write(folder / f"{scale:g}.stl", scale * x, t)
        yield large, "take a larger ply, or a file in mm"


@pytest.mark.parametrize("number", range(10))
def test_what_is_no_tool_is_refused_in_one_line(number, tmp_path, capsys):
    file, reason = list(refused_tools(tmp_path))[number]
    assert command(tmp_path / "out", tool=file) == 2
    said = capsys.readouterr().err
    assert reason in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--point", "0", "0", "nan"), "--point must be three numbers"),
        (("--point", "0", "0", "90"), "from the tool: give a point on it"),
        (("--point", "0", "0", "1e306"), "from the tool: give a point on it"),
        (("--point", "130", "0", "0"), "the tool has no triangle at 129.8"),
        (("--point", "0", "0"), "expected 3 arguments"),
        (("--part-mesh", "none.stl"), "none.stl: no such file"),
        (("--trim", "none.csv"), "No such file"),
        (("--width", "-5"), "the width must be positive"),
    ],
)
def test_bad_options_are_refused_in_one_line(tool, options, reason, tmp_path, capsys):
    try:
        code = command(tmp_path / "out", *options, tool=tool)
    except SystemExit as stop:
        code = stop.code
    said = capsys.readouterr().err
    assert code == 2
    assert reason in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("x,y\n0,0\n", "row 1: the header must name the columns x, y and z"),
        ("x,y,z\n0,0,0\n1,0,0\n1,nan,0\n", "row 4: '1,nan,0' is no point"),
        ("x,y,z\n0,0,0\n1,0\n", "row 3: '1,0' is no point"),
        ("x,y,z\n0,0,0\n1,0,0\n0,0,0\n", "needs three points at least"),
        ("", "the file is empty"),
    ],
)
def test_what_is_no_curve_is_refused_in_one_line(tool, text, reason, tmp_path, capsys):
    curve = tmp_path / "curve.csv"
    curve.write_text(text)
    assert command(tmp_path / "out", "--trim", str(curve), tool=tool) == 2
    said = capsys.readouterr().err
    assert reason in said
    assert said.count("\n") == 1


def test_triangles_that_are_there_twice_change_nothing():
    x, t = plate()
    given = {"size": (4, 4), "width": 120.0, "tension": 0.0}
    once, _ = run(on_tool(drape.TriangleMesh(x, t), **given))
    twice, _ = run(on_tool(drape.TriangleMesh(x, np.hstack([t, t])), **given))
    np.testing.assert_allclose(once.u, twice.u, atol=1e-9)


def test_triangles_whose_corners_coincide_change_nothing(tmp_path):
    """An STL file of a surface of revolution has them at its pole."""
    x, t = plate(n=11)
    plain = read_surface(write(tmp_path / "plain.vtk", x, t))
    doubled = np.hstack([t, [[5], [5], [6]]])
    found = read_surface(write(tmp_path / "doubled.vtk", x, doubled))
    np.testing.assert_allclose(found.level(x), plain.level(x), atol=1e-10)


@pytest.mark.parametrize("point", [None, (12.0, 30.0, bump(12.0, 30.0))])
def test_a_regular_coarse_tool_is_the_same_surface_in_the_axes_of_the_ply(point):
    """Vertices at one distance are many there, of which a fit has some alone."""
    x, t = plate(n=11)
    tool = drape.TriangleMesh(x, t)
    scene = on_tool(tool, point=point, size=(4, 4), width=80.0, height=80.0)
    surface, turn = scene.conditions["tool"].surface, scene.axes.turn
    there = scene.axes.of_ply(x)
    np.testing.assert_allclose(surface.level(there), tool.level(x), atol=1e-10)
    slope, bend = surface.gradient(there), surface.hessian(there)
    np.testing.assert_allclose(turn @ slope, tool.gradient(x), atol=1e-10)
    turned = np.einsum("ik,kln,jl->ijn", turn, bend, turn)
    np.testing.assert_allclose(turned, tool.hessian(x), atol=1e-10)
    np.testing.assert_array_equal(
        surface.beyond_edges(there) > 0, tool.beyond_edges(x) > 0
    )
    scene.conditions["tool"].at("tool", 0.5)  # it touches the plane of the ply


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("tilt", [-0.005, 0.0, 0.005])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_a_wall_is_seen_from_where_it_faces(axis, tilt, side):
    """Upright to half a degree; z of the tool stands in for x across the wall."""
    x, t = plate()
    order = {"x": [2, 0, 1], "y": [1, 2, 0]}[axis]
    x = np.array([[1], [1], [side]]) * x + np.array([[0], [0], [tilt]]) * x[:1]
    wall = drape.TriangleMesh(x[order], t[::side])
    place = np.array([5.0, 0.0, 30.0 * side])[order]
    turn = on_tool(wall, point=place, tension=0.0).axes.turn
    outwards = side * np.eye(3)["xyz".index(axis)]
    first = np.eye(3)[{"x": 2, "y": 0}[axis]]
    expected = np.column_stack([first, np.cross(outwards, first), outwards])
    np.testing.assert_allclose(turn, expected, atol=0.03)


def test_where_no_net_can_be_laid_a_bending_stiffness_is_asked_for(tmp_path, capsys):
    file = ball(tmp_path / "ball.stl", 900)
    large = "--width", "330", "--height", "330", "--tension", "2"
    assert command(tmp_path / "out", *large, tool=file) == 2
    said = capsys.readouterr().err
    assert "give the fibres a bending stiffness" in said
    assert said.count("\n") == 1


def test_a_state_without_a_run_has_a_result():
    scene = hemisphere(size=(4, 4))
    case = Case(scene=scene, fabric=Fabric(1e4, 0.1), steps=1)
    ply, run = case.ply(), case.run()
    state = equilibrium_near(ply, scene.conditions, run.u, warn_only=["stabilisation"])
    result = Result.of_state(ply, scene.conditions, state)
    assert result.converged
    np.testing.assert_allclose(result.u, run.u, atol=1e-3)
    found = scene.summary(result)
    assert found["max_contact_pressure_N_per_mm2"] == pytest.approx(
        scene.summary(run)["max_contact_pressure_N_per_mm2"], rel=1e-3
    )
    assert found["error_estimate"].startswith("none: ")
