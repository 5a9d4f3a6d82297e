"""Fields on a mesh that was made of cells, at the nodes of the cells."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile.mesh.splitting import at_nodes, hat_functions, split, split_cells
from tests.helpers import TRIANGLE_AND_QUAD

SQUARES = MeshQuad.init_tensor(np.arange(4.0), np.array([0.0, 1.0, 3.0]))


def moved(p):
    """Points of which the two inner ones have moved."""
    inside = (p[0] > 0) & (p[0] < 3) & (p[1] == 1)
    return p + inside * np.array([[0.21], [-0.13]])


def linear(x):
    return 2 - x[0] + 3 * x[1]


def squared(x):
    return x[0] ** 2 - x[0] * x[1] + 2 * x[1] ** 2


def test_a_linear_field_on_moved_quadrilaterals_and_triangles_is_exact():
    """Also if the mesh has more nodes than the cells."""
    p, t = SQUARES.p, SQUARES.t
    halves = np.hstack([t[[0, 1, 2]], t[[0, 2, 3]]])
    for elements, parent in ((t, np.arange(6)), (halves, np.tile(np.arange(6), 2))):
        nodes = np.append(moved(p), [[9.0], [9.0]], axis=1)
        matrix = at_nodes(p, [t], nodes, elements, parent)
        assert matrix.shape == (12, 13)
        assert matrix @ linear(nodes) == pytest.approx(linear(p))
        still = (moved(p) == p).all(axis=0)
        assert matrix[still][:, :12].toarray() == pytest.approx(np.eye(12)[still])


def test_a_quadratic_field_on_moved_quadratic_triangles_is_exact():
    cells = SQUARES.to_meshtri().t
    mesh = MeshTri(moved(SQUARES.p), cells)
    nodes = np.hstack([mesh.p, mesh.p[:, mesh.facets].mean(axis=1)])
    elements = np.vstack([mesh.t, 12 + mesh.t2f])
    matrix = at_nodes(SQUARES.p, [cells], nodes, elements, np.arange(cells.shape[1]))
    assert matrix @ squared(nodes) == pytest.approx(squared(SQUARES.p))


def test_without_a_move_the_nodes_of_the_cells_come_first():
    p, t = SQUARES.p, SQUARES.t
    matrix = at_nodes(p, [t], np.append(p, p[:, :3], axis=1), t, np.arange(6))
    assert matrix.toarray() == pytest.approx(np.eye(12, 15))


def test_hat_functions_are_one_at_a_corner_and_linear_along_edges():
    """In the middle of a cell they are the mean of its corners."""
    mesh = split_cells(*TRIANGLE_AND_QUAD)
    hats = hat_functions(mesh, mesh.p.shape[1]).toarray()
    n = TRIANGLE_AND_QUAD[0].shape[1]
    assert hats[:, :n] == pytest.approx(np.eye(n))
    assert hats.sum(axis=0) == pytest.approx(1.0)
    assert TRIANGLE_AND_QUAD[0] @ hats == pytest.approx(mesh.p)
    triangles = split(MeshTri())
    of_triangles = hat_functions(triangles, triangles.p.shape[1])
    assert MeshTri().p @ of_triangles == pytest.approx(triangles.p)
    assert hat_functions(SQUARES, 12).toarray() == pytest.approx(np.eye(12))
    facets = MeshTri().facets
    quadratic = hat_functions(MeshTri(), 4 + facets.shape[1]).toarray()
    halves = np.argwhere(quadratic[:, 4:].T == 0.5)[:, 1].reshape(-1, 2).T
    assert halves == pytest.approx(np.sort(facets, axis=0))
