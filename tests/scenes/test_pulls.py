"""Uniform tests of fabrics with exact solutions."""

from functools import cache

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    CrimpInterchange,
    CrimpToe,
    Fabric,
    Linear,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Polynomial,
    Pretensioned,
    Quadratic,
    StepError,
    split,
)
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import FORMULATIONS_ON_MESHES, fit_mesh
from tests.helpers import independent as plain

pytestmark = pytest.mark.usefixtures("no_interval")

# Stretch along one family, edges free to slide: exact for every mesh and law


STRAIN = 0.02
WIDTH, HEIGHT = 40.0, 60.0  # along warp and weft, mm


LAWS = {
    "soft": 1e3,
    "linear": 1e5,
    "stiff": 1e8,
    **{f"toe, k = {k:g}": CrimpToe(1e5, 0.004, k) for k in (1.0, 10.0, 1000.0)},
    # Slack transverse fibres would contract freely: these resist.
    "no compression": (1e4, CrimpToe(1e5, 0.004, 0.0)),
    "stiffening": Polynomial((1e3, 0.0, 1e7)),
}
FORMULATIONS = FORMULATIONS_ON_MESHES | {
    "quadratic of quads": (Quadratic(80.0), "irregular")
}


def pulled(law, G, formulation, kind, strain=STRAIN):
    mesh = fit_mesh(rectangle(WIDTH, HEIGHT, (3, 4), kind, seed=3), formulation)
    ply = Ply(mesh, Fabric(law, G), formulation)
    conditions = {
        "bottom": Condition("bottom", direction=(0, 1)),
        "top": Condition("top", HEIGHT * strain, direction=(0, 1)),
        "corner": Condition(lambda X: np.hypot(*X) < 1e-9, direction=(1, 0)),
    }
    return LoadStepper(ply, conditions, steps=1).run()


@pytest.mark.parametrize(
    ("law", "formulation", "G"),
    [
        pytest.param(
            *(law, formulation, G),
            id=f"{of_law}, {of_formulation}, {G}",
            marks=[pytest.mark.slow] * ((i + j + 3 * k) % 4 > 0),
        )
        for i, (of_law, law) in enumerate(LAWS.items())
        for j, (of_formulation, formulation) in enumerate(FORMULATIONS.items())
        for k, G in enumerate((0.0, 0.5))
    ],
)
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
    """The stress-free length is where T = 0; the solution is still exact."""
    result = pulled(Pretensioned(Linear(1e4), 5.0), 0.5, *formulation)
    tension = 5.0 + 1e4 * np.log1p(STRAIN)
    width = WIDTH * np.exp(-5e-4)
    force = WIDTH * tension / (1 + STRAIN)
    state = result.states[-1]
    assert state.reactions["top"][1] == pytest.approx(force, rel=1e-8)
    x = result.ply.nodes[0] + result.ply.nodal(result.u)[0]
    assert np.ptp(x) == pytest.approx(width, rel=1e-8)


@pytest.mark.parametrize("formulation", FORMULATIONS.values(), ids=FORMULATIONS)
def test_a_mechanism_is_named(formulation):
    """Without shear stiffness and stiffness of one family the ply is a mechanism."""
    with pytest.raises(StepError, match="a mechanism is present"):
        pulled((1e4, 0.0), 0.0, *formulation)


# Biaxial and uniaxial tests of a fabric with crimp interchange: all exact


PARAMETERS = {
    "balanced": ((1e4, 1e4), (0.01, 0.01), 1.0, 2e-3, 1.0),
    "unbalanced": ((1e4, 2e3), (0.02, 0.002), 0.5, 1e-3, 0.5),
    "straight warp": ((1e5, 1e4), (0.0, 0.02), 2.0, 4e-3, 10.0),
}

