import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    CrimpToe,
    Fabric,
    Linear,
    LoadStepper,
    OnePoint,
    Ply,
    Sin2,
    TensionOnly,
)
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.bias_extension import WIDTH, force, lost_to_stretch
from skfem_textile.scenes.rectangle import rectangle

pytestmark = pytest.mark.usefixtures("no_interval")

GAMMA = np.radians(40.0)


def solve(scene, law=0.5, C_s=5.0, steps=2):
    ply = Ply(scene.mesh, Fabric(1e4, law, scene.warp, scene.weft), OnePoint(C_s))
    return scene.summary(LoadStepper(ply, scene.conditions, steps).run())


@pytest.mark.parametrize("law", [Sin2(0.5), Linear(0.5)])
@pytest.mark.parametrize("sides", [(50.0, 120.0), (40.0, 130.0)])
@pytest.mark.parametrize("degrees", [35.0, 45.0, 50.0])
def test_the_force_is_the_rate_of_the_energy_of_the_three_zones(law, sides, degrees):
    (W, H), theta = sides, np.radians(degrees)
    mesh = rectangle(W, H, (4, 12), "aligned")
    scene = bias_extension(mesh, warp=theta, weft=np.pi - theta, shear_angle=GAMMA)
    x, y = (np.arange(400) + 0.5) / 400 * np.array([[W], [H]])
    grid = np.stack([one.ravel() for one in np.meshgrid(x, y)])
    angles = scene.shear_angle(grid, 1.0)
    share = [np.isclose(angles, g).mean() for g in (0, GAMMA / 2, GAMMA)]
    triangles = W**2 * np.tan(theta)  # corners and middles at one clamp are half of it
    zones = np.array([triangles / 2, triangles, W * H - 1.5 * triangles])
    np.testing.assert_allclose(W * H * np.array(share), zones, rtol=0.005)

    def energy(g):
        return zones @ law.energy(np.array([0, g / 2, g]))

    def elongation(g):
        return (H - W * np.tan(theta)) * (np.sin(theta + g / 2) / np.sin(theta) - 1)

    top = scene.displacement(np.array([[W / 3], [H]]), 1.0)
    np.testing.assert_allclose(top, [[0.0], [elongation(GAMMA)]], atol=1e-11)

    d = 1e-5
    rate = (energy(GAMMA + d) - energy(GAMMA - d)) / (
        elongation(GAMMA + d) - elongation(GAMMA - d)
    )
    assert force(law, GAMMA, W, H, theta) == pytest.approx(rate, rel=1e-7)
    assert scene.load(law, 1.0) == force(law, GAMMA, W, H, theta)


@pytest.mark.parametrize("t", [0.4, 1.0])
@pytest.mark.parametrize("degrees", [35.0, 45.0, 50.0])
def test_the_exact_motion_stretches_no_fibre_and_has_uniform_shear_zones(t, degrees):
    theta = np.radians(degrees)
    scene = bias_extension(
        "aligned", size=(10, 20), warp=theta, weft=np.pi - theta, shear_angle=GAMMA
    )
    X, d = scene.mesh.p + np.array([[0.013], [0.027]]), 1e-6
    for A in (scene.warp, scene.weft):
        step = d * np.array(A)[:, None]
        ends = [X + k * step + scene.displacement(X + k * step, t) for k in (1, -1)]
        stretch = np.linalg.norm(ends[0] - ends[1], axis=0) / (2 * d)
        np.testing.assert_allclose(stretch, 1.0, atol=1e-7)
    angles = scene.shear_angle(X, t)
    assert set(angles.round(12)) == set(np.round([0, t * GAMMA / 2, t * GAMMA], 12))
    H = 2 * WIDTH * np.tan(theta)
    delta = H / 2 * (np.sin(theta + t * GAMMA / 2) / np.sin(theta) - 1)
    top = scene.displacement(np.array([[0.0, 20.0, 50.0], [H] * 3]), t)
    np.testing.assert_allclose(top, [[0.0] * 3, [delta] * 3], atol=1e-12)


