"""Lines on plies: edges, fibres and marks, where there is room for them."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import split
from skfem_textile.scenes import bias_extension
from tests.helpers.pictures import degrees_off

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
    coarse = result.ply.mesh
    for mesh, shape, scale in ((coarse, at_rest(coarse), 0.5), fine):
        every, outer = mesh.facets.shape[1], len(mesh.boundary_facets())
        panel = sheet.Panel("", shape)
        by_itself, with_edges, without = (
            [len(x.ends) for x in sheet.lines_of(panel, scale, show_edges)]
            for show_edges in (None, True, False)
        )
        assert by_itself == ([every, outer] if mesh is coarse else [outer])
        assert with_edges == [every, outer]
        assert without == [outer]


SQUARE = MeshTri().refined(4).scaled(60.0)
CENTRES = SQUARE.p[:, SQUARE.t].mean(axis=1)


def fibre_lines(mesh, warp, weft, spacing=2.0, u=None):
    """Ends of the lines of both families, each (2, 2, n): x and y, ends, lines."""
    fibres = sheet.Fibres.of(mesh.p, (mesh.t,), warp, weft)
    shape = sheet.Shape.of(mesh, np.zeros((2, mesh.nvertices)) if u is None else u)
    both = (fibres.lines(shape.points, i, spacing) for i in (0, 1))
    return [ends[..., :2].T for ends in both]


def uniform(mesh, degrees):
    angle = np.radians(degrees)
    direction = np.array([np.cos(angle), np.sin(angle)])
    return np.repeat(direction[:, None], mesh.nelements, axis=1)


@pytest.mark.parametrize("mesh", [SQUARE, MeshQuad().refined(4).scaled(60.0)])
@pytest.mark.parametrize("angle", [0.0, 20.0, 45.0])
def test_parallel_fibres_are_at_equal_distances(mesh, angle):
    """On both sides of each line there is half the distance."""
    warp, weft = (uniform(mesh, x) for x in (angle, angle + 90.0))
    for ends, A in zip(fibre_lines(mesh, warp, weft), (warp, weft), strict=True):
        across = -A[1, 0] * ends[0] + A[0, 0] * ends[1]
        assert np.abs(np.diff(across, axis=0)).max() < 1e-6
        positions = np.unique(across.round(5))
        assert np.diff(positions) == pytest.approx(2.0, abs=1e-4)
        length = np.hypot(*(ends[:, 1] - ends[:, 0])).sum()
        assert 2.0 * length == pytest.approx(60.0**2, rel=0.02)


def test_fibres_move_with_the_ply():
    """Of a square that is sheared by 30 degrees along its warp."""
    u = np.array([np.sin(np.radians(30)) * SQUARE.p[1], 0 * SQUARE.p[1]])
    u[1] = (np.cos(np.radians(30)) - 1) * SQUARE.p[1]
    warp, weft = fibre_lines(SQUARE, uniform(SQUARE, 0), uniform(SQUARE, 90), u=u)
    for ends, angle in ((warp, 0.0), (weft, 60.0)):
        assert degrees_off(ends[:, 1] - ends[:, 0], angle).max() < 1e-3


def test_curved_fibres_are_followed():
    """Circles about a point outside the ply, and radii, whose distances grow."""
    radius = CENTRES + 30.0
    around = np.array([-radius[1], radius[0]])
    circles, radii = (ends + 30.0 for ends in fibre_lines(SQUARE, around, radius))
    assert np.abs(np.diff(np.hypot(*circles), axis=0)).max() < 0.05
    angle = np.arctan2(*radii[::-1])
    turn = np.abs(np.diff(angle, axis=0)) * np.hypot(*radii.mean(axis=1))
    assert turn.max() < 0.1  # mm to the side in a triangle of 3.75 mm
    assert radii.shape[-1] > 500


def test_fibres_end_where_another_fabric_begins():
    left = CENTRES[0] < 30
    warp = np.where(left, uniform(SQUARE, 0), uniform(SQUARE, 60))
    ends, _ = fibre_lines(SQUARE, warp, warp[::-1] * [[-1], [1]])
    along, middle = ends[:, 1] - ends[:, 0], ends.mean(axis=1)
    for side, angle in ((middle[0] < 30, 0.0), (middle[0] > 30, 60.0)):
        assert degrees_off(along[:, side], angle).max() < 1e-2


def test_small_failing_elements_have_rings(fine):
    _, shape, scale = fine
    panel = sheet.Panel("", shape, marked=np.array([100]))
    _, marks = sheet.lines_of(panel, scale, None)
    reach = np.ptp(marks.ends.reshape(-1, 3), axis=0)[:2] * scale
    assert (reach > 3).all()
