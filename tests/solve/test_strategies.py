from types import SimpleNamespace

import numpy as np
import pytest

from skfem_textile import Fabric, Macro, Ply, Quadratic
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes import Case, bias_extension
from skfem_textile.solve.newton import _shortened
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.stepping import equilibrium_search
from skfem_textile.solve.stepping.equilibrium_search import (
    EquilibriumSearch,
    Found,
    Goal,
)


class Slope:
    """An energy that falls for ever, of a ply that folds at u = 1."""

    def energy(self, u, parameters):
        return -float(u[0])

    def free(self, f, u):
        return f

    def moved(self, u, du):
        return u + du

    def least_area_ratio(self, u):
        return 1.0 - u

    @property
    def ply(self):
        return self


def test_an_increment_is_shortened_until_it_folds_no_element():
    du = _shortened(Slope(), np.zeros(1), np.array([4.0]), np.array([-1.0]), {})
    assert du == 0.5


def test_an_increment_uphill_is_turned_round():
    du = _shortened(Slope(), np.zeros(1), np.array([-0.5]), np.array([-1.0]), {})
    assert du == 0.5


def test_where_every_increment_folds_the_search_gives_up():
    with pytest.raises(NoEquilibriumError, match="no descent") as error:
        _shortened(Slope(), np.ones(1), np.array([4.0]), np.array([-1.0]), {})
    assert error.value.elements.tolist() == [0]


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
def test_a_state_that_is_found_again_was_as_hard_to_find_as_at_first(
    altered, followed, monkeypatch
):
    found = iter([Found("first", altered, followed, False), Found("", 0, True, False)])
    starts = iter(["start", None])

    def first(*_):
        clock.solves += 5
        return next(found)

    monkeypatch.setattr(EquilibriumSearch, "_first", first)
    monkeypatch.setattr(
        equilibrium_search, "_start_of_another", lambda trial: next(starts)
    )
    clock = SimpleNamespace(solves=3)
    search = EquilibriumSearch(SimpleNamespace(clock=clock), (), (), None)
    again = search(Goal(1.0, 1.0, None, None, None))
    assert again == Found("", altered, followed, True, solves_again=5)
