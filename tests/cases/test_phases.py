"""Phases in case files: tables, motions of scenes, round trip and bad input."""

import numpy as np
import pytest

from skfem_textile.cases import case_from_file, case_from_tables, declared
from skfem_textile.cases.read import with_value
from skfem_textile.cases.write import case_text, reference, tables_of

PUNCH = {
    "surface": "sphere",
    "name": "punch",
    "radius_mm": 30.0,
    "centre_mm": [0, 0, -30.2],
}
HOLDER = {
    "surface": "plane",
    "name": "holder",
    "point_mm": [0, 0, 0.2],
    "side": -1,
    "force_N": 1.0,
    "compaction": {
        "law": "compaction",
        "thickness_mm": 0.3,
        "pressure_N_per_mm2": 1e-3,
        "exponent": 8.0,
    },
}
FORMING = {"name": "forming", "width_mm": 120.0, "height_mm": 120.0, "part": "quarter"}
GRAVITY = {"name": "gravity", "steps": 1, "loads": 1.0}
LIFT = {
    "name": "lift",
    "steps": 2,
    "tools": {
        "punch": {"motion_mm": [[0.5, 0, 0, 2], [1, 0, 0, 6]], "friction": 0.2},
        "holder": {
            "force_N": {"travel_of": "punch", "rows": [[0, 1], [6, 4]]},
            "motion_deg": 30,
        },
    },
}


def tables(*phases, scene=FORMING, **others):
    few = {"mesh": {"size": [3, 3]}, "tools": [PUNCH, HOLDER]}
    weight = {"weight_N_per_mm2": [0, 0, -6e-6]}
    return {"scene": scene, "loads": weight, **few, "phases": [*phases], **others}


def moved(*rows, name="up", **others):
    """A phase that moves the punch."""
    return {"name": name, "steps": 1, "tools": {"punch": {"motion_mm": rows}}} | others


def test_the_tool_that_reaches_deepest_is_reported_whatever_the_order():
    """Not a holder with a force, which has no reaction, even if it moves further."""
    plate = {"surface": "plane", "name": "plate", "point_mm": [0, 0, 9]}
    apart = {"name": "apart", "steps": 1, "tools": {"holder": {"motion_mm": [0, 0, 9]}}}
    for order in ([HOLDER, plate, PUNCH], [plate, PUNCH, HOLDER]):
        for phase in moved(0, 0, 6), apart | moved(0, 0, 6):
            case = case_from_tables(tables(phase) | {"tools": order})
            assert case.scene.driven == "punch"
    rows = PUNCH | {"motion_mm": [[0, 0, 0, 0], [0.5, 0, 0, 6], [1, 0, 0, 0]]}
    plain = {"scene": FORMING, "mesh": {"size": [3, 3]}, "tools": [plate, rows]}
    assert case_from_tables(plain).scene.driven == "punch"


def test_holders_alone_are_refused():
    with pytest.raises(ValueError, match="there is no tool against which it presses"):
        case_from_tables(tables(GRAVITY) | {"tools": [HOLDER]})


def test_tools_of_a_case_follow_the_phases():
    case = case_from_tables(tables(GRAVITY, LIFT))
    punch, holder = case.scene.tools
    assert case.steps == (1, 2)
    assert [punch.motion(t)[2] for t in (0.5, 0.75, 1)] == pytest.approx([0, 2, 6])
    assert [holder.force(t) for t in (0.5, 0.75, 1)] == pytest.approx([1, 2, 4])
    assert [punch.friction(t) for t in (0.5, 0.51)] == [0, 0.2]
    turn, _ = holder.motion(1.0)
    assert turn[1, 0] == pytest.approx(0.5)
    (weight,) = case.loads
    assert [weight.factor(t) for t in (0, 0.25, 0.5, 1)] == [0, 0.5, 1, 1]


def test_the_weight_acts_from_the_start_if_no_phase_states_it():
    (weight,) = case_from_tables(tables(LIFT)).loads
    assert weight.factor == 1.0


