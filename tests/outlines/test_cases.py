"""Cases on graded meshes: of the scene, and of the drawing of an outline."""

import numpy as np
import pytest

from skfem_textile import Quadratic
from skfem_textile.cases import case_from_tables
from skfem_textile.outlines import SINGULAR
from skfem_textile.ply.formulations import DEFAULT

SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="50mm" height="100mm"
viewBox="0 0 50 100"><path id="outer" d="M 0 0 H 50 V 100 H 0 Z"/>
<circle id="hole" cx="22" cy="60" r="10"/></svg>"""


@pytest.fixture
def coupon(tmp_path):
    file = tmp_path / "coupon.svg"
    file.write_text(SVG)
    return str(file)


def case(scene="specimen", mesh=(), **tables):
    scene = {"name": scene} if isinstance(scene, str) else scene
    return case_from_tables({"scene": scene, "mesh": dict(mesh), **tables})


@pytest.mark.parametrize("scene", ["picture_frame", "strip", "trellis"])
def test_a_graded_mesh_without_singular_fibres_follows_the_fibres(scene):
    built = case(scene, {"source": "graded"})
    mesh = built.scene.mesh
    edges = np.diff(mesh.p[:, mesh.facets], axis=1)[:, 0]
    along = (np.abs(edges) < 1e-9).any(axis=0)
    assert along.sum() > 0.6 * len(along)  # others are diagonals
    assert SINGULAR not in mesh.boundaries


@pytest.mark.parametrize("key", [{"size": [3, 4]}, {"jitter": 0.1}, {"seed": 2}])
def test_a_key_of_a_grid_gives_a_grid(key):
    built = case("bias_extension", {**key, "as_is": True})
    assert SINGULAR not in built.scene.mesh.boundaries
    assert built.formulation == DEFAULT
    assert not built.changes


@pytest.mark.parametrize(
    ("scene", "mesh", "changes"),
    [
        ("bias_extension", {}, False),
        ("specimen", {}, False),
        ("bias_extension", {"source": "irregular", "size": [6, 18]}, True),
        ("bias_extension", {"source": "delaunay", "size": [6, 18]}, True),
    ],
)
def test_a_mesh_follows_the_singular_fibres_or_is_fitted_to_them(scene, mesh, changes):
    built = case(scene, mesh)
    assert SINGULAR in built.scene.mesh.boundaries
    assert built.formulation == Quadratic(400.0, 6)
    assert ("nodes moved and" in (built.changes or "")) == changes


def test_quadratic_elements_are_chosen_where_no_fibre_is_singular():
    built = case("strip")
    assert built.scene.mesh.nelements == 150
    assert built.formulation == Quadratic(80.0)
    assert not built.changes


def test_a_mesh_that_cannot_be_fitted_stays_with_the_reason():
    """Without shear stiffness nothing resists a jump of the shear angle."""
    shear = {"stiffness_N_per_mm": 0.0}
    built = case("bias_extension", {"size": [6, 18]}, shear=shear)
    assert SINGULAR not in built.scene.mesh.boundaries
    assert built.formulation == DEFAULT
    assert built.changes.startswith("the mesh is left as it is: without shear stiff")


def test_the_mesh_of_a_drawing_follows_the_singular_fibres(coupon):
    built = case(mesh={"outline": coupon})
    boundaries = built.scene.mesh.boundaries
    assert {"bottom", "top", "hole", SINGULAR} <= set(boundaries)
    assert built.formulation == Quadratic(400.0, 6)


def test_density_refines_a_graded_mesh(coupon):
    for outline in {}, {"outline": coupon}:
        coarse, fine = (
            case(mesh={"density": d, **outline}).scene.mesh.nelements
            for d in (1.0, 2.0)
        )
        assert fine > 2.5 * coarse


def test_the_mesh_is_graded_for_the_fabric_of_the_case():
    stiff, soft = (
        case(tension={"stiffness_N_per_mm": E}).scene.mesh for E in (1e6, 1e3)
    )
    assert stiff.nelements > 1.2 * soft.nelements


def test_ends_of_a_loaded_edge_start_singular_fibres(coupon):
    held = {"name": "specimen", "move_mm": {"bottom": [0.0, 0.0]}}
    free, loaded = (
        case(held, {"outline": coupon}, loads={"force_N": forces}).scene.mesh
        for forces in ({}, {"top": [5.0, 0.0]})
    )
    assert len(free.boundaries[SINGULAR]) < len(loaded.boundaries[SINGULAR])


def test_a_stated_formulation_is_used(coupon):
    built = case(mesh={"outline": coupon}, formulation={"name": "macro"})
    assert built.formulation == DEFAULT


def test_unit_and_layers_of_a_drawing_can_be_given(coupon):
    mesh = case(mesh={"outline": coupon, "layer": ["outer"], "unit": "cm"}).scene.mesh
    assert np.ptp(mesh.p, axis=1) == pytest.approx([500, 1000])
    assert "hole" not in mesh.boundaries


def test_a_rotated_scene_has_the_rotated_mesh():
    plain, rotated = (
        case({"name": "bias_extension", "rotate_deg": degrees}).scene.mesh
        for degrees in (0.0, 90.0)
    )
    assert np.allclose(rotated.p[0], -plain.p[1])
    assert np.array_equal(rotated.t, plain.t)


def test_the_log_names_ply_and_holes_once(coupon, caplog):
    case(mesh={"outline": coupon})
    assert caplog.text.count("the ply is 50 x 100 mm (path 'outer')") == 1


def test_holes_are_numbered_as_drawn(tmp_path):
    file = tmp_path / "two.svg"
    file.write_text(SVG.replace("</svg>", '<circle cx="25" cy="25" r="12"/></svg>'))
    mesh = case(mesh={"outline": str(file)}).scene.mesh
    edges = (mesh.boundaries[f"hole {i}"] for i in (1, 2))
    small, large = (np.ptp(mesh.p[0, mesh.facets[:, e]]) for e in edges)
    assert small == pytest.approx(20, abs=0.1)
    assert large == pytest.approx(24, abs=0.1)
