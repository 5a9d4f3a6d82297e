"""Cases whose mesh is made from an outline file."""

import pytest

from skfem_textile import Quadratic
from skfem_textile.cases import case_from_tables
from skfem_textile.singular import SINGULAR

SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="50mm" height="100mm"
viewBox="0 0 50 100"><path id="outer" d="M 0 0 H 50 V 100 H 0 Z"/>
<circle id="hole" cx="22" cy="60" r="10"/></svg>"""


@pytest.fixture
def coupon(tmp_path):
    file = tmp_path / "coupon.svg"
    file.write_text(SVG)
    return str(file)


def case(coupon, scene=(), **mesh):
    tables = {
        "scene": {"name": "specimen", **dict(scene)},
        "mesh": {"source": coupon, **mesh},
    }
    return case_from_tables(tables)


def test_the_mesh_of_an_outline_follows_the_singular_fibres(coupon):
    built = case(coupon)
    boundaries = built.scene.mesh.boundaries
    assert {"bottom", "top", "hole", SINGULAR} <= set(boundaries)
    assert built.formulation == Quadratic()


def test_density_refines_the_mesh_of_an_outline(coupon):
    coarse, fine = (case(coupon, density=d).scene.mesh.nelements for d in (1.0, 2.0))
    assert fine > 2.5 * coarse


def test_a_stated_formulation_is_used(coupon):
    tables = {
        "scene": {"name": "specimen"},
        "mesh": {"source": coupon},
        "formulation": {"name": "macro"},
    }
    assert case_from_tables(tables).formulation != Quadratic()


@pytest.mark.parametrize(
    ("scene", "mesh", "message"),
    [
        ({"name": "strip"}, {}, "applies to the scene specimen only"),
        ({}, {"size": [3, 4]}, "mesh.size does not apply"),
        ({}, {"density": 0.0}, "density must be positive"),
        ({"move_mm": {"side": [0.0, 0.0]}}, {}, "no boundary 'side'"),
    ],
)
def test_input_that_does_not_suit_an_outline_is_refused(coupon, scene, mesh, message):
    with pytest.raises(ValueError, match=message):
        case(coupon, scene, **mesh)


def test_density_of_another_mesh_is_refused():
    tables = {"scene": {"name": "specimen"}, "mesh": {"density": 2.0}}
    with pytest.raises(ValueError, match=r"mesh\.density applies to an outline"):
        case_from_tables(tables)
