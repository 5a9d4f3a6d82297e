"""Creases and folds in space: told from turns, and refused."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, LoadStepper, OnePoint, Ply


def pair_of_elements():
    return MeshQuad.init_tensor(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0]))


def test_a_crease_and_a_fold_are_told_from_a_turn():
    ply = Ply(pair_of_elements(), Fabric(10.0, 1.0), OnePoint(), dimension=3)
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))

    def bent(degrees):
        """The right element turned about the edge between both."""
        x, angle = X.copy(), np.radians(degrees)
        right = X[0] > 1.5
        x[0, right], x[2, right] = 1 + np.cos(angle), np.sin(angle)
        return (x - X).T.ravel()

    for degrees, creased in (
        (0, []),
        (80, []),
        (-80, []),
        (100, [0, 1]),
        (-170, [0, 1]),
    ):
        assert ply.creased(bent(degrees)).tolist() == creased
        np.testing.assert_allclose(ply.least_area_ratio(bent(degrees)), 1.0)
    u = ply.basis.zeros()
    corner = np.flatnonzero((X[0] == 2) & (X[1] == 1))[0]
    u[3 * corner : 3 * corner + 2] = -0.7  # past the diagonal
    assert ply.least_area_ratio(u).min() < 0
    plane = Ply(pair_of_elements(), Fabric(10.0, 1.0), OnePoint())
    u_plane = u.reshape(-1, 3)[:, :2].ravel()
    np.testing.assert_allclose(
        ply.least_area_ratio(u), plane.least_area_ratio(u_plane), atol=1e-14
    )
    assert plane.creased(u_plane).size == 0


def test_a_creased_state_is_refused_unless_it_may_warn():
    """The element at the end lies on its neighbour, held there."""
    ply = Ply(pair_of_elements(), Fabric(10.0, 1.0), OnePoint(), dimension=3)

    def rolled(X, t):
        angle = np.pi * t
        right = np.maximum(X[0] - 1, 0.0)
        return np.array([right * (np.cos(angle) - 1), 0 * right, right * np.sin(angle)])

    conditions = {"all": Condition(lambda X: X[0] > -1, rolled)}
    with pytest.raises(RuntimeError, match="a crease that no mesh resolves"):
        LoadStepper(ply, conditions, 3, max_halvings=0).run()
    result = LoadStepper(ply, conditions, 3, warn_only=["crease"]).run()
    assert result.converged
