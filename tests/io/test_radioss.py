"""Fabrics of OpenRadioss: LAW58 and LAW158, their defaults, and rejected decks."""

import numpy as np
import pytest

from skfem_textile import MeshError
from skfem_textile.fabric import Softening
from skfem_textile.io import read_fabric


def card(**fields):
    """A line of fixed columns: by name, such as c3_2, the first and how many."""
    line = " " * 100
    for column, value in fields.items():
        first, width = (10 * int(n) for n in column.removeprefix("c").split("_"))
        line = line[:first] + str(value).rjust(width) + line[first + width :]
    return line.rstrip()


LAW58 = [
    *("/MAT/LAW58/7/1", "cloth", card(c0_2=1e-9)),
    card(c0_2=1000.0, c2_2=50.0, c4_2=800.0, c8_2=0.01),
    card(c0_2=0.5, c2_2=5.0, c4_2=45.0),
    card(c0_2=0.05),
    card(c0_1=1, c1_1=1, c2_2=0.05, c4_2=0.04),
]
FUNCTION = ["/FUNCT/3", "f", card(c0_2=0, c2_2=0), card(c0_2=0.1, c2_2=9.0)]
TURN = ["/FUNCT/4", "g", card(c0_2=0, c2_2=0), card(c0_2=60, c2_2=1.2)]


def rad(tmp_path, *lines):
    path = tmp_path / "a.rad"
    path.write_text("\n".join(["#RADIOSS STARTER", *lines, "/END"]))
    return path


def test_law58_is_a_cell_of_crimped_yarns(tmp_path):
    read = read_fabric(rad(tmp_path, *LAW58), thickness=0.2)
    law = read.fabric.tensions
    assert law.yarns == (Softening(200.0, 10.0), Softening(160.0))
    assert law.crimp == (0.05, 0.04)
    for spring, E, s in zip(law.springs, (200.0, 160.0), law.crimp, strict=True):
        sine = np.sin(np.arccos(1 / (1 + s)))
        assert spring == pytest.approx(0.01 * E * sine)
    shear = read.fabric.shear_law
    assert (shear.stiffness, shear.angle) == (0.1, pytest.approx(np.pi / 4))
    assert shear.locked_stiffness == pytest.approx(0.5)
    assert [s.partition(":")[0] for s in read.ignored] == ["Df", "density", "/UNIT/1"]


def test_law58_takes_functions_of_its_yarns_and_of_shear(tmp_path):
    lines = [*LAW58, card(c0_1=3, c2_2=2.0), "", card(c0_1=4)]
    read = read_fabric(rad(tmp_path, *lines, *FUNCTION, *TURN), thickness=0.2)
    yarn = read.fabric.tensions.yarns[0]
    assert yarn.value(np.array([0.05]))[0] == pytest.approx(0.2 * 2.0 * 4.5)
    shear = read.fabric.shear_law
    assert shear.value(np.radians([-60.0, 30.0])) == pytest.approx([-0.24, 0.12])


def test_law158_couples_logarithmic_springs(tmp_path):
    lines = [
        *("/MAT/FABR_NL/2", "cloth", card(c0_2=1e-9)),
        card(c0_2=0.05, c2_2=0.04, c4_2=3.0, c6_2=4.0),
        card(c0_2=0.0),
        *(card(c0_1=3), card(c0_1=3, c2_2=2.0), card(c0_1=4)),
    ]
    read = read_fabric(rad(tmp_path, *lines, *FUNCTION, *TURN), 0.5)
    assert any("Fscale" in sentence for sentence in read.ignored)
    law = read.fabric.tensions
    assert (law.coupling, law.springs, law.crimp) == (1.5, (2.0, 0.5), (0.05, 0.04))
    assert np.isfinite(law.value(np.array([[0.02], [0.01]]))).all()


@pytest.mark.parametrize(
    ("lines", "more", "named"),
    [
        ([], {}, "no /MAT/LAW58"),
        (LAW58, {}, "specify the thickness"),
        (LAW58[:4], {"thickness": 1.0}, "2 lines follow the title, but at least 5"),
        ([*LAW58[:3], "1O00", *LAW58[4:]], {"thickness": 1.0}, "E1: '1O00'"),
        ([*LAW58[:3], card(c0_2="-5"), *LAW58[4:]], {"thickness": 1.0}, "stiffness"),
        ([*LAW58, card(c0_1=9)], {"thickness": 1.0}, "no /FUNCT/9"),
        ([*LAW58[:6], card(c0_1=3)], {"thickness": 1.0}, "N1 = 3"),
        ([*LAW58, *LAW58], {"thickness": 1.0}, "several"),
        (LAW58, {"thickness": 1.0, "material": "8"}, "number 8"),
    ],
)
def test_an_unreadable_law58_is_rejected_in_one_line(tmp_path, lines, more, named):
    with pytest.raises(MeshError, match=named) as refusal:
        read_fabric(rad(tmp_path, *lines), **more)
    assert str(refusal.value).isprintable()
