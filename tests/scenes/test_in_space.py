"""The scenes in space: cantilever and buckling."""

import json

import numpy as np
import pytest

from skfem_textile import Fabric
from skfem_textile.cli import main as cli
from skfem_textile.scenes import Case, buckling, cantilever

pytestmark = pytest.mark.usefixtures("no_interval")


def summary_of(scene, steps=1):
    fabric = Fabric(1e5, 0.1, scene.warp, scene.weft, bending=(6.0, 6.0))
    case = Case(scene=scene, fabric=fabric, steps=steps)
    return case.summary(case.run())


@pytest.mark.parametrize("weight", [pytest.param(6e-7, marks=pytest.mark.slow), 6e-6])
def test_a_cantilever_agrees_with_the_elastica(weight):
    errors = []
    for n in (8, 16):
        summary = summary_of(cantilever(size=(n, 2), weight=weight))
        assert summary["reaction_z"] == pytest.approx(weight * 200 * 25)
        errors.append(summary["tip_error_over_length"])
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 3


def test_peirces_formula_overestimates_the_stiffness_at_large_deflections():
    summary = summary_of(cantilever(size=(32, 2)))
    assert summary["chord_angle_deg"] == pytest.approx(41.49, abs=0.05)
    assert summary["bending_by_peirce_N_mm"] == pytest.approx(6.0 * 1.0575, rel=2e-3)


def test_a_strip_buckles_and_agrees_with_the_elastica():
    summary = summary_of(buckling(), steps=2)
    assert summary["path_resolved"]
    assert summary["stable"]
    assert summary["buckling_force_N_per_mm"] == pytest.approx(6.0 * (np.pi / 100) ** 2)
    assert summary["force_over_exact"] == pytest.approx(1.0, abs=3e-3)
    assert summary["height_over_exact"] == pytest.approx(1.0, abs=2e-3)
    over = summary["height_mm"] / summary["exact_height_mm"]
    assert over == pytest.approx(summary["height_over_exact"])


def test_a_plane_ply_bends_from_the_command_line(tmp_path):
    line = "run", "strip", "--size", "4x6", "--steps", "2", "--no-render"
    bending = "--set", "bending.warp_N_mm=2", "--set", "bending.weft_N_mm=5"
    assert cli.main([*line, *bending, "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    exact = 0.5 * 5 * 40 * 60 / 55**2  # the weft lies on a circle
    assert summary["bending_energy"] == pytest.approx(exact, rel=0.05)
