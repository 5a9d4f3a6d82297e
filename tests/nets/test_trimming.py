"""Nets trimmed along curves on a tool, with holes."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers import tool_shapes

SPHERE = drape.Sphere(100.0, (0, 0, -100))


def circle(polar, centre=(0.0, 0.0), n=240, radius=100.0):
    """A small circle of the sphere about the pole, or a tilted one."""
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    x = np.array([np.sin(polar) * np.cos(t), np.sin(polar) * np.sin(t)])
    z = np.cos(polar) + 0 * t
    tilt = centre[0]
    turned = np.cos(tilt) * x[0] + np.sin(tilt) * z
    z = np.cos(tilt) * z - np.sin(tilt) * x[0]
    return radius * np.array([turned, x[1], z - 1])


def cap(polar, radius=100.0):
    return 2 * np.pi * radius**2 * (1 - np.cos(polar))


def test_the_area_of_a_trimmed_net_on_the_tool_is_exact():
    """Areas of sheared cells: flat, they are larger."""
    net = drape.net(SPHERE, 2.5, (32, 32), (32, 32))
    part = drape.trimmed(net, circle(0.7))
    assert part.area == pytest.approx(cap(0.7), rel=1e-3)
    assert part.pattern.area > 1.004 * part.area
    inside = part.shares > 0
    assert np.isfinite(part.shear_angle()[inside]).all()
    assert np.isnan(part.shear_angle()[~inside]).all()


def test_holes_are_cut_out_of_net_and_pattern():
    net = drape.net(SPHERE, 2.5, (32, 32), (32, 32))
    outer, hole = circle(0.7), circle(0.2, (0.3, 0.0))
    whole = drape.trimmed(net, outer)
    part = drape.trimmed(net, outer, [hole])
    cut = drape.trimmed(net, hole)
    assert part.area == pytest.approx(cap(0.7) - cap(0.2), rel=1e-3)
    assert len(part.pattern.holes) == 1
    assert part.pattern.area == pytest.approx(whole.pattern.area - cut.pattern.area)


@pytest.mark.parametrize(
    ("shape", "cell"),
    [
        (lambda: tool_shapes.hemisphere_with_flange(40.0, 10.0, 15.0), 6.0),
        (tool_shapes.saddle, 12.0),
        (lambda: tool_shapes.bonnet(askew=True), 16.0),
    ],
)
def test_a_net_up_to_the_boundary_covers_the_area_of_a_tool(shape, cell):
    tool = drape.TriangleMesh(*shape())
    points = tool.facets.points
    a, b, c = points[:, tool.facets.triangles()].swapaxes(0, 1)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum()
    middle = points[:, np.hypot(*points[:2]).argmin()]
    net = drape.net(tool, cell, angles=(0.5, 0.5 + np.pi / 2), point=middle)
    (outline, *_) = tool.facets.boundary()
    assert drape.trimmed(net, outline).area == pytest.approx(area, rel=5e-3)


def test_points_of_a_part_on_vertical_walls_and_around_a_hole():
    """A curve around the walls of a box at half of their height."""
    box = drape.TriangleMesh(
        *tool_shapes.deep_box(60.0, 40.0, 30.0, fillet=5.0, draft=0.0, flange=10.0)
    )
    t = np.array([[-30, 30, 30, -30], [-20, -20, 20, 20]], dtype=float)
    turn = np.linspace(0, 2 * np.pi, 30, endpoint=False)
    hole = np.array([8 * np.cos(turn), 8 * np.sin(turn), 0 * turn + 30])
    points = drape.points_of_part(box, np.vstack([t, 4 * [15.0]]), [hole])
    vertices = box.facets.points
    z, r = vertices[2], np.hypot(*vertices[:2])
    expected = (z > 16) & ((z < 29) | (r > 10))
    own = points[:, np.abs(points[2] - 15) > 1e-9]
    assert own[2].min() > 14
    top = own[2] > 29
    assert np.hypot(*own[:2, top]).min() > 6.5
    known = {tuple(x) for x in own.T}
    assert {tuple(x) for x in vertices[:, expected].T} <= known
