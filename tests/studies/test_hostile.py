"""The study of hostile inputs: its short form, its outcomes and its workers."""

import os
import signal
import subprocess
import sys
import time
from argparse import Namespace
from contextlib import suppress
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="it forks")

ROOT = Path(__file__).parents[2]

#: Prints the outcomes of trials that end in every way there is, by seed.
OUTCOMES = """
import os, time
from studies.hostile.trial import Family, Finding, refused
from studies.hostile.workers import try_seeds

def attempt(seed, folder):
    acts = [
        lambda: Finding("right", ""),
        lambda: refused("", "mesh.msh: there is no node 7"),
        lambda: refused("", "two" + chr(10) + "lines"),
        lambda: refused("", ""),
        lambda: [].pop(),
        lambda: time.sleep(60),
        lambda: os._exit(3),
        lambda: os.kill(os.getpid(), 9),
        lambda: exit(1),
        lambda: Finding("silent", ""),
    ]
    return acts[seed]()

tried = try_seeds(Family("fake", attempt, 10, 10, seconds=1.0), range(10), 2)
print(*(t.finding.outcome for t in sorted(tried, key=lambda t: t.seed)))
"""

#: Prints the process number of a worker that hangs.
HANGS = """
import os, time
from studies.hostile.trial import Family
from studies.hostile.workers import try_seeds

def attempt(seed, folder):
    print(os.getpid(), flush=True)
    time.sleep(60)

list(try_seeds(Family("fake", attempt, 1, 1, seconds=60.0), [0], 1))
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


@pytest.mark.parametrize(
    "families",
    [
        ("--case", "conditions*", "case files*"),
        ("--case", "deck*", "tables*"),
        pytest.param((), id="all", marks=pytest.mark.long),
    ],
)
def test_no_hostile_input_ends_badly(tmp_path, families):
    options = "--short", "--workers", "2", *families, "--out", str(tmp_path)
    with started("-m", "studies", "hostile", *options) as suite:
        out, err = suite.communicate()
    assert suite.returncode == 0, out + err
    assert (tmp_path / "hostile.md").exists()


def test_stored_counts_are_those_of_the_cases_of_a_whole_run(tmp_path):
    from studies.hostile import trial
    from studies.hostile.study import STUDY

    options = Namespace(short=False, first=0, workers=1)
    cases, none = STUDY.cases(options), dict.fromkeys(trial.OUTCOMES, 0)
    rows = [
        {"family": case.family, "counts": none | {"right": len(case.seeds)}}
        for case in cases
    ]
    rows[0]["counts"] |= {"right": len(cases[0].seeds) - 1, "hang": 1}
    for name, text in STUDY.tables(rows).items():
        (tmp_path / name).write_text(text)
    stored = STUDY.stored(tmp_path)
    assert [row["case"] for row in stored] == [STUDY.name(case) for case in cases]
    assert STUDY.tables(stored) == STUDY.tables(rows)
    assert STUDY.figures(stored)["bad"] == "1"
    assert STUDY.complaint(stored) == "1 trials end badly"


@pytest.fixture(autouse=True)
def _hears_ctrl_c():
    """A suite in the background of a shell ignores it, and so would its children."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_every_outcome_is_recognised():
    with started("-c", OUTCOMES) as suite:
        out, err = suite.communicate()
    assert out.split() == [
        *("right", "refused", "unclear", "unclear", "traceback"),
        *("hang", "died", "died", "traceback", "silent"),
    ], err


@pytest.mark.skipif(sys.platform != "linux", reason="prctl is of Linux")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_suite_that_is_killed_leaves_no_worker(number):
    with started("-c", HANGS) as suite:
        worker = int(suite.stdout.readline())
        suite.send_signal(number)
        suite.wait(timeout=30)
        assert gone(worker)


def gone(process, seconds=10.0):
    """Whether a process ends in time; a zombie has ended."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        with suppress(FileNotFoundError):
            state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2]
            if state.split()[0] != "Z":
                time.sleep(0.05)
                continue
        return True
    os.kill(process, signal.SIGKILL)
    return False
