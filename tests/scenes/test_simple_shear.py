"""Scene `simple_shear`: exact force, rigid clamps, motions across the clamps."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import Fabric, Macro, Sin2
from skfem_textile.ply.formulations import ON_FIBRES
from skfem_textile.scenes import Case, simple_shear
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import refused

pytestmark = pytest.mark.usefixtures("no_interval")

GAMMA = np.radians(20.0)


def run(scene, shear=0.5, formulation=ON_FIBRES, bending=0.0, steps=2):
    fabric = Fabric(1e5, shear, scene.warp, scene.weft, bending=(bending, bending))
    case = Case(scene=scene, fabric=fabric, formulation=formulation, steps=steps)
    result = case.run()
    return result, case.summary(result)


@pytest.mark.parametrize(
    ("kind", "degrees"), [("irregular", 0.0), ("delaunay", 37.0), ("vertical", 200.0)]
)
def test_the_force_is_exact_on_any_mesh_and_at_any_angle_of_the_frame(kind, degrees):
    """Bent fibres bear the compression at free sides, see the next test."""
    scene = simple_shear(kind, size=(4, 2), tension=0.4).rotated(np.radians(degrees))
    _, summary = run(scene, bending=50.0)
    exact = 100 * (0.5 * GAMMA + 0.4 * np.sin(GAMMA)) / np.cos(GAMMA)
    assert summary["reaction_x"] == pytest.approx(exact, rel=2e-3)
    assert summary["load_N"] == pytest.approx(summary["reaction_x"])
    assert summary["load_over_exact"] == pytest.approx(1.0, abs=2e-3)
    assert summary["displacement_error_max"] < 0.05


def test_the_error_of_the_force_is_that_of_the_sides():
    """It falls with the width between them: it is the same part of a wider ply."""
    off = []
    for width in (50.0, 150.0):
        scene = simple_shear("aligned", size=(int(width / 25), 2), width=width)
        off.append(width * (1 - run(scene)[1]["load_over_exact"]))
    assert off[0] > 0
    np.testing.assert_allclose(off, off[1], rtol=0.2)


def test_a_law_that_is_not_linear_gives_its_moment():
    scene, law = simple_shear(size=(4, 2), tension=0.0), Sin2(0.5)
    exact = 100 * law.value(np.array(GAMMA)) / np.cos(GAMMA)
    assert scene.load(law, 1.0) == pytest.approx(float(exact))
    _, summary = run(scene, law, bending=20.0)
    assert summary["load_over_exact"] == pytest.approx(1.0, abs=5e-3)


def test_the_clamp_moves_as_one_and_the_ply_carries_its_tension():
    scene = simple_shear(size=(4, 2), tension=0.3)
    result, _ = run(scene, formulation=Macro())
    ply, state = result.ply, result.states[-1]
    top = ply.nodes[1] > 49.999
    assert np.ptp(ply.nodal(result.u)[:, top], axis=1).max() < 1e-12
    inner = ply.residual(result.u, 1.0, state.parameters) + ply.load(result.u, 1.0)
    assert ply.nodal(inner)[1, top].sum() == pytest.approx(0.3 * 100, rel=1e-9)
    assert state.reactions["top"][1] == pytest.approx(0.0, abs=1e-9)


def test_on_the_circle_the_force_along_the_motion_is_exact():
    scene = simple_shear(size=(4, 2), across="circle").rotated(0.7)
    _, summary = run(scene, bending=50.0)
    exact = 100 * 0.5 * GAMMA
    assert summary["load_along_motion_N"] == pytest.approx(exact, rel=2e-3)


def test_a_constant_gap_stretches_the_weft():
    scene = simple_shear(size=(4, 2), across="gap")
    result, summary = run(scene)
    T = 1e5 * -np.log(np.cos(np.arctan(np.sin(GAMMA))))
    assert "stretches" in summary["exact_answer"]
    stretched = np.hypot(*result.states[-1].reactions["top"])
    length = np.hypot(1.0, np.sin(GAMMA))  # the weft over its length at rest
    assert stretched == pytest.approx(100 * T / length, rel=2e-3)


def test_other_fibres_and_outlines_have_no_exact_force():
    oblique = simple_shear(warp=0.2, weft=0.2 + np.pi / 2)
    assert oblique.misfit == simple_shear(warp=3e-9).misfit
    assert oblique.misfit == "the fibres are not along the sides"
    assert simple_shear(warp=3e-10).misfit == ""
    mesh = rectangle(100, 50, (4, 2))
    x, y = mesh.p
    cut = replace(mesh, doflocs=np.stack([x * (1 - y / 200), y]))
    assert "side of its bounding rectangle" in simple_shear(cut).misfit


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"shear_angle": 2.0}, "shear angle must be between 0 and 90 degrees, got 114"),
        ({"shear_angle": 0.0}, "shear angle must be between 0 and 90 degrees"),
        ({"across": "free"}, "unknown motion across the clamps 'free': choose one of"),
        ({"across": "gap", "tension": 1.0}, "requires a clamp that moves freely"),
        ({"tension": -1.0}, "the tension must be 0 or positive, got -1 N/mm"),
        ({"tension": np.inf}, "the tension must be 0 or positive"),
        ({"height": 0.0}, "the height must be positive, got 0 mm"),
    ],
)
def test_invalid_parameters_are_refused(options, text):
    refused(lambda: simple_shear(**options), text)
