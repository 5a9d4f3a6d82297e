from types import SimpleNamespace

import pytest

from skfem_textile import Fabric, Macro, Ply, Quadratic
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes import Case, bias_extension
from skfem_textile.solve.stepping import equilibrium_search
from skfem_textile.solve.stepping.equilibrium_search import (
    EquilibriumSearch,
    Found,
    Goal,
)


@pytest.mark.parametrize("E", [1e4, pytest.param(1e5, marks=pytest.mark.long), 1e8])
@pytest.mark.parametrize(
    ("formulation", "size", "made"),
    [
        (Macro(), (8, 16), split),
        (Macro(), (8, 16), lambda mesh: split(cut(mesh))),
        (Quadratic(80.0), (16, 32), cut),
    ],
    ids=["macro", "macro triangles", "mean"],
)
def test_a_step_with_kinks_takes_four_iterations(
    formulation, size, made, E, monkeypatch
):
    """Five if the tension is predicted, and not the force over the stretch.

    Further ones find the stiffnesses of the discretisation.
    """
    monkeypatch.setattr(Ply, "updated", lambda _, parameters, *others: parameters)
    scene = bias_extension(made(bias_extension(size=size).mesh))
    fabric = Fabric(E, 0.5, scene.warp, scene.weft)
    case = Case(scene=scene, fabric=fabric, formulation=formulation, steps=4)
    assert case.run().linear_solves <= 18


@pytest.mark.parametrize(("altered", "followed"), [(9, True), (0, False)])
def test_a_state_that_was_updated_counts_as_hard_as_at_first(
    altered, followed, monkeypatch
):
    trial = SimpleNamespace(start_with=lambda parameters, share: "start")
    found = iter([Found(trial, altered, followed, False), Found("", 0, True, False)])
    changes = iter([1.0, 0.0])
    monkeypatch.setattr(EquilibriumSearch, "_first", lambda *_: next(found))
    monkeypatch.setattr(
        equilibrium_search, "_update", lambda trial: ({}, next(changes))
    )
    search = EquilibriumSearch(None, None, (), None)
    again = search(Goal(1.0, 1.0, None, None, None))
    assert again == Found("", altered, followed, True)
