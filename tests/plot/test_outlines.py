"""Pictures of singular fibres."""

import pytest

from skfem_textile import Condition, Fabric, Outline, singular_fibres

pytest.importorskip("matplotlib")


def case():
    hole = [[40, 60, 60, 40], [90, 90, 110, 110]]
    region = {"r": [[0, 100, 100, 0], [140, 140, 200, 200]]}
    points = {"stitch": (20, 50)}
    square = [[0, 100, 100, 0], [0, 0, 200, 200]]
    outline = Outline(square, [hole], points=points, regions=region)
    fabric = Fabric(1e5, 0.5, warp=(1, 1.1), weft=(-1, 1))
    held = {"fixed": Condition("bottom"), "pulled": Condition("top", (0, 20))}
    return outline, singular_fibres(outline, fabric, held, finest=5.0)


def test_every_line_is_drawn_with_the_style_of_its_kind(tmp_path):
    from skfem_textile import plot

    outline, lines = case()
    figure = plot.singular_fibres(outline, lines, tmp_path / "a.png")
    (axes,) = figure.axes
    drawn = {
        line.get_xydata().tobytes(): (line.get_linestyle(), line.get_linewidth())
        for line in axes.lines
        if len(line.get_xdata()) > 1
    }
    families = [
        [fibre.points for fibre in lines.fibres if fibre.family == i] for i in (0, 1)
    ]
    weak = [fibre.points for fibre in lines.weak]
    kinds = *families, weak, lines.borders, lines.held
    looks = [{drawn[points.T.tobytes()] for points in kind} for kind in kinds]
    assert [len(looks_of_kind) for looks_of_kind in looks] == [1] * 5
    assert len(set.union(*looks)) == 5  # also in grey
    assert len(drawn) == sum(map(len, kinds))
    assert len(axes.lines) == len(drawn) + 1  # the stitch
    assert (tmp_path / "a.png").stat().st_size > 1000
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert len(labels) == 5
