"""The error interval: its half-width, what it contains, and states without one."""

import gc
from dataclasses import replace
from weakref import ref

import numpy as np
import pytest
from skfem import BilinearForm, CellBasis, Functional, LinearForm, MeshQuad, MeshTri
from skfem.helpers import dot

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    Force,
    Forms,
    FormTerm,
    Full,
    Linear,
    LoadStepper,
    Locking,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Values,
    equilibrium_near,
    mesh_outline,
)
from skfem_textile.outlines import Outline
from skfem_textile.ply.parameters import Frozen
from skfem_textile.scenes import bias_extension, picture_frame
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.solve import interval
from skfem_textile.solve.interval import work_of
from skfem_textile.solve.problem import Tangent
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.tension_variation import forces_of_tension_variation
from tests.helpers import arguments_of
from tests.helpers.tools import problem_of

MACRO = Macro()
NUMERICAL = [MACRO, OnePoint(), OnePoint(5.0), Quadratic(20.0)]
COMPARED = [Full(), Quadratic(), OnePoint(0.0)]
BIAS = Fabric(1e4, 0.5, (1, 1), (-1, 1))


def run_of(ply, conditions, steps=2, **options):
    return LoadStepper(ply, conditions, steps, **options).run()


def bias(kind="delaunay", formulation=MACRO, size=(4, 8), E=1e4, shear=0.5, steps=1):
    scene = bias_extension(kind, size)
    ply = Ply(scene.mesh, Fabric(E, shear, scene.warp, scene.weft), formulation)
    return LoadStepper(ply, scene.conditions, steps)


def pulled(*arguments, **options):
    return bias(*arguments, **options).run()


# The half-width


@pytest.mark.parametrize("kind", ["irregular", "delaunay"])
@pytest.mark.parametrize("formulation", [*NUMERICAL, Full(), Quadratic()], ids=repr)
def test_a_state_that_the_elements_represent_has_no_error(formulation, kind):
    scene = picture_frame(kind, (4, 4), shear_angle=0.6)
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    error = run_of(Ply(scene.mesh, fabric, formulation), scene.conditions, 2).error
    assert error.load < 1e-7  # the work of forces that remain out of balance
    assert error.shear_angle < 1e-10
    assert max(np.abs(half).max() for half in error.reactions.values()) < 1e-8
    assert error.reason == ""


def scaled(parameters, names, factor):
    """Parameters with the stiffnesses of these names scaled."""
    return Frozen(
        {
            term: Values({k: x * factor ** (k in names) for k, x in values.items()})
            for term, values in parameters.items()
        }
    )


def settled(problem, u, parameters):
    """The equilibrium near a displacement with held stiffnesses, by Newton's method."""
    for _ in range(3):
        force = problem.residual(u, parameters)
        u = u + Tangent.at(problem, u, parameters).equilibrated(force)[0]
    return u, problem.residual(u, parameters)


@pytest.mark.parametrize(
    ("formulation", "kind"),
    [(MACRO, "delaunay"), (OnePoint(), "irregular"), (Quadratic(20.0), "delaunay")],
    ids=repr,
)
def test_the_half_width_is_the_derivative_by_the_logarithm_of_the_stiffness(
    formulation, kind
):
    """A finite difference of two equilibria, for stabilisation and for deviations."""
    scene = bias_extension(kind, (4, 8))
    fabric, h = Fabric(1e4, 0.5, scene.warp, scene.weft), 1e-3
    result = run_of(Ply(scene.mesh, fabric, formulation), scene.conditions)
    ply, state = result.ply, result.states[-1]
    problem = problem_of(result.ply, scene.conditions).at(1.0)
    node = 2 * int(np.abs(ply.nodes - [[20.0], [50.0]]).sum(axis=0).argmin()) + 1
    force, rate, moved = 0.0, np.zeros(2), 0.0
    names = [name for values in state.parameters.values() for name in values]
    assert names
    for name in names:
        ends = [
            settled(problem, state.u, scaled(state.parameters, [name], factor))
            for factor in np.exp([h, -h])
        ]
        top = [problem.reactions(f, u)["top"] for u, f in ends]
        change = (top[0] - top[1]) / (2 * h)
        force += abs(change[1])
        rate += np.abs(change)
        moved += abs(ends[0][0][node] - ends[1][0][node]) / (2 * h)
    log_range, error = ply.formulation.log_range(ply.mesh), result.error
    pull = state.reactions["top"][1]
    assert 0.005 < error.load < 0.5
    assert error.load == pytest.approx(log_range * force / pull, rel=1e-4)
    assert error.reactions["top"] == pytest.approx(log_range * rate, rel=1e-4)
    low, high = error.of(lambda _, u: float(u[node]))
    assert (low + high) / 2 == pytest.approx(state.u[node], rel=1e-12)
    assert (high - low) / 2 == pytest.approx(log_range * moved, rel=1e-4)


