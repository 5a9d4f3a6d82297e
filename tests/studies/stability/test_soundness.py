from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
)
from skfem_textile.scenes import strip
from studies.stability.soundness import is_sound, is_unfolded

SMALL = partial(strip, size=(4, 6))


def test_soundness_requires_equilibrium_stability_and_no_folds():
    scene = SMALL()
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(10.0))
    u = LoadStepper(ply, scene.conditions, 4).run().u
    assert is_sound(ply, scene, u)
    for shift in (1e-2, 10.0):
        moved = u.copy()
        moved[ply.basis.nodal_dofs[:, 17]] += shift
        assert not is_sound(ply, scene, moved)
    assert not is_sound(ply, scene, 0.9 * u)


def test_the_equilibrium_includes_the_whole_energy():
    """On this mesh corners resist at the end."""
    scene = strip(size=(6, 9), seed=0)
    ply = Ply(scene.mesh, Fabric(1e4), OnePoint(1.0))
    result = LoadStepper(ply, scene.conditions, 1).run()
    assert result.summary()["corners_energy"] > 1e-3
    assert is_sound(ply, scene, result.u)
    free = Ply(scene.mesh, Fabric(1e4), OnePoint(1.0))
    free._terms = tuple(term for term in free.terms if term.name != "corners")
    assert not is_sound(free, scene, result.u)


def test_the_equilibrium_uses_the_stiffnesses_of_its_step():
    """Fibres with crimp are stiffer at the end than at rest."""
    scene = SMALL()
    ply = Ply(scene.mesh, Fabric(CrimpToe(1e3, 0.004, 1.0), 0.5), Macro())
    state = LoadStepper(ply, scene.conditions, 1).run().states[-1]
    assert is_sound(ply, scene, state.u, state.parameters)
    assert not is_sound(ply, scene, 0.999 * state.u, state.parameters)
    assert not is_sound(ply, scene, state.u)


@pytest.mark.parametrize(("by", "sound"), [(-0.49, True), (-0.51, False)])
def test_a_state_folded_at_a_corner_is_not_sound(by, sound):
    """Every node is prescribed, so that no other criterion is violated."""

    def pushed(X, t):
        return by * t * (X.sum(axis=0) == 2) * np.ones((2, 1))

    held = {"all": Condition(lambda X: X[0] >= 0, pushed)}
    scene = replace(SMALL(), mesh=MeshQuad(), conditions=held)
    ply = Ply(scene.mesh, Fabric(1e4), Full())
    u = ply.basis.zeros()
    u[ply.basis.nodal_dofs] = pushed(ply.mesh.p, 1.0)
    assert is_sound(ply, scene, u) is sound


def moved(ply, node, by):
    u = ply.basis.zeros()
    u[[2 * node, 2 * node + 1]] = by
    return u


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_quadrilateral_is_folded_at_a_corner(mirrored):
    """The corner at (1, 1) passes the diagonal; det F > 0 at the 2×2 points."""
    X = np.array([[0, 1, 1, 0], [0, 0, 1, 1.0]])
    X = X[::-1] if mirrored else X
    ply = Ply(MeshQuad(X, np.arange(4)[:, None]), Fabric(1e4), Full())
    for by, unfolded in ((-0.49, True), (-0.51, False)):
        u = moved(ply, 2, by)
        assert ply.area_ratio(u, ply.fine_points).min() > 0
        assert is_unfolded(ply, u) is unfolded


def test_a_quadratic_triangle_is_folded_at_a_corner():
    """The midpoint of an edge passes a quarter of it; det F > 0 at six points."""
    mesh = MeshTri(np.array([[0, 1, 0], [0, 0, 1.0]]), np.arange(3)[:, None])
    ply = Ply(mesh, Fabric(1e4, 1.0), Quadratic())
    (middle,) = np.flatnonzero((ply.nodes.T == (0.5, 0)).all(axis=1))
    for by, unfolded in ((-0.24, True), (-0.26, False)):
        u = moved(ply, middle, [by, 0])
        assert ply.area_ratio(u, ply.fine_points).min() > 0
        assert is_unfolded(ply, u) is unfolded


@pytest.mark.parametrize("at", [0.5 - 1e-11, 0.49])
def test_a_corner_flat_or_reflex_at_rest_is_ignored(at):
    X = np.array([[0, 1, at, 0], [0, 0, at, 1.0]])
    ply = Ply(MeshQuad(X, np.arange(4)[:, None]), Fabric(1e4), Full())
    for by in (0.0, -0.01, 0.02):
        assert is_unfolded(ply, moved(ply, 2, by))
    assert not is_unfolded(ply, moved(ply, 1, [-1.1, 0]))
    assert not is_unfolded(ply, moved(ply, 2, -0.4))  # a 2×2 point detects it


@pytest.mark.parametrize("formulation", [Full(), Quadratic()])
def test_all_elements_are_checked_in_agreement_with_the_library(formulation):
    mesh = (MeshTri if isinstance(formulation, Quadratic) else MeshQuad)().refined(2)
    ply, rng = Ply(mesh, Fabric(1e4, 1.0), formulation), np.random.default_rng(3)
    folded = set()
    for size in np.linspace(0.02, 0.12, 100):
        u = size * (2 * rng.random(ply.basis.N) - 1)
        inside = ply.area_ratio(u, ply.fine_points).min()
        unfolded = bool(min(ply.corners.area_ratio(u).min(), inside) > 0)
        assert is_unfolded(ply, u) is unfolded
        folded.add(unfolded)
    assert folded == {True, False}
