"""Biaxial and uniaxial pulls of a fabric whose families exchange crimp: all exact."""

from functools import cache

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    CrimpInterchange,
    CrimpToe,
    Fabric,
    LoadStepper,
    Macro,
    Ply,
)
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import FORMULATIONS_ON_MESHES, fitting
from tests.helpers import independent as plain

WIDTH, HEIGHT = 40.0, 60.0  # along warp and weft, mm
PARAMETERS = {
    "balanced": ((1e4, 1e4), (0.01, 0.01), 1.0, 2e-3, 1.0),
    "unbalanced": ((1e4, 2e3), (0.02, 0.002), 0.5, 1e-3, 0.5),
    "straight warp": ((1e5, 1e4), (0.0, 0.02), 2.0, 4e-3, 10.0),
}

every_fabric = pytest.mark.parametrize(
    "parameters", PARAMETERS.values(), ids=PARAMETERS
)
every_formulation = pytest.mark.parametrize(
    "formulation", FORMULATIONS_ON_MESHES.values(), ids=FORMULATIONS_ON_MESHES
)


@cache
def rectangular(law, formulation, kind):
    """A ply of one fabric, which every pull takes from its state at rest."""
    mesh = fitting(rectangle(WIDTH, HEIGHT, (3, 4), kind, seed=3), formulation)
    return Ply(mesh, Fabric(law, 0.5), formulation)


def pulled(law, formulation, kind, warp, weft=None, steps=1):
    """A rectangle stretched along the warp, and along the weft if that is given."""
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
    """The strain at which the weft has no tension, by halving."""
    low, high = -0.5, 0.0
    for _ in range(100):
        middle = (low + high) / 2
        T = law.value(np.array(warp_strain), np.array(middle))[1]
        low, high = (middle, high) if T < 0 else (low, middle)
    return low


@every_fabric
@every_formulation
@pytest.mark.parametrize(
    "stretch",
    [
        (0.02, 0.01),
        pytest.param((0.005, 0.02), marks=pytest.mark.long),
        (0.025, -0.01),
    ],
)
def test_the_forces_of_a_biaxial_pull_are_exact(parameters, formulation, stretch):
    result = pulled(CrimpInterchange(*parameters), *formulation, *stretch)
    tensions = plain.interchange(*parameters).value(*np.log1p(stretch))
    state = result.states[-1]
    found = state.reactions["right"][0], state.reactions["top"][1]
    sides = HEIGHT, WIDTH
    for force, T, side, e in zip(found, tensions, sides, stretch, strict=True):
        assert force == pytest.approx(side * T / (1 + e), rel=1e-8)
    assert state.verdict.negative_pivots == 0


@every_fabric
@every_formulation
def test_a_free_weft_contracts_as_the_warp_straightens(parameters, formulation):
    stretch = 0.02
    result = pulled(CrimpInterchange(*parameters), *formulation, stretch)
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


@every_formulation
def test_without_crimp_each_family_has_its_own_law(formulation):
    E, _, K, toe, k = PARAMETERS["unbalanced"]
    pulls = [
        pulled(law, *formulation, 0.02, 0.01)
        for law in (
            CrimpInterchange(E, 0.0, K, toe, k),
            tuple(CrimpToe(E_i, toe, k) for E_i in E),
        )
    ]
    coupled, alone = (result.states[-1] for result in pulls)
    assert coupled.energies == pytest.approx(alone.energies, rel=1e-9)
    for edge in ("right", "top"):
        assert coupled.reactions[edge] == pytest.approx(
            alone.reactions[edge], rel=1e-9, abs=1e-9
        )


def test_a_weft_that_is_pulled_along_stiffens_the_warp():
    """At a warp strain of 1 %, for three ratios of strains; the weft's lifts both."""
    law = CrimpInterchange(*PARAMETERS["balanced"])
    tensions = [
        pulled(law, Macro(), "irregular", 0.01, weft).states[-1].reactions["right"][0]
        for weft in (-0.01, 0.0, 0.01)
    ]
    assert tensions[1] > 1.3 * tensions[0]
    assert tensions[2] > 1.3 * tensions[1]