def test_stiffnesses_other_than_the_calibrated_have_a_larger_range():
    mesh = MeshTri().refined(1)
    for usual, other in (
        (OnePoint(), OnePoint(5.0)),
        (Macro(), Macro(5.0)),
        (Macro(), Macro(deviation=(37.0, 70.0))),
        (Quadratic(70.0), Quadratic(7.0)),
    ):
        assert other.log_range(mesh) > usual.log_range(mesh) + 0.9
    for one in (Macro(0.0), Macro(deviation=(0.0, 700.0))):
        assert one.reference(mesh) == Macro()
    assert Quadratic(700.0).log_range(mesh) == pytest.approx(
        Quadratic(7.0).log_range(mesh)
    )


def test_borders_between_subdomains_have_a_larger_range():
    mesh = MeshTri().refined(2)
    usual = Quadratic(70.0).log_range(mesh)
    everywhere = mesh.with_subdomains({"all": np.arange(mesh.nelements)})
    assert Quadratic(70.0).log_range(everywhere) == usual
    patch = mesh.with_subdomains({"patch": lambda x: x[0] < 0.5})
    assert Quadratic(70.0).log_range(patch) > usual + 1


def rectangle_pulled(turn=0.0, mm=1.0, formulation=MACRO):
    """A rectangle, rotated, in other units of length (`mm` units to a millimetre)."""
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s], [s, c]])
    mesh = rectangle(50, 100, (2, 3), "delaunay")
    mesh = type(mesh)(mm * R @ mesh.p, mesh.t, mesh.boundaries)
    warp, weft = R @ [1, 1], R @ [-1, 1]
    ply = Ply(mesh, Fabric(1e4 / mm, 0.5 / mm, warp, weft), formulation)
    value = tuple(mm * R @ [0.0, 15.0])
    held = {"bottom": Condition("bottom"), "top": Condition("top", value)}
    return run_of(ply, held).error, R


@pytest.mark.parametrize(
    ("formulation", "options"),
    [(MACRO, {"turn": 0.5}), (Full(), {"mm": 1e-3})],
    ids=repr,
)
def test_a_rotation_or_other_units_change_no_half_width(formulation, options):
    plain, _ = rectangle_pulled(formulation=formulation)
    other, R = rectangle_pulled(formulation=formulation, **options)
    assert other.load == pytest.approx(plain.load, rel=1e-6)
    assert other.shear_angle == pytest.approx(plain.shear_angle, rel=1e-6)
    if R[0, 1] == 0:
        top = plain.reactions["top"]
        np.testing.assert_allclose(other.reactions["top"], top, rtol=1e-5)


@pytest.mark.parametrize("formulation", [*NUMERICAL, Full()], ids=repr)
def test_the_half_width_under_a_force_is_that_of_its_displacement(formulation):
    """The work of a constant force is linear in the displacement."""
    mesh = rectangle(50, 50, (4, 4), "delaunay")
    ply = Ply(mesh, Fabric(1e3, 5.0, (1, 1), (-1, 1)), formulation)
    ply = ply.with_terms(Force("top", (0.0, 60.0)))
    result = run_of(ply, {"clamp": Condition("bottom")}, 2)
    load = result.ply.load(result.u, 1.0)
    low, high = result.error.of(lambda _, u: float(load @ u))
    assert 1e-4 < result.error.load < 0.3
    assert (high - low) / (high + low) == pytest.approx(result.error.load, rel=1e-6)


