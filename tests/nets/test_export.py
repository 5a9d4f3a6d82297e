"""Fibres of a draped ply in the elements of a tool, against exact solutions."""

import csv

import meshio
import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import Ply, drape
from skfem_textile.io import read_tool_mesh, write_fibres
from skfem_textile.io.meshes import read_raw
from tests.helpers.tools import SPHERE, exact_shear_angle, on_net, rolled, rolled_ply


def tool(mapping, low, high, n, quads=True):
    """A tool with points at ``mapping`` of a regular grid of the flat ply."""
    s = np.linspace(low, high, n + 1)
    mesh = MeshQuad.init_tensor(s, s)
    t = mesh.t[::-1]  # init_tensor goes clockwise
    x = mapping(mesh.p)
    return drape.ToolMesh(x, (t,) if quads else (t[:3], t[[0, 2, 3]]))


@pytest.mark.parametrize("quads", [True, False])
@pytest.mark.parametrize("mesh", [MeshQuad, MeshTri])
def test_fibres_on_a_cylinder_keep_their_angle_to_its_axis(mesh, quads):
    """Up to the second-order error of chords in place of arcs."""
    part, errors = tool(rolled, 10, 90, 17, quads), []
    for n in (12, 24):
        ply, u = rolled_ply(n, 0.4, mesh)
        fibres = drape.fibres_on_tool(drape.Sheet.of_ply(ply, u), part, (0, 1, 0))
        assert fibres.covered.all()
        angles = np.array(fibres.angles_deg()) - np.degrees([[0.4 - np.pi / 2], [0.4]])
        errors.append(np.abs([*angles, np.degrees(fibres.shear_angle)]).max())
        for v in (fibres.warp, fibres.weft):
            np.testing.assert_allclose((v * fibres.normal).sum(axis=0), 0, atol=1e-12)
            np.testing.assert_allclose(np.linalg.norm(v, axis=0), 1)
    assert errors[1] < 0.1
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.3)


@pytest.fixture(scope="module")
def sheet():
    return drape.Sheet.of_ply(*rolled_ply(24))


def in_plane(v, normal):
    v = v - normal * (v * normal).sum(axis=0)
    return v / np.linalg.norm(v, axis=0)


def test_fibres_on_a_sphere_converge_to_the_exact_net():
    """Fibres and shear angle in the planes of the tool's elements, up to the edges."""
    part = tool(on_net, 0, 100, 20)
    s = np.linspace(0, 100, 21)
    X = np.array(np.meshgrid(*2 * [0.5 * (s[1:] + s[:-1])], indexing="ij"))
    X = X.reshape(2, -1)
    h = 1e-3 * np.eye(2)[:, :, None]
    along = [(on_net(X + step) - on_net(X - step)) / 2e-3 for step in h]
    exact = [in_plane(of, part.normals()) for of in along]
    errors = []
    for n in (8, 16):
        net = drape.net(SPHERE, 100 / n, (0, n), (0, n))
        fibres = drape.fibres_on_tool(drape.Sheet.of_net(net), part)
        turned = [
            np.degrees(np.arccos(np.minimum((a * b).sum(axis=0), 1)))
            for a, b in zip((fibres.warp, fibres.weft), exact, strict=True)
        ]
        sheared = np.degrees(fibres.shear_angle - exact_shear_angle(X))
        errors.append([np.max(turned), np.abs(sheared).max()])
    assert max(errors[1]) < 0.05
    assert (np.log2(np.divide(*errors)) > 1.7).all()


def test_elements_outside_the_ply_are_not_covered(sheet):
    fibres = drape.fibres_on_tool(sheet, tool(rolled, 40, 140, 20))
    s = np.linspace(40, 140, 21)
    s = 0.5 * (s[1:] + s[:-1])
    inside = (np.array(np.meshgrid(s, s)) < 100).all(axis=0)
    np.testing.assert_array_equal(fibres.covered, inside.ravel())
    assert np.isnan(fibres.angles_deg()).any(axis=0).sum() == (~inside).sum()


