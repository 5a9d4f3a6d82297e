import os
import signal
import subprocess
import sys
from concurrent.futures import BrokenExecutor
from pathlib import Path

import pytest

from skfem_textile.solve.sweep import WorkerProcesses
from tests.helpers import sweep_cases
from tests.helpers.processes import is_alive, wait_until

ROOT = Path(__file__).parents[2]

KILLED = """
import os, time
from skfem_textile.solve.sweep import WorkerProcesses

if __name__ == "__main__":
    with WorkerProcesses(1) as executor:
        print(executor.submit(os.getpid).result(), flush=True)
        executor.submit(time.sleep, 60).result()
"""


def test_an_error_from_a_process_says_where_it_arose():
    with WorkerProcesses(1) as executor:
        error = executor.submit(divmod, 1, 0).exception()
        assert isinstance(error, ZeroDivisionError)
        assert "Traceback" in str(error.__cause__)
        assert isinstance(executor.submit(os._exit, 3).exception(), BrokenExecutor)
        assert executor.submit(divmod, 7, 2).result() == (3, 1)


def interrupted(file):
    """Stop, with an error, once a case runs that takes long."""
    with WorkerProcesses(1) as executor:
        pid = executor.submit(os.getpid).result()
        for _ in range(2):
            executor.submit(sweep_cases.takes_long, file)
        wait_until(file.exists)
        assert is_alive(pid)
        file.write_text(str(pid))
        raise KeyboardInterrupt


def test_processes_end_at_once_when_their_block_ends_with_an_error(tmp_path):
    file = tmp_path / "pid"
    with pytest.raises(KeyboardInterrupt):
        interrupted(file)
    assert not is_alive(int(file.read_text()))
    assert list(tmp_path.iterdir()) == [file]


def test_processes_end_when_their_caller_is_killed():
    command = [sys.executable, "-c", KILLED]
    options = {"env": os.environ | {"PYTHONPATH": str(ROOT)}, "text": True}
    with subprocess.Popen(command, stdout=subprocess.PIPE, **options) as caller:
        worker = int(caller.stdout.readline())
        assert is_alive(worker)
        caller.send_signal(signal.SIGKILL)
    wait_until(lambda: not is_alive(worker))
