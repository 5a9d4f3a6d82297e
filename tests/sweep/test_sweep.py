"""Sweeps over cases, and their worker processes."""

import itertools
import os
import runpy
import signal
import subprocess
import sys
from collections import Counter
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import nullcontext
from functools import partial
from threading import Event

import pytest

from skfem_textile.solve import solver_threads
from skfem_textile.sweep import SweepError, WorkerProcesses, sweep
from tests.helpers.command_line import OF_CHILD, ROOT
from tests.helpers.sweep_cases import is_alive, lines, process_pool
from tests.sweep import calls

threadpoolctl = pytest.importorskip("threadpoolctl")

EXAMPLE = ROOT / "examples" / "runs" / "sweep.py"


def test_any_executor_is_supported(executor: Executor):
    assert dict(sweep(calls.square, range(9), executor)) == {n: n * n for n in range(9)}


def test_a_failed_load_step_fails_its_case_only_on_any_executor(executor):
    results = sweep(calls.fails_with_result, range(4), executor, retries=0)
    assert sorted(itertools.islice(results, 3)) == [(0, 0), (2, 2), (3, 3)]
    with pytest.raises(SweepError, match=r"^1 case.*: 1: .*StepError: stopped at load"):
        next(results)


def test_messages_during_a_call_name_its_case(executor):
    def key(n):
        return f"case {n}"

    for n, messages in sweep(calls.warns, [7, 8], executor, key=key):
        assert f"case {n}: share {n} %" in messages
        assert f"share {n}" in messages


INTERRUPTED = """
import sys
from pathlib import Path
from skfem_textile.sweep import WorkerProcesses, sweep
from tests.sweep.calls import takes_long

if __name__ == "__main__":
    with WorkerProcesses(1) as executor:
        for case, _ in sweep(takes_long, sys.argv[2:], executor, out=sys.argv[1]):
            print(case, flush=True)
"""


def test_an_interrupted_script_ends_in_one_line(tmp_path):
    """Ctrl-C at a terminal also reaches the worker processes."""
    out, long = tmp_path / "out.jsonl", tmp_path / "long"
    command = [sys.executable, "-c", INTERRUPTED, str(out), str(long)]
    options = {"env": OF_CHILD, "text": True}
    options |= {"start_new_session": True, "stderr": subprocess.PIPE}
    # Otherwise ignored if the tests run in the background of a shell.
    options["preexec_fn"] = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, **options) as caller:
        calls.wait_until(long.exists)
        os.killpg(caller.pid, signal.SIGINT)
        _, message = caller.communicate()
    assert caller.returncode == 130
    assert message == f"interrupted: results of completed cases are kept in {out}\n"


def test_completed_results_are_written_if_the_caller_stops(tmp_path):
    out, submitted = tmp_path / "out.jsonl", Event()

    def cases():
        yield from range(3)
        submitted.set()

    def square(x):
        submitted.wait()
        return calls.square(x)

    with ThreadPoolExecutor(1) as executor:
        results = sweep(square, cases(), executor, out=out)
        next(results)
        executor.shutdown()  # the others are complete
        results.close()
    assert [x["found"] for x in lines(out)] == [0, 1, 4]


def test_a_failing_case_is_repeated(executor, tmp_path):
    file = str(tmp_path / "tried")
    assert list(sweep(calls.fails_once, [file], executor)) == [(file, "done")]


def test_every_call_has_one_thread_of_linear_algebra(executor):
    for _, threads in sweep(calls.threads, range(3), executor):
        assert set(threads) == {1}


def test_rslab_has_one_thread_in_every_call_and_no_limit_after_it(executor):
    assert list(sweep(calls.threads_of_rslab, [0], executor)) == [(0, 1)]
    assert solver_threads.get() is None


@pytest.mark.parametrize("executor", ["workers"], indirect=True)
def test_libraries_loaded_by_a_call_have_one_thread(executor):
    pytest.importorskip("pypardiso")
    ((_, threads),) = sweep(calls.threads_of_pardiso, [0], executor)
    assert threads == [1]


def test_the_threads_of_the_caller_are_unchanged():
    with threadpoolctl.threadpool_limits(3), ThreadPoolExecutor(2) as executor:
        before = calls.threads(None)
        results = dict(sweep(calls.threads, range(8), executor))
        assert all(set(threads) == {1} for threads in results.values())
        assert calls.threads(None) == before != results[0]


@pytest.mark.dear("a worker process ends, and another one starts")
@pytest.mark.parametrize("executor", ["workers"], indirect=True)
def test_a_killed_worker_loses_only_its_case_which_is_repeated(tmp_path, executor):
    cases = [(str(tmp_path), n) for n in range(6)]
    results = dict(sweep(calls.dies_once, cases, executor))
    assert results == {case: case[1] for case in cases}
    runs = [len((tmp_path / f"runs of {n}").read_text()) for n in range(6)]
    assert runs == [1, 2, 1, 1, 1, 1]


def test_a_pool_that_breaks_keeps_its_results_and_the_next_sweep_resumes(tmp_path):
    out = tmp_path / "out.jsonl"
    cases = [(str(tmp_path), n) for n in (3, 1, 2)]
    (tmp_path / "runs of 0").touch()  # for which the killed case would wait
    message = "ProcessPoolExecutor is broken .*WorkerProcesses, .* to resume it"
    with process_pool(1) as pool:
        results = sweep(calls.dies_once, cases, pool, out=out)
        with pytest.raises(SweepError, match=message) as raised:
            list(results)
    assert [case for case, _ in raised.value.failed] == cases[1:]
    assert [line["found"] for line in lines(out)] == [3]
    with ThreadPoolExecutor(1) as pool:
        results = dict(sweep(calls.dies_once, cases, pool, out=out))
    assert results == {case: case[1] for case in cases}
    runs = [len((tmp_path / f"runs of {n}").read_text()) for n in (3, 1)]
    assert runs == [1, 2]


