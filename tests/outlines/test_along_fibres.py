"""Meshes along the fibres: positions of edges, and motions they can represent."""

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Outline,
    Ply,
    Quadratic,
    mesh_along_fibres,
)
from skfem_textile.mesh.bases import node_dofs
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.scenes import bias_extension, strip, trellis
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.intervals import without_interval
from tests.outlines.test_net import area

SQUARE = np.array([[0.0, 30.0, 30.0, 0.0], [0.0, 0.0, 30.0, 30.0]])
# Rounded, so that two sides are exactly along x.
HEXAGON = np.round(
    [30 * np.cos(np.arange(6) * np.pi / 3), 30 * np.sin(np.arange(6) * np.pi / 3)], 12
)
NOTCHED = np.array([[0, 30, 30, 18, 18, 0], [0, 0, 20, 20, 30, 30]], dtype=float)
HOLE = np.array([[6, 12, 14], [8, 6, 15]], dtype=float)
FORMULATIONS = [Full(), OnePoint(), Macro(), Quadratic(), Quadratic(80.0)]
ANGLES = [30.0, 37.5, 45.0, 52.5, 60.0]


def unit(degrees):
    return np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])


def fibre_coordinates(p, warp, weft):
    """Coordinates of points along the fibres, shape (2, n)."""
    return np.linalg.solve(np.column_stack([unit(warp), unit(weft)]), p)


def edge_lines(mesh, warp, weft):
    """Coordinates of the lines of edges along weft and along warp, and of all nodes.

    Of nodes the least and the largest ones; none twice up to round-off.
    """
    lines = []
    for s in fibre_coordinates(mesh.p, warp, weft):
        ends = s[mesh.facets]
        along = ends[0, np.abs(ends[1] - ends[0]) < 1e-9]
        at = np.sort([*along, s.min(), s.max()])
        lines.append(at[np.diff(at, prepend=-np.inf) > 1e-9])
    return lines


def extension(degrees, n, **options):
    theta = np.radians(degrees)
    return bias_extension(
        "aligned", (n, 2 * n), warp=theta, weft=np.pi - theta, **options
    )


def solve(scene, formulation, E, G=0.5, steps=2):
    ply = Ply(scene.mesh, Fabric(E, G, scene.warp, scene.weft), formulation)
    return scene.summary(
        without_interval(LoadStepper(ply, scene.conditions, steps).run())
    )


def largest_strain(ply, x):
    """The largest strain at any point of a law or of the error measure."""
    u = ply.basis.zeros()
    u[node_dofs(ply.basis)] = x - ply.nodes
    strains = ply.law_strain(u), ply.fibre_strain(u, ply.fine_points)
    return max(np.abs(strain).max() for strain in strains)


def edges_along(mesh, warp, weft):
    """Number of edges of each triangle along warp and weft, shape (2, n)."""
    s = fibre_coordinates(mesh.p, warp, weft)[:, mesh.t]
    return (np.abs(np.roll(s, -1, axis=1) - s) < 1e-9).sum(axis=1)


@pytest.mark.parametrize("degrees", ANGLES)
def test_every_triangle_has_an_edge_along_warp_and_one_along_weft(degrees, caplog):
    caplog.set_level("INFO", "skfem_textile")
    mesh = extension(degrees, 5).mesh
    np.testing.assert_array_equal(edges_along(mesh, degrees, 180 - degrees), 1)
    sides = {name: len(edges) for name, edges in mesh.boundaries.items()}
    assert sides == {"left": 10, "bottom": 5, "right": 10, "top": 5}
    assert caplog.messages == []


