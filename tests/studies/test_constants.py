"""The study of constants: what it lists, replaces, and reports."""

import importlib

import numpy as np
import pytest

from skfem_textile.outlines import net, outline, rings
from studies.constants.replacing import Constant, constants, read_by, replaced
from studies.constants.scenes import SCENES, Scene
from studies.constants.study import Case, effects

LISTED = {str(constant): constant for constant in constants(("outlines",))}
SHORTEST = LISTED["outlines.net._SHORTEST"]


def test_constants_have_their_value_and_the_first_sentence_of_their_comment():
    assert SHORTEST.value == net._SHORTEST
    meaning = LISTED["outlines.meshing._SIZE"].meaning
    assert meaning == "Default size of triangles relative to √area"
    assert "outlines.net._SAMPLES" not in LISTED  # an array


def test_integers_are_rounded_and_tuples_are_scaled_as_a_whole():
    divisions = LISTED["outlines.seeds._HALVINGS"]
    assert divisions.times(0.25) == round(divisions.value / 4)
    beside = LISTED["outlines.triangles._BESIDE_LINE"]
    assert beside.times(2.0) == tuple(2 * x for x in beside.value)
    pushes = Constant("solve.active_set", "_MOST_SOLVES", "")
    assert pushes.times(0.01) == 1


def test_a_constant_is_replaced_where_it_is_imported_and_restored_after_an_error():
    users = [
        importlib.import_module(f"skfem_textile.outlines.{x}") for x in ("fibres",)
    ]
    near, value = LISTED["outlines.rings.NEAR"], outline.NEAR

    def fail():
        with replaced(near, 1.0):
            assert [module.NEAR for module in (outline, *users)] == [1.0, 1.0]
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert [module.NEAR for module in (outline, *users)] == [value, value]


def test_names_are_read_by_the_lines_that_run():
    def call(positive):
        return rings._is_closed(np.zeros((2, 3))) if positive else 0

    assert ("skfem_textile.outlines.rings", "JOINED") in read_by(lambda: call(True))
    assert not read_by(lambda: call(False))


def test_a_case_reports_changes_of_its_scenes(monkeypatch):
    """Elements of the quickest scene; errors are outcomes."""

    def run():
        if net._SHORTEST > 0.6:
            raise ValueError("3 edges of 7 are too short")
        return 4, {"shortest": 2.0 + net._SHORTEST}

    scene = Scene("made", run)
    monkeypatch.setitem(SCENES, "outlines", (scene,))
    monkeypatch.setattr("studies.constants.study.Case._reads", lambda *_: True)
    rows = Case("outlines", SHORTEST).rows()
    assert [row["factor"] for row in rows] == [0.25, 0.5, 2.0, 4.0]
    assert [row["solves"] for row in rows] == [1.0] * 4
    assert rows[2]["change"] == pytest.approx(0.25 / 2.25, rel=0.05)
    assert rows[2]["of"] == "made: shortest"
    assert rows[3]["outcomes"] == "made: ValueError: # edges of # are too short"
    table = effects(rows, "outlines")
    assert "| `outlines.net._SHORTEST` | 0.25 |" in table
    assert "made fails |" in table
