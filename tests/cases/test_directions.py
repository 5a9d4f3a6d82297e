"""Fibre directions of cases: of regions, and of fabrics that a run ignores."""

import numpy as np
import pytest

from skfem_textile import CrimpToe, Fabric, Linear, Sin2
from skfem_textile.cases import case_from_tables
from skfem_textile.cases.build import _has_other_directions
from skfem_textile.cases.fabrics import fabric_tables
from skfem_textile.fabric import TwoLaws
from skfem_textile.scenes import trellis
from skfem_textile.scenes.rectangle import rectangle

X, Y, TURNED = (1.0, 0.0), (0.0, 1.0), (1.0, 0.1)


@pytest.mark.parametrize(
    ("own", "used", "differ"),
    [
        ((X, Y), (X, Y), False),
        ((X, Y), ((-3.0, 0.0), (0.0, -2.0)), False),  # length and sense do not matter
        ((X, Y), (X, (3e-5, 1.0)), True),
        ((X, Y), (TURNED, Y), True),
        (((1.0, 3e-6), Y), (X, Y), False),
        ((X, Y), (Y, X), True),
        ((X, np.outer(Y, np.ones(3))), (X, Y), True),  # of another number of elements
    ],
)
def test_a_fabric_has_other_directions_if_one_of_its_families_is_turned(
    own, used, differ
):
    scene, fabrics = trellis(size=(2, 2)), [Fabric(1.0, 0.1, *x) for x in (own, used)]
    assert _has_other_directions(fabrics[0], scene, fabrics[1]) == differ


def test_directions_of_a_fabric_rotate_with_the_scene():
    scene = case_from_tables({"scene": {"name": "trellis", "rotate_deg": 30.0}}).scene
    own, turned = Fabric(1.0, 0.1, X, Y), scene.turn
    used = Fabric(1.0, 0.1, tuple(turned @ X), tuple(turned @ Y))
    assert not _has_other_directions(own, scene, used)
    assert _has_other_directions(own, scene, own)


@pytest.mark.parametrize("given", [{}, {"warp_deg": 30.0}, {"weft_deg": 60.0}])
def test_a_region_without_an_angle_has_that_of_the_scene(given, tmp_path):
    mesh = rectangle(50, 100, (2, 4), "aligned")
    named = mesh.with_subdomains({"a": lambda x: x[1] > 60})
    named.save(tmp_path / "a.vtk", encode_cell_data=True, encode_point_data=False)
    angles = {"warp_deg": 10.0, "weft_deg": 100.0, **given}
    file = {
        "scene": {"name": "trellis", "warp_deg": 10.0, "weft_deg": 100.0},
        "mesh": {"source": str(tmp_path / "a.vtk")},
        "regions": {"a": given | {"bending": {"warp_N_mm": 1.0, "weft_N_mm": 1.0}}},
    }
    case = case_from_tables(file)
    element = case.scene.mesh.subdomains["a"][:1, None]
    found = case.fabric.directions(np.array([[[25.0]], [[90.0]]]), element)
    directions = [np.degrees(np.arctan2(*np.ravel(A)[1::-1])) for A in found]
    assert directions == pytest.approx(list(angles.values()))


def test_laws_of_a_fabric_become_tables_or_the_name_of_its_file():
    tables = {"tension", "shear", "bending"}
    even = fabric_tables(Fabric(2.0, Sin2(0.5), bending=(3.0, 4.0)), tables, "F.toml")
    assert "weft" not in even["tension"]
    assert even["shear"]["stiffness_N_per_mm"] == 0.5
    assert (even["bending"]["warp_N_mm"], even["bending"]["weft_N_mm"]) == (3.0, 4.0)
    two = Fabric(TwoLaws(Linear(2.0), CrimpToe(5.0, 0.1, 1.0)), 0.5)
    found = fabric_tables(two, {"tension"}, "F.toml")["tension"]
    assert found["stiffness_N_per_mm"] == 2.0
    assert found["weft"]["stiffness_N_per_mm"] == 5.0
    assert fabric_tables(two, {"shear"}, "F.toml").keys() == {"shear"}
