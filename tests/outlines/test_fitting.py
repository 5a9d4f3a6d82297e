"""Meshes of the user fitted to the singular fibres."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
import shapely
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    fitted,
)
from skfem_textile.io.results import write_fields
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.mesh.selection import SINGULAR, with_named_nodes
from skfem_textile.mesh.splitting import split_cells
from skfem_textile.outlines import Outline, fitting, singular_fibres
from skfem_textile.outlines.fibres import has_free_side_along_fibres
from skfem_textile.outlines.fitting import fit_to_fibres, smallest_angles
from skfem_textile.outlines.meshing import mesh_outline
from skfem_textile.ply.formulations import DEFAULT, ON_FIBRES, SMOOTH
from skfem_textile.scenes.rectangle import rectangle as irregular

HELD = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 12.0))}


def fabric(angle=45.0):
    """Fabric with the families at ± an angle to the clamps."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return Fabric(1e5, 0.5, (c, s), (-c, s))


def rectangle(kind, n, height=100.0, shift=0.2):
    """Distorted mesh of 50 mm by a height; the left half is a subdomain."""
    quads = MeshQuad.init_tensor(
        np.linspace(0, 50, n + 1), np.linspace(0, height, 2 * n + 1)
    )
    inner = np.ones(quads.p.shape[1], dtype=bool)
    inner[quads.boundary_nodes()] = False
    inner &= np.abs(quads.p[0] - 25) > 1e-9
    p = quads.p.copy()
    rng = np.random.default_rng(5)
    p[:, inner] += shift * 50 / n * rng.uniform(-1, 1, (2, inner.sum()))
    mesh = MeshQuad(p, quads.t)
    mesh = mesh if kind is MeshQuad else mesh.to_meshtri()
    return (
        kind(mesh.p, mesh.t)
        .with_defaults()
        .with_subdomains({"left half": lambda x: x[0] < 25})
    )


def areas(mesh):
    """Areas of elements."""
    return shapely.area(shapely.polygons(mesh.p[:, mesh.t].T))


def oriented(mesh):
    """Triangles, anticlockwise."""
    rings = shapely.linearrings(mesh.p[:, mesh.t].T)
    return np.where(shapely.is_ccw(rings), mesh.t, mesh.t[[0, 2, 1]])


def named_edges(mesh, name=SINGULAR):
    """Edges of a name, by default those on singular fibres, as lines."""
    ends = mesh.facets[:, mesh.boundaries[name]]
    return shapely.linestrings(mesh.p[:, ends].transpose(2, 1, 0))


def length_of(mesh, name=SINGULAR):
    """Length of the edges of a name."""
    return shapely.length(named_edges(mesh, name)).sum()


def fibres_of(mesh, fabric, finest=None):
    """Singular fibres as lines."""
    found = singular_fibres(Outline.of_mesh(mesh), fabric, HELD, finest=finest)
    return [shapely.linestrings(f.points.T) for f in found.fibres]


@pytest.mark.parametrize("kind", [MeshQuad, MeshTri])
@pytest.mark.parametrize("angle", [37.0, 45.0, 56.0])
def test_edges_cover_the_fibres(kind, angle, caplog):
    """Named edges lie on the fibres and cover nearly all of their length.

    Nodes beside the fibres have moved onto them: few nodes are new.
    """
    mesh = rectangle(kind, 12)
    found = fit_to_fibres(mesh, fabric(angle), HELD).mesh
    check_mesh(found)
    length = shapely.length(fibres_of(mesh, fabric(angle), 2.0)).sum()
    assert length_of(found) == pytest.approx(length, rel=0.05)
    assert np.sum(areas(found)) == pytest.approx(5000)
    on = np.unique(found.facets[:, found.boundaries[SINGULAR]])
    assert np.mean(on < mesh.p.shape[1]) > 0.35
    assert "have no edges" not in caplog.text


