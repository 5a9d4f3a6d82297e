import csv
import logging

import numpy as np
import pytest
from helpers import cells, drawn_here

from skfem_textile.solve.strategies import Newton
from studies.__main__ import main
from studies.common.log import warnings_collected
from studies.laws import cases, study, tables
from studies.laws.cases import (
    LINEAR,
    LINEAR_TRIANGLES,
    MATERIALS,
    ONE_POINT,
    QUADRATIC,
    QUADS,
    STEEP_SHEAR,
    TRIANGLES,
    Case,
)
from studies.laws.study import STUDY

ALL = list(cases.all_cases())


def row(method, across, load, warnings="", material=LINEAR):
    names = {"material": material.name, "method": method.name, "across": across}
    return names | {"load": load, "warnings": warnings}


REFERENCE = [
    *(row(LINEAR_TRIANGLES, n, x) for n, x in ((64, 41.0), (128, 40.4), (256, 40.1))),
    *(row(QUADRATIC, n, x) for n, x in ((64, 40.0), (32, 40.8))),
]


def test_no_two_cases_have_one_name_and_every_material_is_judged():
    assert len({STUDY.name(c) for c in ALL}) == len(ALL)
    judged = {(c.material, c.method, c.across, c.seed) for c in ALL}
    for material in MATERIALS:
        for method in (QUADS, TRIANGLES):
            for across in (16, 32):
                assert {(material, method, across, s) for s in range(1, 6)} <= judged
    steps = {(c.material, c.method.steps) for c in ALL}
    assert steps == {(STEEP_SHEAR, 16), *((material, 4) for material in MATERIALS)}


def test_meshes_have_so_many_edges_across():
    for method in (QUADS, TRIANGLES, ONE_POINT):
        case = Case("judged", LINEAR, method, 16, 1)
        scene = case.scene()
        mesh = method.formulation.working_mesh(scene.mesh)
        assert np.sum(mesh.p[1, np.unique(mesh.facets)] == 0) == 17


def test_the_steep_shear_rises_a_hundredfold_from_30_to_55_degrees():
    """To the few percent to which a curve through the table keeps its slopes."""
    slopes = STEEP_SHEAR.shear.tangent(np.radians([15.0, 42.5, 57.5, 70.0]))
    np.testing.assert_allclose(slopes, [0.5, 5.0, 50.0, 50.0], rtol=0.05)


def test_no_fibre_locks_in_triangles_along_the_fibres():
    """Coarse ones read about the load of fine ones."""
    loads = [
        STUDY.examine(Case("reference", LINEAR, m, 8, 0))[0]["load"]
        for m in (LINEAR_TRIANGLES, QUADRATIC)
    ]
    assert loads == pytest.approx([43.5, 43.5], rel=0.05)


def test_references_that_differ_by_half_a_percent_agree():
    text = tables.references(REFERENCE)
    loads, (apart, *halvings, within) = np.split(cells(text, "linear"), [6])
    assert list(loads) == ["41.00", "40.40", "40.10", "40.80", "40.00", "-"]
    assert (apart, within) == ("+0.25 %", "yes")
    assert halvings == ["-0.74 %", "-1.96 %"]
    text = tables.references([*REFERENCE[:2], *REFERENCE[3:]])
    assert cells(text, "linear")[-4:] == ["+1.00 %", "-1.46 %", "-1.96 %", "no"]
    assert cells(text, "toe")[-1] == "no"


def test_loads_are_judged_by_the_median_beside_the_finest_quadratic_triangles():
    said = "load factor 1: deviations carry 12% | the path was not resolved at 1"
    rows = [row(QUADS, 16, x) for x in (40.4, 39.4)]
    rows += [row(QUADS, 16, 41.2, said), row(QUADS, 16, np.nan, said)]
    rows += [row(QUADS, 32, x) for x in (40.6, 40.5, 40.1)]
    line = cells(tables.judged([*REFERENCE, *rows]), "linear", "default, quads")
    median, worst, within, warned = line[:4]
    assert (median, worst) == ("+1.00 % (1 refused)", "+3.00 %")
    assert (within, warned) == ("yes, 2 of 4", "deviations 2, path 2")
    assert line[4:] == ["+1.25 %", "+1.50 %", "no, 1 of 3", "-"]
    assert cells(tables.judged(rows), "linear", "default, quads") == ["-"] * 8


def test_warnings_are_collected_and_not_logged(caplog):
    log = logging.getLogger("skfem_textile.solve")
    with warnings_collected() as texts:
        log.info("a step")
        log.warning("load factor %g: %s", 1, "it is coarse")
    assert texts == ["load factor 1: it is coarse"]
    assert caplog.messages == []
    log.warning("again")
    assert caplog.messages == ["again"]
    assert len(texts) == 1


def test_a_refused_case_has_no_load(monkeypatch):
    """Two iterations of Newton's method do not get there."""
    stepper = study.LoadStepper

    def balks(ply, conditions, steps):
        return stepper(ply, conditions, 1, strategies=[Newton(most=2)], max_halvings=0)

    monkeypatch.setattr(study, "LoadStepper", balks)
    (found,) = STUDY.examine(Case("judged", LINEAR, QUADS, 8, 1))
    assert np.isnan(found["load"])
    assert "stopped at load factor 0" in found["refused"]


def test_the_study_writes_its_report(tmp_path, monkeypatch, capsys):
    some = [
        Case("judged", LINEAR, QUADS, 16, 1),
        Case("reference", LINEAR, LINEAR_TRIANGLES, 8, 0),
        Case("reference", LINEAR, QUADRATIC, 8, 0),
    ]
    monkeypatch.setattr(study, "all_cases", lambda: some)
    assert main(["laws", "--out", str(tmp_path)]) == 0
    assert {p.name for p in tmp_path.iterdir()} == {*STUDY.files, *drawn_here(STUDY)}
    with open(tmp_path / "laws.csv") as file:
        lines = list(csv.DictReader(file))
    loads = [float(line["load"]) for line in lines]
    assert {line["steps"] for line in lines} == {"4"}
    line = cells((tmp_path / "judged.md").read_text(), "linear", "default, quads")
    assert line[0] == f"{100 * (loads[0] / loads[2] - 1):+.2f} %"
    assert "linear: default, quads, 16 across, 1: 4" in capsys.readouterr().out
