"""Map of the starts of a search."""

import numpy as np
import pytest

from skfem_textile import drape
from tests.helpers import tool_shapes

pytest.importorskip("matplotlib")
plot = pytest.importorskip("skfem_textile.plot")


@pytest.fixture(scope="module")
def searched():
    """Search on a height field above the y-z plane."""
    x, triangles = tool_shapes.height_field(
        lambda x, y: 20 * np.exp(-((x / 30) ** 2) - (y / 20) ** 2), 120.0, 80.0, 8.0
    )
    tool = drape.TriangleMesh(x[[2, 0, 1]], triangles)
    return tool, drape.best_start(tool, 8.0, trials=32)


def test_every_start_is_on_the_map(searched, tmp_path):
    tool, best = searched
    figure = plot.starts(best, tool, tmp_path / "starts.png")
    axes, bar = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("y (mm)", "z (mm)")
    assert bar.get_ylabel() == "Shear angle (°)"
    (dots,) = (c for c in axes.collections if c.get_array() is not None)
    laid = np.isfinite(best.measures)
    assert np.asarray(dots.get_offsets()) == pytest.approx(best.points[1:, laid].T)
    assert np.asarray(dots.get_array()) == pytest.approx(
        np.degrees(best.measures[laid])
    )
    assert (tmp_path / "starts.png").stat().st_size > 10_000
    low, high = dots.get_clim()
    ends = plot.fields.scale_of(
        plot.FIELDS["shear_angle"], [np.array([low, high])], clim=(low, high)
    ).colours([0.0, 1.0])
    assert np.asarray(dots.get_cmap()([0.0, 1.0])) == pytest.approx(ends)
