"""Copies: pickled and deep copies of every kind of object, and copies of arrays."""

import pickle
from copy import deepcopy
from functools import partial

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from skfem import MeshQuad

from skfem_textile import (
    Asymmetric,
    BodyForce,
    Clamp,
    Condition,
    CrimpToe,
    Fabric,
    Force,
    Holder,
    Linear,
    LoadStepper,
    Locking,
    Macro,
    MatrixTerm,
    OnePoint,
    OnSurface,
    Outline,
    Ply,
    Polynomial,
    Pressure,
    Quadratic,
    Sin2,
    StepError,
    Tabulated,
    ToleranceStepper,
    Tool,
    Traction,
    UserError,
    VectorTerm,
    drape,
    scenes,
)
from skfem_textile.solve.linear import SOLVERS
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.surfaces.surface import OffSurfaceError

COPIES = [deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
MESH = MeshQuad().refined(1).scaled(100.0).with_defaults()
STEEP = Fabric(1e4, 0.5, (1, 1), (-1, 1))
HELD = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, 0.1))}
SPACE = {"dimension": 3}
EDGES = {name: Condition(name) for name in ("left", "right", "bottom", "top")}
BENT = Fabric(1e3, 0.5, bending=(5.0, 5.0))
PUNCH = Tool(drape.Sphere(30.0, (50, 50, -30)), motion=(0, 0, 0.5), name="punch")


def in_scene(scene, **fabric):
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft, **fabric)
    return scenes.Case(scene=scene, fabric=fabric, steps=1).stepper()


def on_mesh(formulation=None, fabric=STEEP, conditions=HELD, terms=(), **ply):
    ply = Ply(MESH, fabric, formulation or OnePoint(), terms, **ply)
    return LoadStepper(ply, conditions, 1)


STEPPERS = {
    "trellis": lambda: in_scene(
        scenes.trellis(size=(2, 2), edges={"top": 0.3, "left": "free"})
    ),
    "cantilever": lambda: in_scene(
        scenes.cantilever(size=(2, 1)), bending=(50.0, 50.0)
    ),
    "tensioned": lambda: in_scene(
        scenes.hemisphere(size=(2, 2), part="whole", tension=0.2)
    ),
    "macro": lambda: on_mesh(Macro()),
    "quadratic": lambda: on_mesh(Quadratic(400, points=6)),
    "rates": lambda: on_mesh(OnePoint(1.0, kind="rate")),
    "loads": lambda: on_mesh(
        terms=[Traction("top", (1.0, 0.0)), BodyForce((0, -1e-3))]
    ),
    "pressure": lambda: on_mesh(
        fabric=BENT, conditions=EDGES, terms=[Pressure(1e-4)], **SPACE
    ),
    "holder": lambda: on_mesh(
        fabric=BENT,
        conditions=EDGES,
        terms=[PUNCH, Holder(drape.Plane((0, 0, -5)), pressure=1e-4, side=1)],
        **SPACE,
    ),
}


def same_states(result, other):
    for state, copied in zip(result.states, other.states, strict=True):
        np.testing.assert_allclose(copied.u, state.u, atol=1e-9)


def assert_same(result, other, one=None):
    """The second is a copy; `one` is the summary of the first, if it is known."""
    one = one or result.summary()
    same_states(result, other)
    two = other.summary()
    assert one.keys() == two.keys()
    for name, value in one.items():
        if isinstance(value, float) and not name.endswith("time_s"):
            assert two[name] == pytest.approx(value, rel=1e-6, abs=1e-9)
    assert other.error.reason == result.error.reason
    fields = [x.ply.shear_angle(x.u) for x in (result, other)]
    np.testing.assert_allclose(*fields, atol=1e-9)


@pytest.mark.parametrize("name", STEPPERS)
def test_results_and_steppers_are_copied(name):
    stepper = STEPPERS[name]()
    result = stepper.run()
    same = partial(assert_same, result, one=result.summary())
    for copied in COPIES:
        same(copied(result))
        same_states(result, copied(stepper).result)
    same(copied(stepper).run())


