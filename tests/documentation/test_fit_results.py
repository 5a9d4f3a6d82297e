"""The page on the summary of a fit contains the keys that are written, no others."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from skfem_textile import Bilinear, Fabric, Linear, Sin2, WithFriction
from skfem_textile.calibration import (
    BendingCurve,
    BiasExtension,
    CantileverTest,
    Choice,
    PictureFrame,
    Simulation,
    Specimen,
    Strip,
    Zeros,
    fit_tests,
    report,
    validate,
)
from skfem_textile.calibration.selection import Candidate
from skfem_textile.calibration.solving import PARTS
from skfem_textile.cli.fit_report import Reported
from skfem_textile.fabric import along

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "fit-results.md"


def described(section):
    """Keys in the first column of the table of a section."""
    text = PAGE.read_text(encoding="utf-8")
    parts = dict(re.findall(r"^#+ (.+)\n((?:(?!^#).*\n)*)", text, re.M))
    rows = re.findall(r"^\| (`.+?) \|", parts[section], re.M)
    return [key for row in rows for key in re.findall(r"`([^`]+)`", row)]


def written(x, at=""):
    """Paths of the values in a report; lists of numbers and laws are values."""
    if isinstance(x, dict) and not at.endswith("law"):
        for key, value in x.items():
            yield from written(value, f"{at}.{key}" if at else key)
    elif isinstance(x, list) and any(isinstance(one, dict) for one in x):
        for one in x:
            yield from written(one, f"{at}[]")
    elif x != [] or not at.endswith(("curves", "zeros", "candidates")):
        yield at


@pytest.fixture(scope="module")
def reported():
    """Reports of a fit to all kinds of tests, and of a prediction."""
    test, rng = BiasExtension(100.0, 200.0), np.random.default_rng(1)
    gamma = np.radians(np.linspace(1.0, 40.0, 20))
    force = test.force(Sin2(0.3), gamma)
    moved, pull = test.displacement(gamma), np.linspace(0.0, 4.0, 20)
    three = [
        Specimen(f"{i}", test, force + rng.normal(0.0, 0.1, 20), moved)
        for i in range(3)
    ]
    curvature = np.linspace(0.0, 1e-2, 20)
    moment = Bilinear(100.0, 2e-3, 20.0).value(curvature)
    others = [
        Strip("warp", "warp", 50.0, 200.0, displacement=pull, force=500.0 * pull),
        CantileverTest("bend", np.array([200.0, 201.0]), np.array([0.7, 0.71]), 6e-6),
        BendingCurve("weft", curvature, moment, "weft"),
    ]
    three[0] = replace(three[0], zeros=Zeros(None, 0.0))
    choice = Choice(shear="sin2", tension="linear")
    compared = {"shear": [Candidate("sin2", 1, 0.01, 0.001)]}
    found = replace(fit_tests([*three, *others], choice), candidates=compared)
    tests = [replace(three[1], name="held")]
    predicted = validate(found, Fabric(1e5), tests, Simulation(across=2, steps=2))
    return Reported(
        report.reports_of(found),
        report.data_report(found, tests),
        report.joint_report(found),
        report.validation_report(predicted),
    )


def test_the_page_has_the_keys_of_every_law(reported):
    keys = {key for one in reported.laws.values() for key in written(one)}
    sections = "Laws", "Curves", "Shear, tension, bending"
    listed = [key for section in sections for key in described(section)]
    assert sorted(listed) == sorted(keys)
    titles = {report.title_of(part) for part in PARTS}
    assert titles == {*re.findall(r"`([A-Z]\w+(?: \w+)*)`", PAGE.read_text())}


def test_the_page_has_the_keys_of_friction():
    there = np.linspace(0.0, 0.6, 30)
    path = np.concatenate([there, there[-2::-1]])
    shear = WithFriction(Sin2(0.3), [0.02], [0.1])
    frame = PictureFrame(200.0, 160.0)
    force = frame.arms(path)[0][1] * along(shear, path)[0]
    moved = frame.displacement(path)
    tension = WithFriction(Linear(1e3), [0.5], [1e-3])
    strain = 0.02 * path
    pull = 50.0 * along(tension, strain)[0] * np.exp(-strain)
    tests = [
        Specimen("shear", frame, force, moved, cyclic=True),
        Strip("warp", "warp", 50.0, 1.0, np.expm1(strain), pull, cyclic=True),
    ]
    bending = WithFriction(Linear(6.0), [0.01], [1e-3])
    curvature = 0.05 * path
    tests.append(
        BendingCurve("bend", curvature, along(bending, curvature)[0], cyclic=True)
    )
    found = fit_tests(tests, Choice(shear="sin2", tension="linear"))
    reports = report.reports_of(found).values()
    keys = {f"friction.{key}" for one in reports for key in written(one["friction"])}
    assert sorted(described("Friction")) == sorted(keys)


def test_the_page_has_the_keys_of_a_prediction(reported):
    assert sorted(described("Predictions")) == sorted({*written(reported.validation)})


def test_the_page_has_all_other_keys(reported):
    rest = reported._asdict() | {"laws": 0, "validation": 0, "inputs": 0}
    assert sorted(described("Summary of a fit")) == sorted({*written(rest)})
