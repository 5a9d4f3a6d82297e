"""The folder of a result is written at once, or left unchanged."""

import os
from pathlib import Path

import pytest

from skfem_textile.cli.output import OutputError
from skfem_textile.cli.result_folder import ResultFolder
from tests.helpers import full_disk

pytestmark = pytest.mark.skipif(os.name != "posix", reason="locks are POSIX's")

NAMES = ("summary.json", "picture.png", "fields/step_[0-9]*.vtu")


def test_a_result_replaces_the_previous_one_and_nothing_else(tmp_path):
    out = tmp_path / "out"
    with ResultFolder(out, NAMES) as folder:
        (folder / "fields").mkdir()
        for name in ("summary.json", "picture.png", "fields/step_0001.vtu"):
            (folder / name).write_text("old")
    (out / "fields" / "mine.pvsm").write_text("kept")
    (out / "mine").write_text("kept")
    with (results := ResultFolder(out, NAMES)) as folder:
        (folder / "fields").mkdir()
        for name in ("summary.json", "fields/step_0000.vtu"):
            (folder / name).write_text("new")
    assert results.removed_text() == "; removed from an earlier run: picture.png"
    files = {str(p.relative_to(out)): p for p in out.rglob("*") if p.is_file()}
    assert set(files) == {
        "summary.json",
        "fields/step_0000.vtu",
        "fields/mine.pvsm",
        "mine",
    }
    assert files["summary.json"].read_text() == "new"


def test_files_that_are_not_stale_stay_and_empty_folders_go(tmp_path):
    names = "summary.json", "part.csv", "deck/old/a.inp", "deck/b.inp"
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("old")
    with (results := ResultFolder(tmp_path, names)) as folder:
        results.stale = names[2:]
        (folder / "summary.json").write_text("new")
    assert results.removed == [*names[2:]]
    assert {p.name for p in tmp_path.iterdir()} == {"summary.json", "part.csv"}


def test_an_interrupted_run_leaves_the_folder_unchanged(tmp_path):
    def interrupted(out):
        with ResultFolder(out, NAMES) as folder:
            (folder / "summary.json").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted(tmp_path / "new")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "summary.json").write_text("whole")
    with pytest.raises(KeyboardInterrupt):
        interrupted(tmp_path / "old")
    assert [p.name for p in (tmp_path / "old").iterdir()] == ["summary.json"]
    assert (tmp_path / "old" / "summary.json").read_text() == "whole"


def test_obstacles_are_reported_at_once(tmp_path):
    (tmp_path / "summary.json").mkdir()
    (tmp_path / "file").write_text("")
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / "fields").write_text("")
    for path, message in [
        (tmp_path, "summary.json is a folder"),
        (tmp_path / "file", "cannot write results to .*file"),
        (tmp_path / "ours", "is not a folder"),
    ]:
        with pytest.raises(OSError, match=message):
            ResultFolder(path, NAMES)


def test_a_second_run_into_one_folder_is_rejected(tmp_path):
    out = tmp_path / "new" / "out"
    first = ResultFolder(out, NAMES)
    with pytest.raises(BlockingIOError, match=f"another run is writing to {out}"):
        ResultFolder(out, NAMES)
    with first as folder:
        with pytest.raises(BlockingIOError):
            ResultFolder(out, NAMES)
        (folder / "summary.json").write_text("{}")
    ResultFolder(out, NAMES)
    assert [p.name for p in out.iterdir()] == ["summary.json"]


def test_an_empty_folder_is_removed(tmp_path):
    out = tmp_path / "new" / "out"
    results = ResultFolder(out, NAMES)
    assert out.is_dir()
    del results
    assert list(tmp_path.iterdir()) == []


def test_files_of_others_in_a_new_folder_are_kept_on_failure(tmp_path):
    """Such a file is a checkpoint."""
    out = tmp_path / "out"
    results = ResultFolder(out, NAMES)
    (out / "checkpoint").mkdir()
    with pytest.raises(OSError, match="full"), results:
        raise OSError("full")
    assert [p.name for p in out.iterdir()] == ["checkpoint"]


def test_a_disk_that_fills_while_files_are_moved_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(Path, "replace", full_disk)
    message = r"cannot write results to .*/out: No space left on device"
    with (
        pytest.raises(OutputError, match=message),
        ResultFolder(tmp_path / "out", ["a"]) as folder,
    ):
        (folder / "a").write_text("a")
    assert not (tmp_path / "out").exists()


def test_the_next_run_removes_unfinished_files_of_a_killed_one(tmp_path):
    left, current = tmp_path / ".unfinished-left", tmp_path / "own"
    for path in (left / "fields", current):
        path.mkdir(parents=True)
        (path / "file").write_text("half a fi")
    with ResultFolder(tmp_path, ["a"]) as folder:
        (folder / "a").write_text("a")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "own"]
