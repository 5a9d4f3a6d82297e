"""Text of the figures of the studies is legible on a page."""

import pytest

pytest.importorskip("matplotlib")
figures = pytest.importorskip("studies.common.figures")


def test_text_below_seven_points_on_a_page_is_refused(tmp_path):
    """A figure of twice the width of a page is printed at half its size."""
    wide = 2 * figures.PAGE, 3.0
    with (
        pytest.raises(ValueError, match=r"text of 5\.0 pt on a page: at least 7 pt"),
        figures.figure_of(wide, tmp_path / "x.png", 10),
    ):
        pass
    with figures.figure_of(wide, tmp_path / "x.png", 14):
        pass
    assert (tmp_path / "x.png").exists()
