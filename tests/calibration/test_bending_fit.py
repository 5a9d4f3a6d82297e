"""Bending stiffnesses from cantilever tests, by the elastica and by Peirce."""

import numpy as np
import pytest

from skfem_textile.calibration import CantileverTest, fit_tests, read_cantilever
from skfem_textile.calibration.outliers import wild
from skfem_textile.calibration.report import reports_of
from skfem_textile.cli import main as cli
from skfem_textile.io import read_fabric
from skfem_textile.scenes.elastica import buckled, hanging, peirce
from tests.helpers.command_line import summary_in


def test_the_elastica_has_its_known_deflections():
    """Values computed by another program, and the limits of small deflections."""
    for weight, force, tip in (
        (0.0, 1.0, (0.943567, -0.301721)),
        (0.0, 10.0, (0.445004, -0.810609)),
        (8.0, 0.0, (0.724425, -0.640631)),
    ):
        shape = hanging(weight, force)
        np.testing.assert_allclose((shape.x[-1], shape.z[-1]), tip, atol=2e-6)
    assert hanging(1e-3).z[-1] == pytest.approx(-1e-3 / 8, rel=1e-4)
    assert hanging(0.0, 1e-3).z[-1] == pytest.approx(-1e-3 / 3, rel=1e-4)


def test_a_strip_buckles_at_pi_squared_with_the_first_order_postbuckling_load():
    """P = π² (1 + δ/2) and height 2 √δ/π to first order in the shortening δ."""
    shape = buckled(1e-4)
    assert shape.force == pytest.approx(np.pi**2 * (1 + 0.5e-4), rel=1e-7)
    assert shape.height == pytest.approx(2 / np.pi * 1e-2, rel=1e-3)


def test_a_reading_of_an_elastica_gives_its_stiffness():
    lengths, weight, stiffness = np.array([200.0, 210.0]), 6e-6, 5.0
    angles = [hanging(weight * L**3 / stiffness).chord_angle for L in lengths]
    test = CantileverTest("a", lengths, np.array(angles), weight)
    np.testing.assert_allclose(test.by_elastica, stiffness, rtol=1e-6)
    (band,) = fit_tests([test]).parts["bending warp"].intervals
    assert band == pytest.approx([5.0, 5.0], rel=1e-5)


def test_peirces_formula_is_accurate_for_small_deflections():
    """Its error over the angle of the chord: below 1 % to 17°, 5.7 % at 41.5°."""
    angles = np.radians([17.0, 41.5])
    test = CantileverTest("a", np.ones(2), angles, 1.0)
    excess = test.by_peirce / test.by_elastica - 1
    assert (excess > 0).all()
    assert (excess < [0.0099, 0.058]).all()
    assert test.by_peirce.tolist() == [peirce(1.0, 1.0, angle) for angle in angles]


def test_the_command_writes_a_fabric_that_bends(tmp_path, capsys):
    data = tmp_path / "a.csv"
    data.write_text("overhang (cm),chord angle (deg)\n20,41.5\n20.3,41.5\n")
    line = "--weight", "6e-6", "--family", "weft", "--no-render"
    out = tmp_path / "out"
    assert cli.main(["fit", "cantilever", str(data), *line, "--out", str(out)]) == 0
    warp, weft = read_fabric(out / "fabric.json").fabric.bending
    assert warp == 0.0
    assert weft == pytest.approx(6.15, abs=0.2)
    (stiffness,) = summary_in(out)["laws"]["Bending of the weft"]["parameters"]
    assert stiffness["value"] == weft
    assert "N·mm" in capsys.readouterr().out
    assert "D by Peirce" in (out / "report.html").read_text(encoding="utf-8")


def test_the_band_of_a_bending_stiffness_is_that_of_a_mean():
    """Student's t of the readings, t(4) = 2.776."""
    lengths, angle = np.array([200.0, 203.0, 198.0, 205.0, 201.0]), np.radians(41.5)
    test = CantileverTest("a", lengths, np.full(5, angle), 6e-6, "weft")
    fit = fit_tests([test]).parts["bending weft"]
    half = 2.776445 * test.by_elastica.std(ddof=1) / np.sqrt(5)
    assert np.ptp(fit.intervals[0]) == pytest.approx(2 * half, rel=1e-5)
    assert fit.law.stiffness == pytest.approx(test.by_elastica.mean())


@pytest.mark.slow
def test_normal_scatter_has_no_wild_readings():
    noises = (np.random.default_rng(i).standard_normal(6) for i in range(300))
    assert sum(wild(1 + 0.1 * noise).any() for noise in noises) < 5


def test_a_wild_reading_is_named_by_row(tmp_path):
    rows = [200.0, 201.0, 199.5, 2000.0, 200.5, 199.0]
    (tmp_path / "bend.csv").write_text("\n".join(["overhang (mm)", *map(str, rows)]))
    tests = read_cantilever(tmp_path / "bend.csv", 6e-6, angle=np.radians(41.5))
    (report,) = reports_of(fit_tests(tests)).values()
    (note,) = [note for note in report["notes"] if "median" in note]
    assert note.startswith("bend.csv, row 5: the stiffness of")
