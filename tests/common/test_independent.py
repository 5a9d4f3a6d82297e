"""Energies and forces of every formulation agree with an independent implementation.

`independent` is that implementation; `random_plies` generates the problems.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from skfem import MeshTri

from skfem_textile import Fabric, Full, Macro, OnePoint, Ply, Quadratic
from tests.helpers import independent as plain
from tests.helpers.random_plies import (
    SHEARS,
    TENSIONS,
    fibres,
    macro_elements,
    motion,
    quads,
    split_both,
    split_quads,
    split_triangles,
    triangles,
    with_middles,
)

# Every law is tested with every second formulation.  In the long form every pair of a
# tension law and a shear law is tested with every formulation.
N_LAWS, N_PAIRS = 6, 30
# The last two laws couple warp and weft: a few formulations treat them differently.
COUPLED, OF_COUPLED = 4, {"full", "energy", "macro, steps", "quadratic, mean"}


# Formulations: arguments of the library, and terms of the independent implementation


class Problem(NamedTuple):
    """A ply, the same cloth, its macro-elements, converged states and another state."""

    ply: Ply
    cloth: plain.Cloth
    macros: list | None
    converged: list
    x: np.ndarray


class Case(NamedTuple):
    """A formulation, its mesh, its terms, and the number of earlier converged states.

    ``rule`` integrates the shear.  ``tension`` and ``stabilisation`` are energies of
    (problem, x); ``rate`` is a stabilisation without energy: its work and its forces.
    """

    formulation: Any
    mesh: Callable
    rule: str
    tension: Callable
    stabilisation: Callable | None = None
    rate: Callable | None = None
    states: int = 0


def pointwise(rule):
    return lambda p, x: plain.tension(p.cloth, x, rule)


def of_triangles(c):
    return lambda p, x: plain.quadratic_mean_tension(p.cloth, x, c)


def of_macros(*c):
    return lambda p, x: plain.macro_tension(p.cloth, x, p.macros, c, p.converged)


def hourglass(C_s):
    return lambda p, x: plain.hourglass(p.cloth, x, C_s)


def automatic(p, x):
    return plain.automatic_hourglass(p.cloth, x, p.macros, p.converged)


def isotropic(kappa):
    return lambda p, x: plain.isotropic(p.cloth, x, kappa)


def continuity(C_j):
    return lambda p, x: plain.continuity(p.cloth, x, C_j)


def rate(C_s):
    return lambda p, x: plain.rate(p.cloth, x, C_s, p.converged)


def one_point(formulation, stabilisation=None, **others):
    tension = pointwise("centre")
    return Case(formulation, quads, "centre", tension, stabilisation, **others)


def macro(mesh, **others):
    return Case(Macro(), mesh, "centre", of_macros(370, 700), automatic, **others)


def macro_of(C_s, c):
    chosen = of_macros(*c), hourglass(C_s)
    return Case(Macro(C_s, c), split_both, "centre", *chosen)


def quadratic(formulation, tension):
    return Case(formulation, triangles, "three", tension)


CASES = {
    "full": Case(Full(), quads, "gauss", pointwise("gauss")),
    "plain": one_point(OnePoint(0.0)),
    "energy": one_point(OnePoint(3.0), hourglass(3.0)),
    "isotropic": one_point(OnePoint(0.7, "isotropic"), isotropic(0.7)),
    "continuity": one_point(OnePoint(0.6, "continuity"), continuity(0.6)),
    "rate": one_point(OnePoint(0.9, "rate"), rate=rate(0.9)),
    "rate, steps": one_point(OnePoint(0.9, "rate"), rate=rate(0.9), states=2),
    "auto": one_point(OnePoint("auto"), automatic),
    "auto, steps": one_point(OnePoint("auto"), automatic, states=2),
    "macro triangles": macro(split_triangles),
    "macro quads": macro(split_quads),
    "macro both": macro(split_both),
    "macro, steps": macro(split_both, states=1),
    "macro, chosen": macro_of(2.0, (3.0, 90.0)),
    "quadratic": quadratic(Quadratic(), pointwise("three")),
    "quadratic, mean": quadratic(Quadratic(20.0), of_triangles(20.0)),
    "quadratic, stiff": quadratic(Quadratic(900.0), of_triangles(900.0)),
}


def random_problem(case, seed):
    rng = np.random.default_rng(seed)
    mesh, originals = case.mesh(rng)
    X, elements = mesh.p, list(mesh.t.T)
    if isinstance(mesh, MeshTri):
        X, elements = with_middles(mesh)
    (warp, A_1), (weft, A_2) = fibres(rng, seed, len(elements))
    tension, tension_laws = TENSIONS[seed % len(TENSIONS)]
    shear, shear_law = SHEARS[seed % len(SHEARS)]

    def both(e, X):
        return A_1(e, X), A_2(e, X)

    cloth = plain.Cloth(X, elements, both, tension_laws, shear_law)
    turns = [(seed // 3 + i) % 2 for i in range(case.states + 1)]
    *converged, x = [motion(rng, cloth, turn) for turn in turns]
    ply = Ply(mesh, Fabric(tension, shear, warp, weft), case.formulation)
    macros = None if originals is None else macro_elements(mesh, originals)
    return Problem(ply, cloth, macros, converged, x)


def library_terms(problem):
    """Energies and nodal forces (2, n_nodes) of each term, and all forces."""
    ply = problem.ply
    dofs = ply.nodal(np.arange(ply.basis.N))

    def displacement(x):
        u = ply.basis.zeros()
        u[dofs] = x[..., 0] - problem.cloth.X
        return u

    parameters = ply.parameters_at_rest
    for state in problem.converged:
        parameters = ply.updated(parameters, displacement(state))
        parameters = ply.advanced(parameters, displacement(state))
    arguments = displacement(problem.x), 1.0, parameters
    forces = {name: ply.nodal(f) for name, f in ply.residuals(*arguments).items()}
    return ply.energies(*arguments), forces, ply.nodal(ply.residual(*arguments))


def independent_terms(case, problem):
    """The same from the independent implementation."""

    def energies(x):
        """Energies by name of the term."""
        computed = {"tension": case.tension(problem, x)}
        if problem.cloth.shear is not None:
            computed["shear"] = plain.shear(problem.cloth, x, case.rule)
        if case.stabilisation is not None:
            computed["stabilisation"] = case.stabilisation(problem, x)
        if plain.corner_stiffness(problem.cloth) > 0:
            computed["corners"] = plain.corners(problem.cloth, x)
        return computed

    derivatives = energies(plain.imaginary_moves(problem.x))
    forces = {name: plain.derivative(E) for name, E in derivatives.items()}
    work = {name: float(E[0]) for name, E in energies(problem.x).items()}
    if case.rate is not None:
        work["stabilisation"], forces["stabilisation"] = case.rate(problem, problem.x)
    return work, forces, sum(forces.values())


def is_short(number, name, seed):
    """True for the problems of the short form."""
    laws = N_LAWS if name in OF_COUPLED else COUPLED
    return seed < laws and (number + seed) % 2 == 0


@pytest.mark.parametrize(
    ("case", "seed"),
    [
        pytest.param(
            *(case, seed),
            id=f"{name}-{seed}",
            marks=[pytest.mark.slow] * (not is_short(number, name, seed)),
        )
        for number, (name, case) in enumerate(CASES.items())
        for seed in range(N_PAIRS)
    ],
)
def test_energies_and_forces_agree_with_their_definitions(case, seed):
    problem = random_problem(case, seed)
    energies, forces, whole = library_terms(problem)
    expected_energies, expected_forces, expected_whole = independent_terms(
        case, problem
    )
    assert energies == pytest.approx(expected_energies, rel=1e-9, abs=0)
    assert forces.keys() == expected_forces.keys()
    for name, expected in expected_forces.items():
        assert_close(forces[name], expected)
    assert_close(whole, expected_whole)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["energy", "macro both", "quadratic"])
def test_closing_corners_resist_as_defined(name, seed):
    problem = random_problem(CASES[name], seed)
    x = problem.x + closing_moves(problem, seed)
    computed = library_terms(problem._replace(x=x))
    expected = plain.corners(problem.cloth, x)
    assert expected > 0
    assert computed[0]["corners"] == pytest.approx(expected.item(), rel=1e-9)
    moved = plain.corners(problem.cloth, plain.imaginary_moves(x))
    assert_close(computed[1]["corners"], plain.derivative(moved))


def closing_moves(problem, seed):
    """Displacements of nodes that fold some corners."""
    moves = 0.05 * np.random.default_rng(seed).standard_normal(problem.x.shape)
    while plain.smallest_det_F(problem.cloth, (problem.x + moves)[..., 0]) > -0.05:
        moves *= 1.1
    return moves


def assert_close(forces, expected):
    np.testing.assert_allclose(
        forces, expected, rtol=0, atol=1e-9 * np.abs(expected).max()
    )
