"""Plies on surfaces: tangent, verdict, exact answers, contact pressure, refusals."""

import numpy as np
import pytest
from helpers import wobble
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    AdaptiveStepper,
    CheckpointError,
    Condition,
    Fabric,
    LoadStepper,
    Macro,
    OnePoint,
    OnSurface,
    Ply,
    Quadratic,
    StepError,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem, Tangent
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.stepping import error_estimate
from skfem_textile.solve.stepping.error_estimate import estimated_error, problem_at
from studies.formulations.drape import chebyshev

SADDLE = drape.HeightField(
    lambda x, y: drape.Height(
        *(0.002 * (x * x - y * y), 0.004 * x, -0.004 * y),
        *(0.004 + 0 * x, 0 * x, -0.004 + 0 * x),
    )
)
SYMMETRY = {
    "x": Condition("left", (0.0, None, None)),
    "y": Condition("bottom", (None, 0.0, None)),
}


def square(side=60.0, cells=4, fabric=None, formulation=None, loads=()):
    s = np.linspace(0, side, cells + 1)
    mesh = MeshQuad.init_tensor(s, s).with_defaults()
    fabric, formulation = fabric or Fabric(1e4, 0.1), formulation or OnePoint()
    return Ply(mesh, fabric, formulation, loads, dimension=3)


def problem_of(ply, conditions):
    constraints = Constraints(ply.basis, conditions)
    return Problem(ply, constraints, solver_named("superlu")).at(1.0)


@pytest.mark.parametrize("held", [{}, SYMMETRY, {"slope": None}])
def test_the_reduced_tangent_is_that_of_the_energy_on_the_surface(held):
    """Against second differences of the energy along retracted motions."""
    fabric = Fabric(50.0, 0.5, warp=(2, 1), weft=(-1, 3))
    ply = square(6.0, 2, fabric)
    if "slope" in held:  # an inclined direction, beside which the normal is turned
        held = {"slope": Condition("left", 0.0, direction=(1.0, 2.0, 0.3))}
    problem = problem_of(ply, {"on": OnSurface(drape.Sphere(8.0, (0, 0, -8)))} | held)
    start = drape.exponential_map(drape.Sphere(8.0, (0, 0, -8)), ply.nodes)
    u = problem.moved(drape.displacement(ply.nodes, start), wobble(ply, 1, 0.1))
    tangent, h = Tangent(problem, u), 1e-3
    free, turn = problem.system.free, problem.turn(u)
    upper = tangent._matrix.upper
    K = (upper + upper.T).toarray() - np.diag(upper.diagonal())
    rng, f = np.random.default_rng(2), problem.residual(u)
    for _ in range(3):
        q = np.zeros(ply.basis.N)
        q[free] = rng.standard_normal(len(free))
        d = turn @ q
        there, back = (problem.moved(u, s * h * d) for s in (1, -1))
        energy = problem.energy(there) + problem.energy(back) - 2 * problem.energy(u)
        # Retraction along the normal is second-order: what the slope sees of its bend
        # along the surface is taken off.
        bend = problem.unfixed(f, u) @ (there + back - 2 * u)
        expected = q[free] @ K @ q[free]
        assert (energy - bend) / h**2 == pytest.approx(expected, rel=2e-5)
        slope = (problem.energy(there) - problem.energy(back)) / (2 * h)
        assert slope == pytest.approx(
            problem.free(f, u) @ q[problem.constraints.free], rel=1e-5
        )


def test_nodes_lie_on_the_surface_and_no_force_is_left_along_it():
    ply = square(
        loads=[Traction("right", (0.5, 0, -0.3)), Traction("top", (0, 0.5, 0))]
    )
    sphere = drape.Sphere(100.0, (0, 0, -100))
    conditions = {"on": OnSurface(sphere)} | SYMMETRY
    start = drape.displacement(ply.nodes, drape.exponential_map(sphere, ply.nodes))
    state = equilibrium_near(ply, conditions, start)
    x = np.pad(ply.nodes, ((0, 1), (0, 0))) + ply.nodal(state.u)
    np.testing.assert_allclose(sphere.level(x), 0.0, atol=1e-9)
    forces, n = ply.nodal(ply.residual(state.u)), sphere.gradient(x)
    along = forces - (forces * n).sum(axis=0) * n
    inner = (ply.nodes > 0).all(axis=0)
    assert np.abs(along[:, inner]).max() < 1e-7
    assert state.verdict.stable
    np.testing.assert_allclose(state.reactions["on"], forces.sum(axis=1))


