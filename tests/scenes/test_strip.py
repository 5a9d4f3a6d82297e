import numpy as np
import pytest

from skfem_textile import Fabric, Full, LoadStepper, OnePoint, Ply
from skfem_textile.mesh.scikit_fem import with_names
from skfem_textile.scenes import strip
from skfem_textile.scenes.rectangle import rectangle

pytestmark = pytest.mark.usefixtures("no_interval")

# Reached with 100 equal steps by another implementation; E = 1e4 N/mm, 10×15
# elements, jitter 0.3, seed 1.
CASES = {
    "full": (Full(), 0.0),
    "full, G = 0.5": (Full(), 0.5),
    "one point, C_s = 10": (OnePoint(10.0), 0.0),
    "one point, C_s = 1": (OnePoint(1.0), 0.0),
    "one point, C_s = 5, G = 0.5": (OnePoint(5.0), 0.5),
}
# Of each of them.
REFERENCE = {
    "energy": (309.7692, 544.5272, 7.718556, 1.265074, 232.3383),
    "reaction_x": (-148.3962, -147.1534, -3.497139, 3.065955, -10.09401),
    "max_fibre_strain": (0.0221994, 0.02212622, 0.001555848, 0.0005726203, 0.00189342),
    "mesh_fibre_strain": (0.0221994, 0.02212622, 0.07058819, 0.08420948, 0.1249006),
    "displacement_error_rms": (0.06033311, 0.0683589, 0.1566349, 0.2062505, 0.3177282),
    "displacement_error_max": (0.1979174, 0.292663, 0.6677883, 0.9549539, 1.019766),
    "shear_angle_error_rms_deg": (1.162084, 1.26078, 3.383372, 4.374981, 6.659398),
    "min_det_F_2x2": (0.4960615, 0.5076109, 0.270201, 0.1920662, 0.2870012),
}


def run(scene, formulation, shear=0.0, steps=5, E=1e4):
    ply = Ply(scene.mesh, Fabric(E, shear, scene.warp, scene.weft), formulation)
    return LoadStepper(ply, scene.conditions, steps).run()


@pytest.mark.parametrize("case", CASES)
def test_the_reference_is_reached(case):
    formulation, shear = CASES[case]
    scene = strip("irregular", (10, 15), 0.3, 1)
    result = run(scene, formulation, shear)
    summary = scene.summary(result)
    assert summary["converged"]
    ply = result.ply
    summary["min_det_F_2x2"] = ply.area_ratio(result.u, ply.fine_points).min()
    for key, values in REFERENCE.items():
        expected = values[[*CASES].index(case)]
        assert summary[key] == pytest.approx(expected, rel=1e-4), key


@pytest.mark.parametrize("kind", ["aligned", "horizontal"])
def test_meshes_along_the_warp_do_not_lock(kind):
    scene = strip(kind)
    summary = scene.summary(run(scene, Full()))
    assert summary["max_fibre_strain"] < 1e-9
    assert abs(summary["reaction_x"]) < 1e-5


def test_one_point_and_stabilisation_unlock():
    """Strain and load decrease in the order of the paper's figures."""
    scene = strip()
    ends = [
        scene.summary(run(scene, f, steps=2))
        for f in (Full(), OnePoint(10.0), OnePoint(1.0))
    ]
    for key in ("max_fibre_strain", "reaction_x", "energy"):
        sizes = [abs(summary[key]) for summary in ends]
        assert sizes == sorted(sizes, reverse=True), key
    locked, _, unlocked = ends
    assert unlocked["max_fibre_strain"] < locked["max_fibre_strain"] / 20
    assert unlocked["energy"] < locked["energy"] / 100


def test_meshes_along_the_weft_lock():
    scene = strip("vertical")
    assert scene.summary(run(scene, Full()))["max_fibre_strain"] > 1e-3


@pytest.mark.parametrize(
    ("formulation", "angle"), [(Full(), 0.3), (OnePoint(10.0), -2.5)]
)
def test_a_rotated_problem_has_the_same_answer(formulation, angle):
    scene = strip(size=(5, 8))
    turned = scene.rotated(angle)
    plain, rotated = (run(s, formulation, 0.1) for s in (scene, turned))
    a, b = scene.summary(plain), turned.summary(rotated)
    assert b["energy"] == pytest.approx(a["energy"], rel=1e-10)
    for key in ("reaction_x", "reaction_y", "displacement_error_rms"):
        assert b[key] == pytest.approx(a[key], rel=1e-6), key
    np.testing.assert_allclose(
        turned.driven_displacement(rotated.states[-1]),
        scene.driven_displacement(plain.states[-1]),
        rtol=1e-6,
    )
    c, s = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(
        rotated.states[-1].reactions["right"],
        np.array([[c, -s], [s, c]]) @ plain.states[-1].reactions["right"],
        rtol=1e-6,
    )


def test_the_exact_motion_stretches_no_fibre():
    scene = strip("aligned", (40, 60))
    ply = Ply(scene.mesh, Fabric(1e4), Full())
    for t in (1e-3, 0.5, 1.0):
        u = scene.displacement(scene.mesh.p, t).T.ravel()
        centre = np.array([[0.5], [0.5]])
        assert np.abs(ply.fibre_strain(u, centre)).max() < 1e-4
        X = scene.mesh.p[:, scene.mesh.t].mean(axis=1)
        error = ply.shear_angle(u, centre)[:, 0] - scene.shear_angle(X, t)
        assert np.abs(error).max() < 1e-4


def test_long_meshes_are_constrained_at_their_edges_only():
    mesh = rectangle(500, 10, (20, 20), "aligned")
    assert len(mesh.boundaries["bottom"]) == 20
    mesh = rectangle(40, 60, (100, 2), "aligned")
    assert len(mesh.boundaries["right"]) == 2


def test_a_mesh_keeps_its_names_or_is_named_by_its_edges():
    mesh = strip("irregular").mesh
    unnamed = with_names(mesh, None, None)
    scene = strip(unnamed)
    np.testing.assert_array_equal(
        np.sort(scene.mesh.boundaries["right"]), np.sort(mesh.boundaries["right"])
    )
    half = mesh.boundaries["right"][:5]
    named = with_names(mesh, {"right": half}, None)
    np.testing.assert_array_equal(strip(named).mesh.boundaries["right"], half)
