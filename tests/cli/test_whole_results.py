"""Full disks, closed pipes and killed runs give one line and complete results."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from skfem_textile import Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.cli import main as cli
from skfem_textile.cli.main import command_parser
from skfem_textile.cli.output import OutputError
from skfem_textile.cli.run import run
from skfem_textile.io import write_fields, write_history
from skfem_textile.scenes import strip
from tests.helpers import full_disk
from tests.helpers.command_line import OF_CHILD, QUICK, is_whole

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="locks are POSIX's"),
    pytest.mark.usefixtures("no_interval"),
]


def test_a_summary_never_lists_missing_files(tmp_path, monkeypatch):
    """Checked before every change of the folder, a shorter run after a longer one."""
    out, listed = tmp_path / "out", []

    def watched(change, plain):
        def watch(path, *arguments, **options):
            if out in path.parents:
                listed.append((change, is_whole(out)))
            return plain(path, *arguments, **options)

        return watch

    options = ("run", "strip", *QUICK, "--out", str(out))
    assert cli.main(options) == 0
    for change in ("unlink", "replace", "mkdir"):
        monkeypatch.setattr(Path, change, watched(change, getattr(Path, change)))
    assert cli.main([*options, "--steps", "2"]) == 0
    assert {*listed} == {("unlink", True), ("replace", True), ("mkdir", True)}
    assert is_whole(out)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "the run cannot be resumed, because --checkpoint was not given"),
        (("--checkpoint",), "/checkpoint remains: resume the run with --resume"),
    ],
)
def test_a_full_disk_is_reported_with_the_remaining_files(
    tmp_path, capsys, monkeypatch, options, message
):
    out = tmp_path / "out"
    command = ["run", "strip", *QUICK, "--steps", "1", "--out", str(out)]
    assert cli.main(command) == 0
    before = (out / "summary.json").read_text()
    capsys.readouterr()
    with monkeypatch.context() as patch:
        patch.setattr("meshio.Mesh.write", full_disk)
        assert cli.main([*command, *options]) == 1
    printed, stderr = capsys.readouterr()
    assert printed == ""
    assert stderr.startswith(
        f"skfem-textile: error: cannot write results to {out}: No space left on device;"
    )
    assert stderr.endswith(message + "\n")
    assert stderr.count("\n") == 1
    assert (out / "summary.json").read_text() == before
    assert is_whole(out)
    assert not list(out.glob(".unfinished-*"))
    if options:
        assert cli.main([*command, "--resume"]) == 0


@pytest.mark.parametrize("write", [write_fields, write_history])
def test_writing_one_file_to_a_full_disk_names_its_path(tmp_path, monkeypatch, write):
    scene = strip(size=(3, 4))
    ply = Ply(scene.mesh, Fabric(), OnePoint(10.0))
    result = LoadStepper(ply, scene.conditions, 1).run()
    monkeypatch.setattr("meshio.Mesh.write", full_disk)
    monkeypatch.setattr("skfem_textile.io.results.write_table", full_disk)
    with pytest.raises(OSError, match=r"No space left on device: '.*/out'"):
        write(result, tmp_path / "out")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize(
    "word",
    [pytest.param("list", marks=pytest.mark.slow), "--help"],
)
def test_a_failure_to_print_is_reported_in_one_line(word):
    with open("/dev/full", "w") as stdout:
        child = subprocess.run(
            [sys.executable, "-m", "skfem_textile", word],
            stdout=stdout,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
            env=OF_CHILD,
        )
    assert child.returncode == 1
    reason = "cannot write to the standard output: No space left on device"
    assert child.stderr == f"skfem-textile: error: {reason}\n"


def test_results_are_written_if_nothing_can_be_printed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("builtins.print", full_disk)
    monkeypatch.setattr("skfem_textile.cli.output.silence", lambda _: None)
    line = "run", "strip", *QUICK, "--out", str(tmp_path / "out")
    with pytest.raises(OutputError, match="cannot write to the standard output"):
        run(command_parser(line).parse_args(line))
    assert (tmp_path / "out" / "summary.json").exists()
