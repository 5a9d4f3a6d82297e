"""Figures of the studies are legible, and name and number what they show."""

import pytest

pytest.importorskip("matplotlib")

from studies.common.figures import PAGE, figure_of
from studies.speed.study import draw_waterfall
from studies.stability.grid.study import Cell, draw_grid
from studies.stability.study import draw_outcomes


def test_text_below_seven_points_on_a_page_is_refused(tmp_path):
    """A figure of twice the width of a page is printed at half its size."""
    wide = 2 * PAGE, 3.0
    with (
        pytest.raises(ValueError, match=r"text of 5\.0 pt on a page: at least 7 pt"),
        figure_of(wide, tmp_path / "x.png", 10),
    ):
        pass
    with figure_of(wide, tmp_path / "x.png", 14):
        pass
    assert (tmp_path / "x.png").exists()


def test_other_formats_are_rejected_before_any_work(tmp_path):
    with pytest.raises(ValueError, match=r"y\.gif: pictures can"):
        draw_grid({}, tmp_path / "y.gif")


def test_bars_and_cells_have_their_names_and_numbers():
    runs = [{"family": "crossing", "outcome": kind} for kind in ("right", "wrong")]
    cells = {"code, element": {(1e2, 0.0): Cell(1.5, 7), (1e4, 0.0): Cell()}}
    costs = {"s": [(2.0, 0.1), (1.0, 0.1), (0.1, 0.2)]}
    (outcomes,), (grid, *_) = draw_outcomes(runs).axes, draw_grid(cells).axes
    (waterfall,) = draw_waterfall(costs, "abc").axes
    assert [text.get_text() for text in outcomes.get_yticklabels()] == ["crossing"]
    assert [text.get_text() for text in grid.texts] == ["7", "–"]
    assert [text.get_text() for text in waterfall.texts] == ["+2", "+1", "≈ 0"]
