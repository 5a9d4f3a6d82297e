from pathlib import Path

import pytest

from skfem_textile.fabric.catalogue import catalogue, file_of
from studies.catalogue import study
from studies.catalogue.fabrics import ENTRIES, Cao
from studies.catalogue.study import STUDY

PUBLISHED = Path(__file__).parents[2] / "docs" / "catalogue"


# The fit of the nylon simulates its strips.
FITTED = [
    pytest.param(
        one, id=one.name, marks=[] if isinstance(one, Cao) else [pytest.mark.slow]
    )
    for one in ENTRIES
]


@pytest.mark.parametrize("entry", FITTED)
def test_a_stored_fabric_is_the_fit_of_its_measurements(entry):
    assert file_of(entry.name).read_text() == entry.text(entry.fit())


def test_the_catalogue_consists_of_the_fabrics_of_the_study():
    assert {*catalogue()} == {entry.name for entry in ENTRIES}


def test_a_file_that_differs_is_a_failure():
    rows = STUDY.stored(PUBLISHED)
    assert not STUDY.complaint(rows)
    differs = [{**row, "file": "differs"} for row in rows[:1]]
    assert "pass --write" in STUDY.complaint(differs)


def test_the_assumed_fibre_stiffness_changes_loads_little():
    rows = [row for row in STUDY.stored(PUBLISHED) if "change" in row]
    assert len(rows) == 9
    assert max(abs(row["change"]) for row in rows) < 0.03


def test_points_lie_within_the_band_of_a_further_specimen():
    rows = STUDY.stored(PUBLISHED)
    for name in (entry.name for entry in ENTRIES if isinstance(entry, Cao)):
        own = [row for row in rows if row["case"] == name]
        at = {row["angle_deg"]: row for row in own if row["of"] == "law"}
        points = [row for row in own if row["of"] == "point"]
        far = [p for p in points if 10 <= p["angle_deg"] <= 40]
        bands = [at[round(p["angle_deg"])] for p in far]
        pairs = zip(bands, far, strict=True)
        inside = [band["low"] < p["moment"] < band["high"] for band, p in pairs]
        assert sum(inside) >= 0.95 * len(far)


def test_the_table_states_bands():
    assert study.laws(STUDY.stored(PUBLISHED)).count(" to ") == 9
