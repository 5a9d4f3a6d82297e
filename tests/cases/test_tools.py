"""Tools in case files: surfaces, motions, holders, round trip and bad input."""

import re

import meshio
import numpy as np
import pytest
import shapely

from skfem_textile.cases import case_from_file, case_from_tables, declared
from skfem_textile.cases.write import case_text, reference
from skfem_textile.contact import Holder, contacts
from skfem_textile.drape import Axes, Die
from skfem_textile.ply.amount import Rows
from tests.helpers import graph, refused
from tests.helpers.curves import write_columns

PUNCH = {
    "surface": "sphere",
    "name": "punch",
    "radius_mm": 30.0,
    "centre_mm": [0, 0, -30.2],
    "motion_mm": [[0, 0, 0, 0], [0.5, 0, 0, 2], [1, 0, 0, 6]],
}
DIE = {"surface": "die", "radius_mm": 34.0, "fillet_mm": 6.0, "point_mm": [0, 0, 0.2]}
HOLDER = {
    "surface": "plane",
    "point_mm": [0, 0, 0.2],
    "side": -1,
    "gap_mm": [[0, 3.0], [0.5, 0.4], [1, 0.4]],
    "outline_mm": [[40, -90], [90, -90], [90, 90], [40, 90]],
}
SCENE = {
    "name": "forming",
    "width_mm": 120.0,
    "height_mm": 120.0,
    "part": "quarter",
}


def tables(*tools, scene=SCENE, **others):
    return {"scene": scene, "mesh": {"size": [3, 3]}, "tools": [*tools], **others}


def test_tools_of_a_case_have_friction_and_a_force():
    rubbing = DIE | {"friction": [[0, 0.1], [1, 0.3]], "elastic_slip_mm": 0.05}
    law = {"law": "compaction", "thickness_mm": 0.3, "exponent": 8.0}
    rigid = {k: x for k, x in HOLDER.items() if k != "gap_mm"} | {
        "force_N": [[0, 0], [1, 4]],
        "compaction": law | {"pressure_N_per_mm2": 1e-3},
    }
    case = case_from_tables(tables(PUNCH, rubbing, rigid))
    punch, die, holder = case.scene.tools
    assert punch.friction == 0.0
    assert (die.friction(0.5), die.elastic_slip) == (pytest.approx(0.2), 0.05)
    assert holder.force(0.5) == pytest.approx(2.0)
    assert holder.compaction.pressure_at(0.15) == pytest.approx(0.255)
    measured = {
        "law": "measured-compaction",
        "thickness_mm": [0.3, 0.2],
        "pressure_N_per_mm2": [0, 0.1],
    }
    case = case_from_tables(tables(PUNCH, DIE, rigid | {"compaction": measured}))
    assert case.scene.tools[2].compaction.free == 0.3


def test_an_elastic_slip_is_refused_by_its_key():
    slip = PUNCH | {"friction": 0.1, "elastic_slip_mm": 0.0}
    message = r"tools\.punch\.elastic_slip_mm must be a number > 0"
    refused(lambda: case_from_tables(tables(slip)), message)


def test_the_tools_of_a_scene_have_its_friction():
    scene = {"name": "hemisphere_forming", "friction": 0.25}
    case = case_from_tables({"scene": scene})
    assert [tool.friction for tool in case.scene.tools] == [0.25] * 3


def test_tools_of_a_case_move_with_the_load_factor():
    few = {"mesh": {"size": [2, 2]}, "stepping": {"steps": 2}}
    case = case_from_tables(tables(PUNCH, DIE, HOLDER, **few))
    punch, die, holder = case.scene.tools
    assert punch.motion(0.5).tolist() == [0, 0, 2]
    assert punch.motion(0.75).tolist() == [0, 0, 4]
    assert isinstance(die.surface, Die)
    assert (die.name, holder.name) == ("tool_2", "tool_3")
    assert isinstance(holder, Holder)
    assert holder.gap(0.25) == pytest.approx(1.7)
    assert np.shape(holder.outline) == (2, 4)
    result = case.run()
    half = next(state for state in result.states if state.load_factor == 0.5)
    end = result.states[-1]
    assert half.displacements["punch"].tolist() == [0, 0, 2]
    assert end.displacements["punch"].tolist() == [0, 0, 6]
    assert end.reactions["punch"][2] > half.reactions["punch"][2] > 0


