"""Nets along straight fibres: graded lines, cells cut by the outline, and loads."""

import numpy as np
import pytest
import shapely

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Outline,
    Ply,
    Quadratic,
    Sin2,
    mesh_outline,
)
from skfem_textile.mesh.checks import check_mesh
from skfem_textile.outlines import SINGULAR
from skfem_textile.outlines.net import graded
from skfem_textile.scenes.bias_extension import force
from tests.outlines.test_triangles import random_case

W, H = 50.0, 100.0


def fabric(degrees=45.0, ratio=1e5, law=0.5):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return Fabric(0.5 * ratio, law, (c, s), (-c, s))


def held(travel=10.0):
    return {"bottom": Condition("bottom"), "top": Condition("top", (0.0, travel))}


def area(mesh):
    return shapely.area(shapely.polygons(mesh.p[:, mesh.t].T)).sum()


def test_lines_are_finest_at_strong_keys_and_pass_through_all_keys():
    keys, strong = np.array([0.0, 10.0, 30.0]), np.array([False, True, False])
    lines = graded(keys, strong, finest=0.1, largest=5.0, growth=1.0)
    gaps = np.diff(lines)
    assert np.isin(keys, lines).all()
    at = int(np.flatnonzero(lines == 10.0)[0])
    # The size doubles within the first element: ∫ dx/(0.1 + x) = 1 at x = 0.17.
    assert gaps[at - 1] < 0.18
    assert gaps[at] < 0.18
    assert gaps.max() <= 5.0
    finer = graded(keys, strong, 0.1, 5.0, 1.0, density=2.0)
    assert 1.7 < (len(finer) - 1) / (len(lines) - 1) < 2.3


def test_singular_fibres_are_edges_with_a_name():
    mesh = mesh_outline(Outline([[0, W, W, 0], [0, 0, H, H]]), fabric(), held())
    x = mesh.p[:, mesh.facets[:, mesh.boundaries[SINGULAR]]]
    length = np.linalg.norm(x[:, 1] - x[:, 0], axis=0).sum()
    assert length == pytest.approx(4 * W * np.sqrt(2), rel=1e-9)
    along = np.abs(x[0, 1] - x[0, 0]) - np.abs(x[1, 1] - x[1, 0])
    np.testing.assert_allclose(along, 0, atol=1e-9)
    assert {"left", "bottom", "right", "top"} < set(mesh.boundaries)


@pytest.mark.parametrize("seed", [4714, 4717, 4722])
def test_random_outlines_with_holes_give_valid_meshes_of_the_same_area(seed):
    outline, fabric, held, _ = random_case(seed)
    mesh = mesh_outline(outline, fabric, held)
    check_mesh(mesh)
    assert area(mesh) == pytest.approx(outline.shape().area, rel=1e-9)
    assert len(mesh.boundaries["fixed"]) > 0


def test_names_of_holes_and_points_are_kept():
    angles = 2 * np.pi * np.arange(24) / 24
    hole = 25 + 8 * np.cos(angles), 40 + 8 * np.sin(angles)
    outline = Outline(
        [[0, W, W, 0], [0, 0, H, H]], [hole], points={"pin": (20.0, 70.0)}
    )
    conditions = held() | {"pin": Condition("pin", 0.0, direction=(1, 0))}
    mesh = mesh_outline(outline, fabric(41.0), conditions)
    at_hole = mesh.p[:, mesh.facets[:, mesh.boundaries["hole"]]]
    np.testing.assert_allclose(np.hypot(at_hole[0] - 25, at_hole[1] - 40), 8, rtol=0.01)
    np.testing.assert_allclose(mesh.p[:, mesh.named_nodes["pin"]].T, [[20.0, 70.0]])


def test_load_of_a_bias_extension_is_right_within_half_a_percent():
    theta, gamma = np.pi / 4, np.radians(40.0)
    law = Sin2(0.5)
    free = (H / np.sin(theta) - W / np.cos(theta)) / 2
    travel = 2 * free * (np.sin(theta + gamma / 2) - np.sin(theta))
    f = fabric(45.0, 2e6, law)
    mesh = mesh_outline(Outline([[0, W, W, 0], [0, 0, H, H]]), f, held(travel))
    ply = Ply(mesh, f, Quadratic())
    assert ply.basis.N < 5000
    state = LoadStepper(ply, held(travel), steps=1).run().states[-1]
    # Fibres that stretch take 0.22 % of the load (docs/angles).
    expected = 0.9978 * force(law, gamma, W, H)
    assert state.reactions["top"][1] == pytest.approx(expected, rel=5e-3)


