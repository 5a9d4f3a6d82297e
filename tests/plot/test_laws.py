"""Curves of laws: their range, units and points."""

import numpy as np
import pytest

from skfem_textile import CrimpInterchange, Linear, Locking, Sin2, Tabulated

pytest.importorskip("matplotlib")
from matplotlib.figure import Figure

from skfem_textile.plot.curves import plot_law, plot_tensions


def drawn(law, **how):
    axes = plot_law(law, Figure().subplots(), **how)
    return axes, [line.get_xydata().T for line in axes.lines]


def test_a_shear_law_is_over_degrees_up_to_60_or_close_to_its_end():
    axes, ((x, y),) = drawn(Sin2(0.5), of="shear")
    assert x[[0, -1]] == pytest.approx([-60, 60])
    assert y == pytest.approx(Sin2(0.5).value(np.radians(x)))
    assert axes.get_ylabel() == "shear moment (N mm/mm²)"
    _, ((x, y),) = drawn(Locking(0.5, np.radians(50)), of="shear")
    assert x[-1] == pytest.approx(0.95 * 50)


def test_a_tension_law_is_over_strain_up_to_2_percent():
    axes, ((x, y),) = drawn(Linear(7.0), of="tension")
    assert x[[0, -1]] == pytest.approx([-0.02, 0.02])
    assert y == pytest.approx(7 * x)
    assert axes.get_xlabel() == "fibre strain ε (-)"
    assert drawn(Linear(7.0))[0].get_ylabel().startswith("tension or moment (N/mm")


def test_the_curve_of_a_table_has_its_points():
    law = Tabulated([0.0, 0.1, 0.3], [0.0, 1.0, 5.0])
    _, (_, points) = drawn(law, of="shear")
    assert points == pytest.approx(np.array([np.degrees([0, 0.1, 0.3]), [0, 1, 5]]))


def test_tensions_of_a_biaxial_law_are_over_the_warp_strain_by_ratio():
    law = CrimpInterchange(100.0, (0.01, 0.02), 0.1, 0.001, 1.0)
    axes = plot_tensions(law, Figure().subplots(), ratios=(0.5,))
    warp, weft = (line.get_xydata().T for line in axes.lines)
    expected = law.value(np.array([warp[0], 0.5 * warp[0]]))
    assert np.array([warp[1], weft[1]]) == pytest.approx(expected)
    assert axes.get_legend().texts[0].get_text() == "warp, weft strain 0.5 ε"