def test_a_tool_of_a_case_turns_about_an_axis_through_a_point():
    """A quarter turn about y, then 3 mm along z, in the axes of the tools."""
    moved = {"motion_axis": [0, -2, 0], "motion_point_mm": [-5, 0, 4]}
    moved |= {"motion_mm": [0, 0, 3], "motion_deg": 90.0}
    case = case_from_tables(tables({**PUNCH, **moved, "side": 1}))
    (punch,) = case.scene.tools
    turn, translation = punch.motion(1.0)
    x = np.array([-5.0 + 2, 7, 4])
    assert turn @ x + translation == pytest.approx([-5, 7, 4 + 2 + 3])
    (a, b), (c, d) = punch.motion(0.5), punch.motion(0.0)
    assert a @ a == pytest.approx(turn)
    assert c == pytest.approx(np.eye(3))
    assert np.abs(d).max() < 1e-12
    half = a @ [-5.0, 7, 4] + b
    assert half == pytest.approx([-5, 7, 5.5])
    rows = {**PUNCH, "motion_deg": [[0, 0], [0.5, 30], [1, -30]]}
    (punch,) = case_from_tables(tables(rows)).scene.tools
    angles = [np.degrees(np.arcsin(punch.motion(t)[0][1, 0])) for t in (0.25, 0.5, 1)]
    assert angles == pytest.approx([15, 30, -30])
    assert punch.motion(0.5)[1].tolist() == [0, 0, 2]


def test_the_weight_of_a_case_acts_from_the_start():
    """A table carries it at all load factors; edges are not pulled."""
    table = {"surface": "plane", "name": "table", "side": 1}
    scene = SCENE | {"tension_N_per_mm": 0.0}
    others = {"stepping": {"steps": 2}, "loads": {"weight_N_per_mm2": [0, 0, -2e-5]}}
    result = case_from_tables(tables(table, scene=scene, **others)).run()
    for state in result.states:
        assert state.reactions["table"][2] == pytest.approx(2e-5 * 60**2, rel=1e-6)
    with pytest.raises(ValueError, match=r"loads\.weight_N_per_mm2"):
        case_from_tables(tables(table, loads={"weight_N_per_mm2": [1.0]}))
    plane = {"scene": {"name": "trellis"}, "loads": {"weight_N_per_mm2": [0, 0, 1.0]}}
    with pytest.raises(ValueError, match=r"'weight'.* finite vector of shape"):
        case_from_tables(plane).ply()


def test_the_weight_turns_with_a_scene_in_the_plane():
    weight = {"weight_N_per_mm2": [0.0, -1e-5]}
    scene = {"name": "bias_extension", "rotate_deg": 90.0}
    irregular = {"source": "irregular", "size": [2, 4]}
    case = case_from_tables({"scene": scene, "mesh": irregular, "loads": weight})
    (load,) = case.loads
    assert load.value == pytest.approx([1e-5, 0.0])


def test_a_case_with_tools_is_written_and_read_again(tmp_path):
    case = declared(tables(PUNCH, DIE, HOLDER))
    file = tmp_path / "case.toml"
    file.write_text(case_text(case, "# A case."), encoding="utf-8")
    again = case_from_file(file)
    assert [tool.name for tool in again.scene.tools] == ["punch", "tool_2", "tool_3"]
    assert "\n[[tools]]" not in case_text(declared(tables()), "# A case.")


def test_an_elastic_slip_without_friction_is_refused():
    """Friction may also be 0, or follow in a phase."""
    slips = {**PUNCH, "name": "punch", "elastic_slip_mm": 0.1}
    with pytest.raises(ValueError, match="elastic_slip_mm requires friction: set it"):
        case_from_tables(tables(slips))
    phase = {"name": "up", "steps": 1, "tools": {"punch": {"friction": 0.2}}}
    still = {key: x for key, x in slips.items() if not key.startswith("motion")}
    for case in (
        tables({**slips, "friction": 0.0}),
        tables(still) | {"phases": [phase]},
    ):
        (punch,) = case_from_tables(case).scene.tools
        assert punch.elastic_slip == 0.1


@pytest.mark.parametrize("value", [20, -0.1])
def test_the_friction_of_a_scene_is_refused_by_its_key(value):
    scene = {"name": "hemisphere_forming", "friction": value}
    with pytest.raises(ValueError, match=r"scene\.friction must be a number [<>]="):
        case_from_tables({"scene": scene})


