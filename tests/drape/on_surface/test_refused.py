"""Surfaces and conditions on them that are refused."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    OnSurface,
    Ply,
    StepError,
    drape,
    equilibrium_near,
)
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers.laid_plies import SYMMETRY, laid, square


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
    start = laid(ply, sphere)
    conditions.pop("x"), conditions.pop("y")
    with pytest.raises(NoEquilibriumError, match="across its surface already"):
        equilibrium_near(ply, conditions, start)
