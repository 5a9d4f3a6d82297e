"""Grid of E/G and distortion: judgement of each run, outcomes and words."""

from pathlib import Path

import numpy as np
import pytest

from skfem_textile.mesh.checks import MeshError
from skfem_textile.ply.formulations import Full
from studies.common.rivals.codes import Plain
from studies.common.rivals.newton import STEPS, NotConvergedError, Run
from studies.common.rivals.rival import QUAD4
from studies.stability.grid import study
from studies.stability.grid.study import (
    LIMIT,
    OURS,
    REFERENCE,
    STUDY,
    Cell,
    Ours,
    Theirs,
)

DOCS = Path(__file__).parents[3] / "docs" / "stability"


@pytest.fixture
def coarse(monkeypatch):
    monkeypatch.setattr(study, "ACROSS", 8)


@pytest.fixture(scope="module")
def stored():
    return STUDY.stored(DOCS)


def use(monkeypatch, rival):
    monkeypatch.setattr(study, "RIVALS", ((rival, Full()),))


def test_the_library_has_the_converged_load_where_points_lock(coarse, monkeypatch):
    """At E/G = 10⁵ elements with four points give several times the load."""
    use(monkeypatch, Plain(QUAD4))
    ours, theirs = (
        case.rows()[0] for case in (Ours(1e5, 0.18, 1), Theirs(0, 1e5, 0.18, 1))
    )
    assert ours["sound"]
    assert theirs["sound"]
    assert ours["load"] == pytest.approx(1.0, abs=0.15)
    assert theirs["load"] > 10
    assert theirs["linear_solves"] >= theirs["steps"]


def test_stored_references_agree(stored):
    rows = [row for row in stored if row["code"] == REFERENCE]
    assert [row["ratio"] for row in rows] == list(study.RATIOS)
    assert all(max(abs(r["halving"]), abs(r["apart"])) < 0.005 for r in rows)


def test_unstable_final_states_do_not_count(coarse, monkeypatch):
    """A rival that stays at rest, or does not converge, has no result."""
    tried = []

    class AtRest(Plain):
        def run(self, task, steps, repeats):
            tried.append(steps)
            if steps == 1:
                raise NotConvergedError("not converged")
            u = np.zeros(task.nodes.size)
            return Run(u, u, 3, [])

    use(monkeypatch, AtRest(QUAD4))
    (row,) = Theirs(0, 1e2, 0.0, 1).rows()
    assert tried == list(STEPS)
    assert row["sound"] is False
    assert row["note"] == "not stable, or folded"


def test_seeds_that_invert_an_element_are_skipped():
    assert study.seeds("irregular", 16, 0.45) == (1, 4, 5)
    with pytest.raises(MeshError, match="inverted"):
        study._scene("irregular", 16, 0.45, 2)
    assert study.seeds("irregular", 16, 0.0) == (1,)


def run(load, seed=1, sound=True, ratio=1e4):
    at = {"code": OURS, "ratio": ratio, "distortion": 0.1, "seed": seed}
    return at | {"load": load, "linear_solves": 4 + seed, "sound": sound}


CONVERGED = {"code": REFERENCE, "load": 0.5, "halving": 0.001, "apart": -0.002}


def cell_of(*rows):
    rows = [CONVERGED | {"ratio": 1e4}, *rows]
    return study.cells(rows)[OURS][1e4, 0.1]


def test_a_cell_is_the_median_over_its_meshes():
    cell = cell_of(run(0.51), run(0.5, 2), run(0.6, 3))
    assert cell == pytest.approx((1.02, 6))
    assert cell_of(run(0.47)) == pytest.approx((0.94, 5))


def test_a_cell_has_no_result_where_most_meshes_have_none():
    bad = [run(0.5, seed, sound=False) for seed in (2, 3)]
    assert cell_of(run(0.5), *bad) == Cell()
    assert cell_of(run(0.5), run(0.52, 2), bad[1]).load == pytest.approx(1.02)


def test_stored_results_are_right_up_to_the_stated_ratios(stored):
    right = {
        code: {
            ratio
            for (ratio, _), cell in of_code.items()
            if cell.load and abs(cell.load - 1) <= LIMIT
        }
        for code, of_code in study.cells(stored).items()
    }
    assert right == {
        OURS: set(study.RATIOS) - {1e10},
        "FElupe, Q4, 2×2": set(),
        "DOLFINx, P2, 3 points": {1e2},
    }
