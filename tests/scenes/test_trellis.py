import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import CENTRE, Fabric, Full, LoadStepper, OnePoint, Ply, quad_basis
from skfem_textile.scenes import picture_frame, trellis
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.scenes.trellis import SIDE, sheared
from tests.helpers import forces_of

pytestmark = pytest.mark.usefixtures("no_interval")


def solve(scene, formulation, E=1e4, G=0.5, steps=1):
    fabric = Fabric(E, G, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, formulation)
    return LoadStepper(ply, scene.conditions, steps).run()


def held_nodes(scene):
    return scene.conditions["held"].nodes("held", quad_basis(scene.mesh, CENTRE))


@pytest.mark.parametrize(
    ("formulation", "degrees"),
    [(Full(), 80.0), (OnePoint(1.0), 45.0), (OnePoint(10.0, "rate"), 10.0)],
)
def test_a_picture_frame_is_exact(formulation, degrees):
    gamma = np.radians(degrees)
    scene = picture_frame("horizontal", size=(5, 5), shear_angle=gamma)
    result = solve(scene, formulation, steps=3)
    summary = scene.summary(result)
    assert summary["displacement_error_max"] < 1e-9
    assert summary["mesh_fibre_strain"] < 1e-11
    moment = 0.5 * gamma
    force = SIDE * moment * np.array([np.cos(gamma), -np.sin(gamma)])
    np.testing.assert_allclose(scene.reaction(result.states[-1]), force, rtol=1e-8)
    assert summary["energy"] == pytest.approx(SIDE**2 * 0.25 * gamma**2)


@pytest.mark.parametrize("crossing", [30.0, 90.0, 150.0])
@pytest.mark.parametrize("inclination", [0.0, 20.0, 90.0])
def test_a_straight_trellis_is_exact_at_any_fibre_angles(crossing, inclination):
    warp, weft = np.radians([inclination, inclination + crossing])
    scene = trellis(size=(5, 5), warp=warp, weft=weft, turns=sheared(np.radians(20.0)))
    summary = scene.summary(solve(scene, OnePoint(1.0)))
    assert summary["displacement_error_max"] < 1e-8 * SIDE
    assert summary["shear_angle_error_rms_deg"] < 1e-7


def test_a_bent_trellis_converges_to_the_inextensible_motion():
    errors = []
    for n in (4, 8, 16):
        scene = trellis("aligned", size=(n, n))
        errors.append(scene.errors(solve(scene, Full()))["displacement_error_rms"])
    assert errors[0] > 3.5 * errors[1] > 12 * errors[2]


# Fibres along no side, so that the constrained sides are clamps across them.
INCLINED = {"warp": np.radians(20.0), "weft": np.radians(100.0)}
EDGES = [
    {"right": "free"},
    {"left": np.radians(60.0)},
    {"right": "free", "left": np.radians(60.0)},
    {"right": "free", "top": np.radians(-30.0)},
    {"top": "free", "right": np.radians(110.0)},
    {"left": np.radians(35.0), "bottom": np.radians(-50.0)},  # they meet at a corner
]


@pytest.mark.parametrize(
    ("edges", "degrees"), [*zip(EDGES, [0.0, 25.0] * 3, strict=True)]
)
def test_a_straight_trellis_has_no_force_for_any_free_sides(edges, degrees):
    scene = trellis(size=(6, 6), turns=sheared(0.4), edges=edges, **INCLINED)
    result = solve(scene.rotated(np.radians(degrees)), OnePoint(1.0), G=0.0, steps=4)
    summary = scene.rotated(np.radians(degrees)).summary(result)
    assert summary["displacement_error_max"] < 1e-9
    assert summary["mesh_fibre_strain"] < 1e-11
    assert np.hypot(summary["reaction_x"], summary["reaction_y"]) < 1e-7
    assert summary["stable"]


