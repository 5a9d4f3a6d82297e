"""Cantilevers against the elastica."""

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Traction,
)
from tests.helpers.bent_plies import SIDE, D


def elastica(alpha, weight=False):
    """Tip of a cantilever of unit length and stiffness."""

    def slopes(s, y):
        load = alpha * (1 - s) if weight else alpha
        return np.array([y[1], -load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])])

    def ends(a, b):
        return np.array([a[0], b[1], a[2], a[3]])

    s = np.linspace(0, 1, 201)
    guess = np.array([s * min(1.2, alpha / 3), 1 - s, s, 0 * s])
    found = solve_bvp(slopes, ends, s, guess, tol=1e-10, max_nodes=100_000)
    return found.y[2:, -1]


def cantilever(n, alpha, weight, formulation):
    """Tip over the length after a single step, and how many steps it took."""
    mesh = MeshQuad.init_tensor(np.linspace(0, SIDE, n + 1), np.linspace(0, 20, 3))
    load = (0.0, 0.0, alpha * D / SIDE**2)
    loads = [Traction("right", load)]
    if weight:
        loads = [BodyForce((0.0, 0.0, alpha * D / SIDE**3))]
    ply = Ply(
        *(mesh.with_defaults(), Fabric(1e4, 0.1, bending=(D, D)), formulation, loads),
        dimension=3,
        fibre_ends={"left": "clamped"},
    )
    conditions = {"left": Condition("left")}
    result = LoadStepper(ply, conditions, 1, solver="superlu").run()
    tip = ply.nodes[0] > SIDE - 1e-9
    x, _, z = ply.nodal(result.u)[:, tip].mean(axis=1) / SIDE
    return np.array([1 + x, z]), len(result.states) - 1


def test_the_elastica_that_the_tip_is_compared_with():
    """Values computed by another program."""
    for alpha, weight, tip in (
        (1.0, False, (0.943567, 0.301721)),
        (10.0, False, (0.445004, 0.810609)),
        (8.0, True, (0.724425, 0.640631)),
    ):
        np.testing.assert_allclose(elastica(alpha, weight), tip, atol=1e-6)


@pytest.mark.parametrize(
    ("formulation", "halved"),
    [(OnePoint(), 1), (Macro(), 2)],
    ids=["one point", "macro"],
)
@pytest.mark.parametrize(
    ("alpha", "weight", "off"),
    [(1.0, False, 2e-4), (10.0, False, 1e-3), (8.0, True, 1e-3)],
)
def test_a_cantilever_is_an_elastica_to_second_order_in_one_step(
    formulation, halved, alpha, weight, off
):
    exact = elastica(alpha, weight)
    (coarse, _), (fine, steps) = (
        cantilever(n // halved, alpha, weight, formulation) for n in (16, 32)
    )
    assert steps == 1
    assert abs(fine[1] - exact[1]) < off
    assert (np.abs(coarse - exact) > 3.3 * np.abs(fine - exact)).all()


def test_a_cantilever_of_quadratic_triangles_is_an_elastica():
    tip, _ = cantilever(32, 1.0, False, Quadratic())
    np.testing.assert_allclose(tip, elastica(1.0), atol=5e-4)
