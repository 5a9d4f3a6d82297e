"""Nodal forces of the variation of the tension, and intervals beside poles."""

import numpy as np
import pytest

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Locking,
    Macro,
    OnePoint,
    Outline,
    Ply,
    Quadratic,
    mesh_outline,
)
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve.interval import work_of
from skfem_textile.solve.tension_variation import forces_of_tension_variation

MEAN = Quadratic(70.0, points=6)


def stretched(formulation, strain):
    """Omitted forces of a rectangle stretched along its warp by a function of x."""
    mesh = rectangle(2, 1, (8, 4), "delaunay")
    ply = Ply(mesh, Fabric(1e3, 1.0), formulation)
    u = np.zeros((len(ply.nodes.T), 2))
    u[:, 0] = strain(ply.nodes[0])
    return ply, forces_of_tension_variation(ply, u.ravel())


def test_a_constant_tension_has_no_variation():
    _, forces = stretched(MEAN, lambda x: 0.01 * x)
    assert np.abs(forces).max() < 1e-10


@pytest.mark.parametrize("formulation", [Macro(), Quadratic(), OnePoint()], ids=repr)
def test_other_elements_omit_no_forces(formulation):
    _, forces = stretched(formulation, lambda x: 0.01 * x**2)
    assert not forces.any()


def test_a_linear_tension_is_recovered_inside():
    """Its work over a further such stretch is the variance of the tension."""
    ply, forces = stretched(MEAN, lambda x: 1e-6 * x**2)
    over = np.zeros((len(ply.nodes.T), 2))
    over[:, 0] = ply.nodes[0] ** 2
    # N = 2e-3 x and δλ = 2 x: 4e-3 times the variance of x over the area of triangles.
    x, area = ply.mesh.p[0][ply.mesh.t], ply.basis.dx.sum(axis=1)
    variance = (x.var(axis=0) * area / 4).sum()
    # The field recovered at free ends is too flat.
    assert forces @ over.ravel() == pytest.approx(4e-3 * variance, rel=0.25)


def test_forces_balance():
    _, forces = stretched(MEAN, lambda x: 0.01 * np.sin(3 * x))
    assert np.abs(forces).max() > 1e-3
    assert np.abs(forces.reshape(-1, 2).sum(axis=0)).max() < 1e-10


def test_the_load_of_steep_fibres_is_inside():
    """The converged load is 151.7 to 152.6 N·mm."""
    angle, height = np.radians(66.823), 138.984
    pull = pull_to(86.418, angle, height)
    run = load_of(Fabric(12521.34, 0.53967, *fibres(angle)), height, pull)
    inside(run, 151.74, 152.6)


def test_the_load_beside_the_pole_of_a_law_is_inside():
    """The converged load is 3020 to 3031 N·mm."""
    angle, pole = np.radians(39.1424), np.radians(59.7048)
    height = 95.0842
    pull = pull_to(64.3906, angle, height)
    law = Locking(0.53967, pole)
    run = load_of(Fabric(12521.34, law, *fibres(angle)), height, pull)
    inside(run, 3020.0, 3031.0)


def pull_to(degrees, angle, height):
    """Displacement with inextensible fibres at an angle to the clamps."""
    free = (height / np.sin(angle) - 50 / np.cos(angle)) / 2
    return 2 * free * (np.sin(np.radians(degrees)) - np.sin(angle))


def fibres(angle):
    c, s = np.cos(angle), np.sin(angle)
    return (c, s), (-c, s)


def load_of(fabric, height, pull):
    """Work of the load on the default net, and its half-width."""
    outline = Outline([[0, 50, 50, 0], [0, 0, height, height]])
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, pull))}
    mesh = mesh_outline(outline, fabric, held)
    stepper = LoadStepper(Ply(mesh, fabric, Quadratic(400.0, points=6)), held, 1)
    result = stepper.run()
    work = work_of(stepper.problem.at(1.0), result.states[-1])
    return work, result.error.load


def inside(run, low, high):
    work, half = run
    assert work * (1 - half) < low
    assert work * (1 + half) > high
    assert half < 0.06


def test_one_point_on_triangles_is_compared_with_macro_elements():
    """One point locks on triangles; 43.214 N: `docs/angles/references.json`."""
    scene = bias_extension("delaunay", (8, 16))
    ply = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft), OnePoint())
    assert ply.formulation.reference(ply.mesh) == Macro()
    result = LoadStepper(ply, scene.conditions, 2).run()
    load, half = result.states[-1].reactions["top"][1], result.error.load
    assert 0.02 < load / 43.214 - 1 < half * load / 43.214
    assert half < 2.5 * (1 - 43.214 / load)
