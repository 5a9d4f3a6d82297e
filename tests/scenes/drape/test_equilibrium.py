"""Plies on surfaces are in equilibrium along them, and stable."""

import numpy as np
import pytest

from skfem_textile import (
    BodyForce,
    CheckpointError,
    Condition,
    Fabric,
    LoadStepper,
    Macro,
    OnSurface,
    Ply,
    Result,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.drape import Sphere
from skfem_textile.scenes import Case, hemisphere
from skfem_textile.solve.continuation import loads_drive, moves
from skfem_textile.solve.problem import reduced
from tests.helpers import arguments_of, random_u
from tests.helpers.tools import (
    RADIUS,
    SYMMETRY,
    geodesic_u,
    problem_of,
    square,
)

# Plies in equilibrium on surfaces: tangent, forces, folds, checkpoints


@pytest.mark.parametrize("held", [{}, SYMMETRY, {"slope": None}])
def test_the_reduced_tangent_is_the_hessian_of_the_energy_on_the_surface(held):
    """Against second differences of the energy along retracted motions."""
    fabric = Fabric(50.0, 0.5, warp=(2, 1), weft=(-1, 3))
    ply = square(6.0, 2, fabric)
    if "slope" in held:  # an inclined direction, with the normal rotated beside it
        held = {"slope": Condition("left", 0.0, direction=(1.0, 2.0, 0.3))}
    sphere = drape.Sphere(8.0, (0, 0, -8))
    problem = problem_of(ply, {"on": OnSurface(sphere)} | held).at(1.0)
    u = problem.moved(geodesic_u(ply, sphere), random_u(ply, 1, 0.1))
    p, h = ply.parameters_at_rest, 1e-3
    free, turn = problem.constraints.free, problem.turn(u)
    upper = reduced(problem.system, problem.blocks(u, None, p), turn).upper
    K = (upper + upper.T).toarray() - np.diag(upper.diagonal())
    rng, f = np.random.default_rng(2), problem.residual(u, p)
    for _ in range(3):
        q = np.zeros(ply.basis.N)
        q[free] = rng.standard_normal(len(free))
        d = turn @ q
        forward, back = (problem.moved(u, s * h * d) for s in (1, -1))
        ends = problem.energy(forward, p), problem.energy(back, p)
        energy = sum(ends) - 2 * problem.energy(u, p)
        # Retraction along the normal is second-order: the effect of its curvature
        # on the slope along the surface is subtracted.
        bend = problem.unfixed(f, u) @ (forward + back - 2 * u)
        expected = q[free] @ K @ q[free]
        assert (energy - bend) / h**2 == pytest.approx(expected, rel=2e-5)
        slope = (ends[0] - ends[1]) / (2 * h)
        assert slope == pytest.approx(problem.unfixed(f, u) @ d, rel=1e-5)


def test_nodes_lie_on_the_surface_without_residual_along_it():
    ply = square(
        loads=[Traction("right", (0.5, 0, -0.3)), Traction("top", (0, 0.5, 0))]
    )
    sphere = drape.Sphere(100.0, (0, 0, -100))
    conditions = {"on": OnSurface(sphere)} | SYMMETRY
    start = geodesic_u(ply, sphere)
    state = equilibrium_near(ply, conditions, start)
    x = ply.positions(state.u)
    np.testing.assert_allclose(sphere.level(x), 0.0, atol=1e-9)
    forces, n = ply.nodal(ply.residual(*arguments_of(state))), sphere.gradient(x)
    along = forces - (forces * n).sum(axis=0) * n
    inner = (ply.nodes > 0).all(axis=0)
    assert np.abs(along[:, inner]).max() < 1e-7
    assert state.verdict.stable
    np.testing.assert_allclose(state.forces["on"], forces.sum(axis=1))


def test_an_inverted_element_is_folded():
    ply = square(cells=4)
    sphere = drape.Sphere(100.0, (0, 0, -100))
    problem = problem_of(ply, {"on": OnSurface(sphere)}).at(1.0)
    x = drape.exponential_map(sphere, ply.nodes)
    assert (problem.area_ratio(drape.displacement(ply.nodes, x)) > 0).all()
    mirrored = x * [[-1], [1], [1]]
    ratio = problem.area_ratio(drape.displacement(ply.nodes, mirrored))
    assert (ratio > 0).all()  # the other face of the ply, but without a fold
    x[0, ply.nodes[0] > 50] -= 2 * 15.0  # the last column laid back over the others
    x = x * 100.0 / np.linalg.norm(x - sphere.centre[:, None], axis=0)
    ratio = problem.area_ratio(drape.displacement(ply.nodes, x))
    folded = ply.mesh.p[0, ply.mesh.t].max(axis=0) > 50
    np.testing.assert_array_equal(ratio < 0, folded)


def test_nodes_by_name_lie_on_surfaces_and_others_are_free():
    ply = square(loads=[Traction("top", (0.0, 1.0, 0.0))])
    plane = drape.Plane((0, 0, 0), (0, 0, 1))
    slope = drape.Plane((60, 0, 0), (-1, 0, 1))
    conditions = {
        "flat": OnSurface(plane, lambda X: X[0] < 59),
        "rail": OnSurface(slope, "right"),
        "clamp": Condition("left"),
        "foot": Condition("bottom", (None, 0.0, None)),
    }
    start = ply.basis.zeros()
    state = equilibrium_near(ply, conditions, start)
    x = ply.positions(state.u)
    np.testing.assert_allclose(x[2, ply.nodes[0] < 59], 0.0, atol=1e-9)
    right = ply.nodes[0] == 60
    np.testing.assert_allclose(x[2, right], x[0, right] - 60, atol=1e-9)
    assert state.verdict.stable


def test_a_run_is_resumed_on_the_same_surface_only(tmp_path):
    c = np.sqrt(0.5)
    ply = square(100.0, 4, Fabric(1e5, 0.1, warp=(c, c), weft=(-c, c)))

    def stepper(radius):
        sphere = drape.Sphere(radius, (0, 0, -radius))
        conditions = {"on": OnSurface(sphere)} | SYMMETRY
        return LoadStepper(ply, conditions, 2, checkpoint=tmp_path)

    u = stepper(100.0).run().u
    np.testing.assert_allclose(stepper(100.0).run(resume=True).u, u, atol=1e-9)
    with pytest.raises(CheckpointError, match="surfaces"):
        stepper(101.0).run(resume=True)


def test_a_state_without_a_run_has_a_result():
    scene = hemisphere(size=(4, 4))
    case = Case(scene=scene, fabric=Fabric(1e4, 0.1), steps=1)
    ply, run = case.ply(), case.run()
    state = equilibrium_near(ply, scene.conditions, run.u, warn_only=["stabilisation"])
    result = Result.of_state(ply, scene.conditions, state)
    assert result.converged
    np.testing.assert_allclose(result.u, run.u, atol=1e-3)
    summary = scene.summary(result)
    assert summary["max_contact_pressure_N_per_mm2"] == pytest.approx(
        scene.summary(run)["max_contact_pressure_N_per_mm2"], rel=1e-3
    )
    assert summary["error_interval"].startswith("none: ")


# Control of a ply on a surface: by its loads, or by the surface


def weight(w):
    return BodyForce((0.0, 0.0, -w))


@pytest.mark.parametrize(("w", "drives"), [(1e-12, False), (1e-5, False), (1e-2, True)])
def test_a_load_that_does_most_of_the_work_drives_a_ply_on_a_tool(w, drives):
    tool = Sphere(RADIUS, (0.0, 0.0, -RADIUS))
    ply = square(30.0, 4, Fabric(1e3, 0.1, bending=(1.0, 1.0)), loads=[weight(w)])
    conditions = {"on": OnSurface(tool)} | SYMMETRY
    state = equilibrium_near(ply, conditions, geodesic_u(ply, tool))
    problem = problem_of(ply, conditions).at(1.0)
    state_data = state.u, state.parameters, state.energies
    problem.moves = bool(moves(problem, [1.0]))
    assert loads_drive(problem, *state_data) == drives


@pytest.mark.slow
def test_a_light_ply_follows_the_path_of_one_without_weight():
    """A difficult step of the ply is not a limit point of the load."""
    scene = hemisphere(
        size=(6, 6), radius=60.0, width=120.0, height=120.0, tension=0.0, part="quarter"
    )
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(1.0, 1.0))
    loads = [*scene.loads_of(fabric), weight(1e-12)]
    options = {"dimension": 3, "fibre_ends": scene.fibre_ends}
    ply = Ply(scene.mesh, fabric, Macro(), loads, **options)
    assert LoadStepper(ply, scene.conditions, 4).run().converged
