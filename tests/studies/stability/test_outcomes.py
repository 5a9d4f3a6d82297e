"""Outcomes:

a state is right, wrong or another one, or the run fails; and their counts.
"""

import numpy as np

from studies.stability import study as ends
from studies.stability.study import End, outcome


def end(energy=2.0, reactions=(5.0, -1.0), **others):
    """The end of a run that is right except for the given attributes."""
    arguments = {"converged": True, "sound": True, "path_resolved": True} | others
    return End(**arguments, energy=energy, reactions=np.array(reactions), **NOTHING)


NOTHING = {"no_energy": 1e-12, "no_force": 1e-9}
REFUSED = {"converged": False, "sound": False}


def test_a_state_agrees_with_400_steps_or_is_reported_as_another():
    another = {"path_resolved": False}
    for near in (end(), end(2.0198), end(2.0, (4.96, -1.04)), end(**another)):
        assert outcome(near, end(), True) == ends.RIGHT
    for far in ({"energy": 2.04}, {"energy": 1.96}, {"reactions": (5.0, -1.06)}):
        assert outcome(end(**far), end(), True) == ends.WRONG
        assert outcome(end(**far, **another), end(), True) == ends.OTHER
    for reference in (end(sound=False), end(**REFUSED)):  # no other run to compare with
        assert outcome(end(), reference, True) == ends.WRONG
        assert outcome(end(**another), reference, True) == ends.OTHER


def test_an_unsound_state_is_wrong_for_any_verdict_on_its_path():
    for resolved in (True, False):
        unsound = end(sound=False, path_resolved=resolved)
        assert outcome(unsound, end(), True) == ends.WRONG


def test_a_failure_on_a_solvable_problem_is_distinguished():
    assert outcome(end(**REFUSED), end(), True) == ends.MISSED
    assert outcome(end(**REFUSED), end(**REFUSED), False) == ends.REFUSED


def test_round_off_is_not_a_disagreement():
    none = end(1e-13, (1e-10, 0.0))
    assert outcome(none, end(-5e-13, (0.0, -8e-10)), True) == ends.RIGHT
    assert outcome(none, end(5e-12, (0.0, 0.0)), True) == ends.WRONG
    assert outcome(none, end(0.0, (5e-9, 0.0)), True) == ends.WRONG


def test_each_of_the_five_outcomes_is_counted_separately():
    """A right state and another equilibrium are not summed."""

    def row(outcome, error=0.0, path_resolved=True, **head):
        head = {"family": "laws: f", "problem": "p", "steps": 1} | head
        figures = {"energy_off": error, "reactions_off": 0.0, "energy": 2.0}
        figures |= {"corners_energy": 0.0, "min_det_F": 0.5, "linear_solves": 4}
        figures |= {"solvable": outcome != ends.REFUSED}
        return figures | head | {"outcome": outcome, "path_resolved": path_resolved}

    rows = [row(ends.RIGHT, 0.001, corners_energy=0.1)] * 3
    rows += [row(ends.RIGHT, 0.009, path_resolved=False, problem="q")]
    rows += [row(ends.OTHER, 0.85, path_resolved=False)] * 2
    rows += [row(ends.MISSED), row(ends.WRONG)] + [row(ends.REFUSED)] * 4
    words = ends.in_words(rows)
    counts = {"right": "4", "other": "2", "refused": "4", "missed": "1", "wrong": "1"}
    assert {name: words[name] for name in counts} == counts
    assert (words["cases"], words["problems"], words["solvable"]) == ("12", "2", "8")
    assert (words["right_resolved"], words["right_resolved_off"]) == ("3", "0.1 %")
    assert (words["other_off"], words["right_unresolved"]) == ("85 %", "1")
    assert words["law_problems_with_several"] == "1 of 2"