@pytest.mark.parametrize("cells", [16, 32])
@pytest.mark.parametrize(
    ("formulation", "bounds"),
    [(Macro(), {16: 0.1, 32: 0.03}), (OnePoint(), {16: 0.05, 32: 0.015})],
)
def test_the_chebyshev_net_is_found_in_a_few_solves(formulation, bounds, cells):
    parts = 2 if isinstance(formulation, Macro) else 1
    ply, conditions, start = chebyshev.problem(formulation, cells // parts)
    state = equilibrium_near(ply, conditions, start)
    largest, _ = chebyshev.error(ply, state.u)
    assert largest < bounds[cells]
    assert state.linear_solves <= 8
    assert state.verdict.stable


def test_its_largest_error_falls_with_second_order_until_the_mesh_is_fine():
    """What is stabilised out of the plane does not resist the warp of a sphere."""
    errors = []
    for parts in (16, 32, 64):
        ply, conditions, start = chebyshev.problem(Macro(), parts)
        state = equilibrium_near(ply, conditions, start)
        assert state.linear_solves <= 8
        errors.append(chebyshev.error(ply, state.u)[0])
    assert (np.diff(np.log2(errors)) < -1.8).all()


@pytest.mark.parametrize("tension", [0.1, 50.0])
def test_the_tension_of_the_edges_takes_no_more_solves(tension):
    for formulation, cells in ((Macro(), 8), (OnePoint(), 16)):
        ply, conditions, start = chebyshev.problem(formulation, cells, tension=tension)
        assert equilibrium_near(ply, conditions, start).linear_solves <= 8


def test_a_coarse_mesh_takes_no_more_solves():
    """Its stiffnesses are those of predicted tensions, so that none is found again."""
    ply, conditions, start = chebyshev.problem(Macro(), 4)
    state = equilibrium_near(ply, conditions, start, warn_only=["stabilisation"])
    assert state.linear_solves <= 8


def test_a_net_is_as_good_a_start():
    ply, conditions, _ = chebyshev.problem(OnePoint(), 16)
    net = drape.net(chebyshev.SPHERE, chebyshev.SIDE / 16, (0, 16), (0, 16))
    start = drape.displacement(ply.nodes, net.at(ply.nodes))
    state = equilibrium_near(ply, conditions, start)
    assert chebyshev.error(ply, state.u)[0] < 0.05
    assert state.linear_solves <= 6


def rolled(angle, formulation, q=1.0, radius=60.0):
    """A ply that is rolled around a cylinder, pulled along and around it."""
    end = chebyshev.SIDE / radius
    loads = [
        Traction("right", (q * np.cos(end), 0, -q * np.sin(end))),
        Traction("top", (0.0, q, 0.0)),
    ]
    c, s = np.cos(angle), np.sin(angle)
    ply = square(
        chebyshev.SIDE,
        12,
        Fabric(1e5, 0.1, warp=(c, s), weft=(-s, c)),
        formulation,
        loads,
    )
    cylinder = drape.Cylinder(radius, (0, 0, -radius))
    conditions = {"on": OnSurface(cylinder)} | SYMMETRY
    start = drape.displacement(ply.nodes, drape.exponential_map(cylinder, ply.nodes))
    return ply, cylinder, equilibrium_near(ply, conditions, start)


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_a_cylinder_shears_no_ply_and_presses_by_tension_over_radius(formulation):
    ply, cylinder, state = rolled(0.0, formulation)
    assert np.abs(ply.shear_angle(state.u)).max() < 1e-8
    pressure = drape.contact_pressure(ply, cylinder, state.u)
    inner = ply.nodes[0] < chebyshev.SIDE - 1e-9
    np.testing.assert_allclose(pressure[inner], 1.0 / 60.0, rtol=0.02)
    assert not drape.wrinkle_risk(ply, state.u).any()


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_a_cylinder_shears_no_bias_ply_but_by_the_pull_on_its_last_elements(
    formulation,
):
    """Which lie askew to it by h/(2R): q h²/(8R² (q + 2G)) with fibres at ±45°."""
    q, shear, radius = 1.0, 0.1, 60.0
    ply, _, state = rolled(np.pi / 4, formulation, q=0.0)
    assert np.abs(ply.shear_angle(state.u)).max() < 1e-8
    ply, _, state = rolled(np.pi / 4, formulation, q)
    h = chebyshev.SIDE / (12 * (2 if isinstance(formulation, Macro) else 1))
    exact = q * h**2 / (8 * radius**2 * (q + 2 * shear))
    np.testing.assert_allclose(np.abs(ply.shear_angle(state.u)), exact, rtol=0.01)


def test_the_sphere_presses_by_the_sum_of_tensions_over_its_radius():
    ply, conditions, start = chebyshev.problem(OnePoint(), 24)
    state = equilibrium_near(ply, conditions, start)
    pressure = drape.contact_pressure(ply, chebyshev.SPHERE, state.u)
    tension = ply.fibre_tension(state.u)[..., 0].sum(axis=0)
    angle = ply.shear_angle(state.u)[:, 0]
    exact = tension / chebyshev.RADIUS / np.cos(angle)
    centres = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    inner = (centres < 0.95 * chebyshev.SIDE).all(axis=0)
    of_elements = pressure[ply.mesh.t].mean(axis=0)
    np.testing.assert_allclose(of_elements[inner], exact[inner], rtol=0.02)


@pytest.mark.parametrize("tension", [(3.0, 1.0), (1.0, 3.0)])
def test_a_saddle_presses_or_would_have_to_pull(tension):
    """Fibres along x lift off the saddle, those along y press on it."""
    loads = [
        Traction(name, sign * tension[i] * np.eye(3)[i])
        for name, i, sign in zip(
            *(("left", "right", "bottom", "top"), (0, 0, 1, 1), (-1, 1, -1, 1)),
            strict=True,
        )
    ]
    s = np.linspace(-30, 30, 13)
    mesh = MeshQuad.init_tensor(s, s).with_defaults()
    ply = Ply(mesh, Fabric(1e5, 0.1), OnePoint(), loads, dimension=3)
    (middle,) = np.flatnonzero((ply.nodes == 0).all(axis=0))
    conditions = {
        "on": OnSurface(SADDLE),
        "x": Condition(lambda X: np.abs(X[0]) < 1e-9, (0.0, None, None)),
        "y": Condition(lambda X: np.abs(X[1]) < 1e-9, (None, 0.0, None)),
    }
    start = drape.displacement(ply.nodes, drape.exponential_map(SADDLE, ply.nodes))
    state = equilibrium_near(ply, conditions, start)
    pressure = drape.contact_pressure(ply, SADDLE, state.u)
    warp, weft = tension
    assert pressure[middle] == pytest.approx(0.004 * (weft - warp), rel=0.02)


def test_an_element_that_is_turned_over_is_folded():
    ply = square(cells=4)
    sphere = drape.Sphere(100.0, (0, 0, -100))
    problem = problem_of(ply, {"on": OnSurface(sphere)})
    x = drape.exponential_map(sphere, ply.nodes)
    assert (problem.least_area_ratio(drape.displacement(ply.nodes, x)) > 0).all()
    mirrored = x * [[-1], [1], [1]]
    ratio = problem.least_area_ratio(drape.displacement(ply.nodes, mirrored))
    assert (ratio > 0).all()  # the other face of the ply, but no fold
    x[0, ply.nodes[0] > 50] -= 2 * 15.0  # the last column laid back over the others
    x = x * 100.0 / np.linalg.norm(x - sphere.centre[:, None], axis=0)
    ratio = problem.least_area_ratio(drape.displacement(ply.nodes, x))
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
    x = np.pad(ply.nodes, ((0, 1), (0, 0))) + ply.nodal(state.u)
    np.testing.assert_allclose(x[2, ply.nodes[0] < 59], 0.0, atol=1e-9)
    right = ply.nodes[0] == 60
    np.testing.assert_allclose(x[2, right], x[0, right] - 60, atol=1e-9)
    assert state.verdict.stable


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda s: {"a": OnSurface(s), "b": OnSurface(s, "top")}, "on another surface"),
        (lambda s: {"a": OnSurface(s, "nowhere")}, "no boundary 'nowhere'"),
        (
            lambda s: {"a": OnSurface(drape.Sphere(1.0))},
            r"does not touch the plane z = 0 at \(0.0, 0.0\), where it has no tangent",
        ),
        (
            lambda s: {"a": OnSurface(drape.Plane((0, 0, -0.25)))},
            r"at \(0.0, 0.0\), where it is 0.25 mm away: move it",
        ),
        (
            lambda s: {"a": OnSurface(drape.Plane((0, 0, 0), (0, 3, 4)))},
            r"at \(0.0, 0.0\), where it is inclined by 37°: move it",
        ),
        (
            lambda s: {"a": OnSurface(s, touch=(5.0, 0.0))},
            r"where it is 0.12\d mm away",
        ),
    ],
)
def test_conditions_that_cannot_be_are_refused(build, message):
    conditions = build(drape.Sphere(100.0, (0, 0, -100)))
    with pytest.raises(ValueError, match=message):
        LoadStepper(square(), conditions, 1)


