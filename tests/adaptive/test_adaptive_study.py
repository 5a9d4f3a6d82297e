"""The study of refinement: its references, its tables, and one case of each task."""

import numpy as np
import pytest

from skfem_textile.mesh.checks import check_mesh
from studies.adaptive.cases import Case
from studies.adaptive.reference import graded
from studies.adaptive.study import STUDY, Adaptive
from studies.adaptive.tables import estimates, factor, kinks, tolerances


@pytest.mark.parametrize("degrees", [30.0, 45.0, 60.0])
def test_graded_meshes_are_sound_and_keep_their_outline(degrees):
    mesh = graded(np.radians(degrees))
    check_mesh(mesh)
    height = 100 * np.tan(np.radians(degrees))
    np.testing.assert_allclose(mesh.p.max(axis=1), [50.0, height], rtol=1e-9)
    np.testing.assert_allclose(mesh.p.min(axis=1), 0.0, atol=1e-9)
    for edges, axis, at in (("bottom", 1, 0.0), ("top", 1, height)):
        ends = mesh.p[:, mesh.facets[:, mesh.boundaries[edges]]]
        np.testing.assert_allclose(ends[axis], at, atol=1e-9)


def test_a_case_has_an_error_and_an_estimate():
    (row,) = STUDY.examine(Case("judges", 45, 20.0, 1e5, "irregular", 4))
    assert 0 < abs(row["error"]) < 0.1
    assert 0.5 < row["estimate"] / abs(row["error"]) < 3
    assert row["cost"] > 0
    assert "estimate" in Adaptive().line([row])


def row(task, error, estimate, **more):
    given = {"task": task, "error": error, "estimate": estimate, "case": task}
    return given | {"cost": 0.2, "met": True, "unknowns": 10, "at": 1.0} | more


def test_tables_count_what_passes():
    rows = [row("judges", 0.01, x) for x in (0.004, 0.006, 0.02, 0.04, None)]
    rows += [row("judges", 0.001, x) for x in (0.019, 0.021)]
    assert "| judges | 2 of 5 | 1 of 2 |" in estimates(rows)
    rows = [row("tolerance", *x) for x in ((0.009, 0.008), (-0.02, 0.005))]
    rows.append(row("tolerance", 0.02, 0.03, met=False))
    assert tolerances(rows).startswith("Of 3 runs to 1%, 2 say that they met it, and 1")
    angles = {"angle_error": 2.0, "angle_estimate": 2.6}
    assert "| load | 1.00 |" in factor([row("calibrates", 0.01, 0.02, **angles)])
    uniform = [(100, 0.4), (400, 0.2)]
    own = [
        {"task": "kinks", "degrees": 45.0, "mesh": kind, "unknowns": n}
        | {"position_error": error}
        for kind, pairs in (("uniform", uniform), ("adaptive", [(200, 0.1)]))
        for n, error in pairs
    ]
    assert "| 45° | 200 | 0.1000 | 0.2828 | 0.35 |" in kinks(own)