@pytest.mark.parametrize("copied", COPIES, ids=["deepcopy", "pickle"])
@pytest.mark.parametrize("form", [Macro(), OnePoint()])
def test_intervals_of_loads_are_copied(form, copied):
    fabric = Fabric(2e3, 0.3, (1, 1), (-1, 1))
    mesh = MeshQuad.init_tensor(np.linspace(0, 30, 3), np.linspace(0, 60, 5))
    ply = Ply(mesh.with_defaults(), fabric, form)
    result = LoadStepper(ply, HELD, 1).run()
    error = copied(result.error)
    assert error.load == result.error.load > 0
    assert error.of(work) == result.error.of(work)
    assert copied(result).error.of(work) == error.of(work)


def work(ply, u):
    return float(u @ u)


@pytest.mark.parametrize(
    "solver",
    [
        pytest.param(
            solver,
            marks=[pytest.mark.dear("loads its library")] * (solver == "pardiso"),
        )
        for solver in SOLVERS
    ],
)
def test_steppers_are_copied_with_any_linear_solver(solver):
    pytest.importorskip(SOLVERS[solver].package)
    stepper = LoadStepper(Ply(MESH, STEEP), HELD, 1, solver=solver)
    result = stepper.run()
    for copied in COPIES:
        np.testing.assert_allclose(copied(stepper).run().u, result.u, atol=1e-9)


def at_density(density):
    n = round(2 * density)
    mesh = MeshQuad.init_tensor(*2 * [np.linspace(0, 20, n + 1)]).with_defaults()
    return LoadStepper(Ply(mesh, Fabric(1e3, 0.5)), HELD, 1)


def test_runs_to_a_tolerance_and_errors_are_copied():
    stepper = ToleranceStepper(at_density, 0.1)
    result = stepper.run()
    for copied in COPIES:
        assert_same(result, copied(result))
        assert copied(stepper).run().rounds == result.rounds
        error = copied(StepError("stopped", result, np.array([1]), "shear_angle"))
        assert str(error) == "stopped"
        assert error.elements.tolist() == [1]
        assert_same(result, error.result)


@pytest.mark.parametrize("copied", COPIES, ids=["deepcopy", "pickle"])
def test_exceptions_are_copied_with_their_attributes(copied):
    net = copied(drape.NetError("the threads end", AXIS, "; move it"))
    assert str(net) == "net: the threads end at (0, 0, 1) mm; move it"
    assert net.position.tolist() == [0.0, 0.0, 1.0]
    assert copied(OffSurfaceError("a geodesic", AXIS)).what == "a geodesic"
    assert str(copied(UserError(ValueError("no")))) == "ValueError: no"
    assert copied(NoEquilibriumError("no", [3], "fewer")).advice == "fewer"


def test_a_function_of_the_user_is_copied_but_not_pickled():
    held = HELD | {"top": Condition(lambda x: x[1] > 99, lambda X, t: t * (0 * X + 1))}
    stepper = on_mesh(conditions=held)
    result = stepper.run()
    assert_same(result, deepcopy(stepper).run())
    assert_same(result, deepcopy(result))
    with pytest.raises((AttributeError, pickle.PicklingError), match="lambda"):
        pickle.dumps(result)


GAMMA = np.array([0.0, 0.5, 1.0])
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]]).T
CORNERS = np.array([[0.0, 10, 10, 0], [0, 0, 10, 10]])
AXIS = np.array([0.0, 0.0, 1.0])
PLANE = drape.Plane()


