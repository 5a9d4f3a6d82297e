"""A table of a case file contains the parameters of its class or function."""

from argparse import ArgumentTypeError
from dataclasses import MISSING, fields
from inspect import signature
from math import radians
from typing import get_args

import pytest
from msgspec import structs

from skfem_textile import Locking, OnePoint, Polynomial, scenes
from skfem_textile.cases import CaseFileError, declared
from skfem_textile.cases.scenes import SCENES
from skfem_textile.cases.schema import (
    AnyFormulation,
    BendingLaw,
    ShearLaw,
    TensionLaw,
)
from skfem_textile.cases.tables import Table, tag_of
from skfem_textile.cases.tools import AnyTool
from skfem_textile.cases.write import reference
from skfem_textile.declarations import words

TABLES = [
    table
    for union in (AnyFormulation, TensionLaw, ShearLaw, BendingLaw, AnyTool)
    for table in get_args(union)
    if table.keys or tag_of(table) == "full"
] + [*SCENES.values()]


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_an_implementation_has_the_declared_parameters(table):
    parameters = signature(table.implementation()).parameters
    declared_fields = {field.name: field for field in fields(table.declaration)}
    assert {*parameters} == {*declared_fields}
    for name, parameter in parameters.items():
        default = declared_fields[name].default
        stated = parameter.empty if default is MISSING else default
        assert parameter.default is stated or parameter.default == stated


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_a_table_of_defaults_has_the_values_of_python(table):
    required = [one.encode_name for one in structs.fields(table) if one.required]
    values = table(**dict.fromkeys(required, 0.0)).values()
    for key, (name, stated) in table.keys.items():
        if key not in required and stated.default is not None:
            assert values[name] == getattr(table.declaration, name)


def test_the_help_of_an_option_ends_with_its_default():
    assert words.option("size", int, default=3)["help"] == "size (default: %(default)s)"
    assert words.option("size", int)["help"] == "size"


def test_angles_are_in_radians_in_python_and_words_are_flags():
    law = ShearLaw.__args__[3](stiffness_N_per_mm=0.5, locking_angle_deg=60.0)
    assert law.construct() == Locking(0.5, radians(60))
    assert law.of(Locking(0.5, radians(60))).locking_angle_deg == pytest.approx(60)
    table = ShearLaw.__args__[4]
    sine = table(coefficients_N_per_mm=(1.0,), variable="sine")
    assert sine.construct() == Polynomial((1.0,), sine=True)
    assert table.of(Polynomial((1.0,), odd=True)).continuation == "odd"


def test_parameters_are_positional_in_the_order_of_the_signature():
    assert OnePoint(2.0, "rate").kind == "rate"
    scene = scenes.bias_extension("aligned", (2, 4), 0.0, 1)
    assert (
        scene.mesh.nelements == scenes.bias_extension("aligned", (2, 4)).mesh.nelements
    )
    with pytest.raises(TypeError, match="unexpected keyword argument 'raduis'"):
        scenes.hemisphere(raduis=3.0)


def misspelt():
    """A case with a misspelt key in each table of the reference, and its path."""
    for table, choice in {(e.table, e.choice): None for e in reference()}:
        case, path = {"scene": {"name": "strip"}}, table
        if table == "scene":
            if choice:
                case["scene"] = {"name": choice, "stepz": 1}
        elif table == "[tools]":
            case["tools"], path = [{"surface": choice or "plane", "stepz": 1}], "tool_1"
        elif table == "[phases]":
            case["phases"], path = [{"stepz": 1}], "phase_1"
        elif table == "phases.tools.NAME":
            phase = {"name": "a", "steps": 1, "tools": {"punch": {"stepz": 1}}}
            case["phases"], path = [phase], "phases.a.tools.punch"
        elif table == "[clamps]":
            case["clamps"], path = [{"stepz": 1}], "clamp_1"
        elif table == "[plies]":
            case["plies"], path = [{"stepz": 1}], "ply_1"
        elif table.startswith("regions") or table == "vary":
            continue
        else:
            *around, name = table.split(".")
            inner = case
            for one in around:
                inner = inner.setdefault(one, {})
            tag = "name" if table == "formulation" else "law"
            inner[name] = {"stepz": 1, **({tag: choice} if choice else {})}
        if "stepz" in repr(case) and not choice.startswith("FILE"):
            yield path, case


def tables_below(table):
    """All classes derived from a table."""
    return [x for one in table.__subclasses__() for x in (one, *tables_below(one))]


def test_every_table_forbids_unknown_keys():
    tables = tables_below(Table)
    assert len(tables) > len(TABLES)
    assert all(table.__struct_config__.forbid_unknown_fields for table in tables)


MISSPELT = [*misspelt()]


@pytest.mark.parametrize(("path", "case"), MISSPELT)
def test_a_misspelt_key_is_refused_in_every_table(path, case):
    with pytest.raises(CaseFileError, match=r"'stepz'|is missing") as refused:
        declared(case)
    assert str(refused.value).startswith(path)


def test_a_name_has_one_value_or_several():
    assert words.pair("top=40") == ("top", 40)
    assert words.pair("top=0,40") == ("top", [0, 40])
    assert words.pair("top=.5,1.") == ("top", [0.5, 1.0])
    assert words.setting("mesh.seed=02") == ("mesh.seed", 2)
    with pytest.raises(ArgumentTypeError, match="NAME=VALUE"):
        words.pair("top")


def test_commas_within_a_lay_up_do_not_separate_values():
    word = "scene.layup=[0/90, ±45]s,[±45,0/90]2"
    assert words.variation(word)[1] == ["[0/90, ±45]s", "[±45,0/90]2"]
    assert words.variation("mesh.source=graded,aligned")[1] == ["graded", "aligned"]


@pytest.mark.parametrize(
    ("kind", "accepted", "refused", "text"),
    [
        (words.acute_degrees, "2e-12 89.999", "0 90 90.000000000001", "0 and 90 deg"),
        (words.length, "2e-12 9e11", "0 2e12 -1 nan long", "a positive length in mm"),
        (words.degrees, "36000 -36000 -30", "36001 -36001 nan", "most 36000 degrees"),
    ],
)
def test_numbers_outside_their_range_are_refused(kind, accepted, refused, text):
    accepted, refused = accepted.split(), refused.split()
    assert [kind(word) for word in accepted] == [float(word) for word in accepted]
    for word in refused:
        with pytest.raises(ArgumentTypeError, match=text):
            kind(word)


def test_simple_shear_is_under_a_small_tension_and_its_help_says_so():
    entries = [x for x in reference() if x.table == "[scene]" or "scene" in x.table]
    texts = " ".join(str(entry) for entry in entries)
    assert "tension across the clamp (default with tension: 0.1)" in texts


def test_a_scene_with_inclined_fibres_has_one_inclination_for_each_family():
    for table in SCENES.values():
        names = {field.name for field in fields(table.declaration)}
        texts = {field.name: str(field.metadata) for field in fields(table.declaration)}
        assert ("warp" in names) == ("weft" in names)
        for name in names & {"warp", "weft"}:
            assert f"inclination of the {name}" in texts[name]


@pytest.mark.parametrize(
    ("n", "accepted"), [(1, False), (2, True), (8, True), (9, False)]
)
def test_a_setting_has_two_to_eight_keys(n, accepted):
    word = f"{'.'.join('abcdefghi'[:n])}=5"
    if accepted:
        assert words.setting(word)[1] == 5
        return
    with pytest.raises(ArgumentTypeError, match="expected KEY=VALUE"):
        words.setting(word)