class Broken(drape.Plane):
    """A surface that is not one."""

    def __init__(self, level):
        super().__init__()
        self.__dict__["level"] = level


@pytest.mark.parametrize(
    ("surface", "message"),
    [
        (5, "a surface must be like"),
        (drape.Sphere, "a surface must be like"),
        (Broken(lambda x: x), "must have the shape"),
        (Broken(lambda x: x[7]), "level of the surface fails"),
    ],
)
def test_what_is_no_surface_is_refused(surface, message):
    with pytest.raises(ValueError, match=f"condition 'on'.*{message}"):
        LoadStepper(square(), {"on": OnSurface(surface)})


def test_a_surface_that_is_not_finite_is_no_answer():
    nowhere = Broken(lambda x: np.where(x[0] > 30, np.nan, x[2]))
    conditions = {"on": OnSurface(nowhere), "clamp": Condition("left")}
    ply = square()
    with pytest.raises(NoEquilibriumError, match="no way to the surface"):
        equilibrium_near(ply, conditions, ply.basis.zeros())


def test_a_ply_in_its_plane_lies_on_no_surface():
    ply = Ply(MeshQuad().refined(1), Fabric(1e4, 1.0))
    with pytest.raises(ValueError, match="only a ply in space"):
        LoadStepper(ply, {"on": OnSurface(drape.Plane())})


