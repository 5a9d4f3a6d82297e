import numpy as np
import pytest

from skfem_textile import Fabric, Linear, LoadStepper, OnePoint, Ply, Sin2
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.bias_extension import HEIGHT, WIDTH, force
from skfem_textile.scenes.rectangle import rectangle

GAMMA = np.radians(40.0)


@pytest.mark.parametrize(("law", "known"), [(Sin2(0.5), 34.04), (Linear(0.5), 43.80)])
def test_the_force_is_that_of_fibres_that_do_not_stretch(law, known):
    assert force(law, GAMMA, WIDTH, HEIGHT) == pytest.approx(known, abs=0.005)


@pytest.mark.parametrize("law", [Sin2(0.5), Linear(0.5)])
@pytest.mark.parametrize("sides", [(50.0, 100.0), (40.0, 130.0)])
def test_the_force_is_the_rate_of_the_energy_of_the_three_zones(law, sides):
    W, H = sides
    D = H - W

    def energy(g):
        full, half = law.energy(np.array([g, g / 2]))
        return (W * (2 * H - 3 * W) / 2) * full + W**2 * half

    def elongation(g):
        return D * (np.sqrt(2) * np.cos(np.pi / 4 - g / 2) - 1)

    d = 1e-5
    rate = (energy(GAMMA + d) - energy(GAMMA - d)) / (
        elongation(GAMMA + d) - elongation(GAMMA - d)
    )
    assert force(law, GAMMA, W, H) == pytest.approx(rate, rel=1e-7)


@pytest.mark.parametrize("t", [0.4, 1.0])
def test_the_exact_motion_stretches_no_fibre_and_shears_by_zones(t):
    scene = bias_extension("aligned", size=(10, 20))
    X, d = scene.mesh.p + np.array([[0.013], [0.027]]), 1e-6
    for A in (scene.warp, scene.weft):
        step = d * np.array(A)[:, None] / np.sqrt(2)
        ends = [X + k * step + scene.displacement(X + k * step, t) for k in (1, -1)]
        stretch = np.linalg.norm(ends[0] - ends[1], axis=0) / (2 * d)
        np.testing.assert_allclose(stretch, 1.0, atol=1e-7)
    angles = scene.shear_angle(X, t)
    assert set(angles.round(12)) == set(np.round([0, t * GAMMA / 2, t * GAMMA], 12))
    delta = (HEIGHT - WIDTH) * (np.sqrt(2) * np.cos(np.pi / 4 - t * GAMMA / 2) - 1)
    top = scene.displacement(np.array([[0.0, 20.0, 50.0], [100.0] * 3]), t)
    np.testing.assert_allclose(top, [[0.0] * 3, [delta] * 3], atol=1e-12)


@pytest.mark.parametrize(("law", "off"), [(Linear(0.5), 0.04), (Sin2(0.5), 0.06)])
def test_one_stabilised_point_reads_the_load_on_a_jittered_mesh(law, off):
    scene = bias_extension(size=(16, 32))
    ply = Ply(scene.mesh, Fabric(1e4, law, scene.warp, scene.weft), OnePoint(5.0))
    summary = scene.summary(LoadStepper(ply, scene.conditions, 4).run())
    assert summary["load_over_exact"] == pytest.approx(1.0, abs=off)
    assert summary["stable"]


def test_without_shear_stiffness_there_is_no_load_to_compare_with():
    scene = bias_extension(size=(4, 8))
    ply = Ply(scene.mesh, Fabric(1e4, 0.0, scene.warp, scene.weft), OnePoint(5.0))
    summary = scene.summary(LoadStepper(ply, scene.conditions, 2).run())
    assert "load_over_exact" not in summary


def test_meshes_and_angles_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="between 0 and 90 degrees, got 95"):
        bias_extension(shear_angle=np.radians(95))
    with pytest.raises(ValueError, match="twice as high as wide"):
        bias_extension(rectangle(50, 90, (4, 8)))
    with pytest.raises(ValueError, match="corner must be at the origin"):
        bias_extension(rectangle(50, 100, (4, 8)).translated((1.0, 0.0)))