def test_the_edge_of_the_ply_equals_the_edge_of_the_flat_ply(sheet):
    """Also for points above it, such as points of a tool above its chords."""
    s = np.linspace(10, 90, 33)
    for beyond, is_found in ((-0.02, True), (0.02, False)):
        for X in ([s, 0 * s - beyond], [s, 0 * s + 100 + beyond]):
            points = sheet.at(rolled(np.array(X)))
            np.testing.assert_array_equal(points.found, is_found)
    on_edge = sheet.at(rolled(np.array([s, 0 * s])))
    assert on_edge.found.all()
    assert on_edge.distance.max() > 0.005


def flat_tool(low, high, n, height):
    return tool(lambda X: np.vstack([X, 0 * X[:1] + height]), low, high, n)


@pytest.mark.parametrize("quads", [True, False])
@pytest.mark.parametrize("height", [0.0, 4.0, -25.0])
def test_elements_beside_the_ply_are_not_covered_at_any_distance(height, quads):
    """Of a flat part over a flat ply, those whose centres are over it."""
    flat = tool(lambda X: np.pad(X, ((0, 1), (0, 0))), 0, 40, 4, quads)
    fibres = np.tile([[1.0], [0.0]], flat.n_elements)
    cells = np.hstack(flat.cells)
    sheet = drape.Sheet(flat.points[:2], flat.points, cells, fibres, fibres[::-1])
    part = flat_tool(-30, 70, 50, height)
    x, y, _ = part.centres()
    over = (np.abs(x - 20) < 20) & (np.abs(y - 20) < 20)
    covered = drape.fibres_on_tool(sheet, part, reach=30.0).covered
    np.testing.assert_array_equal(covered, over)


@pytest.mark.parametrize("radius", [66.0, 84.0])
def test_elements_beside_a_curved_ply_are_not_covered(sheet, radius):
    """Of a cylinder over the ply with the same axis."""

    def over(X):
        centre = np.array([[0.0], [0.0], [-60.0]])
        return centre + (rolled(X) - centre) * [[radius / 60], [1], [radius / 60]]

    s = np.linspace(-59, 159, 55)  # no centre is at the edge of the ply
    s = 0.5 * (s[1:] + s[:-1])
    inside = (np.abs(np.array(np.meshgrid(s, s)) - 50) < 50).all(axis=0)
    part = tool(over, -59, 159, 54)
    covered = drape.fibres_on_tool(sheet, part, reach=30.0).covered
    np.testing.assert_array_equal(covered, inside.ravel())


def test_the_default_reach_is_the_same_for_all_elements():
    """A quarter of the longest edge of the part also for its small elements."""
    sheet = drape.Sheet.of_net(drape.net(drape.Plane(), 2.0, (9, 9), (9, 9)))
    large, small = flat_tool(-16, 0, 1, 0.0), flat_tool(2, 4, 1, 3.9)
    points = np.hstack([large.points, small.points])
    part = drape.ToolMesh(points, (np.hstack([large.cells[0], small.cells[0] + 4]),))
    assert drape.fibres_on_tool(sheet, part).covered.all()
    part.points[2, 4:] = 4.1
    part = drape.ToolMesh(part.points, part.cells)
    assert drape.fibres_on_tool(sheet, part).covered.tolist() == [True, False]


def test_a_small_reach_excludes_the_other_side_of_a_thin_tool(sheet):
    below = tool(lambda X: rolled(X) - [[0], [0], [0.8]], 10, 40, 6)
    assert drape.fibres_on_tool(sheet, below).covered.all()
    with pytest.raises(ValueError, match="no element of the tool is within reach"):
        drape.fibres_on_tool(sheet, below, reach=0.4)


