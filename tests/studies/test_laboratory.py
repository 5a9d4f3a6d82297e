"""The study of raw files: what it draws, and what it reports."""

import numpy as np
import pytest

from skfem_textile.calibration import read_recordings
from studies.laboratory import cases, study
from studies.laboratory.cases import ANGLES, DOUBTFUL, Doubtful, File, all_cases
from studies.laboratory.machines import MACHINES, Export


def test_files_are_recorded_by_their_seed():
    one, again, other = File(3, "clean"), File(3, "clean"), File(4, "clean")
    assert one.rows() == again.rows()
    assert one.rows() != other.rows()
    assert File(3, "clean", judged=False).rows() != one.rows()


def test_every_style_and_contamination_is_judged():
    drawn = [cases._drawn(x).description for x in all_cases(1) if isinstance(x, File)]
    assert {one["machine"] for one in drawn} == set(MACHINES)
    assert len({one["separator"] for one in drawn}) == 5
    assert {one["force_unit"] for one in drawn} == {"N", "kN", "mN", "lbf"}
    assert {one["sign"] for one in drawn} == {1, -1}
    for contamination in ("toe", "hysteresis", "outliers", "force_at_rest"):
        assert {one[contamination] for one in drawn} == {True, False}
    noise = [one["noise"] for one in drawn]
    assert 0.01 <= min(noise) < 0.012
    assert 0.048 < max(noise) <= 0.05


@pytest.mark.parametrize("what", DOUBTFUL)
def test_doubtful_files_are_refused_with_their_option(what):
    for machine in MACHINES:
        (row,) = Doubtful(what, machine).rows()
        assert row["as_needed"]
        assert DOUBTFUL[what] in row["message"]


MOVED = np.linspace(0.0, 30.0, 40)
CURVES = [(MOVED, 0.1 * MOVED**2), (MOVED[:30], 0.2 * MOVED[:30])]


@pytest.mark.parametrize("machine", MACHINES)
def test_exports_of_machines_are_read_as_written(machine, tmp_path):
    file, rng = tmp_path / "test.csv", np.random.default_rng(1)
    for _ in range(10):
        export = Export.drawn(machine, rng)
        file.write_bytes(export.written(CURVES))
        recordings = read_recordings(file)
        assert len(recordings) == 2
        for recording, (moved, force) in zip(recordings, CURVES, strict=True):
            columns = recording.columns
            np.testing.assert_allclose(columns["displacement"], moved, atol=1e-3)
            np.testing.assert_allclose(columns["force"], force, atol=1e-3)
            said = recording.statements[0]
            assert ("sign of force turned" in said) == (export.sign < 0)
            assert f", {export.force_unit})" in said


def test_a_file_that_differs_from_what_was_written_is_misread(tmp_path):
    drawn = cases._drawn(File(1, "clean"))
    path = tmp_path / "test.csv"
    path.write_bytes(drawn.export.written(drawn.curves))
    assert not cases._misread(path, drawn)
    moved, force = drawn.curves[0]
    wrong = (moved, 1.01 * force), *drawn.curves[1:]
    path.write_bytes(drawn.export.written(wrong))
    assert cases._misread(path, drawn)


def test_missed_targets_are_reported():
    row = {f"inside_{a}": True for a in ANGLES}
    row |= {"judged": True, "misread": False, "case": "judged: clean, 1"}
    out = {f"inside_{a}": False for a in ANGLES}
    for share, number in ((0.95, 0), (0.90, 1), (0.99, 1)):
        n = round(100 * share)
        rows = [row | {"group": "clean"}] * n
        rows += [row | out | {"group": "clean"}] * (100 - n)
        assert len(study.missed(rows)) == number
    good = [row | {"group": "force at rest"}]
    assert study.missed(good) == []
    assert len(study.missed([good[0] | {"misread": True}])) == 1
    assert len(study.missed([good[0] | {"refused": "no"}])) == 1
    assert len(study.missed([{"case": "x", "what": "y", "as_needed": False}])) == 1


JOINT = {"case": "joint: seed 1", "seed": 1, "parameter": "shear, stiffness"}
JOINT |= {"error": 0.01, "joint": 0.014, "picture frame": 0.04, "bias extension": 0.02}


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        ({}, []),
        ({"error": -0.021}, ["error of"]),
        ({"joint": 0.021}, ["wider"]),
        ({"joint": 0.02}, ["not narrower"]),
        ({"bias extension": None, "joint": 0.04}, []),
    ],
)
def test_joint_fits_are_judged_by_their_errors_and_bands(change, texts):
    missed = study.missed([JOINT | change])
    assert all(any(text in one for one in missed) for text in texts)
    assert bool(missed) == bool(texts)


@pytest.mark.parametrize(("inside", "number"), [(89, 0), (88, 2)])
def test_predictions_are_judged_by_the_seeds_inside(inside, number):
    rows = [
        {"case": "held out: all seeds", "seed": seed, "converged_share": 0.95}
        | {f"{name}_inside": seed <= inside for name in ("converged", "same_mesh")}
        for seed in range(1, 101)
    ]
    assert len(study.missed(rows)) == number