def test_curved_fibres_meet_at_nodes():
    """Also where an edge of one fibre is a chord that the other crosses."""

    def curved(sign):
        return lambda x: np.stack([1 + 0 * x[0], sign * (1 + 0.02 * x[0])])

    bent, mesh = Fabric(1e5, 0.5, curved(1), curved(-1)), rectangle(MeshTri, 8)
    found = fit_to_fibres(mesh, bent, HELD).mesh
    lines = fibres_of(mesh, bent, 1.0)
    nodes = shapely.multipoints(found.p.T)
    meetings = [
        point
        for i, one in enumerate(lines)
        for other in lines[:i]
        for point in shapely.get_parts(one & other)
        if point.geom_type == "Point"
    ]
    assert len(meetings) > 3
    assert max(nodes.distance(point) for point in meetings) < 1e-4


def test_a_fibre_without_edges_is_reported_with_its_place(monkeypatch, caplog):
    monkeypatch.setattr(fitting._Fit, "cut", lambda *_: None)
    mesh = rectangle(MeshTri, 8)
    found = fit_to_fibres(mesh, fabric(52.0), HELD).mesh
    edges = shapely.union_all(named_edges(found))
    fibres = shapely.union_all(fibres_of(mesh, fabric(52.0)))
    messages = [m for m in caplog.messages if "have no edges, near" in m]
    assert messages
    for message in messages:
        at = message.partition("near (")[2].partition(")")[0].split(",")
        at = shapely.Point(*map(float, at))
        assert fibres.distance(at) < 0.01
        assert edges.distance(at) > 1e-4


@pytest.mark.parametrize("kind", [MeshQuad, MeshTri])
def test_names_and_parents_are_kept(kind):
    """Boundaries keep their length, and elements lie in their parents."""
    mesh = rectangle(kind, 8)
    found, parent = fit_to_fibres(mesh, fabric(52.0), HELD)
    for name in mesh.boundaries:
        assert length_of(found, name) == pytest.approx(length_of(mesh, name))
    left = np.isin(parent, mesh.subdomains["left half"])
    assert np.array_equal(np.flatnonzero(left), found.subdomains["left half"])
    border = np.flatnonzero(mesh.p[0] == 25)
    np.testing.assert_array_equal(found.p[:, border], mesh.p[:, border])
    centre, old = (m.p[:, m.t].mean(axis=1) for m in (found, mesh))
    assert np.hypot(*(centre - old[:, parent])).max() < 50 / 8


@pytest.mark.parametrize("x", [12.5, 25.0])
@pytest.mark.parametrize("kind", [MeshQuad, MeshTri])
def test_named_inner_boundaries_keep_their_nodes(kind, x):
    """A line along the mesh, which may also be the border of a region."""
    mesh = rectangle(kind, 8, shift=0.0)
    inner = np.flatnonzero(np.abs(mesh.p[0, mesh.facets] - x).max(axis=0) < 1e-9)
    mesh = mesh.with_boundaries({"seam": inner})
    found = fit_to_fibres(mesh, fabric(52.0), HELD).mesh
    nodes = np.unique(mesh.facets[:, inner])
    assert nodes.size == 17
    np.testing.assert_array_equal(found.p[:, nodes], mesh.p[:, nodes])
    ends = found.p[:, found.facets[:, found.boundaries["seam"]]]
    np.testing.assert_allclose(ends[0], x, atol=1e-9)
    assert np.abs(ends[1, 1] - ends[1, 0]).sum() == pytest.approx(100.0)
    assert ends.shape[2] > 16  # fibres cut it


def test_no_slivers():
    mesh = rectangle(MeshTri, 16)
    found, parent = fit_to_fibres(mesh, fabric(52.0), HELD)
    assert (areas(found) / areas(mesh)[parent]).min() > 0.01
    assert smallest_angles(found.p, oriented(found)).min() > 3


