"""Processes in phases: motions and amounts of tools, output by phase, bad input."""

import pickle
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from skfem_textile import Holder, LoadStepper, Tool, contact, drape
from skfem_textile.contact import OverTravel, Phase, Process, phase_table
from skfem_textile.solve.quantities import first_rows
from tests.helpers.forming import GAP, RADIUS, SYMMETRY, blank

# The holder lifts the ply by less than the distance of its nodes to the die.
CLOSED = GAP / 20
CLOSE = Phase("close", 1, {"holder": {"gap": CLOSED}})
PUNCH = Phase("punch", 2, {"punch": {"motion": (0, 0, 6)}})
OPEN = Phase("open", 1, {"punch": {"motion": (0, 0, 0)}, "holder": {"gap": 3.0}})


def tools(mu=0.0, **punch):
    """Punch, and a plate with a hole towards which a holder presses the ply."""
    t = np.linspace(0, 2 * np.pi, 41)
    ring = np.hstack([r * np.array([np.cos(t), np.sin(t)]) for r in (200.0, 38.0)])
    plate = drape.Plane((0, 0, GAP / 2))
    on_plate = {"side": -1, "outline": ring, "friction": mu}
    ball = drape.Sphere(RADIUS, (0, 0, -RADIUS - GAP / 2))
    return [
        Tool(ball, name="punch", friction=mu, **punch),
        Tool(plate, name="die", **on_plate),
        Holder(plate, gap=3.0, name="holder", **on_plate),
    ]


def stepper(phases, mu=0.0, cells=2, **settings):
    process = Process(phases, tools(mu))
    ply = blank(cells, terms=process.tools)
    return process, LoadStepper(ply, SYMMETRY, process.steps, **settings)


@pytest.fixture(scope="module")
def formed():
    """The three phases, with friction."""
    process, run = stepper([CLOSE, PUNCH, OPEN], 0.2)
    return process, run.run()


def test_values_are_reached_linearly_at_the_ends_of_phases():
    punch, die, holder = Process([CLOSE, PUNCH, OPEN], tools()).tools
    ends = [punch.motion(t)[2] for t in (0, 1 / 3, 0.5, 2 / 3, 1)]
    assert ends == pytest.approx([0, 0, 3, 6, 0])
    gaps = [holder.gap(t) for t in (0, 1 / 6, 1 / 3, 2 / 3, 1)]
    assert gaps == pytest.approx([3, (3 + CLOSED) / 2, CLOSED, CLOSED, 3])
    assert die.motion is None


def test_friction_is_valid_in_the_whole_phase():
    phases = [Phase("a", 1, {"die": {"friction": 0.3}}), Phase("b", 1)]
    phases.append(Phase("c", 1, {"die": {"friction": [[0, 0.1], [1, 0.2]]}}))
    die = Process(phases, tools(0.1)).tools[1]
    at = (0.0, 0.1, 1 / 3, 0.5, 2 / 3, 2 / 3 + 1e-9, 1.0)
    found = [die.friction(t) for t in at]
    assert found == pytest.approx([0.3, 0.3, 0.3, 0.3, 0.3, 0.1, 0.2])


def test_rows_are_linear_between_shares_of_the_phase():
    rows = [(0.5, (0, 0, 8)), (1, (0, 0, 4))]
    phases = [CLOSE, Phase("punch", 2, {"punch": {"motion": rows}})]
    punch = Process(phases, tools()).tools[0]
    assert [punch.motion(t)[2] for t in (0.5, 0.625, 0.75, 1)] == [0, 4, 8, 4]


