"""Fabrics in files of the package, of Abaqus and of OpenRadioss."""

import logging

import numpy as np
import pytest

from skfem_textile import (
    CrimpToe,
    Fabric,
    Linear,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)
from skfem_textile.fabric import Asymmetric, CrimpedYarns, Softening, TangentShear
from skfem_textile.fabric.directions import AlongCurve
from skfem_textile.fabric.kinematics import shear_angle
from skfem_textile.fabric.regions import fabric_of_regions
from skfem_textile.io import read_fabric, write_fabric
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers.decks import FABRIC as DECK
from tests.helpers.decks import WEAVE

RISING = Tabulated([0.0, 0.01, 0.03], [0.0, 5.0, 100.0])
BOTH_SIGNS = Tabulated([-1.0, -0.4, 0.0, 0.5, 1.1], [-3.0, -0.2, 0.0, 0.1, 2.0])

FABRICS = {
    "numbers": Fabric(1e4, 0.5, (1, 1), (-1, 1)),
    "each element": Fabric(
        np.array([1e4, 0.1]), np.array([0.5, 0.3]), np.array([[0.1, 1], [1, 0.2]])
    ),
    "nested": Fabric(
        (Pretensioned(TensionOnly(RISING), 2.0), CrimpToe(1e5, 4e-3, 1.0))
    ),
    "two sides": Fabric(Asymmetric(Linear(1e4), Linear(0.1)), Sin2(0.3)),
    "weave": WEAVE,
    "yarns": Fabric(
        CrimpedYarns((Softening(4e2, 3.0), RISING), 0.1, (0.1, 1 / 3), 2.0),
        TangentShear(0.1, 0.7, 0.8),
    ),
    "in ln and sin": Fabric(
        (Polynomial((1e3, 2e4)), Polynomial((8e2,))),
        Polynomial((0.1, 0.0, 1 / 3), sine=True, odd=True),
    ),
    "curve": Fabric(
        warp=AlongCurve([[0, 1, 2], [0, 1, 0]], 0.1),
        weft=AlongCurve([[0, 1, 2], [0, 1, 0]], 1.7),
    ),
    "bends": Fabric(
        bending=(1.0, np.array([2.0, 0.1])), twist=0.3, wrinkling_angle=0.9
    ),
}


