"""Pictures of figures of several runs."""

import itertools

import numpy as np
import pytest

compared_runs = pytest.importorskip("skfem_textile.plot").compared_runs

FORCES, FRICTIONS = [2, 10, 40, 2, 10, 40], [0.1, 0.1, 0.1, 0.3, 0.3, 0.3]
VALUES = {"Friction": FRICTIONS, "Holder force (N)": FORCES}
FIGURE = np.array([1.0, 2.0, 3.0, 4.0, 5.0, np.nan])


def lines_of(axes, marker):
    """Points of the lines with a marker and at least one point."""
    drawn = (x.get_xydata() for x in axes.lines if x.get_marker() == marker)
    finite = (points[np.isfinite(points).all(axis=1)].tolist() for points in drawn)
    return [points for points in finite if points]


def test_the_key_with_most_values_is_the_abscissa_and_the_other_a_line():
    figure = compared_runs(VALUES, {"Force (N)": FIGURE, "Angle (°)": FIGURE}, [1] * 6)
    assert [axes.get_title() for axes in figure.axes] == ["Force (N)", "Angle (°)"]
    for axes in figure.axes:
        assert axes.get_xlabel() == "Holder force (N)"
        assert lines_of(axes, "o") == [[[2, 1], [10, 2], [40, 3]], [[2, 4], [10, 5]]]
    labels = [x.get_text() for x in figure.legends[0].get_texts()]
    assert labels == ["Friction 0.1", "Friction 0.3"]


def test_runs_that_stopped_or_have_no_state_are_marked():
    """A line does not pass over them."""
    complete = np.array([1, 0, 1, 1, 1, 0])
    figure = compared_runs(VALUES, {"Force (N)": FIGURE}, complete)
    (axes,) = figure.axes
    assert lines_of(axes, "o")[0] == [[2, 1], [40, 3]]
    assert np.isnan(axes.lines[0].get_ydata()[1])
    assert lines_of(axes, "x") == [[[10, 2]]]
    ((at, _),) = lines_of(axes, "v")[0]
    assert at == 40
    labels = [x.get_text() for x in figure.legends[0].get_texts()]
    assert labels[2:] == ["stopped early: at its last state", "refused: no state"]


def test_more_than_six_lines_are_in_rows_of_panels():
    """Labels have no space before a degree sign, and fit their panels."""
    key = "Phases punch tools holder force of the whole process (N)"
    names = {
        key: (20, 60),
        "Friction": (1, 2),
        "Fibres (°)": (0, 45),
        "Size (mm)": (1, 2),
    }
    runs = [*itertools.product(*names.values())]
    values = dict(zip(names, map(list, zip(*runs, strict=True)), strict=True))
    figure = compared_runs(values, {"Force (N)": np.arange(16.0)}, [1] * 16)
    assert [x.get_title() for x in figure.axes] == [
        f"Friction {x}\nForce (N)" for x in (1, 2)
    ]
    labels = [x.get_text() for x in figure.legends[0].get_texts()]
    assert labels[-1] == "Fibres 45°, Size 2 mm"
    assert lines_of(figure.axes[1], "o")[0] == [[20, 4], [60, 12]]
    figure.draw_without_rendering()
    width = figure.bbox.width
    for axes in figure.axes:
        assert axes.get_xlabel().replace("\n", " ") == key
        label = axes.xaxis.label.get_window_extent()
        assert 0 <= label.x0 < label.x1 <= width


def test_half_widths_are_error_bars():
    figures = {"Force (N)": [FIGURE, [0.5, np.nan, 0.1, np.nan, 0.2, np.nan]]}
    figure = compared_runs(VALUES, figures, [1] * 6)
    bars = [c for c in figure.axes[0].containers if hasattr(c, "has_yerr")]
    ends = np.vstack([x for bar in bars for x in bar[2][0].get_segments() if len(x)])
    ends = ends[np.isfinite(ends).all(axis=1)].tolist()
    assert ends == [[2, 0.5], [2, 1.5], [40, 2.9], [40, 3.1], [10, 4.8], [10, 5.2]]
    assert figure.legends[0].get_texts()[-1].get_text() == "error interval"


def test_words_are_places_on_the_abscissa_in_their_order():
    values = {"Law": ["sin2", "linear", "locking"]}
    (axes,) = compared_runs(values, {"Force (N)": FIGURE[:3]}, [1, 1, 1]).axes
    assert [x.get_text() for x in axes.get_xticklabels()] == values["Law"]
    assert lines_of(axes, "o") == [[[0, 1], [1, 2], [2, 3]]]


def test_small_differences_do_not_fill_a_panel():
    values = {"Friction": [0.0, 0.1]}
    (axes,) = compared_runs(values, {"Force (N)": [100.0, 100.1]}, [1, 1]).axes
    low, high = axes.get_ylim()
    assert high - low == pytest.approx(5, rel=0.01)