def test_an_amount_follows_the_travel_of_a_tool():
    force = OverTravel("punch", [[0, 5], [10, 20], [15, 20]])
    phases = [
        Phase("press", 1, {"holder": {"force": 5}}),
        Phase(
            "punch", 3, {"punch": {"motion": (0, 9, 12)}, "holder": {"force": force}}
        ),
    ]
    law = contact.Compaction(thickness=0.3, pressure=1e-3, exponent=8.0)
    flange = drape.Plane((0, 0, 0.1))
    holder = Holder(flange, force=0.0, compaction=law, side=-1)
    holder = Process(phases, [tools()[0], holder]).tools[1]
    found = [holder.force(t) for t in (0, 0.25, 0.5, 2 / 3, 5 / 6, 1)]
    assert found == pytest.approx([0, 2.5, 5, 12.5, 20, 20])


def test_an_amount_follows_the_travel_of_the_axis_of_a_tool():
    turned = {"punch": {"motion": (0, 0, 5), "rotation": 1.2}}
    gap = OverTravel("punch", [[0, 3.0], [5, 1.0]])
    phases = [Phase("punch", 1, turned | {"holder": {"gap": gap}})]
    holder = Process(phases, tools(), {"punch": ((0, 1, 0), (9, 0, 0))}).tools[2]
    assert holder.gap(0.5) == pytest.approx(2.0)


def test_rows_of_a_travel_turn_back_where_a_step_of_their_phase_ends():
    """The steps of the second phase end at travels of 9 and 12 mm."""

    def phases(turn):
        friction = OverTravel("punch", [[6, 0.0], [turn, 0.4], [12, 0.1]])
        rubs = {"punch": {"motion": (0, 0, 12)}, "die": {"friction": friction}}
        return [PUNCH, Phase("rub", 2, rubs)]

    die = Process(phases(9), tools()).tools[1]
    assert die.friction(0.75) == pytest.approx(0.4)
    refused("turns back at the travel 8 mm, within one of 2 steps", phases(8))


def test_a_tool_turns_about_its_axis():
    phases = [Phase("turn", 1, {"die": {"rotation": np.pi / 2}}), Phase("stay", 1)]
    axes = {"die": ((0, 0, 2), (10, 0, 0))}
    die = Process(phases, tools(), axes).tools[1]
    turn, moved = die.motion(0.75)
    assert turn @ [1, 0, 0] == pytest.approx([0, 1, 0])
    assert turn @ [10, 0, 0] + moved == pytest.approx([10, 0, 0])
    assert die.motion(0.25)[0][0, 0] == pytest.approx(np.sqrt(0.5))


def test_a_rotation_by_more_than_half_a_turn_is_reported_as_such():
    turns = [Phase("turn", 1, {"die": {"rotation": -1.5 * np.pi}}), Phase("stay", 1)]
    die = Process(turns, tools()).tools[1].on(blank().basis)
    assert [die.rotation(t) for t in (0.0, 0.25, 1.0)] == pytest.approx(
        [0, 0.75 * np.pi, 1.5 * np.pi]
    )


def test_loads_have_a_factor_in_each_phase():
    assert Process([CLOSE], tools()).loads is None
    phases = [Phase("gravity", 1, loads=1.0), CLOSE, Phase("lift", 1, loads=0.5)]
    loads = Process(phases, tools()).loads
    assert [loads(t) for t in (0, 1 / 6, 1 / 3, 2 / 3, 1)] == pytest.approx(
        [0, 0.5, 1, 1, 0.5]
    )


@pytest.mark.dear("two runs between tools")
@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_one_motion_in_two_phases_gives_the_same_states(mu):
    """The phases have different lengths in the load factor, but equal steps in mm."""
    whole = Phase("punch", 3, {"punch": {"motion": (0, 0, 6)}})
    first = Phase("first", 1, {"punch": {"motion": (0, 0, 2)}})
    rest = Phase("rest", 2, {"punch": {"motion": (0, 0, 6)}})
    one, two = (
        stepper(phases, mu)[1].run()
        for phases in ([CLOSE, whole], [CLOSE, first, rest])
    )
    assert len(one.states) == len(two.states) == 5
    for a, b in zip(one.states, two.states, strict=True):
        np.testing.assert_allclose(a.u, b.u, rtol=0, atol=1e-8)
    assert np.abs(one.u).max() > 3
    if mu:
        assert min(one.states[-1].energy_lost.values()) > 1e-3  # also at the holder


