"""The benchmarks: their tables are those of the results in the documentation."""

import json
from pathlib import Path

import pytest

from studies.speed import scaling
from studies.speed.measuring import Settings
from studies.speed.study import BENCHMARKS, STUDY, Benchmark

DOCS = Path(__file__).parents[2] / "docs" / "speed"


@pytest.mark.parametrize("file", sorted(DOCS.glob("*.json")), ids=lambda f: f.stem)
def test_tables_are_made_of_the_results(file):
    results = json.loads(file.read_text())
    row = {"benchmark": file.stem, "machine": results.pop("machine")}
    texts = STUDY.tables([row | {"results": results}])
    written = STUDY.written([Benchmark(file.stem, Settings())])
    assert set(texts) == set(written)
    for name, text in texts.items():
        assert (DOCS / name).read_text() == text


def test_every_benchmark_has_its_functions():
    for name in (*BENCHMARKS, "by_turns"):
        module = Benchmark(name, Settings()).module
        assert callable(module.measured)
        assert callable(module.tables)
        assert all(table.endswith(".md") for table in module.TABLES)


def test_exponents_are_those_of_power_laws():
    parts = scaling._PARTS
    rows = [
        {"elements": n} | {part: float(n) ** i for i, part in enumerate(parts)}
        for n in (10**4, 10**5, 10**6)
    ]
    exponents = scaling._exponents(rows)
    assert [exponents[part] for part in parts] == pytest.approx(range(len(parts)))
