"""Files of laws and fabrics."""

import numpy as np
import pytest

import skfem_textile.fabric
from skfem_textile import (
    Asymmetric,
    Bilinear,
    CrimpInterchange,
    CrimpToe,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
    WithFriction,
)
from skfem_textile.fabric import CrimpedYarns, Softening, TangentShear, TwoLaws
from skfem_textile.fabric.files import read_law, write_law

# CSV files of measured laws: valid files, and files rejected in one line


def write_file(tmp_path, text):
    file = tmp_path / "law.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


@pytest.mark.parametrize(
    ("text", "arguments", "values"),
    [
        ("shear angle (deg),moment (N mm/mm2)\n0,0\n90,1\n", [0, np.pi / 2], [0, 1]),
        ("Shear Angle (rad), shear moment ( N/mm )\n0,0\n1,1", [0, 1], [0, 1]),
        (
            "\ufeffshear angle (°),moment (N·mm/mm²)\r\n0,0\r\n\r\n45,2",
            [0, np.pi / 4],
            [0, 2],
        ),
        (
            "shear angle (deg),normalised shear force (N/mm)\n0,0\n60,3\n",
            [0, np.pi / 3],
            [0, 1.5],
        ),
        ("fibre strain (-),tension (N/mm)\n-0.1,-1\n1e-2,2\n", [-0.1, 0.01], [-1, 2]),
        ("fibre strain (%),tension (kN/m)\n 0 , 0 \n2,5\n", [0, 0.02], [0, 5]),
    ],
)
def test_the_header_determines_the_units(tmp_path, text, arguments, values):
    law = Tabulated.from_csv(write_file(tmp_path, text))
    np.testing.assert_allclose(law.arguments, arguments)
    np.testing.assert_allclose(law.values, values)


def test_semicolons_and_decimal_commas_are_read(tmp_path):
    text = "shear angle (rad);moment (N/mm)\n0;0\n0,5;1,25\n"
    law = Tabulated.from_csv(write_file(tmp_path, text))
    assert law.values == (0.0, 1.25)


# Laws in files; fabrics are in tests/io/test_fabrics.py


SHEAR = (
    Sin2(0.1),
    Polynomial((0.1, 0.0, 1 / 3), sine=True),
    Locking(0.1, 1.0),
    Tabulated([0.0, 0.5], [0.0, 0.1], odd=True),
    TangentShear(0.1, 0.7, 0.8),
)
TENSION = (
    Linear(1e5),
    TensionOnly(CrimpToe(1e5, 0.004, 10.0)),
    Asymmetric(Linear(1e5), Linear(10.0)),
    Pretensioned(Linear(1e3), 5.0),
    WithFriction(Linear(1e3), [1.0], [0.01]),
)
BENDING = (Bilinear(100.0, 1 / 3, 20.0),)
BOTH = (
    CrimpInterchange(1e4, 0.01, 1, 1e-3, 1),
    CrimpedYarns((Softening(4e2, 3.0), Linear(1e3)), 0.1, (0.1, 1 / 3), 2.0),
    TwoLaws(Linear(1e5), Linear(1e3)),
)


@pytest.mark.parametrize("law", [*SHEAR, *TENSION, *BENDING, *BOTH])
def test_a_law_is_read_back_to_the_last_digit(law, tmp_path):
    write_law(law, tmp_path / "law.json")
    assert repr(read_law(tmp_path / "law.json")) == repr(law)


def test_every_law_of_the_library_has_a_file():
    laws = {type(law) for law in (*SHEAR, *TENSION, *BENDING, *BOTH)}
    laws.add(type(TENSION[1].law))
    laws.add(Softening)  # within another
    names = skfem_textile.fabric.__all__
    public = [getattr(skfem_textile.fabric, name) for name in names]
    assert laws == {one for one in public if is_law(one)}


def is_law(one):
    """True for the class of a law with parameters."""
    own = one.__module__.startswith("skfem_textile.fabric.") if callable(one) else False
    return own and hasattr(one, "tangent") and hasattr(one, "__dataclass_fields__")
