"""Clamps in case files: keys, names, rotation, round trip and bad input."""

import re

import numpy as np
import pytest

from skfem_textile.cases import case_from_file, case_from_tables, declared
from skfem_textile.cases.write import case_text

GRIPPER = {
    "edge": "top",
    "stiffness_N_per_mm": 5.0,
    "direction": [0, 2],
    "release_N": 4.0,
    "preload_N": 1.0,
    "within_mm": [0, 0, 30, 60],
    "name": "gripper",
}
PLAIN = {"edge": "top", "stiffness_N_per_mm": 5.0}


def tables(*clamps, **scene):
    scene = {"name": "strip"} | scene
    return {"scene": scene, "mesh": {"size": [2, 3]}, "clamps": [*clamps]}


def clamps(*given, **scene):
    return case_from_tables(tables(*given, **scene)).loads


def test_the_keys_of_a_clamp_are_its_parameters():
    gripper, plain = clamps(GRIPPER, PLAIN)
    assert (gripper.name, plain.name) == ("gripper", "clamp_2")
    assert (gripper.stiffness, gripper.release, gripper.preload) == (5.0, 4.0, 1.0)
    assert [*gripper.direction] == [0, 2]
    assert [*gripper.within] == [0, 0, 30, 60]
    assert plain.release is plain.direction is plain.within is None


def test_a_case_with_clamps_is_written_and_read_again(tmp_path):
    case = declared(tables(GRIPPER, PLAIN))
    file = tmp_path / "case.toml"
    file.write_text(case_text(case, "# a case"))
    assert declared(tables(GRIPPER, PLAIN)) == case
    again = case_from_file(file).loads
    for one, other in zip(again, clamps(GRIPPER, PLAIN), strict=True):
        assert repr(one) == repr(other)


def test_clamps_are_in_the_axes_of_the_tools():
    scene = {"name": "hemisphere_forming", "centre_mm": [10, 0]}
    (gripper,) = case_from_tables({"scene": scene, "clamps": [GRIPPER]}).loads
    assert [*gripper.within] == [-10, 0, 20, 60]


def test_clamps_turn_with_the_scene():
    """A part of an edge, and the direction, of a strip that is rotated by 30°."""
    terms = []
    for degrees in (0.0, 30.0):
        case = case_from_tables(tables(GRIPPER, rotate_deg=degrees))
        ply = case.ply()
        u = np.zeros(ply.basis.N)
        terms.append((ply.terms[-1], case.scene.turn, ply.nodal(u)))
    (plain, _, _), (turned, Q, _) = terms
    u = np.random.default_rng(1).standard_normal((2, len(terms[0][2][0])))
    energies = plain.energy(u.T.ravel(), 1.0), turned.energy((Q @ u).T.ravel(), 1.0)
    assert energies[0] == pytest.approx(energies[1], rel=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"edge": "north"}, "clamp 'clamp_1': the mesh has no boundary 'north'"),
        ({"edge": None}, "clamp_1.edge is missing: name of the boundary of the mesh"),
        (
            {"edge": None, "name": "east"},
            "clamps.east.edge is missing: name of the boundary of the mesh that the "
            "clamp holds, such as left, right, top or bottom",
        ),
        ({"stiffness_N_per_mm": 0}, "clamp 'clamp_1': stiffness must be"),
        ({"release_N": -1}, "clamp 'clamp_1': release must be"),
        ({"direction": [0, 0]}, "clamp 'clamp_1': direction must be a non-zero"),
        ({"within_mm": [0, 0, 1]}, "clamp_1.within_mm"),
        ({"stifness_N_per_mm": 1}, "clamp_1 has no key 'stifness_N_per_mm'"),
    ],
)
def test_bad_input_is_refused_in_one_line(change, message):
    table = {k: x for k, x in (PLAIN | change).items() if x is not None}
    with pytest.raises(ValueError, match=re.escape(message)) as refused:
        case_from_tables(tables(table)).ply()
    assert "\n" not in str(refused.value)


def test_names_and_arrays_are_checked():
    with pytest.raises(ValueError, match="two clamps have the name 'gripper'"):
        case_from_tables(tables(GRIPPER, GRIPPER))
    with pytest.raises(ValueError, match="clamps must be an array of tables"):
        case_from_tables(tables() | {"clamps": GRIPPER})
    held = case_from_tables(tables(PLAIN | {"name": "right"}))
    with pytest.raises(
        ValueError, match="a clamp and a condition have the name 'right'"
    ):
        held.stepper()
