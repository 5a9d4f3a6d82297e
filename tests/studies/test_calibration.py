import numpy as np
import pytest

from skfem_textile.calibration import BiasExtension
from studies.laws.calibration import study
from studies.laws.calibration.cases import (
    BENCHMARK,
    TESTS,
    Benchmark,
    Coverage,
    all_cases,
    known,
    specimens,
    steps,
)
from studies.laws.calibration.study import STUDY


@pytest.fixture
def folder(tmp_path):
    """Curves of the benchmark's format, of a linear law of 0.02 N/mm."""
    for width, height in BENCHMARK:
        test = BiasExtension(width, height)
        gamma = np.radians(np.linspace(0.5, 55.0, 200))
        force = test.force(known("linear")[0].build(np.array([0.02])), gamma)
        rows = zip(test.displacement(gamma), force, strict=True)
        lines = ["displacement,   force", *(f"{x:.12g}, {y:.12g}" for x, y in rows)]
        name = f"glass_plain_{width:g}_{height:g}.csv"
        (tmp_path / name).write_text("\n".join(lines))
    return tmp_path


def test_noise_is_2_percent_of_the_largest_force_and_independent():
    tests, (model, truth) = TESTS["frame"], known("sin2")
    moved = [steps(test, 4000) for test in tests]
    forces = [
        t.force(model.build(truth), t.shear_angle(x))
        for t, x in zip(tests, moved, strict=True)
    ]
    noisy = specimens(tests, moved, forces, 1, 0.02)
    noise = [s.force - f for s, f in zip(noisy, forces, strict=True)]
    for one, force in zip(noise, forces, strict=True):
        assert one.std() == pytest.approx(0.02 * force.max(), rel=0.05)
    assert np.abs(np.corrcoef(noise) - np.eye(3)).max() < 0.06


def test_the_cramer_rao_width_is_that_of_a_fit_with_known_noise():
    """With one coefficient the width is σ/|x|, x the force of the unit law."""
    case = Coverage("frame", "linear", seeds=3)
    tests, (model, _) = TESTS["frame"], known("linear")
    moved = [steps(test) for test in tests]
    unit = [
        t.force(model.build(np.ones(1)), t.shear_angle(x))
        for t, x in zip(tests, moved, strict=True)
    ]
    forces = [0.1 * one for one in unit]
    information = sum(
        (x / (0.02 * f.max())) @ (x / (0.02 * f.max()))
        for x, f in zip(unit, forces, strict=True)
    )
    width = case.cramer_rao(forces)
    assert width[0] == pytest.approx(information**-0.5, rel=1e-6)


def test_the_benchmark_is_read_and_reduced(folder):
    for case in all_cases(folder):
        if isinstance(case, Benchmark):
            for row in case.rows():
                expected = 0.02 * np.radians(row["angle"])
                assert row["moment"] == pytest.approx(expected, rel=1e-3)


def test_missed_targets_are_reported():
    good = {"task": "coverage", "test": "frame", "law": "sin2", "parameter": "G"}
    good |= {"inside": 0.95, "width_over_cramer_rao": 1.0}
    assert study.missed([good]) == []
    assert len(study.missed([good | {"inside": 0.92}])) == 1
    assert len(study.missed([good | {"inside": 0.98}])) == 1
    assert len(study.missed([good | {"width_over_cramer_rao": 1.6}])) == 1
    for task, key, most in (
        ("inverse", "off_over_largest", 0.02),
        ("agreement", "apart", 0.02),
        ("round trip", "off", 0.03),
        ("benchmark", "off", 0.05),
    ):
        assert study.missed([{"task": task, key: -0.99 * most}]) == []
        assert len(study.missed([{"task": task, key: -1.01 * most}])) == 1
        assert len(study.missed([{"task": task, key: np.nan}])) == 1


def test_files_of_the_benchmark_are_unchanged_without_its_curves(folder):
    benchmark = {"benchmark.csv", "benchmark.md"}
    assert benchmark <= {*STUDY.written(all_cases(folder))}
    assert not benchmark & {*STUDY.written(all_cases(None))}
    assert not benchmark & {*STUDY.tables([])}
