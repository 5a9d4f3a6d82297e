"""Outlines: names, points, regions, files, and what is refused."""

import numpy as np
import pytest
import shapely
from skfem import MeshQuad, MeshTri

from skfem_textile import Outline
from skfem_textile.mesh.checks import with_edges
from skfem_textile.mesh.selection import with_named_nodes
from skfem_textile.outlines.drawings.elements import _arc_points
from skfem_textile.outlines.rings import _is_closed, refuse_too_many, valid_ring
from skfem_textile.outlines.triangles import refuse_narrow_gaps

SQUARE = np.array([[0.0, 100, 100, 0], [0, 0, 100, 100]])


def at(x, y, side=10.0):
    """Corners of a small square."""
    return side / 100 * SQUARE + np.array([[x], [y]])


@pytest.mark.parametrize("reverse", [False, True])
def test_rings_are_oriented_and_names_follow_their_edges(reverse):
    order = slice(None, None, -1 if reverse else 1)
    square, hole = SQUARE[:, order], at(40, 40)[:, order]
    # The edge at the bottom of the square, and the one on the right of the hole.
    bottom, right = (2, 1) if reverse else (0, 1)
    names = {"clamp": [bottom], "hook": (1, [right])}
    outline = Outline(square, [hole], names)
    assert shapely.Polygon(outline.polygon.T).exterior.is_ccw
    assert not shapely.Polygon(outline.holes[0].T).exterior.is_ccw
    start, end = outline.edges()
    middle = (start + end) / 2
    for name, place in {
        "clamp": (50, 0),
        "bottom": (50, 0),
        "right": (100, 50),
        "top": (50, 100),
        "left": (0, 50),
        "hook": (50, 45),
    }.items():
        assert middle[:, outline.boundaries[name]].T.tolist() == [list(place)]
    assert outline.boundaries["hole"].tolist() == [False] * 4 + [True] * 4
    assert sorted(outline.edge_names[0]) == ["clamp", "left", "right", "top"]
    assert sorted(outline.edge_names[1]) == ["hole"] * 3 + ["hook"]
    assert outline.shape().area == 9900


def test_only_edges_on_the_bounding_box_have_the_names_of_sides():
    outline = Outline([[0, 60, 100, 100, 0], [0, 0, 40, 100, 100]])
    assert outline.edge_names == [["bottom", "", "right", "top", "left"]]
    two = Outline(SQUARE, [at(20, 20), at(60, 60)])
    assert two.edge_names[1:] == [["hole 1"] * 4, ["hole 2"] * 4]


@pytest.mark.parametrize("mesh", [MeshTri().refined(3), MeshQuad().refined(3)])
def test_the_boundary_of_a_mesh(mesh):
    mesh = with_edges(mesh.scaled(80.0))
    pulled = mesh.facets_satisfying(lambda x: (x[1] == 0) & (x[0] > 39))
    outline = Outline.of_mesh(mesh.with_boundaries({"pulled": pulled}))
    assert outline.polygon.shape == (2, 5)
    assert (outline.polygon == [[40], [0]]).all(axis=0).any()
    assert outline.boundaries["bottom"].sum() == 2
    assert outline.boundaries["pulled"].sum() == 1
    assert outline.shape().area == pytest.approx(6400)


def test_the_boundary_of_a_mesh_with_a_hole():
    mesh = MeshQuad().refined(3)
    x = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.remove_elements(np.flatnonzero((np.abs(x - 0.5) < 0.25).all(axis=0)))
    outline = Outline.of_mesh(mesh)
    assert [ring.shape for ring in outline.rings] == [(2, 4), (2, 4)]
    assert outline.shape().area == 0.75


def test_single_named_nodes_of_a_mesh_are_points():
    mesh = MeshTri().refined(2)
    node = np.flatnonzero((mesh.p == [[0.5], [0.25]]).all(axis=0))
    mesh = with_named_nodes(mesh, {"stitch": node, "row": np.arange(3)})
    points = Outline.of_mesh(mesh).points
    assert {name: x.tolist() for name, x in points.items()} == {"stitch": [0.5, 0.25]}


def square_with_gap(gap):
    """A square of 10 mm with a hole near its left side."""
    hole = [(gap, 4), (5, 4), (5, 6), (gap, 6)]
    return shapely.Polygon([(0, 0), (10, 0), (10, 10), (0, 10)], [hole])


@pytest.mark.parametrize(
    ("call", "accepted", "value", "text"),
    [
        (
            lambda x: valid_ring("ply", [[0, 1, 1 + x, 1, 0], [0, 0, 1, 1 + x, 1]]),
            *(3e-9, 3e-10, "coincident corners"),
        ),
        (lambda x: valid_ring("ply", [[0, 1, 1], [0, 0, x]]), 3e-9, 3e-10, "coinci"),
        (lambda x: refuse_narrow_gaps(square_with_gap(x), 1.0), 3e-3, 3e-4, "narrow"),
        (lambda n: refuse_too_many("a.svg", n), 100_000, 100_001, "more than 100000"),
    ],
)
def test_an_outline_is_refused_beyond_a_limit(call, accepted, value, text):
    call(accepted)
    with pytest.raises(ValueError, match=text):
        call(value)


def test_a_curve_whose_ends_nearly_meet_is_closed():
    """Relative to its size, a square of the diagonal 1."""
    for gap, closed in ((3e-6, True), (3e-5, False)):
        points = np.array([[0, 0.6, 0.6, 0, 0], [0, 0, 0.8, 0.8, gap]])
        assert _is_closed(points) == closed


def test_an_arc_has_at_most_ten_thousand_segments():
    assert _arc_points(np.pi, 1.0, 1e-7) == 1 + 3513
    assert _arc_points(np.pi, 1.0, 1e-12) == 10_001
