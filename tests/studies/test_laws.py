from pathlib import Path

import numpy as np
import pytest

from skfem_textile.solve.newton import PlainNewton
from studies.angles import cases as cases_of_angles
from studies.angles import study as angles
from studies.angles.cases import ACROSS, ANGLES
from studies.laws import study
from studies.laws.study import (
    FULL,
    LINEAR,
    MATERIALS,
    QUADRATIC,
    QUADS,
    REFERENCES,
    SPECIMEN,
    STUDY,
    TRIANGLES,
    Case,
    judged_methods,
)
from tests.helpers import table_cells

ALL = list(study.all_cases())


PUBLISHED = Path(__file__).parents[2] / "docs"


def row(method, across, load, warnings="", material=LINEAR):
    names = {"material": material.name, "method": method.name, "across": across}
    return names | {"load": load, "warnings": warnings}


LOADS = 40.1, 40.08, 40.0
REFERENCE = [row(*mesh, x) for mesh, x in zip(REFERENCES, LOADS, strict=True)]


def test_the_shared_case_has_one_reference_and_one_limit_in_both_studies():
    """The stored loads of the linear law agree with the study of angles."""
    scene = SPECIMEN.scene(QUADS.mesh(16, 1))
    inextensible = scene.load(SPECIMEN.shear_law, 1.0)
    reference = cases_of_angles.stored()[SPECIMEN, ANGLES[-1]]["load"] * inextensible
    rows = STUDY.stored(PUBLISHED / "laws")
    assert study.converged(rows, LINEAR) == pytest.approx(reference, rel=2e-3)
    of_angles = angles.errors(angles.COMPARED.read(PUBLISHED / "angles"))
    for method, elements in ((QUADS, "quads"), (TRIANGLES, "triangles")):
        for across in ACROSS:
            here = study.errors(rows, LINEAR, method, across)
            stored = of_angles[SPECIMEN, ANGLES[-1], elements, across]
            np.testing.assert_allclose(here, stored, atol=1e-5)
            limit = 100 * cases_of_angles.limit(SPECIMEN.inclination, across)
            assert f"within {limit:g} %" in study.judged(rows)


def test_no_fibre_locks_on_meshes_along_the_fibres():
    """The load on coarse meshes is nearly that on fine ones."""
    loads = [
        STUDY.examine(Case("reference", LINEAR, m, 4, 0))[0]["load"]
        for m in (FULL, QUADRATIC)
    ]
    assert loads == pytest.approx([43.2, 43.2], rel=0.01)


def test_references_that_differ_by_half_a_percent_agree():
    text = study.references(REFERENCE)
    line = ["40.10", "40.08", "40.00", "+0.25 %", "-0.20 %", "yes"]
    assert table_cells(text, "linear") == line
    apart = [row(FULL, 16, 40.4), *REFERENCE[1:]]
    assert table_cells(study.references(apart), "linear")[-3:] == [
        "+1.00 %",
        "-0.20 %",
        "no",
    ]
    halving = [REFERENCE[0], row(QUADRATIC, 16, 40.4), REFERENCE[2]]
    assert table_cells(study.references(halving), "linear")[-1] == "no"
    assert table_cells(text, "toe") == [*["-"] * 5, "no"]


def test_loads_are_judged_by_the_median_against_the_finest_triangles():
    texts = "load factor 1: deviations contribute 12% | the path was not resolved at 1"
    rows = [row(QUADS, 16, x) for x in (40.4, 39.4)]
    rows += [row(QUADS, 16, 42.0, texts), row(QUADS, 16, np.nan, texts)]
    rows += [row(QUADS, 32, x) for x in (41.2, 41.0, 40.1)]
    line = table_cells(study.judged([*REFERENCE, *rows]), "linear", "default, quads")
    median, worst, within, warned = line[:4]
    assert (median, worst) == ("+1.00 % (1 refused)", "+5.00 %")
    assert (within, warned) == ("yes, 2 of 4", "deviations 2, path 2")
    assert line[4:] == ["+2.50 %", "+3.00 %", "no, 1 of 3", "-"]
    assert table_cells(study.judged(rows), "linear", "default, quads") == ["-"] * 8


def test_medians_within_the_limits_are_counted():
    rows = [
        row(*mesh, 40.0, material=material)
        for material in MATERIALS
        for mesh in REFERENCES
    ]
    off_by = 0.03, 0.005, 0.015, -0.07, 0.03
    rows += [
        row(method, across, 40 * (1 + error), material=material)
        for material, error in zip(MATERIALS, off_by, strict=True)
        for method in judged_methods(material)
        for across in ACROSS
    ]
    words = study.in_words(rows)
    assert (words["met"], words["met_half"]) == ("12 of 20", "6 of 20")
    names = "quads_32", "triangles_32_steep", "triangles_32_others"
    assert [words[name] for name in names] == ["7.0 %", "7.0 %", "3.0 %"]


def test_a_refused_case_has_no_load(monkeypatch):
    """Two iterations of Newton's method do not get there."""
    stepper = study.LoadStepper

    def balks(ply, conditions, steps):
        return stepper(ply, conditions, 1, method=PlainNewton(most=2), max_halvings=0)

    monkeypatch.setattr(study, "LoadStepper", balks)
    (row,) = STUDY.examine(Case("judged", LINEAR, QUADS, 8, 1))
    assert np.isnan(row["load"])
    assert "stopped at load factor 0" in row["refused"]
