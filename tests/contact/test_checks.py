"""Checks of tools before a run: room between them, sides, contact."""

import re
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from skfem import MeshQuad

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Full,
    Holder,
    LoadStepper,
    Ply,
    Tool,
    contact,
    drape,
)
from skfem_textile.contact.checks import check_tools
from skfem_textile.contact.obstacle import refuse_extent
from skfem_textile.contact.outline import is_flat
from skfem_textile.contact.tool import amount_of
from skfem_textile.scenes import (
    Case,
    double_dome_forming,
    hemisphere_forming,
)
from tests.helpers import graph
from tests.helpers.forming import MIRRORS

SIDE = np.linspace(-60.0, 60.0, 9)
MESH = MeshQuad.init_tensor(SIDE, SIDE).with_defaults()
QUARTER = MeshQuad.init_tensor(SIDE[4:], SIDE[4:]).with_defaults()
UP = (0, 0, 8.0)
SHEET = np.array([[-90.0, 90.0, 90.0, -90.0], [-90.0, -90.0, 90.0, 90.0]])


def ply(*terms, mesh=MESH, **options):
    return Ply(mesh, Fabric(1e4), Full(), terms=terms, dimension=3, **options)


quarter = partial(ply, mesh=QUARTER, fibre_ends=MIRRORS)


def punch(travel, radius=30.0, **options):
    sphere = drape.Sphere(radius, (0, 0, -radius - 0.2))
    return Tool(sphere, motion=(0, 0, travel), name="punch", **options)


def lid(height):
    return Tool(drape.Plane((0, 0, height)), name="lid")


@pytest.mark.parametrize(
    "scene",
    [
        hemisphere_forming(radius=40.0, travel=90.0),  # deeper than the sphere
        hemisphere_forming(gap=0.0),
        double_dome_forming(gap=0.05),
    ],
)
def test_tools_of_scenes_have_room_for_the_ply(scene):
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft)
    check_tools(Case(scene=scene, fabric=fabric).ply())
    check_tools(ply())


@pytest.mark.parametrize("travel", [20.0, 60.0])
def test_no_room_at_the_end_is_refused_with_the_depth(travel):
    """A sphere and a plane overlap by the travel beyond the plane."""
    node = r"'punch' pushes node \d+, at \(0, 0, 0\) mm in the undeformed ply, "
    message = f"^tools 'punch' and 'lid' leave no room .* at load factor .*: {node}"
    with pytest.raises(ValueError, match=message) as error:
        check_tools(ply(punch(travel), lid(10.0)))
    t = float(str(error.value).partition("load factor ")[2].partition(":")[0])
    depth = t * travel - 0.2 - 10.0
    assert f"{depth:.3g} mm into 'lid'" in str(error.value)
    assert "\n" not in str(error.value)


def test_tools_that_just_fit_are_accepted():
    check_tools(ply(punch(10.2), lid(10.0)))
    dome = drape.double_dome(20.0, 40.0, 30.0)
    cavity = drape.HeightField(
        lambda x, y: dome.height(x, y)._replace(h=dome.height(x, y).h + 20.0)
    )
    tools = (
        Tool(dome, motion=(0, 0, 20.0), name="punch"),
        Tool(cavity, side=-1, name="die"),
    )
    check_tools(ply(*tools))
    further = Tool(dome, motion=(0, 0, 22.0), name="punch")
    with pytest.raises(ValueError, match="'punch' and 'die' leave no room"):
        check_tools(ply(further, tools[1]))


def test_no_room_at_the_beginning_is_refused():
    holder = Holder(drape.Plane((0, 0, 0.2)), gap=0.1, side=-1)
    low = Tool(drape.Plane((0, 0, 0.05)), side=-1, name="low")
    with pytest.raises(ValueError, match=r"'holder' and 'low' .* at load factor 0: "):
        check_tools(ply(low, holder))