def graph_file(path):
    """Write a slope z = x / 4 over 0 ≤ x, y ≤ 80 mm, in metres."""
    x, t = graph(np.linspace(0.0, 0.08, 9), lambda x, y: 0.25 * x)
    meshio.Mesh(x.T, [("triangle", t.T)]).write(path)
    return str(path)


def test_a_tool_of_a_file_is_turned_about_the_origin_and_then_moved(tmp_path):
    """x becomes y and y becomes -x; the unit applies to the file, not to the offset."""
    placed = {"offset_mm": [10.0, 20.0, -30.0], "rotation_deg": 90.0}
    file = {"surface": "triangles", "source": graph_file(tmp_path / "P.stl")}
    case = declared(tables({**file, **placed, "unit": "m", "side": 1}))
    path = tmp_path / "case.toml"
    path.write_text(case_text(case, "# A case."), encoding="utf-8")
    (tool,) = case_from_file(path).scene.tools
    points = tool.surface.facets.points
    low, high = points.min(axis=1), points.max(axis=1)
    assert low == pytest.approx([10 - 80, 20, -30], abs=1e-5)
    assert high == pytest.approx([10, 20 + 80, -30 + 20], abs=1e-5)
    at = np.array([[-30.0], [60.0], [-30 + 10.0]])  # 40 mm along x in the file
    assert tool.surface.level(at) == pytest.approx(0.0, abs=1e-5)


def test_a_tool_of_a_file_is_turned_about_any_axis(tmp_path):
    file = {"surface": "triangles", "source": graph_file(tmp_path / "P.stl")}
    turned = {"rotation_deg": 180.0, "rotation_axis": [3.0, 0, 0], "unit": "m"}
    (tool,) = case_from_tables(tables({**file, **turned, "side": 1})).scene.tools
    points = tool.surface.facets.points
    low, high = points.min(axis=1), points.max(axis=1)
    assert low == pytest.approx([0, -80, -20], abs=1e-5)
    assert high == pytest.approx([80, 0, 0], abs=1e-5)


def test_tools_apply_to_any_scene_in_space():
    plate = {"surface": "plane", "point_mm": [0, 0, -20.0], "name": "table"}
    scene = {"name": "cantilever"}
    case = case_from_tables(tables(plate, scene=scene, mesh={"size": [3, 1]}))
    result = case.run()
    figures = case.summary(result)
    (table,) = contacts(result.ply)
    assert abs(table.gaps(result.u, 1.0).min()) < 1e-6
    assert result.states[-1].reactions["table"][2] > 0
    assert "tip_error_over_length" not in figures
    assert {"table_gap_mm", "table_force_N"} & figures.keys()
    assert figures["exact_answer"] == "none: tools act on the ply"


def test_positions_in_a_file_are_in_the_axes_of_the_tools():
    """The ply is computed in parallel axes with another origin."""
    stated = {**HOLDER, "motion_deg": 90.0, "motion_point_mm": [50.0, 30.0, 0.0]}
    (given,) = declared(tables(stated)).tools
    tool = given.build("holder", Axes(np.array([5.0, 2.0, 1.0])))
    corners = np.transpose(HOLDER["outline_mm"])
    assert tool.outline == pytest.approx(corners - [[5], [2]])
    assert tool.surface.level(np.array([[0.0], [0.0], [-0.8]])) == pytest.approx(0.0)
    turn, move = tool.motion(1.0)
    assert turn @ [45.0, 38.0, 0.0] + move == pytest.approx([35.0, 28.0, 0.0])


@pytest.mark.parametrize("hole", [0, 45])
def test_the_share_by_which_elements_differ_from_an_outline_is_logged(
    tmp_path, caplog, hole
):
    """Of a circle off the origin, and of one with a hole, in which elements lie."""
    t = np.linspace(0.0, 2 * np.pi, 60, endpoint=False)
    circles = [np.stack([50 + r * np.cos(t), r * np.sin(t)]) for r in (60, hole) if r]
    x, number = np.hstack(circles), np.repeat(range(len(circles)), len(t))
    outline = str(write_columns(tmp_path / "ring.csv", "x,y,curve", *x, number))
    mesh = {"outline": outline, "size": [6, 6]}
    case = case_from_tables(tables(PUNCH, scene={"name": "forming"}, mesh=mesh))
    x = case.scene.mesh.p
    assert x.min(axis=1) == pytest.approx(-x.max(axis=1), abs=2.0)
    ring = shapely.Polygon(circles[0].T, [one.T for one in circles[1:]])
    cells = shapely.polygons(x[:, case.scene.mesh.t].T + np.array([50, 0]))
    expected = 100 * (ring ^ shapely.union_all(cells)).area / ring.area
    share = re.search(r"differ by ([\d.]+) % of its area", caplog.text)[1]
    assert float(share) == pytest.approx(expected, abs=0.051)


