"""Validity of the exact solution of a scene, and the summary where it does not hold."""

import json

import numpy as np
import pytest
from skfem import MeshQuad, MeshTri

from skfem_textile import (
    Fabric,
    Full,
    Linear,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Sin2,
)
from skfem_textile.cli import main as cli
from skfem_textile.io import read_mesh
from skfem_textile.mesh.splitting import split
from skfem_textile.scenes import bias_extension, picture_frame, strip, trellis
from skfem_textile.scenes.bias_extension import WIDTH, lost_to_stretch
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.scenes.trellis import sheared
from tests.helpers import graded_along_fibres

pytestmark = pytest.mark.usefixtures("no_interval")

EXACT = {
    "displacement_error_rms",
    "displacement_error_max",
    "shear_angle_error_rms_deg",
}
LOAD = {"load_over_exact", "load_lost_to_fibre_stretch"}
ON_NO_SIDE = (
    "boundary edge(s) of the mesh do not lie on a side of its bounding rectangle"
)


def solve(scene, formulation=None, E=1e6, law=0.5, steps=2):
    fabric = Fabric(E, law, scene.warp, scene.weft)
    ply = Ply(scene.mesh, fabric, formulation or OnePoint(5.0))
    return scene.summary(LoadStepper(ply, scene.conditions, steps).run())


def without(mesh, bad):
    """A mesh without its elements whose centres are bad, and without names."""
    centres = mesh.p[:, mesh.t].mean(axis=1)
    rest = mesh.remove_elements(np.flatnonzero(bad(*centres)))
    return MeshQuad(rest.p, rest.t)


def with_hole(W, H, n=8):
    x, y = W / 2, H / 2
    return without(
        rectangle(W, H, (n, 2 * n), "aligned"),
        lambda X, Y: (abs(X - x) < W / 6) & (abs(Y - y) < H / 12),
    )


def with_waist(W, H):
    """Its left side bends in by a hundred-thousandth of the width."""
    mesh = rectangle(W, H, (8, 16), "aligned")
    x, y = mesh.p
    bent = x + 1e-5 * (W - x) * np.sin(np.pi * y / H)
    return MeshQuad(np.stack([bent, y]), mesh.t)


def with_crack(W, H):
    """A node doubled: the area equals the area of the rectangle."""
    mesh = rectangle(W, H, (8, 16), "aligned")
    node = int(np.linalg.norm(mesh.p - [[W / 2], [H / 2]], axis=0).argmin())
    right = mesh.p[0, mesh.t].mean(axis=0) > mesh.p[0, node]
    cells = np.where((mesh.t == node) & right, mesh.p.shape[1], mesh.t)
    return MeshQuad(np.column_stack([mesh.p, mesh.p[:, node]]), cells)


def with_half_a_clamp(W, H):
    mesh = rectangle(W, H, (8, 16), "aligned")
    return mesh.with_boundaries({"bottom": mesh.boundaries["bottom"][::2]})


MISFITS = [
    (with_hole, ON_NO_SIDE),
    (with_waist, ON_NO_SIDE),
    (with_crack, ON_NO_SIDE),
    (
        with_half_a_clamp,
        "boundary 'bottom' of the mesh does not consist of the whole bottom side",
    ),
]


@pytest.mark.parametrize(("outline", "why"), MISFITS)
def test_a_mesh_of_another_shape_has_no_exact_solution(outline, why):
    for scene, sides in ((bias_extension, (50, 100)), (strip, (40, 60))):
        for angle in (0.0, np.radians(30.0)):
            assert scene(outline(*sides)).rotated(angle).misfit.endswith(why)
    summary = solve(bias_extension(outline(50, 100), shear_angle=0.1), steps=1)
    assert not (EXACT | LOAD) & set(summary)
    assert summary["exact_answer"].startswith("none: ")
    assert summary["exact_answer"].endswith(why)
    assert summary["converged"]
    assert summary["reaction_y"] != 0


def test_half_and_split_meshes_are_checked():
    half = with_hole(25, 100)
    for scene in (
        bias_extension(half, part="half"),
        bias_extension(split(with_hole(50, 100))),
        bias_extension(split(half), part="half"),
    ):
        assert scene.misfit.endswith(ON_NO_SIDE)


def triangles_with_nodes_inside(W, H):
    """A Delaunay mesh whose nodes lie anywhere inside; its free sides are rounded."""
    from scipy.spatial import Delaunay

    sides, rng = rectangle(W, H, (6, 12), "aligned"), np.random.default_rng(1)
    inside = rng.uniform([2, 2], [W - 2, H - 2], (60, 2)).T
    p = np.column_stack([sides.p[:, sides.boundary_nodes()], inside])
    cells = np.ascontiguousarray(Delaunay(p.T).simplices.T)
    p[0] += rng.uniform(0, 2e-7 * W, p.shape[1]) * (p[1] > 0) * (p[1] < H)
    return MeshTri(p, cells)


@pytest.mark.parametrize(("law", "degrees"), [(Linear(0.5), 0.0), (Sin2(0.5), 30.0)])
def test_a_rectangle_from_a_file_has_its_exact_solution(tmp_path, law, degrees):
    triangles_with_nodes_inside(50, 100).save(tmp_path / "mesh.msh")
    scene = bias_extension(read_mesh(tmp_path / "mesh.msh"))
    summary = solve(scene.rotated(np.radians(degrees)), Macro(), law=law)
    assert set(summary) >= EXACT | LOAD
    assert "exact_answer" not in summary
    assert summary["load_over_exact"] == pytest.approx(1.0, abs=0.1)