def test_a_punch_larger_than_the_hole_of_its_die_is_refused():
    """Beside the punch, below the die, there is room; the tools cross nevertheless.

    A sphere of radius 30 in a hole of radius 20: it stops where both are 20 wide.
    """
    die = Tool(drape.Die(20.0, 2.0, (0, 0, 0.2)), name="die")
    holder = Holder(drape.Plane((0, 0, 0.2)), gap=0.4, side=-1, name="holder")
    message = "tools 'punch' and 'die' leave no room .* pushes node .* mm into 'die'"
    with pytest.raises(ValueError, match=message) as error:
        check_tools(ply(punch(30.0), die, holder))
    assert "\n" not in str(error.value)
    check_tools(ply(punch(30 - 500**0.5), die, holder))


def test_walls_and_bottom_of_a_box_may_overlap():
    """The walls push nodes at the edges into the bottom, which pushes them up."""
    walls = [
        Tool(drape.Plane((x, 0, 0), (-x, 0, 0)), side=1, name=f"wall at {x}")
        for x in (-58, 58)
    ]
    bottom = Tool(drape.Plane((0, 0, -5)), motion=(0, 0, 10), name="bottom")
    check_tools(ply(bottom, *walls))


def test_tools_beside_the_ply_are_refused():
    corner = np.array([[54.0, 55.0, 55.0], [54.0, 54.0, 55.0]])
    message = "all its nodes are beyond the edges or outlines of the tools"
    with pytest.raises(ValueError, match=message):
        check_tools(ply(punch(10.0, outline=corner, side=1)))
    x, t = graph(np.linspace(100.0, 160.0, 9), lambda x, y: 0 * x - 1)
    tool = Tool(drape.TriangleMesh(x, t), UP, side=1)
    with pytest.raises(ValueError, match=message):
        check_tools(quarter(tool))


def test_tools_are_checked_at_41_load_factors():
    """Pushed by a quarter of the travel at a time, which is a part of them."""
    factors, amounts = [], []
    plane = drape.Plane((0, 0, 90))

    def motion(t):
        factors.append(t)
        return 0.0, 0.0, t

    with pytest.raises(ValueError, match="nearest is 'far', 90 mm away"):
        check_tools(ply(Tool(plane, motion=motion, side=-1, name="far")))
    holder = Holder(plane, gap=lambda t: amounts.append(t) or 1.0)
    amount_of(holder, "gap", "holder")
    assert np.unique(factors) == pytest.approx(np.linspace(0, 1, 41))
    assert amounts == pytest.approx(np.linspace(0, 1, 41))


@pytest.mark.parametrize(
    ("size", "text"), [(50, ""), (200, "over 100 times the size of the ply, 120 mm")]
)
def test_triangles_of_another_unit_than_the_ply_are_refused(size, text):
    facets = SimpleNamespace(points=np.diag([120.0 * size, 1, 1]))
    with pytest.raises(ValueError, match=text) if text else nullcontext():
        refuse_extent("tool", SimpleNamespace(facets=facets), MESH)


@pytest.mark.parametrize(("height", "flat"), [(3e-10, True), (3e-9, False)])
def test_an_outline_without_area_is_flat(height, flat):
    assert is_flat(np.array([[0, 1, 1, 0], [0, 0, height, height]])) == flat


def test_a_ply_that_a_load_or_support_moves_may_touch_later():
    check_tools(ply(punch(-10.0), BodyForce((0, 0, -1e-6))))
    edges = {"left": Condition("left", (0.0, 0.0, -20.0))}
    LoadStepper(ply(punch(-10.0)), edges)
    still = {"left": Condition("left", (0.0, 0.0, 0.0))}
    with pytest.raises(ValueError, match="nothing touches the ply"):
        LoadStepper(ply(punch(-10.0)), still)


def test_a_tool_in_the_middle_of_its_motion_is_found():
    """It touches the ply from 0.45 to 0.55 of the load only."""

    def motion(t):
        return 0.0, 0.0, 2.0 - 40 * abs(t - 0.5)

    check_tools(ply(Tool(punch(0.0).surface, motion, name="punch")))


