import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from skfem_textile.solve.sealed import Lock

ROOT = Path(__file__).parents[2]
HOLDS = """
import sys, time
from pathlib import Path
from skfem_textile.solve.sealed import Lock
lock = Lock(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(60)
"""
FORKS = """
import os, sys, time
from pathlib import Path
from skfem_textile.solve.sealed import Lock
lock, (came, goes) = Lock(Path(sys.argv[1])), os.pipe()
child = os.fork()
if not child:
    os.write(goes, b".")
    time.sleep(60)
os.read(came, 1)
lock.release()
Lock(Path(sys.argv[1]))
os.kill(child, 9)
"""


def started(script, path):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", script, str(path)]
    return subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_a_killed_process_leaves_no_lock(tmp_path, kind):
    path = tmp_path
    if kind == "file":
        path = tmp_path / "file"
        path.touch()
    with started(HOLDS, path) as process:
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(BlockingIOError, match="another run is writing to"):
            Lock(path)
        process.send_signal(signal.SIGKILL)
    Lock(path).release()


def test_a_forked_process_does_not_keep_the_lock_of_its_parent(tmp_path):
    with started(FORKS, tmp_path) as process:
        _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, b"")


def test_a_lock_that_was_interrupted_as_it_was_made_is_released_in_silence():
    Lock.__new__(Lock).release()
