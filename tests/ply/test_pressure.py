"""A pressure that follows the surface, and the edges that it needs."""

import numpy as np
import pytest
from scipy.optimize import brentq
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    LoadStepper,
    OnePoint,
    Ply,
    Pressure,
    Quadratic,
)
from tests.helpers import derivative, distorted, wobble

EVERY = {"quadrilaterals": Full(), "triangles": Quadratic()}
every_element = pytest.mark.parametrize("formulation", EVERY.values(), ids=EVERY)


def pressed(formulation, value=0.7):
    mesh = distorted(1, jitter=0.2).with_defaults()
    return Ply(mesh, Fabric(10.0, 1.0), formulation, [Pressure(value)], dimension=3)


@every_element
def test_the_energy_is_that_of_the_volume_above_the_plane(formulation):
    ply = pressed(formulation)
    x, y = ply.nodes
    u = ply.basis.zeros()
    u[::3], u[1::3], u[2::3] = 0.5 * x, 0.2 * y, 1 + 0.3 * x
    volume = 1.5 * 1.2 * 6 * (1 + 0.3 * 1.5)
    assert ply.energies(u, 0.5)["pressure"] == pytest.approx(-0.35 * volume, rel=1e-12)


@every_element
def test_forces_and_tangent_are_derivatives(formulation):
    ply = pressed(formulation)
    term = ply.terms[-1]
    u, d = wobble(ply, 1, 0.2), wobble(ply, 2, 1.0)
    slope = derivative(lambda x: term.energy(x, 0.5), u, d)
    assert term.residual(u, 0.5) @ d == pytest.approx(slope, rel=1e-8)
    change = derivative(lambda x: term.residual(x, 0.5), u, d)
    np.testing.assert_allclose(term.tangent(u, 0.5) @ d, change, atol=1e-8)


@every_element
def test_inside_the_force_is_pressure_times_area_along_the_normal(formulation):
    """On a plane that is turned, stretched and lifted."""
    ply = pressed(formulation)
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))
    F = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    F *= np.linalg.det(F)
    F[:, 0] *= 1.7
    u = (F @ X - X + 3.0).T.ravel()
    f = -ply.nodal(ply.residuals(u, 1.0)["pressure"])
    share = ply.nodal(ply.with_terms().load(ply.basis.zeros(), 1.0))[2]
    inner = (ply.nodes > 1e-9).all(axis=0) & (ply.nodes < [[2.999], [1.999]]).all(
        axis=0
    )
    assert inner.any()
    expected = 1.7 * F[:, 2:] * share[inner]
    np.testing.assert_allclose(f[:, inner], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("formulation", [OnePoint(), Quadratic()], ids=["quad", "tri"])
def test_a_sheet_between_two_edges_becomes_a_cylinder(formulation):
    """T/λ = p R, the arc λ L over the chord L."""
    L, E, p = 100.0, 1e3, 1.0
    mesh = MeshQuad.init_tensor(np.linspace(0, L, 17), np.linspace(0, 20, 4))
    mesh = mesh.with_defaults()
    fabric = Fabric(E, 0.1, bending=(1.0, 1.0))
    ply = Ply(mesh, fabric, formulation, [Pressure(p)], dimension=3)
    conditions = {
        "left": Condition("left"),
        "right": Condition("right"),
        "across": Condition(lambda X: X[0] > -1, (None, 0.0, None)),
    }
    result = LoadStepper(ply, conditions, 4, solver="superlu").run()

    def unbalanced(half_angle):
        stretch = half_angle / np.sin(half_angle)
        return E * np.log(stretch) / stretch - p * L / (2 * np.sin(half_angle))

    angle = brentq(unbalanced, 1e-3, 1.5)
    height = L / 2 * np.tan(angle / 2)
    assert ply.nodal(result.u)[2].max() == pytest.approx(height, rel=5e-3)
    # Each held edge carries half of the pressure on the chord.
    force = result.states[-1].reactions["left"]
    assert force[2] == pytest.approx(-p * L * 20 / 2, rel=1e-6)


def test_edges_on_planes_of_symmetry_may_rise():
    """A quarter of a square bulges as the whole does."""
    heights = []
    for side, n, fixed in (
        (100.0, 8, ("left", "bottom", "right", "top")),
        (50.0, 4, ("left", "bottom")),
    ):
        lines = np.linspace(0, side, n + 1)
        mesh = MeshQuad.init_tensor(lines, lines).with_defaults()
        ply = Ply(mesh, Fabric(1e3, 1.0), Full(), [Pressure(0.1)], dimension=3)
        conditions = {name: Condition(name) for name in fixed}
        if side < 100:
            conditions["right"] = Condition("right", direction=(1, 0, 0))
            conditions["top"] = Condition("top", direction=(0, 1, 0))
        result = LoadStepper(ply, conditions, 2, solver="superlu").run()
        heights.append(ply.nodal(result.u)[2].max())
    assert heights[1] == pytest.approx(heights[0], rel=1e-8)


@pytest.mark.parametrize(
    ("conditions", "reason"),
    [
        ({"left": Condition("left")}, "boundary are free"),
        (
            {
                name: Condition(name, (0.0, 0.0, 1.0))
                for name in ("left", "right", "bottom", "top")
            },
            "",
        ),
        (
            {
                name: Condition(name, (None, None, 1.0))
                for name in ("left", "right", "bottom", "top")
            },
            "stay in the plane z = 0",
        ),
    ],
    ids=["free", "held", "lifted"],
)
def test_a_pressure_without_potential_is_refused(conditions, reason):
    ply = pressed(OnePoint())
    if reason:
        with pytest.raises(ValueError, match=f"load 'pressure': .*{reason}"):
            LoadStepper(ply, conditions, 1)
    else:
        LoadStepper(ply, conditions, 1)


@pytest.mark.parametrize(
    ("load", "dimension", "reason"),
    [
        (Pressure(1.0), 2, "give the ply dimension=3"),
        (Pressure(np.nan), 3, "must be a finite number"),
        (Pressure(1.0, lambda t: np.nan), 3, "its factor must be a finite number"),
    ],
    ids=["plane", "nan", "factor"],
)
def test_a_pressure_that_is_none_is_refused(load, dimension, reason):
    with pytest.raises(ValueError, match=reason):
        Ply(distorted(1), Fabric(), OnePoint(), [load], dimension=dimension)