@pytest.mark.parametrize(
    ("tool", "boundary"),
    [
        (Tool(drape.Sphere(30.0, (0.5, 0, -30.2)), UP), "left"),
        (Tool(drape.Plane((0, 0, -1), (0, 0.01, 1)), UP, side=1), "bottom"),
        (Tool(drape.Sphere(30.0, (0, 0, -30.2)), (2.0, 0, 8.0)), "left"),
        (
            Holder(drape.Sphere(300.0, (9, 0, -301)), pressure=0.1, outline=SHEET),
            "left",
        ),
    ],
)
def test_a_tool_without_the_symmetry_of_a_quarter_is_refused(tool, boundary):
    """Of any surface, motion or holder; the whole ply is accepted."""
    tools = replace(tool, name="one"), punch(2.0)
    message = f"'one' is not symmetric about the boundary '{boundary}' of the ply: it "
    with pytest.raises(ValueError, match=message) as error:
        check_tools(quarter(*tools))
    assert "\n" not in str(error.value)
    check_tools(ply(*tools))


@pytest.mark.parametrize(
    ("motion", "boundary"),
    [
        (lambda t: (turned(0.3 * t, 2), np.zeros(3)), "left"),
        (lambda t: (turned(0.3 * t * (1 - t), 0), np.zeros(3)), "bottom"),
        (lambda t: (turned(4 * np.pi * t, 2), np.zeros(3)), "left"),
        (lambda t: np.array([np.sin(8 * np.pi * t), 0.0, 0.0]), "left"),
        ((0.0, 1.0, 0.0), "bottom"),
    ],
)
def test_friction_of_a_tool_that_slides_or_turns_breaks_the_symmetry(motion, boundary):
    """Also if the shape is symmetric; without friction there is no traction."""
    plane = Tool(drape.Plane((0, 0, 1)), motion, side=-1, friction=0.3, name="one")
    message = f"'one' has friction, and its motion is not symmetric about .*{boundary}"
    with pytest.raises(ValueError, match=message) as error:
        check_tools(quarter(plane, punch(0.5)))
    assert "\n" not in str(error.value)
    check_tools(quarter(replace(plane, motion=UP), punch(0.5)))


def turned(angle, axis):
    """Rotation matrix about an axis of the coordinates."""
    return Rotation.from_rotvec(angle * np.eye(3)[axis]).as_matrix()


def test_a_part_that_deviates_only_where_the_ply_is_pushed_is_refused():
    """The roof of a cavity, 20 mm above a ply that a punch pushes there."""

    def height(x, y):
        h, dome = 20.0 + 0.01 * x, np.zeros_like(x)
        return drape.Height(h, dome + 0.01, dome, dome, dome, dome)

    roof = Tool(drape.HeightField(height), name="roof")
    with pytest.raises(ValueError, match="'roof' is not symmetric about the boundary"):
        check_tools(quarter(punch(19.0), roof))


def test_a_surface_that_is_defined_for_a_quarter_only_is_accepted():
    def height(x, y):
        h = -0.2 - (x**2 + y**2) / 200 + np.where(x < -1e-9, np.nan, 0.0)
        dome = np.zeros_like(x)
        return drape.Height(h, -x / 100, -y / 100, dome - 0.01, dome, dome - 0.01)

    check_tools(quarter(Tool(drape.HeightField(height), UP, side=1)))


def test_a_punch_that_misses_is_named(caplog):
    """Before a run only where nothing moves the ply, which may reach any tool."""
    with pytest.raises(ValueError, match=r"'lid', 0\.1 mm .*, and 'punch', which "):
        check_tools(ply(punch(-10.0), lid(0.1)))
    slid = replace(lid(0.3), motion=(3, 0, 0), friction=0.3)
    pressed = Holder(drape.Plane((0, 0, 0.3)), pressure=1.0, side=-1)
    check_tools(ply(slid, pressed))
    check_tools(ply(punch(0.5), replace(lid(0.1), motion=(0, 0, 5))))
    assert not caplog.text


