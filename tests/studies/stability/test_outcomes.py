"""Outcomes: a state is right, wrong or another one, or is refused; and how many."""

import numpy as np

from studies.stability import outcomes as ends
from studies.stability.outcomes import End, outcome


def end(energy=2.0, reactions=(5.0, -1.0), **others):
    """The end of a run that is right, unless something else is said of it."""
    given = {"converged": True, "sound": True, "path_resolved": True} | others
    return End(**given, energy=energy, reactions=np.array(reactions), **NOTHING)


NOTHING = {"no_energy": 1e-12, "no_force": 1e-9}
REFUSED = {"converged": False, "sound": False}


def test_a_state_is_right_as_400_steps_or_told_to_be_another():
    told = {"path_resolved": False}
    for near in (end(), end(2.0198), end(2.0, (4.96, -1.04)), end(**told)):
        assert outcome(near, end(), True) == ends.RIGHT
    for far in ({"energy": 2.04}, {"energy": 1.96}, {"reactions": (5.0, -1.06)}):
        assert outcome(end(**far), end(), True) == ends.WRONG
        assert outcome(end(**far, **told), end(), True) == ends.OTHER
    for reference in (end(sound=False), end(**REFUSED)):  # nothing to agree with
        assert outcome(end(), reference, True) == ends.WRONG
        assert outcome(end(**told), reference, True) == ends.OTHER


def test_what_is_not_sound_is_wrong_whatever_it_says_of_its_path():
    for resolved in (True, False):
        unsound = end(sound=False, path_resolved=resolved)
        assert outcome(unsound, end(), True) == ends.WRONG


def test_a_refusal_of_what_can_be_solved_is_told_from_others():
    assert outcome(end(**REFUSED), end(), True) == ends.MISSED
    assert outcome(end(**REFUSED), end(**REFUSED), False) == ends.REFUSED


def test_round_off_is_no_disagreement():
    none = end(1e-13, (1e-10, 0.0))
    assert outcome(none, end(-5e-13, (0.0, -8e-10)), True) == ends.RIGHT
    assert outcome(none, end(5e-12, (0.0, 0.0)), True) == ends.WRONG
    assert outcome(none, end(0.0, (5e-9, 0.0)), True) == ends.WRONG


def test_the_summary_counts():
    def row(outcome, solvable=True, agrees=True, path_resolved=True, **head):
        head = {"family": "f", "problem": "p"} | head
        said = {"agrees": agrees, "path_resolved": path_resolved}
        return head | {"outcome": outcome, "solvable": solvable} | said

    rows = [row(ends.RIGHT)] * 3 + [row(ends.RIGHT, path_resolved=False, problem="q")]
    rows += [row(ends.OTHER, agrees=False, path_resolved=False)] * 2
    rows += [row(ends.MISSED, agrees=False), row(ends.WRONG, agrees=False)]
    rows += [row(ends.REFUSED, solvable=False, agrees=False)] * 4
    assert ends.summary(rows) == {
        "problems": 2,
        "cases": 12,
        "right": 6,
        "right_on_another_equilibrium": 2,
        "refused": 5,
        "refused_though_solvable": 1,
        "wrong": 1,
        "solvable": 8,
        "share_right_of_solvable": 6 / 8,
        "share_right_as_400_steps_of_solvable": 4 / 8,
        "agree_with_400_steps": 4,
        "agree_but_path_not_resolved": 1,
        "share_of_these_not_resolved": 1 / 4,
    }
