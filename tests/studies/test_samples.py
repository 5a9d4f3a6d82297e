from pathlib import Path

import numpy as np

from studies.common.tables import having
from studies.samples.study import POPULATIONS, STUDY, Trials

PUBLISHED = Path(__file__).parents[2] / "docs" / "samples"


def test_bands_cover_nine_of_ten_repeated_tests():
    """Closed form and simulation, for the population that samples assume."""
    rows = STUDY.stored(PUBLISHED)
    assert not STUDY.complaint(rows)
    for part in ("closed form", "simulated"):
        own = having(rows, population="log-normal", part=part)
        assert np.mean([row["inside"] for row in own]) >= 9
    narrow = [{**row, "inside": 8} for row in rows if "inside" in row]
    assert "only 80.0 % of the repeated tests" in STUDY.complaint(narrow)


def test_a_trial_is_repeated_by_its_seed(monkeypatch):
    monkeypatch.setattr("studies.samples.study._TRIALS", 2)
    stored = STUDY.stored(PUBLISHED)
    for population in POPULATIONS:
        for row in Trials(population, 5, 1).rows():
            known = {k: row[k] for k in ("population", "specimens", "part", "trial")}
            (same,) = having(stored, **known)
            assert row["inside"] == same["inside"]
            assert np.isclose(row["width"], same["width"], rtol=1e-6)
