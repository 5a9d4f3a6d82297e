"""Case files of earlier runs are read, and give the results that they gave."""

import json
from pathlib import Path

import pytest

from skfem_textile.cases import case_from_file

FOLDER = Path(__file__).parent / "earlier"
RESULTS = json.loads((FOLDER / "results.json").read_text())


@pytest.mark.parametrize("name", RESULTS)
def test_a_file_of_an_earlier_run_gives_the_same_results(name):
    """Bit for bit on the machine that wrote them."""
    case = case_from_file(FOLDER / f"{name}.toml")
    found, expected = case.summary(case.run()), RESULTS[name]
    for key, value in expected.items():
        assert found[key] == pytest.approx(value, rel=1e-9, abs=1e-9), key


def test_every_file_is_run():
    assert {file.stem for file in FOLDER.glob("*.toml")} == set(RESULTS)
