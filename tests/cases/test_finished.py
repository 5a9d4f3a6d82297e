"""Finished runs are read from their folders, and other folders are refused by name."""

import json
import shutil

import numpy as np
import pytest

from skfem_textile.cases import read_result
from skfem_textile.cases.finished import read_summary
from skfem_textile.cli import main as cli
from skfem_textile.solve import interval
from tests.helpers.intervals import OMITTED

DOME = "hemisphere --size 2x2 --steps 2 --fibres 20 --checkpoint --no-render"


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(interval, "error_interval", lambda *_: OMITTED)
        words = ["run", *DOME.split(), "--out", str(folder)]
        assert cli.main(words) == 0
    return folder


@pytest.fixture
def copied(finished, tmp_path):
    return shutil.copytree(finished, tmp_path / "out")


@pytest.mark.dear("the run of this module, and the set-up of one from its checkpoint")
def test_the_last_state_is_read_from_fields_or_from_the_checkpoint(copied):
    moved_by(1 + 3e-10, last(copied))  # of rounding
    read = read_result(copied)
    assert read.load_factor == 1.0
    assert read.u.shape == (3 * read.ply.mesh.nvertices,)
    assert (
        read.summary
        == read_summary(copied)
        == json.loads((copied / "summary.json").read_text())
    )
    shutil.rmtree(copied / "fields")
    again = read_result(copied)
    assert again.load_factor == 1.0
    assert again.u == pytest.approx(read.u, abs=1e-9)
    heights = read.ply.nodal(again.u)[2]
    assert np.ptp(heights) > 1.0
    shutil.rmtree(copied / "checkpoint")
    with pytest.raises(ValueError, match=r"neither fields/steps\.pvd nor a checkpoint"):
        read_result(copied)


def last(folder):
    return max((folder / "fields").glob("step_*.vtu"))


def moved_by(factor, file):
    """Scale the positions of a file of fields."""
    import meshio

    grid = meshio.read(file)
    grid.points = grid.points * factor
    grid.write(file)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda x: (x / "case.toml").unlink(), r"out[/\\]checkpoint is a checkpoint"),
        (lambda x: (x / "case.toml").write_text("[scene]"), "not written by a run"),
        (lambda x: (x / "summary.json").write_text("{}"), "is not the summary of a ru"),
        (lambda x: (x / "summary.json").write_text("["), "is not the summary of a run"),
        (lambda x: (x / "summary.json").unlink(), "summary.json is missing: name the"),
        (lambda x: (x / "fields/steps.pvd").write_text(""), "pvd lists no states"),
        (lambda x: (x / "fields/steps.pvd").write_bytes(b"\xff"), "is damaged: it is"),
        (lambda x: last(x).write_text("<"), "cannot be read"),
        (lambda x: moved_by(1 + 1e-8, last(x)), "not belong to the"),
    ],
)
def test_damaged_results_are_refused_by_the_name_of_the_file(copied, damage, message):
    damage(copied)
    with pytest.raises(ValueError, match=message):
        read_result(copied)


def test_the_folder_of_a_net_or_a_checkpoint_is_refused(copied, tmp_path):
    with pytest.raises(ValueError, match=r"case\.toml is missing: name the results"):
        read_result(tmp_path)
    with pytest.raises(ValueError, match="checkpoint without the case of its run"):
        read_summary(copied / "checkpoint")
    (tmp_path / "net.vtu").touch()
    with pytest.raises(ValueError, match="is the folder of a net, not of a run"):
        read_result(tmp_path)
