"""Figures of fits: values in the units of the axes, and the layout of panels."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import Fabric, Linear
from skfem_textile.calibration import Choice, Simulation, fit_tests
from skfem_textile.calibration.simulation import FIBRES
from skfem_textile.calibration.validation import NORMAL_95, validate
from tests.helpers.fits import FRAME, specimen, strip

pytest.importorskip("matplotlib")
from matplotlib.figure import Figure

from skfem_textile.calibration import figure

GAMMA = np.radians(np.linspace(2.0, 35.0, 12))
ANGLES = np.degrees(GAMMA)


def fitted(**how):
    tests = [specimen(FRAME, Linear(0.2), GAMMA, 0.01, seed) for seed in (1, 2)]
    return fit_tests(tests, Choice("linear", **how))


def drawn(panel):
    axes = Figure().subplots()
    panel(axes)
    return axes


def lines(axes):
    return [line.get_xydata().T for line in axes.lines]


def ends(band):
    """Lower and upper ends of a band where its outline begins."""
    x, y = band.get_paths()[0].vertices.T
    return np.array([y[x == x.min()].min(), y[x == x.min()].max()])


@pytest.mark.parametrize(("n", "grid"), [(1, (1, 1)), (2, (1, 2)), (3, (2, 2))])
def test_panels_are_two_in_a_row(n, grid, tmp_path, monkeypatch):
    sheets = []
    monkeypatch.setattr(figure, "save", lambda sheet, _: sheets.append(sheet))
    figure.save_panels(
        [lambda axes: axes.plot([0, 1], [0, 1], label="a")] * n, tmp_path
    )
    (sheet,) = sheets
    rows, columns = grid
    assert sheet.get_size_inches() == pytest.approx([4.8 * columns, 4.0 * rows])
    places = [axes.get_subplotspec() for axes in sheet.axes]
    assert [place.num1 for place in places] == [*range(n)]
    assert places[0].get_gridspec().get_geometry() == grid
    assert all(axes.get_legend() for axes in sheet.axes)


def test_shear_forces_beyond_the_range_are_crosses():
    result = fitted(up_to=np.radians(20.0))
    forces, moments = (drawn(x) for x in figure.law_panels(result, "shear").values())
    used, beside, law = lines(forces)[:3]
    n = int((ANGLES <= 20).sum())
    assert used[0] == pytest.approx(ANGLES[:n], abs=0.5)
    assert used[1] == pytest.approx(result.specimens[0].force[:n])
    assert beside[0].min() > 20
    assert beside[0].max() < 1.6 * 20.5
    assert law[1] == pytest.approx(result.parts["shear"].predicted(0), rel=1e-9)
    points, _, curve = lines(moments)[:3]
    assert points[1] == pytest.approx(0.2 * np.radians(points[0]), rel=0.1, abs=0.01)
    stiffness = result.parts["shear"].law.stiffness
    assert curve[1] == pytest.approx(stiffness * np.radians(curve[0]))
    assert moments.get_ylim()[1] == pytest.approx(1.3 * curve[1].max())


def test_residuals_are_relative_to_the_noise():
    result = fitted()
    axes = drawn(figure.residual_panel(result, "shear"))
    fit, curves = result.parts["shear"], lines(axes)[1:]
    for i, (x, y) in enumerate(curves):
        assert x == pytest.approx(ANGLES, abs=1.0)
        assert y == pytest.approx(fit.residuals[i] / fit.noise[i])
    assert len(curves) == 2
    assert axes.patches[0].get_bbox().extents[[1, 3]] == (
        pytest.approx([-NORMAL_95, NORMAL_95])
    )


def test_tensions_of_a_strip_are_per_width_of_the_deformed_ply():
    moved = np.linspace(0.5, 4.0, 12)
    result = fit_tests([strip(Linear(100.0), moved)], Choice(tension="linear"))
    (panel,) = figure.law_panels(result, *result.parts).values()
    points, law = lines(drawn(panel))
    strain = np.log1p(moved / 200.0)
    assert points == pytest.approx(np.array([strain, 100 * strain]), rel=1e-6)
    assert law == pytest.approx(points, rel=1e-6)


def test_a_prediction_has_bands_of_its_law_its_mesh_and_its_scatter():
    held = specimen(FRAME, Linear(0.2), GAMMA, 0.01, 3, 1.4)
    (one,) = validate(fitted(), Fabric(FIBRES), [held], Simulation(across=2, steps=2))
    one = replace(one, scatter=one.scatter + 3 * one.prediction.pointwise)
    axes = drawn(figure.prediction_panel(one))
    force, half = one.prediction.force, one.prediction.pointwise
    lost = np.nan_to_num(one.prediction.discretisation)
    widths = [np.ptp(ends(band)) / 2 for band in axes.collections]
    expected = (3 * half + one.scatter * 0)[0], (half + lost)[0], half[0]
    assert widths[:3] == pytest.approx(expected, rel=1e-6)
    assert widths[3] == pytest.approx(NORMAL_95 * one.noise)
    prediction, measured, smooth = (y for _, y in lines(axes))
    assert prediction == pytest.approx(force)
    assert measured == pytest.approx(one.measured)
    assert smooth == pytest.approx(force + one.off.force)
    assert smooth[-1] == pytest.approx(1.4 * force[-1], rel=0.05)