@pytest.mark.dear("a run between tools")
def test_a_ply_that_unloads_in_one_step_takes_no_more_solves_than_a_step_of_loading():
    back = Phase("back", 1, {"punch": {"motion": (0, 0, 0)}})
    punch = Phase("punch", 3, {"punch": {"motion": (0, 0, 12)}})
    _, *loading, unloading = [
        state.linear_solves for state in stepper([punch, back])[1].run().states
    ]
    assert unloading <= max(loading)


def test_a_process_can_be_pickled(formed):
    process, _ = formed
    again = pickle.loads(pickle.dumps(process))
    assert again.tools[2].gap(0.9) == process.tools[2].gap(0.9)


# Output


def test_the_table_has_a_row_for_the_end_of_each_phase(formed):
    process, result = formed
    rows = phase_table(result, process)
    assert [row["phase"] for row in rows] == ["close", "punch", "open"]
    assert [row["share"] for row in rows] == [1, 1, 1]
    assert [row["punch_travel_mm"] for row in rows] == pytest.approx([0, 6, 0])
    at = process.at_ends(result)
    history = contact.tool_history(result)
    assert [row["punch_force_N"] for row in rows] == list(history["punch_force_N"][at])
    key = "recovered_max_shear_angle_deg"
    assert rows[1][key] == result.until(at[1]).summary()[key] > 1
    assert rows[0]["energy_lost"] < rows[1]["energy_lost"] <= rows[2]["energy_lost"]
    assert {*result.states[-1].energy_lost} == {"punch", "die", "holder"}
    assert min(result.states[-1].energy_lost.values()) > 1e-3
    assert process.phase_at(0.0) == process.phase_at(1 / 3) == "close"


def test_a_phase_at_whose_end_a_clamp_lets_go_has_one_row(formed):
    """That of the state without the clamp."""
    process, result = formed
    states = result.states[:2] + result.states[1:]
    twice = type(result)(**{**vars(result), "states": states})
    assert process.at_ends(twice) == [i + 1 for i in process.at_ends(result)]


def test_the_energy_lost_is_of_the_whole_ply_and_stated_once(formed):
    _, result = formed
    summary, lost = result.summary(), sum(result.states[-1].energy_lost.values())
    assert contact.figures.mirror_images(result.ply) == 4
    assert summary["energy_lost"] == pytest.approx(lost)
    of_lost = [row for row in first_rows(summary) if row[0] == "Energy lost"]
    on_whole = "N·mm on the whole ply, 4 times that on the computed quarter"
    assert of_lost == [("Energy lost", "", f"{4 * lost:.4g} {on_whole}")]


def test_the_table_has_the_forces_of_clamps(formed, monkeypatch):
    process, result = formed
    monkeypatch.setattr(
        type(result), "clamp_forces", lambda _, at: {"grip_force_N": at.load_factor}
    )
    rows = phase_table(result, process)
    assert [row["grip_force_N"] for row in rows] == [row["load_factor"] for row in rows]


def test_a_run_that_stopped_ends_with_its_last_state(formed):
    process, result = formed
    part = result.states[:3]  # within the second phase
    row = phase_table(replace(result, states=part), process)[-1]
    assert (row["phase"], row["share"]) == ("punch", 0.5)
    assert row["punch_travel_mm"] == pytest.approx(3)


# Bad input


def refused(message, phases, given=None, axes=None):
    with pytest.raises(ValueError, match=message) as caught:
        Process(phases, given or tools(), axes)
    assert "\n" not in str(caught.value)


def test_lists_that_are_none_are_refused():
    with pytest.raises(ValueError, match="phases must be a list of phases, got None"):
        Process(None, tools())
    with pytest.raises(ValueError, match="tools must be a list of tools, got None"):
        Process([CLOSE], None)


