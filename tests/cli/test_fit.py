"""The command ``fit``: from curves of tests to a fabric that runs can read."""

import numpy as np
import pytest

from skfem_textile import CrimpToe, Linear
from skfem_textile.cli.options import TESTS
from skfem_textile.fabric.files import read_law
from skfem_textile.io import read_fabric
from tests.helpers.command_line import fit, rejected, run, summary_in
from tests.helpers.curves import (
    BIAS,
    BIAXIAL,
    QUINTIC,
    joint_file,
    shear_file,
    shear_files,
    write_columns,
)
from tests.helpers.fits import FRAME
from tests.helpers.pages import Page

SIZES, FRAME_SIZES = "--width 100 --height 200", "--frame-side 200 --fabric-side 160"
ZEROS = "--slack 0 --force-at-rest 0"
WIDTHS = "--warp-width 100 --weft-width 100"


def pull(path, force):
    """A biaxial test in which both families have a force as a function of strain."""
    e = np.linspace(0.0, 0.02, 15)[1:]
    return write_columns(path, BIAXIAL, e, force(e), e, force(e))


@pytest.mark.parametrize(
    ("kind", "test", "sizes"),
    [
        ("bias-extension", BIAS, SIZES),
        ("picture-frame", FRAME, FRAME_SIZES),
    ],
)
def test_a_fit_writes_a_law_that_a_run_reads(kind, test, sizes, tmp_path, capsys):
    data, out = shear_files(tmp_path, test), tmp_path / "fit"
    fit(kind, *data, sizes, ZEROS, "--out", out)
    names = {file.name for file in out.iterdir()}
    assert names == {"law.json", "fabric.json", "report.html", "summary.json"}
    law = read_law(out / "law.json")
    assert read_fabric(out / "fabric.json").fabric.shear_law == law
    gamma = np.radians([10.0, 40.0])
    np.testing.assert_allclose(law.value(gamma), QUINTIC.value(gamma), rtol=0.1)
    largest = summary_in(out)["laws"]["Shear"]["largest_angle_deg"]
    assert largest == pytest.approx(40.0)
    assert "read: separator comma" in capsys.readouterr().out
    quick = "--size", "2x3", "--steps", "1", "--no-render", "--tension-law", "linear"
    assert run(tmp_path, *quick, "--shear-law", str(out / "law.json")) == 0


def test_tension_and_shear_are_fitted_into_one_fabric(tmp_path, capsys):
    """Each fit lists the properties that it does not fit."""
    default = "the fibre stiffness in fabric.json is the default, 100000 N/mm"
    data, one, two = shear_file(tmp_path / "0.csv"), tmp_path / "one", tmp_path / "two"
    fit("bias-extension", data, SIZES, ZEROS, "--out", one)
    assert default in capsys.readouterr().out
    fit("bias-extension", data, SIZES, ZEROS, "--fibre-stiffness 2e4 --out", one)
    assert default not in capsys.readouterr().out
    fabric = read_fabric(one / "fabric.json").fabric
    assert fabric.families[0].tension.stiffness == 2e4
    toe = CrimpToe(5e3, 0.004, 10.0)
    file = pull(tmp_path / "pull.csv", lambda e: 100 * toe.value(np.log1p(e)) / (1 + e))
    fit("biaxial", file, WIDTHS, "--slack 0 --out", two)
    assert "fabric.json contains no shear stiffness" in capsys.readouterr().out
    known = f"--fabric {one / 'fabric.json'}"
    fit("biaxial", file, WIDTHS, known, "--slack 0 --out", two)
    assert "fabric.json contains" not in capsys.readouterr().out
    fabric = read_fabric(two / "fabric.json").fabric
    assert fabric.shear_law == read_law(one / "law.json")
    for family in fabric.families:
        assert family.tension.stiffness == pytest.approx(5e3, rel=1e-3)
    assert read_law(two / "warp_law.json") == fabric.families[0].tension


def test_a_table_is_extrapolated_on_request(tmp_path):
    data, out = shear_file(tmp_path / "0.csv", n=8), tmp_path / "o"
    how = f"--law tabulated --points 3 --slack 0 --out {out}"
    beyond = "--extrapolation linear"
    fit("bias-extension", data, SIZES, how, "--force-at-rest 0")
    assert read_law(out / "law.json").extrapolation == "refuse"
    fit("bias-extension", data, SIZES, how, "--force-at-rest 0", beyond)
    assert read_law(out / "law.json").extrapolation == "linear"
    file = pull(tmp_path / "pull.csv", lambda e: 4e4 * e)
    fit("biaxial", file, WIDTHS, f"--fabric {out / 'fabric.json'}", how, beyond)
    fabric = read_fabric(out / "fabric.json").fabric
    assert {law.extrapolation for law in fabric.laws} == {"linear"}
    law = summary_in(out)["laws"]["Tension of the warp"]["law"]
    assert law["extrapolation"] == "linear"


