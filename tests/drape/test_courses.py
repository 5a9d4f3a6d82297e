"""Courses: strips of a roll side by side."""

import numpy as np
import pytest
import shapely

from skfem_textile import drape
from tests.helpers import tool_shapes

CYLINDER = drape.TriangleMesh(*tool_shapes.cylinder(100.0, 200.0, 120.0))


def laid(tool, width, overlap, degrees):
    warp = np.radians(degrees)
    points = tool.facets.points
    top = points[:, points[2].argmax()]
    angles = warp, warp + np.pi / 2
    return drape.courses(tool, 5.0, width, overlap, point=top, angles=angles)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 75.0])
def test_strips_without_overlap_have_the_area_of_a_developable_tool(degrees):
    """The outer ones end with the first whole cell beyond the tool."""
    strips = laid(CYLINDER, 60.0, 0.0, degrees)
    area = sum(strip.pattern.area for strip in strips)
    of_tool, outer_cells = CYLINDER.facets.area, 2 * 5.0 * 250.0
    assert 0.998 * of_tool < area < of_tool + outer_cells
    shear = [np.nanmax(np.abs(strip.net.shear_angle())) for strip in strips]
    assert np.degrees(max(shear)) < 0.2


def test_a_strip_starts_at_the_overlap_from_the_edge_of_its_neighbour():
    bonnet = drape.TriangleMesh(*tool_shapes.bonnet())
    one, other = laid(bonnet, 60.0, 20.0, 0.0)[-2:]
    edge = one.net.positions[:, :, -1 - 4]  # four cells of 5 mm
    start = other.net.positions[:, :, 0]
    for x in start.T[np.isfinite(start[0])]:
        assert np.nanmin(np.linalg.norm(edge - x[:, None], axis=0)) < 2.6
    assert np.ptp(other.net.along[1]) == pytest.approx(60.0)


@pytest.mark.parametrize("overlap", [0.0, 20.0])
def test_both_sides_of_a_seam_are_one_line_on_the_tool(overlap):
    bonnet = drape.TriangleMesh(*tool_shapes.bonnet())
    strips = laid(bonnet, 60.0, overlap, 20.0)
    lines = {}
    for strip in strips:
        for seam in strip.pattern.seams:
            lines.setdefault(seam.number, []).append(seam)
    assert sorted(lines) == list(range(1, len(strips)))
    for one, other in lines.values():
        lengths = [
            np.linalg.norm(np.diff(of), axis=0).sum()
            for line in (one, other)
            for of in (line.flat, line.on_tool)
        ]
        np.testing.assert_allclose(lengths, lengths[0], rtol=5e-3)
        for x in other.on_tool.T:
            away = np.linalg.norm(one.on_tool - x[:, None], axis=0)
            assert away.min() < 2.6
    moved = drape.side_by_side([strip.pattern for strip in strips])
    for pattern in moved:
        for seam in pattern.seams:  # on the pattern, which has moved
            inside = shapely.Polygon(pattern.outline.T).buffer(0.1)
            assert shapely.contains_xy(inside, *seam.flat).all()


def test_patterns_side_by_side_do_not_overlap():
    strips = laid(CYLINDER, 60.0, 10.0, 30.0)
    moved = drape.side_by_side([strip.pattern for strip in strips], gap=7.0)
    weft = moved[0].weft[:, 0]
    spans = [(weft @ one.outline).min() for one in moved]
    ends = [(weft @ one.outline).max() for one in moved]
    gaps = np.array(spans[1:]) - np.array(ends[:-1])
    np.testing.assert_allclose(gaps, 7.0)
    areas = [one.area for one in moved]
    np.testing.assert_allclose(areas, [strip.pattern.area for strip in strips])


@pytest.mark.parametrize("overlap", [-1.0, 60.0, np.nan])
def test_an_overlap_beyond_the_width_is_refused(overlap):
    with pytest.raises(ValueError, match="the overlap must be"):
        laid(CYLINDER, 60.0, overlap, 0.0)