def test_a_number_may_be_an_array_without_axes():
    phases = [Phase("a", 1, {"die": {"friction": np.array(0.3)}})]
    assert Process(phases, tools()).tools[1].friction(1.0) == 0.3


def moving(rows, steps=2, name="punch"):
    return Phase(name, steps, {"punch": {"motion": rows}})


def holding(**amounts):
    return Phase("hold", 1, {"holder": amounts})


def test_tools_that_are_not_the_tools_of_the_process_are_refused():
    """Of a ply that is built with the tools before the process, none moves."""
    process = Process([CLOSE, PUNCH], tools())
    own, other = (
        SimpleNamespace(ply=blank(terms=x), states=[SimpleNamespace(load_factor=1.0)])
        for x in (process.tools, tools())
    )
    assert process.at_ends(own) == [0]
    with pytest.raises(ValueError, match="'punch' of the ply is not the one of the"):
        process.at_ends(other)
    for one in process, pickle.loads(pickle.dumps(process)):
        with pytest.raises(ValueError, match="'punch' of the ply is not the one of"):
            LoadStepper(other.ply, SYMMETRY, one.steps)


@pytest.mark.parametrize(
    ("message", "phases"),
    [
        ("at least one phase", []),
        ("name of a phase must be text", [Phase("", 1)]),
        ("phase 'a/b': the name contains '/', which names", [Phase("a/b", 1)]),
        ("a phase must be a Phase, got 3", [CLOSE, 3]),
        ("tools must be a dictionary", [Phase("x", 1, [3])]),
        ("changes of 'die' must be a dictionary", [Phase("x", 1, {"die": 3})]),
        ("gap of 'holder' must be a number, or rows", [holding(gap="wide")]),
        ("gap of 'holder' must be a number, or rows", [holding(gap=[[0, 1, 2]])]),
        ("two phases have the name 'close'", [CLOSE, CLOSE]),
        ("phase 'x': steps must be a whole", [Phase("x", 0)]),
        ("no tool 'pinch': choose from punch, die", [Phase("x", 1, {"pinch": {}})]),
        ("'die' has no 'sped'", [Phase("x", 1, {"die": {"sped": 1}})]),
        ("'die' has no gap", [Phase("x", 1, {"die": {"gap": 1}})]),
        (
            "'holder' is a holder with a gap, not a force: state its gap",
            [holding(force=1)],
        ),
        (
            "gap of 'holder' must be a number of at least 0 mm, got -1 mm",
            [holding(gap=-1)],
        ),
        ("friction of 'holder' must be a number from 0 to 2", [holding(friction=2.5)]),
        ("gap of 'holder' must be a number, or rows", [holding(gap=(1, 2))]),
        ("gap of 'holder' must be finite", [holding(gap=np.nan)]),
        (
            "shares of the rows must increase",
            [moving([[0.6, 0, 0, 1], [0.4, 0, 0, 2]])],
        ),
        ("shares of the rows must increase to 1", [moving([[0.6, 0, 0, 1]])]),
        (
            r"begins with \(0, 0, 2\) mm, but phase 'punch' leaves it at \(0, 0, 6\)",
            [PUNCH, moving([[0, 0, 0, 2], [1, 0, 0, 3]], name="again")],
        ),
        ("begins with 2 mm, but before it is 3 mm", [holding(gap=[[0, 2], [1, 1]])]),
        (
            "turns back at the share 0.3, within one of 2 steps",
            [moving([[0.3, 0, 0, 4], [1, 0, 0, 2]])],
        ),
        (
            "travels of the rows must increase",
            [holding(gap=OverTravel("punch", [[5, 3], [2, 3]]))],
        ),
        (
            "no tool 'pinch' whose travel is known",
            [holding(gap=OverTravel("pinch", [[0, 3], [2, 3]]))],
        ),
        (
            r"no tool \['punch'\] whose travel is known",
            [holding(gap=OverTravel(["punch"], [[0, 3], [2, 3]]))],
        ),
        (
            "gap of 'holder' follows the travel of 'die', which does not move",
            [holding(gap=OverTravel("die", [[0, 3], [2, 3]]))],
        ),
        (
            "motion of 'punch' does not follow the travel of a tool",
            [Phase("x", 1, {"punch": {"motion": OverTravel("die", [[0, 0, 0, 1]])}})],
        ),
        (
            "rotation of 'die' does not follow the travel of a tool",
            [Phase("x", 1, {"die": {"rotation": OverTravel("punch", [[0, 1]])}})],
        ),
        (
            "friction of 'die' turns back at the travel 2 mm, within one of 2 steps",
            [
                Phase(
                    *("x", 2),
                    {
                        "punch": {"motion": (0, 0, 6)},
                        "die": {
                            "friction": OverTravel("punch", [[0, 0], [2, 1], [6, 0]])
                        },
                    },
                )
            ],
        ),
        (
            "turns back at the share 0.6, within one of 2 steps",
            [moving([[0.6, 0, 0, 4], [0.9, 0, 0, 4], [1, 0, 0, 2]])],
        ),
        ("gap of 'holder' must be a number, or rows", [holding(gap=True)]),
        ("gap of 'holder' must be a number, or rows", [holding(gap="2")]),
    ],
)
def test_invalid_phases_are_refused_in_one_line(message, phases):
    refused(message, phases)


