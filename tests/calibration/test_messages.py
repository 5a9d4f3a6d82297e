"""Messages about tests that cannot be read or fitted."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from skfem_textile import Fabric, Linear, Polynomial
from skfem_textile.calibration import (
    BiaxialCurve,
    CantileverTest,
    Choice,
    Format,
    Preparation,
    Recording,
    Simulation,
    fit_tests,
    predict,
    prepare,
    read_biaxial,
    read_cantilever,
    read_recordings,
    read_specimens,
    validate,
)
from skfem_textile.calibration.simulation import FIBRES
from skfem_textile.calibration.solving import covariance_of
from tests.helpers import refused
from tests.helpers.fits import (
    BIAS,
    FRAME,
    QUINTIC,
    fit_shear,
    fit_tension,
    specimen,
    strip,
)

X = np.linspace(0.0, 1.0, 50)
GAMMA = np.radians(np.linspace(1.0, 40.0, 60))
SOFTENING = Polynomial((0.3, 0.0, -0.9, 0.0, 0.8))
DATA, ON_FRAME = specimen(BIAS, QUINTIC, GAMMA), specimen(FRAME, QUINTIC, GAMMA)
STRIP = strip(Linear(2e3), np.linspace(0.0, 6.0, 80), 0.005)
WARP = STRIP.displacement / 200.0
PULL = BiaxialCurve("one", np.array([WARP, WARP]), np.array([WARP, WARP]), (1.0, 1.0))


def prepared(moved, force, **choices):
    columns = {"displacement": np.asarray(moved), "force": np.asarray(force)}
    recording = Recording("one", columns, np.arange(2, 2 + len(moved)), ())
    return prepare(recording, "displacement", ["force"], Preparation(**choices))


CYCLES = np.concatenate([X[:25], X[24::-1], X])
MOVED, FEW = DATA.displacement, specimen(BIAS, QUINTIC, GAMMA[::25])
SOFT = specimen(FRAME, SOFTENING, np.radians(np.linspace(1.0, 55.0, 60)), 0.01)
WITH_A_POLE = replace(ON_FRAME, force=GAMMA * np.append(np.ones(59), 200.0))
FALLING = replace(STRIP, force=STRIP.force * (1.3 - 0.15 * STRIP.displacement))
STILL = replace(PULL, strain=0 * PULL.strain)
PUSHED = replace(PULL, force=-PULL.force)
READING = CantileverTest("a", np.ones(1), np.ones(1), 6e-6)
BELOW = {"stiffness": (-2, -1)}
ALIKE = np.transpose([X, X * (1 + 1e-14 * X)])


def other(**columns):
    """The bias extension with other columns."""
    return [replace(DATA, **columns)]


#: Rows (function, arguments, options, message).
FITS = [
    (fit_shear, ([DATA], "cubic"), {}, "unknown law 'cubic': choose one of polynom"),
    (fit_shear, ([DATA],), {"degree": 4}, "must be an odd number"),
    (fit_shear, ([DATA],), {"up_to": -1.0}, "must be positive, got -57.2958 degrees"),
    (fit_shear, ([DATA],), {"bounds": {"c2": (0, 1)}}, "no parameter 'c2'"),
    (fit_shear, ([DATA], "linear"), {"bounds": BELOW}, "leave no number between"),
    (fit_shear, ([FEW],), {}, "3 points are too few for the 3 parameters"),
    (fit_shear, ([DATA], "tabulated"), {"points": 0}, "at least one point"),
    (fit_shear, ([ON_FRAME],), {"simulation": Simulation()}, "only bias-extension tes"),
    (Simulation, (), {"across": 5}, "even and at least 2"),
    (fit_shear, (other(force=-DATA.force),), {}, "one: the forces must be positive"),
    (fit_shear, (other(force=0 * GAMMA + 3),), {}, "one: the force is 3 N at every"),
    (fit_shear, (other(displacement=-MOVED),), {}, "between 0 .* angles range from -2"),
    (fit_shear, (other(displacement=1e3 * MOVED),), {}, "all displacements are beyond"),
    (fit_shear, (other(measured_angle=60 * GAMMA),), {}, "2400 degrees, but the test"),
    (covariance_of, (ALIKE, np.ones(50)), {}, "parameters are not identifiable"),
    (fit_shear, ([SOFT],), {}, "law polynomial of the shear is not .*decreases betwee"),
    (fit_shear, ([WITH_A_POLE], "locking"), {}, "its pole is at the end of the data"),
    (fit_tension, ([FALLING], "tabulated"), {"points": 4}, "tabulated of the warp"),
    (fit_tests, ([],), {}, "no test is given"),
    (fit_tension, ([STRIP], "crimp-interchange"), {}, "use biaxial tests alone"),
    (fit_tension, ([STRIP],), {"extrapolation": "linear"}, "omit the extrapolation"),
    (replace, (STRIP,), {"family": "fill"}, "the family must be warp or weft"),
    (fit_tension, ([PULL], "sin2"), {}, "unknown law 'sin2': choose one of crimp-toe"),
    (fit_tension, ([STILL],), {}, "no test contains a positive strain of the warp"),
    (fit_tension, ([PUSHED],), {}, "forces along the warp must be positive"),
    (fit_tests, ([READING],), {}, "1 points are too few for the 1 parameters"),
    (Preparation, (), {"slack": np.nan}, "must be finite, got"),
    (Preparation, (), {"branch": "up"}, "the branch must be one of loading"),
    (Preparation, (), {"cycle": 0}, "numbered from 1 on"),
    (prepared, (CYCLES, CYCLES), {"cycle": 3}, "no loading of cycle 3: the test has 2"),
]


@pytest.mark.parametrize(("call", "arguments", "options", "message"), FITS)
def test_what_cannot_be_fitted_is_refused(call, arguments, options, message):
    refused(partial(call, *arguments, **options), message)


def test_only_shear_tests_with_displacements_are_predicted():
    base, sheared = Fabric(FIBRES), fit_shear([ON_FRAME])
    pulled = fit_tests([STRIP], Choice(tension="linear"))
    refused(partial(predict, pulled, base, BIAS, GAMMA), "requires a fitted shear law")
    angles = replace(ON_FRAME, displacement=None, measured_angle=GAMMA)
    message = "one: only bias extensions and picture"
    refused(partial(validate, sheared, base, [angles]), message)


def written(tmp_path, text, name="test.csv"):
    file = tmp_path / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def rows(**columns):
    """A table of columns, named with their units."""
    cells = zip(*columns.values(), strict=True)
    lines = (";".join(f"{x:.4f}" for x in row) for row in cells)
    return "\n".join([";".join(columns), *lines])


NOISE = np.random.default_rng(3).standard_normal(200)
RISE = np.linspace(0.0, 30.0, 200)
STRAIN_BESIDE = {"Strain1 (mm)": 0.05 * NOISE, "Load (N)": RISE, "Extension (mm)": RISE}

FILES = [
    ("", "the file is empty"),
    (
        "displacement,force (N)\n1,2\n",
        "'displacement' must be one of mm, .* it has none: .*--unit displacement",
    ),
    ("force (pound)\n1\n", "'force' must be one of N, .* got 'pound': convert"),
    ("force (kg)\n1\n", "got 'kg': use --unit force=kgf for the weight"),
    ("Усилие (Н),Путь (мм)\n1,2\n", "the columns are named Усилие, Путь: specify"),
    ("1;2\n2;3\n", "row 1: the columns have no headings: .*--column force=2"),
    ("force (N),load (N)\n1,2\n", r"column 1 \('force'\) and column 2 \('load'\)"),
    ("force (N),displacement (mm)\n", "the file contains no rows"),
    ("force (N),displacement (mm)\n1,2\n1\n", "row 3: expected 2 .* got '1'"),
    ("force (N),displacement (mm)\nnan,2\n3,4\n", "row 2: expected 2 cells"),
    ("force (N),displacement (mm)\n2,3\n1e200,2\n", "row 3: expected 2 cells"),
    ("displacement (mm)\n1\n", "the column 'force' is missing: .*--column force=2"),
    (
        "shear angle (deg),normalised shear force (N/mm)\n1,2\n",
        "is already a law, and needs no fit",
    ),
    ("force (N)\n1\n", "a column 'displacement' or 'shear angle'"),
    ("displacement (N),force (mm)\n1,2\n", "whether columns are swapped"),
    (
        "displacement (mm);force (N)\n1,234;2,345\n2,234;4,345\n",
        "'1,234' may be 1.234 or 1234, .* --decimal ',' .* --decimal '.'",
    ),
    (
        "displacement (mm);force (N)\n1,2;2.3\n2,2;4.3\n",
        "numbers such as '1,2' and '2.3' have different decimal marks",
    ),
    (
        "displacement (mm),force (N)\n0,5,1,5\n1,5,2,5\n",
        "row 2: 4 numbers have no headings, or commas both separate columns",
    ),
    (
        "displacement (mm);force (N)\n0;-9\n1;-8\n2;-7\n3;-5\n4;-3\n5;-1\n",
        "force is negative and its magnitude decreases.*--sign force=-1",
    ),
    (b"PK\x03\x04abc", "the file is a workbook: save the sheet"),
    (b"\x00\x01\x02\x80\x00", "not a text file|no rows of numbers"),
    (
        rows(**{"Weg (mm)": np.cos(np.arange(200) / 4), "Kraft (N)": RISE}),
        "column 1 .* not larger than its scatter.*: specify another column",
    ),
    (
        rows(**{"Weg (mm)": RISE, "Kraft (N)": 5 + NOISE}),
        r"column 2 \('Kraft'\) contains noise, not the force",
    ),
]


@pytest.mark.parametrize(("text", "message"), FILES, ids=[row[1] for row in FILES])
def test_files_that_cannot_be_read_are_refused_in_one_line(tmp_path, text, message):
    file = written(tmp_path, text)
    assert "test.csv" in refused(partial(read_specimens, file, BIAS), message)


SIZE = "Größe (mm),force (N)\n1,2\n"
OPTIONS = [
    (SIZE, {"units": {"time": "s"}}, "--unit time: unknown column: choose one of"),
    (SIZE, {"separator": "x"}, "the separator must be one of"),
    (SIZE, {"decimal": ";"}, "the decimal mark must be . or ,"),
    (SIZE, {"columns": {"force": 7}}, "there are 2 columns, and no column 7"),
    (SIZE, {"columns": {"force": "F"}}, "no column is named 'F'"),
    (SIZE, {"encoding": "ascii"}, "not in the encoding 'ascii'"),
    (
        rows(**STRAIN_BESIDE),
        {"columns": {"displacement": 1}},
        r"column 1 \('Strain1'\) contains noise, not displacement: .*column 3 "
        r"\('Extension'\) with --column displacement=3",
    ),
    (
        rows(**{"strain (-)": 0.01 + 0 * RISE, "force (N)": RISE}),
        {},
        "column 1 .* contains noise, not strain",
    ),
]


@pytest.mark.parametrize(("text", "form", "message"), OPTIONS)
def test_options_that_do_not_suit_a_file_are_refused(tmp_path, text, form, message):
    file = written(tmp_path, text)
    refused(lambda: read_recordings(file, Format(**form)), message)


def test_a_slack_requires_a_displacement(tmp_path):
    angles = written(tmp_path, "shear angle (deg),force (N)\n1,2\n5,9\n", "angles.csv")
    text = "warp strain (-),warp force (N),weft strain (-),weft force (N)\n0,1,0,1\n"
    strains = written(tmp_path, text, "strains.csv")
    given, zero = Preparation(slack=2.0), Preparation(slack=0.0)
    message = "a slack of 2 mm requires a displacement, .* contains {}: omit --slack"
    shear = partial(read_specimens, angles, BIAS)
    pull = partial(read_biaxial, strains, (100.0, 100.0))
    refused(partial(shear, choices=given), message.format("shear angles"))
    refused(partial(pull, choices=given), message.format("strains"))
    assert shear(choices=zero)[0].slack == 0.0
    assert not pull(choices=zero)[0].slack_is_unknown


@pytest.mark.parametrize(("n", "at"), [(8, [4]), (60, [30, 31, 32])])
def test_overloads_that_are_not_outliers_of_a_curve_are_refused(n, at):
    x = np.linspace(0.0, 30.0, n)
    force = x**2 + 1.0
    force[at] = 99999.0
    named = ", ".join(str(2 + i) for i in at)
    refused(partial(prepared, x, force), f"force of 99999 in rows? {named} is far")
    assert prepared(x, force, outliers=False).recording.rows.size == n


HEADINGS = "overhang (mm),chord angle (deg)"
FIXED = {"angle": np.radians(41.0)}
CANTILEVERS = [
    ("overhang (mm)\n200\n", {}, "either in the column 'chord angle' or"),
    ("chord angle (deg)\n41\n", {}, "the column 'overhang' is missing"),
    (f"{HEADINGS}\n200,89\n", {}, "between 0.5 and 85 degrees, got angles from 89"),
    (f"{HEADINGS}\n-1,40\n", {}, "must be positive"),
    ("overhang,chord angle (deg)\n1,40\n", {}, "one of mm, cm, m, in, and it has none"),
    ("overhang (mm)\n1\n", {"weight": 0.0, **FIXED}, "must be a positive number"),
    ("overhang (mm)\n1\n", {"weight": 600, **FIXED}, "give 5.884e-06 N/mm2"),
]


@pytest.mark.parametrize(("text", "how", "message"), CANTILEVERS)
def test_invalid_cantilevers_are_refused(tmp_path, text, how, message):
    file = written(tmp_path, text)
    refused(partial(read_cantilever, file, **{"weight": 1e-6, **how}), message)
