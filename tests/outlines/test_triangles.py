"""Triangles with given lines as edges, and meshes along singular fibres."""

import numpy as np
import pytest
import shapely
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Macro,
    Ply,
    Quadratic,
    along_edges,
)
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.mesh.selection import SINGULAR
from skfem_textile.outlines import Outline, singular_fibres
from skfem_textile.outlines.meshing import irregular, mesh_outline, quadrilaterals
from skfem_textile.outlines.triangles import triangles
from skfem_textile.ply.formulations import ON_FIBRES

# Of the random outlines, and numbers of those that take a moment.
SEED, QUICK = 4711, (4, 16, 19)


def angles(p, t):
    """Angles in degrees, shape (3, n_elements)."""
    x = p[:, t]
    u, v = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cos = (u * v).sum(axis=0) / np.hypot(*u) / np.hypot(*v)
    return np.degrees(np.arccos(cos.clip(-1, 1)))


def random_case(seed):
    """Polygon with holes, constant or curved directions, and the conditions."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 10))
    at = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    polygon = 100 * rng.uniform(0.6, 1.3, n) * np.array([np.cos(at), np.sin(at)])
    shape, holes = shapely.Polygon(polygon.T), []
    for x in rng.uniform(-60, 60, (3, 2)):
        r = 0.5 * shape.boundary.distance(shapely.Point(x))
        if shape.contains(shapely.Point(x)) and r > 5:
            corners = 2 * np.pi * np.arange(k := int(rng.choice([3, 4, 12, 40]))) / k
            holes.append(x[:, None] + r * np.array([np.cos(corners), np.sin(corners)]))
            shape = shape.difference(shapely.Polygon(holes[-1].T))
    angle, between = rng.uniform(0, np.pi), rng.uniform(0.6, np.pi - 0.6)
    bend = rng.uniform(-0.008, 0.008, 2) * (seed % 4 == 0)

    def direction(shift):
        if not bend.any():
            return np.cos(angle + shift), np.sin(angle + shift)
        return lambda x: np.stack(
            [f(angle + shift + np.tensordot(bend, x, 1)) for f in (np.cos, np.sin)]
        )

    fabric = Fabric(1e5, 0.5, direction(0.0), direction(between))
    outline = Outline(polygon, holes, {"fixed": [0], "pulled": [n // 2]})
    held = {"fixed": Condition("fixed"), "pulled": Condition("pulled", (1.0, 0.0))}
    return outline, fabric, held, float(np.sqrt(shape.area)) / rng.uniform(8, 24)


def input_angles(edges, points):
    """Smallest angle in degrees between edges at each of their nodes."""
    smallest = np.full(points.shape[1], 360.0)
    ends = np.hstack([edges, edges[::-1]])
    along = points[:, ends[1]] - points[:, ends[0]]
    at = np.degrees(np.arctan2(along[1], along[0]))
    for k in np.unique(ends):
        a = np.sort(at[ends[0] == k])
        if len(a) > 1:
            smallest[k] = np.diff(np.append(a, a[0] + 360)).min()
    return smallest


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(seed, marks=[] if seed - SEED in QUICK else pytest.mark.slow)
        for seed in range(SEED, SEED + 24)
    ],
)
def test_random_outlines_have_valid_meshes_with_good_angles(seed):
    """Angles are at least 10° except beside smaller angles between the lines."""
    outline, fabric, held, size = random_case(seed)
    lines = singular_fibres(outline, fabric, held, finest=size / 4)
    found = triangles(outline.shape(), [f.points for f in lines.fibres], size)
    mesh = MeshTri(found.points, found.triangles)
    check_mesh(mesh)
    smallest = angles(mesh.p, mesh.t).min(axis=0)
    sharp = found.points[:, input_angles(found.edges, found.points) < 15]
    centre = mesh.p[:, mesh.t[:, smallest < 10]].mean(axis=1)
    gaps = np.hypot(*(centre[:, :, None] - sharp[:, None])).min(axis=1, initial=np.inf)
    assert (gaps < 3 * size).all()


def test_every_line_is_covered_by_edges():
    """Edges cover the length of a line and the perimeter of the outline."""
    shape = shapely.Point(0, 0).buffer(50, 16).difference(shapely.box(-5, -5, 5, 5))
    lines = [np.array([[-40.0, 40], [-20, -20]]), np.array([[20.0, 20], [-40, 40]])]
    found = triangles(shape, lines, 6.0)
    x = found.points[:, found.edges]
    length = np.hypot(*(x[:, 1] - x[:, 0]))
    for i in range(2):
        assert length[found.line == i].sum() == pytest.approx(80)
    assert length[found.line < 0].sum() == pytest.approx(shape.length, rel=0.01)
    assert angles(found.points, found.triangles).min() > 20


def test_many_triangles_of_the_right_size():
    """About as many triangles as equilateral ones of the size, and none much larger."""
    found = triangles(shapely.box(0, 0, 40, 50), [], 1.0)
    n = 2000 / (np.sqrt(3) / 4)
    assert 0.95 * n < found.triangles.shape[1] < 1.15 * n
    x = found.points[:, found.triangles]
    assert np.hypot(*(np.roll(x, 1, axis=1) - x)).max() < 1.7


def test_parallel_lines_nearby_are_joined():
    """A second line at a hundredth of the size adds no elements."""
    line = np.array([[0.0, 100], [40, 40]])
    one = triangles(shapely.box(0, 0, 100, 100), [line], 5.0)
    other = line + np.array([[0], [0.05]])
    two = triangles(shapely.box(0, 0, 100, 100), [line, other], 5.0)
    assert two.triangles.shape[1] < 1.1 * one.triangles.shape[1]


@pytest.fixture(scope="module")
def bias():
    """Bias extension at 45° with a locking force in the singular fibres."""
    outline = Outline([[0, 50, 50, 0], [0, 0, 100, 100]])
    fabric = Fabric(1e5, 0.5, (1, 1), (-1, 1))
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 12.0))}
    return outline, fabric, held


def load(mesh, fabric, held, formulation):
    """Force on the upper clamp."""
    result = LoadStepper(Ply(mesh, fabric, formulation), held, 1).run()
    return result.states[-1].reactions["top"][1]


@pytest.fixture(scope="module")
def exact(bias):
    """Load on a graded net."""
    return load(mesh_outline(*bias, density=2.0), *bias[1:], Quadratic())


@pytest.mark.parametrize(
    ("formulation", "turn"), [(Macro(), 0.35), (Quadratic(400), 0.0)]
)
def test_load_on_conforming_triangles(bias, exact, formulation, turn):
    """With 12 elements across, the load is within 1 % of the load on a graded net."""
    outline, fabric, held = bias
    lines = singular_fibres(*bias, finest=1.0)
    mesh = irregular(outline, lines, 50 / 12, turn)
    assert load(mesh, fabric, held, formulation) == pytest.approx(exact, rel=0.01)


def test_without_the_name_the_same_mesh_is_too_soft(bias, exact):
    """The stiffness at singular fibres, not the mesh alone, gives the load."""
    _, fabric, held = bias
    named = mesh_outline(*bias, size=50 / 12)
    plain = MeshTri(named.p, named.t).with_boundaries(
        {name: named.boundaries[name] for name in ("bottom", "top")}
    )
    assert load(plain, fabric, held, Macro()) < 0.97 * exact


def disc(radius=10.0, x=25.0, y=55.0):
    """Corners of a disc."""
    at = 2 * np.pi * np.arange(64) / 64
    return np.stack([x + radius * np.cos(at), y + radius * np.sin(at)])


@pytest.mark.parametrize("size", [2.0, 4.0, 8.0])
def test_tangents_of_a_border_are_edges_up_to_where_they_touch_it(size):
    ring = disc()
    touch = ring[:, 8]  # at 45 degrees
    tangent = touch[:, None] + np.array([[15.0, 0, -15.0], [-15.0, 0, 15.0]])
    border = np.hstack([ring, ring[:, :1]])
    shape = shapely.box(0, 0, 50, 110)
    mesh = triangles(shape, [border, tangent], size, borders=1)
    x = mesh.points[:, mesh.edges[:, mesh.line == 1]]
    length = np.hypot(*(x[:, 0] - x[:, 1])).sum()
    assert length == pytest.approx(30 * np.sqrt(2), rel=1e-6)
    assert angles(mesh.points, mesh.triangles).min() > 2


def test_lines_at_a_small_angle_to_a_border_are_left_out_near_it():
    border = np.array([[0.0, 100.0], [50.0, 50.0]])
    line = np.array([[0.0, 100.0], [50.0, 51.2]])
    mesh = triangles(shapely.box(0, 0, 100, 100), [border, line], 10.0, borders=1)
    x = mesh.points[:, mesh.edges[:, mesh.line == 1]]
    assert 35 < x[0].min() < 60


@pytest.mark.dear("meshes of 6000 unknowns with many singular fibres")
@pytest.mark.parametrize(
    ("stiffer", "degrees", "load"), [(400, [45, 135], 22.26), (1, [80, 100], 16.7)]
)
def test_load_with_an_inclusion_is_right_on_the_default_mesh(stiffer, degrees, load):
    """Loads of meshes of 67 000 and 122 000 unknowns.

    Without the tangents they are 8 and 2 % larger.
    """
    sides = [[0, 50, 50, 0], [0, 0, 115, 115]]
    outline = Outline(sides, regions={"disc": disc(10.0, 22.0)})
    warp, weft = ((np.cos(a), np.sin(a)) for a in np.radians(degrees))
    ply, inner = (
        Fabric(1e5, 0.5, (1, 1), (-1, 1)),
        Fabric(1e5, 0.5 * stiffer, warp, weft),
    )
    held = {"fixed": Condition("bottom"), "pulled": Condition("top", (0, 8.0))}
    mesh = mesh_outline(outline, ply, held, fabrics={"disc": inner})
    plies = {"rest": ply, "disc": inner}
    result = LoadStepper(Ply(mesh, plies, ON_FIBRES), held, steps=1).run()
    assert result.states[-1].reactions["pulled"][1] == pytest.approx(load, rel=0.012)


def test_regions_are_subdomains():
    """Borders of a region are edges, and its elements a subdomain."""
    region = [[30, 70, 70, 30], [30, 30, 70, 70]]
    outline = Outline(
        [[0, 100, 100, 0], [0, 0, 100, 100]],
        regions={"patch": region},
        points={"stitch": (20.0, 80.0)},
    )
    fabric, patch = Fabric(1e4, 0.5, (1, 1), (-1, 1)), Fabric(1e4, 5.0, (1, 1), (-1, 1))
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 5.0))}
    mesh = mesh_outline(outline, fabric, held, fabrics={"patch": patch}, size=10.0)
    check_mesh(mesh)
    x = mesh.p[:, mesh.t[:, mesh.subdomains["patch"]]]
    u, v = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    assert np.abs(u[0] * v[1] - u[1] * v[0]).sum() / 2 == pytest.approx(1600)
    assert sum(map(len, mesh.subdomains.values())) == mesh.nelements
    assert np.allclose(mesh.p[:, mesh.named_nodes["stitch"][0]], [20, 80])
    fabrics = {"patch": patch, "rest": fabric}
    assert Ply(mesh, fabrics, Quadratic(400)).parent.size == mesh.nelements


@pytest.mark.dear("locking shows in the loads of three plies")
def test_curved_fibres_do_not_lock():
    """Log spirals: 6 and 12 elements across agree within 1.5 %; plain ones do not."""
    at = np.linspace(0, 1.2, 41)
    inner, outer = 83.0, 152.0
    arc = np.array([np.cos(at), np.sin(at)])
    outline = Outline(
        np.hstack([outer * arc, inner * arc[:, ::-1]]),
        names={"pulled": [40], "fixed": [81]},
    )

    def direction(sign):
        def field(x):
            r = x / np.hypot(*x)
            return (sign * r + np.stack([-r[1], r[0]])) / np.sqrt(2)

        return field

    fabric = Fabric(1e5, 0.5, direction(1), direction(-1))
    normal = np.array([-np.sin(1.2), np.cos(1.2)])
    held = {
        "fixed": Condition("fixed"),
        "pulled": Condition("pulled", tuple(12 * normal)),
    }

    def force(size, formulation):
        mesh = mesh_outline(outline, fabric, held, size=size)
        assert len(mesh.boundaries[SINGULAR]) > 15
        ply = Ply(mesh, along_edges(mesh, fabric), formulation)
        result = LoadStepper(ply, held, 1).run()
        return result.states[-1].reactions["pulled"] @ normal

    fine = force(69 / 12, Quadratic(400))
    assert force(69 / 6, Quadratic(400)) == pytest.approx(fine, rel=0.015)
    assert force(69 / 6, Quadratic()) > 1.1 * fine


@pytest.mark.parametrize("seed", QUICK)
def test_quadrilaterals_fill_an_outline(seed):
    """Equal area and names, good angles, and squares away from the sides."""
    outline, *_ = random_case(seed)
    mesh = quadrilaterals(outline, (14, 11))
    check_mesh(mesh)
    assert mesh.param() < 0.5 * outline.size
    triangles, squares = mesh.cells
    area = np.abs(mesh.mapping().detDF(np.full((2, 1), 0.5))).sum()
    assert area == pytest.approx(outline.shape().area, rel=0.02)  # chords of holes
    assert angles(mesh.p, triangles).min() > 8
    side = (np.ptp(outline.polygon, axis=1) / (14, 11))[:, None, None]
    assert np.allclose(np.ptp(mesh.p[:, squares], axis=1), side[:, 0])
    middle = mesh.p[:, mesh.facets[:, mesh.boundaries["fixed"]]].mean(axis=1)
    fixed = shapely.LineString([*outline.edges()[0][:, :2].T])
    assert shapely.distance(fixed, shapely.points(middle.T)).max() < 1e-6
    assert {"fixed", "pulled"} <= set(mesh.boundaries)


def test_an_outline_without_a_whole_square_is_filled_with_triangles():
    mesh = quadrilaterals(Outline([[-60, 60, 0], [-60, -60, 60]]), (4, 4))
    assert [len(cell) for cell in mesh.cells] == [3]
    ply = Ply(mesh, Fabric())
    assert ply.on_users_nodes(ply.nodes) == pytest.approx(ply.users_points)


def test_quadrilaterals_of_a_rectangle_are_those_of_its_grid():
    mesh = quadrilaterals(Outline([[0, 60, 60, 0], [5, 5, 45, 45]]), (6, 5))
    assert type(mesh) is MeshQuad
    assert (mesh.nelements, mesh.nvertices) == (30, 42)
    assert np.ptp(mesh.p[:, mesh.t], axis=1) == pytest.approx(
        np.tile([[10.0], [8.0]], 30)
    )


@pytest.mark.parametrize(
    ("size", "message"), [((0, 4), "at least 1x1"), ((4000, 4000), "choose less")]
)
def test_a_number_of_quadrilaterals_is_refused(size, message):
    with pytest.raises(ValueError, match=message):
        quadrilaterals(Outline([[0, 60, 60, 0], [5, 5, 45, 45]]), size)
