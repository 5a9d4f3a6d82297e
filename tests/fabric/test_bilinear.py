"""The bilinear bending law, and tables of moments over curvature."""

import numpy as np
import pytest

from skfem_textile import Bilinear, Fabric, Linear, Tabulated
from skfem_textile.fabric.files import fabric_of_text, fabric_text
from tests.helpers import refused


def test_the_slopes_are_exact_outside_the_transition():
    law = Bilinear(100.0, 1e-3, 20.0, rounding=0.2)
    x = np.array([-3e-3, -0.7e-3, 0.8e-3, 1.2e-3, 2e-3])
    expected = [-0.14, -0.07, 0.08, 0.104, 0.12]
    np.testing.assert_allclose(law.value(x), expected, rtol=1e-12)
    np.testing.assert_allclose(law.tangent(x), [20, 100, 100, 20, 20])


def test_value_and_energy_are_integrals():
    law = Bilinear(100.0, 1e-3, 150.0, rounding=0.5)
    x = np.linspace(0.0, 3e-3, 3001)
    for part, of in (("energy", "value"), ("value", "tangent")):
        slopes = getattr(law, of)(x)
        sums = np.append(0.0, np.cumsum(0.5 * (slopes[1:] + slopes[:-1]) * x[1]))
        np.testing.assert_allclose(getattr(law, part)(x), sums, rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((0.0, 1e-3, 1.0), "stiffness must be a finite number > 0"),
        ((1.0, 2.0, 1.0), "knee: 2 1/mm exceeds the largest curvature"),
        ((1.0, 1e-3, -1.0), "further stiffness must be a finite number >= 0"),
        ((1.0, 1e-3, 1.0, 2.0), "rounding must be at most 1"),
    ],
)
def test_invalid_numbers_are_refused(numbers, message):
    refused(lambda: Bilinear(*numbers), message)


@pytest.mark.parametrize(
    ("header", "factor", "per_moment"),
    [
        ("curvature (1/mm),moment (N mm/mm)", 1.0, 1.0),
        ("curvature (1/m),moment (N)", 1e-3, 1.0),
        ("curvature (1/cm),bending moment (gf cm/cm)", 0.1, 9.80665e-3),
    ],
)
def test_the_header_of_a_table_of_moments_determines_its_units(
    tmp_path, header, factor, per_moment
):
    file = tmp_path / "moments.csv"
    file.write_text(f"{header}\n0,0\n0.5,2\n")
    law = Tabulated.from_csv(file, odd=True, of="bending")
    np.testing.assert_allclose(law.arguments, [0.0, 0.5 * factor])
    np.testing.assert_allclose(law.values, [0.0, 2.0 * per_moment])


def test_curvatures_per_metre_in_the_wrong_unit_are_refused(tmp_path):
    file = tmp_path / "moments.csv"
    file.write_text("curvature (1/mm),moment (N)\n0,0\n3.2,1\n")
    refused(lambda: Tabulated.from_csv(file), "is the value in 1/m?")


def test_a_fabric_with_laws_is_read_back():
    fabric = Fabric(bending=(Bilinear(100.0, 1e-3, 20.0), Linear(3.0)))
    found, _ = fabric_of_text(fabric_text(fabric).encode())
    assert found.bending == (Bilinear(100.0, 1e-3, 20.0), 3.0)
