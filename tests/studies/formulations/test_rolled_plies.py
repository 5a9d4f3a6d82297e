"""Elements with straight sides between generators cause no shear."""

import numpy as np
import pytest

from skfem_textile import Fabric, Macro, OnePoint, Ply, drape, equilibrium_near
from studies.formulations.drape import rolled
from tests.helpers import arguments_of


@pytest.mark.parametrize("tension", [0.0, 1.0])
@pytest.mark.parametrize("formulation", [Macro(), OnePoint()])
@pytest.mark.parametrize("how", [rolled.CYLINDER, rolled.BIAS, rolled.FAN])
def test_elements_between_generators_cause_no_shear(how, formulation, tension):
    """Pulled in the planes of its strips, or not."""
    cells = 6 if isinstance(formulation, Macro) else 12
    ply, conditions, surface, start = rolled.problem(
        how, formulation, cells, 12, tension
    )
    state = equilibrium_near(ply, conditions, start)
    assert np.abs(ply.shear_angle(state.u)).max() < 1e-10
    pressure = drape.contact_pressure(ply, surface, *arguments_of(state))
    mesh = ply.users_mesh
    on_edge = np.isin(mesh.t, mesh.boundary_nodes()).any(axis=0)[ply.parent]
    inner = np.setdiff1d(ply.mesh.t, ply.mesh.t[:, on_edge])
    exact = rolled.pressure(how, tension, ply.nodes)
    np.testing.assert_allclose(pressure[inner], exact[inner], rtol=0.01, atol=1e-9)


@pytest.mark.parametrize("degrees", [25.0, 45.0])
def test_a_cone_causes_no_shear_at_any_fibre_angle(degrees):
    plain, conditions, _, start = rolled.problem(rolled.FAN, Macro(), 6, 12)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    fabric = Fabric(1e5, 0.1, warp=(c, s), weft=(-s, c))
    ply = Ply(plain.users_mesh, fabric, Macro(), dimension=3)
    state = equilibrium_near(ply, conditions, start)
    assert np.abs(ply.shear_angle(state.u)).max() < 1e-10
