"""Meshes too coarse for the curvature of their tool are reported, with a place."""

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
from skfem_textile.scenes.draped_ply import draped_ply
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.surfaces.surface import gaps
from tests.helpers.tools import SYMMETRY, case_of, geodesic_u

SIDE, TOP, SLOPE = 90.0, 40.0, np.tan(np.radians(50))
OTHERS = "work", "stabilisation", "deviation", "corners"


def rounded(fillet, top=TOP, corner=0.0):
    """A flat top, and walls of 50° with a fillet between them: round, or a box.

    The top of a box is a square with rounded corners.
    """
    width = fillet * SLOPE / np.hypot(1, SLOPE)

    def at(x, y):
        p, q = (np.maximum(x - top, 0), np.maximum(y - top, 0)) if corner else (x, y)
        start = corner or top
        rho = np.maximum(np.hypot(p, q), 1e-9)
        s = np.clip(rho - start, 0, width)
        root = np.sqrt(fillet**2 - s**2)
        h = root - fillet - SLOPE * np.maximum(rho - start - width, 0)
        slope, c, n = -s / root, p / rho, q / rho
        on_fillet = (rho > start) & (rho < start + width)
        bend = np.where(on_fillet, -(fillet**2) / root**3, 0)
        around = np.where((p > 0) & (q > 0), slope / rho, 0) if corner else slope / rho
        return drape.Height(
            *(h, slope * c, slope * n, bend * c * c + around * n * n),
            *((bend - around) * c * n, bend * n * n + around * c * c),
        )

    return drape.HeightField(at)


def draped(surface, cells):
    s = np.linspace(0, SIDE, cells + 1)
    mesh = MeshQuad.init_tensor(s, s).with_defaults()
    fabric = Fabric(1e4, 0.1, bending=(5.0, 5.0))
    ends = {"left": "mirror", "bottom": "mirror"}
    ply = Ply(mesh, fabric, OnePoint(), dimension=3, fibre_ends=ends)
    return ply, {"tool": OnSurface(surface)} | SYMMETRY, geodesic_u(ply, surface)


def gaps_at(ply, surface, u):
    x = ply.positions(u)
    return gaps([(surface, np.arange(x.shape[1]))], x, ply.basis)


@pytest.mark.parametrize("ratio", [0.56, 0.28])
def test_a_mesh_that_resolves_the_fillets_is_not_reported(ratio):
    surface = rounded(SIDE / 8 / ratio)
    ply, conditions, start = draped(surface, 8)
    state = equilibrium_near(ply, conditions, start, warn_only=OTHERS)
    assert gaps_at(ply, surface, state.u).share.max() < 0.1


@pytest.mark.parametrize("ratio", [1.12, 2.2])
def test_elements_as_large_as_a_fillet_have_a_position_and_share(ratio):
    surface, cells = rounded(SIDE / 8 / ratio), 8
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
    ply, conditions, _ = draped(rounded(5.0), 4)
    with caplog.at_level(logging.WARNING):
        result = LoadStepper(ply, conditions, 2).run()
    assert result.states[-1].load_factor == 1.0
    assert "deviate from the surface between nodes" in caplog.text


@pytest.mark.parametrize("turn", [0.2, 0.5, 1.0])
def test_the_gap_of_an_arc_is_its_sagitta(turn):
    """The gap is tan(turn/4)/2 of the chord; quadratic elements are far closer."""
    radius = 10.0
    cylinder = drape.Cylinder(radius, (0, 0, -radius))
    for of, formulation, (low, high) in (
        (MeshQuad, OnePoint(), (0.99, 1.01)),
        (MeshTri, Quadratic(), (0.0, 0.1)),
    ):
        s = np.linspace(0, 4 * turn * radius, 5)
        mesh = of.init_tensor(s, np.array([0.0, 1.0]))
        ply = Ply(mesh, Fabric(1e4, 0.1), formulation, dimension=3)
        gap = gaps_at(ply, cylinder, geodesic_u(ply, cylinder))
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


# Elements that are large against the fillets of a tool


def shear_by_place(fillet, cells):
    """Shear angles of a quarter in degrees by row and column, and its summary."""
    scene = draped_ply(
        *("box", rounded(fillet, 35.0, 3.0), "irregular"),
        size=(cells, cells),
        width=140.0,
        height=140.0,
    )
    result = case_of(scene).run()
    ply, rows = result.ply, 2 * cells
    angle = np.degrees(ply.shear_angle(result.u).mean(axis=1))
    centre = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    i, j = np.floor(centre * rows / 70.0).astype(int)
    by_row = np.zeros((rows, rows))
    by_row[i, j] = angle
    return by_row, scene.summary(result)


@pytest.mark.usefixtures("coarse_net", "no_interval")
@pytest.mark.parametrize(("fillet", "turn"), [(20.0, 25), (8.0, 40)])
def test_elements_that_turn_by_more_than_30_degrees_are_reported(fillet, turn):
    _, figures = shear_by_place(fillet, 6)
    assert figures["max_turn_of_normal_deg"] == pytest.approx(turn, abs=5)
    assert ("coarse_elements" in figures) == (turn > 30)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_net", "no_interval")
@pytest.mark.parametrize(
    ("fillet", "least", "most"), [(20.0, 0.3, 1.0), (8.0, 1.0, 4.0)]
)
def test_elements_that_are_reported_have_shear_errors_above_one_degree(
    fillet, least, most
):
    """The reference has elements of a third of the size."""
    (coarse, _), (fine, _) = (shear_by_place(fillet, cells) for cells in (6, 18))
    means = fine.reshape(12, 3, 12, 3).mean(axis=(1, 3))
    assert least < np.abs(coarse - means).max() < most


@pytest.mark.usefixtures("coarse_net", "no_interval")
def test_the_turn_of_the_normal_is_the_arc_angle_of_an_element():
    sphere = drape.Sphere(100.0, (0, 0, -100))
    sides = {"width": 80.0, "height": 80.0}
    scene = draped_ply("ball", sphere, "irregular", size=(4, 4), **sides)
    result = case_of(scene, stretch=1e5).run()
    turn = drape.turn_of_normal(result.ply, result.tool(1.0), result.u)
    diagonal = np.hypot(5, 5) / 100  # macro-elements have two parts a side
    assert turn[0] == pytest.approx(diagonal, rel=0.02)
