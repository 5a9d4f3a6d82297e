"""Courses: strips of a roll side by side, which meet at seams."""

from functools import cache

import numpy as np
import pytest
import shapely

from skfem_textile import drape
from tests.helpers import tool_shapes

CYLINDER = drape.TriangleMesh(*tool_shapes.cylinder(100.0, 60.0, 40.0, 12.0))
BONNET = drape.TriangleMesh(*tool_shapes.bonnet(90.0, 80.0, 15.0, size=10.0))
CELL, WIDTH = 10.0, 40.0


@cache
def laid(tool, overlap, degrees):
    warp = np.radians(degrees)
    points = tool.facets.points
    top = points[:, points[2].argmax()]
    angles = warp, warp + np.pi / 2
    return drape.courses(tool, CELL, WIDTH, overlap, point=top, angles=angles)


@pytest.mark.parametrize("degrees", [30.0])
def test_strips_without_overlap_have_the_area_of_a_developable_tool(degrees):
    """The outer ones end with the first whole cell beyond the tool."""
    strips = laid(CYLINDER, 0.0, degrees)
    area = sum(strip.pattern.area for strip in strips)
    of_tool, outer_cells = CYLINDER.facets.area, 2 * CELL * 100.0
    assert 0.998 * of_tool < area < of_tool + outer_cells
    shear = [np.nanmax(np.abs(strip.net.shear_angle())) for strip in strips]
    assert np.degrees(max(shear)) < 0.2


@pytest.fixture(scope="module")
def strips():
    return laid(BONNET, 10.0, 20.0)


def test_a_strip_starts_at_the_overlap_from_the_edge_of_its_neighbour(strips):
    one, other = strips[-2:]
    edge = one.net.positions[:, :, -1 - round(10.0 / CELL)]
    start = other.net.positions[:, :, 0]
    for x in start.T[np.isfinite(start[0])]:
        assert np.nanmin(np.linalg.norm(edge - x[:, None], axis=0)) < 0.52 * CELL
    assert np.ptp(other.net.along[1]) == pytest.approx(WIDTH)


@pytest.mark.parametrize("overlap", [0.0, 10.0])
def test_both_sides_of_a_seam_are_one_line_on_the_tool(overlap):
    strips = laid(BONNET, overlap, 20.0)
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
        away = np.linalg.norm(one.on_tool[:, :, None] - other.on_tool[:, None], axis=0)
        assert away.min(axis=0).max() < 0.52 * CELL


def test_patterns_side_by_side_do_not_overlap_and_carry_their_seams(strips):
    moved = drape.side_by_side([strip.pattern for strip in strips], gap=7.0)
    weft = moved[0].weft[:, 0]
    spans = [(weft @ one.outline).min() for one in moved]
    ends = [(weft @ one.outline).max() for one in moved]
    np.testing.assert_allclose(np.array(spans[1:]) - np.array(ends[:-1]), 7.0)
    for pattern, strip in zip(moved, strips, strict=True):
        assert pattern.area == pytest.approx(strip.pattern.area)
        inside = shapely.Polygon(pattern.outline.T).buffer(0.1)
        for seam in pattern.seams:
            assert shapely.contains_xy(inside, *seam.flat).all()
