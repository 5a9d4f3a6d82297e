import errno
import hashlib
import itertools
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import closing
from importlib import import_module
from pathlib import Path
from threading import Event

import numpy as np
import pytest
import sweep_cases
from threadpoolctl import threadpool_limits

from skfem_textile.cli.output import OutputError
from skfem_textile.sweep import Processes, SweepError, sweep

ROOT = Path(__file__).parents[2]


def process_pool(n):
    return ProcessPoolExecutor(n, multiprocessing.get_context("spawn"))


@pytest.fixture(scope="module")
def client():
    distributed = pytest.importorskip("dask.distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(processes=True, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(params=["threads", "process pool", "Processes", "dask"])
def executor(request):
    if request.param == "dask":
        make = request.getfixturevalue("client").get_executor
    else:
        kinds = {"threads": ThreadPoolExecutor, "process pool": process_pool}
        make = lambda: kinds.get(request.param, Processes)(2)  # noqa: E731
    with make() as executor:
        yield executor


def lines(out):
    """Cases and results on file; every line ends with the digest of what is before."""
    found = []
    for line in out.read_bytes().splitlines():
        entry = json.loads(line)
        digest = entry.pop("digest").encode()
        assert line.endswith(digest + b'"}')
        assert (
            hashlib.sha256(line[: -len(digest) - 2]).hexdigest()[:16] == digest.decode()
        )
        found.append(entry)
    return found


def test_any_executor_will_do(executor: Executor):
    assert dict(sweep(sweep_cases.square, range(9), executor)) == {
        n: n * n for n in range(9)
    }


def test_a_refused_load_step_fails_its_own_case_on_any_executor(executor):
    found = sweep(sweep_cases.refuses, range(4), executor, retries=0)
    with pytest.raises(SweepError, match=r"^1 case.*: 1: .*StepError stopped at load"):
        assert (
            sorted(itertools.islice(found, 3))
            == [(0, 0), (2, 2), (3, 3)]
            == next(found)
        )


def test_a_case_that_fails_is_run_again(executor, tmp_path):
    file = str(tmp_path / "tried")
    assert list(sweep(sweep_cases.fails_once, [file], executor)) == [(file, "done")]


@pytest.fixture
def many_threads(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)


def test_every_call_has_one_thread_of_linear_algebra(many_threads, executor):
    for _, threads in sweep(sweep_cases.threads, range(3), executor):
        assert set(threads) == {1}


def test_libraries_that_a_call_loads_have_one_thread_too():
    pytest.importorskip("pypardiso")
    with Processes(1) as executor:
        ((_, threads),) = sweep(sweep_cases.threads_of_pardiso, [0], executor)
    assert threads == [1]


def test_the_callers_own_threads_are_as_before():
    with threadpool_limits(3), ThreadPoolExecutor(2) as executor:
        before = sweep_cases.threads(None)
        found = dict(sweep(sweep_cases.threads, range(8), executor))
        assert all(set(threads) == {1} for threads in found.values())
        assert sweep_cases.threads(None) == before != found[0]


@pytest.mark.parametrize("kind", ["Processes", "dask"])
def test_a_killed_worker_loses_only_its_own_case_which_is_run_again(
    tmp_path, kind, request
):
    cases = [(str(tmp_path), n) for n in range(6)]
    dask = kind == "dask"
    with (
        request.getfixturevalue("client").get_executor() if dask else Processes(2) as e
    ):
        found = dict(sweep(sweep_cases.dies_once, cases, e))
    assert found == {case: case[1] for case in cases}
    runs = [len((tmp_path / f"runs of {n}").read_text()) for n in range(6)]
    assert runs == [1, 2, 1, 1, 1, 1]


def test_a_pool_that_breaks_keeps_what_it_found_and_says_what_to_take(tmp_path):
    out = tmp_path / "out.jsonl"
    with process_pool(1) as pool, pytest.raises(SweepError) as raised:
        dict(sweep(sweep_cases.dies, range(100), pool, out=out))
    assert "take skfem_textile.sweep.Processes" in str(raised.value)
    assert [line["found"] for line in lines(out)] == [0, 1]


class Breaks(Executor):
    """The first result comes as the second case breaks it."""

    def __init__(self):
        self.first = None

    def submit(self, fn, /, *args, **kwargs):
        if self.first is None:
            self.first = Future()
            return self.first
        self.first.set_result("first")
        raise BrokenExecutor


def test_what_came_as_the_executor_broke_is_kept_too(tmp_path):
    out = tmp_path / "out.jsonl"
    with pytest.raises(SweepError, match="Breaks broke"):
        list(sweep(sweep_cases.square, range(3), Breaks(), out=out))
    assert lines(out) == [{"case": "0", "found": "first"}]


class AtOnce(Executor):
    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def test_a_result_does_not_wait_for_cases_to_be_taken():
    counter = iter(range(9))
    assert next(sweep(sweep_cases.square, counter, AtOnce())) == (0, 0)
    assert next(counter) == 1


def test_results_are_on_disk_as_soon_as_they_come(tmp_path):
    out, read = tmp_path / "out.jsonl", Event()

    def waits(n):
        return n if n < 2 or read.wait(60) else None

    with ThreadPoolExecutor(1) as executor:
        found = sweep(waits, range(3), executor, out=out)
        assert [next(found), next(found)] == [(0, 0), (1, 1)]
        assert lines(out) == [{"case": str(n), "found": n} for n in range(2)]
        read.set()
        assert list(found) == [(2, 2)]
    assert len(lines(out)) == 3


def test_an_interrupted_sweep_does_not_run_again_what_it_has(tmp_path):
    out, asked, broken_off = tmp_path / "out.jsonl", Counter(), Event()

    def counted(n):
        asked[n] += 1
        assert n < 5 or broken_off.wait(60)
        return {"value": n / 7}

    with ThreadPoolExecutor(1) as executor:
        with closing(sweep(counted, range(9), executor, out=out)) as found:
            assert [next(found)[0] for _ in range(5)] == list(range(5))
        broken_off.set()
    assert max(asked) <= 5  # the rest is taken back
    assert [int(line["case"]) for line in lines(out)] == list(range(5))
    asked.clear()
    with ThreadPoolExecutor(1) as executor:
        again = dict(sweep(counted, range(9), executor, out=out))
    assert set(asked) == set(range(5, 9))
    assert again == {n: {"value": n / 7} for n in range(9)}
    assert len(lines(out)) == 9


def test_a_torn_last_line_is_dropped_and_its_case_run_again(tmp_path):
    out, asked = tmp_path / "out.jsonl", []

    def told(n):
        asked.append(n)
        return "text"

    with ThreadPoolExecutor(1) as executor:
        list(sweep(told, range(3), executor, out=out))
        whole = out.read_bytes()
        for torn in (1, 4, len(whole.splitlines()[-1])):
            out.write_bytes(whole[:-torn])
            asked.clear()
            assert len(list(sweep(told, range(3), executor, out=out))) == 3
            assert asked == [2]
            assert out.read_bytes() == whole


@pytest.mark.parametrize(
    "text",
    [
        "load,N\n1,2\n",
        "a note",
        '{"a": 1}\n',
        "[]\n{}",
        "{",
        '{"case": "of a lawyer", "found": 1',
        '{"case": "0", "found": 1}\n',
        "\n",
    ],
)
def test_a_file_of_something_else_is_refused_and_left_alone(tmp_path, text):
    out = tmp_path / "out"
    out.write_text(text)
    with (
        ThreadPoolExecutor(1) as executor,
        pytest.raises(ValueError, match="not what a sweep wrote"),
    ):
        next(sweep(sweep_cases.square, range(3), executor, out=out))
    assert out.read_text() == text


def swept(out):
    with ThreadPoolExecutor(1) as executor:
        return dict(sweep(lambda n: {"value": n / 7}, range(6), executor, out=out))


def test_damage_at_random_changes_no_result(tmp_path, caplog):
    """Lines that were changed are told; a file without a whole line is refused."""
    out = tmp_path / "out.jsonl"
    right = swept(out)
    whole, rng = out.read_bytes(), np.random.default_rng(0)
    n_told = 0
    for _ in range(300):
        content, places = bytearray(whole), rng.integers(len(whole), size=3)
        match rng.integers(5):
            case 0:
                content[places[0]] ^= rng.integers(1, 256)
            case 1:
                del content[min(places) : max(places)]
            case 2:
                content[places[0] : places[0]] = rng.bytes(rng.integers(1, 60))
            case 3:
                content[places[0] : places[0]] = whole[min(places) : max(places)]
            case 4:
                content = content[: places[0]]
        out.write_bytes(content)
        caplog.clear()
        try:
            assert swept(out) == right
        except ValueError as error:
            assert "not what a sweep wrote" in str(error)  # noqa: PT017
            assert out.read_bytes() == content
        else:
            assert len(caplog.messages) <= 1
            n_told += len(caplog.messages)
    assert n_told > 150


def test_the_line_that_is_damaged_is_told_and_its_case_run_again(tmp_path, caplog):
    out = tmp_path / "out.jsonl"
    right = swept(out)
    whole = out.read_bytes().splitlines(keepends=True)
    edited = whole[2].replace(b"0.28", b"0.29")
    assert edited != whole[2]
    out.write_bytes(b"".join([*whole[:2], edited, *whole[3:]]))
    assert swept(out) == right
    assert "run again: line(s) 3" in caplog.text
    assert out.read_bytes().splitlines(keepends=True)[-1] == whole[2]


def test_two_results_of_one_case_are_told_and_neither_is_taken(tmp_path, caplog):
    out, other = tmp_path / "out.jsonl", tmp_path / "other.jsonl"
    right = swept(out)
    with ThreadPoolExecutor(1) as executor:
        list(sweep(lambda n: {"value": n}, [2], executor, out=other))
    first = out.read_bytes().splitlines(keepends=True)[0]
    out.write_bytes(out.read_bytes() + other.read_bytes() + first)
    assert swept(out) == right
    assert "run again: line(s) 3, 7" in caplog.text


def test_what_was_added_to_a_file_is_not_cut_off(tmp_path, caplog):
    out = tmp_path / "out.jsonl"
    right = swept(out)
    whole = out.read_bytes()
    out.write_bytes(whole + b"a note of mine")
    assert swept(out) == right
    assert out.read_bytes() == whole + b"a note of mine\n"
    assert "line(s) 7" in caplog.text


@pytest.mark.parametrize(
    "start",
    [
        b"",
        b"null",
        b'{"case": "0"',
        b'{"case": ["0"], "found": 1',
        b'{"case": 1, "found": 1',
        b"\xff",
        b'{"case": "0", "found": ' + b"[" * 50_000,
    ],
)
def test_a_line_that_makes_no_sense_is_told_whatever_its_digest(
    tmp_path, caplog, start
):
    out = tmp_path / "out.jsonl"
    right = swept(out)
    start += b', "digest": "'
    digest = hashlib.sha256(start).hexdigest()[:16].encode()
    forged = start + digest + b'"}\n'
    out.write_bytes(out.read_bytes() + forged)
    assert swept(out) == right
    assert "run again: line(s) 7" in caplog.text
    out.write_bytes(forged)
    with pytest.raises(ValueError, match="not what a sweep wrote"):
        swept(out)
    assert out.read_bytes() == forged


def test_of_two_sweeps_on_one_file_the_second_is_told(tmp_path):
    out = tmp_path / "out.jsonl"
    with ThreadPoolExecutor(1) as executor:
        with closing(sweep(sweep_cases.square, range(3), executor, out=out)) as first:
            assert next(first) == (0, 0)
            with pytest.raises(BlockingIOError, match="another run is writing to"):
                next(sweep(sweep_cases.square, range(3), executor, out=out))
        assert len(list(sweep(sweep_cases.square, range(3), executor, out=out))) == 3


def test_a_full_disk_is_told_and_the_next_sweep_goes_on(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    out, cases = tmp_path / "out", [1, 2, 3]
    told = r"cannot write results to .*/out: No space left on device; .* remains"
    with ThreadPoolExecutor(1) as executor:
        some = sweep(abs, cases, executor, out=out)
        next(some)
        with monkeypatch.context() as patch:
            patch.setattr("skfem_textile.sweep.kept.open", full, raising=False)
            with pytest.raises(OutputError, match=told):
                next(some)
    assert out.read_bytes().count(b"\n") == 1
    with ThreadPoolExecutor(1) as executor:
        assert len(list(sweep(abs, cases, executor, out=out))) == 3


def test_what_is_no_file_is_refused(tmp_path):
    for out in (tmp_path, Path("/dev/zero")):
        with pytest.raises(ValueError, match="not what a sweep wrote"):
            swept(out)


def test_a_case_that_always_fails_is_named_and_the_others_finish(tmp_path):
    out, asked = tmp_path / "out.jsonl", Counter()

    def fails(n):
        asked[n] += 1
        return 1 / (n - 1)

    with ThreadPoolExecutor(2) as executor:
        with pytest.raises(SweepError, match=r"^1 case.*: 1: ZeroDivis") as raised:
            list(sweep(fails, range(5), executor, out=out, retries=2))
        assert asked == {0: 1, 1: 3, 2: 1, 3: 1, 4: 1}
        ((case, error),) = raised.value.failed
        assert case == 1
        assert isinstance(error, ZeroDivisionError)
        asked.clear()
        list(sweep(lambda n: asked.update([n]), range(5), executor, out=out))
    assert asked == {1: 1}


def test_of_many_failures_some_are_named_and_all_are_counted():
    with ThreadPoolExecutor(2) as executor:
        found = sweep(lambda n: [][n], range(50), executor)
        with pytest.raises(SweepError, match=r"^50 case.*; and 45 more$") as raised:
            list(found)
    assert len(raised.value.failed) == 50


def test_cases_are_taken_as_they_are_needed(monkeypatch):
    module = import_module("skfem_textile.sweep.sweep")
    monkeypatch.setattr(module, "_AT_ONCE", 8)
    counter = iter(range(9999))
    with ThreadPoolExecutor(2) as executor:
        found = sweep(sweep_cases.square, counter, executor)
        assert len(list(itertools.islice(found, 100))) == 100
        found.close()
    assert next(counter) <= 108


def test_cases_on_file_have_names_of_their_own_that_last(tmp_path):
    out = tmp_path / "out.jsonl"
    with ThreadPoolExecutor(1) as executor:
        with pytest.raises(ValueError, match="two cases are named 1"):
            list(sweep(sweep_cases.square, [1, 2, 1], executor, out=out))
        with pytest.raises(ValueError, match="give a key that lasts"):
            list(sweep(lambda _: 0, [sweep_cases.square], executor, out=out))
        named = sweep(lambda f: 0, [len], executor, out=out, key=lambda f: f.__name__)
        assert list(named) == [(len, 0)]


def test_arrays_are_written_as_lists_and_what_cannot_be_written_is_named(tmp_path):
    out = tmp_path / "out.jsonl"
    with ThreadPoolExecutor(1) as executor:
        array = sweep(lambda n: {"u": np.arange(n), "n": n}, [np.int64(2)], executor)
        assert isinstance(next(array)[1]["u"], np.ndarray)
        kept = sweep(lambda n: {"u": np.arange(n)}, [2], executor, out=out)
        assert list(kept) == [(2, {"u": [0, 1]})]
        with pytest.raises(TypeError, match="cannot write a object"):
            list(sweep(lambda _: object(), [3], executor, out=out))


def test_an_error_from_a_process_says_where_it_arose():
    with Processes(1) as executor:
        error = executor.submit(divmod, 1, 0).exception()
        assert isinstance(error, ZeroDivisionError)
        assert "Traceback" in error.__notes__[0]
        with pytest.raises(BrokenExecutor, match="exit code 3"):
            executor.submit(os._exit, 3).result()
        assert executor.submit(divmod, 7, 2).result() == (3, 1)


def interrupted(file):
    """Stop, with an error, once a case runs that takes long."""
    with Processes(1) as executor:
        pid = executor.submit(os.getpid).result()
        for _ in range(2):
            executor.submit(sweep_cases.takes_long, file)
        sweep_cases.wait_for(file)
        assert alive(pid)
        file.write_text(str(pid))
        raise KeyboardInterrupt


def test_processes_end_at_once_when_their_block_ends_with_an_error(tmp_path):
    file = tmp_path / "pid"
    with pytest.raises(KeyboardInterrupt):
        interrupted(file)
    assert not alive(int(file.read_text()))
    assert list(tmp_path.iterdir()) == [file]


STUDY = """
import os, sys, time
from pathlib import Path
from skfem_textile import Full
from skfem_textile.cli import main as cli
from skfem_textile.studies import stability
from skfem_textile.studies.extremes import Extreme

stability.extremes = lambda: [Extreme("family", n, None, Full()) for n in "abcd"]
stability.PICTURES = ()

def examined(problem):
    with open(problem.label, "a") as file:
        file.write(f"{os.getpid()} ")
    while problem.label == "b" and not Path("go on").exists():
        time.sleep(0.01)
    figures = {"family": problem.family, "problem": problem.name, "steps": 1}
    figures |= {"kind": problem.kind, "seed": None, "outcome": stability.RIGHT}
    figures |= {"solvable": True, "agrees": True, "path_resolved": True}
    return [figures | {"linear_solves": ord(problem.label), "energy": 0.1}]

stability.examined = examined

if __name__ == "__main__":
    sys.exit(cli.main(["study", "stability", "--no-render", *sys.argv[1:]]))
"""


def alive(pid):
    try:
        return "zombie" not in Path(f"/proc/{pid}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


def until(condition):
    for _ in range(6000):
        if condition():
            return
        time.sleep(0.01)
    pytest.fail("it does not come to pass")


def test_a_study_that_was_killed_goes_on_and_its_report_is_the_same(tmp_path):
    (tmp_path / "study.py").write_text(STUDY)
    command = [sys.executable, "study.py", "--workers", "2", "--out"]
    options = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
    kept = tmp_path / "killed" / "stability-unfinished.jsonl"
    started = tmp_path / "b"
    with subprocess.Popen([*command, "killed"], **options) as study:
        until(lambda: started.is_file() and started.read_text().endswith(" "))
        until(lambda: kept.is_file() and len(kept.read_text().splitlines()) == 3)
        study.send_signal(signal.SIGKILL)
    (left,) = {int(pid) for pid in started.read_text().split()}
    until(lambda: not alive(left))
    (tmp_path / "go on").touch()
    subprocess.run([*command, "killed", "--resume"], **options, check=True)
    runs = [len((tmp_path / name).read_text().split()) for name in "abcd"]
    assert runs == [1, 2, 1, 1]
    assert not kept.exists()
    subprocess.run([*command, "whole"], **options, check=True)
    files = [p.name for p in (tmp_path / "whole").iterdir()]
    assert len(files) == 3
    for name in files:
        ours, theirs = (tmp_path / d / name for d in ("killed", "whole"))
        assert ours.read_bytes() == theirs.read_bytes()


def test_the_example_runs_on_dask_too(tmp_path):
    pytest.importorskip("dask.distributed")
    script = ROOT / "examples" / "sweep.py"
    options = {"cwd": tmp_path, "env": os.environ | {"PYTHONPATH": str(ROOT)}}
    subprocess.run([sys.executable, script, "--dask"], **options, check=True)