def test_mesh_that_follows_the_fibres_is_unchanged():
    """Squares along the fibres, or with them as diagonals of triangles, stay."""
    along = Fabric(1e5, 0.5, (1, 0), (0, 1))
    mesh = MeshQuad().refined(3).scaled(40.0).with_defaults()
    found, parent = fit_to_fibres(mesh, along, {"s": Condition(lambda x: x[1] < 1e-9)})
    assert isinstance(found, MeshQuad)
    assert np.array_equal(found.p, mesh.p)
    assert np.array_equal(parent, np.arange(64))


def test_diagonals_become_edges():
    """Squares with fibres along their diagonals are halved along these."""
    mesh = MeshQuad.init_tensor(np.linspace(0, 50, 11), np.linspace(0, 100, 21))
    found, parent = fit_to_fibres(mesh.with_defaults(), fabric(), HELD)
    assert found.nelements == 400
    assert np.allclose(found.p, mesh.p, atol=1e-9)
    assert np.bincount(parent).max() == 2
    assert len(found.boundaries[SINGULAR]) == 40


@pytest.mark.dear("compares the loads of three plies")
def test_load_on_a_fitted_mesh():
    """The load is within 1.5 %, and without the fit it is not."""
    held = {**HELD, "top": Condition("top", (0.0, 6.0))}
    outline = Outline([[0, 50, 50, 0], [0, 0, 100, 100]])
    net = mesh_outline(outline, fabric(50.0), held, density=1.0)
    mesh = rectangle(MeshTri, 12)

    def load(mesh):
        result = LoadStepper(Ply(mesh, fabric(50.0), Macro()), held, 1).run()
        return result.states[-1].reactions["top"][1]

    exact = LoadStepper(Ply(net, fabric(50.0), Quadratic()), held, 1).run()
    exact = exact.states[-1].reactions["top"][1]
    assert load(fit_to_fibres(mesh, fabric(50.0), held).mesh) == pytest.approx(
        exact, rel=0.015
    )
    assert load(mesh) != pytest.approx(exact, rel=0.015)


@pytest.mark.parametrize(("seed", "angle"), [(1, 53.0), (4, 38.0), (2, 38.0)])
def test_no_fibre_is_left_uncut(seed, angle, caplog):
    """Edges cover the fibres and lie on them, and angles exceed 3 degrees."""
    height = 50 * {53.0: 3.1, 38.0: 2.2}[angle]
    size = (8, round(8 * height / 50))
    mesh = irregular(50.0, height, size, "irregular", 0.25, seed)
    found = fit_to_fibres(mesh, fabric(angle), HELD).mesh
    fibres = fibres_of(mesh, fabric(angle))
    assert length_of(found) == pytest.approx(shapely.length(fibres).sum())
    ends = shapely.points(shapely.get_coordinates(named_edges(found)))
    off = np.min([shapely.distance(f, ends) for f in fibres], axis=0)
    assert off.max() < 1e-9
    assert np.sum(areas(found)) == pytest.approx(50 * height, rel=1e-12)
    assert smallest_angles(found.p, oriented(found)).min() >= 3
    assert caplog.text == ""


def test_nodes_that_would_move_to_fibres_stay_if_they_are_named():
    """Two of one name, since a single one would be a point with fibres."""
    mesh = rectangle(MeshTri, 8)
    free = fit_to_fibres(mesh, fabric(52.0), HELD).mesh.p[:, : mesh.p.shape[1]]
    nodes = np.flatnonzero((free != mesh.p).any(axis=0))[:2]
    named = with_named_nodes(mesh, {"stitches": nodes})
    found = fit_to_fibres(named, fabric(52.0), HELD).mesh
    np.testing.assert_array_equal(found.p[:, nodes], mesh.p[:, nodes])


