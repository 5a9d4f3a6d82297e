"""Meshes that quadratic triangles take and refuse, and quadrilaterals cut into them."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri, MeshTri2

from skfem_textile import MeshError
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.mesh.splitting import cut, split
from tests.helpers import distorted
from tests.helpers.quadratic_plies import SQUARES, ply_on


def moved(node, by):
    p = SQUARES.p.copy()
    p[:, node] += by
    return MeshTri(p, SQUARES.t)


TWO = np.array([[0, 1, 0, 0.2], [0, 0, 1, 0.2]])


@pytest.mark.parametrize(
    ("mesh", "message"),
    [
        (split(MeshQuad()), "quadratic triangles take no mesh that was split"),
        (MeshTri2(), "a skfem.MeshTri with straight edges, not MeshTri2$"),
        (moved(5, np.nan), r"1 node\(s\) not finite: 5"),
        (moved(12, 0.6), r"triangle\(s\) lie on top of a neighbour"),
        (MeshTri(TWO[:, [0, 1, 1]], [[0], [1], [2]]), "inverted or degenerate: 0"),
        (MeshTri([[0, 1, 3], [0, 1, 3.0]], [[0], [1], [2]]), "degenerate: 0"),
        (MeshTri(TWO, [[0], [1], [2]]), r"1 node.* belong to no triangle.*: 3"),
        (MeshTri(TWO, [[0, 0], [1, 1], [2, 3]]), r"2 triangle.* on top.*: 0, 1"),
        (MeshTri(TWO, [[0] * 3, [1] * 3, [2, 3, 2]]), "share an edge with more than"),
        (MeshTri(TWO, [[0], [1], [4]]), "name a node that is not there: 0"),
    ],
    ids=[
        *("split", "curved", "nan", "overturned", "collapsed", "flat", "unused"),
        *("overlap", "thrice", "index"),
    ],
)
def test_bad_meshes_are_refused(mesh, message):
    with pytest.raises(MeshError, match=message):
        ply_on(mesh)


def test_quadrilaterals_that_are_not_convex_are_cut_inside():
    """A node comes so near the middle of an element that one diagonal lies outside."""
    quads = MeshQuad(
        np.array([[0.0, 2.0, 0.8, 0.0], [0.0, 0.0, 0.8, 2.0]]), np.arange(4)[:, None]
    )
    for turn in range(4):
        mesh = MeshQuad(quads.p, np.roll(quads.t, turn, axis=0)).with_defaults()
        check_mesh(mesh)
        triangles = cut(mesh)
        check_mesh(triangles)
        assert triangles.nelements == 2
        assert set(triangles.boundaries) == {"left", "bottom"}


def test_cut_meshes_keep_the_extent_of_their_names():
    quads = distorted(4).with_subdomains({"part": np.array([0, 2])})
    triangles = cut(quads)
    for name, edges in quads.boundaries.items():
        np.testing.assert_array_equal(
            np.unique(triangles.facets[:, triangles.boundaries[name]]),
            np.unique(quads.facets[:, edges]),
        )
    assert len(triangles.subdomains["part"]) == 4
