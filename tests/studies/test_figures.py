"""Figures of studies: names that promise what is not written are refused."""

import re

import pytest

pytest.importorskip("matplotlib")

from studies.adaptive.figure import draw_errors
from studies.angles.figure import draw_loads
from studies.error_time.figure import drawn_elements, drawn_fronts, drawn_ratios
from studies.formulations.figure import convergence
from studies.inf_sup.figure import draw_constants
from studies.laws.figure import draw_errors as draw_laws
from studies.speed.figure import waterfall
from studies.stability.figure import draw_outcomes
from studies.stability.grid.figure import draw_grid
from studies.stability.grid.tables import Cell

LINES = {"a": ([1, 2], [1, 2])}
FIGURES = {
    "errors": lambda file: draw_errors([], file),
    "laws": lambda file: draw_laws([], file),
    "loads": lambda file: draw_loads([], file),
    "convergence": lambda file: convergence({"mm": {"title": LINES}}, file),
    "fronts": lambda file: drawn_fronts([], file),
    "ratios": lambda file: drawn_ratios([], file),
    "elements": lambda file: drawn_elements([], "load", file),
    "constants": lambda file: draw_constants([], file),
    "outcomes": lambda file: draw_outcomes([{"family": "a", "outcome": "right"}], file),
    "grid": lambda file: draw_grid({"a": {(1e2, 0.0): Cell()}}, file),
    "waterfall": lambda file: waterfall({"s": [(1.0, 0.0)]}, "a", file),
}


@pytest.mark.parametrize("draw", FIGURES.values(), ids=FIGURES)
def test_other_formats_are_refused_before_any_work(tmp_path, monkeypatch, draw):
    draw(tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes()[1:4] == b"PNG"

    def draws(*_, **__):
        raise AssertionError("drawn")

    monkeypatch.setattr("matplotlib.figure.Figure.__init__", draws)
    for suffix in (".gif", ".5"):
        message = f"cannot write {suffix} files, only .png, .svg, .pdf, .eps: name it"
        with pytest.raises(ValueError, match=re.escape(message)):
            draw(tmp_path / f"y{suffix}")
    assert [file.name for file in tmp_path.iterdir()] == ["x.png"]