def test_an_interval_needs_one_factorisation_and_changes_no_run(monkeypatch):
    made, first = [], interval.Tangent.__init__

    def counted(tangent, *arguments):
        made.append(ref(tangent))
        first(tangent, *arguments)

    stepper = bias(size=(2, 4), steps=2)
    result = stepper.run()
    ply, state, u = result.ply, result.states[-1], result.u.copy()
    energies, forces = (f(*arguments_of(state)) for f in (ply.energies, ply.residual))
    monkeypatch.setattr(interval.Tangent, "__init__", counted)
    assert result.error is result.error
    assert len(made) == 1
    gc.collect()
    assert made[0]() is None
    np.testing.assert_array_equal(result.u, u)
    assert ply.energies(*arguments_of(state)) == state.energies == energies
    np.testing.assert_array_equal(ply.residual(*arguments_of(state)), forces)
    for count in ("linear_solves", "factorisations", "solve_time_s"):
        assert getattr(stepper.result, count) == getattr(result, count)
    assert 0 < result.interval(result.states[1]).load != result.error.load
    assert len(repr(result.error)) < 400  # without arrays


# Contents of the interval


# Formulations and meshes, and the largest error over the half-width.  Triangles across
# the singular fibres are the worst meshes for these formulations.
CASES = [
    *((formulation, "irregular", 1.0) for formulation in (MACRO, OnePoint(), Full())),
    *((formulation, "delaunay", 1.0) for formulation in (MACRO, Quadratic(70.0))),
    *((formulation, "delaunay", 1.0) for formulation in (OnePoint(5.0), Quadratic())),
    (Quadratic(20.0), "delaunay", 1.2),
]


@pytest.mark.parametrize(("formulation", "kind", "most"), CASES, ids=repr)
def test_the_interval_contains_the_converged_load(formulation, kind, most):
    """The load on a graded mesh along the fibres: `docs/angles/references.json`."""
    result, exact = pulled(kind, formulation, (6, 12), 1e5), 43.214
    load, half = result.states[-1].reactions["top"][1], result.error.load
    assert abs(load - exact) < most * half * load
    assert abs(load - exact) < most * result.error.reactions["top"][1]
    assert half < 2 * abs(load / exact - 1) + 0.3
    summary = result.summary()
    assert summary["load_half_width"] == half
    assert 0 < summary["shear_angle_error_deg"] < 20
    assert summary["error_interval"] == "by the numerical stiffness"


def test_a_law_that_is_not_proportional_widens_the_interval_of_free_meshes(monkeypatch):
    """By ∫ |M′Γ − M| δ dΩ, which is zero for a proportional one."""
    laws = Locking(0.5, np.radians(50.0)), Linear(0.5)
    results = [pulled(size=(2, 4), shear=law) for law in laws]
    wide = [result.error for result in results]
    monkeypatch.setattr(interval, "_OF_JUMPS", 0.0)
    narrow = [result.interval(result.states[-1]) for result in results]
    ratio, of_plain = (x.load / y.load for x, y in zip(wide, narrow, strict=True))
    assert of_plain == 1.0
    assert ratio > 1.2
    reactions = [x[0].reactions["top"] for x in (wide, narrow)]
    np.testing.assert_allclose(reactions[0], ratio * reactions[1])


CRIMPED = CrimpToe(7e3, toe=0.003, initial_stiffness=10)


@pytest.mark.parametrize("density", [0.5, pytest.param(1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "formulation",
    [
        *(Quadratic(400, points=6), MACRO),
        *(pytest.param(x, marks=pytest.mark.slow) for x in (OnePoint(), Full())),
    ],
    ids=repr,
)
def test_the_load_of_crimped_fibres_is_inside(density, formulation):
    """54.02 to 54.13 N on the finest meshes: `docs/benchmarks/error-interval.md`."""
    fabric = Fabric(CRIMPED, 0.5, (1, 1), (-1, 1))
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 20.0))}
    outline = Outline([[0, 50, 50, 0], [0, 0, 115, 115]])
    mesh = mesh_outline(outline, fabric, held, density=density)
    result = run_of(Ply(mesh, fabric, formulation), held, 4)
    load, half = result.states[-1].reactions["top"][1], result.error.load
    assert load * (1 - half) < 54.02
    assert load * (1 + half) > 54.13
    assert half < 0.06 / density


