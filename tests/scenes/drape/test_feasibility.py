"""Feasibility of a tool is checked before the ply is draped."""

import numpy as np
import pytest

from skfem_textile import Fabric, Newton, OnSurface, StepError, drape
from skfem_textile.scenes import drape as on_tool
from skfem_textile.scenes import draped_ply
from skfem_textile.scenes.edge_tension import net_over
from skfem_textile.solve import search
from tests.helpers import graph
from tests.helpers.tools import case_of

# Half a side of the top, and the height, of a box.
TOP, HEIGHT = 60.0, 40.0

SPHERE, H = drape.Sphere(100.0, (0, 0, -100)), np.pi / 2


def box(slope_deg, edge=6.0):
    """Top and walls of a box; the walls lean by the angle."""
    n, m = round(TOP / edge), round(HEIGHT / edge)
    inner = np.linspace(-TOP, TOP, 2 * n + 1)
    down = np.arange(1, m + 1) * HEIGHT / m
    lean = 1 / np.tan(np.radians(slope_deg))
    k = np.r_[-m - n : m + n + 1]
    i, j = (a.ravel() for a in np.meshgrid(k, k))
    depth = np.r_[0.0, down][np.maximum(np.maximum(abs(i), abs(j)) - n, 0)]
    at = inner[np.clip(i, -n, n) + n], inner[np.clip(j, -n, n) + n]
    # Lines of the grid beyond the top run down the wall: lines beyond a corner end
    # in its edge, so that their triangles have no area.
    x, y = (a * (1 + depth * lean / TOP) for a in at)
    return drape.TriangleMesh(np.array([x, y, -depth]), graph(k, np.add)[1])


def reported(caplog, tool, **kwargs):
    kwargs = {"width": 160.0, "height": 160.0, "tension": 0.0, "size": (4, 4)} | kwargs
    scene = on_tool(tool, **kwargs)
    return scene, [record.getMessage() for record in caplog.records]


def test_a_net_that_folds_behind_the_corner_of_a_box_is_reported(caplog):
    _, messages = reported(caplog, box(89.0))
    (line,) = messages
    assert "their net folds at" in line
    assert "use a ply that ends before that corner" in line
    corner = np.array(line.partition("(")[2].partition(")")[0].split(","), dtype=float)
    assert np.abs(np.abs(corner[:2]) - TOP).max() < 15


@pytest.mark.parametrize("fibres", [0.0, 0.5])
def test_shear_behind_a_corner_is_its_curvature(caplog, fibres):
    """The sum of angles around the corner falls short of 2π by the shear of the net."""
    slope = np.radians(67)
    hip = np.array([1, 1, -np.tan(slope)]) / np.sqrt(2 + np.tan(slope) ** 2)
    lacks = 2 * np.pi - 0.5 * np.pi - 2 * np.arccos(-hip[0])
    _, messages = reported(caplog, box(67.0), fibres=fibres)
    (line,) = messages
    shear = float(line.partition("shear by ")[2].split()[0])
    assert shear == pytest.approx(np.degrees(lacks), abs=6)


@pytest.mark.parametrize(
    ("slope", "side"), [(45.0, 160.0), (89.0, 90.0)], ids=["flat walls", "small ply"]
)
def test_a_feasible_tool_is_not_reported(caplog, slope, side):
    _, messages = reported(caplog, box(slope), width=side, height=side)
    assert not messages


def test_shear_of_smooth_curvature_is_not_reported(caplog):
    """A net on a sphere shears as far as behind a corner, but gradually."""
    s = np.linspace(-150, 150, 31)
    X = np.array(np.meshgrid(s, s)).reshape(2, -1)
    x = drape.exponential_map(SPHERE, X * np.abs(X).max(axis=0) / np.hypot(*X + 1e-9))
    tool = drape.TriangleMesh(x, graph(s, np.add)[1])
    kwargs = {"width": 200.0, "height": 200.0, "size": (6, 6), "fibres": 0.3}
    scene, messages = reported(caplog, tool, **kwargs)
    net = net_over(scene.mesh.p, OnSurface(SPHERE), (0.3, 0.3 + H))
    assert np.degrees(np.nanmax(np.abs(net.shear_angle()))) > 45
    assert not messages


def test_a_thread_that_leaves_the_tool_is_not_a_fold(caplog, monkeypatch):
    cone, start = drape.Cone(0.4, (0, 0, 0), (1, 0, 0)), (50.0, 0, 50 * np.tan(0.4))
    ends = drape.net(cone, 4.0, (30, 0), (1, 1), point=start)
    assert ends.leaves.shape[1]
    assert not ends.folds.shape[1]
    monkeypatch.setattr(draped_ply, "edge_net", lambda *_, **options: ends)
    _, messages = reported(caplog, box(89.0))
    assert not messages


def test_a_failed_drape_names_elements_and_a_remedy(caplog, monkeypatch):
    scene, _ = reported(caplog, box(89.0), size=(2, 2))
    stepper = case_of(scene, method=Newton(most=1)).stepper()
    stepper.max_halvings = 0
    monkeypatch.setattr(search, "_SHORTEST_AT_REST", (0.5, 0.5))
    with pytest.raises(StepError) as error:
        stepper.run()
    assert error.value.elements.size
    assert "(element " in str(error.value)
    assert "; try " in str(error.value)


def test_loads_of_a_scene_share_one_net():
    scene = draped_ply.draped_ply("sphere", SPHERE, "aligned", size=(4, 4))
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft)
    (first,), (second,) = scene.loads_of(fabric), scene.loads_of(fabric)
    assert first.net() is second.net()