def write_file(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


def description(fabric):
    """All properties of a fabric, in words."""
    parts = fabric.tensions, fabric.shear_law
    directions = [
        (d.points.tolist(), d.angle)
        if isinstance(d, AlongCurve)
        else np.array(d).tolist()
        for d in (fabric.warp, fabric.weft)
    ]
    return [*map(repr, parts), directions]


@pytest.mark.parametrize("fabric", FABRICS.values(), ids=FABRICS)
def test_a_fabric_is_read_back_to_the_last_digit(tmp_path, fabric):
    write_fabric(tmp_path / "fabric.json", fabric)
    read = read_fabric(tmp_path / "fabric.json")
    assert description(read.fabric) == description(fabric)
    assert read.ignored == ()


def test_the_fabric_of_regions_is_read_back(tmp_path):
    mesh = rectangle(4, 2, (4, 2), "irregular", 0.2, 1)
    halves = mesh.with_subdomains({"a": lambda x: x[0] < 2, "b": lambda x: x[0] > 2})
    fabric = fabric_of_regions(halves, {"a": FABRICS["numbers"], "b": FABRICS["weave"]})
    write_fabric(tmp_path / "fabric.json", fabric)
    read = read_fabric(tmp_path / "fabric.json").fabric
    x, strain = mesh.p[:, mesh.t].transpose(0, 2, 1), np.full((2, 8, 1), 0.01)
    assert np.array_equal(read.directions(x), fabric.directions(x))
    assert np.array_equal(
        read.at().tensions.value(strain), fabric.at().tensions.value(strain)
    )


FALLING = Tabulated([-0.02, 0.0, 0.05], [-0.1, 0.0, 300.0], "linear")


@pytest.mark.parametrize(
    ("fabric", "reach", "share"),
    [
        (Fabric((FALLING, TensionOnly(RISING)), BOTH_SIGNS), 0.02, 1e-12),
        (Fabric(CrimpToe(1e5, 4e-3, 10.0), Sin2(0.4)), 0.01, 1e-3),
    ],
)
def test_laws_are_read_back_from_abaqus(tmp_path, fabric, reach, share):
    """Tables to round-off, other laws within their points."""
    write_fabric(tmp_path / "fabric.inp", fabric, 0.35)
    read = read_fabric(tmp_path / "fabric.inp", 0.35).fabric
    x = np.linspace(-reach, reach, 41)
    for one, other in zip(read.laws, fabric.laws, strict=True):
        largest = np.abs(other.value(x)).max()
        assert np.abs(one.value(x) - other.value(x)).max() <= share * largest


def test_the_work_of_abaqus_equals_the_work_of_the_law(tmp_path):
    strain = np.linspace(0.0, 0.05, 400)
    stress = 2e3 * strain + 5e4 * strain**2
    rows = "\n".join(f"{s}, {e}" for s, e in zip(stress, strain, strict=True))
    deck = DECK.replace("0., 0.\n400., 0.02", rows)
    warp = read_fabric(write_file(tmp_path, "a.inp", deck), thickness=0.25).fabric.laws[
        0
    ]
    work = 0.25 * (1e3 * 0.04**2 + 5e4 / 3 * 0.04**3)  # t ∫ σ de up to 0.04
    assert warp.energy(np.log1p(np.array(0.04))) == pytest.approx(work, rel=1e-5)
    pull = 0.25 * 1.03 * (2e3 * 0.03 + 5e4 * 0.03**2)  # T = t (1 + e) σ
    assert warp.value(np.log1p(np.array(0.03))) == pytest.approx(pull, rel=1e-6)


def test_shear_of_abaqus_is_the_decrease_of_the_angle_between_fill_and_warp(tmp_path):
    deck = DECK.replace(
        "0., 0.\n0.1, 0.5\n1., 0.9", "-9., -1.\n0., 0.\n0.1, 0.5\n1., 1."
    )
    mesh = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT, TYPE=S4R\n1,1,2,3,4\n"
    deck = f"{mesh}*ORIENTATION, NAME=A\n1,0,0,0,1,0\n3,0\n{deck}"
    fabric = read_fabric(write_file(tmp_path, "a.inp", deck), thickness=2.0).fabric
    warp, weft = fabric.warp[:, 0], fabric.weft[:, 0]
    F = np.array([[1.0, np.sin(0.5)], [0.0, np.cos(0.5)]])  # y leans towards x
    moment = fabric.shear_law.value(shear_angle(F, warp, weft))
    assert abs(moment) == pytest.approx(2.0 * 0.1)


def test_units_and_section_thickness_convert_stress_into_force(tmp_path):
    section = "*MEMBRANE SECTION, ELSET=A, MATERIAL=cloth\n0.0005,\n"
    path = write_file(tmp_path, "a.inp", DECK.replace("400.", "4e8") + section)
    warp = read_fabric(path, units="N m").fabric.laws[0]
    at = np.log1p(np.array(0.02))
    assert warp.value(at) == pytest.approx(0.5 * 1.02 * 400.0)
    assert read_fabric(path, 1.0, "kN m").fabric.laws[0].value(at) == pytest.approx(
        1.02 * 4e5
    )


def test_abaqus_data_without_counterpart_are_reported(tmp_path, caplog):
    deck = DECK.replace("*FABRIC", "*DENSITY\n1e-9,\n*DAMPING, ALPHA=1\n*FABRIC")
    deck = deck.replace("DIRECTION=TENSION", "DIRECTION=TENSION, TYPE=DAMAGE")
    deck = deck.replace(
        "EXTRAPOLATION=LINEAR\n0., 0.\n0.1", "TYPE=ELASTIC\n0., 0.\n0.1"
    )
    path = write_file(tmp_path, "a.inp", deck)
    with caplog.at_level(logging.WARNING, "skfem_textile"):
        ignored = read_fabric(path, 0.3).ignored
    for part in (
        "*DENSITY",
        "*DAMPING",
        "TYPE=DAMAGE",
        "shear: EXTRAPOLATION",
        "interpolates the data linearly",
    ):
        assert sum(part in sentence for sentence in ignored) == 1
    assert [
        r.getMessage().partition("not represented exactly: ")[2] for r in caplog.records
    ] == [*ignored]
