from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    Newton,
    Ply,
    Quadratic,
    StepError,
    Term,
    equilibrium_near,
)
from skfem_textile.mesh.splitting import cut, split
from skfem_textile.scenes import Case, bias_extension
from skfem_textile.solve import globalisation, newton, search
from skfem_textile.solve.problem import Evaluation
from skfem_textile.solve.search import AcceptedEquilibrium, EquilibriumSearch, Target
from skfem_textile.solve.states import NoEquilibriumError


@pytest.mark.parametrize(
    "E", [1e8, *(pytest.param(E, marks=pytest.mark.slow) for E in (1e4, 1e5))]
)
@pytest.mark.parametrize(
    ("formulation", "size", "made"),
    [
        (Macro(), (4, 8), split),
        (Macro(), (4, 8), lambda mesh: split(cut(mesh))),
        (Quadratic(80.0), (8, 16), cut),
    ],
    ids=["macro", "macro triangles", "mean"],
)
def test_a_step_with_kinks_needs_4_iterations(formulation, size, made, E, monkeypatch):
    """Five if the tension is predicted, and not the force over the stretch.

    Further iterations update the stabilisation stiffnesses.
    """
    monkeypatch.setattr(Ply, "updated", lambda _, parameters, *others: parameters)
    scene = bias_extension(made(bias_extension(size=size).mesh))
    fabric = Fabric(E, 0.5, scene.warp, scene.weft)
    case = Case(scene=scene, fabric=fabric, formulation=formulation, steps=4)
    assert case.run().linear_solves <= 18


class Found(NamedTuple):
    """Equilibrium of `test_an_updated_state_keeps_its_difficulty`."""

    u: str = "u"
    f: str = "f"
    p: str = "p"
    tangent: None = None


def test_an_updated_state_keeps_its_difficulty(monkeypatch):
    ply = SimpleNamespace(updated=lambda p, u, t: {}, terms=())
    start = Evaluation(1.0, *np.zeros((3, 1)), {}, {})
    problem = SimpleNamespace(ply=ply, evaluation=lambda *_: start, contacts=())
    trial = SimpleNamespace(problem=problem, equilibrium=Found())
    states = iter(
        [AcceptedEquilibrium(trial, 9, False), AcceptedEquilibrium(trial, 0, False)]
    )
    changes = iter([1.0, 0.0])
    monkeypatch.setattr(EquilibriumSearch, "_first", lambda *_: next(states))
    monkeypatch.setattr(search, "_change", lambda *_: next(changes))
    equilibria = EquilibriumSearch(problem, None, (), None)
    again = equilibria(Target(1.0, 1.0, None, None, None))
    assert again == AcceptedEquilibrium(trial, 9, True)


class Towards(Term):
    """A force that grows with the distance to a point and saturates soon."""

    name, role, line_search = "towards", "internal", True

    def __init__(self, basis, x, force, reach):
        self.x, self.force, self.reach, self.n = x, force, reach, basis.N

    def _over_reach(self, u):
        return (u[-1] - self.x) / self.reach

    def energy(self, u, t, p):
        return self.force * self.reach * np.hypot(1, self._over_reach(u))

    def residual(self, u, t, p):
        y = self._over_reach(u)
        return np.append(np.zeros(self.n - 1), self.force * y / np.hypot(1, y))

    def tangent(self, u, t, p):
        slope = self.force / self.reach / np.hypot(1, self._over_reach(u)) ** 3
        return csr_matrix(([slope], ([self.n - 1], [self.n - 1])), (self.n, self.n))


def test_a_line_search_prevents_overshooting():
    """Far from the point the tangent is small: whole increments pass it by more."""
    ply = Ply(MeshQuad().refined(1).with_defaults(), Fabric(10.0, 3.0), Full())
    term = Towards(ply.basis, 0.02, 3.0, 0.01)
    ply = Ply(ply.mesh, ply.fabric, Full(), [term])
    arguments = ply, {"clamp": Condition("bottom")}, ply.basis.zeros()
    method = Newton(longest=np.inf)
    assert equilibrium_near(*arguments, method=method).u[-1] == pytest.approx(
        0.0193, 1e-2
    )
    term.line_search = False
    with pytest.raises(NoEquilibriumError):
        equilibrium_near(*arguments, method=method)


def test_an_unconverged_iteration_continues_downhill(monkeypatch):
    scene = bias_extension(size=(8, 16))
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, Macro())

    def run():
        method = Newton(most=5)
        return LoadStepper(ply, scene.conditions, 1, method=method, max_halvings=0)

    energies, applied = [], globalisation.Descent.__call__

    def recorded(descent, *others):
        at, increment = applied(descent, *others)
        reached = at.u, at.u + increment.du
        energies.append([descent.problem.energy(u, at.parameters) for u in reached])
        return at, increment

    monkeypatch.setattr(globalisation.Descent, "__call__", recorded)
    assert run().run().converged
    assert energies
    assert all(after <= before for before, after in energies)
    monkeypatch.setattr(newton, "_DESCENT", 0)
    with pytest.raises(StepError):
        run().run()
