import hashlib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from skfem_textile.solve.sweep import sweep
from tests.helpers import full_disk
from tests.helpers.sweep_cases import lines
from tests.sweep.calls import square

FOREIGN = "not written by a sweep"


def sevenths(n):
    return {"value": n / 7}


RESULTS = {n: sevenths(n) for n in range(6)}


@pytest.fixture
def out(tmp_path):
    return tmp_path / "out.jsonl"


@pytest.fixture
def swept(out, thread):
    """A whole file; called, returns the results of a sweep into it."""

    def swept():
        return dict(sweep(sevenths, range(6), thread, out=out))

    swept()
    return swept


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


def test_a_torn_last_line_is_dropped_and_its_case_repeated(out, thread, swept):
    whole, calls = out.read_bytes(), []

    def called(n):
        calls.append(n)
        return sevenths(n)

    for torn in (1, 4, len(whole.splitlines()[-1])):
        out.write_bytes(whole[:-torn])
        calls.clear()
        assert dict(sweep(called, range(6), thread, out=out)) == RESULTS
        assert calls == [5]
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
def test_another_kind_of_file_is_rejected_and_left_unchanged(out, swept, text):
    out.write_text(text)
    with pytest.raises(ValueError, match=FOREIGN):
        swept()
    assert out.read_text() == text


def test_a_damaged_line_is_reported_and_its_case_repeated(out, swept, caplog):
    whole = out.read_bytes().splitlines(keepends=True)
    edited = whole[2].replace(b"0.28", b"0.29")
    assert edited != whole[2]
    out.write_bytes(b"".join([*whole[:2], edited, *whole[3:]]))
    assert swept() == RESULTS
    assert "line(s) 3 are damaged" in caplog.text
    assert out.read_bytes().splitlines(keepends=True)[-1] == whole[2]


def test_five_of_many_unused_lines_are_reported(out, swept, caplog):
    out.write_bytes(out.read_bytes() + b"a note\n" * 8)
    assert swept() == RESULTS
    assert "line(s) 7, 8, 9, 10, 11, and 3 more are damaged" in caplog.text


def test_two_results_of_one_case_are_reported_and_neither_is_used(
    tmp_path, thread, out, swept, caplog
):
    other = tmp_path / "other.jsonl"
    list(sweep(square, [2], thread, out=other))
    first = out.read_bytes().splitlines(keepends=True)[0]
    out.write_bytes(out.read_bytes() + other.read_bytes() + first)
    assert swept() == RESULTS
    assert "line(s) 3, 7 are damaged" in caplog.text


def test_additions_to_a_file_are_not_cut_off(out, swept, caplog):
    whole = out.read_bytes()
    out.write_bytes(whole + b"a note of mine")
    assert swept() == RESULTS
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
def test_an_invalid_line_is_reported_with_any_digest(out, swept, caplog, start):
    start += b', "digest": "'
    forged = start + hashlib.sha256(start).hexdigest()[:16].encode() + b'"}\n'
    out.write_bytes(out.read_bytes() + forged)
    assert swept() == RESULTS
    assert "line(s) 7 are damaged" in caplog.text
    out.write_bytes(forged)
    with pytest.raises(ValueError, match=FOREIGN):
        swept()
    assert out.read_bytes() == forged


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
        patch.setattr("skfem_textile.solve.sweep.open", full_disk, raising=False)
        with pytest.raises(OSError, match=message):
            next(results)
    assert len(lines(out)) == 1
    assert len(list(sweep(square, range(3), thread, out=out))) == 3


def test_a_path_that_is_not_a_file_is_rejected(tmp_path, thread):
    for path in (tmp_path, Path("/dev/zero")):
        with pytest.raises(ValueError, match=FOREIGN):
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
