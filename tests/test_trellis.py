import numpy as np
import pytest

from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import picture_frame, trellis
from skfem_textile.scenes.trellis import SIDE, sheared


def solve(scene, formulation, E=1e4, G=0.5, steps=1):
    fabric = Fabric(E, G, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, formulation)
    return LoadStepper(ply, scene.conditions, steps).run()


@pytest.mark.parametrize("formulation", [Full(), OnePoint(1.0), OnePoint(10.0, "rate")])
@pytest.mark.parametrize("degrees", [10.0, 45.0, 80.0])
def test_a_picture_frame_is_exact(formulation, degrees):
    gamma = np.radians(degrees)
    scene = picture_frame("horizontal", size=(5, 5), shear_angle=gamma)
    result = solve(scene, formulation, steps=3)
    summary = scene.summary(result)
    assert summary["displacement_error_max"] < 1e-9
    assert summary["max_fibre_strain_2x2"] < 1e-11
    moment = 0.5 * gamma
    force = SIDE * moment * np.array([np.cos(gamma), -np.sin(gamma)])
    np.testing.assert_allclose(scene.reaction(result.states[-1]), force, rtol=1e-8)
    assert summary["energy"] == pytest.approx(SIDE**2 * 0.25 * gamma**2)


def test_the_machines_force_does_the_work_of_the_frame():
    """F times the travel of the corners: the docstring's formula is a derivative."""

    def travel(gamma):
        return 2 * SIDE * (np.cos(np.pi / 4 - gamma / 2) - np.sqrt(0.5))

    gamma, d = 0.6, 1e-6
    slope = (travel(gamma + d) - travel(gamma - d)) / (2 * d)
    force = SIDE * 0.5 * gamma / np.sin(np.pi / 4 - gamma / 2)
    assert force * slope == pytest.approx(SIDE**2 * 0.5 * gamma)


@pytest.mark.parametrize("crossing", [30.0, 90.0, 150.0])
@pytest.mark.parametrize("inclination", [0.0, 20.0, 90.0])
def test_a_straight_trellis_is_exact_at_any_fibre_angles(crossing, inclination):
    warp, weft = np.radians([inclination, inclination + crossing])
    scene = trellis(size=(5, 5), warp=warp, weft=weft, turns=sheared(np.radians(20.0)))
    summary = scene.summary(solve(scene, OnePoint(1.0)))
    assert summary["displacement_error_max"] < 1e-8 * SIDE
    assert summary["shear_angle_error_rms_deg"] < 1e-7


def test_a_bent_trellis_converges_to_the_motion_that_stretches_no_fibre():
    errors = []
    for n in (4, 8, 16):
        scene = trellis("aligned", size=(n, n))
        errors.append(scene.errors(solve(scene, Full()))["displacement_error_rms"])
    assert errors[0] > 3.5 * errors[1] > 12 * errors[2]


@pytest.mark.parametrize("t", [0.3, 1.0])
def test_no_motion_stretches_a_fibre(t):
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


def test_fibres_that_would_fold_or_are_parallel_are_refused():
    with pytest.raises(ValueError, match="would fold"):
        picture_frame(shear_angle=np.pi / 2)
    with pytest.raises(ValueError, match="would fold"):
        trellis(warp=0.0, weft=np.radians(30), turns=sheared(np.radians(31)))
    for degrees in (120.0, 300.0, 360.0, 400.0):
        with pytest.raises(ValueError, match="would fold"):
            picture_frame(shear_angle=np.radians(degrees))
    with pytest.raises(ValueError, match=r"shear by .* at load factor 0\.3"):
        trellis(turns=(lambda s, t: 8 * t * (1 - t) + 0 * s, lambda s, t: 0 * s))
    with pytest.raises(ValueError, match="parallel"):
        trellis(warp=0.3, weft=0.3)
