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