@settings(max_examples=6, phases=[Phase.explicit, Phase.generate])
@given(
    warp=st.integers(0, 180),
    crossing=st.integers(5, 175),
    rings=st.sampled_from(
        [[SQUARE[:, ::-1]], [HEXAGON], [HEXAGON[:, [0, 1, 3]]], [NOTCHED, HOLE]]
    ),
    spacing=st.floats(3, 12),
    seed=st.integers(0, 1000),
)
@example(179, 47, [HEXAGON], 3.3236387476298743, 350)  # thin triangles
@example(30, 90, [NOTCHED, HOLE], 4.0, 3)
def test_motions_bent_at_lines_stretch_no_fibre(warp, crossing, rings, spacing, seed):
    """In any outline, and in the elements that are cut off."""
    weft, rng = warp + crossing, np.random.default_rng(seed)
    outline = Outline(rings[0], rings[1:])
    mesh = mesh_along_fibres(outline, unit(warp), unit(weft), spacing)
    check_mesh(mesh)
    assert area(mesh) == pytest.approx(outline.shape().area, rel=1e-12)
    assert np.abs(mesh.p.min(axis=1) - rings[0].min(axis=1)).max() == 0
    assert ("hole" in mesh.boundaries) == (len(rings) > 1)

    formulation = FORMULATIONS[seed % len(FORMULATIONS)]
    fabric = Fabric(1e4, 0.0, unit(warp), unit(weft))
    ply = Ply(mesh, fabric, formulation)
    s = fibre_coordinates(ply.nodes, warp, weft)
    lines, x = edge_lines(mesh, warp, weft), 0.0
    for at, line, angle in zip(s, lines, (warp, weft), strict=True):
        bends = np.radians(angle) + rng.uniform(-0.03, 0.03, line.size - 1)
        steps = np.diff(line) * np.array([np.cos(bends), np.sin(bends)])
        path = np.hstack([np.zeros((2, 1)), np.cumsum(steps, axis=1)])
        x = x + np.array([np.interp(at, line, component) for component in path])
    assert largest_strain(ply, x) < 1e-8


@pytest.mark.parametrize(
    ("degrees", "formulation"),
    [(30.0, Full()), (45.0, Quadratic()), (52.5, Full()), (60.0, Quadratic())],
)
def test_errors_of_a_bias_extension_decrease_with_stiffness(degrees, formulation):
    """Down to 1e-8 of the width, in proportion to G/E, on a coarse mesh."""
    size = WIDTH * np.hypot(1, 2 * np.tan(np.radians(degrees)))
    stiff, rigid = (solve(extension(degrees, 3), formulation, E) for E in (5e6, 5e9))
    assert stiff["displacement_error_max"] < 1e-4 * size
    assert rigid["displacement_error_max"] < 1.1e-3 * stiff["displacement_error_max"]
    assert rigid["displacement_error_max"] < 1e-8 * size
    assert rigid["load_over_exact"] == pytest.approx(1.0, abs=2e-6)
    assert rigid["stable"]


@pytest.mark.parametrize("size", [(50.0, 120.0), (50.0, 107.3)])
def test_kinks_are_lines_of_the_net_where_it_does_not_close(size):
    """The exact motion of a higher ply has kinks along lines through its corners."""
    mesh = rectangle(*size, (6, 12), "aligned", warp=np.pi / 4, weft=3 * np.pi / 4)
    scene = bias_extension(mesh)
    ply = Ply(scene.mesh, Fabric(1e4, 0.5, scene.warp, scene.weft), Quadratic())
    assert largest_strain(ply, ply.nodes + scene.displacement(ply.nodes, 1.0)) < 1e-12


def test_lines_that_do_not_meet_at_the_sides_are_logged(caplog):
    caplog.set_level("INFO", "skfem_textile")
    mesh_along_fibres(SQUARE * [[1.0], [1.37]], (1, 1), (-1, 1), 5.0)
    assert "lines of warp and weft do not meet at the sides" in caplog.text


@pytest.mark.parametrize("fibres", [(0, 60), (20, 160), (45, 135), (90, 150)])
def test_the_distance_of_points_on_the_sides_is_at_most_the_spacing(fibres):
    mesh = mesh_along_fibres(HEXAGON, *map(unit, fibres), 4.0)
    ends = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0)
    assert 0.5 < lengths.max() / 4.0 < 1 + 1e-9