@pytest.mark.parametrize("formulation", COMPARED, ids=repr)
def test_without_numerical_stiffness_the_interval_contains_that_of_the_reference(
    formulation,
):
    result = pulled("delaunay", formulation, size=(2, 4), steps=2)
    ply, error, scene = result.ply, result.error, bias_extension("delaunay", (2, 4))
    reference = ply.formulation.reference(ply.mesh)
    assert reference != ply.formulation
    assert reference.reference(ply.mesh) == reference
    other = Ply(ply.mesh, ply.fabric, reference)
    start, warn = result.u, ["stabilisation", "deviation"]
    there = equilibrium_near(other, scene.conditions, start, warn_only=warn)
    theirs = problem_of(other, scene.conditions).at(1.0)
    log_range = reference.log_range(ply.mesh)
    groups = interval._groups(formulation, other)
    tangent = Tangent.at(theirs, there.u, there.parameters)
    changes = interval._Changes.of(theirs, tangent, there, groups)
    load, other_load = (s.reactions["top"][1] for s in (result.states[-1], there))
    half = changes.work / work_of(theirs, there) * other_load
    assert log_range > 0 < half
    assert error.load * load == pytest.approx(abs(load - other_load) + half, rel=1e-4)
    assert error.load * load < error.reactions["top"][1] * 1.001
    low, high = error.of(lambda _, u: float(u @ u))
    assert low < there.u @ there.u < high


# Conditions, terms and loads


def square(formulation=MACRO, mesh=None):
    mesh = mesh or rectangle(50, 50, (4, 4), "delaunay")
    return Ply(mesh, BIAS, formulation)


def test_an_elastic_term_of_ones_own_leaves_no_interval():
    ply, mass = square(Full()), BilinearForm(lambda u, v, w: dot(u, v))
    energy = Functional(lambda w: 0.5 * dot(w["u"], w["u"]))
    forms = Forms(energy, LinearForm(lambda v, w: dot(w["u"], v)), mass)
    glued = ply.with_terms(FormTerm("glue", forms, CellBasis(ply.mesh, ply.basis.elem)))
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0, 1.0))}
    assert run_of(ply, held, 1).error.load is not None
    error = run_of(glued, held, 1).error
    assert error.load is None
    assert error.reason.startswith("the discretisation error of the term glue is not")


def rotated(X, t):
    """Rotates the edge by half a radian about its middle, so that its mean vanishes."""
    x = X[0] - X[0].mean()
    return np.array([x * (np.cos(0.5 * t) - 1), x * np.sin(0.5 * t)])


def test_the_load_of_a_rotated_edge_is_the_rate_of_the_energy():
    """Its mean displacement is zero and gives no load."""
    mesh = rectangle(50, 100, (2, 4), "delaunay")
    ply = Ply(mesh, Fabric(1e3, 1.0, (1, 1), (-1, 1)), Full())
    held = {"bottom": Condition("bottom"), "top": Condition("top", rotated)}
    result = run_of(ply, held, n := 12)
    last = [sum(s.energies.values()) for s in result.states[-4:]]
    rate = np.dot(last, [-2, 9, -18, 11]) / 6 * n
    work = work_of(problem_of(result.ply, held).at(1.0), result.states[-1])
    assert work == pytest.approx(rate, rel=1e-3)
    assert 0 < result.error.load < 1


# States without an interval


def reason_of(error):
    """The reason of an interval that is not available."""
    assert error.load is None
    assert error.shear_angle is None
    assert error.reactions == {}
    with pytest.raises(ValueError, match="there is no interval: ") as refused:
        error.of(lambda ply, u: float(u.max()))
    assert str(refused.value) == f"there is no interval: {error.reason}"
    return error.reason


def test_a_ply_at_rest_and_an_unstable_state_have_no_interval():
    result = pulled()
    reason = reason_of(result.interval(result.states[0]))
    assert reason == "the ply is not loaded yet"
    mesh = MeshQuad.init_tensor(np.linspace(0, 1, 9), np.linspace(0, 0.1, 2))
    rods = Ply(mesh.with_defaults(), Fabric(100.0, 0.01), Full())
    squeezed = {"left": Condition("left"), "right": Condition("right", (-0.2, 0.0))}
    buckled = run_of(rods, squeezed, 1, method="plain", warn_only=["stability", "work"])
    assert reason_of(buckled.error) == "the equilibrium is not stable"
    summary = buckled.summary()
    assert summary["load_half_width"] is None
    assert summary["shear_angle_error_deg"] is None
    assert summary["error_interval"] == "none: the equilibrium is not stable"


def there_and_back(X, t):
    return np.array([np.zeros(X.shape[1]), np.full(X.shape[1], 20 * t * (1 - t))])


