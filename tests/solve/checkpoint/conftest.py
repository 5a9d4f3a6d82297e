"""Checkpoints of finished and interrupted runs."""

import shutil
from pathlib import Path

import pytest

from tests.helpers import sheared_runs
from tests.helpers.strip_runs import interrupted, stepper


@pytest.fixture(scope="session")
def half_done(tmp_path_factory):
    """The checkpoint of a run that was interrupted half-way; read-only."""
    folder = tmp_path_factory.mktemp("half done") / "c"
    interrupted(0.5, stepper, folder)
    return folder


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """The checkpoint of a run that was finished; read-only."""
    folder = tmp_path_factory.mktemp("finished") / "c"
    stepper(folder).run()
    return folder


@pytest.fixture
def done(finished, tmp_path):
    """A copy of the checkpoint of a run that was finished."""
    return Path(shutil.copytree(finished, tmp_path / "c"))


@pytest.fixture
def half(half_done, tmp_path):
    """A copy of the checkpoint of a run that was interrupted half-way."""
    return Path(shutil.copytree(half_done, tmp_path / "c"))


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """The checkpoint of a run with several states; read-only."""
    folder = tmp_path_factory.mktemp("sheared") / "run"
    interrupted(0.6, sheared_runs.stepper, folder)
    return folder


@pytest.fixture
def run(made, tmp_path):
    """A copy of ``made``."""
    return shutil.copytree(made, tmp_path / "c")
