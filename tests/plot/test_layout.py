"""Layout of pictures: sizes, and elements without overlap."""

import numpy as np
import pytest

pytest.importorskip("pyvista")
Image = pytest.importorskip("PIL.Image")
plot = pytest.importorskip("skfem_textile.plot")
layout = pytest.importorskip("skfem_textile.plot.layout")
sheet = pytest.importorskip("skfem_textile.plot.sheet")


@pytest.mark.parametrize(
    ("n", "size", "width"), [(1, None, 85), (2, None, 85), (3, None, 174), (1, 60, 60)]
)
def test_pictures_have_the_column_widths_of_a_journal(result, sheets, n, size, width):
    plot.shear_angle(*[result] * n, size=size)
    assert sheets[0][1].width == width


def test_pictures_have_300_dots_per_inch(result, tmp_path):
    plot.shear_angle(result, filename=tmp_path / "x.png", size=(30, 40))
    with Image.open(tmp_path / "x.png") as image:
        assert image.info["dpi"] == pytest.approx((300, 300), abs=0.01)
        assert image.size == pytest.approx((30 / 25.4 * 300, 40 / 25.4 * 300), abs=1)


WORDS = "a title of many words that has to go onto several lines of text"
ONE_WORD = "donaudampfschifffahrt" * 5
LABELS = {"Shear angle (°)": (0, 60), "A longer label (N mm/mm²)": (-1.2e-3, 1.3e5)}


@pytest.mark.parametrize(
    ("n", "title", "label"),
    [
        (1, WORDS, "Shear angle (°)"),
        (1, ONE_WORD, "A longer label (N mm/mm²)"),
        (3, WORDS, "A longer label (N mm/mm²)"),
        (3, ONE_WORD, "Shear angle (°)"),
    ],
)
def test_parts_of_a_picture_do_not_overlap(result, n, title, label):
    """Boxes of titles, plies, scales, numbers, labels and keys, all within the page."""
    shape = sheet.Shape.of(result.ply.mesh, np.zeros_like(result.ply.mesh.p))
    scale = sheet.Scale.of(label, LABELS[label], "viridis", None)
    panels = [sheet.Panel(title, shape, np.zeros(12), scale)] * n
    keys = [("Warp", "k"), ("A key with a name that is rather long", "k")]
    legend = sheet.Legend(0, n, scale, keys)
    drawn = sheet.Sheet([panels] * 2, [legend], sheet.extent([shape]))
    page = layout.lay_out(drawn)
    boxes = list(boxes_of(page))
    for i, (x, y, right, top) in enumerate(boxes):
        assert -0.01 <= x < right <= page.width + 0.01
        assert -0.01 <= y < top <= page.height + 0.01
        for a, b, c, d in boxes[:i]:
            assert min(right, c) <= max(x, a) or min(top, d) <= max(y, b)


def boxes_of(page):
    """Left, low, right and top of every part of a page."""
    panels = [panel for row in page.panels for panel in row]
    writings = [line for panel in panels for line in panel.title]
    for box in [panel.ply for panel in panels] + [
        bar.box for below in page.legends for bar in below.bars
    ]:
        yield box.x, box.y, box.x + box.width, box.y + box.height
    for below in page.legends:
        writings += below.writings
        for stroke in below.strokes:
            yield stroke.x, stroke.y - 0.2, stroke.x + layout.KEY, stroke.y + 0.2
    for text, x, y, size, align in writings:
        width = layout.text_width(text, size)
        left = x if align == "left" else x - width / 2
        half = 0.6 * size * layout.POINT
        yield left, y - half, left + width, y + half
