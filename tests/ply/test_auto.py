import logging

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import Fabric, Linear, LoadStepper, Macro, OnePoint, Ply, Sin2
from skfem_textile.scenes import bias_extension, strip
from tests.helpers import distorted, random_u
from tests.helpers.random_plies import Crimped


def run(scene, formulation, steps=4, E=1e4, shear=0.5, **options):
    ply = Ply(scene.mesh, Fabric(E, shear, scene.warp, scene.weft), formulation)
    return LoadStepper(ply, scene.conditions, steps, **options).run()


def stabilisation(ply, u=None):
    """C_s at a displacement, by default at rest."""
    parameters = ply.parameters_at_rest
    if u is not None:
        parameters = ply.updated(parameters, u)
    return parameters["stabilisation"]["C_s"]


def rule(G, omega, tau=0.0):
    """C_s with shear stiffness, from the angle ω between the families."""
    return (4 * G + 3.2 * tau) / (1 - np.abs(np.cos(omega))) ** 1.5


@pytest.mark.parametrize("formulation", [OnePoint(), Macro()])
def test_the_stiffness_at_rest_depends_on_shear_stiffness_and_angle_only(formulation):
    for half in (np.pi / 6, np.pi / 4, np.pi / 3):
        warp, weft = ((x, np.sin(half)) for x in (np.cos(half), -np.cos(half)))
        fabric = Fabric(1e4, Linear(0.5), warp, weft)
        ply = Ply(distorted(1), fabric, formulation)
        np.testing.assert_allclose(stabilisation(ply), rule(0.5, 2 * half))


@pytest.mark.parametrize("strain", [0.01, -0.01])
def test_the_stiffness_of_macro_elements_grows_with_tension_of_either_sign(strain):
    """Both families are stretched, or shortened, equally, and not sheared."""
    fabric = Fabric(1e3, Linear(0.5))
    for formulation, T in ((Macro(), 10.0), (OnePoint(), 0.0)):
        ply = Ply(distorted(1), fabric, formulation)
        u = ply.basis.zeros()
        u[ply.basis.nodal_dofs] = np.expm1(strain) * ply.mesh.p
        tau = T / (1 + 80 * np.sqrt(0.5 / 1e3))
        np.testing.assert_allclose(stabilisation(ply, u), rule(0.5, np.pi / 2, tau))


@pytest.mark.parametrize("E", [1e4, 1e6, (1e4, 3e4)])
def test_the_stiffness_without_shear_is_a_fraction_of_the_fibre_stiffness(E):
    scene = strip(size=(4, 6))
    ply = Ply(scene.mesh, Fabric(E, 0.0), OnePoint())
    np.testing.assert_allclose(stabilisation(ply), 1e-4 * np.mean(E))


def test_the_stiffness_follows_secant_and_angle_of_each_element():
    result = run(bias_extension(size=(6, 12)), OnePoint(), shear=Sin2(0.5))
    ply = result.ply
    angle = ply.shear_angle(result.u)
    secant = 0.25 * np.sin(2 * angle) / angle
    expected = rule(secant, np.pi / 2 - angle)
    used = result.states[-1].parameters["stabilisation"]["C_s"]
    np.testing.assert_allclose(used, expected, rtol=0.05)
    assert np.ptp(used) > 0.5
    np.testing.assert_allclose(stabilisation(ply, result.u), expected, rtol=1e-9)


def test_the_stiffness_is_positive_and_bounded():
    """It is bounded where fibres are nearly parallel."""
    mesh = distorted(1)
    ply = Ply(mesh, Fabric(1e4, Sin2(0.5)), OnePoint())
    sheared = ply.basis.zeros()
    sheared[ply.basis.nodal_dofs] = [8 * mesh.p[1], 0 * mesh.p[1]]
    np.testing.assert_allclose(stabilisation(ply, sheared), 4 * 0.05 / 0.01**1.5)


def test_the_stiffness_is_independent_of_the_node_order():
    """The shear angle is evaluated at the centre, also for curved fibres."""

    def warp(x):
        return np.stack([np.cos(0.3 * x[1]), np.sin(0.3 * x[1])])

    mesh, stiffnesses = distorted(1), []
    for turns in range(4):
        listed = MeshQuad(mesh.p, np.roll(mesh.t, turns, axis=0))
        ply = Ply(listed, Fabric(1e4, Sin2(0.5), warp), OnePoint())
        stiffnesses.append(stabilisation(ply, random_u(ply, 1)))
    for C_s in stiffnesses:
        np.testing.assert_allclose(C_s, stiffnesses[0], rtol=1e-12)


def test_a_law_without_stiffness_at_rest_starts_from_the_fibres():
    ply = Ply(distorted(1), Fabric(1e4, Crimped(50.0)), OnePoint())
    np.testing.assert_allclose(stabilisation(ply), 1.0)
    sheared = ply.basis.zeros()
    sheared[ply.basis.nodal_dofs] = [ply.mesh.p[1], 0 * ply.mesh.p[1]]
    expected = rule(50 * (np.pi / 4) ** 2, np.pi / 4)
    np.testing.assert_allclose(stabilisation(ply, sheared), expected)


def test_a_small_stabilisation_energy_is_not_reported(caplog):
    run(bias_extension(size=(4, 8)), OnePoint(0.5), 1)
    assert "the stabilisation contributes" not in caplog.text


def test_a_warning_is_shown_once_and_logged_for_every_state(caplog):
    with caplog.at_level(logging.INFO, logger="skfem_textile"):
        result = run(bias_extension(size=(4, 8)), OnePoint(50.0), 2)
    text = "the stabilisation contributes"
    records = [r.levelno for r in caplog.records if text in r.message]
    assert len(records) == len(result.states) - 1
    assert records == [logging.WARNING] + [logging.INFO] * (len(records) - 1)