def test_a_tool_turns_in_phases_about_its_own_axis():
    punch = PUNCH | {"motion_axis": [0, 2, 0], "motion_point_mm": [10, 0, 0]}
    turn = {"name": "turn", "steps": 1, "tools": {"punch": {"motion_deg": 90}}}
    case = case_from_tables(tables(turn, tools=[punch, HOLDER]))
    rotation, translation = case.scene.tools[0].motion(1.0)
    assert rotation @ [1, 0, 0] == pytest.approx([0, 0, -1])
    assert rotation @ [10, 0, 0] + translation == pytest.approx([10, 0, 0])


@pytest.mark.parametrize("name", ["hemisphere_forming", "double_dome_forming"])
def test_phases_replace_the_motion_of_a_scene(name):
    phases = [moved(0, 0, 9), moved(0, 0, 4, name="down")]
    case = case_from_tables({"scene": {"name": name}, "phases": phases})
    punch, die, _ = case.scene.tools
    assert [punch.motion(t)[2] for t in (0.25, 0.5, 1)] == pytest.approx([4.5, 9, 4])
    assert die.motion is None
    kept = [{"name": "a", "steps": 1, "tools": {"holder": {"gap_mm": 0.5}}}]
    case = case_from_tables({"scene": {"name": name}, "phases": kept})
    assert case.scene.tools[0].motion[2] >= 60


def test_a_case_with_phases_is_written_and_read_again(tmp_path):
    scene = FORMING | {"name": "hemisphere_forming"}
    hold = {"friction": [[0, 0.1], [1, 0.2]], "gap_mm": [[0.5, 0.4], [1, 0.4]]}
    punch = {"motion_mm": [0, 0, 9]}
    phases = [{"name": "a b", "steps": 2, "tools": {"punch": punch, "holder": hold}}]
    for given in (tables(GRAVITY, LIFT), tables(*phases, scene=scene, tools=[])):
        case = declared(given)
        file = tmp_path / "case.toml"
        file.write_text(case_text(case, "# A case."), encoding="utf-8")
        read = case_from_file(file)
        assert tables_of(declared(tables_of(case))) == tables_of(case)
        built = case_from_tables(given)
        for tool, again in zip(built.scene.tools, read.scene.tools, strict=True):
            if tool.motion is not None:
                for one, other in zip(tool.motion(0.7), again.motion(0.7), strict=True):
                    assert np.array_equal(one, other)
        assert read.scene.process.phases == built.scene.process.phases


def test_the_keys_of_phases_are_in_the_reference():
    entries = {(entry.table, entry.key): entry for entry in reference()}
    assert entries["[phases]", "steps"].kind == "integer"
    assert "{travel_of, rows}" in entries["phases.tools.NAME", "force_N"].kind


SCENE = {"name": "hemisphere_forming"}


@pytest.mark.parametrize(
    ("message", "given"),
    [
        ("phases must be an array of tables", tables() | {"phases": {"a": 1}}),
        ("phase_1 must be a table", tables(3)),
        ("phases.up.tools must be a table, not 3", tables(moved(0, 0, 1, tools=3))),
        (
            "phases.b.steps is missing: number of its load steps",
            tables(moved(0, 0, 1), {"name": "b"}),
        ),
        ("phases.up.steps must be an integer >= 1", tables(moved(0, 0, 1, steps=0))),
        (
            "phases.up.tools.punch has no key 'motion'; did you mean 'motion_mm'",
            tables(moved(0, 0, 1, tools={"punch": {"motion": 1}})),
        ),
        (
            "phase 'up': there is no tool 'pnch': choose from punch, holder",
            tables(moved(0, 0, 1, tools={"pnch": {"motion_deg": 1}})),
        ),
        (
            r"a tool has the name '\*', which selects all: rename it",
            tables(GRAVITY, tools=[PUNCH | {"name": "*"}, HOLDER]),
        ),
        (
            "stepping.steps does not apply beside",
            tables(moved(0, 0, 1), stepping={"steps": 2}),
        ),
        (
            "stepping.programme: a programme does not apply",
            tables(moved(0, 0, 1), stepping={"programme": [1, 0]}),
        ),
        (
            "'punch' has a motion besides the motions of phases",
            tables(moved(0, 0, 1), tools=[PUNCH | {"motion_mm": [0, 0, 1]}]),
        ),
        (
            "scene.travel_mm is 75, but the phases move the punch, by up to 9 mm",
            {"scene": SCENE | {"travel_mm": 75}, "phases": [moved(0, 0, 9)]},
        ),
        (
            "phase 'gravity' states a factor of the loads, but there are none",
            {"scene": SCENE, "phases": [GRAVITY]},
        ),
        (
            r"\[\[phases\]\] do not apply to the scene strip, which has no tools",
            {"scene": {"name": "strip"}, "phases": [GRAVITY]},
        ),
    ],
)
def test_invalid_phases_are_refused(message, given):
    with pytest.raises(ValueError, match=message):
        case_from_tables(given)