def test_every_generated_mesh_has_an_exact_solution():
    for kind in ("aligned", "irregular", "horizontal", "vertical", "delaunay"):
        assert strip(kind).misfit == ""
        assert bias_extension(kind, part="half").misfit == ""
        assert bias_extension(split(bias_extension(kind).mesh)).misfit == ""
        steep = np.radians([54.0, 126.0])
        assert bias_extension(kind, warp=steep[0], weft=steep[1]).misfit == ""


@pytest.mark.parametrize("outline", [with_hole, with_waist])
def test_a_frame_that_holds_every_edge_is_exact_on_any_outline(outline):
    """A uniform shear is in equilibrium if the whole boundary is prescribed."""
    for scene in (
        picture_frame(outline(100, 100)),
        trellis(outline(100, 100), turns=sheared(0.5)),
    ):
        summary = solve(scene.rotated(0.3), OnePoint(1.0), E=1e4)
        assert summary["displacement_error_max"] < 1e-9
        assert summary["shear_angle_error_rms_deg"] < 1e-7
        assert "exact_answer" not in summary


def test_a_bent_trellis_with_a_hole_converges_to_its_motion():
    errors = []
    for n in (6, 12):
        scene = trellis(with_hole(100, 100, n))
        summary = solve(scene, Full(), E=1e4, law=0.0)
        errors.append(summary["displacement_error_rms"])
    assert errors[0] > 3.5 * errors[1]


def test_a_report_states_once_why_there_is_no_exact_solution(tmp_path):
    with_hole(50, 100, 6).save(tmp_path / "mesh.vtk")
    command = ["run", "bias_extension", "--mesh", str(tmp_path / "mesh.vtk")]
    command += ["--steps", "1", "--shear-angle", "10", "--no-render"]
    assert cli.main([*command, "--out", str(tmp_path / "out")]) == 0
    assert cli.main(["report", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    checks, _, _ = page.partition("All values")
    assert checks.count(ON_NO_SIDE) == 1
    assert ON_NO_SIDE in summary["exact_answer"]
    assert not (EXACT | LOAD) & set(summary)


# θ and γ in degrees, E over the shear stiffness of 0.5 N/mm.
STRETCHED = [
    (45.0, 40.0, Linear(0.5), (2e4, 2e4)),
    (45.0, 40.0, Linear(0.5), (2e4, 2e5)),
    (45.0, 20.0, Linear(0.5), (2e5, 2e5)),
    (45.0, 40.0, Sin2(0.5), (2e3, 2e3)),
    (45.0, 40.0, Sin2(0.5), (2e5, 2e5)),
    (30.0, 40.0, Linear(0.5), (2e5, 2e5)),
    (35.0, 60.0, Linear(0.5), (2e5, 2e5)),
    (52.5, 40.0, Linear(0.5), (2e4, 2e4)),
    (60.0, 20.0, Linear(0.5), (2e4, 2e4)),
]
#: Whose meshes are the coarsest, and differ in every quantity.
FEW = 0, 3, 5


@pytest.mark.parametrize(
    ("degrees", "shear", "law", "ratios"),
    [
        pytest.param(*case, marks=[pytest.mark.slow] * (i not in FEW))
        for i, case in enumerate(STRETCHED)
    ],
)
def test_the_load_lost_to_stretch_is_accurate_to_a_third(degrees, shear, law, ratios):
    """Against meshes along the fibres, which do not lock, finest at their kinks."""
    theta, E = np.radians(degrees), tuple(0.5 * ratio for ratio in ratios)
    mesh = graded_along_fibres(WIDTH, theta, 5, 0.4 / np.sqrt(min(E)))
    angles = {"warp": theta, "weft": np.pi - theta, "shear_angle": np.radians(shear)}
    summary = solve(bias_extension(mesh, **angles), Quadratic(), E, law, steps=4)
    lost = 1 - summary["load_over_exact"]
    estimate = summary["load_lost_to_fibre_stretch"]
    assert estimate == pytest.approx(lost, rel=1 / 3)
    assert ("exact_answer" in summary) == (estimate > 0.01)


def test_half_and_rotated_plies_lose_the_same_share():
    shares = [
        solve(scene)["load_lost_to_fibre_stretch"]
        for scene in (
            bias_extension(size=(4, 8)),
            bias_extension(size=(2, 8), part="half"),
            bias_extension(size=(4, 8)).rotated(0.7),
        )
    ]
    assert shares[0] == shares[1] == shares[2] > 0


def test_the_summary_contains_the_limit_of_the_ratio():
    reason = solve(bias_extension(size=(4, 8)), E=1e4)["exact_answer"]
    assert reason == (
        "valid for inextensible fibres: fibre stretch reduces the load by about 4 %, "
        "so that load_over_exact converges to about 0.96, not to 1"
    )


def test_fibres_without_stiffness_lose_all_of_the_load():
    angle = np.radians(40.0)
    assert lost_to_stretch(Fabric(0.0, 0.5), angle, 50.0, 100.0) == 1.0
    assert lost_to_stretch(Fabric((0.0, 1e4), 0.5), angle, 50.0, 100.0) == 1.0
    assert lost_to_stretch(Fabric(1e12, 0.5), angle, 50.0, 100.0) < 1e-5