STRETCHES = [(0.02, 0.01), (0.005, 0.02), (0.025, -0.01)]
every_crimp = pytest.mark.parametrize(
    ("parameters", "formulation", "stretch"),
    [
        pytest.param(
            *(PARAMETERS[of_crimp], formulation, STRETCHES[k]),
            id=f"{of_crimp}, {of_formulation}, {k}",
            # Each pair of them in one of nine.
            marks=[pytest.mark.slow] * ((i + j) % 3 > 0 or (i + j // 3 + k) % 3 > 0),
        )
        for i, of_crimp in enumerate(PARAMETERS)
        for j, (of_formulation, formulation) in enumerate(
            FORMULATIONS_ON_MESHES.items()
        )
        for k in range(3)
    ],
)


@cache
def rectangular(law, formulation, kind):
    """A ply of one fabric, which every test starts from rest."""
    mesh = fit_mesh(rectangle(WIDTH, HEIGHT, (3, 4), kind, seed=3), formulation)
    return Ply(mesh, Fabric(law, 0.5), formulation)


def stretched(law, formulation, kind, warp, weft=None, steps=1):
    """A rectangle stretched along the warp, and along the weft if given."""
    conditions = {
        "left": Condition("left", direction=(1, 0)),
        "right": Condition("right", WIDTH * warp, direction=(1, 0)),
        "corner": Condition(lambda X: np.hypot(*X) < 1e-9, direction=(0, 1)),
    }
    if weft is not None:
        del conditions["corner"]
        conditions["bottom"] = Condition("bottom", direction=(0, 1))
        conditions["top"] = Condition("top", HEIGHT * weft, direction=(0, 1))
    ply = rectangular(law, formulation, kind)
    return LoadStepper(ply, conditions, steps=steps).run()


def free_weft(law, warp_strain):
    """The strain at which the weft has no tension, by bisection."""
    low, high = -0.5, 0.0
    for _ in range(100):
        middle = (low + high) / 2
        T = law.value(np.array(warp_strain), np.array(middle))[1]
        low, high = (middle, high) if T < 0 else (low, middle)
    return low


@every_crimp
def test_the_forces_of_a_biaxial_pull_are_exact(parameters, formulation, stretch):
    result = stretched(CrimpInterchange(*parameters), *formulation, *stretch)
    tensions = plain.interchange(*parameters).value(*np.log1p(stretch))
    state = result.states[-1]
    forces = state.reactions["right"][0], state.reactions["top"][1]
    sides = HEIGHT, WIDTH
    for force, T, side, e in zip(forces, tensions, sides, stretch, strict=True):
        assert force == pytest.approx(side * T / (1 + e), rel=1e-8)
    assert state.verdict.negative_pivots == 0


@every_crimp
def test_a_free_weft_contracts_as_the_warp_straightens(
    parameters, formulation, stretch
):
    stretch = stretch[0]
    result = stretched(CrimpInterchange(*parameters), *formulation, stretch)
    law = plain.interchange(*parameters)
    weft = free_weft(law, np.log1p(stretch))
    T = law.value(np.log1p(stretch), np.array(weft))[0]
    state = result.states[-1]
    assert state.reactions["right"][0] == pytest.approx(
        HEIGHT * T / (1 + stretch), rel=1e-8
    )
    y = result.ply.nodes[1] + result.ply.nodal(result.u)[1]
    assert np.ptp(y) == pytest.approx(HEIGHT * np.exp(weft), rel=1e-8)
    if parameters[1][0] > 0:
        assert weft < -1e-3  # the crimp that the warp has lost


# Stretch of a crimped fabric along the bisector of its fibres


# Load in N at 32 edges across, which 64 edges change by 0.12 %.
CONVERGED = 22.3406


def load(mesh, formulation, steps=1):
    """Force in N that lengthens 100 mm by 10 mm, fibres at 45 degrees."""
    fabric = Fabric(CrimpToe(1e5, 0.004, 10.0), 0.5, warp=(1, 1), weft=(-1, 1))
    pull = {"clamp": Condition("bottom"), "pull": Condition("top", (0, 10))}
    ply = Ply(mesh, fabric, formulation)
    return LoadStepper(ply, pull, steps).run().states[-1].reactions["pull"][1]


@pytest.mark.slow
def test_one_point_converges_to_the_load_of_a_crimped_fabric():
    fine = load(rectangle(50, 100, (32, 64)), OnePoint(), steps=5)
    assert fine == pytest.approx(CONVERGED, rel=1e-5)


@pytest.mark.parametrize("kind", ["irregular", "delaunay"])
def test_macro_elements_give_the_load_of_a_crimped_fabric(kind):
    """Deviations in elements must not be as soft as crimped fibres at rest."""
    macro = load(split(rectangle(50, 100, (8, 16), kind)), Macro())
    assert macro == pytest.approx(CONVERGED, rel=0.02)