def test_twice_the_density_reduces_the_error_of_the_load():
    loads = []
    for density in (0.6, 1.2, 2.4):
        f = fabric(55.0, 1e5)
        mesh = mesh_outline(
            Outline([[0, W, W, 0], [0, 0, 150, 150]]), f, held(), density=density
        )
        state = LoadStepper(Ply(mesh, f, Quadratic()), held(), steps=1).run().states[-1]
        loads.append(state.reactions["top"][1])
    errors = np.abs(np.array(loads[:2]) - loads[2])
    assert errors[1] < errors[0] / 3


@pytest.mark.parametrize("angle", [0.0, 90.0])
@pytest.mark.parametrize("holes", [(), ([[10, 30, 30, 10], [20, 20, 60, 60]],)])
def test_cells_that_the_outline_does_not_cut(angle, holes):
    """Fibres along the edges of a rectangle, with and without an aligned hole."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    f = Fabric(1e4, 0.5, (c, s), (-s, c))
    outline = Outline([[0, W, W, 0], [0, 0, H, H]], holes)
    for conditions in (held(), {}):
        mesh = mesh_outline(outline, f, conditions)
        check_mesh(mesh)
        assert area(mesh) == pytest.approx(outline.shape().area, rel=1e-12)


@pytest.mark.parametrize("size", [None, 10.0])
@pytest.mark.parametrize(("low", "high"), [(0.0, 2.5), (0.0, 61.7), (50.0, 51.2)])
def test_a_held_part_of_an_edge_ends_at_nodes(size, low, high):
    """A function of position selects them, also where elements are larger."""

    def where(x):
        return (x[1] == 0) & (x[0] >= low) & (x[0] <= high)

    outline = Outline([[0, 100, 100, 0], [0, 0, 150, 150]])
    conditions = {"held": Condition(where), "top": Condition("top", (0.0, 1.0))}
    mesh = mesh_outline(outline, fabric(40.0), conditions, size=size)
    x = mesh.p[0, where(mesh.p)]
    assert [x.min(), x.max()] == pytest.approx([low, high], abs=1e-9)
    assert mesh.p[1].max() == 150.0


def test_the_size_is_divided_by_the_density():
    outline = Outline([[0, W, W, 0], [0, 0, H, H]])
    sizes = [
        mesh_outline(outline, fabric(), held(), size=10.0, density=d).nelements
        for d in (1.0, 2.0)
    ]
    assert 3 < sizes[1] / sizes[0] < 5


def test_an_outline_without_names_is_meshed():
    """No edge of a diamond lies on its bounding box."""
    outline = Outline([[0, 50, 0, -50], [-50, 0, 50, 0]])
    assert not outline.boundaries
    for size in (None, 10.0):
        check_mesh(mesh_outline(outline, fabric(30.0), {}, size=size))


def test_nets_are_graded_towards_corners_of_clamps():
    """The layer of a singular fibre begins at a corner, where it is narrow."""
    mesh = mesh_outline(Outline([[0, W, W, 0], [0, 0, H, H]]), fabric(40.0), held())
    x, y = mesh.p
    c, s = np.cos(np.radians(40.0)), np.sin(np.radians(40.0))
    along = c * x + s * y
    on_fibre = (np.abs(s * x - c * y) < 1e-6) & (along > 1e-6)
    assert along[on_fibre].min() < 0.01 * np.sqrt(W * H)


def test_the_fibre_law_acts_on_all_stretches_along_resolved_layers():
    """E_d is E for the family along a layer, and far less for the other."""
    E = 0.5e5
    mesh = mesh_outline(Outline([[0, W, W, 0], [0, 0, H, H]]), fabric(), held())
    ply = Ply(mesh, fabric(), Quadratic(400.0, points=6))
    E_d = ply.parameters_at_rest["tension"]["E_d"][..., 0]
    along = np.isclose(E_d, E, rtol=2e-3)
    assert 0.3 < along.any(axis=0).mean() < 0.9
    assert not along.all(axis=0).any()
    assert E_d[::-1][along].max() < 0.01 * E


def test_the_load_of_steep_fibres_is_close():
    """Fibres end at 80° to the clamps: 63.46 N with three times the density."""
    theta, height = np.radians(58.0), 90.0
    free = (height / np.sin(theta) - W / np.cos(theta)) / 2
    travel = 2 * free * (np.sin(np.radians(80.0)) - np.sin(theta))
    outline, plain = Outline([[0, W, W, 0], [0, 0, height, height]]), fabric(58.0)
    mesh = mesh_outline(outline, plain, held(travel))
    ply = Ply(mesh, plain, Quadratic(400.0, points=6))
    result = LoadStepper(ply, held(travel), steps=1).run()
    load = result.states[-1].reactions["top"][1]
    assert load == pytest.approx(63.46, rel=0.006)
    assert abs(load / 63.46 - 1) < result.error.load < 0.03
