"""Map of the starts of a search."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers import tool_shapes

pytest.importorskip("matplotlib")
plot = pytest.importorskip("skfem_textile.plot")


def test_every_start_that_covers_the_part_is_on_the_map(tmp_path):
    """On a height field above the y-z plane."""
    x, triangles = tool_shapes.plate(120.0, 80.0, 20.0)
    tool = drape.TriangleMesh(x[[2, 0, 1]], triangles)
    points = np.array([0 * x[0], x[0], x[1]])[:, ::3]
    measures = np.linspace(0.1, 0.9, points.shape[1])
    measures[2] = np.nan
    along = np.zeros_like(points)
    along[1] = 1.0
    start = drape.NetStart(points[:, 0], along[:, 0])
    best = drape.BestStart(start, None, 0.1, points, along, measures, np.empty(0))
    figure = plot.starts(best, tool, tmp_path / "starts.png")
    axes, bar = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y (mm)", "z (mm)")
    assert bar.get_ylabel() == "Shear angle (°)"
    width, height = figure.get_size_inches()  # of a plate of 120 mm × 80 mm, and labels
    assert height - 0.9 == pytest.approx(0.75 * width * 80 / 120)
    (dots,) = (c for c in axes.collections if c.get_array() is not None)
    laid = np.isfinite(measures)
    assert np.asarray(dots.get_offsets()) == pytest.approx(points[1:, laid].T)
    assert np.asarray(dots.get_array()) == pytest.approx(np.degrees(measures[laid]))
    assert (tmp_path / "starts.png").stat().st_size > 10_000
    low, high = dots.get_clim()
    ends = plot.fields.scale_of(
        plot.FIELDS["shear_angle"], [np.array([low, high])], clim=(low, high)
    ).colours([0.0, 1.0])
    assert np.asarray(dots.get_cmap()([0.0, 1.0])) == pytest.approx(ends)