#: Object of an array, and the array.
OF_ARRAYS = {
    "condition nodes": (Condition, np.array([1, 2])),
    "condition value": (lambda a: Condition("top", a), np.ones(2)),
    "condition list": (lambda a: Condition("top", [a, None]), np.ones(3)),
    "condition direction": (lambda a: Condition("top", 1, a), np.ones(2)),
    "plane": (lambda a: drape.Plane(a, a), AXIS),
    "sphere": (lambda a: drape.Sphere(10.0, a), AXIS),
    "cylinder": (lambda a: drape.Cylinder(10.0, a, a), AXIS),
    "cone": (lambda a: drape.Cone(0.3, a, a), AXIS),
    "torus": (lambda a: drape.Torus(20.0, 5.0, a, a), AXIS),
    "punch": (lambda a: drape.Punch(20.0, a), AXIS),
    "die": (lambda a: drape.Die(20.0, 5.0, a), AXIS),
    "tool mesh": (lambda a: drape.ToolMesh(a, (TRIANGLES,)), np.eye(3, 4)),
    "cells": (lambda a: drape.ToolMesh(np.eye(3, 5), (a,)), TRIANGLES),
    "surface nodes": (lambda a: OnSurface(PLANE, a), np.array([1, 2])),
    "touch": (lambda a: OnSurface(PLANE, touch=a), np.ones(2)),
    "motion": (lambda a: Tool(PLANE, a), AXIS),
    "outline of tool": (lambda a: Tool(PLANE, outline=a), CORNERS),
    "motion of holder": (lambda a: Holder(PLANE, 1.0, motion=a), AXIS),
    "outline of holder": (lambda a: Holder(PLANE, 1.0, outline=a), CORNERS),
    "outline": (Outline, CORNERS),
    "directions": (lambda a: Fabric(1e4, 1.0, a), np.ones((2, 3))),
    "weft": (lambda a: Fabric(1e4, 1.0, (1, 0), a), np.ones(2)),
    "stiffness": (lambda a: Fabric((a, 1e4), a), np.ones(3)),
    "bending": (lambda a: Fabric(1e4, bending=(a, a), twist=a), np.ones(3)),
    "wrinkling angle": (lambda a: Fabric(wrinkling_angle=a), np.full(3, 0.2)),
    "linear": (Linear, np.ones(3)),
    "sin2": (Sin2, np.ones(3)),
    "polynomial": (Polynomial, np.ones(2)),
    "table": (lambda a: Tabulated(a, a), GAMMA),
    "traction": (lambda a: Traction("top", a), np.ones(2)),
    "force": (lambda a: Force(np.array([1]), a), np.ones(2)),
    "loaded nodes": (lambda a: Force(a, (1, 0)), np.array([1, 2])),
    "clamp": (lambda a: Clamp("top", 1.0, a), np.ones(2)),
    "body force": (BodyForce, np.ones(2)),
    "matrix": (lambda a: MatrixTerm("m", a), np.eye(3)),
    "vector": (lambda a: VectorTerm("v", a), np.ones(3)),
    "guess": (
        lambda a: LoadStepper(Ply(MESH, STEEP), HELD, 1, initial_guess=a).initial_guess,
        np.zeros(50),
    ),
}


@pytest.mark.parametrize("name", OF_ARRAYS)
def test_later_changes_of_an_array_change_no_object(name):
    build, array = OF_ARRAYS[name]
    array = array.copy()
    one = build(array)
    before = pickle.dumps(one)
    array += 1
    assert pickle.dumps(one) == before


def test_later_changes_of_a_sparse_matrix_change_no_term():
    matrix = csr_matrix(np.eye(3))
    term = MatrixTerm("m", matrix)
    matrix.data[:] = 2.0
    assert term.energy(np.ones(3), 1.0) == 1.5


def test_arrays_of_objects_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        Condition("top", np.ones(2)).value[0] = 2.0


@pytest.mark.parametrize(
    "one",
    [
        *(Linear(1.0), Sin2(1.0), Locking(1.0, 0.8), Polynomial((1.0, 2.0))),
        *(
            CrimpToe(1e3, 0.01, 10.0),
            Tabulated(GAMMA, GAMMA),
            Asymmetric(Linear(1e4), Linear(1.0)),
        ),
        *(drape.double_dome(), PUNCH, PLANE, drape.Torus(20.0, 5.0)),
    ],
    ids=lambda one: type(one).__name__,
)
@pytest.mark.parametrize("copied", COPIES, ids=["deepcopy", "pickle"])
def test_laws_tools_and_surfaces_are_copied(one, copied):
    assert type(copied(one)) is type(one)
