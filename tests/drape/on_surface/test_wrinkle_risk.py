"""Where fibres on a surface may wrinkle."""

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Macro,
    OnePoint,
    OnSurface,
    Ply,
    Quadratic,
    drape,
    equilibrium_near,
)
from skfem_textile.solve.states import NoEquilibriumError
from tests.helpers.laid_plies import SYMMETRY, laid, square


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
        held = {"on": OnSurface(tool)} | SYMMETRY
        state = equilibrium_near(ply, held, laid(ply, tool))
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
            equilibrium_near(ply, conditions, u, method="plain")
    else:
        state = equilibrium_near(ply, conditions, u, method="plain")
        assert state.verdict.stable
