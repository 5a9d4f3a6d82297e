"""Plies of stacks in case files: lay-ups, tables, round trip, sweeps and bad input."""

import shutil

import numpy as np
import pytest

from skfem_textile.cases import case_from_file, case_from_tables, declared
from skfem_textile.cases.read import numbered
from skfem_textile.cases.sweep import variants
from skfem_textile.cases.write import WrittenCase, case_text, reference
from skfem_textile.cli import main as cli
from skfem_textile.contact.stack import Stack
from skfem_textile.fabric.catalogue import file_of
from tests.helpers import refused
from tests.helpers.command_line import rejected

TABLE = [[0.0, 0.1], [0.1, 0.0]]
OWN = {"law": "sin2", "stiffness_N_per_mm": 0.7}
PLIES = [
    {"angle_deg": 45.0, "shear": OWN},
    {"thickness_mm": 0.3, "fabric": "cao2008-plain-weave"},
]
WEAVE = str(file_of("cao2008-plain-weave"))


def tables(*plies, name="hemisphere_forming", **scene):
    case = {"scene": {"name": name, **scene}, "mesh": {"size": [2, 2]}}
    return {**case, "plies": [*plies]} if plies else case


def angles(case):
    """Inclination of the warp of each ply in degrees."""
    warp = np.array([ply.fabric.warp for ply in case.ply().plies]).T
    return np.degrees(np.arctan2(warp[1], warp[0])).tolist()


@pytest.mark.parametrize("name", ["hemisphere_forming", "double_dome_forming"])
def test_a_lay_up_of_a_case_makes_a_stack(name):
    of = {"layup": "[0/90, ±45]", "ply_friction": 0.2, "ply_thickness_mm": 0.25}
    case = case_from_tables(tables(name=name, **of))
    assert isinstance(case.ply(), Stack)
    assert angles(case) == pytest.approx([0, 45])
    assert case.scene.plies.friction == 0.2
    assert case.scene.plies.thickness == (0.25, 0.25)
    assert case.scene.tools[2].gap == pytest.approx(0.8)


def test_tools_of_a_case_form_a_lay_up():
    punch = {"surface": "sphere", "radius_mm": 30.0, "centre_mm": [0, 0, -30.2]}
    scene = tables(name="forming", layup="[30, 0]", fibres_deg=10)
    case = case_from_tables({**scene, "tools": [punch | {"motion_mm": [0, 0, 1]}]})
    assert angles(case) == pytest.approx([40, 10])


def test_plies_of_tables_have_their_angle_thickness_and_fabric():
    case = case_from_tables(tables(*PLIES, ply_friction=TABLE, ply_thickness_mm=0.2))
    assert angles(case) == pytest.approx([45, 0])
    assert case.scene.plies.thickness == (0.2, 0.3)
    assert np.array_equal(case.scene.plies.friction, TABLE)
    assert case.scene.tools[2].gap == pytest.approx(0.8)
    low, high = (ply.fabric for ply in case.ply().plies)
    assert low.shear_law.stiffness == 0.7
    assert low.families[0].tension.stiffness == 1e4
    assert high.families[0].tension.stiffness != 1e4


def test_the_written_case_has_the_same_plies(tmp_path):
    given = {"fibres_deg": 45, "ply_friction": TABLE, "ply_thickness_mm": 0.2}
    file = declared(tables(*PLIES, **given))
    WrittenCase(file).write(tmp_path)
    read = case_from_file(tmp_path / "case.toml")
    assert (tmp_path / "case_files" / "fabric.json").is_file()
    plain = case_from_tables(tables(*PLIES, **given))
    assert angles(read) == angles(plain) == pytest.approx([90, 45])
    assert read.scene.plies.thickness == plain.scene.plies.thickness
    assert np.array_equal(read.scene.plies.friction, TABLE)
    pairs = zip(read.ply().plies, plain.ply().plies, strict=True)
    for one, other in pairs:
        assert one.fabric.shear_law.value(0.3) == other.fabric.shear_law.value(0.3)


def test_a_lay_up_is_written_as_it_was_given(tmp_path):
    of = {"layup": "[0/90, ±45]s", "ply_friction": 0.2}
    text = case_text(declared(tables(**of)), "# A case.")
    assert 'layup = "[0/90, ±45]s"' in text
    assert "ply_friction = 0.2" in text
    assert max(map(len, text.splitlines())) <= 88
    file = tmp_path / "case.toml"
    file.write_text(text, encoding="utf-8")
    assert case_from_file(file).scene.plies.angles_deg == (0, 45, 45, 0)


