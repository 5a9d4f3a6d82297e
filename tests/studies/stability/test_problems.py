"""The problems covered by the study."""

import numpy as np
import pytest

from skfem_textile import Fabric, Linear, Macro, OnePoint, Quadratic
from studies.stability import study
from studies.stability.problems import SHEARS, TENSIONS, extremes


def test_the_study_covers_the_stated_problems():
    problems = extremes()
    assert len(problems) * len(study.STEPS) >= 300
    ratios = {p.E / p.G for p in problems if p.G}
    assert {1e2, 1e4, 1e6, 1e8, 1e10} <= ratios
    assert any(p.G == 0 for p in problems)
    stabilisations = {getattr(p.formulation, "stabilisation", 1) for p in problems}
    assert {1e-3, 1e3} <= stabilisations


def test_every_law_is_on_every_scene_with_every_formulation_and_stiffness():
    problems = [p for p in extremes() if p.family.startswith("laws: ")]
    assert {p.family.removeprefix("laws: ") for p in problems} == {
        "strip",
        "trellis",
        "picture frame",
        "bias extension",
    }
    for law in (*TENSIONS, *SHEARS):
        of_law = [p for p in problems if p.label.rpartition(", ")[0] == law]
        assert len({p.family for p in of_law}) == 4
        formulations = {p.formulation for p in of_law}
        assert formulations == {Macro(), OnePoint(), Quadratic(80.0)}
        assert {p.E for p in of_law} == {1e3, 1e5, 1e8}
        for problem in of_law:
            fabric = problem.ply(problem.scene()).fabric
            if law in SHEARS:
                assert fabric.shear_law is SHEARS[law]
                assert fabric.families[0].tension == Linear(problem.E)
            else:
                assert fabric.shear_law == Linear(0.5)
                tensions = Fabric(TENSIONS[law](problem.E)).tensions
                assert repr(fabric.tensions) == repr(tensions)


@pytest.mark.parametrize("law", TENSIONS)
def test_tension_laws_have_about_the_slope_E_at_one_percent_of_strain(law):
    law = Fabric(TENSIONS[law](1e5)).tensions.of_family(0)
    assert 0.6 < law.tangent(np.array([0.01]))[0] / 1e5 < 1.01


def test_the_shear_table_rises_a_hundredfold():
    at_30, at_55 = SHEARS["shear table"].value(np.radians([30, 55]))
    assert at_55 == pytest.approx(100 * at_30)


def test_folding_plies_use_consecutive_meshes():
    """No mesh is chosen by its outcome."""
    seeds, first = {}, {}
    for problem in extremes():
        if problem.family == "folding":
            seeds.setdefault(problem.kind, []).append(problem.seed)
            mesh = problem.scene().mesh.p
            assert not np.array_equal(mesh, first.setdefault(problem.kind, 0 * mesh))
            first[problem.kind] = mesh
    assert {kind: (n[0], len(n)) for kind, n in seeds.items()} == {
        "strip 6×9, C_s = 1, one point": (0, 24),
        "strip 6×9, C_s = 0.1, one point": (0, 6),
        "strip 6×9, C_s = 0.01, one point": (0, 6),
        "strip 10×15, C_s = 1, one point": (2, 7),
        "strip 10×15, C_s = 0.1, one point": (2, 7),
        "bias 60°, Delaunay, G = 0.1, macro": (0, 24),
        "bias 60°, Delaunay, G = 0, macro": (0, 8),
        "bias 40°, G = 0, one point": (0, 4),
        "trellis, G = 0, one point": (0, 4),
    }
    assert all(n == list(range(n[0], n[-1] + 1)) for n in seeds.values())


def test_flat_angles_are_flat():
    (problem,) = [p for p in extremes() if p.name == "strip, 2×2" and "179" in p.family]
    mesh = problem.scene().mesh
    x = mesh.p[:, mesh.t]
    ahead, behind = np.roll(x, -1, axis=1) - x, np.roll(x, 1, axis=1) - x
    cosine = np.sum(ahead * behind, axis=0) / (
        np.linalg.norm(ahead, axis=0) * np.linalg.norm(behind, axis=0)
    )
    assert np.degrees(np.arccos(cosine)).max() == pytest.approx(179.0)