@pytest.mark.parametrize(("side", "axis", "at"), [("left", 0, 0), ("top", 1, SIDE)])
def test_a_roller_moves_along_its_line_and_a_free_side_in_any_direction(side, axis, at):
    """Shear stiffness moves both away from the motion, which is then inexact."""
    edges = {"right": "free", side: np.radians(60.0)}
    scene = trellis(size=(6, 6), turns=sheared(0.4), edges=edges, **INCLINED)
    result = solve(scene, OnePoint(5.0), E=1e3, G=5.0, steps=2)
    error = result.ply.nodal(result.u) - scene.displacement(scene.mesh.p, 1.0)
    on_roller, on_right = scene.mesh.p[axis] == at, scene.mesh.p[0] == SIDE
    rolled, right = error[:, on_roller], error[:, on_right & ~on_roller]
    np.testing.assert_allclose(rolled[0] * np.sqrt(3), rolled[1], atol=1e-12)
    assert np.abs(rolled).max() > 0.1
    assert np.abs(right).max(axis=1).min() > 0.1
    held = held_nodes(scene)
    np.testing.assert_allclose(error[:, held], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("edges", "driven"),
    [
        ({}, "top"),
        ({"top": np.radians(20.0), "right": "free"}, "top"),
        ({"top": "free"}, "right"),
        ({"top": "free", "right": "free"}, "bottom"),
    ],
)
def test_the_reaction_is_summed_over_the_first_constrained_side(edges, driven):
    scene = trellis(size=(4, 4), turns=sheared(0.4), edges=edges, **INCLINED)
    result = solve(scene, OnePoint(1.0), steps=2)
    axis, side = {"top": (1, SIDE), "right": (0, SIDE), "bottom": (1, 0)}[driven]
    expected = forces_of(result)[:, scene.mesh.p[axis] == side].sum(axis=1)
    assert scene.driven == driven
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(scene.reaction(result.states[-1]), expected, rtol=1e-9)


def test_edges_on_no_side_and_corners_of_constrained_sides_are_constrained():
    """A square without its upper right quarter, its right side free."""
    square = rectangle(SIDE, SIDE, (4, 4), "aligned")
    quarter = (square.p[:, square.t].mean(axis=1) > SIDE / 2).all(axis=0)
    mesh = square.remove_elements(np.flatnonzero(quarter))
    mesh = MeshQuad(mesh.p, mesh.t)
    scene = trellis(mesh, edges={"right": "free"})
    boundary = mesh.p[:, mesh.boundary_nodes()]
    free = (boundary[0] == SIDE) & (boundary[1] > 0) & (boundary[1] < SIDE / 2)
    held = mesh.p[:, held_nodes(scene)]
    np.testing.assert_array_equal(held, boundary[:, ~free])
    all_free = dict.fromkeys(["left", "bottom", "right", "top"], "free")
    everything_else = trellis(mesh, edges=all_free)
    assert everything_else.driven == "held"
    inner = mesh.p[:, held_nodes(everything_else)]
    assert sorted(map(tuple, inner.T)) == [
        (50, 50),
        (50, 75),
        (50, 100),
        (75, 50),
        (100, 50),
    ]


@pytest.mark.parametrize("t", [0.3, 1.0])
def test_exact_motions_stretch_no_fibre(t):
    def warp(s, t):
        return t * np.sin(s / 30)

    def weft(s, t):
        return t * 0.2 * np.cos(s / 20)

    inclinations = np.radians([15.0, 100.0])
    scene = trellis(warp=inclinations[0], weft=inclinations[1], turns=(warp, weft))
    X, d = scene.mesh.p, 1e-4
    inclination = []
    for A in (scene.warp, scene.weft):
        step = d * np.array(A)[:, None]
        ends = [X + k * step + scene.displacement(X + k * step, t) for k in (1, -1)]
        a = (ends[0] - ends[1]) / (2 * d)
        np.testing.assert_allclose(np.linalg.norm(a, axis=0), 1.0, atol=1e-8)
        inclination.append(np.arctan2(a[1], a[0]))
    crossing = inclination[1] - inclination[0]
    np.testing.assert_allclose(
        np.ptp(inclinations) - crossing, scene.shear_angle(X, t), atol=1e-7
    )