@pytest.mark.parametrize(
    ("law", "degrees", "bound"),
    [
        (Linear(0.5), 45.0, 0.04),
        (Sin2(0.5), 45.0, 0.06),
        (Linear(0.5), 40.0, 0.04),
        (Linear(0.5), 50.0, 0.04),
    ],
)
def test_one_stabilised_point_gives_the_load_on_a_jittered_mesh(law, degrees, bound):
    fibres = {"warp": np.radians(degrees), "weft": np.radians(180 - degrees)}
    summary = solve(bias_extension(size=(16, 32), **fibres), law)
    assert summary["load_over_exact"] == pytest.approx(1.0, abs=bound)
    assert summary["stable"]


def halves():
    """A mesh of the left half, and one of it and its mirror image."""
    half = rectangle(WIDTH / 2, 2 * WIDTH, (3, 12), "irregular", 0.25)
    p = half.p.round(6)
    mirrored = MeshQuad(np.stack([WIDTH - p[0], p[1]]), half.t[::-1])
    return MeshQuad(p, half.t), MeshQuad(p, half.t) + mirrored


@pytest.mark.parametrize("degrees", [40.0, pytest.param(45.0, marks=pytest.mark.slow)])
def test_half_a_ply_on_a_roller_agrees_with_the_whole(degrees):
    theta = np.radians(degrees)
    half, whole = halves()
    fibres = {"warp": theta, "weft": np.pi - theta}
    one = solve(bias_extension(whole, **fibres))
    scene = bias_extension(half, part="half", **fibres)
    for angle in (0.0, np.radians(30.0)):
        other = solve(scene.rotated(angle))
        for name in ("load_over_exact", "max_fibre_strain", "displacement_error_max"):
            assert other[name] == pytest.approx(one[name], rel=1e-6)
        assert other["reaction_y"] == pytest.approx(one["reaction_y"] / 2, rel=1e-6)
        assert other["energy"] == pytest.approx(one["energy"] / 2, rel=1e-6)


@pytest.mark.parametrize(
    ("seed", "size"), [(2, (8, 16)), pytest.param(3, (16, 32), marks=pytest.mark.slow)]
)
def test_fibres_that_resist_tension_only_are_stretched_in_few_solves(seed, size):
    """The load agrees with `docs/benchmarks/laws.md`."""
    scene = bias_extension(seed=seed, size=size)
    fibres = TensionOnly(Linear(1e5))
    ply = Ply(scene.mesh, Fabric(fibres, 0.5, scene.warp, scene.weft))
    result = LoadStepper(ply, scene.conditions, steps=2).run()
    assert scene.summary(result)["reaction_y"] == pytest.approx(43.2, rel=0.03)
    assert result.linear_solves < 100


def test_the_ratio_of_loads_is_undefined_without_shear_stiffness():
    summary = solve(bias_extension(size=(4, 8)), 0.0, steps=2)
    assert "load_over_exact" not in summary


@pytest.mark.parametrize(
    "kind", ["irregular", pytest.param("delaunay", marks=pytest.mark.slow)]
)
def test_one_step_and_eight_give_the_same_load(kind):
    """E_d follows the current state, not the initial one, which has no tension."""
    scene = bias_extension(kind, size=(4, 8))
    fabric = Fabric(1e5, 0.5, scene.warp, scene.weft)
    runs = {
        steps: LoadStepper(Ply(scene.mesh, fabric), scene.conditions, steps).run()
        for steps in (1, 8)
    }
    loads = {steps: scene.reaction(run.states[-1])[1] for steps, run in runs.items()}
    assert loads[1] == pytest.approx(loads[8], rel=0.005)
    assert all(run.path_resolved for run in runs.values())


def test_the_load_lost_to_stretch_is_not_estimated_from_crimp_at_rest():
    """Linear and quadratic triangles along the fibres give 3.4 % less, 42.3 N."""
    fabric = Fabric(CrimpToe(1e5, toe=0.004, initial_stiffness=10.0), 0.5)
    share = lost_to_stretch(fabric, GAMMA, WIDTH, 2 * WIDTH)
    assert 0.02 < share < 0.04