def test_a_fibre_beside_a_named_node_is_reported(caplog):
    """Named nodes stay, and the small angle between one and a fibre is said."""
    mesh = rectangle(MeshTri, 8)
    fibre = shapely.LineString([(0, 0), (50, 50)])
    gap = shapely.distance(fibre, shapely.points(mesh.p.T))
    gap[(mesh.p[0] < 1) | (mesh.p[0] > 49) | (gap == 0)] = np.inf
    near = int(gap.argmin())
    p = mesh.p.copy()
    along = fibre.interpolate(fibre.project(shapely.Point(p[:, near])))
    p[:, near] = along.x + 0.02, along.y - 0.02
    mesh = with_named_nodes(MeshTri(p, mesh.t), {"stitch": np.array([near])})
    found = fit_to_fibres(mesh.with_defaults(), fabric(), HELD).mesh
    assert np.array_equal(found.p[:, near], p[:, near])
    assert np.sum(areas(found)) == pytest.approx(5000)
    assert "the smallest angle of the fitted mesh" in caplog.text


@pytest.mark.parametrize("kind", [MeshQuad, MeshTri])
@pytest.mark.parametrize(
    "formulation",
    [Quadratic(400.0, points=6), Quadratic(), Macro(), OnePoint(), Full()],
    ids=lambda x: x.title,
)
def test_fields_return_to_the_users_nodes_and_elements(kind, formulation):
    """A linear field is exact at nodes that moved, a constant one in cut elements."""
    mesh = rectangle(kind, 6)
    ply = Ply(fitted(mesh, fabric(41.0), HELD).mesh, fabric(41.0), formulation)
    assert ply.users_mesh is mesh
    assert (ply.nodes[:, : mesh.nvertices] != mesh.p).any()
    np.testing.assert_allclose(ply.on_users_nodes(ply.nodes), mesh.p, atol=1e-11)
    constant = ply.on_users_elements(np.ones(ply.mesh.nelements))
    np.testing.assert_allclose(constant, np.ones(mesh.nelements))


def test_a_quadratic_field_is_exact_at_nodes_that_moved():
    mesh = rectangle(MeshTri, 6)
    ply = Ply(fitted(mesh, fabric(41.0), HELD).mesh, fabric(41.0), Quadratic())

    def field(x):
        return x[0] ** 2 - x[0] * x[1]

    found = ply.on_users_nodes(field(ply.nodes))
    np.testing.assert_allclose(found, field(mesh.p), atol=1e-9)


def test_values_of_the_users_elements_hold_on_the_fitted_mesh():
    """A fabric with directions per element, written without the fit."""
    mesh, plain = rectangle(MeshQuad, 6), fabric(41.0)
    angle = np.radians(41.0) + np.linspace(0, 0.1, mesh.nelements)
    warp = np.array([np.cos(angle), np.sin(angle)])
    ply = Ply(
        fitted(mesh, plain, HELD).mesh,
        Fabric(1e5, 0.5, warp, (0.0, 1.0)),
        Quadratic(),
    )
    found = ply.fabric.directions(ply.basis.global_coordinates())[0][..., 0]
    np.testing.assert_allclose(found, warp[:, ply.parent])


def test_files_of_the_users_mesh_have_its_nodes(tmp_path):
    """They are where they were, with the displacement there."""
    mesh = rectangle(MeshQuad, 6)
    ply = Ply(fitted(mesh, fabric(41.0), HELD).mesh, fabric(41.0), Quadratic())
    result = LoadStepper(ply, HELD, steps=1).run()
    write_fields(result, tmp_path)
    own = meshio.read(tmp_path / "own_step_0001.vtu")
    np.testing.assert_allclose(own.points[:, :2].T, mesh.p, atol=1e-12)
    assert {cell.type: len(cell.data) for cell in own.cells} == {"quad": mesh.nelements}
    u = own.point_data["displacement"][:, :2].T
    np.testing.assert_allclose(
        u[:, np.unique(mesh.facets[:, mesh.boundaries["top"]])][1], 12.0, rtol=1e-9
    )
    exact = ply.on_users_nodes(ply.nodal(result.u))
    assert np.abs(u - exact).max() < 0.1


def both_kinds(n=6):
    """Triangles on the left, quadrilaterals on the right, split, with names."""
    mesh = rectangle(MeshQuad, n)
    left = mesh.subdomains["left half"]
    right = np.setdiff1d(np.arange(mesh.nelements), left)
    quads = mesh.t[:, left]
    cells = np.hstack([quads[[0, 1, 2]], quads[[0, 2, 3]]]), mesh.t[:, right]
    edges = {name: mesh.facets[:, at] for name, at in mesh.boundaries.items()}
    regions = {"left half": np.arange(2 * len(left))}
    return split_cells(mesh.p, cells, edges, regions), mesh