def test_cells_along_the_sides_of_a_rectangle_are_quadrilaterals():
    mesh = strip("aligned", (4, 6)).mesh
    assert isinstance(mesh, MeshQuad)
    x, y = np.meshgrid(np.linspace(0, 40, 5), np.linspace(0, 60, 7))
    np.testing.assert_array_equal(mesh.p, [x.ravel(), y.ravel()])
    assert mesh.nelements == 24
    sides = {name: len(edges) for name, edges in mesh.boundaries.items()}
    assert sides == {"left": 6, "bottom": 4, "right": 6, "top": 4}


def test_a_corner_may_be_straight_and_lines_pass_through_it():
    outline = np.array([[0.0, 7.0, 30.0, 30.0, 0.0], [0.0, 0.0, 0.0, 30.0, 30.0]])
    mesh = mesh_along_fibres(outline, unit(45), unit(135), 100.0)
    at = np.flatnonzero((mesh.p == [[7.0], [0.0]]).all(axis=0))
    assert at.size == 1
    assert isinstance(mesh, MeshTri)


def test_sides_along_the_fibres_give_quadrilaterals_around_a_hole():
    """And in a concave outline, with fibres that are not along the axes."""
    turn = np.array([unit(30), unit(120)]).T
    hole = [[6, 12, 12, 6], [6, 6, 9, 9]]
    outline = Outline(turn @ NOTCHED, [turn @ hole], points={"pin": turn @ [21, 4]})
    mesh = mesh_along_fibres(outline, unit(30), unit(120), 3.0)
    assert isinstance(mesh, MeshQuad)
    check_mesh(mesh)
    assert area(mesh) == pytest.approx(outline.shape().area, rel=1e-12)
    np.testing.assert_allclose(
        mesh.p[:, mesh.named_nodes["pin"]].T, [turn @ [21, 4]], rtol=0, atol=1e-12
    )
    assert mesh.nelements == 10 * 12 - 4 * 4 - 2 * 1


def test_lines_of_both_families_meet_at_all_sides_of_an_L():
    L = [[0, 40, 40, 20, 20, 0], [0, 0, 20, 20, 60, 60]]
    mesh = mesh_along_fibres(L, unit(45), unit(135), 5.0)
    np.testing.assert_array_equal(edges_along(mesh, 45, 135), 1)
    ends = mesh.p[:, mesh.facets[:, mesh.boundary_facets()]]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=0), 5.0)


@pytest.mark.parametrize("degrees", [10.0, 47.0, 71.0, 133.0])
def test_an_outline_turned_with_its_fibres_has_the_same_elements(degrees):
    """Also where the corner of a cell touches a side, up to round-off."""
    turn, H = np.array([unit(degrees), unit(degrees + 90)]).T, 50 * np.sqrt(3)
    outline = np.array([[0, 50, 50, 0], [0, 0, H, H]])
    mesh = mesh_along_fibres(outline, unit(30), unit(150), 5.0)
    turned = mesh_along_fibres(turn @ outline, turn @ unit(30), turn @ unit(150), 5.0)
    centres, others = (m.p[:, m.t].mean(axis=1) for m in (mesh, turned))
    assert centres.shape == others.shape
    gaps, _ = KDTree(others.T).query((turn @ centres).T)
    assert gaps.max() < 1e-9


def test_a_bent_trellis_converges_along_inclined_fibres():
    errors = []
    for n in (4, 8, 16):
        scene = trellis("aligned", (n, n), warp=np.pi / 4, weft=3 * np.pi / 4)
        summary = solve(scene, Quadratic(), 1e4, 0.0)
        errors.append(summary["displacement_error_rms"])
    assert errors[0] > 6 * errors[1] > 36 * errors[2]
