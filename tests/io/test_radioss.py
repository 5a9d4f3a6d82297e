"""Fabrics of OpenRadioss: LAW58 and LAW158, their defaults, and rejected decks."""

import numpy as np
import pytest

from skfem_textile.fabric import Softening
from skfem_textile.io import read_fabric
from tests.helpers.decks import LAW58, card, radioss

FUNCTION = ["/FUNCT/3", "f", card((0, 0.0), (2, 0.0)), card((0, 0.1), (2, 9.0))]
TURN = ["/FUNCT/4", "g", card((0, 0.0), (2, 0.0)), card((0, 60.0), (2, 1.2))]


def rad(folder, *lines):
    (folder / "a.rad").write_text(radioss(*lines))
    return folder / "a.rad"


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
    lines = [*LAW58, card((0, 3), (2, 2.0)), "", card((0, 4))]
    read = read_fabric(rad(tmp_path, *lines, *FUNCTION, *TURN), thickness=0.2)
    yarn = read.fabric.tensions.yarns[0]
    assert yarn.value(np.array([0.05]))[0] == pytest.approx(0.2 * 2.0 * 4.5)
    shear = read.fabric.shear_law
    assert shear.value(np.radians([-60.0, 30.0])) == pytest.approx([-0.24, 0.12])


def test_law158_couples_logarithmic_springs(tmp_path):
    lines = [
        *("/MAT/FABR_NL/2", "cloth", card((0, 1e-9))),
        card((0, 0.05), (2, 0.04), (4, 3.0), (6, 4.0)),
        card((0, 0.0)),
        *(card((0, 3)), card((0, 3), (2, 2.0)), card((0, 4))),
    ]
    read = read_fabric(rad(tmp_path, *lines, *FUNCTION, *TURN), 0.5)
    assert any("Fscale" in sentence for sentence in read.ignored)
    law = read.fabric.tensions
    assert (law.coupling, law.springs, law.crimp) == (1.5, (2.0, 0.5), (0.05, 0.04))
    assert np.isfinite(law.value(np.array([[0.02], [0.01]]))).all()


def test_flexions_and_the_tangent_have_defaults(tmp_path):
    """A flexion alone holds for both families; the crimp is 0.1; GT is (E1 + E2)/4."""
    cards = [*LAW58[:3], card((0, 1000.0), (4, 800.0)), card((0, 0.5), (4, 45.0))]
    for given, springs in (
        ([], (0.001, 0.001)),
        ([(6, 0.2)], (0.2, 0.2)),
        ([(8, 0.3)], (0.3, 0.3)),
        ([(6, 0.2), (8, 0.3)], (0.2, 0.3)),
    ):
        last = card((0, 1), (1, 1), (4, 0.04), *given)
        lines = [*cards, card((0, 0.05)), last]
        cloth = read_fabric(rad(tmp_path, *lines), thickness=0.2).fabric
        sines = np.sin(np.arccos(1 / (1 + np.array([0.1, 0.04]))))
        expected = np.array(springs) * [200.0, 160.0] * sines
        assert cloth.tensions.springs == pytest.approx(expected)
        locked = 0.2 * 0.25 * (1000.0 + 800.0) / 2
        assert cloth.shear_law.locked_stiffness == pytest.approx(locked)
