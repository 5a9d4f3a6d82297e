from itertools import pairwise

import numpy as np
import pytest

from skfem_textile import Condition, Fabric, LoadStepper, OnePoint, Ply
from skfem_textile.scenes import strip
from tests.helpers import distorted, random_u
from tests.helpers.intervals import without_interval


@pytest.fixture(scope="module")
def step_series():
    """Summaries of the strip in 5, 10 and 20 steps, by kind of stabilisation.

    The number of steps has no effect with an energy.
    """
    scene = strip("irregular", (10, 15), 0.3, 1)
    summaries = {}
    for kind, numbers in (("energy", [5]), ("rate", [5, 10, 20])):
        ply = Ply(scene.mesh, Fabric(1e4), OnePoint(10.0, kind))
        runs = (LoadStepper(ply, scene.conditions, n).run() for n in numbers)
        summaries[kind] = [scene.summary(without_interval(run)) for run in runs]
    return summaries


def test_rates_and_energy_have_the_same_forces_for_a_small_motion():
    """In one step, and in two that add their moments."""
    rate, energy = (
        Ply(distorted(5), Fabric(1e4), OnePoint(2.0, kind))
        for kind in ("rate", "energy")
    )
    u = random_u(rate, 5, 1e-6)
    f = energy.residuals(u)["stabilisation"]
    half = rate.advanced(rate.parameters_at_rest, 0.5 * u)
    for parameters in (rate.parameters_at_rest, half):
        found = rate.residuals(u, 1.0, parameters)["stabilisation"]
        np.testing.assert_allclose(found, f, atol=1e-5 * np.abs(f).max())


@pytest.mark.slow
def test_rates_and_energy_agree_on_the_strip(step_series):
    energy, rate = (runs[-1] for runs in step_series.values())
    keys = (
        "reaction_x max_fibre_strain mesh_fibre_strain displacement_error_rms "
        "displacement_error_max shear_angle_error_rms_deg"
    )
    for key in keys.split():
        assert rate[key] == pytest.approx(energy[key], rel=0.05), key
        assert rate[key] != energy[key], key


@pytest.mark.slow
def test_the_work_of_the_rates_converges_with_the_steps(step_series):
    """With first order, to a fifth more than the energy: it depends on the path."""
    energy, work = (
        [summary["stabilisation_energy"] for summary in runs]
        for runs in step_series.values()
    )
    few, many = np.diff(work)
    assert few / many == pytest.approx(2.0, rel=0.1)
    assert extrapolated(work) == pytest.approx(1.205 * energy[-1], rel=0.005)


def turn(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def sheared_with_rotation(ply, steps, angle):
    """Moments M̃ after a motion of all nodes, with a rotation superposed on it."""
    X, parameters = ply.mesh.p, ply.parameters_at_rest
    bend = 0.3 * np.random.default_rng(0).standard_normal(X.shape)
    for t in np.arange(1, steps + 1) / steps:
        x = turn(angle * t) @ (X + t * bend + 0.2 * t**2 * X[::-1] ** 2)
        parameters = ply.advanced(parameters, (x - X).T.ravel(), t)
    return parameters["stabilisation"]["moment"]


def extrapolated(values):
    """Limit of values at n, 2n, 4n, ... steps (Richardson)."""
    for order in range(1, len(values)):
        values = [(2**order * b - a) / (2**order - 1) for a, b in pairwise(values)]
    return values[0]


def test_a_rotation_superposed_on_the_loading_changes_nothing_in_the_limit():
    """Differences decrease as 1/steps; the extrapolated limit is zero."""
    ply = Ply(distorted(3, jitter=0.25), Fabric(1e4), OnePoint(2.0, "rate"))
    differences = []
    for steps in (8, 16, 32, 64):
        plain, turned = (sheared_with_rotation(ply, steps, a) for a in (0.0, 1.0))
        differences.append((turned - plain) / np.abs(plain).max())
    sizes = [np.abs(d).max() for d in differences]
    assert sizes[-2] / sizes[-1] == pytest.approx(2.0, rel=0.02)
    assert np.abs(extrapolated(differences)).max() < 1e-6


def loaded_with_rotation(steps, angle):
    """Force on a ply pulled askew, in axes that rotate with the whole problem."""
    mesh = distorted(6, size=(4, 3), jitter=0.25)
    ply = Ply(mesh, Fabric(1e3, 1.0), OnePoint(5.0, "rate"))

    def placed(pull):
        def displacement(X, t):
            return turn(angle * t) @ (X + t * np.array(pull)[:, None]) - X

        return displacement

    conditions = {
        "bottom": Condition("bottom", placed((0.0, 0.0))),
        "top": Condition("top", placed((0.5, 0.1))),
    }
    result = LoadStepper(ply, conditions, steps).run()
    return turn(-angle) @ result.states[-1].reactions["top"]


@pytest.mark.slow
def test_rotating_a_loaded_ply_changes_no_load_in_the_limit():
    differences = []
    for steps in (4, 8, 16, 32):
        plain, turned = (loaded_with_rotation(steps, a) for a in (0.0, 1.0))
        differences.append((turned - plain) / np.linalg.norm(plain))
    sizes = np.array([np.abs(d).max() for d in differences])
    np.testing.assert_allclose(sizes[:-1] / sizes[1:], 2.0, rtol=0.15)
    assert np.abs(extrapolated(differences)).max() < 0.01 * sizes[-1]


def test_parameters_contain_a_copy_of_the_displacement():
    ply = Ply(distorted(1), Fabric(1e4), OnePoint(2.0, "rate"))
    u = random_u(ply, 1)
    values = ply.advanced(ply.parameters_at_rest, u)["stabilisation"]
    u += random_u(ply, 2)
    np.testing.assert_array_equal(values["last"], random_u(ply, 1))


def test_a_homogeneous_increment_changes_no_moments():
    """The paper's B_HGL Δu vanishes on it, from any state."""
    ply = Ply(distorted(4), Fabric(1e4), OnePoint(2.0, "rate"))
    u = random_u(ply, 4)
    parameters = ply.advanced(ply.parameters_at_rest, u)
    before = parameters["stabilisation"]["moment"]
    G = np.array([[0.1, 0.3], [-0.2, 0.05]])
    x = ply.mesh.p + ply.nodal(u)
    parameters = ply.advanced(parameters, u + (G @ x).T.ravel())
    after = parameters["stabilisation"]["moment"]
    assert np.abs(before).max() > 1e-3
    np.testing.assert_allclose(after, before, atol=1e-14)


def test_the_work_is_the_work_of_the_forces():
    ply = Ply(distorted(5), Fabric(1e4), OnePoint(2.0, "rate"))
    steps, work, before, parameters = 10, 0.0, 0.0, ply.parameters_at_rest
    target, u = random_u(ply, 5, 0.3), ply.basis.zeros()
    for t in np.arange(1, steps + 1) / steps:
        f = ply.residuals(t * target, t, parameters)["stabilisation"]
        work += 0.5 * (before + f) @ target / steps
        u, before = t * target, f
        parameters = ply.advanced(parameters, u, t)
    energy = ply.energies(u, 1.0, parameters)["stabilisation"]
    assert energy == pytest.approx(work, rel=0.01)