def test_the_cells_of_a_file_of_both_kinds_are_fitted():
    """Names and values belong to the cells, not to their parts."""
    mesh, plain = both_kinds()
    fit = fitted(mesh, fabric(41.0), HELD)
    assert isinstance(fit.mesh, MeshTri)
    assert fit.mesh.nelements < mesh.nelements
    ply = Ply(fit.mesh, fit.fabric, fit.formulation)
    assert [cell.shape[1] for cell in ply.cells] == [c.shape[1] for c in mesh.cells]
    np.testing.assert_allclose(ply.on_users_nodes(ply.nodes), plain.p, atol=1e-11)
    for name in ("bottom", "right"):
        assert length_of(fit.mesh, name) == pytest.approx(length_of(plain, name))
    left = fit.mesh.subdomains["left half"]
    assert areas(fit.mesh)[left].sum() == pytest.approx(2500)


SHEARED = {"bottom": Condition("bottom"), "top": Condition("top", (4.0, 0.0))}


def arcs(x):
    return np.stack([50.0 - x[1], x[0] + 120.0])


def rays(x):
    return np.stack([x[0] + 120.0, x[1] - 50.0])


def test_smooth_directions_per_element_are_as_good_as_their_field():
    """Arcs about a point, given in each element, on a mesh that is fitted."""
    mesh = irregular(50.0, 100.0, (8, 16), "irregular", 0.3, 1)
    x = mesh.p[:, mesh.t].mean(axis=1)
    loads = []
    for fabric in Fabric(1e4, 0.5, rays, arcs), Fabric(1e4, 0.5, rays(x), arcs(x)):
        fit = fitted(mesh, fabric, SHEARED)
        assert "cut along singular fibres" in fit.note
        stepper = LoadStepper(Ply(fit.mesh, fit.fabric, fit.formulation), SHEARED, 1)
        loads.append(stepper.run().states[-1].reactions["top"][0])
    assert loads[1] == pytest.approx(loads[0], rel=5e-3)


def test_a_region_without_shear_stiffness_leaves_the_mesh_as_it_is():
    """A jump of the shear angle there would be a mechanism."""
    mesh = rectangle(MeshTri, 6)
    right = np.setdiff1d(np.arange(mesh.nelements), mesh.subdomains["left half"])
    mesh = mesh.with_subdomains({"rest": right})
    fabrics = {"rest": fabric(), "left half": replace(fabric(), shear=0.0)}
    fit = fitted(mesh, fabrics, HELD)
    assert fit.mesh is mesh
    assert "without shear stiffness nothing resists" in fit.note


def test_a_fit_that_turns_elements_over_is_refused_with_the_cure():
    mesh = irregular(50.0, 100.0, (6, 12), "irregular", 0.3, 1)
    x = mesh.p[:, mesh.t].mean(axis=1)
    turned = Fabric(1e4, 0.5, rays(x), arcs(x))
    assert fitted(mesh, turned, SHEARED).note == (
        "the mesh is left as it is: elements along the singular fibres would be "
        "inverted or degenerate: use smaller elements, or mesh_outline"
    )


def test_directions_that_change_their_sign_are_not_smooth():
    mesh, plain = rectangle(MeshQuad, 6), fabric(41.0)
    sign = np.where(np.arange(mesh.nelements) % 2, 1, -1)
    warp = np.outer(plain.warp, sign)
    fit = fitted(mesh, Fabric(1e5, 0.5, warp, plain.weft), HELD)
    assert fit.mesh is mesh
    assert fit.formulation == DEFAULT
    assert "the warp directions of the elements do not follow a smooth" in fit.note
    uniform = fitted(mesh, Fabric(1e5, 0.5, np.outer(plain.warp, sign**2)), HELD)
    assert uniform.fabric.warp == pytest.approx(plain.warp)


