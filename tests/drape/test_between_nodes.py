"""Meshes too coarse for the curvature of their tool are reported."""

import logging

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Fabric,
    LoadStepper,
    OnePoint,
    OnSurface,
    Ply,
    Quadratic,
    drape,
    equilibrium_near,
)
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.surface import gaps
from tests.helpers.tools import SYMMETRY, geodesic_u

SIDE, TOP, SLOPE = 90.0, 40.0, np.tan(np.radians(50))
OTHERS = "work", "stabilisation", "deviation", "corners"


def dome(fillet):
    """A flat top and walls of 50° with a fillet between them."""
    width = fillet * SLOPE / np.hypot(1, SLOPE)

    def at(x, y):
        rho = np.maximum(np.hypot(x, y), 1e-9)
        s = np.clip(rho - TOP, 0, width)
        root = np.sqrt(fillet**2 - s**2)
        h = root - fillet - SLOPE * np.maximum(rho - TOP - width, 0)
        slope = -s / root
        bend = np.where((rho > TOP) & (rho < TOP + width), -(fillet**2) / root**3, 0)
        c, n = x / rho, y / rho
        around = slope / rho
        return drape.Height(
            *(h, slope * c, slope * n, bend * c * c + around * n * n),
            *((bend - around) * c * n, bend * n * n + around * c * c),
        )

    return drape.HeightField(at)


def draped(surface, cells, formulation=None, mesh_of=MeshQuad):
    s = np.linspace(0, SIDE, cells + 1)
    mesh = mesh_of.init_tensor(s, s).with_defaults()
    fabric = Fabric(1e4, 0.1, bending=(5.0, 5.0))
    ends = {"left": "mirror", "bottom": "mirror"}
    ply = Ply(mesh, fabric, formulation or OnePoint(), dimension=3, fibre_ends=ends)
    conditions = {
        "tool": OnSurface(surface),
    } | SYMMETRY
    return ply, conditions, geodesic_u(ply, surface)


def gaps_at(ply, surface, u):
    x = ply.positions(u)
    return gaps([(surface, np.arange(x.shape[1]))], x, ply.basis)


@pytest.mark.parametrize("ratio", [0.56, 0.28])
@pytest.mark.parametrize("cells", [8, 16])
def test_a_mesh_that_resolves_the_fillets_is_not_reported(cells, ratio):
    surface = dome(SIDE / cells / ratio)
    ply, conditions, start = draped(surface, cells)
    state = equilibrium_near(ply, conditions, start, warn_only=OTHERS)
    assert gaps_at(ply, surface, state.u).share.max() < 0.1


@pytest.mark.parametrize("ratio", [1.12, 2.2, 4.5])
@pytest.mark.parametrize("cells", [8, 16])
def test_elements_as_large_as_a_fillet_have_a_position_and_share(cells, ratio):
    surface = dome(SIDE / cells / ratio)
    ply, conditions, start = draped(surface, cells)
    with pytest.raises(NoEquilibriumError, match="deviate from the surface") as error:
        equilibrium_near(ply, conditions, start, warn_only=OTHERS)
    state = equilibrium_near(ply, conditions, start, warn_only=(*OTHERS, "surface"))
    gap = gaps_at(ply, surface, state.u)
    is_coarse = gap.share > 0.125
    worst = gap.share.argmax()
    np.testing.assert_array_equal(error.value.elements, np.flatnonzero(is_coarse))
    share = ply.basis.dx.sum(axis=1)[is_coarse].sum() / SIDE**2
    message = str(error.value)
    assert f"{is_coarse.sum()} element(s), {100 * share:.2g} % of the area" in message
    assert message.endswith("refine the mesh there")
    x, y, z = gap.position[:, worst]
    by = f"by up to {gap.gap[worst]:.2g} mm at ("
    at = np.array(message.partition(by)[2].partition(")")[0].split(","), dtype=float)
    # The dome is symmetric.
    np.testing.assert_allclose(sorted(at), sorted([x, y, z]), rtol=1e-3, atol=1e-3)
    radius = np.hypot(*gap.position[:2, worst])
    assert abs(radius - TOP) < SIDE / cells + SIDE / cells / ratio


def test_a_run_warns_and_continues(caplog):
    surface = dome(5.0)
    ply, conditions, _ = draped(surface, 8)
    with caplog.at_level(logging.WARNING):
        result = LoadStepper(ply, conditions, 2).run()
    assert result.states[-1].load_factor == 1.0
    assert "deviate from the surface between nodes" in caplog.text


@pytest.mark.parametrize("turn", [0.2, 0.5, 1.0])
def test_the_gap_of_an_arc_is_its_sagitta(turn):
    """The gap is tan(turn/4)/2 of the chord; quadratic elements are far closer."""
    radius = 10.0
    cylinder = drape.Cylinder(radius, (0, 0, -radius))
    for of, formulation, bound in (
        (MeshQuad, OnePoint(), (0.99, 1.01)),
        (MeshTri, Quadratic(), (0.0, 0.1)),
    ):
        mesh = of.init_tensor(
            np.linspace(0, 4 * turn * radius, 5), np.array([0.0, 1.0])
        )
        ply = Ply(mesh, Fabric(1e4, 0.1), formulation, dimension=3)
        u = geodesic_u(ply, cylinder)
        gap = gaps_at(ply, cylinder, u)
        low, high = bound
        exact = radius * (1 - np.cos(turn / 2))
        assert low * exact <= gap.gap.max() <= high * exact
        edge = max(2 * radius * np.sin(turn / 2), 1.0)
        if low:
            np.testing.assert_allclose(gap.share, exact / edge, rtol=0.01)


def test_elements_with_nodes_off_the_surface_have_no_gap():
    sphere = drape.Sphere(20.0, (0, 0, -20))
    s = np.linspace(0, 20, 5)
    mesh = MeshQuad.init_tensor(s, s)
    ply = Ply(mesh, Fabric(1e4, 0.1), OnePoint(), dimension=3)
    x = np.pad(ply.nodes, ((0, 1), (0, 0)))
    on = np.flatnonzero(ply.nodes[0] < 11)
    x[:, on] = drape.exponential_map(sphere, ply.nodes[:, on])
    gap = gaps([(sphere, on)], x, ply.basis)
    near = mesh.p[0, mesh.t].max(axis=0) < 11
    assert (gap.gap[near] > 0).all()
    assert not gap.gap[~near].any()
