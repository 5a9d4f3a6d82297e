"""The study of hostile inputs: short form, outcomes and workers."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.sweep_cases import is_alive
from tests.sweep.calls import wait_until

pytestmark = pytest.mark.skipif(os.name != "posix", reason="it forks")

ROOT = Path(__file__).parents[2]

#: Prints the outcomes of trials with every possible outcome.
ENDS = """
import os, time
from collections import Counter
from hypothesis import strategies as st
from studies.hostile.workers import findings
from tests.helpers.hostile import RIGHT, Family, WrongAnswerError, rejected

def wrong():
    raise WrongAnswerError

acts = {
    "right": lambda: RIGHT,
    "refused": lambda: rejected("mesh.msh: there is no node 7"),
    "two lines": lambda: rejected("two" + chr(10) + "lines"),
    "no line": lambda: rejected(""),
    "error": lambda: [].pop(),
    "sleep": lambda: time.sleep(60),
    "end": lambda: os._exit(3),
    "kill": lambda: os.kill(os.getpid(), 9),
    "exit": lambda: exit(1),
    "wrong": wrong,
}
inputs = {name: st.tuples(st.just(name), st.integers()) for name in acts}
family = Family("fake", inputs, lambda given: acts[given[0]](), 10, 10, seconds=0.2)
ends = Counter(finding.outcome for finding in findings(family, range(10), 2))
print(*sorted(ends.items()))
"""

#: Prints the process number of a worker that hangs.
HANGS = """
import os, time
from hypothesis import strategies as st
from studies.hostile.workers import findings
from tests.helpers.hostile import Family

def attempt(given):
    print(os.getpid(), flush=True)
    time.sleep(60)

list(findings(Family("fake", {"": st.integers()}, attempt, 1), range(1), 1))
"""


def started(*words, **options):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, *words],
        cwd=ROOT,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        **options,
    )


@pytest.mark.slow
def test_hostile_inputs_have_no_bad_outcome(tmp_path):
    options = "--short", "--workers", "2", "--out", str(tmp_path)
    with started("-m", "studies", "hostile", *options) as suite:
        out, err = suite.communicate()
    assert suite.returncode == 0, out + err
    assert (tmp_path / "hostile.md").exists()


@pytest.fixture(autouse=True)
def _receives_ctrl_c():
    """A background process of a shell ignores it, and so would its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_every_outcome_is_recognised():
    with started("-c", ENDS) as suite:
        out, err = suite.communicate()
    ends = {"died": 2, "hang": 1, "refused": 1, "right": 1, "silent": 1}
    ends |= {"traceback": 2, "unclear": 2}
    assert out.strip() == " ".join(map(str, ends.items())), err


@pytest.mark.skipif(sys.platform != "linux", reason="prctl is of Linux")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_suite_that_is_killed_leaves_no_worker(number):
    with started("-c", HANGS) as suite:
        worker = int(suite.stdout.readline())
        suite.send_signal(number)
        suite.wait(timeout=30)
        wait_until(lambda: not is_alive(worker), seconds=10)
