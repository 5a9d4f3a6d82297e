"""Fabrics of the catalogue: names, sources, files."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import Fabric
from skfem_textile.calibration.measured import FAMILIES
from skfem_textile.cases import case_from_tables
from skfem_textile.fabric.catalogue import catalogue, file_of
from skfem_textile.fabric.origin import Origin
from skfem_textile.io import read_fabric, write_fabric
from tests.helpers import refused

NAMES = catalogue()

#: Quantities of a fabric, each of which has a source or is assumed.
QUANTITIES = {"tension", "shear", "bending", "directions", "wrinkling_angle"}


@pytest.mark.parametrize("name", NAMES)
def test_a_fabric_is_written_as_it_was_read(name, tmp_path):
    fabric, _, origin = read_fabric(name)
    write_fabric(tmp_path / "copy.json", fabric, origin=origin)
    assert (tmp_path / "copy.json").read_bytes() == file_of(name).read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_every_quantity_has_a_source_or_is_assumed(name):
    fabric, _, origin = read_fabric(name)
    assert set(origin.sources) | set(origin.assumed) == QUANTITIES
    assert not set(origin.sources) & set(origin.assumed)
    assert all([origin.title, origin.reference, *origin.sources.values()])
    assert all("Table" in text for text in origin.properties.values())
    measured = {"tension": FAMILIES, "shear": ("shear",)}
    ranges = [part for name in origin.sources for part in measured[name]]
    assert set(origin.ranges) == set(ranges)
    if "tension" in origin.assumed:  # the numbers are stated where they are assumed
        for family in fabric.families:
            text = f"{family.tension.stiffness:.0f} N/mm in {family.name}"
            assert text in origin.assumed["tension"]
    if "bending" in origin.assumed:
        assert not fabric.bends


@pytest.mark.parametrize("name", [name for name in NAMES if "cao2008" in name])
def test_the_specimens_of_a_law_are_those_that_its_source_counts(name):
    origin = read_fabric(name).origin
    names = [one.name for one in origin.specimens["shear"]]
    assert f" {len(names)} bias extensions" in origin.sources["shear"]
    assert len({*names}) == len(names)


def test_samples_scatter_about_the_law_of_a_fabric():
    found = read_fabric("cao2008-plain-weave")
    x = np.radians([20.0])
    moments = [one.shear_law.value(x)[0] for one in found.samples(20)]
    assert min(moments) < found.fabric.shear_law.value(x)[0] < max(moments)


def test_fabrics_without_known_scatter_have_no_samples():
    refused(lambda: read_fabric("farrell-woven-nylon").samples(2), "contains none")


@pytest.mark.parametrize("name", ["cao2008", "cao2008-plain-weave ", "folder/cloth"])
def test_unknown_names_list_the_known_ones(name):
    message = refused(lambda: read_fabric(name), "nor a name in the catalogue")
    assert all(known in message for known in NAMES)


def test_an_origin_that_is_not_one_is_refused(tmp_path):
    path = tmp_path / "cloth.json"
    write_fabric(path, Fabric(1e4), origin=Origin(title="cloth"))
    assert read_fabric(path).origin == Origin(title="cloth")
    text = path.read_text().replace('"kind": "Origin"', '"kind": "Linear"')
    path.write_text(text)
    refused(lambda: read_fabric(path), "cloth.json: Linear has no parameter")
    before, _, after = text.rpartition('"kind": "Linear"')
    path.write_text(f'{before}"name": "cloth"{after}')
    refused(lambda: read_fabric(path), "origin must be an object of the kind Origin")
    for specimens in ('{"shear": [1]}', '{"shear": 1}', "[1]"):
        given = after.replace('"specimens": {}', f'"specimens": {specimens}')
        path.write_text(f'{before}"kind": "Origin"{given}')
        refused(lambda: read_fabric(path), "cloth.json: .*specimens")


def test_specimens_keep_their_laws_in_a_file(tmp_path):
    fabric, _, origin = read_fabric("cao2008-balanced-twill")
    path = tmp_path / "cloth.json"
    write_fabric(path, replace(fabric, warp=(1, 1), weft=(-1, 1)), origin=origin)
    assert read_fabric(path).origin == origin


def test_a_run_states_what_its_fabric_assumes():
    tables = {"scene": {"name": "strip"}, "fabric": {"file": "cao2008-plain-weave"}}
    note = case_from_tables(tables).defaults
    assert note.startswith("no tension test was published: 6051 N/mm")
    assert "no bending stiffness" in note
    assert note.endswith("the shear law is fitted up to 40° and extrapolated beyond")
