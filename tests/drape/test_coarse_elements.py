"""Elements large against the fillets of a tool are reported with their error.

The tool is a box with rounded edges and walls of 50°.
"""

import numpy as np
import pytest

from skfem_textile import Fabric, drape
from skfem_textile.scenes import Case
from skfem_textile.scenes.draped_ply import draped_ply

pytestmark = pytest.mark.usefixtures("coarse_net", "no_interval")

SIDE, TOP, CORNER, SLOPE = 140.0, 35.0, 3.0, np.tan(np.radians(50))


def box(fillet):
    """A flat top of half the width TOP, fillets around it, and walls."""
    width = fillet * SLOPE / np.hypot(1, SLOPE)

    def at(x, y):
        p, q = np.maximum(x - TOP, 0), np.maximum(y - TOP, 0)
        rho = np.maximum(np.hypot(p, q), 1e-9)
        s = np.clip(rho - CORNER, 0, width)
        root = np.sqrt(fillet**2 - s**2)
        h = root - fillet - SLOPE * np.maximum(rho - CORNER - width, 0)
        slope, c, n = -s / root, p / rho, q / rho
        on_fillet = (rho > CORNER) & (rho < CORNER + width)
        bend = np.where(on_fillet, -(fillet**2) / root**3, 0)
        around = np.where((p > 0) & (q > 0), slope / rho, 0)
        return drape.Height(
            *(h, slope * c, slope * n, bend * c * c + around * n * n),
            *((bend - around) * c * n, bend * n * n + around * c * c),
        )

    return drape.HeightField(at)


def drape_quarter(fillet, cells):
    """Shear angles of a quarter in degrees by row and column, and its summary."""
    size = cells, cells
    scene = draped_ply(
        "box", box(fillet), "irregular", size=size, width=SIDE, height=SIDE
    )
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft)
    result = Case(scene=scene, fabric=fabric, steps=1).run()
    ply, rows = result.ply, 2 * cells
    angle = np.degrees(ply.shear_angle(result.u).mean(axis=1))
    centre = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    i, j = np.floor(centre * rows / (0.5 * SIDE)).astype(int)
    by_row = np.zeros((rows, rows))
    by_row[i, j] = angle
    return by_row, scene.summary(result)


@pytest.mark.parametrize(
    ("fillet", "turn", "least", "most"), [(20.0, 25, 0.3, 1.0), (8.0, 40, 1.0, 4.0)]
)
def test_elements_that_turn_by_30_degrees_have_shear_errors_above_one_degree(
    fillet, turn, least, most
):
    """The reference has elements of a third of the size."""
    coarse, medium = drape_quarter(fillet, 6)
    fine, _ = drape_quarter(fillet, 18)
    means = fine.reshape(12, 3, 12, 3).mean(axis=(1, 3))
    error = np.abs(coarse - means).max()
    assert medium["max_turn_of_normal_deg"] == pytest.approx(turn, abs=5)
    assert least < error < most
    assert ("coarse_elements" in medium) == (turn > 30)


def test_the_turn_of_the_normal_is_the_arc_angle_of_an_element():
    sphere = drape.Sphere(100.0, (0, 0, -100))
    scene = draped_ply(
        "ball", sphere, "irregular", size=(4, 4), width=80.0, height=80.0
    )
    fabric = Fabric(1e5, 0.1, scene.warp, scene.weft)
    result = Case(scene=scene, fabric=fabric, steps=1).run()
    turn = drape.turn_of_normal(result.ply, result.tool(1.0), result.u)
    diagonal = np.hypot(5, 5) / 100  # macro-elements have two parts a side
    assert turn[0] == pytest.approx(diagonal, rel=0.02)