def test_a_holder_whose_force_grows_from_zero_moves_the_ply():
    """In the middle of the run: it is zero at the begin and at the end."""
    law = contact.Compaction(0.4, 1e-3, 7.0)
    press = {"force": lambda t: 40 * t * (1 - t), "compaction": law}
    check_tools(ply(lid(0.2), Holder(drape.Plane((0, 0, 0.2)), side=-1, **press)))


def test_travels_in_another_unit_are_refused_and_long_ones_a_warning(caplog):
    text = "'punch' moves by 8000 mm, over 10 times the size of the ply, 120 mm: check"
    with pytest.raises(ValueError, match=text):
        check_tools(ply(punch(8000.0)))
    check_tools(ply(punch(60.0)))
    check_tools(quarter(punch(60.0)))
    check_tools(ply(replace(punch(-200.0), surface=drape.Sphere(30.0, (0, 0, 199)))))
    assert not caplog.text
    for tools in (ply(punch(62.0)), quarter(punch(62.0))):
        check_tools(tools)
        text = "'punch' pushes the ply by 61.8 mm, over half of the size of the whole"
        assert text in caplog.text
        caplog.clear()


FAR_LID = drape.Plane((0, 0, 1000.0))
OUT_OF_REACH = {
    "at rest": Tool(FAR_LID, side=-1, friction=0.2, name="lid"),
    "moving away": Tool(
        drape.Plane((0, 0, 200.0)), UP, side=-1, friction=0.2, name="lid"
    ),
    "beside the ply": Holder(
        *(drape.Plane((0, 0, 0.2)), 0.4),
        motion=lambda t: (900.0 * (t < 0.9), 0, 0),
        side=-1,
        outline=SHEET,
        friction=0.2,
        name="lid",
    ),
}


@pytest.mark.parametrize("far", OUT_OF_REACH.values(), ids=OUT_OF_REACH)
def test_friction_of_a_tool_out_of_reach_is_a_warning_before_the_run(far, caplog):
    """Unless it comes closer than the size of the ply, 120 mm, and all motions."""
    comes = not isinstance(far, Tool)
    check_tools(ply(punch(8.0), far))
    text = r"friction of \w+ 'lid' will hardly have an effect: it stays .* mm away"
    assert bool(re.search(text, caplog.text)) != comes
    caplog.clear()
    check_tools(ply(punch(8.0), replace(far, friction=0.0)))
    near = replace(far, surface=drape.Plane((0, 0, 120.0)), motion=None)
    check_tools(ply(punch(8.0), near))
    check_tools(ply(punch(8.0), far), moved=1e4)
    assert "friction" not in caplog.text


@pytest.mark.parametrize(
    ("kind", "zero"),
    [
        ("pressure", {"pressure": 0.0}),
        ("force", {"force": 0.0, "compaction": contact.Compaction(0.4, 1e-3, 7.0)}),
    ],
)
def test_friction_of_a_holder_that_never_presses_is_a_warning(kind, zero, caplog):
    holder = Holder(drape.Plane((0, 0, 0.2)), side=-1, friction=0.2, **zero)
    check_tools(ply(punch(8.0), holder))
    text = f"tool 'holder' will have no effect: its {kind} is 0: increase it, or omit"
    assert text in caplog.text
    caplog.clear()
    check_tools(ply(punch(8.0), replace(holder, **{kind: lambda t: t})))
    assert not caplog.text


@pytest.mark.parametrize("kind", [drape.Sphere, drape.Punch])
def test_a_sphere_or_punch_that_passes_between_nodes_is_refused(kind):
    text = "'punch' extends over 7.4 mm, less than half an element of the ply, 15 mm:"
    with pytest.raises(ValueError, match=text):
        ply(Tool(kind(3.7, (0, 0, -8)), UP, name="punch"))
    ply(Tool(kind(3.8, (0, 0, -8)), UP, name="punch"))