def test_tests_of_several_kinds_are_fitted_jointly(tmp_path, capsys):
    file = joint_file(tmp_path, Linear(4e3), ("bias", "weft", "bend"))
    out = tmp_path / "o"
    fit("joint", file, "--tension-law linear --out", out)
    fabric = read_fabric(out / "fabric.json").fabric
    assert fabric.shear_law == read_law(out / "shear_law.json")
    assert fabric.families[1].tension == read_law(out / "weft_law.json")
    assert fabric.families[1].tension.stiffness == pytest.approx(4e3)
    assert fabric.bending[0] == pytest.approx(6.0, rel=0.02)
    found = summary_in(out)["joint"]
    assert found["parameters"] == [
        *("weft stiffness", "shear c1", "shear c3", "shear c5"),
        "bending warp stiffness",
    ]
    assert len(found["correlations"]) == len(found["parameters"])
    printed = capsys.readouterr().out
    for title in ("Shear ", "Tension of the weft ", "Bending of the warp "):
        assert f"\n{title}" in printed
    assert "the tension of the warp in fabric.json is the default" in printed


def test_a_strip_is_fitted_alone(tmp_path):
    joint_file(tmp_path, Linear(4e3))
    strip = tmp_path / "warp.csv", "--width 50 --length 200"
    fit("strip", *strip, "--law linear --out", tmp_path / "o")
    assert read_law(tmp_path / "o" / "law.json").stiffness == pytest.approx(4e3)


def held_out(folder):
    """Two tests of the same size, and the file that names them."""
    gamma = np.radians(np.linspace(1.0, 35.0, 30))
    header, file = "displacement (mm),force (N)", folder / "held.toml"
    for name, scale in (("held.csv", 1.0), ("off.csv", 1.3)):
        force = scale * BIAS.force(QUINTIC, gamma)
        write_columns(folder / name, header, BIAS.displacement(gamma), force)
    test = '[[test]]\nkind = "bias-extension"\nwidth = 100\nheight = 200\nslack = 0'
    file.write_text(f'{test}\ndata = "held.csv"\n{test}\ndata = "off.csv"\n')
    return file


@pytest.mark.dear("the only prediction of tests that were not used")
def test_tests_that_were_not_used_are_predicted_and_compared(tmp_path, capsys):
    """The second test is of another law, which it does not confirm."""
    pytest.importorskip("matplotlib")
    data, out = shear_files(tmp_path, n=2), tmp_path / "o"
    how = ZEROS, "--out", out, "--fibre-stiffness 1e6 --validate", held_out(tmp_path)
    fit("bias-extension", *data, SIZES, *how, draw=True)
    row, off = summary_in(out)["validation"]["rows"]
    assert row["confirmed"]
    assert not off["confirmed"]
    assert row["inside_simultaneous"] == 1.0
    assert row["largest_over_largest_force"] < 0.05
    error = f"{100 * row['rms_over_largest_force']:.2g} % of its largest value, rms"
    printed = capsys.readouterr().out
    assert f"Prediction of held.csv  error of the load {error}: confirmed, " in printed
    assert "the prediction is not confirmed" in printed
    page = Page((out / "report.html").read_text(encoding="utf-8"))
    for part in (
        "Inside the band of the curve",
        "Load lost to fibre stretch",
        "not confirmed, only",
    ):
        assert part in page.text
    assert page.tags.count("img") == 2 + 2 + 1 + 2 * 2  # data, law, residuals, held


def test_the_help_lists_every_law():
    from skfem_textile.calibration.choice import BENDING_LAWS, SHEAR_LAWS, TENSION_LAWS

    flags = {"joint": {"--shear-law", "--tension-law", "--bending-law"}}
    for test, (_, options) in TESTS.items():
        laws = {flag for flag in options if flag.endswith("law")}
        assert laws == flags.get(test, {"--law"})
        for flag in laws:
            tension = flag == "--tension-law" or test in ("strip", "biaxial")
            bending = flag == "--bending-law" or test in ("cantilever", "bending")
            names = TENSION_LAWS if tension else SHEAR_LAWS
            names = BENDING_LAWS if bending else names
            assert all(name in options[flag]["help"] for name in names)


@pytest.mark.parametrize("across", [0, 3])
def test_a_simulation_needs_an_even_number_of_elements(across, tmp_path, capsys):
    data = shear_file(tmp_path / "0.csv")
    words = f"{data} {SIZES} --simulate {across} --out {tmp_path / 'out'}"
    line = rejected(capsys, "fit", "bias-extension", *words.split())
    assert "--simulate: the number of elements across must be even" in line