def test_fabrics_of_several_plies_are_copied_by_number(tmp_path):
    shutil.copy(WEAVE, tmp_path / "own.json")
    named = [{"fabric": "own.json"}, {"fabric": "own.json"}]
    (tmp_path / "out").mkdir()
    WrittenCase(declared(tables(*named), tmp_path)).write(tmp_path / "out")
    copied = sorted(x.name for x in (tmp_path / "out" / "case_files").iterdir())
    assert copied == ["fabric.json", "fabric_2.json"]
    case_from_file(tmp_path / "out" / "case.toml")


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("scene.layup", ["[0/90, ±45]", "[0/90]2"]),
        ("scene.ply_friction", [0.0, 0.2, TABLE]),
        ("scene.ply_thickness_mm", [0.0, 0.25]),
    ],
)
def test_options_of_a_lay_up_are_compared_in_a_sweep(key, values):
    case = tables(layup="[0/90, 0/90]") | {"vary": {key: values}}
    plies = [one.case.scene.plies for one in variants(case)]
    found = {
        "scene.layup": [x.angles_deg for x in plies],
        "scene.ply_friction": [x.friction for x in plies],
        "scene.ply_thickness_mm": [x.thickness for x in plies],
    }[key]
    assert len({*map(repr, found)}) == len(values)


def test_a_key_of_one_ply_is_compared_in_a_sweep():
    case = tables({}, {}) | {"vary": {"plies.2.angle_deg": [0, 45]}}
    found = [one.case.scene.plies.angles_deg for one in variants(case)]
    assert found == [(0, 0), (0, 45)]


def test_the_command_line_has_the_options_of_a_lay_up(capsys, tmp_path):
    run = "run", "hemisphere_forming", "--out", str(tmp_path / "out")
    message = rejected(capsys, *run, "--layup", "[0/90, 45]x")
    assert "the lay-up '[0/90, 45]x' ends with 'x'" in message
    message = rejected(capsys, *run, "--layup", "[0]2", "--ply-friction", "3")
    assert "ply_friction must be between 0 and 2, got 3" in message
    message = rejected(capsys, *run, "--layup", "[0]2", "--ply-thickness", "-1")
    assert "ply_thickness must be a length of at least 0 mm" in message
    file = tmp_path / "new.toml"
    assert cli.main(["init", str(file), "--scene", "forming"]) == 0
    assert "# layup is not given" in file.read_text()


@pytest.mark.parametrize(
    ("case", "text"),
    [
        (tables({}, layup="[0]"), r"scene\.layup and \[\[plies\]\] both describe"),
        (tables({}, name="strip"), r"\[\[plies\]\] do not apply to the scene strip"),
        (tables({"angel_deg": 4}), r"ply_1 has no key 'angel_deg'; did you mean"),
        (tables({}, {"thickness_mm": -1}), r"ply_2\.thickness_mm must be a number >="),
        (tables({"fabric": "nix"}), r"ply_1\.fabric nix is neither a file"),
        (tables({"fabric": "nix.json"}), r"ply_1\.fabric nix\.json: no such file"),
        (
            tables({}, PLIES[1] | {"shear": OWN}),
            r"ply_2\.shear sets a law, but ply_2\.fabric contains all laws",
        ),
        (
            tables({}, {"shear": OWN}) | {"fabric": {"file": WEAVE}},
            r"ply_2\.shear sets a law, but fabric\.file contains all laws",
        ),
        (tables({"shear": {"law": "sin"}}), r"ply_1\.shear\.law is .*expected one of"),
        (tables({}, {}, ply_friction=[[0, 0.1]]), "ply_friction must be one coeff"),
        (tables({}, {}, ply_friction=[[0, 0.1], [0.2, 0]]), "must be symmetric"),
        (tables(ply_friction=0.1), "ply_friction requires layup"),
        (tables(layup="[0/90]"), "layup must have at least two plies: omit it"),
        (tables({}), r"\[\[plies\]\] describe one ply: add another table"),
        (
            tables({}, {}) | {"output": {"trim": WEAVE}},
            r"output\.trim describes one ply, but the case has several",
        ),
        (
            tables(layup="[0]2") | {"output": {"trim": WEAVE}},
            r"output\.trim describes one ply, but the case has several",
        ),
        (tables(layup=30), r"scene\.layup must be text"),
        (tables(layup="[0/80]"), "has a ply '0/80' with 80° from warp to weft"),
        ({**tables(), "plies": 3}, r"plies must be an array of tables, \[\[plies\]\]"),
        ({**tables(), "plies": [3]}, "ply_1 must be a table"),
    ],
)
def test_contradictions_and_misspelt_keys_of_plies_are_refused(case, text):
    refused(lambda: case_from_tables(case), text)


def test_plies_are_numbered_and_in_the_reference():
    assert numbered("plies", 2) == "ply_2"
    kinds = {x.key: x.kind for x in reference() if x.table == "[plies]"}
    assert kinds["shear"] == "[plies.shear]"
    assert kinds["fabric"] == "file"
    keys = {(x.choice, x.key) for x in reference() if x.table == "scene"}
    for scene in "forming", "hemisphere_forming", "double_dome_forming":
        assert {(scene, "layup"), (scene, "ply_friction")} < keys
