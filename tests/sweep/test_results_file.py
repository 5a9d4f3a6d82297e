from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from skfem_textile.sweep import sweep
from tests.helpers import full_disk
from tests.helpers.sweep_cases import FOREIGN, FORGED, lines, with_checksum
from tests.sweep.calls import square

NOT_OF_SWEEP = "not written by a sweep"


def sevenths(n):
    return {"value": n / 7}


RESULTS = {n: sevenths(n) for n in range(6)}


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out.jsonl"


def test_results_are_written_as_soon_as_they_are_computed(out, thread):
    read = Event()

    def waits(n):
        return n if n < 2 or read.wait(60) else None

    results = sweep(waits, range(3), thread, out=out)
    assert [next(results), next(results)] == [(0, 0), (1, 1)]
    assert lines(out) == [{"case": str(n), "found": n} for n in range(2)]
    read.set()
    assert list(results) == [(2, 2)]
    assert len(lines(out)) == 3


def test_an_interrupted_sweep_does_not_repeat_finished_cases(out):
    calls, broken_off = Counter(), Event()

    def counted(n):
        calls[n] += 1
        assert n < 5 or broken_off.wait(60)
        return n

    with ThreadPoolExecutor(1) as executor:
        with closing(sweep(counted, range(9), executor, out=out)) as results:
            assert [next(results)[0] for _ in range(5)] == list(range(5))
        broken_off.set()
    assert max(calls) <= 5  # the rest is removed
    assert [int(line["case"]) for line in lines(out)] == list(range(5))
    calls.clear()
    with ThreadPoolExecutor(1) as executor:
        again = dict(sweep(counted, range(9), executor, out=out))
    assert set(calls) == set(range(5, 9))
    assert again == {n: n for n in range(9)}
    assert len(lines(out)) == 9


INVALID = [*map(with_checksum, FORGED)]
OTHER = with_checksum(b'{"case": "2", "found": 4')

# Content of a file for the lines of a whole one, cases that run again, and the report.
DAMAGED = {
    "torn": (lambda *x: b"".join(x)[:-4], [5], "6 are damaged"),
    "without its end": (lambda *x: b"".join(x)[:-1], [5], "6 are damaged"),
    "without a line": (lambda *x: b"".join(x[1:]), [0], ""),
    "edited": (lambda *x: b"".join(x).replace(b"0.28", b"0.29"), [2], "3 are damaged"),
    "with a note": (lambda *x: b"".join(x) + b"a note", [], "7 are damaged"),
    "with notes": (
        lambda *x: b"".join(x) + b"a note\n" * 8,
        *([], "7, 8, 9, 10, 11, and 3 more are damaged"),
    ),
    "with two results": (
        lambda *x: b"".join(x) + OTHER + x[0],
        [2],
        "3, 7 are damaged",
    ),
    **{
        f"invalid {i}": (lambda *x, line=line: b"".join(x) + line, [], "7 are damaged")
        for i, line in enumerate(INVALID)
    },
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_lines_are_reported_and_their_cases_repeated(out, thread, caplog, name):
    damaged, repeated, report = DAMAGED[name]
    calls = []

    def called(n):
        calls.append(n)
        return sevenths(n)

    list(sweep(called, range(6), thread, out=out))
    content = damaged(*out.read_bytes().splitlines(keepends=True))
    out.write_bytes(content)
    calls.clear()
    assert dict(sweep(called, range(6), thread, out=out)) == RESULTS
    assert calls == repeated
    assert ("line(s)" in caplog.text) == bool(report)
    assert report in caplog.text
    torn = name in ("torn", "without its end")
    kept = content[: content.rindex(b"\n") + 1] if torn else content
    assert out.read_bytes().startswith(kept)
    if torn:
        assert len(lines(out)) == 6


@pytest.mark.parametrize(
    "content", [*filter(None, FOREIGN), b"{", b'{"case": "of a lawyer", "found": 1']
)
def test_another_kind_of_file_is_rejected_and_left_unchanged(out, thread, content):
    out.write_bytes(content)
    with pytest.raises(ValueError, match=NOT_OF_SWEEP):
        list(sweep(sevenths, range(6), thread, out=out))
    assert out.read_bytes() == content


def test_a_second_sweep_on_one_file_is_rejected(out, thread):
    with closing(sweep(square, range(3), thread, out=out)) as first:
        assert next(first) == (0, 0)
        with pytest.raises(BlockingIOError, match="another run is writing to"):
            next(sweep(square, range(3), thread, out=out))
    assert len(list(sweep(square, range(3), thread, out=out))) == 3


def test_a_full_disk_is_reported_and_the_next_sweep_continues(out, thread, monkeypatch):
    message = (
        "cannot write results to .*/out.jsonl: No space left on device; .*resume it"
    )
    results = sweep(square, range(3), thread, out=out)
    next(results)
    with monkeypatch.context() as patch:
        patch.setattr("skfem_textile.sweep.open", full_disk, raising=False)
        with pytest.raises(OSError, match=message):
            next(results)
    assert len(lines(out)) == 1
    assert len(list(sweep(square, range(3), thread, out=out))) == 3


def test_a_path_that_is_not_a_file_is_rejected(tmp_path, thread):
    for path in (tmp_path, Path("/dev/zero")):
        with pytest.raises(ValueError, match=NOT_OF_SWEEP):
            next(sweep(square, range(3), thread, out=path))


def test_names_of_cases_on_file_are_unique_and_permanent(out, thread):
    with pytest.raises(ValueError, match="two cases have the name 1"):
        list(sweep(square, [1, 2, 1], thread, out=out))
    with pytest.raises(ValueError, match="pass a key that returns the same name"):
        list(sweep(lambda _: 0, [square], thread, out=out))
    named = sweep(lambda f: 0, [len], thread, out=out, key=lambda f: f.__name__)
    assert list(named) == [(len, 0)]


def test_arrays_are_written_as_lists_and_unsupported_objects_are_named(out, thread):
    array = sweep(lambda n: {"u": np.arange(n), "n": n}, [np.int64(2)], thread)
    assert isinstance(next(array)[1]["u"], np.ndarray)
    on_file = sweep(lambda n: {"u": np.arange(n)}, [2], thread, out=out)
    assert list(on_file) == [(2, {"u": [0, 1]})]
    with pytest.raises(TypeError, match="cannot write a object"):
        list(sweep(lambda _: object(), [3], thread, out=out))