@pytest.mark.parametrize(
    ("message", "axes"),
    [
        ("axes: there is no tool 'pnch'", {"pnch": ((0, 0, 1), (0, 0, 0))}),
        ("axis of 'die' must be a direction, not", {"die": ((0, 0, 0), (0, 0, 0))}),
        ("axis of 'die' must be a direction, not", {"die": (0, 0, 1)}),
        (
            "axis of 'die' must be a direction, not",
            {"die": ((0, 0, 1), (0, np.nan, 0))},
        ),
    ],
)
def test_invalid_axes_are_refused(message, axes):
    refused(message, [Phase("turn", 1, {"die": {"rotation": 1.0}})], axes=axes)


def test_a_value_that_is_kept_over_the_end_of_a_step_may_turn_back():
    rows = [[0.4, 0, 0, 4], [0.6, 0, 0, 4], [1, 0, 0, 2]]
    assert Process([moving(rows)], tools()).tools[0].motion(0.5)[2] == 4


def test_a_tool_that_would_be_in_two_places_is_refused():
    for motion in ((0, 0, 5), lambda t: (0, 0, t)):
        refused("'punch' has a motion besides", [PUNCH], tools(motion=motion))
    punch, die, _ = tools()
    own = Holder(die.surface, gap=lambda t: 3 - t, side=-1)
    refused("gap that is a function of the load", [holding(gap=1)], [punch, own])


def test_steps_that_pass_the_end_of_a_phase_are_refused():
    process = Process([CLOSE, PUNCH, OPEN], tools())
    ply = blank(terms=process.tools)
    with pytest.raises(ValueError, match=r"steps must be a multiple of 3, .* phases"):
        LoadStepper(ply, SYMMETRY, 4)


def test_steps_that_pass_a_turn_within_a_phase_are_refused():
    """Although each phase ends with a step."""
    process = Process([moving([[0.5, 0, 0, 8], [1, 0, 0, 4]])], tools())
    ply = blank(terms=process.tools)
    with pytest.raises(ValueError, match=r"share 0\.5, within one of 3 steps"):
        LoadStepper(ply, SYMMETRY, 3)


def test_crossing_tools_at_the_end_of_a_phase_are_refused():
    """Between the load factors that are otherwise checked, quarters of the load."""
    punch, die, _ = tools()
    lid = Tool(drape.Plane((0, 0, 9)), side=-1, name="lid")
    phases = [moving((0, 0, 12), 1), moving((0, 0, 0), 1, "back"), Phase("rest", 1)]
    process = Process(phases, [punch, die, lid])
    with pytest.raises(ValueError, match=r"no room for the ply at load factor 0\.333"):
        LoadStepper(blank(terms=process.tools), SYMMETRY, process.steps)


