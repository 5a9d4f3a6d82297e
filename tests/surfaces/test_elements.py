"""Elements in space: feet of points, and distances beyond their sides."""

import numpy as np
import pytest

from skfem_textile.surfaces.tool_mesh import Elements

POINTS = np.array(
    [[0, 4, 5, 0, 9, 9], [0, 0, 3, 3, 0, 4], [0, 1, 3, 1, 0, 2]], dtype=float
)
QUADS = Elements(np.array([[0, 1], [1, 4], [2, 5], [3, 2]]))
TRIANGLES = Elements(np.array([[0, 1], [1, 4], [2, 5]]))
LOCAL = np.array([[0.2, 0.7, 0.9, 0.4], [0.3, 0.1, 0.6, 0.5]])


@pytest.mark.parametrize("elements", [QUADS, TRIANGLES], ids=["quads", "triangles"])
@pytest.mark.parametrize("away", [0.0, 0.1, -0.1])
def test_the_foot_of_a_point_above_an_element_is_below_it(elements, away):
    """Also of one outside a triangle, in its plane."""
    element = np.array([0, 1, 0, 1])
    x = elements.between(POINTS, element, LOCAL)
    slopes = elements.slopes(POINTS, element, LOCAL)
    first, second = np.moveaxis(slopes, 1, 0) if slopes.shape[1] == 2 else slopes
    normal = np.cross(first, second, axis=0)
    normal = away * normal / np.linalg.norm(normal, axis=0)
    feet = elements.feet(POINTS, x + normal, element)
    assert feet == pytest.approx(LOCAL, abs=1e-6)
