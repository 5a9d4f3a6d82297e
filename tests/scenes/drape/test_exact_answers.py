"""Plies on surfaces have the shear angles and pressures of exact solutions."""

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    Macro,
    OnePoint,
    OnSurface,
    Ply,
    Quadratic,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.contact.risks import most_compressed
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers import arguments_of
from tests.helpers.tools import (
    SIDE,
    SPHERE,
    SYMMETRY,
    chebyshev,
    geodesic_u,
    shear_error,
    square,
)

SADDLE = drape.HeightField(
    lambda x, y: drape.Height(
        *(0.002 * (x * x - y * y), 0.004 * x, -0.004 * y),
        *(0.004 + 0 * x, 0 * x, -0.004 + 0 * x),
    )
)


@pytest.mark.parametrize(
    ("formulation", "coarse", "bound"), [(Macro(), 8, 0.1), (OnePoint(), 6, 0.05)]
)
def test_the_chebyshev_net_is_found_in_a_few_solves(formulation, coarse, bound):
    """Errors of second order: the warp of a sphere is not resisted."""
    errors, parts = [], 2 if isinstance(formulation, Macro) else 1
    for cells in (coarse, 2 * coarse):
        ply, conditions, start = chebyshev(formulation, cells // parts)
        warned = ["stabilisation"] if cells == coarse else []
        state = equilibrium_near(ply, conditions, start, warn_only=warned)
        assert state.linear_solves <= 8
        assert state.verdict.stable
        errors.append(shear_error(ply, state.u))
    assert errors[1] < bound
    assert np.log2(errors[0] / errors[1]) > 1.2


@pytest.mark.parametrize(
    ("formulation", "shear", "tension", "unit"),
    [
        (Macro(), 0.1, 0.1, 1.0),
        (OnePoint(), 0.1, 50.0, 1e-6),
        (OnePoint(), 1e-4, 20.0, 1e3),
    ],
)
def test_no_stiffness_tension_or_unit_of_force_takes_more_solves(
    formulation, shear, tension, unit
):
    stiffnesses = (unit * x for x in (1e5, shear, tension))
    ply, conditions, start = chebyshev(formulation, 6, *stiffnesses)
    state = equilibrium_near(ply, conditions, start, warn_only=["stabilisation"])
    assert state.linear_solves <= 8


def rolled(angle, formulation, q=1.0, side=SIDE, mesh=MeshQuad, warn_only=()):
    """A ply rolled around a cylinder of radius 60, pulled along and around it."""
    radius = 60.0
    end = side / radius
    loads = [
        Traction("right", (q * np.cos(end), 0, -q * np.sin(end))),
        Traction("top", (0.0, q, 0.0)),
    ]
    c, s = np.cos(angle), np.sin(angle)
    fabric = Fabric(1e5, 0.1, warp=(c, s), weft=(-s, c))
    ply = square(side, 12, fabric, formulation, loads, mesh=mesh)
    cylinder = drape.Cylinder(radius, (0, 0, -radius))
    conditions = {"on": OnSurface(cylinder)} | SYMMETRY
    start = geodesic_u(ply, cylinder)
    state = equilibrium_near(ply, conditions, start, warn_only=warn_only)
    return ply, cylinder, state


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_a_cylinder_causes_no_shear_and_a_pressure_of_tension_over_radius(formulation):
    ply, cylinder, state = rolled(0.0, formulation)
    assert np.abs(ply.shear_angle(state.u)).max() < 1e-8
    pressure = drape.contact_pressure(ply, cylinder, *arguments_of(state))
    inner = ply.nodes[0] < SIDE - 1e-9
    np.testing.assert_allclose(pressure[inner], 1.0 / 60.0, rtol=0.02)
    assert not drape.wrinkle_risk(ply, state.u).any()


@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
def test_a_cylinder_shears_a_bias_ply_at_its_pulled_edges_only(formulation):
    """Askew edge elements shear by h/(2R): q h²/(8R² (q + 2G)) with fibres at ±45°."""
    q, shear, radius = 1.0, 0.1, 60.0
    ply, _, state = rolled(np.pi / 4, formulation, q=0.0)
    assert np.abs(ply.shear_angle(state.u)).max() < 1e-8
    ply, _, state = rolled(np.pi / 4, formulation, q)
    h = SIDE / (12 * (2 if isinstance(formulation, Macro) else 1))
    exact = q * h**2 / (8 * radius**2 * (q + 2 * shear))
    np.testing.assert_allclose(np.abs(ply.shear_angle(state.u)), exact, rtol=0.01)


def test_the_pressure_on_a_sphere_is_the_sum_of_tensions_over_the_radius():
    ply, conditions, start = chebyshev(OnePoint(), 16)
    state = equilibrium_near(ply, conditions, start)
    pressure = drape.contact_pressure(ply, SPHERE, *arguments_of(state))
    tension = ply.fibre_tension(state.u)[..., 0].sum(axis=0)
    angle = ply.shear_angle(state.u)[:, 0]
    exact = tension / 100.0 / np.cos(angle)
    centres = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    inner = (centres < 0.92 * SIDE).all(axis=0)
    of_elements = pressure[ply.mesh.t].mean(axis=0)
    np.testing.assert_allclose(of_elements[inner], exact[inner], rtol=0.02)


@pytest.mark.parametrize("tension", [(3.0, 1.0), (1.0, 3.0)])
def test_a_saddle_has_positive_and_negative_pressures(tension):
    """Fibres along x lift off the saddle, fibres along y press on it."""
    loads = [
        Traction(name, sign * tension[i] * np.eye(3)[i])
        for i, (low, high) in enumerate((("left", "right"), ("bottom", "top")))
        for name, sign in ((low, -1), (high, 1))
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
    state = equilibrium_near(ply, conditions, geodesic_u(ply, SADDLE))
    pressure = drape.contact_pressure(ply, SADDLE, *arguments_of(state))
    warp, weft = tension
    assert pressure[middle] == pytest.approx(0.004 * (weft - warp), rel=0.02)


@pytest.mark.parametrize("formulation", [Macro(), Quadratic(80.0), OnePoint()])
def test_triangles_and_quadrilaterals_have_the_same_pressure(formulation):
    """The pressure on a cylinder is q/R for any elements; all forces add up to it."""
    warned = "stabilisation", "deviation"
    ply, cylinder, state = rolled(0.0, formulation, 1.0, 60.0, MeshTri, warned)
    pressure = drape.contact_pressure(ply, cylinder, *arguments_of(state))
    inner = (ply.nodes[0] > 4.0) & (ply.nodes[0] < 56.0)
    np.testing.assert_allclose(pressure[inner], 1.0 / 60.0, rtol=0.02)


# Wrinkling of fibres on a surface


def test_formulations_agree_on_where_fibres_wrinkle():
    """Tensions at the points of quadratic triangles oscillate from -8 to 8 N/mm."""
    tool, c, s = drape.Sphere(150.0, (0, 0, -150)), np.cos(0.3), np.sin(0.3)
    fabric = Fabric(2e4, 0.2, (c, s), (-s, c), bending=(40.0, 60.0))
    shares = []
    for formulation in (OnePoint(), Quadratic()):
        ply = square(60.0, 10, fabric, formulation)
        held = {"on": OnSurface(tool)} | SYMMETRY
        state = equilibrium_near(ply, held, geodesic_u(ply, tool))
        shares.append(drape.wrinkle_risk(ply, state.u).mean())
    assert 0 < min(shares) <= max(shares) < 0.1


def test_any_compression_beyond_the_wrinkling_angle_is_a_risk():
    """In the region that has such an angle, and not where the fibres are pulled."""
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
        most = most_compressed(ply, u)
        assert right[most] if risk else most is None


@pytest.mark.parametrize(("tension", "risk"), [(-0.99, False), (-1.01, True)])
def test_a_net_buckles_in_its_plane_at_the_wrinkling_limit(tension, risk):
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
    assert drape.wrinkle_risk(ply, np.nan * u).all()
    if risk:
        with pytest.raises(NoEquilibriumError, match="unstable"):
            equilibrium_near(ply, conditions, u, method="plain")
    else:
        state = equilibrium_near(ply, conditions, u, method="plain")
        assert state.verdict.stable