def test_an_unknown_phase_is_refused():
    process = Process([CLOSE, PUNCH], tools())
    assert (process.begin("close"), process.begin("punch")) == (0, 0.5)
    with pytest.raises(ValueError, match="no phase 'pinch': choose from close, punch"):
        process.begin("pinch")


# Resumed and repeated


class StopError(Exception):
    """Raised within a phase."""


def same(one, other):
    assert [s.load_factor for s in one.states] == [s.load_factor for s in other.states]
    for a, b in zip(one.states, other.states, strict=True):
        assert np.array_equal(a.u, b.u)
        assert a.energies == b.energies
        for term, values in a.parameters.items():
            assert values.same_as(b.parameters[term])


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """Checkpoint of a run that was stopped within the second phase."""
    folder = tmp_path_factory.mktemp("stopped")

    def stop(state):
        if state.load_factor > 1 / 3:
            raise StopError

    run = stepper([CLOSE, PUNCH, OPEN], 0.2, checkpoint=folder, on_step=stop)[1]
    with pytest.raises(Exception, match="StopError"):
        run.run()
    assert run.states[-1].load_factor == pytest.approx(0.5)
    return folder


def content(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_a_run_stopped_within_a_phase_is_resumed_bit_for_bit(stopped, formed, tmp_path):
    for file, data in content(stopped).items():
        (tmp_path / file).write_bytes(data)
    run = stepper([CLOSE, PUNCH, OPEN], 0.2, checkpoint=tmp_path)[1]
    same(run.run(resume=True), formed[1])


@pytest.mark.dear("two runs between tools")
def test_a_run_repeats_phases_with_other_values(stopped, tmp_path):
    """As from the undeformed ply, bit for bit; and the run can be resumed itself."""
    before, new = content(stopped), tmp_path / "new"
    faster = Phase("punch", 1, {"punch": {"motion": (0, 0, 4)}, "die": {"friction": 0}})
    phases = [CLOSE, faster, Phase("open", 1, {"punch": {"motion": (0, 0, 0)}})]
    process, run = stepper(phases, 0.2, checkpoint=new)
    repeated = run.run(states_of=stopped, until=process.begin("punch"))
    same(repeated, stepper(phases, 0.2)[1].run())
    assert content(stopped) == before
    max(new.glob("state_*")).unlink()
    same(stepper(phases, 0.2, checkpoint=new)[1].run(resume=True), repeated)


@pytest.mark.parametrize(
    ("message", "phases", "phase"),
    [
        ("values of the gap of 'holder' differ", [holding(gap=1.0), PUNCH, OPEN], 1),
        (
            r"steps was \[1, 2, 1\] and is now \[2, 2, 1\]",
            [Phase("close", 2, CLOSE.tools), PUNCH, OPEN],
            1,
        ),
        ("contains no state at the load factor 0.666667", [CLOSE, PUNCH, OPEN], 2),
    ],
)
def test_only_the_same_run_is_repeated(stopped, message, phases, phase):
    process, run = stepper(phases, 0.2)
    with pytest.raises(ValueError, match=message):
        run.run(states_of=stopped, until=process.begin(process.names[phase]))


def test_invalid_repeats_are_refused(stopped, tmp_path):
    run = stepper([CLOSE, PUNCH, OPEN], 0.2, checkpoint=tmp_path)[1]
    with pytest.raises(ValueError, match="until must be a load factor at which a part"):
        run.run(states_of=stopped, until=0.5)
    with pytest.raises(ValueError, match="resumed or repeated"):
        run.run(resume=True, states_of=stopped)
    with pytest.raises(ValueError, match="would replace the run"):
        run.run(states_of=tmp_path)
    with pytest.raises(ValueError, match="contains no states"):
        run.run(states_of=tmp_path / "missing")
