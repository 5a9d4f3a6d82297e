"""Lengths of threads in flat patterns are lengths of geodesics on the exact surface."""

import numpy as np
import pytest
import shapely
from scipy.integrate import quad

from skfem_textile import drape
from tests.helpers.tool_shapes import bonnet, hat, hemisphere_with_flange, saddle


def along_section(height, half):
    """Arc length of a section z = h(s) from −half to half."""
    step = 1e-4

    def speed(s):
        return np.hypot(1, (height(s + step) - height(s - step)) / (2 * step))

    return quad(speed, -half, half, epsabs=1e-6)[0]


def hemisphere_across(radius=50.0, fillet=8.0, flange=60.0):
    return 2 * ((radius + fillet) * np.arccos(fillet / (radius + fillet)) + flange)


def hat_across(top=50.0, height=40.0, flange=50.0, fillet=8.0, degrees=20.0):
    draft = np.radians(degrees)
    around = 2 * fillet * (np.pi / 2 - draft)
    wall = (height - 2 * fillet * (1 - np.sin(draft))) / np.cos(draft)
    return 2 * (top / 2 - fillet + around + wall + flange)


def bonnet_section(s):
    """Height of the bonnet on its plane of symmetry."""
    s = s / 200
    dome = 0.15 * np.exp(-8 * (0.4 * s) ** 2)
    return 60 * (1 - 0.45 * s**2 - 0.2 * np.exp(3 * (s - 1)) + dome)


SADDLE = along_section(lambda s: s**2 / 300, 100.0)

DOME = hemisphere_across(30.0, 10.0, 10.0)

#: Shape, cell, inclination of the warp, and lengths along warp and weft through the
#: middle; None where the geodesic has no closed form.
CASES = {
    "hemisphere": (hemisphere_with_flange(30.0, 10.0, 10.0), 3.0, 30.0, DOME, DOME),
    "hat": (hat(80.0, flange=20.0), 3.0, 90.0, hat_across(flange=20.0), 80.0),
    "saddle": (saddle(), 10.0, 0.0, SADDLE, SADDLE),
    "saddle, askew": (saddle(), 10.0, 45.0, 200 * np.sqrt(2), 200 * np.sqrt(2)),
    "bonnet": (bonnet(), 12.0, 0.0, along_section(bonnet_section, 200.0), None),
}


@pytest.mark.parametrize("shape", CASES)
def test_first_threads_are_as_long_as_geodesics(shape):
    triangles, cell, degrees, warp, weft = CASES[shape]
    tool = drape.TriangleMesh(*triangles)
    points = tool.facets.points
    middle = points[:, np.hypot(*points[:2]).argmin()] * [0, 0, 1]
    angles = np.radians(degrees) + np.array([0.0, np.pi / 2])
    net = drape.net(tool, cell, point=middle, angles=tuple(angles))
    part = drape.trimmed(net, tool.facets.boundary()[0])
    region = shapely.Polygon(part.pattern.outline.T)
    ends = [1e3 * np.outer([-1, 1], of) for of in net.directions.T]
    lengths = [region.intersection(shapely.LineString(of)).length for of in ends]
    for length, exact in zip(lengths, (warp, weft), strict=True):
        assert exact is None or length == pytest.approx(exact, rel=2e-3)
    if shape == "hat":  # developable
        assert region.area == pytest.approx(80.0 * hat_across(flange=20.0), rel=2e-3)