def test_a_ply_that_slides_around_its_sphere_is_refused():
    ply, sphere = square(), drape.Sphere(100.0, (0, 0, -100))
    with pytest.raises(StepError, match=r"stiffness|stable"):
        LoadStepper(ply, {"on": OnSurface(sphere)}, 1, max_halvings=1).run()


def test_conditions_across_a_surface_are_refused():
    sphere = drape.Sphere(100.0, (0, 0, -100))
    conditions = {
        "on": OnSurface(sphere),
        "held": Condition([0], (None, None, 0.0)),
    } | SYMMETRY
    ply = square()
    start = drape.displacement(ply.nodes, drape.exponential_map(sphere, ply.nodes))
    conditions.pop("x"), conditions.pop("y")
    with pytest.raises(NoEquilibriumError, match="across its surface already"):
        equilibrium_near(ply, conditions, start)


@pytest.mark.parametrize("formulation", [Macro(), Quadratic(80.0), OnePoint()])
def test_triangles_press_as_quadrilaterals_do(formulation):
    """A cylinder presses by q/R whatever the elements; all forces add up to it."""
    s, (q, radius) = np.linspace(0, 60, 13), (1.0, 60.0)
    end = 60.0 / radius
    loads = [
        Traction("right", (q * np.cos(end), 0, -q * np.sin(end))),
        Traction("top", (0.0, q, 0.0)),
    ]
    mesh = MeshTri.init_tensor(s, s).with_defaults()
    ply = Ply(mesh, Fabric(1e5, 0.1), formulation, loads, dimension=3)
    cylinder = drape.Cylinder(radius, (0, 0, -radius))
    conditions = {"on": OnSurface(cylinder)} | SYMMETRY
    start = drape.displacement(ply.nodes, drape.exponential_map(cylinder, ply.nodes))
    warn_only = "stabilisation", "deviation"
    state = equilibrium_near(ply, conditions, start, warn_only=warn_only)
    pressure = drape.contact_pressure(ply, cylinder, state.u)
    inner = (ply.nodes[0] > 4.0) & (ply.nodes[0] < 56.0)
    np.testing.assert_allclose(pressure[inner], q / radius, rtol=0.02)


def test_wrinkle_risk_starts_at_the_shear_stiffness():
    for tension, risk in ((-0.99, False), (-1.01, True)):
        ply = square(1.0, 2, Fabric(100.0, 1.0))
        u = ply.basis.zeros()
        u[0::3] = ply.nodes[0] * np.expm1(tension / 100.0)
        assert drape.wrinkle_risk(ply, u).all() == risk
    assert drape.wrinkle_risk(ply, np.nan * u).all()


def test_formulations_agree_on_where_fibres_wrinkle():
    """Tensions at the points of quadratic triangles oscillate from -8 to 8 N/mm."""
    tool, c, s = drape.Sphere(150.0, (0, 0, -150)), np.cos(0.3), np.sin(0.3)
    fabric = Fabric(2e4, 0.2, (c, s), (-s, c), bending=(40.0, 60.0))
    shares = []
    for formulation in (Macro(), OnePoint(), Quadratic(), Quadratic(10.0)):
        ply = square(60.0, 12, fabric, formulation)
        start = drape.exponential_map(tool, ply.nodes)
        held = {"on": OnSurface(tool)} | SYMMETRY
        state = equilibrium_near(ply, held, drape.displacement(ply.nodes, start))
        shares.append(drape.wrinkle_risk(ply, state.u).mean())
    assert 0 < min(shares) <= max(shares) < 0.1


