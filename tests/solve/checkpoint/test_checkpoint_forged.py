"""Checkpoints edited by somebody who can compute digests, and what is no file."""

import os

import pytest

from skfem_textile import CheckpointError
from skfem_textile.solve import sealed
from tests.helpers.sheared_runs import opened, stepper


def forge(folder, number, edit):
    """Edit text and arrays of a file, and seal it and all after it anew."""
    files = [folder / "run.npz", *sorted(folder.glob("state_*"))]
    digest = ""
    for i, file in enumerate(files):
        text, arrays, (of_run, name, _) = opened(file)
        if i == number:
            edit(text, arrays)
        digest = sealed.write(file, of_run, name, digest, text, arrays)


def refusal(folder):
    with pytest.raises(CheckpointError) as refused:
        stepper(folder).run(resume=True)
    line = str(refused.value)
    assert line.isprintable()
    assert len(line) < 500 + len(str(folder))
    return line


def test_sealing_anew_alone_changes_nothing(run):
    forge(run, 1, lambda text, arrays: None)
    assert stepper(run).run(resume=True).converged


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("factor", [1.01, 1 + 3e-8])
def test_every_state_must_agree_with_its_displacement(run, number, factor):
    def edit(text, arrays):
        text["reactions"]["pull"][0] = text["reactions"]["pull"][0] * factor + (
            number == 1
        )

    forge(run, number, edit)
    line = refusal(run)
    assert f"state_{number - 1:06d}.npz" in line
    assert "its reactions are not those of its displacement" in line


@pytest.mark.parametrize("value", [0.0, [0.0], [[0.0, 0.0]]])
def test_a_vector_of_another_shape_is_refused(run, value):
    forge(run, 1, lambda text, arrays: text["displacements"].update(clamp=value))
    assert "state_000000.npz" in refusal(run)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_parameters_of_complex_numbers_are_refused(run, number):
    def edit(text, arrays):
        arrays["stabilisation C_s"] = arrays["stabilisation C_s"].astype(complex)

    forge(run, number, edit)
    assert f"state_{number - 1:06d}.npz" in refusal(run)


def test_files_of_another_format_are_refused_in_one_line(run):
    """Those of format 6 have the work of each term beside its other parameters."""

    def edit(text, arrays):
        text["work"] = {"stabilisation": 0.0}

    forge(run, 1, edit)
    forge(run, 0, lambda text, arrays: text.update(format=6))
    assert refusal(run) == (f"checkpoint {run} is of another run: format was 6, is 7")


@pytest.mark.parametrize("said", ["two\nlines \x1b[31m", "long " * 2000, 10**400])
def test_what_a_file_says_is_told_in_one_short_line(run, said):
    forge(run, 0, lambda text, arrays: text.update(method=said))
    assert "method was" in refusal(run)


@pytest.mark.parametrize("name", ["run.npz", "state_000001.npz"])
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_what_is_no_file_is_refused_and_not_waited_for(run, name):
    (run / name).unlink()
    os.mkfifo(run / name)
    assert f"{name} is no file" in refusal(run)
    (run / name).unlink()
    (run / name).symlink_to("/dev/zero")
    assert f"{name} is no file" in refusal(run)


def test_times_of_other_parts_are_refused(run):
    def edit(text, arrays):
        del text["progress"]["clock"]["seconds"]["solve"]

    forge(run, len(list(run.glob("state_*"))), edit)
    assert "its times are not those of a run" in refusal(run)