@pytest.mark.parametrize(
    ("formulation", "value"), [(Full(), there_and_back), (MACRO, 0.0)]
)
def test_without_a_load_only_the_shear_angle_has_an_error(formulation, value):
    held = {"bottom": Condition("bottom"), "top": Condition("top", value)}
    result = run_of(square(formulation), held, 4)
    assert result.error.load is None
    assert result.error.shear_angle < 1e-6
    assert result.error.reason == "no moving condition carries a load"
    summary = result.summary()
    assert summary["error_interval"] == (
        "by the numerical stiffness; none for the load: no moving condition carries a "
        "load"
    )


@pytest.mark.parametrize("formulation", [OnePoint(), Full()], ids=repr)
def test_a_ply_without_free_nodes_has_no_interval(formulation):
    """Nothing can move with the numerical stiffness; the error is large."""
    mesh = MeshQuad().scaled(50.0).with_defaults()
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 8.0))}
    reason = reason_of(run_of(square(formulation, mesh), held, 1).error)
    assert reason == "no node is free: refine the mesh"


def test_a_mostly_numerical_resistance_has_no_interval():
    reason = reason_of(pulled("irregular", OnePoint(1e4), (2, 4)).error)
    assert reason == (
        "most of the resistance is numerical: refine the mesh, or use one that follows "
        "the singular fibres"
    )


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (MemoryError(), "there is not enough memory"),
        (IndexError("out of\nbounds"), "IndexError: out of"),
        (
            NoEquilibriumError("stuck"),
            "a formulation with numerical stiffness has no state nearby: stuck",
        ),
    ],
)
def test_a_failed_interval_loses_no_run(error, reason, monkeypatch):
    def fails(*_, **__):
        raise error

    result = pulled("delaunay", Full())
    monkeypatch.setattr(interval, "equilibrium_near", fails)
    assert reason_of(result.error) == reason
    assert result.summary()["error_interval"] == f"none: {reason}"


def test_an_unstable_reference_is_not_compared_with(monkeypatch):
    result, near = pulled("delaunay", Full()), interval.equilibrium_near

    def unstable(*arguments, **options):
        state = near(*arguments, **options)
        return replace(state, verdict=replace(state.verdict, min_det_F=-0.1))

    monkeypatch.setattr(interval, "equilibrium_near", unstable)
    assert "it is not stable, or elements are folded" in reason_of(result.error)


def test_an_error_of_a_quantity_is_raised():
    error = pulled(size=(2, 4)).error
    with pytest.raises(KeyError, match="mine"):
        error.of(lambda ply, u: {}["mine"])


# Forces of the variation of the tension


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


@pytest.mark.parametrize(
    ("degrees", "initial", "height", "pole", "converged"),
    [
        (86.418, 66.823, 138.984, None, (151.74, 152.6)),
        (64.3906, 39.1424, 95.0842, 59.7048, (3020.0, 3031.0)),
    ],
    ids=["steep fibres", "pole of the law"],
)
def test_the_load_beside_a_pole_is_inside(degrees, initial, height, pole, converged):
    """The work of the load on the default net, in N·mm."""
    angle, end = np.radians([initial, degrees])
    free = (height / np.sin(angle) - 50 / np.cos(angle)) / 2
    pull = 2 * free * (np.sin(end) - np.sin(angle))
    (c, s), G = (np.cos(angle), np.sin(angle)), 0.53967
    law = Locking(G, np.radians(pole)) if pole else Linear(G)
    fabric = Fabric(12521.34, law, (c, s), (-c, s))
    outline = Outline([[0, 50, 50, 0], [0, 0, height, height]])
    held = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, pull))}
    mesh = mesh_outline(outline, fabric, held)
    stepper = LoadStepper(Ply(mesh, fabric, Quadratic(400.0, points=6)), held, 1)
    result = stepper.run()
    work = work_of(stepper.problem.at(1.0), result.states[-1])
    half = result.error.load
    assert work * (1 - half) < converged[0]
    assert work * (1 + half) > converged[1]
    assert half < 0.06


def test_one_point_on_triangles_is_compared_with_macro_elements():
    """One point locks on triangles; 43.214 N: `docs/angles/references.json`."""
    result = pulled("delaunay", OnePoint(), (8, 16), 1e5, steps=2)
    assert OnePoint().reference(result.ply.mesh) == Macro()
    load, half = result.states[-1].reactions["top"][1], result.error.load
    assert 0.02 < load / 43.214 - 1 < half * load / 43.214
    assert half < 2.5 * (1 - 43.214 / load)
