"""Figures of studies: panels, and rejected formats."""

import re

import pytest

pytest.importorskip("matplotlib")

from studies.angles.study import draw_loads
from studies.error_time.study import draw_elements, draw_fronts, draw_ratios
from studies.formulations.drape.study import draw_error_time
from studies.formulations.space.study import draw_errors as draw_space
from studies.formulations.study import draw_convergence
from studies.inf_sup.study import draw_constants
from studies.laws.study import draw_errors as draw_laws
from studies.speed.study import draw_waterfall
from studies.stability.grid.study import Cell, draw_grid
from studies.stability.study import draw_outcomes

RUNS = [{"family": "crossing", "outcome": kind} for kind in ("right", "wrong")]
CELLS = {"code, element": {(1e2, 0.0): Cell(1.5, 7), (1e4, 0.0): Cell()}}
COSTS = {"s": [(2.0, 0.1), (1.0, 0.1), (0.1, 0.2)]}
FIGURES = {
    "laws": lambda file=None: draw_laws([], file),
    "loads": lambda file=None: draw_loads([], file),
    "convergence": lambda file=None: draw_convergence([], file),
    "drape": lambda file=None: draw_error_time(
        [{"formulation": "macro", "start": "net", "refused": "it"}], file
    ),
    "space": lambda file=None: draw_space([], file),
    "fronts": lambda file=None: draw_fronts([], file),
    "ratios": lambda file=None: draw_ratios([], file),
    "elements": lambda file=None: draw_elements([], "load", file),
    "constants": lambda file=None: draw_constants([], file),
    "outcomes": lambda file=None: draw_outcomes(RUNS, file),
    "grid": lambda file=None: draw_grid(CELLS, file),
    "waterfall": lambda file=None: draw_waterfall(COSTS, "abc", file),
}

TITLES = {
    "laws": ["16 across", "32 across"],
    "loads": ["quads, 16 across", "triangles, 16 across"],
    "constants": ["Fibres at 0°", "Fibres at 30°"],
    "convergence": ["strip", "trellis"],
}


@pytest.mark.parametrize("draw", FIGURES.values(), ids=FIGURES)
def test_other_formats_are_rejected_before_any_work(tmp_path, monkeypatch, draw):
    def draws(*_, **__):
        raise AssertionError("drawn")

    monkeypatch.setattr("matplotlib.figure.Figure.__init__", draws)
    for suffix in (".gif", ".5"):
        message = (
            f"y{suffix}: pictures can be written only to .png, .svg, .pdf, .eps files: "
            "name it y.png"
        )
        with pytest.raises(ValueError, match=re.escape(message)):
            draw(tmp_path / f"y{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", TITLES)
def test_panels_have_titles(name):
    titles = [axes.get_title() for axes in FIGURES[name]().axes]
    assert titles[: len(TITLES[name])] == TITLES[name]


def test_bars_and_cells_have_their_names_and_numbers():
    (outcomes,), (grid, *_), (costs,) = (
        FIGURES[name]().axes for name in ("outcomes", "grid", "waterfall")
    )
    assert [text.get_text() for text in outcomes.get_yticklabels()] == ["crossing"]
    assert [text.get_text() for text in grid.texts] == ["7", "–"]
    assert [text.get_text() for text in costs.texts] == ["+2", "+1", "≈ 0"]
