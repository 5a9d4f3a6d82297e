"""The study of drapes: surfaces, outcomes and parts."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import drape
from studies.common.tables import csv_table
from studies.formulations.drape import chebyshev
from studies.formulations.drape import extremes as judging
from studies.formulations.drape import study as tables
from studies.formulations.drape.cases import FLAT, FORMULATIONS, SPHERE, TIME, Case
from studies.formulations.drape.extremes import (
    SURFACES,
    Drape,
    Extreme,
    Mirrored,
    draped,
)
from studies.formulations.drape.study import STUDY

ON_SPHERE = Extreme("", "sphere", False, cells=4)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("name", SURFACES)
def test_derivatives_of_surfaces_agree_with_differences(name, mirrored):
    surface = Mirrored(SURFACES[name]) if mirrored else SURFACES[name]
    x, h = np.random.default_rng(0).uniform(5, 60, (3, 4)), 1e-5
    steps = h * np.eye(3)[:, :, None]
    slope, bend = (
        np.array([(f(x + s) - f(x - s)) / (2 * h) for s in steps])
        for f in (surface.level, surface.gradient)
    )
    np.testing.assert_allclose(surface.gradient(x), slope, atol=1e-7)
    np.testing.assert_allclose(surface.hessian(x), bend.swapaxes(0, 1), atol=1e-7)
    assert surface.level(np.zeros((3, 1))) == pytest.approx(0)


def test_an_accurate_drape_and_its_mirror_image_are_right():
    row = judging.judged(replace(ON_SPHERE, mirrored=True))
    assert row["outcome"] == judging.RIGHT
    assert row["off_mirror"] < 1e-6


def test_states_out_of_equilibrium_are_wrong(monkeypatch):
    """The initial guess along geodesics, and a slightly moved state, are wrong."""
    right = draped(ON_SPHERE)
    x = drape.exponential_map(right.surface, right.ply.nodes)
    start = replace(right.state, u=drape.displacement(right.ply.nodes, x))
    turned = right.positions + 1e-3 * np.sin(right.positions / 20)
    moved = judging.onto(right.surface, turned)
    moved = replace(right.state, u=drape.displacement(right.ply.nodes, moved))
    for state in (start, moved):
        wrong = Drape(right.ply, right.conditions, right.surface, state)
        monkeypatch.setattr(judging, "draped", lambda *_, wrong=wrong, **__: wrong)
        monkeypatch.setattr(judging, "_against_finer", lambda *_: {})
        row = judging.judged(ON_SPHERE)
        assert row["outcome"] == judging.WRONG
        assert "no stable equilibrium" in row["reason"]


def test_a_drape_that_differs_from_the_net_is_wrong_unless_reported(monkeypatch):
    monkeypatch.setattr(judging, "_against_net", lambda *_: {"off_net": 30.0})
    monkeypatch.setattr(judging, "_warnings", lambda *_: "")
    row = judging.judged(ON_SPHERE)
    assert row["outcome"] == judging.WRONG
    assert "differs from the net by 30.0°" in row["reason"]
    monkeypatch.setattr(judging, "_warnings", lambda *_: "wrinkles")
    assert judging.judged(ON_SPHERE)["outcome"] == judging.TOLD


def test_a_part_writes_only_its_files():
    timed = Case(TIME, 8)
    files = {"error_time.csv", "error_time.png"}
    assert {*STUDY.written([timed])} == files
    rows = STUDY.examine(timed)
    assert {*STUDY.tables(rows)} == files - {"error_time.png"}
    assert rows[0]["largest"] < 0.1


def test_stored_rows_include_every_written_part(tmp_path):
    with pytest.raises(FileNotFoundError):
        STUDY.stored(tmp_path)
    judged = {"case": "extreme, a", "kind": "extreme", "group": "g", "refused": ""}
    judged |= {"outcome": "right", "reason": "", "told": "", "off_net": 2.0}
    net = {"case": "net, n", "kind": "net", "refused": "", "parts": 16}
    net |= {"surface": "analytic", "start": "net", "largest": 0.1, "rms": 0.01}
    alone = judged | {"case": "extreme, b", "off_net": None}
    texts = STUDY.tables([judged, alone])
    *_, line = texts["extremes.md"].splitlines()
    assert line.startswith("| all | 2 | 2 | 0 | 0 | 0 | 1 |")
    for name, text in (texts | {"drape.csv": csv_table([net])}).items():
        (tmp_path / name).write_text(text, newline="")
    rows = STUDY.stored(tmp_path)
    assert [row["case"] for row in rows] == ["net, n", "extreme, a", "extreme, b"]
    again = STUDY.tables(rows[1:])
    assert again == texts


def test_a_surface_has_a_line_with_the_shear_of_every_mesh():
    row = {"kind": "rolled", "surface": "cone", "tension": 1.0, "refused": ""}
    row |= {"formulation": "macro", "parts": 16, "largest": 2e-3}
    refused = row | {"parts": 32, "refused": "no state"}
    other = row | {"formulation": "one point"}
    lines = tables.rolled([row, refused, other]).splitlines()[2:]
    assert lines == [
        "| cone | 1 | macro | 2.0e-03 | refused |",
        "| cone | 1 | one point | 2.0e-03 | – |",
    ]


def test_a_failed_row_is_marked():
    row = {"kind": SPHERE, "refused": "no state", "formulation": "macro", "parts": 8}
    results = {"x": "{x}", "y": "{x}"}
    text = tables.of_runs([row], {"formulation": "{formulation}"}, results)
    assert text.splitlines()[-1] == "| macro | refused | – |"


def test_macro_elements_without_stabilisation_out_of_plane_differ_by_that_alone():
    ply, *_ = chebyshev.problem(FORMULATIONS[FLAT], 2)
    whole, *_ = chebyshev.problem(FORMULATIONS["macro"], 2)
    assert {*whole.roles} - {*ply.roles} == {"out_of_plane"}
    assert {*ply.roles} < {*whole.roles}
