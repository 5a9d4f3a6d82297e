"""The tables of the benchmarks agree with the results in the documentation."""

import json
from itertools import count
from pathlib import Path

import pytest

from skfem_textile import Ply
from skfem_textile.scenes import strip
from studies.__main__ import main
from studies.speed import needs, one_ply, small_runs, study
from studies.speed.study import STUDY

DOCS = Path(__file__).parents[2] / "docs" / "speed"

ELEMENTS = 16


@pytest.fixture(scope="module")
def stored():
    return STUDY.stored(DOCS)


@pytest.fixture(scope="module")
def results(stored):
    """Results by benchmark."""
    return {row["case"]: row for row in stored}


def test_one_benchmark_keeps_the_results_of_others(tmp_path, monkeypatch, results):
    monkeypatch.setattr(study, "in_new_process", lambda *_: results["needs"])
    others = {f.name: f.read_bytes() for f in DOCS.iterdir() if "needs" not in f.name}
    for name, content in others.items():
        (tmp_path / name).write_bytes(content)
    command = ["speed", "--case", "needs", "--no-render", "--out", str(tmp_path)]
    assert main(command) == 0
    for name, content in others.items():
        if name != "provenance.json":
            assert (tmp_path / name).read_bytes() == content
    assert (tmp_path / "unused.md").read_text() == (DOCS / "unused.md").read_text()
    assert json.loads((tmp_path / "provenance.json").read_text())["speed"]


def terms_of(arguments, dimension):
    return {term.name for term in Ply(*arguments, dimension=dimension).terms}


def test_each_feature_adds_its_terms_to_the_previous_ones():
    count = 1 + one_ply.FEATURES.index("bending of fibres")
    terms = [
        terms_of(*one_ply._with_features(one_ply.FEATURES[:n], ELEMENTS))
        for n in range(1, count + 1)
    ]
    added = [new - old for old, new in zip([set(), *terms], terms, strict=False)]
    none = set()
    assert added == [
        *({"tension", "corners"}, {"stabilisation"}, {"shear"}, none, none),
        *({"out_of_plane"}, {"bending"}),
    ]


@pytest.mark.parametrize("name", one_ply.UNUSED)
def test_a_zero_feature_adds_no_term(name):
    absent, zero = (terms_of(*one_ply._without(name, x, ELEMENTS)) for x in (0, 1))
    assert zero == absent
    assert name not in zero


def test_a_zero_feature_imports_no_module():
    runs = [needs.run(kind, "bending", ELEMENTS) for kind in ("absent", "zero")]
    absent, zero = (set(needs.own_modules(run)) for run in runs)
    assert zero == absent
    assert "skfem_textile.ply.ply" in zero


def test_a_strip_imports_no_picture_file_format_or_tool(results):
    """Stored counts agree with the code."""
    strip, sphere = (needs.loaded(name) for name in ("strip", "sphere"))
    assert not {"meshio", "pyvista", "matplotlib"} & set(strip["heavy"])
    assert strip["own"] < sphere["own"]
    for name, current in (("strip", strip), ("sphere", sphere)):
        assert results["modules"]["scenes"][name]["own"] == current["own"]


def costs(median, scatter=0.0):
    return {"median": median, "least": median - scatter, "most": median + scatter}


def test_changes_within_their_scatter_are_not_significant():
    features = {
        "first": {"memory": costs(60.0)},
        "second": {"memory": costs(61.0, 3.0), "assembly": costs(3.0)},
        "third": {"memory": costs(81.0, 3.0), "assembly": costs(2.0)},
    }
    adds = needs.added({"features": features})
    assert adds["second"] == {"memory": (1.0, 2.0), "assembly": (3.0, 0.0)}
    assert adds["third"] == {"memory": (20.0, 4.0), "assembly": (-1.0, 0.0)}
    assert study.two_digits(*adds["second"]["memory"]) == "≈ 0"
    assert study.two_digits(*adds["third"]["memory"]) == "+20"
    assert study.two_digits(*adds["third"]["assembly"]) == "−1"


def test_shares_have_median_and_quartiles():
    share = needs._middle([-0.02, -0.01, 0.004, 0.02, 0.03])
    assert study._share(share) == "+0.4 % (−1.5 to +2.5 %)"
    none = {"median": -0.0001, "low": -0.01, "high": 0.0}
    assert study._share(none) == "0.0 % (−1.0 to 0.0 %)"


def test_the_parts_of_a_small_run_add_up_to_its_time(monkeypatch):
    ticks = count()
    monkeypatch.setattr(small_runs, "process_time", lambda: next(ticks))
    clock, scene = small_runs._Clock(), strip(size=(2, 3))
    with clock.measuring():
        clock.run(lambda: small_runs._stepper(scene).run())
    small_runs._stepper(scene)  # is not measured
    (parts,) = clock.runs
    assert all(parts.values())
    assert sum(parts.values()) == next(ticks) - 1