def test_a_mesh_is_left_as_it_is_with_the_reason():
    """Where no fibre is singular, where it cannot be fitted, and where it was."""
    mesh = rectangle(MeshTri, 6)
    free = fitted(mesh, fabric(), {"point": Condition([0])})
    assert free.mesh is mesh
    at_nodes = {"some": Condition("bottom"), "nowhere": Condition("nowhere")}
    refused = fitted(mesh, fabric(), at_nodes)
    assert refused.mesh is mesh
    assert refused.note.startswith("the mesh is left as it is: ")
    assert "there is no fabric" in fitted(mesh, {}, HELD).note
    once = fitted(mesh, fabric(), HELD)
    again = fitted(once.mesh, fabric(), HELD)
    assert again.mesh is once.mesh
    assert "already" in again.note


@pytest.mark.parametrize(
    ("warp", "shear", "held", "chosen"),
    [
        ((1, 0), 0.5, ("bottom", "top"), ON_FIBRES),
        ((1, 0), 0.0, ("bottom", "top"), SMOOTH),
        ((1, 0), 0.5, ("bottom", "top", "left", "right"), SMOOTH),
        ((0, 1), 0.5, ("left", "right"), ON_FIBRES),
    ],
)
def test_fibres_along_free_sides_are_singular(warp, shear, held, chosen):
    """The fibre there carries the shear moment, a traction on the side, alone."""
    mesh, weft = rectangle(MeshTri, 6), (-warp[1], warp[0])
    conditions = {name: Condition(name) for name in held}
    fit = fitted(mesh, Fabric(1e4, shear, warp, weft), conditions)
    assert fit.mesh is mesh
    assert fit.formulation == chosen
    oblique = Fabric(1e4, shear, (1, 2), (-2, 1))
    outline = Outline.of_mesh(mesh)
    assert not has_free_side_along_fibres(outline, [oblique], conditions)


def test_fabrics_of_subdomains_have_fibres_at_their_borders():
    """A patch within a plate, which has a hole there."""
    mesh, of = rectangle(MeshQuad, 6), {"patch": fabric(60.0), "rest": fabric(45.0)}
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    patch = (x > 16) & (x < 34) & (y > 33) & (y < 67)
    parts = {"patch": np.flatnonzero(patch), "rest": np.flatnonzero(~patch)}
    mesh = mesh.with_subdomains(parts)
    fit, plain = fitted(mesh, of, HELD), fitted(mesh, fabric(45.0), HELD)
    assert fit.fabric == of
    along, without = (x.mesh.boundaries[SINGULAR].size for x in (fit, plain))
    assert along > 2 * without
    parents = fit.mesh.parent[fit.mesh.subdomains["patch"]]
    np.testing.assert_array_equal(np.unique(parents), parts["patch"])
    assert Ply(fit.mesh, fit.fabric, Quadratic()).mesh is fit.mesh
    nested = {**of, "left half": fabric(50.0)}
    assert "left as it is" in fitted(mesh, nested, HELD).note


@pytest.mark.parametrize("kind", [MeshQuad, MeshTri])
def test_no_corner_loses_most_of_its_area_when_nodes_move(kind):
    mesh = rectangle(kind, 8)
    lines = fibres_of(mesh, fabric(37.0), 2.0)
    fit = fitting._Fit(mesh, Outline.of_mesh(mesh), lines)
    n = len(fit.t)

    def areas_of_corners():
        a, b, c = (fit.p[:, np.roll(fit.t, -k, axis=0)] for k in (n - 1, 0, 1))
        return np.abs((b - a)[0] * (c - b)[1] - (b - a)[1] * (c - b)[0])

    before = areas_of_corners()
    for i in range(len(lines)):
        last = areas_of_corners()
        fit.move(i)
        assert (areas_of_corners() >= 0.3 * last).all()
    assert (areas_of_corners() < 0.8 * before).any()