class Breaks(Executor):
    """The first result arrives as the second case breaks the executor."""

    def __init__(self):
        self.first = None

    def submit(self, fn, /, *args, **kwargs):
        if self.first is None:
            self.first = Future()
            return self.first
        self.first.set_result("first")
        raise BrokenExecutor


def test_results_of_a_broken_executor_are_kept_and_no_more_cases_start(tmp_path):
    out, counter = tmp_path / "out.jsonl", iter(range(9))
    with pytest.raises(SweepError, match="Breaks is broken"):
        list(sweep(calls.square, counter, Breaks(), out=out))
    assert lines(out) == [{"case": "0", "found": "first"}]
    assert next(counter) == 2


class AtOnce(Executor):
    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def test_a_result_does_not_wait_for_cases_to_be_drawn():
    counter = iter(range(9))
    assert next(sweep(calls.square, counter, AtOnce())) == (0, 0)
    assert next(counter) == 1


def test_a_case_that_always_fails_is_named_and_the_others_finish(tmp_path):
    out, tried = tmp_path / "out.jsonl", Counter()

    def fails(n):
        tried[n] += 1
        return 1 / (n - 1)

    with ThreadPoolExecutor(2) as executor:
        with pytest.raises(SweepError, match=r"^1 case.*: 1: ZeroDivis") as raised:
            list(sweep(fails, range(5), executor, out=out, retries=2))
        assert tried == {0: 1, 1: 3, 2: 1, 3: 1, 4: 1}
        ((case, error),) = raised.value.failed
        assert case == 1
        assert isinstance(error, ZeroDivisionError)
        tried.clear()
        list(sweep(lambda n: tried.update([n]), range(5), executor, out=out))
    assert tried == {1: 1}


def test_five_of_many_failures_are_named_and_all_are_counted(thread):
    with pytest.raises(SweepError, match=r"^50 case.*; and 45 more$") as raised:
        list(sweep([].__getitem__, range(50), thread))
    assert len(raised.value.failed) == 50


class Holds(Executor):
    """The first result arrives with the 4096th case."""

    def __init__(self):
        self.calls = []

    def submit(self, fn, /, *args, **kwargs):
        self.calls.append(Future())
        if len(self.calls) == 4096:
            self.calls[0].set_result("first")
        return self.calls[-1]


def test_cases_are_drawn_as_they_are_needed():
    counter = iter(range(9999))
    assert next(sweep(calls.square, counter, Holds())) == (0, "first")
    assert next(counter) == 4096


@pytest.mark.slow
def test_sweeps_and_the_example_run_on_dask(client, tmp_path, monkeypatch):
    """In one test, because a cluster takes seconds to start."""
    from dask import distributed

    with client.get_executor() as executor:
        test_any_executor_is_supported(executor)
        test_a_failed_load_step_fails_its_case_only_on_any_executor(executor)
        test_a_failing_case_is_repeated(executor, tmp_path)
        test_every_call_has_one_thread_of_linear_algebra(executor)
        test_a_killed_worker_loses_only_its_case_which_is_repeated(tmp_path, executor)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        distributed, "LocalCluster", lambda **_: nullcontext(client.cluster)
    )
    runpy.run_path(str(EXAMPLE))["run"](tmp_path, "dask")


@pytest.mark.slow
def test_the_example_starts_a_separate_cluster(tmp_path):
    pytest.importorskip("dask.distributed")
    command = [sys.executable, EXAMPLE, "--dask"]
    subprocess.run(command, cwd=tmp_path, env=OF_CHILD, check=True)


KILLED = """
import os, time
from skfem_textile.sweep import WorkerProcesses

if __name__ == "__main__":
    with WorkerProcesses(1) as executor:
        print(executor.submit(os.getpid).result(), flush=True)
        executor.submit(time.sleep, 60).result()
"""


@pytest.mark.parametrize("executor", ["workers"], indirect=True)
def test_an_error_from_a_process_contains_its_traceback(executor):
    error = executor.submit(divmod, 1, 0).exception()
    assert isinstance(error, ZeroDivisionError)
    assert "Traceback" in str(error.__cause__)
    assert isinstance(executor.submit(os._exit, 3).exception(), BrokenExecutor)
    assert executor.submit(divmod, 7, 2).result() == (3, 1)


@pytest.mark.parametrize("executor", ["workers"], indirect=True)
def test_processes_ignore_ctrl_c(executor):
    """One that did not would print a traceback of its imports."""
    blocked = executor.submit(signal.pthread_sigmask, signal.SIG_BLOCK, []).result()
    assert signal.SIGINT in blocked
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def interrupted(file):
    """Stop, with an error, once a case runs that takes long."""
    with WorkerProcesses(1) as executor:
        pid = executor.submit(os.getpid).result()
        for _ in range(2):
            executor.submit(calls.takes_long, file)
        calls.wait_until(file.exists)
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
    options = {"env": OF_CHILD, "text": True}
    with subprocess.Popen(command, stdout=subprocess.PIPE, **options) as caller:
        worker = int(caller.stdout.readline())
        assert is_alive(worker)
        caller.send_signal(signal.SIGKILL)
    calls.wait_until(lambda: not is_alive(worker))
