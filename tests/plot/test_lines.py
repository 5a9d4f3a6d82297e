"""Lines on plies: edges, fibres and marks, where there is room for them."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import split
from skfem_textile.scenes import bias_extension

lines = pytest.importorskip("skfem_textile.plot.sheet")
sheet = pytest.importorskip("skfem_textile.plot.sheet")


@pytest.fixture(scope="module")
def fine():
    """40×80 quadrilaterals, each split in four, 80 mm high on the picture."""
    mesh = split(bias_extension(size=(40, 80), mesh="irregular").mesh)
    shape = at_rest(mesh)
    return mesh, shape, 80 / np.ptp(shape.points[:, 1])


def at_rest(mesh):
    return sheet.Shape.of(mesh, np.zeros((2, mesh.nvertices)))


def test_edges_are_drawn_where_there_is_room(result, fine):
    """The outline is always drawn."""
    coarse = sheet.Panel("", at_rest(result.ply.mesh))
    split_mesh, shape, fine_scale = fine
    small = sheet.Panel("", shape)

    def drawn(panel, scale, show_edges):
        return [len(x.ends) for x in lines.lines_of(panel, scale, show_edges)]

    for panel, scale, mesh in (
        (coarse, 0.5, result.ply.mesh),
        (small, fine_scale, split_mesh),
    ):
        every, outer = mesh.facets.shape[1], len(mesh.boundary_facets())
        by_itself = [every, outer] if panel is coarse else [outer]
        assert drawn(panel, scale, None) == by_itself
        assert drawn(panel, scale, True) == [every, outer]
        assert drawn(panel, scale, False) == [outer]


def test_fibres_of_small_elements_are_thinned_to_a_spacing(fine):
    _, shape, scale = fine
    points, elements, _ = lines.fibre_positions(shape, scale)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1) * scale
    nearest = np.sort(apart, axis=1)[:, 1]
    np.testing.assert_allclose(nearest, 2.4, rtol=1e-9)
    area = np.prod(np.ptp(shape.points[:, :2], axis=0)) * scale**2
    assert len(points) == pytest.approx(area / 2.4**2, rel=0.05)
    away = np.linalg.norm(points - shape.centres[elements], axis=1)
    assert (away <= shape.sides[elements]).all()


@pytest.mark.parametrize("n", [10, 40])
def test_fibres_end_within_a_slanted_outline(n):
    """For large elements, and for elements that are thinned to a grid."""
    mesh = MeshQuad.init_tensor(*2 * [np.linspace(0.0, 60.0, n + 1)])
    slant = 1.2
    shape = sheet.Shape.of(mesh, np.stack([slant * mesh.p[1], 0 * mesh.p[1]]))
    along, across = (np.tile(v, (n**2, 1)) for v in ([1.0, 0, 0], [0, 1.0, 0]))
    panel = sheet.Panel("", shape, fibres=sheet.Fibres(along, across))
    for family in lines.lines_of(panel, 1.0, show_edges=False)[1:]:
        x, y, _ = family.ends.reshape(-1, 3).T
        for inside in (x - slant * y, y):
            assert inside.min() > -1e-9
            assert inside.max() < 60.0 + 1e-9
        assert len(family.ends) > 80


def test_a_point_is_in_the_element_that_holds_it(result):
    u = result.ply.nodal(result.u)
    shape = sheet.Shape.of(result.ply.mesh, u)
    assert lines.holding(shape, shape.centres).tolist() == list(range(12))
    assert lines.holding(shape, shape.points.max(axis=0)[None] + 1.0).tolist() == [-1]


def test_small_failing_elements_have_rings(fine):
    _, shape, scale = fine
    panel = sheet.Panel("", shape, marked=np.array([100]))
    _, marks = lines.lines_of(panel, scale, None)
    reach = np.ptp(marks.ends.reshape(-1, 3), axis=0)[:2] * scale
    assert (reach > 3).all()
