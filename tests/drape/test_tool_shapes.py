"""The tools of the tests are surfaces of nearly equilateral triangles."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers.tool_shapes import SHAPES, bonnet, deep_box, hemisphere_with_flange


@pytest.mark.parametrize("name", SHAPES)
def test_triangles_are_nearly_equilateral_and_oriented(name):
    x, t = SHAPES[name]()
    a, b, c = x[:, t].swapaxes(0, 1)
    areas = np.cross(b - a, c - a, axis=0)
    edges = np.linalg.norm([b - a, c - b, a - c], axis=1)
    quality = 2 * np.sqrt(3) * np.linalg.norm(areas, axis=0) / (edges**2).sum(axis=0)
    assert quality.min() > 0.6
    assert np.median(quality) > 0.85
    assert areas[2].sum() > 0
    directed = np.hstack([t[[0, 1]], t[[1, 2]], t[[2, 0]]])
    assert np.unique(directed, axis=1).shape == directed.shape
    assert len(drape.ToolMesh(x, (t,)).boundary()) == 1 + ("ring" in name)


def test_areas_are_those_of_the_shapes():
    """A half sphere of radius R 50 with the edge of its fillet; the top of a box."""
    x, t = hemisphere_with_flange(50.0, 1.0, 20.0, 1.0)
    a, b, c = x[:, t].swapaxes(0, 1)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a, axis=0), axis=0).sum()
    expected = 2 * np.pi * 50**2 + np.pi * (71**2 - 51**2)
    assert area == pytest.approx(expected, rel=0.01)
    x, t = deep_box(length=100.0, width=60.0, depth=30.0, fillet=5.0)
    centres = x[:, t].mean(axis=1)
    top = np.abs(centres[2] - 30) < 1e-9
    assert top.any()
    a, b, c = x[:, t[:, top]].swapaxes(0, 1)
    assert 0.5 * np.cross(b - a, c - a, axis=0)[2].sum() == pytest.approx(90 * 50)
    assert x[2].min() == 0
    assert x[2].max() == 30


def test_a_bonnet_has_no_plane_of_symmetry_if_askew():
    s = np.linspace(-190, 190, 39)
    for askew in (False, True):
        x, _ = bonnet(askew=askew)
        heights = []
        for side in (-1, 1):
            along, _, z = x[:, side * x[1] > 149.9]
            heights.append(np.interp(s, np.sort(along), z[np.argsort(along)]))
        assert np.allclose(*heights, atol=0.1) is not askew