@pytest.mark.parametrize(("side", "is_told"), [(20.0, False), (6.0, True)])
def test_an_outline_in_another_unit_than_the_tools_is_told(
    tmp_path, caplog, side, is_told
):
    x, t = graph(np.linspace(-80, 80, 9), lambda x, y: -(x**2 + y**2) / 400)
    meshio.Mesh(x.T, [("triangle", t.T)]).write(tmp_path / "tool.stl")
    corners = side * np.array([[-0.5, 0.5, 0.5, -0.5], [-0.5, -0.5, 0.5, 0.5]])
    mesh = {"outline": str(write_columns(tmp_path / "ply.csv", "x,y", *corners))}
    scene = {"name": "drape", "tool": str(tmp_path / "tool.stl")}
    case_from_tables({"scene": scene, "mesh": {**mesh, "size": [2, 2]}})
    line = f"extends over {side:g} mm, the tools over 160 mm: check the units"
    assert (line in caplog.text) == is_told


def test_every_surface_is_in_the_reference():
    listed = {entry.choice for entry in reference() if entry.table == "[tools]"}
    surfaces = "triangles plane sphere cylinder cone torus punch die"
    assert listed >= {*surfaces.split()}


@pytest.mark.parametrize(
    ("key", "rows"),
    [
        ("motion_mm", [[0, 0, 0, 0], [0.55, 0, 0, 9], [1, 0, 0, 0]]),
        ("motion_deg", [[0, 0], [0.55, 9], [1, 0]]),
        ("friction", [[0, 0], [0.55, 0.2], [0.7, 0.2], [1, 0]]),
    ],
)
def test_steps_that_pass_a_turning_point_of_rows_are_refused(key, rows):
    two, twenty = (
        case_from_tables(tables(PUNCH | {key: rows}, DIE, stepping={"steps": n}))
        for n in (2, 20)
    )
    message = f"tools.punch.{key} turns back at the load factor 0.55, within one of 2 "
    refused(two.stepper, message)
    twenty.stepper()


@pytest.mark.parametrize("key", ["friction", "gap_mm", "force_N", "motion_deg"])
def test_empty_rows_are_refused(key):
    named = PUNCH | {"name": "stamp", key: []}
    refused(lambda: case_from_tables(tables(named)), f"tools.stamp.{key} is empty")


def test_a_number_that_is_not_finite_names_its_tool_and_phase():
    gap = {"tools": {"stamp": {"friction": np.nan}}, "name": "press", "steps": 1}
    for given, path in (
        ({"friction": np.nan}, "tools.stamp.friction"),
        ({"motion_mm": [0, 0, np.inf]}, "tools.stamp.motion_mm"),
        ({}, "phases.press.tools.stamp.friction"),
    ):
        case = tables(PUNCH | {"name": "stamp"} | given)
        case |= {} if given else {"phases": [gap]}
        refused(lambda case=case: declared(case), f"{path} must be a finite number")


def test_a_motion_of_all_tools_is_not_a_travel_of_the_scene():
    still = {key: x for key, x in PUNCH.items() if key != "motion_mm"}
    motions = {"punch": {"motion_mm": [0, 0, 2]}}, {"*": {"motion_mm": [0, 0, 9]}}
    phases = [{"name": str(i), "steps": 1, "tools": x} for i, x in enumerate(motions)]
    case = tables(still, scene={"name": "forming"}, phases=phases)
    assert case_from_tables(case).steps == (1, 1)


def test_rows_are_interpolated():
    rows = Rows.of("x", [(0.0, 1.0), (0.25, 3.0), (1.0, 0.0)])
    assert [rows(t) for t in (0.0, 0.125, 0.25, 1.0)] == [1.0, 2.0, 3.0, 0.0]
