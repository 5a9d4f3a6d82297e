"""Outlines: names, points, regions, files, and what is refused."""

import numpy as np
import pytest
import shapely
from skfem import MeshQuad, MeshTri

from skfem_textile import Outline
from skfem_textile.mesh.checks import with_edges
from skfem_textile.mesh.selection import with_named_nodes

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
