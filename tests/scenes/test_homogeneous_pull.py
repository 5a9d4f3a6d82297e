"""A pull along one family, edges free to slide: exact for every mesh and law."""

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    Linear,
    LoadStepper,
    Ply,
    Polynomial,
    Pretensioned,
    Quadratic,
    StepError,
)
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import FORMULATIONS_ON_MESHES, fitting

STRAIN, WIDTH, HEIGHT = 0.02, 40.0, 60.0


LAWS = {
    "soft": 1e3,
    "linear": 1e5,
    "stiff": 1e8,
    **{f"toe, k = {k:g}": CrimpToe(1e5, 0.004, k) for k in (1.0, 10.0, 1000.0)},
    # Slack fibres across the pull would be free to contract: these resist.
    "no compression": (1e4, CrimpToe(1e5, 0.004, 0.0)),
    "stiffening": Polynomial((1e3, 0.0, 1e7)),
}
FORMULATIONS = FORMULATIONS_ON_MESHES | {
    "quadratic of quads": (Quadratic(80.0), "irregular")
}


def pulled(law, G, formulation, kind, strain=STRAIN):
    mesh = fitting(rectangle(WIDTH, HEIGHT, (3, 4), kind, seed=3), formulation)
    ply = Ply(mesh, Fabric(law, G), formulation)
    conditions = {
        "bottom": Condition("bottom", direction=(0, 1)),
        "top": Condition("top", HEIGHT * strain, direction=(0, 1)),
        "corner": Condition(lambda X: np.hypot(*X) < 1e-9, direction=(1, 0)),
    }
    return LoadStepper(ply, conditions, steps=1).run()


@pytest.mark.parametrize("G", [0.0, 0.5])
@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_the_force_is_exact(law, formulation, G):
    result = pulled(law, G, *formulation)
    state, T = result.states[-1], result.ply.fabric.laws[1]
    tension = T.value(np.array([np.log1p(STRAIN)]))[0]
    force = WIDTH * tension / (1 + STRAIN)
    assert state.reactions["top"][1] == pytest.approx(force, rel=1e-8)
    assert state.verdict.negative_pivots == 0
    assert state.linear_solves <= 8


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_pre_tension_contracts_the_other_family(formulation):
    """Its stress-free length is where T = 0; what is pulled is exact all the same."""
    result = pulled(Pretensioned(Linear(1e4), 5.0), 0.5, *formulation)
    tension = 5.0 + 1e4 * np.log1p(STRAIN)
    width = WIDTH * np.exp(-5e-4)
    force = WIDTH * tension / (1 + STRAIN)
    state = result.states[-1]
    assert state.reactions["top"][1] == pytest.approx(force, rel=1e-8)
    x = result.ply.nodes[0] + result.ply.nodal(result.u)[0]
    assert np.ptp(x) == pytest.approx(width, rel=1e-8)


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_a_motion_that_nothing_resists_is_named(formulation):
    """No shear stiffness, and a family without any: the ply is a mechanism."""
    with pytest.raises(StepError, match="some motion meets no stiffness"):
        pulled((1e4, 0.0), 0.0, *formulation)
