"""Tools that move: contact is a constraint, and no state depends on its stiffness."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import spsolve
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    Holder,
    LoadStepper,
    Macro,
    OnePoint,
    OnSurface,
    Ply,
    Quadratic,
    StepError,
    Tool,
    Values,
    drape,
)
from skfem_textile.contact.figures import formed as figures_of
from skfem_textile.solve.continuation import initial_guess
from skfem_textile.solve.on_surface import SurfaceError
from skfem_textile.solve.stepper import DEFAULT_WARN_ONLY
from tests.helpers import graph
from tests.helpers.forming import GAP, SIDE, SYMMETRY, blank
from tests.helpers.tools import problem_of

RADIUS, TRAVEL = 40.0, 15.0


def punch(motion=(0, 0, TRAVEL), **options):
    sphere = drape.Sphere(RADIUS, (0, 0, -RADIUS - GAP / 2))
    return Tool(sphere, motion=motion, name="punch", **options)


def ring(z, **options):
    """Torus above the ply: an edge of the die over which it is drawn."""
    torus = drape.Torus(RADIUS + 10.0, 8.0, (0, 0, z + 8.0))
    return Tool(torus, name="die", **options)


def formed(steps=1, motion=(0, 0, TRAVEL), **options):
    ply = blank(terms=[punch(motion), ring(GAP / 2)], **options)
    return LoadStepper(ply, SYMMETRY, steps=steps).run()


@pytest.fixture(scope="module")
def state():
    return formed()


@pytest.fixture(scope="module")
def in_steps():
    return formed(2)


def test_number_of_steps_does_not_change_the_state(state, in_steps):
    other = in_steps
    assert other.converged
    assert state.path_resolved
    angles = [np.degrees(x.ply.shear_angle(x.u)) for x in (state, other)]
    assert np.abs(angles[0] - angles[1]).max() < 0.01
    forces = [x.states[-1].reactions["punch"][2] for x in (state, other)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-3)


@pytest.mark.parametrize(
    ("travels", "share"),
    [((2, 3), 0.5), ((2, 1), -0.5), ((2, 2), 0), ((0, 2), 0), ((1, 9), 0)],
    ids=["onward", "back", "at rest now", "at rest before", "folded"],
)
def test_a_step_starts_from_an_extrapolation_in_proportion_to_the_travel(
    travels, share
):
    """With the tensions of the last state, as nodes do not move on straight lines."""

    def motion(t):
        return 0.0, 0.0, np.interp(t, (0.0, 0.5, 1.0), (0, *travels))

    ply = blank(terms=[punch(motion)], cells=2)
    problem = problem_of(ply, SYMMETRY)
    u = np.random.default_rng(3).normal(0.0, 0.5, (2, ply.basis.N))
    states = [SimpleNamespace(load_factor=i / 2, u=u[i]) for i in range(2)]
    start = problem.at(0.5).evaluation(u[1], ply.parameters_at_rest)
    guess = initial_guess(problem.at(1.0), start, states)
    if not share:
        assert guess is start
        return
    assert_allclose(guess.u, u[1] + share * (u[1] - u[0]), atol=1e-12)
    tension = ply.geometric_tension(u[1], 0 * u[1], ply.parameters_at_rest)
    assert_allclose(guess.tension, tension)


def test_contact_is_a_constraint(state):
    """No penetration, no tensile contact force, no force without contact."""
    last = state.states[-1]
    for tool in (x for x in state.ply.terms if x.name in ("punch", "die")):
        gap = tool.gaps(last.u, 1.0)
        force = last.parameters[tool.name]["force"]
        assert gap.min() >= -1e-9 * SIDE
        assert force.min() >= 0
        assert np.abs(gap[force > 1e-6 * force.max()]).max() <= 1e-9 * SIDE
        assert (force > 0).sum() > 4
    assert last.verdict.negative_pivots == 0


def test_force_is_the_derivative_of_the_energy():
    """The work of the punch over a small travel is the change of all energies."""

    def motion(t):
        return 0.0, 0.0, TRAVEL - 0.01 if t == 0.5 else TRAVEL * t

    result = formed(2, motion, cells=2)
    before, after = result.states[-2:]
    energies = [
        sum(x.energies.values())
        + sum(v for k, v in x.potentials.items() if k.startswith("traction"))
        for x in (before, after)
    ]
    forces = [x.reactions["punch"][2] for x in (before, after)]
    assert np.diff(energies) / 0.01 == pytest.approx(np.mean(forces), rel=1e-3)


def test_tools_turn_with_the_problem():
    """Fibres at 45° and at 135° to a quarter are the same ply."""
    small = {"cells": 2, "motion": (0, 0, 5.0), "formulation": OnePoint()}
    one, other = (formed(fibres=np.radians(a), **small) for a in (45, 135))
    shear = [np.abs(x.ply.shear_angle(x.u)).max() for x in (one, other)]
    assert shear[0] == pytest.approx(shear[1], rel=1e-5)


@pytest.mark.slow
def test_formulations_agree():
    options = {"cells": 5}, {"cells": 10, "formulation": OnePoint()}
    options += ({"cells": 5, "formulation": Quadratic()},)
    results = [formed(2, (0, 0, 25.0), **more) for more in options]
    first, *others = (x.states[-1].reactions["punch"][2] for x in results)
    assert others == pytest.approx([first, first], rel=0.1)


def test_triangles_form_like_the_surface(state):
    """A punch of triangles of 4.5 mm, open at its rim."""
    x, t = graph(
        np.linspace(-45.0, 45.0, 21),
        lambda x, y: np.sqrt(np.maximum(RADIUS**2 - x**2 - y**2, 0)) - RADIUS - GAP / 2,
    )
    t = t[:, (np.hypot(*x[:2])[t] < RADIUS - 4).all(axis=0)]
    punch = Tool(drape.TriangleMesh(x, t), motion=(0, 0, TRAVEL), name="punch")
    result = LoadStepper(blank(terms=[punch, ring(GAP / 2)]), SYMMETRY, steps=1).run()
    forces = [x.states[-1].reactions["punch"][2] for x in (state, result)]
    assert forces[0] == pytest.approx(forces[1], rel=0.01)
    angles = [np.degrees(x.ply.shear_angle(x.u)) for x in (state, result)]
    assert np.abs(angles[0] - angles[1]).max() < 0.1


@pytest.mark.parametrize("tension", [pytest.param(0.2, marks=pytest.mark.slow), 20.0])
def test_a_step_in_which_nothing_touches_has_no_warning_of_the_energy(tension):
    """Rounding of stretches changes the energy by tension times length."""
    approach = punch(lambda t: (0, 0, 6 * t - 5.2), side=1)
    ply = blank(2, 0.5, [approach, ring(GAP / 2)], tension=tension)
    checks = set(DEFAULT_WARN_ONLY) - {"work"}
    options = {"steps": 3, "warn_only": checks, "max_halvings": 0}
    result = LoadStepper(ply, SYMMETRY, **options).run()
    assert result.converged
    assert [s.reactions["punch"][2] > 0 for s in result.states] == [False] * 3 + [True]


def test_thickness_keeps_the_nodes_away():
    terms = punch(thickness=1.0), ring(1.0, thickness=1.0)
    ply = blank(2, terms=terms, formulation=OnePoint())
    last = LoadStepper(ply, SYMMETRY, steps=1).run().states[-1]
    x = ply.positions(last.u)
    centre = np.array([[0.0], [0.0], [TRAVEL - RADIUS - GAP / 2]])
    distance = np.linalg.norm(x - centre, axis=0)
    assert distance.min() == pytest.approx(RADIUS + 0.5, abs=1e-6)


@pytest.mark.parametrize("formulation", [Macro(), OnePoint(), Quadratic()], ids=repr)
def test_gravity_rests_on_a_plane(formulation):
    """The plane carries the weight, with a uniform pressure on the stretched ply."""
    weight = BodyForce((0, 0, -1e-5), factor=1.0)
    table = Tool(drape.Plane(), side=1, name="table")
    ply = blank(2, terms=[weight, table], formulation=formulation)
    result = LoadStepper(ply, SYMMETRY, steps=1).run()
    force = result.states[-1].reactions["table"][2]
    assert force == pytest.approx(1e-5 * SIDE**2, rel=1e-6)
    most = figures_of(result)["table_max_pressure_N_per_mm2"]
    assert most == pytest.approx(1e-5 / (1 + 2e-5) ** 2, rel=1e-6)


def test_tools_edges_and_symmetry_balance(hemisphere):
    """Punch, die and holder together."""
    for state in hemisphere.states:
        reactions = state.reactions
        assert set(reactions) == {"x", "y", "punch", "die", "holder"}
        off = sum(reactions.values()) + 0.2 * SIDE * np.array([1, 1, 0])
        largest = max(np.abs(force).max() for force in reactions.values())
        assert np.abs(off).max() < 1e-6 * largest
    assert reactions["punch"][2] > 1
    assert min(abs(reactions[name][2]) for name in ("die", "holder")) > 0.01


def test_holders_with_outlines_are_segments():
    """Each presses within its outline, and nothing presses outside both."""
    table = Tool(drape.Plane(), side=1, name="table")
    boxes = {"a": (37.5, 70.0, -5.0, 27.5), "b": (-5.0, 17.5, 37.5, 70.0)}
    pressures = {"a": 0.01, "b": 0.03}
    holders = [
        Holder(
            drape.Plane(),
            pressure=pressures[name],
            side=1,
            outline=[[x0, x1, x1, x0], [y0, y0, y1, y1]],
            name=name,
        )
        for name, (x0, x1, y0, y1) in boxes.items()
    ]
    ply = blank(5, terms=[table, *holders])
    result = LoadStepper(ply, SYMMETRY, steps=1).run()
    figures, state = figures_of(result), result.states[-1]
    areas = {"a": 22.5 * 27.5, "b": 17.5 * 22.5}
    for term in (x for x in ply.terms if x.name in boxes):
        force = term.forces(state.u, 1.0, state.parameters[term.name])
        x0, x1, y0, y1 = boxes[term.name]
        x, y = ply.nodes + ply.nodal(state.u)[:2]
        h = SIDE / 10  # the size of elements
        near = (x > x0 - h) & (x < x1 + h) & (y > y0 - h) & (y < y1 + h)
        assert (force[near] > 0).all()
        assert not force[~near].any()
        pushed = pressures[term.name] * areas[term.name]
        assert figures[f"{term.name}_force_N"] == pytest.approx(pushed, rel=2e-5)
        most = figures[f"{term.name}_max_pressure_N_per_mm2"]
        assert most == pytest.approx(pressures[term.name], rel=1e-3)
    total = sum(pressures[name] * areas[name] for name in boxes)
    assert state.reactions["table"][2] == pytest.approx(total, rel=2e-5)


def test_nodes_on_an_outline_have_an_equilibrium():
    """They would be pushed out where they touch, and fall back where they do not."""
    outer, inner = (
        r * np.array([[-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1.0]]) for r in (120, 48)
    )
    outline, plane = np.hstack([outer, inner[:, ::-1]]), drape.Plane((0, 0, 0.1))
    on_ring = {"side": -1, "outline": outline}
    tools = [
        Tool(plane, name="ring", **on_ring),
        Holder(plane, pressure=1e-3, **on_ring),
    ]
    x = np.linspace(-80, 80, 6)  # 48 is one of them
    mesh = MeshQuad.init_tensor(x, x).with_defaults()
    fabric = Fabric(1e4, 0.1, bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, terms=tools, dimension=3)

    def few(iteration):
        assert iteration.number < 40

    left = {"left": Condition("left", (-0.2, 0.0, None))}
    run = LoadStepper(ply, left, steps=1, on_iteration=few).run()
    total = 1e-3 * (160**2 - 96**2)
    assert run.states[-1].reactions["ring"][2] == pytest.approx(-total, rel=0.01)
    assert run.linear_solves < 60


def test_a_holder_presses_on_the_undeformed_area_at_the_present_position():
    """A ply is stretched to twice its width, half of which is inside.

    The level of the surface is three times the distance from it.
    """
    plane, names = drape.Plane(), ("level", "gradient", "hessian")
    thrice = {x: lambda at, x=x: 3 * getattr(plane, x)(at) for x in names}
    outline = [[60.0, 200.0, 200.0, 60.0], [-90.0, -90.0, 90.0, 90.0]]
    holder = Holder(SimpleNamespace(**thrice), None, 0.01, side=1, outline=outline)
    ply = blank(terms=[holder])
    (term,) = (x for x in ply.terms if x.name == "holder")
    u = np.array([ply.nodes[0], 0 * ply.nodes[0], 0 * ply.nodes[0]]).T.ravel()
    force = term.forces(u, 1.0, term.parameters.updated({}, u, 1.0))
    assert force.sum() == pytest.approx(0.01 * 30 * 60)


def test_a_ply_that_flies_away_is_no_equilibrium():
    ply = blank(2, terms=[BodyForce((0, 0, 1e-4), factor=1.0), punch()])
    with pytest.raises(StepError, match=r"moves by .* far beyond its size"):
        LoadStepper(ply, SYMMETRY, steps=1).run()


def test_a_ply_on_a_surface_flies_if_it_is_far_from_where_the_surface_is():
    ply, ball = blank(2), drape.Sphere(200.0, (0, 0, -200.0))
    problem = LoadStepper(ply, {"ball": OnSurface(ball)}, steps=1).problem
    assert not problem.flies(np.full(ply.basis.N, 3e3), np.zeros(0))
    assert problem.flies(np.full(ply.basis.N, 3e4), np.zeros(0))


def test_a_tool_that_touches_nothing_restrains_nothing():
    pulled = SYMMETRY | {"pull": Condition("right", (1.0, None, None))}
    ply = blank(2, terms=[punch((0, 0, -10.0))], tension=0.0)
    with pytest.raises(StepError, match="a mechanism is present; try supports, or a"):
        LoadStepper(ply, pulled, steps=1, max_halvings=0).run()


def test_a_tool_does_not_graze_a_held_edge_within_a_step():
    """On its way it is 5 mm inside, so shallow that normals before and after agree."""
    x = np.linspace(0.0, 100.0, 6)
    mesh = MeshQuad.init_tensor(x, x[:3]).with_defaults()
    surface = drape.Sphere(30.0, (-20.0, 20.0, -25.0))
    tool = Tool(surface, (40.0, 0, 0), side=1, name="punch")
    fabric = Fabric(1e3, 1.0, bending=(5.0, 5.0))
    ply = Ply(mesh, fabric, terms=[tool], dimension=3)
    held = {name: Condition(name) for name in ("left", "right")}
    stepper = LoadStepper(ply, held, steps=1, max_halvings=0)
    text = r"3 node\(s\) passed through tool 'punch', the first is node 1"
    with pytest.raises(StepError, match=text):
        stepper.run()


def test_travel_is_from_the_initial_position():
    """Of a tool that stands beside its surface at the load factor 0."""
    tool = punch(lambda t: (0.0, 0.0, 30.0 * t - 10.0), side=1).on(blank().basis)
    assert tool.travel(0.5) == pytest.approx([0.0, 0.0, 15.0])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.7, np.pi - 1e-6, np.pi])
def test_rotation_is_from_the_initial_position(angle):
    def turned(t):
        c, s = np.cos(0.4 + angle * t), np.sin(0.4 + angle * t)
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.zeros(3)

    tool = punch(turned, side=1).on(blank().basis)
    assert tool.rotation(1.0) == pytest.approx(angle, rel=1e-6, abs=1e-15)
    assert not tool.travel(1.0).any()


def test_holder_keeps_its_gap():
    """Beyond the punch the ply lifts from the plane by up to the gap."""
    outline = [[45.0, 70.0, 70.0, 45.0], [-5.0, -5.0, 70.0, 70.0]]
    holder = Holder(drape.Plane(), gap=5.0, side=1, outline=outline)
    ply = blank(3, terms=[punch((0, 0, 25.0)), holder])
    last = LoadStepper(ply, SYMMETRY, steps=1).run().states[-1]
    x = ply.nodes + ply.nodal(last.u)[:2]
    (term,) = (term for term in ply.terms if term.name == "holder")
    height = (term.points @ ply.nodal(last.u)[2])[(x[0] > 46) & (x[0] < 69)]
    assert height.max() == pytest.approx(5.0, abs=1e-6)
    assert last.reactions["holder"][2] < 0


def test_derivatives():
    """Energy, residual and tangent agree where nodes touch, also with rotations."""
    rng = np.random.default_rng(3)
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    tools = [
        punch(lambda t: (turn, np.array([12.0, 0.0, -1.6])), side=1, thickness=0.4),
        Tool(drape.double_dome(), motion=(0, 0, 0.05), name="dome", side=1),
        Holder(drape.Sphere(300.0, (0, 0, -300.5)), gap=0.2, name="holder"),
        Holder(drape.Sphere(300.0, (0, 0, -300.5)), pressure=0.1, name="pressed"),
    ]
    flat = blank(6)
    ply = Ply(flat.mesh, flat.fabric, terms=tools, dimension=3)
    u = rng.normal(0, 0.02, ply.basis.N)
    du = rng.normal(0, 1, ply.basis.N)
    for term in ply.terms[-4:]:
        values = term.parameters.at_rest()
        if "force" in values:
            n = len(values["force"])
            values = Values({"force": np.zeros(n), "stiffness": np.full(n, 2.0)})
            values = term.parameters.updated(values, u, 1.0)
        h = 1e-6
        energy = [term.energy(u + k * h * du, 1.0, values) for k in (-1, 1)]
        f = [term.residual(u + k * h * du, 1.0, values) for k in (-1, 1)]
        slope = (energy[1] - energy[0]) / (2 * h)
        residual = term.residual(u, 1.0, values)
        assert np.abs(residual).max() > 1e-3
        assert slope == pytest.approx(residual @ du, rel=1e-4)
        change = (f[1] - f[0]) / (2 * h)
        K = term.tangent(u, 1.0, values)
        assert np.abs(K @ du - change).max() < 0.03 * np.abs(change).max()


def test_the_gradient_of_a_gap_depends_on_the_distance():
    """Of a level that is not a distance: the gradient is not the normal."""

    def dome(x, y):
        o = 0 * x
        return drape.Height(-0.2 - x**2 / 60, -x / 30, o, o - 1 / 30, o, o)

    tool = Tool(drape.HeightField(dome), (0, 0, 0.5), side=1, name="dome")
    ply = blank(2, terms=[tool])
    (term,) = (term for term in ply.terms if term.name == "dome")
    X = ply.nodes
    u = np.array([0 * X[0], 0 * X[0], 0.25 - X[0] ** 2 / 60]).T.ravel()
    ones = np.ones(X.shape[1])
    force = -term.gaps(u, 1.0)
    assert force.min() > 0.02
    residual = term.residual(u, 1.0, Values({"force": 0 * ones, "stiffness": ones}))
    gradient = -spsolve(csc_matrix(term.points.T), ply.nodal(residual).T).T / force
    difference = np.empty_like(gradient)
    for k in range(3):
        h = np.zeros((X.shape[1], 3))
        h[:, k] = 1e-5
        ends = (term.gaps(u + sign * h.ravel(), 1.0) for sign in (1, -1))
        difference[k] = np.subtract(*ends) / 2e-5
    normal = term.normals(u, 1.0)
    assert (normal * gradient).sum(axis=0) == pytest.approx(1.0, rel=1e-9)
    off, turned = gradient - difference, normal - difference
    for error in off, turned:  # along the surface; across it the gap is a distance
        error -= normal * (normal * error).sum(axis=0)
    assert np.abs(turned).max() > 3e-4
    assert np.abs(off).max() < 0.1 * np.abs(turned).max()


def test_resumed_run_is_the_same(tmp_path):
    """A run that is killed after its first step and resumed, bit for bit."""

    class KilledError(Exception):
        pass

    def kill(_):
        raise KilledError

    def stepper(**options):
        ply = blank(
            3, terms=[punch((0, 0, 5.0)), ring(GAP / 2)], formulation=OnePoint()
        )
        return LoadStepper(ply, SYMMETRY, steps=2, **options)

    with pytest.raises(StepError):
        stepper(on_step=kill, checkpoint=tmp_path).run()
    resumed = stepper(checkpoint=tmp_path).run(resume=True).states[-1]
    whole = stepper().run().states[-1]
    assert np.array_equal(resumed.u, whole.u)
    assert np.array_equal(resumed.reactions["punch"], whole.reactions["punch"])
    for name, values in whole.parameters.items():
        for key, value in values.items():
            assert np.array_equal(resumed.parameters[name][key], value)


def undefined_beyond(x_most, part, z=-1.0):
    """A plane whose level, gradient or hessian is NaN for larger x."""
    plane = drape.Plane((0, 0, z))

    def values(name, x):
        value = getattr(plane, name)(x)
        return np.where(x[0] > x_most, np.nan, value) if name == part else value

    methods = ("level", "gradient", "hessian")
    return SimpleNamespace(**{name: partial(values, name) for name in methods})


@pytest.mark.parametrize("part", ["level", "gradient"])
def test_a_surface_that_is_not_finite_is_not_taken_as_out_of_reach(part):
    message = r"tool 'table': level or gradient of the surface is not finite at \(45, 0"
    with pytest.raises(SurfaceError, match=message):
        blank(cells=4, terms=[Tool(undefined_beyond(31, part), name="table")])
    box = [[-1.0, 31.0, 31.0, -1.0], [-1.0, -1.0, 61.0, 61.0]]
    tool = Tool(undefined_beyond(31, part), name="table", outline=box)
    ply = blank(cells=4, terms=[tool])
    (contact,) = (term for term in ply.terms if term.name == "table")
    reached = np.isfinite(contact.gaps(ply.basis.zeros(), 0.0))
    assert np.array_equal(reached, ply.nodes[0] < 31)


def test_a_ply_that_reaches_where_a_surface_is_not_finite_is_refused():
    """In a step, the failed attempt names the surface; other nodes do not matter."""
    conditions = SYMMETRY | {"right": Condition("right", (2.0, None, None))}
    for part in ("level", "hessian"):
        weight = BodyForce((0, 0, -1e-5), factor=1.0)
        tool = Tool(undefined_beyond(61.0, part, z=0.0), side=1, name="table")
        ply = blank(cells=2, terms=[weight, tool], formulation=OnePoint())
        with pytest.raises(StepError, match=f"'table': .*{part}.* is not finite at"):
            LoadStepper(ply, conditions, steps=1, max_halvings=0).run()
    outline = [[-1.0, 27.0, 27.0, -1.0], [-1.0, -1.0, 61.0, 61.0]]
    surface = undefined_beyond(31, "hessian")
    holder = Holder(surface, pressure=0.1, outline=outline, side=1)
    ply = blank(cells=4, terms=[holder])
    (term,) = (term for term in ply.terms if term.name == "holder")
    u, p = ply.basis.zeros(), term.parameters.at_rest()
    assert np.isfinite(term.residual(u, 0.0, p)).all()
    assert np.isfinite(term.matrices(u, 0.0, p)).all()


def test_a_large_step_across_an_outline_is_halved_or_not_resolved():
    """Nodes touch or not by their position at the last state."""
    x = np.linspace(0, 60, 7)
    mesh = MeshQuad.init_tensor(x, x[:3]).with_defaults()
    outline = [[-99, 35, 35, -99], [-99, -99, 99, 99]]
    plate = Tool(drape.Plane(), side=1, outline=outline, name="plate")
    weight, fabric = BodyForce((0, 0, -1e-4)), Fabric(10.0, 0.5, bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, Full(), terms=[plate, weight], dimension=3)
    pulled = {x: Condition(x, (8.0, 0.0, 0.0)) for x in ("left", "right")}
    text = "load factor 1: nodes that touch tool 'plate' cross its outline by over half"
    for halvings, warned in ((0, True), (3, False)):
        run = LoadStepper(ply, pulled, steps=1, max_halvings=halvings).run()
        found = ply.contradictions(run.states)
        assert [x.startswith(text) for x in found] == warned * [True]
        assert run.path_resolved != warned