def test_past_the_wrinkling_angle_any_compression_is_a_risk():
    """In the region that has one, and not where the fibres are pulled."""
    parts = {"left": lambda x: x[0] < 0.5, "right": lambda x: x[0] > 0.5}
    mesh = MeshQuad().refined(1).with_subdomains(parts)
    plain, locks = Fabric(100.0, 1.0), Fabric(100.0, 1.0, wrinkling_angle=0.4)
    ply = Ply(mesh, {"left": plain, "right": locks}, dimension=3)
    x = ply.nodes[0]
    right = x[ply.mesh.t].mean(axis=0) > 0.5
    for tension, angle, risk in (
        (-0.1, 0.41, True),
        (-0.1, 0.39, False),
        (0.1, 0.41, False),
    ):
        u, stretch = ply.basis.zeros(), np.exp(tension / 100.0)
        u[0::3] = x * (stretch * np.cos(angle) - 1.0)
        u[1::3] = x * stretch * np.sin(angle)
        np.testing.assert_array_equal(drape.wrinkle_risk(ply, u), right & risk)


def test_a_run_goes_on_from_its_checkpoint_on_the_same_surface_only(tmp_path):
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


def of_constant_angles(ply, u):
    """Root-mean-square error in radians of the angle that is constant in an element."""
    xi = (np.indices((8, 8)).reshape(2, -1) + 0.5) / 8
    exact = chebyshev.shear_angle(ply.basis.mapping.F(xi))
    off = ply.shear_angle(u).mean(axis=1)[:, None] - exact
    return float(np.sqrt(np.mean(off**2)))


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_the_error_is_estimated_on_a_surface(formulation):
    cells = 8 if isinstance(formulation, Macro) else 16
    ply, conditions, start = chebyshev.problem(formulation, cells)
    state = equilibrium_near(ply, conditions, start)
    found = estimated_error(ply, conditions, "superlu", state)
    error = of_constant_angles(ply, state.u)
    assert 0.8 * error < found.shear_angle < 1.6 * error
    assert found.load < 0.1


def test_the_estimate_is_of_a_finer_ply_on_the_surface():
    ply, conditions, start = chebyshev.problem(OnePoint(), 4)
    state = equilibrium_near(ply, conditions, start, warn_only=["stabilisation"])
    finer = ply.finer()
    fine = problem_at(finer.ply, conditions, "superlu", 1.0)
    carried, tension = finer.carry(state.u)
    assert not fine.surfaces.are_on(carried, 1.0)
    u, _ = error_estimate._moved(fine, carried, tension, np.zeros(2))
    assert fine.surfaces.are_on(u, 1.0)


def test_a_run_to_a_tolerance_refines_on_a_surface():
    ply, conditions, _ = chebyshev.problem(Macro(), 4)
    result = AdaptiveStepper(
        ply, conditions, 0.05, steps=4, warn_only=["stabilisation", "deviation"]
    ).run()
    assert result.tolerance_met
    assert result.ply.basis.N > ply.basis.N
    x = np.pad(result.ply.nodes, ((0, 1), (0, 0))) + result.ply.nodal(result.u)
    np.testing.assert_allclose(chebyshev.SPHERE.level(x), 0.0, atol=1e-8)


@pytest.mark.parametrize(("tension", "risk"), [(-0.99, False), (-1.01, True)])
def test_a_net_buckles_in_its_plane_where_wrinkles_become_a_risk(tension, risk):
    """Fibres along x, ends held, edges along them free: T = −G (Rosen 1965)."""
    s, t = np.linspace(0, 60, 13), np.linspace(0, 15, 5)
    mesh = MeshQuad.init_tensor(s, t).with_defaults()
    ply = Ply(mesh, Fabric(1e5, 1.0), OnePoint(), dimension=3)
    move = 60 * np.expm1(tension / 1e5)
    conditions = {
        "on": OnSurface(drape.Plane()),
        "left": Condition("left"),
        "right": Condition("right", (move, 0.0, None)),
    }
    u = ply.basis.zeros()
    u[0::3] = ply.nodes[0] * move / 60
    assert drape.wrinkle_risk(ply, u).all() == risk
    if risk:
        with pytest.raises(NoEquilibriumError, match="not stable"):
            equilibrium_near(ply, conditions, u, strategies=["newton"])
    else:
        state = equilibrium_near(ply, conditions, u, strategies=["newton"])
        assert state.verdict.stable