@pytest.mark.parametrize("upwards", [True, False])
@pytest.mark.parametrize(
    ("depths", "nearer"),
    [((0.1, 0.8), 0), ((1.5, 2.5), 0), ((-0.5, 0.5), 0), ((-0.8, 0.4), 1)],
)
def test_of_two_skins_one_has_fibres(sheet, upwards, depths, nearer):
    """The nearer or the upper one, also if elements face the ply with their backs."""
    skins = [
        tool(lambda X, d=depth: rolled(X) - [[0], [0], [d]], 10, 40, 6)
        for depth in depths
    ]
    n = skins[0].points.shape[1]
    cells = [skins[0].cells[0], skins[1].cells[0][:: 1 if upwards else -1] + n]
    points = np.hstack([skin.points for skin in skins])
    both = drape.ToolMesh(points, (np.hstack(cells),))
    covered = drape.fibres_on_tool(sheet, both, reach=4.0).covered
    np.testing.assert_array_equal(covered, np.repeat([nearer == 0, nearer == 1], 36))


def test_another_axis_replaces_one_along_the_normal():
    flat = tool(lambda X: np.pad(X, ((0, 1), (0, 0))), 0, 10, 4)
    net = drape.net(drape.Plane(), 5.0, (1, 4), (1, 4))
    sheet = drape.Sheet.of_net(net)
    near, off = ((0, np.radians(degrees), 1) for degrees in (0.03, 0.3))
    for axis, expected in ((near, 0.0), (off, -90.0), ((5, 0, 0), 0.0)):
        warp, weft = drape.fibres_on_tool(sheet, flat, axis).angles_deg()
        np.testing.assert_allclose(warp, expected, atol=1e-9)
        np.testing.assert_allclose(weft, expected + 90, atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_any_point_of_a_sheet_is_located(share):
    """On quadrilaterals that are long, distorted and bent, and between their edges."""
    random = np.random.default_rng(3)
    s, t = np.linspace(0, 100, 31), np.linspace(0, 100, 7)
    mesh = MeshQuad.init_tensor(s, t)
    inner = ((mesh.p > 0) & (mesh.p < 100)).all(axis=0)
    moves = random.uniform(-1, 1, mesh.p.shape) * share * inner
    flat = mesh.p + moves * np.array([[100 / 30], [100 / 6]])
    n = mesh.nelements
    fibres = np.tile([[1.0], [0.0]], n), np.tile([[0.0], [1.0]], n)
    surface = drape.Torus(80.0, 30.0, (0, 0, -30.0))
    x = drape.exponential_map(surface, 0.3 * flat, point=(80.0, 0.0, 0.0))
    sheet = drape.Sheet(flat, x, mesh.t, *fibres)
    element = random.integers(0, n, 500)
    local = random.uniform(0, 1, (2, 500))
    local[:, :100] = np.round(local[:, :100])
    exact = drape.SheetPoints(element, local, np.zeros(500))
    at = sheet._elements.between(x, element, local)
    spots = sheet.at(at)
    assert spots.found.all()
    np.testing.assert_allclose(spots.distance, 0, atol=1e-9)
    np.testing.assert_allclose(sheet.flat_at(spots), sheet.flat_at(exact), atol=1e-6)


@pytest.mark.parametrize(("degrees", "found"), [(30.0, True), (70.0, False)])
def test_a_point_over_the_ridge_of_two_elements_has_a_foot(degrees, found):
    """Its perpendiculars meet both planes beyond the ridge."""
    flat = 10 * np.array([[-1.0, 0, 1, -1, 0, 1], [0, 0, 0, 1, 1, 1]])
    c, s = np.cos(np.radians(degrees / 2)), np.sin(np.radians(degrees / 2))
    x = np.array([c * flat[0], flat[1], -s * np.abs(flat[0])])
    fibres = np.tile([[1.0], [0.0]], 2), np.tile([[0.0], [1.0]], 2)
    sheet = drape.Sheet(flat, x, np.array([[0, 1, 4, 3], [1, 2, 5, 4]]).T, *fibres)
    assert sheet.at(np.array([[0.0], [5.0], [1.0]])).found.all() == found


def test_a_tool_is_read_in_the_order_of_its_file(tmp_path):
    part = tool(rolled, 10, 90, 5)
    cells = [("triangle", part.cells[0][:3].T), ("quad", part.cells[0].T)]
    meshio.Mesh(part.points.T, cells).write(tmp_path / "tool.vtu")
    read = read_tool_mesh(tmp_path / "tool.vtu")
    assert [cell.shape for cell in read.cells] == [(3, 25), (4, 25)]
    np.testing.assert_array_equal(read.cells[1], part.cells[0])


def quadratic_file(file):
    """A quadrilateral of eight nodes and a triangle of six beside it."""
    x = np.array([[0, 0], [10, 0], [10, 10], [0, 10], [20, 0]], dtype=float)
    sides = [[0, 1], [1, 2], [2, 3], [3, 0], [1, 4], [4, 2]]
    points = np.pad(np.vstack([x, x[sides].mean(axis=1)]), ((0, 0), (0, 1)))
    quad, triangle = [0, 1, 2, 3, 5, 6, 7, 8], [1, 4, 2, 9, 10, 6]
    if file.suffix != ".inp":
        cells = [("quad8", [quad]), ("triangle6", [triangle])]
        options = {"file_format": "gmsh22"} if file.suffix == ".msh" else {}
        meshio.write_points_cells(file, points, cells, **options)
        return
    lines = ["*NODE", *(f"{i}, {a}, {b}, {c}" for i, (a, b, c) in enumerate(points, 1))]
    for n, (kind, nodes) in enumerate((("S8R", quad), ("STRI65", triangle)), 1):
        words = ", ".join(str(k + 1) for k in nodes)
        lines += [f"*ELEMENT, TYPE={kind}", f"{n}, {words}"]
    file.write_text("\n".join(lines))


@pytest.mark.parametrize("suffix", ["inp", "msh", "vtu"])
def test_quadratic_elements_of_a_part_are_read_by_their_corners(tmp_path, suffix):
    quadratic_file(tmp_path / f"part.{suffix}")
    quads, triangles = read_tool_mesh(tmp_path / f"part.{suffix}").cells
    assert quads.T.tolist() == [[0, 1, 2, 3]]
    assert triangles.T.tolist() == [[1, 4, 2]]


@pytest.fixture(scope="module")
def fibres():
    """In a part that the ply covers in part."""
    sheet = drape.Sheet.of_ply(*rolled_ply(12, 0.3))
    return drape.fibres_on_tool(sheet, tool(rolled, 60, 120, 8), (0, 1, 0))


def test_files_contain_the_same_fibres_and_mark_uncovered_elements(tmp_path, fibres):
    for suffix in ("vtu", "csv", "inp"):
        write_fibres(tmp_path / f"fibres.{suffix}", fibres)
    angles = np.array([*fibres.angles_deg(), np.degrees(fibres.shear_angle)])
    cells = meshio.read(tmp_path / "fibres.vtu").cell_data
    np.testing.assert_array_equal(cells["warp_direction"][0], fibres.warp.T)
    np.testing.assert_array_equal(cells["weft_angle_deg"][0], angles[1])
    np.testing.assert_array_equal(cells["covered"][0], fibres.covered)
    with open(tmp_path / "fibres.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    names = ("warp_angle_deg", "weft_angle_deg", "shear_angle_deg")
    table = [[float(row[name] or "nan") for row in rows] for name in names]
    np.testing.assert_array_equal(table, angles)
    left = [row for row in rows if row["covered"] == "0"]
    assert {row[name] for row in left for name in names} == {""}
    assert [row["covered"] for row in rows] == [str(int(c)) for c in fibres.covered]


def orientation(lines, name):
    """Points a and b of each element in a deck, by its number."""
    start = lines.index(
        f"*DISTRIBUTION, NAME={name}_AXES, LOCATION=ELEMENT, TABLE=AXES"
    )
    axes = {}
    for line in lines[start + 2 :]:
        if line.startswith("*") or not line:
            break
        number, *values = line.split(",")
        axes[int(number)] = np.array(values, dtype=float).reshape(2, 3)
    return axes


def test_a_deck_has_both_axes_of_each_element_in_space(tmp_path, fibres):
    write_fibres(tmp_path / "fibres.inp", fibres)
    lines = (tmp_path / "fibres.inp").read_text().splitlines()
    for name, family in (("WARP", fibres.warp), ("WEFT", fibres.weft)):
        axes = orientation(lines, name)
        assert list(axes) == (1 + np.flatnonzero(fibres.covered)).tolist()
        for number, (a, b) in axes.items():
            np.testing.assert_allclose(a, family[:, number - 1], rtol=0, atol=1e-17)
            normal = np.cross(a, b)
            np.testing.assert_allclose(normal, fibres.normal[:, number - 1], atol=1e-12)
    left = lines[lines.index("*ELSET, ELSET=NOT_COVERED") + 1 :]
    first = [int(word) for word in left[0].split(",")]
    assert first == (1 + np.flatnonzero(~fibres.covered))[:16].tolist()
    read = read_tool_mesh(tmp_path / "fibres.inp")
    np.testing.assert_array_equal(read.points, fibres.mesh.points)
    np.testing.assert_array_equal(read.cells[0], fibres.mesh.cells[0])


def test_fibres_on_the_ply_itself_are_in_the_users_elements(tmp_path):
    """Angles are seen from the upper side of the flat ply."""
    ply, u = rolled_ply(12, 0.3)
    fibres = drape.fibres_on_ply(ply, u, (0, 1, 0))
    assert fibres.mesh.n_elements == 144
    warp, weft = fibres.angles_deg()
    np.testing.assert_allclose(warp, np.degrees(0.3) - 90, atol=0.05)
    np.testing.assert_allclose(weft, np.degrees(0.3), atol=0.05)
    assert (fibres.normal[2] > 0).mean() > 0.9


@pytest.mark.parametrize("mesh", [MeshQuad, MeshTri])
def test_names_of_a_ply_in_space_are_sets_of_its_deck(tmp_path, mesh):
    ply, u = rolled_ply(4, mesh=mesh)
    named = ply.users_mesh.with_boundaries({"clamp": lambda x: x[0] == 0})
    named = named.with_subdomains({"left half": lambda x: x[0] < 50})
    ply = Ply(named, ply.fabric, ply.formulation, dimension=3)
    write_fibres(tmp_path / "fibres.inp", drape.fibres_on_ply(ply, u))
    read, _ = read_raw(tmp_path / "fibres.inp")
    (clamp,) = read.point_sets.values()
    assert list(read.point_sets) == ["clamp"]
    np.testing.assert_array_equal(clamp, np.flatnonzero(named.p[0] == 0))
    ((half,),) = (of for n, of in read.cell_sets.items() if n == "left half")
    np.testing.assert_array_equal(half, named.subdomains["left half"])


def test_a_wall_across_the_ply_has_no_fibres():
    """Elements at 70° and at 50° to a flat ply, both with their centres on it."""
    sheet = drape.Sheet.of_net(drape.net(drape.Plane(), 1.0, (9, 9), (9, 9)))
    for degrees, covered in ((70.0, False), (50.0, True)):
        lean = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        corners = np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
        leaning = np.array([corners[0] * lean[0], corners[1], corners[0] * lean[1]])
        flat = np.array([corners[0] + 4, corners[1], 0 * corners[0]])
        cells = np.array([[0, 1, 2, 3], [4, 5, 6, 7]]).T
        part = drape.ToolMesh(np.hstack([leaning, flat]), (cells,))
        fibres = drape.fibres_on_tool(sheet, part)
        assert fibres.covered.tolist() == [covered, True]
        assert np.isfinite(fibres.warp[:, 0]).all() == covered
