"""Bending stiffnesses and laws from cantilevers, and from measured moments."""

import numpy as np
import pytest

from skfem_textile import Bilinear, Fabric, Linear, Polynomial, read_law
from skfem_textile.calibration import (
    CantileverTest,
    Choice,
    Preparation,
    fit_tests,
    read_bending,
    read_cantilever,
)
from skfem_textile.calibration.outliers import wild
from skfem_textile.calibration.report import reports_of
from skfem_textile.cli import main as cli
from skfem_textile.io import read_fabric
from skfem_textile.scenes.elastica import buckled, drooping, hanging, peirce
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


@pytest.mark.dear("solves boundary value problems for its interval")
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


# Bending laws

LAW = Bilinear(119.0, 2.4e-3, 20.0)
OVERHANGS = np.array([120.0, 160.0, 200.0, 220.0, 230.0, 240.0])


def cantilevers(law, scatter=0.0):
    """Readings of strips of a law at several overhangs."""
    angles = drooping(law.tangent, OVERHANGS, 13.6e-6, 300).chord_angle
    noise = np.random.default_rng(0).standard_normal(OVERHANGS.size)
    overhang = OVERHANGS * (1 + scatter * noise)
    return CantileverTest("strips", overhang, angles, 13.6e-6)


@pytest.mark.slow
def test_cantilevers_of_a_law_give_the_law():
    fit = fit_tests([cantilevers(LAW)], Choice(bending="bilinear"))
    law = fit.laws["bending warp"]
    assert law.stiffness == pytest.approx(119.0, rel=5e-3)
    assert law.knee == pytest.approx(2.4e-3, rel=0.05)
    assert law.further_stiffness == pytest.approx(20.0, rel=0.2)
    assert fit.fabric(Fabric()).bending == (law, 0.0)


@pytest.mark.slow
def test_a_law_is_chosen_where_the_overhangs_ask_for_it():
    fit = fit_tests([cantilevers(LAW, 0.005)])
    assert isinstance(fit.laws["bending warp"], Bilinear)
    fit = fit_tests([cantilevers(Linear(100.0), 0.01)])
    assert isinstance(fit.laws["bending warp"], Linear)


def test_readings_of_one_angle_give_a_stiffness_without_a_comparison():
    test = CantileverTest("a", np.full(8, 200.0), np.full(8, np.radians(41.5)), 6e-6)
    fit = fit_tests([test])
    assert not fit.candidates
    assert fit.fabric(Fabric()).bending[0] == pytest.approx(test.by_elastica.mean())


@pytest.mark.dear("solves a boundary value problem for each strip")
def test_an_apparent_stiffness_is_that_of_a_linear_law():
    test = cantilevers(Linear(100.0))
    np.testing.assert_allclose(test.apparent(Polynomial((100.0,))), 100.0, rtol=1e-4)
    np.testing.assert_allclose(test.by_elastica, 100.0, rtol=1e-5)


def moments(folder):
    """A cycle of a bilinear law: loading, and unloading along a lower curve."""
    kappa = np.concatenate([np.linspace(0, 10, 41), np.linspace(9.75, 0, 40)])
    moment = LAW.value(1e-3 * kappa)
    moment[41:] -= 0.02 * np.sin(np.pi * kappa[41:] / 10)
    rows = "".join(f"{x:.4f},{y:.6f}\n" for x, y in zip(kappa, moment, strict=True))
    (folder / "m.csv").write_text(f"curvature (1/m),bending moment (N mm/mm)\n{rows}")
    return folder / "m.csv"


def test_moments_over_curvature_give_the_law_of_the_loading(tmp_path):
    (test,) = read_bending(moments(tmp_path))
    assert [branch.kind for branch in test.prepared.branches] == [
        "loading",
        "unloading",
    ]
    assert test.prepared.read.column("curvature").size == 81
    fit = fit_tests([test])
    law = fit.laws["bending warp"]
    assert isinstance(law, Bilinear)
    assert law.knee == pytest.approx(2.4e-3, rel=1e-3)
    table = fit_tests([test], Choice(bending="tabulated", points=20))
    at = np.array([1e-3, 8e-3])
    found = table.laws["bending warp"].value(at)
    np.testing.assert_allclose(found, LAW.value(at), rtol=0.02)


def test_both_branches_give_their_mean(tmp_path):
    (test,) = read_bending(moments(tmp_path), choices=Preparation("both"))
    law = fit_tests([test], Choice(bending="bilinear")).laws["bending warp"]
    assert law.value(np.array([5e-3]))[0] == pytest.approx(
        LAW.value(np.array([5e-3]))[0] - 0.01, abs=2e-3
    )


def test_the_command_writes_the_law_and_a_case_that_uses_it(tmp_path, capsys):
    out = tmp_path / "out"
    line = ["fit", "bending", str(moments(tmp_path)), "--no-render", "--out", str(out)]
    assert cli.main(line) == 0
    law = read_fabric(out / "fabric.json").fabric.bending[0]
    assert read_law(out / "law.json") == law
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Bending of the warp: bilinear" in page
    assert "moment (N·mm/mm)" in page
    assert "further_stiffness" in capsys.readouterr().out


def test_moments_of_the_wrong_sign_are_refused(tmp_path):
    file = tmp_path / "m.csv"
    file.write_text("curvature (1/m),bending moment (N)\n0,0\n-1,1\n-2,2\n-3,3\n")
    with pytest.raises(ValueError, match="reverse the sign of a column"):
        read_bending(file)