def test_a_star_is_every_tool_of_a_phase_unless_its_own_table_states_it():
    given = tables(GRAVITY, LIFT | {"tools": {"*": {"friction": 0.3}, **LIFT["tools"]}})
    punch, holder = case_from_tables(given).scene.tools
    assert (punch.friction(1.0), holder.friction(1.0)) == (0.2, 0.3)
    every = with_value(given, "phases.lift.tools.*.friction", 0.4)
    punch, holder = case_from_tables(every).scene.tools
    assert (punch.friction(1.0), holder.friction(1.0)) == (0.4, 0.4)
    assert declared(tables_of(declared(every))) == declared(every)


def test_tools_that_no_phase_states_are_tools_of_it_too():
    text = tables(GRAVITY, moved(0, 0, 1))
    every = with_value(text, "phases.up.tools.*.friction", 0.4)
    for tool in case_from_tables(every).scene.tools:
        assert (tool.friction(0.5), tool.friction(1.0)) == (0.0, 0.4)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("friction", 0.1),
        ("holder_gap_mm", 0.2),
        ("holder_pressure_N_per_mm2", 0.1),
        ("holder_force_N", 1.0),
        ("holder_compaction", HOLDER["compaction"]),
        ("centre_mm", [30, 0]),
        ("travel_mm", 75),
    ],
)
def test_keys_of_tools_that_a_scene_has_not_are_refused(key, value):
    scene = FORMING | {key: value}
    with pytest.raises(ValueError, match=f"scene.{key} has no effect, because"):
        case_from_tables(tables(GRAVITY, scene=scene))


def test_friction_that_the_first_phase_replaces_is_refused():
    """Force and gap change from their first values, as friction in rows from later."""
    states = {"name": "first", "steps": 1, "tools": {"punch": {"friction": 0.2}}}
    rubs = [PUNCH | {"friction": 0.1}, HOLDER | {"friction": 0.1}]
    expected = "tools.punch.friction has no effect, because the phase 'first' states"
    with pytest.raises(ValueError, match=expected):
        case_from_tables(tables(states, tools=rubs))
    states["tools"] = {"*": {"friction": 0.2}}
    scene = SCENE | {"friction": 0.1}
    with pytest.raises(ValueError, match=r"scene\.friction has no effect, because"):
        case_from_tables({"scene": scene, "phases": [states]})
    states["tools"] = {"die": {"friction": 0.2}}
    case_from_tables({"scene": scene, "phases": [states]})
    states["tools"] = {"punch": {"friction": [[1, 0.2]]}, "holder": {"force_N": 2}}
    punch, holder = case_from_tables(tables(states, tools=rubs)).scene.tools
    assert punch.friction(0.5) == pytest.approx(0.15)
    assert holder.force(0.5) == 1.5


@pytest.mark.parametrize(("of_shear", "end"), [(False, ", no locking"), (True, "")])
def test_a_note_on_default_laws_describes_these_only(of_shear, end):
    law = {"law": "locking", "stiffness_N_per_mm": 0.1, "locking_angle_deg": 60}
    case = case_from_tables({"scene": SCENE} | ({"shear": law} if of_shear else {}))
    assert f"N/mm, linear{end}; no wrinkling" in case.defaults
