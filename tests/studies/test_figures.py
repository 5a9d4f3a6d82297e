"""Figures of studies: panels, and rejected formats."""

import pytest

pytest.importorskip("matplotlib")

from studies.angles.study import draw_loads
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
    "laws": lambda: draw_laws([]),
    "loads": lambda: draw_loads([]),
    "convergence": lambda: draw_convergence([]),
    "constants": lambda: draw_constants([]),
    "outcomes": lambda: draw_outcomes(RUNS),
    "grid": lambda: draw_grid(CELLS),
    "waterfall": lambda: draw_waterfall(COSTS, "abc"),
}

TITLES = {
    "laws": ["16 across", "32 across"],
    "loads": ["quads, 16 across", "triangles, 16 across"],
    "constants": ["Fibres at 0°", "Fibres at 30°"],
    "convergence": ["strip", "trellis"],
}


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
