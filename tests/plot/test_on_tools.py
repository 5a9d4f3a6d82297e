"""Pictures of plies on tools."""

import numpy as np
import pytest

from skfem_textile import Fabric, OnePoint, Quadratic, Result, drape
from skfem_textile.scenes import Case, hemisphere
from skfem_textile.scenes import drape as on_tool
from tests.helpers import graph

plot = pytest.importorskip("skfem_textile.plot")
drawing = pytest.importorskip("skfem_textile.plot.drawing")
pytest.importorskip("pyvista")
Image = pytest.importorskip("PIL.Image")
fields = pytest.importorskip("skfem_textile.plot.fields")
sheet = pytest.importorskip("skfem_textile.plot.sheet")


def result_of(scene, bending=(0.0, 0.0), **more):
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending)
    return Case(scene=scene, fabric=fabric, steps=1, **more).run()


def coloured_and_grey(path):
    """Shares of pixels with a colour, and with a grey of tools."""
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")).astype(int)
    spread = np.ptp(pixels, axis=2)
    grey = (spread < 3) & (pixels[..., 0] > 130) & (pixels[..., 0] < 240)
    return (spread > 30).mean(), grey.mean()


@pytest.mark.dear("the only tools whose pixels are counted")
@pytest.mark.parametrize("suffix", ["png", "pdf"])
def test_a_tool_is_drawn_under_the_ply(draped, tmp_path, monkeypatch, suffix):
    """It hides nothing of a ply that faces the camera."""
    file = tmp_path / f"ply.{suffix}"
    monkeypatch.setattr(drawing, "save", lambda *_: None)
    figure = plot.shear_angle(draped, filename=file, cmap="viridis")  # nowhere grey
    if suffix == "pdf":
        figure.savefig(tmp_path / "ply.png", dpi=50)
    coloured, grey = coloured_and_grey(tmp_path / "ply.png")
    (shape,) = fields.shapes_of([draped], [draped.states[-1]])
    points = np.vstack([shape.points, shape.tool.points])[:, :2]
    ply = (shape.sides**2).sum() / np.prod(np.ptp(points, axis=0))
    with Image.open(tmp_path / "ply.png") as image:
        width, height = image.size
    area = np.prod(np.ptp(points, axis=0)) / np.ptp(points[:, 0]) ** 2
    drawn = area * (81 / 85) ** 2 * width / height
    assert coloured == pytest.approx(ply * drawn, abs=0.06)
    assert grey > 0.1


def test_a_tool_is_near_the_ply_at_every_load_factor(draped):
    for state, radius in zip(draped.states, (np.inf, 100.0), strict=True):
        (shape,) = fields.shapes_of([draped], [state])
        assert shape.tool.triangles.shape[1] > 100
        assert (shape.tool.shades <= 1).all()
        span, of_ply = np.ptp(shape.tool.points, 0), np.ptp(shape.points, 0)
        assert (span[:2] > of_ply[:2]).all(), radius
        assert (span[:2] < 2.5 * of_ply[:2]).all(), radius


@pytest.mark.parametrize("mesh", ["irregular", "delaunay"])
def test_shear_and_pressure_stand_side_by_side_with_risks_marked(sheets, mesh):
    """Also of quadratic triangles."""
    formulation = OnePoint() if mesh == "irregular" else Quadratic()
    scene = hemisphere(mesh, size=(3, 3), tension=0.0)
    result = result_of(scene, bending=(5.0, 5.0), formulation=formulation)
    plot.draped(result, titles=["free"])
    ((_, layout),) = sheets
    words = [w.text for legend in layout.legends for w in legend.writings]
    for text in ("Shear angle (°)", "Contact pressure (N/mm²)", "Risk of wrinkling"):
        assert words.count(text) == 1
    titles = [line.text for row in layout.panels for slot in row for line in slot.title]
    assert titles == ["free"] * 2


def test_lines_behind_a_tool_are_omitted_from_vectors():
    x, y = np.meshgrid(np.linspace(0, 10, 21), np.linspace(0, 10, 21))
    points = np.column_stack([x.ravel(), y.ravel(), x.ravel()])
    k = np.add.outer(21 * np.arange(20), np.arange(20)).ravel()
    tool = sheet.Tool(points, np.array([k, k + 1, k + 22]), np.ones(len(k)))
    line = np.array([[4.0, 5, 0], [6, 5, 0]])
    lines = np.array([line + np.array([0, 0, z]) for z in (6.0, 0.0, 5.0)])
    np.testing.assert_array_equal(sheet.in_front_of_tool(lines, tool), lines[[0, 2]])
    assert len(sheet.in_front_of_tool(lines, None)) == 3


def bump(x, y):
    return 9 * np.exp(-(x * x + y * y) / 1800)


@pytest.mark.parametrize("side", [60.0, 200.0])
def test_a_tool_of_triangles_is_drawn_to_its_edges(side):
    """A small ply has the tool nearby, a large one all of it and nothing beyond."""
    tool = drape.TriangleMesh(*graph(np.linspace(-80, 80, 17), bump))
    scene = on_tool(tool, size=(2, 2), width=side, height=side, tension=0.0)
    result = result_of(scene, bending=(5.0, 5.0))
    surface = result.tool(1.0)
    points = np.pad(result.ply.mesh.p, ((0, 1), (0, 0))).T
    tool = fields.tool_under(points, surface)
    corners = tool.points[tool.triangles]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    reach = min(80.0, 0.5 * side + 0.17 * np.sqrt(2) * side)
    np.testing.assert_allclose(high[:2] - low[:2], 2 * reach, rtol=0.01)
    assert np.ptp(tool.shades) > 0.02
    for state in result.states:  # while it grows
        (shape,) = fields.shapes_of([result], [state])
        assert shape.tool.triangles.shape[1] > 100


def test_a_shallow_tool_has_a_lower_camera():
    """Heights fill more of the picture; the elevation is constant from 20 mm on."""
    sizes = (np.array([100.0, 80.0, z]) for z in (0, 5, 10, 20, 60))
    heights = [sheet.eye_axes(True, size)[2, 2] for size in sizes]
    assert np.degrees(np.arcsin(heights)) == pytest.approx([18, 23, 28, 38, 38])


def test_a_state_alone_is_drawn_like_a_state_of_a_run(draped, sheets):
    conditions = hemisphere(size=(4, 4)).conditions
    alone = Result.of_state(draped.ply, conditions, draped.states[-1])
    plot.draped(draped)
    plot.draped(alone)
    (one, _), (other, _) = sheets
    assert one.legends == other.legends
    for a, b in zip(one.panels, other.panels, strict=True):
        np.testing.assert_array_equal(a.values, b.values)
        np.testing.assert_array_equal(a.shape.points, b.shape.points)
        np.testing.assert_array_equal(a.shape.tool.points, b.shape.tool.points)
