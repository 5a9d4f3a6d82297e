"""Properties of every study: names, stored results, and the files of a run."""

from argparse import ArgumentParser
from functools import cache
from pathlib import Path

import pytest

from studies.__main__ import main
from studies.common import provenance
from studies.study import descriptions, load

DOCS = Path(__file__).parents[2] / "docs"
STUDIES = {name: load(name) for name in descriptions() if name != "hostile"}

each_study = pytest.mark.parametrize("name", STUDIES)


@cache
def cases_of(name, *words):
    study, parser = STUDIES[name], ArgumentParser()
    study.add_options(parser)
    return study.cases(parser.parse_args(words))


@cache
def stored(name):
    """Stored results; read-only."""
    study = STUDIES[name]
    return study.stored(DOCS / (study.folder or name))


@each_study
def test_names_of_cases_are_unique_and_the_sample_is_a_case(name):
    study = STUDIES[name]
    cases = [*cases_of(name)]
    if name == "angles":
        for part in ("choosing", "references"):
            cases += cases_of(name, "--part", part)
    names = [study.name(case) for case in cases]
    assert len(set(names)) == len(names)
    assert study.sample in {"", *names}


#: Cases that are not stored, and stored cases of parts with options, by the starts of
#: their names.
MISSING = {
    "forming": ("deep", "slack", "chosen"),
    "interval": ("chosen",),
    "singular_fibres": (
        *("choosing inclusion", "inclusion 7", "chosen specimen", "chosen steep"),
    ),
    "speed": ("overhead",),
}
FURTHER = {
    "angles": ("30", "37", "45", "52", "60"),
    "calibration": ("benchmark",),
    "speed": ("drapes",),
}


@each_study
def test_every_case_is_stored_and_no_other(name):
    """So the stored results show if a study loses a problem, a code or a seed."""
    cases = {STUDIES[name].name(case) for case in cases_of(name)}
    rows = {row["case"] for row in stored(name)}
    assert not [x for x in cases - rows if not x.startswith(MISSING.get(name, ()))]
    assert not [x for x in rows - cases if not x.startswith(FURTHER.get(name, ()))]


#: Studies whose stored results miss a target, and the complaint.
MISSED = {"laboratory": "1 target(s) missed"}


@each_study
def test_stored_results_meet_the_targets_of_their_study(name):
    complaint = STUDIES[name].complaint(stored(name))
    assert complaint.partition(",")[0] == MISSED.get(name, "")


@each_study
def test_stored_rows_reproduce_tables(name):
    study = STUDIES[name]
    folder = DOCS / (study.folder or name)
    rows = stored(name)
    for file, text in study.tables(rows).items():
        assert (folder / file).read_bytes().decode() == text, file


@pytest.mark.parametrize("name", [name for name in STUDIES if name != "paper"])
def test_stored_rows_reproduce_the_pictures(name, tmp_path):
    pytest.importorskip("matplotlib")
    study = STUDIES[name]
    study.draw(stored(name), tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {*study.pictures}


@pytest.mark.parametrize("name", [name for name in STUDIES if name != "speed"])
def test_a_run_writes_its_files_and_its_rows_reproduce_them(
    name, tmp_path, capsys, monkeypatch
):
    """The stored rows of a case take the place of its results.

    `python -m studies figures --check` computes them.
    """
    study, out = STUDIES[name], tmp_path / "out"
    case = study.sample or stored(name)[0]["case"]
    rows = [row for row in stored(name) if row["case"] == case]
    found = [{k: x for k, x in row.items() if k != "case"} for row in rows]
    monkeypatch.setattr(study, "examine", lambda _: found, raising=False)
    cases = cases_of(name)
    monkeypatch.setattr(study, "cases", lambda _: cases, raising=False)
    monkeypatch.setattr("studies.__main__.load", lambda _: study)
    words = [name, "--case", case, "--out", str(out), "--no-render"]
    assert main(words) == 0
    assert case in capsys.readouterr().out
    rows = study.stored(out)
    assert {row["case"] for row in rows} == {case}
    texts = study.tables(rows)
    assert {*texts} <= {*study.files}
    assert {file.name for file in out.iterdir()} == {*texts, provenance.FILE}
    for file, text in texts.items():
        assert (out / file).read_bytes().decode() == text
