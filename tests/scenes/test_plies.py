"""Lay-ups of the scenes of forming."""

from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import Fabric
from skfem_textile.contact import Tool
from skfem_textile.contact.stack import Stack
from skfem_textile.scenes import (
    Case,
    double_dome_forming,
    hemisphere_forming,
)
from skfem_textile.scenes.forming import GAP, formed_ply
from skfem_textile.surfaces.analytic import Sphere
from tests.helpers import refused


def formed(**options):
    return hemisphere_forming("aligned", size=(2, 2), **options)


def stack_of(scene, **laws):
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, **laws)
    return Case(scene=scene, fabric=fabric).ply()


def test_a_scene_without_a_lay_up_has_one_ply():
    scene = formed()
    assert scene.plies is None
    assert not isinstance(stack_of(scene), Stack)


def test_a_stack_has_the_turned_fabric_in_each_ply():
    scene = formed(layup="[0/90, ±45]s", fibres=np.pi / 2)
    stack = stack_of(scene)
    assert isinstance(stack, Stack)
    warp = np.degrees([np.arctan2(*x.fabric.warp[::-1]) for x in stack.plies])
    assert warp == pytest.approx([90, 135, 135, 90])
    assert {ply.fibre_ends["left"] for ply in stack.plies} == {"mirror"}
    assert all(not ply.user_terms for ply in stack.plies)
    names = {tool.name for tool in stack.user_terms if hasattr(tool, "name")}
    assert names == {"punch", "die", "holder"}


def test_a_list_of_angles_in_degrees_is_a_lay_up_too():
    listed, text = formed(layup=[0, 45]).plies, formed(layup="[0/90, ±45]").plies
    assert listed.angles_deg == text.angles_deg == (0, 45)
    refused(lambda: formed(layup=[]), "layup must be a text such as")
    refused(lambda: formed(layup=[np.nan]), "layup must be a text such as")


@pytest.mark.parametrize("build", [hemisphere_forming, double_dome_forming])
def test_the_default_gap_of_the_holder_has_room_for_the_plies(build):
    gaps = {
        thickness: build(layup="[0, 45, 0]", ply_thickness=thickness).tools[2].gap
        for thickness in (0.0, 0.25, (0.1, 0.2, 0.3))
    }
    expected = {0.0: GAP, 0.25: GAP + 0.75, (0.1, 0.2, 0.3): GAP + 0.6}
    assert gaps == pytest.approx(expected)
    given = build(layup="[0, 45]", ply_thickness=0.25, gap=0.4)
    assert given.tools[2].gap == 0.4


def test_a_quarter_requires_the_symmetry_of_every_ply():
    assert formed(layup="[0, 45]").fibre_ends
    assert not formed(layup="[0, 30]").fibre_ends
    text = "fibres at 30 degrees have no planes of symmetry"
    refused(lambda: formed(layup="[0, 30]", part="quarter"), text)


def test_each_ply_is_held_at_its_centre():
    """A condition holds the nodes of all plies at a point, whatever their numbers."""
    scene = formed(layup="[0, 30]", tension=0.0)
    X = np.hstack([scene.mesh.p[:, ::-1], scene.mesh.p])
    for name in "centre", "turn":
        held = scene.conditions[name].where(X)
        assert held.sum() == 2
        assert np.ptp(X[:, held], axis=1).tolist() == [0, 0]
        assert X[1, held][0] == pytest.approx(0)


def test_plies_between_tools_of_the_user_have_a_lay_up():
    punch = Tool(Sphere(20.0, (0, 0, -20.2)), motion=(0, 0, 1.0), name="punch")
    scene = formed_ply("own", [punch], "aligned", size=(2, 2), layup="[0]2")
    assert scene.plies.angles_deg == (0, 0)


def test_a_ply_may_have_its_own_fabric():
    scene = formed(layup=[0, 90])
    plies = replace(scene.plies, fabrics=(None, Fabric(7.0, 1.0)))
    low, high = (ply.fabric for ply in stack_of(replace(scene, plies=plies)).plies)
    assert (low.tension, high.tension) == (1e4, 7.0)
    assert high.warp.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"layup": None, "ply_friction": 0.1}, "ply_friction requires layup"),
        ({"layup": None, "ply_thickness": 0.1}, "ply_thickness requires layup"),
        ({"layup": "[0/80, 0]"}, "has a ply '0/80' with 80° from warp to weft"),
        ({"ply_friction": -0.1}, "ply_friction must be between 0 and 2, got -0.1"),
        ({"ply_friction": 20}, "ply_friction must be between 0 and 2, got 20"),
        ({"ply_friction": [0.1, 0.1]}, "or 2 rows of 2 coefficients"),
        ({"ply_friction": [[0, 0.1]]}, "or 2 rows of 2 coefficients"),
        ({"ply_friction": [[0, 0.1], [0.1]]}, "or 2 rows of 2 coefficients"),
        ({"ply_friction": [[0, np.nan], [0, 0]]}, "must be between 0 and 2"),
        (
            {"ply_friction": [[0, 0.1], [0.2, 0]]},
            "is 0.1 in row 1 and column 2, and 0.2 in row 2 and column 1",
        ),
        ({"ply_friction": "rough"}, "ply_friction"),
        ({"ply_thickness": -0.1}, "ply_thickness must be a length of at least 0 mm"),
        ({"ply_thickness": np.inf}, "ply_thickness must be a length of at least 0 mm"),
        ({"ply_thickness": [0.1]}, "or one for each of 2 plies"),
        ({"ply_thickness": "thick"}, "ply_thickness"),
    ],
)
def test_invalid_parameters_of_plies_are_refused_by_name(options, text):
    def build():
        formed(**{"layup": "[0, 45]", **options})

    refused(build, f"hemisphere_forming: .*{text}")


def test_tables_of_friction_and_functions_reach_the_stack():
    table = [[0.3, 0.1], [0.1, 0]]
    assert formed(layup="[0]2", ply_friction=table).plies.friction == table
    assert formed(layup="[0]2", ply_friction=abs).plies.friction is abs
