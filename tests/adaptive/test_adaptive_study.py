"""The study of refinement: its references, its tables, and one case of each task."""

import numpy as np
import pytest

from skfem_textile import Linear, refine
from skfem_textile.mesh.bases import node_dofs
from studies.adaptive.study import (
    MESHES,
    STUDY,
    Case,
    all_cases,
    band_at_kinks,
    estimates,
    factor,
    in_words,
    kinks,
    position,
    tolerances,
)
from studies.angles.cases import G


def test_every_case_of_a_load_has_a_reference():
    loads = {
        case: case.reference(case.scene())
        for case in all_cases()
        if case.task != "kinks" and case.across < 8
    }
    for case, load in loads.items():
        scene = case.scene()
        lost = scene.load_lost(case.ply(scene).fabric, 1.0)
        assert load == pytest.approx(scene.load(Linear(G), 1.0) * (1 - lost), rel=0.01)


def test_a_band_at_the_exact_kinks_has_the_smallest_elements_and_few_others():
    case = Case("kinks", 45.0, 40.0, 1e6, "delaunay", 4)
    scene = case.scene()
    coarse, band = case.ply(scene), band_at_kinks(case.ply(scene), scene, 6000)
    assert 3000 < band.basis.N <= 6000
    mesh = band.users_mesh
    area = band.on_users_elements(band.basis.dx.sum(axis=1))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    lines = (x - y, x - y + 50, x + y - 50, x + y - 100)
    away = np.abs(lines).min(axis=0)
    assert area[away < 1].max() < 0.3 * area[away > 10].max()
    largest = coarse.on_users_elements(coarse.basis.dx.sum(axis=1)).max()
    assert area.max() > 0.3 * largest


def test_position_errors_over_nodes_and_area_are_those_of_a_shift():
    case = Case("kinks", 45.0, 40.0, 1e6, "delaunay", 4)
    scene = case.scene()
    ply = refine(case.ply(scene), [0]).ply
    u = ply.basis.zeros()
    shift = np.array([[0.3], [0.4]])
    u[node_dofs(ply.basis)] = scene.displacement(ply.nodes, 1.0) + shift
    errors = position(scene, ply, u)
    assert errors["position_error"] == pytest.approx(0.5)
    assert errors["over_area"] == pytest.approx(0.5)


def test_a_case_has_an_error_and_an_estimate():
    (row,) = STUDY.examine(Case("judges", 45, 20.0, 1e5, "irregular", 4))
    assert abs(row["error"]) < 0.1
    assert 0.4 * row["carried"] <= row["estimate"] < 0.1
    assert row["cost"] > 0
    assert "estimate" in STUDY.line([row])


def row(task, error, estimate, **more):
    arguments = {"task": task, "error": error, "estimate": estimate, "case": task}
    return arguments | {"cost": 0.2, "met": True, "unknowns": 10} | more


def test_tables_count_the_cases_that_pass():
    rows = [row("judges", 0.01, x) for x in (0.004, 0.006, 0.02, 0.04, None)]
    rows += [row("judges", 0.001, x) for x in (0.019, 0.021)]
    assert "| validation | 2 of 5 | 1 of 2 |" in estimates(rows)
    rows = [row("tolerance", *x) for x in ((0.009, 0.008), (-0.02, 0.005))]
    rows.append(row("tolerance", 0.02, 0.03, met=False))
    assert tolerances(rows).splitlines()[-1].endswith("| 2.00% | 3.00% | no |")
    angles = {"angle_error": 2.0, "angle_estimate": 2.6}
    message = factor([row("calibrates", 0.01, 0.02, carried=0.04, **angles)])
    assert "| load error over energy share | 0.25 |" in message
    errors = {"uniform": [(100, 0.4), (400, 0.2)]}
    errors |= {mesh: [(200, 0.1)] for mesh in MESHES}
    case_rows = [
        {"task": "kinks", "degrees": 45.0, "mesh": kind, "unknowns": n}
        | {"position_error": error, "over_area": error**2}
        for kind, pairs in errors.items()
        for n, error in pairs
    ]
    assert "| 0.1000 | 0.2828 | 0.35 | 0.0100 | 0.0800 | 0.12 |" in kinks(case_rows)
    words = in_words([row("judges", 0.01, 0.02), *rows, *case_rows])
    counts = [words[name] for name in ("estimates", "within", "met", "right")]
    assert counts == ["1 of 1", "1 of 3", "2 of 3", "1 of 2"]
    assert (words["met_worst"], words["along"]) == ("2.00 %", "0.12 to 0.35")
