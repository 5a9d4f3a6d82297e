"""Figures of formed plies, against exact answers."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Full,
    Holder,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Result,
    Tool,
    Values,
    drape,
)
from skfem_textile.contact import (
    Phase,
    Process,
    areal_weight,
    contacts,
    draw_in,
    fibre_curvature,
    figures,
    formed,
    smallest_gap,
    tool_forces,
    tool_history,
    touching,
    travels,
    turn_on_tool,
)
from skfem_textile.contact.figures import mirror_images
from skfem_textile.contact.risks import bridging, wrinkle_risk
from skfem_textile.contact.tool import deepest_of
from skfem_textile.io.results import fields_between_tools

R = 50.0
FORMULATIONS = [Macro(), OnePoint(), Full(), Quadratic()]


def square(formulation=None, terms=(), n=6, side=60.0):
    """Square ply in space, its first corner at the origin."""
    x = np.linspace(0, side, n + 1)
    mesh = MeshQuad.init_tensor(x, x).with_defaults()
    fabric = Fabric(10.0, 0.5, bending=(1.0, 1.0))
    return Ply(mesh, fabric, formulation or Full(), terms=terms, dimension=3)


def moved(ply, position):
    """Displacement to a position, a function of x and y."""
    X = np.pad(ply.nodes, ((0, 1), (0, 0)))
    return (np.array(np.broadcast_arrays(*position(*ply.nodes))) - X).T.ravel()


def bent(ply):
    """Displacement to a cylinder along y with the radius R, its top at z = 0."""
    return moved(ply, lambda x, y: (R * np.sin(x / R), y, R * np.cos(x / R) - R))


def on_cylinder(formulation=None, n=6):
    """Ply bent over a cylinder, the contact, and a state in which all nodes touch."""
    cylinder = drape.Cylinder(R, (0, 0, -R), (0, 1, 0))
    ply = square(formulation, [Tool(cylinder, side=1)], n)
    (contact,) = contacts(ply)
    ones = np.ones(ply.nodes.shape[1])
    values = Values({"force": contact.areas, "stiffness": 1e-6 * ones})
    state = replace(
        FLAT, u=bent(ply), parameters={**ply.parameters_at_rest, contact.name: values}
    )
    return ply, contact, state


def result_of(ply, u, **changes):
    """Result of a displaced ply, whose tools have no forces by default."""
    rest, tools = ply.parameters_at_rest, contacts(ply)
    state = replace(
        FLAT,
        u=u,
        parameters=rest | changes,
        reactions={tool.name: np.zeros(3) for tool in tools},
        displacements={},
    )
    return Result.of_state(ply, {}, state)


@pytest.fixture(scope="module", autouse=True)
def flat():
    """A state, whose displacement and parameters the tests replace."""
    global FLAT
    ply = square(terms=[Tool(drape.Plane(), side=1)], n=1)
    edges = {name: Condition(name) for name in ("left", "right", "top", "bottom")}
    FLAT = LoadStepper(ply, edges, steps=1).run().states[-1]


UP, DOWN, FAR = ({"motion": (0, 0, z)} for z in (6, -6, 40))
BACK = {"motion": (0, 0, -40)}
OPENINGS = {
    "punch and holder": ("punch", {"punch": UP}, {"punch": BACK, "holder": BACK}),
    "die": ("punch", {"punch": UP}, {"die": FAR}),
    "die over a punch": (
        "die",
        {"die": DOWN, "holder": DOWN},
        {"die": FAR, "holder": BACK},
    ),
    "gap": ("punch", {"punch": UP, "holder": {"gap": 0.2}}, {"holder": {"gap": 9}}),
}


@pytest.mark.parametrize(("driven", "closed", "opened"), OPENINGS.values())
def test_tools_open_further_than_the_punch_has_moved(driven, closed, opened):
    """The state before they open is described, by the tool that went deepest."""
    tools = [
        Tool(drape.Plane((30, 30, -0.1)), side=1, name="punch"),
        Tool(drape.Plane((30, 30, 0.1)), side=-1, name="die"),
        Holder(drape.Plane((30, 30, 0.1)), gap=0.4, side=-1, name="holder"),
    ]
    hold = Phase("hold", 1)
    process = Process([Phase("close", 1, closed), hold, Phase("o", 1, opened)], tools)
    states = [SimpleNamespace(load_factor=i / 3) for i in range(4)]
    result = SimpleNamespace(ply=square(terms=process.tools), states=states)
    assert figures.driven_tool(result) == driven
    assert figures.last_closed(result) == 2
    assert deepest_of(process.tools, result.ply.mesh.p) == driven
    directions = figures._directions(result)
    assert directions["holder"].tolist() == [0, 0, 1]  # pressed from below
    assert directions["die"][2] == (-1 if driven == "die" else 1)


@pytest.mark.parametrize("reached", [1, 2, 3])
def test_scene_and_result_name_the_same_driven_tool(reached):
    """The tool that reaches deepest in the whole run, however far a result goes."""
    tools = [
        Tool(drape.Plane((30, 30, -0.1)), side=1, name="punch"),
        Tool(drape.Plane((30, 30, 0.1)), side=-1, name="die"),
    ]
    phases = [
        Phase("shift", 1, {"die": {"motion": (0, 0, -2)}}),
        Phase("punch", 1, {"die": {"motion": (0, 0, 9)}, "punch": UP}),
    ]
    process = Process(phases, tools)
    states = [SimpleNamespace(load_factor=i / 2) for i in range(reached)]
    result = SimpleNamespace(ply=square(terms=process.tools), states=states)
    assert figures.driven_tool(result) == "punch"
    assert deepest_of(process.tools, result.ply.mesh.p) == "punch"


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_draw_in_of_a_quarter_is_along_the_planes_of_symmetry(formulation):
    """A rim whose edges move by a and b: these, and (a + b)/√2 at the corner."""
    ply = square(formulation)
    drawn = draw_in(ply, moved(ply, lambda x, y: (0.9 * x, 0.8 * y, x * y)))
    assert drawn.at(0.0) == pytest.approx(6.0)
    assert drawn.at(np.pi / 2) == pytest.approx(12.0)
    assert drawn.at(np.pi / 4) == pytest.approx(18 / np.sqrt(2))
    assert drawn.at(np.radians(20)) == pytest.approx(6.0)
    assert drawn.at(np.pi) is None
    stretched = moved(ply, lambda x, y: (1.1 * x, y, 0))
    assert draw_in(ply, stretched).at(0.0) == pytest.approx(-6.0)
    inner = (drawn.x.min(axis=0) == 0) & (drawn.x.max(axis=0) < 60)
    assert np.abs(drawn.inwards[inner]).max() < 1e-12


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_areal_weight_of_stretched_and_sheared_fibres(formulation):
    """m₀/(λ₁ λ₂ cos Γ) of fibres at right angles at rest."""
    ply, stretch, angle = square(formulation), (1.1, 0.9), np.radians(40.0)
    warp = stretch[0] * np.array([1, 0, 0])
    weft = np.array([np.sin(angle), 0.6 * np.cos(angle), 0.8 * np.cos(angle)])
    weft *= stretch[1]
    u = moved(ply, lambda x, y: [warp[i] * x + weft[i] * y for i in range(3)])
    expected = 1 / (stretch[0] * stretch[1] * np.cos(angle))
    assert areal_weight(ply, u, 300.0) == pytest.approx(300 * expected)


def test_thickness_at_constant_fibre_fraction_where_a_tool_states_it():
    """A ply of 0.4 mm whose area decreases by a fifth is 0.5 mm thick."""
    for thickness, expected in ((0.4, 0.5), (0.0, None)):
        plane = Tool(drape.Plane((0, 0, -1.0)), side=1, thickness=thickness)
        ply = square(terms=[plane])
        result = result_of(ply, moved(ply, lambda x, y: (0.8 * x, y, 0)))
        figures = formed(result)
        for most in ("max", "min"):
            name = f"{most}_thickness_at_constant_fibre_fraction_mm"
            assert figures.get(name) == (expected and pytest.approx(expected))
        cells = fields_between_tools(ply, result.states[-1])[1]
        field = cells.get("thickness_at_constant_fibre_fraction")
        assert (field is None) == (expected is None)
        assert field is None or field == pytest.approx(expected)


@pytest.mark.parametrize("formulation", [Macro(), Full()])
def test_penetration_between_nodes_is_the_sagitta(formulation):
    ply, contact, state = on_cylinder(formulation)
    least = smallest_gap(ply, contact, state.u, 1.0)
    side = np.ptp(ply.mesh.p[0, ply.mesh.t], axis=0).max()
    assert least.gap == pytest.approx(R * np.cos(side / (2 * R)) - R)
    assert np.hypot(least.place[0], least.place[2] + R) - R == pytest.approx(least.gap)
    corners = ply.mesh.p[:, ply.mesh.t[:, least.element]]
    at = R * np.arcsin(least.place[0] / (R + least.gap))
    assert corners[0].min() <= at <= corners[0].max()
    assert np.abs(contact.gaps_at(ply.positions(state.u), 1.0)).max() < 1e-12


def test_quadratic_plies_are_checked_at_nodes_without_contact():
    """Corners of quadratic triangles touch no tool, but are points of the ply."""
    ply, contact, state = on_cylinder(Quadratic())
    u = state.u.copy()
    u[3 * 10 + 2] -= 0.5
    least = smallest_gap(ply, contact, u, 1.0)
    x = ply.nodal(u)[:, 10] + [*ply.nodes[:, 10], 0]
    assert least.place == pytest.approx(x)
    assert 10 in ply.mesh.t[:, least.element]
    assert contact.gaps(u, 1.0).min() > -1e-9


def test_a_tool_out_of_reach_has_no_gap():
    outline = [[100.0, 110.0, 110.0], [100.0, 100.0, 110.0]]
    ply = square(terms=[Tool(drape.Plane((0, 0, -1)), side=1, outline=outline)])
    assert smallest_gap(ply, contacts(ply)[0], ply.basis.zeros(), 1.0) is None


def test_elements_that_do_not_touch_have_no_turn():
    ply, contact, state = on_cylinder()
    force = np.where(ply.nodes[0] < 15, 1.0, 0.0)
    stiffness = 1e-20 * np.ones_like(force)
    values = Values({"force": force, "stiffness": stiffness})
    state = replace(state, parameters={**ply.parameters_at_rest, contact.name: values})
    turned = turn_on_tool(ply, contact, state) > 0
    near = ply.mesh.p[0, ply.mesh.t].min(axis=0) < 15
    assert (turned == near).all()
    assert (touching(ply, contact, state) == near).all()


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_curvature_of_fibres_over_a_cylinder(formulation):
    """1/R along the warp, 0 along the weft, up to the edges."""
    ply = square(formulation)
    curvature = fibre_curvature(ply, bent(ply))
    x, y = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    inside = (np.minimum(x, y) > 12) & (np.maximum(x, y) < 48)
    assert curvature[0, inside] == pytest.approx(-1 / R, rel=0.01)
    assert np.abs(curvature[1, inside]).max() < 1e-4 / R


def test_forces_of_the_tools_balance_over_the_travel(hemisphere):
    travel, force = travels(hemisphere), tool_forces(hemisphere)
    assert travel["punch"] == pytest.approx([0.0, 5.0, 10.0, 15.0])
    assert not np.any(travel["die"])
    assert (np.diff(force["punch"]) > 0).all()
    balance = force["punch"] + force["die"] + force["holder"]
    assert np.abs(balance).max() < 1e-6 * force["punch"].max()


def test_a_printed_run_has_the_travel_of_the_tools_that_move(hemisphere):
    head, *rows = str(hemisphere).splitlines()
    assert head.startswith("load factor  punch (mm)      solves ")
    assert "die" not in head
    assert [row.split()[1] for row in rows[:4]] == ["0.00", "5.00", "10.00", "15.00"]
    assert all(row.endswith("yes") and len(row) == len(head) for row in rows[1:4])


def test_history_of_the_tools_agrees_with_summary_and_contacts(hemisphere):
    history, figures = tool_history(hemisphere), formed(hemisphere)
    for column in history:
        assert figures[column] == history[column][-1]
    for contact in contacts(hemisphere.ply):
        touched = history[f"{contact.name}_nodes_in_contact"]
        for n, state in zip(touched, hemisphere.states, strict=True):
            p = state.parameters[contact.name]
            gaps = contact.gaps(state.u, state.load_factor, p)
            assert n <= (gaps < 1e-6).sum()
        pressure = history[f"{contact.name}_max_pressure_N_per_mm2"]
        assert ((pressure > 0) == (touched > 0)).all()
    punched = history["punch_nodes_in_contact"]
    assert punched[0] == 0 < punched[1] <= punched[3]


def test_forces_of_tools_that_return_are_along_their_longest_travel():
    """A wall that moves along x and back: the normal force has no part along x."""
    wall = Tool(
        drape.Plane((0, 0, -1.0)),
        motion=lambda t: (4 * t * (1 - t), 0.0, 0.0),
        side=1,
        name="wall",
    )
    ply = square(terms=[wall], n=1)
    result = result_of(ply, ply.basis.zeros())
    (state,) = result.states
    pressed = replace(state, reactions={"wall": np.eye(3)[2]})
    states = [replace(pressed, load_factor=t) for t in (0.0, 0.5, 1.0)]
    result = replace(result, states=states)
    assert travels(result)["wall"].tolist() == [0.0, 1.0, 0.0]
    assert tool_forces(result)["wall"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("axis", "phases", "travel", "units"),
    [
        ((0, 0, 1), [("rotation", 1.2), ("motion", (0, 0, 0))], [0, 0, 0], ["°"]),
        ((0, 1, 0), [("motion", (0, 0, 4)), ("rotation", 1.2)], [0, 4, 4], ["mm", "°"]),
    ],
    ids=["disc", "drum"],
)
def test_the_travel_of_a_tool_that_turns_is_that_of_its_axis(
    axis, phases, travel, units
):
    """So is the direction of the forces; z if no axis moves."""
    tool = Tool(drape.Plane((0, 0, -1.0)), side=1, name="disc")
    every = [Phase(name, 1, {"disc": {name: end}}) for name, end in phases]
    (turning,) = Process(every, [tool], {"disc": (axis, (60, 0, 0))}).tools
    ply = square(terms=[turning], n=1)
    result = result_of(ply, ply.basis.zeros())
    pressed = replace(result.states[0], reactions={"disc": np.array([5.0, 0.0, 4.0])})
    states = [replace(pressed, load_factor=t) for t in (0.0, 0.5, 1.0)]
    result = replace(result, states=states)
    assert travels(result)["disc"] == pytest.approx(travel, abs=1e-12)
    assert tool_forces(result)["disc"] == pytest.approx(4.0)
    assert [motion.unit for motion in result.tool_motions(1.0)] == units


def test_a_ply_without_tools_has_no_tool_forces():
    ply = square(n=1)
    with pytest.raises(ValueError, match="no tools or holders"):
        tool_forces(result_of(ply, ply.basis.zeros()))


def test_summary_of_a_formed_ply(hemisphere):
    figures = formed(hemisphere)
    state = hemisphere.states[-1]
    assert figures["punch_travel_mm"] == pytest.approx(15.0)
    assert figures["punch_force_N"] == pytest.approx(state.reactions["punch"][2])
    whole = figures["punch_force_on_whole_ply_N"]
    assert whole == pytest.approx(4 * figures["punch_force_N"])
    x = hemisphere.ply.nodal(state.u)
    (tip,) = np.flatnonzero((hemisphere.ply.nodes.T == (60, 0)).all(axis=1))
    assert figures["draw_in_at_0_deg_mm"] == pytest.approx(-x[0, tip])
    assert figures["max_draw_in_mm"] == pytest.approx(-x[0, tip])
    assert figures["max_penetration_tool"] == "die"
    die = contacts(hemisphere.ply)[1]
    deepest = smallest_gap(hemisphere.ply, die, state.u, 1.0).gap
    assert figures["die_penetration_mm"] == pytest.approx(-deepest)
    assert figures["max_areal_weight_ratio"] == pytest.approx(
        1 / hemisphere.ply.area_ratio(state.u).min(), rel=1e-3
    )
    assert "coarse_elements" not in figures
    assert "not_formed" not in figures
    assert "untouched_tools" not in figures
    numbers = [x for x in figures.values() if not isinstance(x, str | list)]
    assert np.isfinite(numbers).all()


@pytest.mark.parametrize(
    ("planes", "copies"),
    [
        ([], 1),
        (["left"], 2),
        (["left", "bottom"], 4),
        (["left", "right"], 0),
        (["left", "bottom", "top"], 0),
    ],
)
def test_mirror_images_of_a_part_fit_together_or_are_not_counted(planes, copies):
    ends = dict.fromkeys(planes, "mirror")
    ply = Ply(square(n=1).mesh, Fabric(1.0), dimension=3, fibre_ends=ends)
    assert mirror_images(ply) == copies


@pytest.mark.parametrize(("rise", "copies"), [(3e-7, 4), (3e-6, 0)])
def test_planes_of_symmetry_are_at_right_angles(rise, copies):
    mesh = MeshQuad(np.array([[0, 1, 1, 0], [0, rise, 1, 1]]), np.arange(4)[:, None])
    sides = {"left": lambda x: x[0] < 0.1, "bottom": lambda x: x[1] < 0.1}
    ends = dict.fromkeys(sides, "mirror")
    mesh = mesh.with_boundaries(sides)
    ply = Ply(mesh, Fabric(1.0), Full(), dimension=3, fibre_ends=ends)
    assert mirror_images(ply) == copies


@pytest.mark.parametrize(("radius", "bridges"), [(3e4, True), (3e5, False)])
def test_a_ply_bridges_a_tool_that_pulls_it_at_a_radius(radius, bridges):
    """Relative to its size: on a flatter tool the pressure is round-off."""
    ply = square(n=1)
    u = moved(ply, lambda x, y: (1.1 * x, y, 0))
    pull = ply.fibre_tension(u).max() / (radius * 60.0)
    assert bridging(ply, u, np.full(4, -pull)).all() == bridges


@pytest.mark.parametrize(("share", "is_at_risk"), [(3e-9, False), (3e-8, True)])
def test_compression_is_at_risk_beyond_the_wrinkling_angle(share, is_at_risk):
    """Relative to the tension of the other family, of which a share is round-off."""
    flat = square(n=1)
    ply = Ply(flat.mesh, Fabric(10.0, 0.5, wrinkling_angle=0.5), Full(), dimension=3)
    shortened = 1.0 - share * np.log(1.1)
    u = moved(ply, lambda x, y: (1.1 * x + 0.8 * shortened * y, 0.6 * shortened * y, 0))
    assert wrinkle_risk(ply, u).all() == is_at_risk


def test_a_tool_that_touches_the_ply_in_no_state_is_named():
    far = Tool(drape.Plane((0, 0, 500.0)), side=-1, name="far")
    ply = square(terms=[Tool(drape.Plane(), side=1, name="table"), far], n=1)
    on_table = Values({"force": np.ones(4), "stiffness": np.ones(4)})
    figures = formed(result_of(ply, ply.basis.zeros(), table=on_table))
    assert figures["untouched_tools"].startswith("no state touches 'far':")


def test_a_tool_that_touches_later_is_not_named():
    ply = square(terms=[Tool(drape.Plane(), side=1, name="table")], n=1)
    pressed = Values({"force": np.ones(4), "stiffness": np.ones(4)})
    result = result_of(ply, ply.basis.zeros(), table=pressed)
    none = Values({"force": np.zeros(4), "stiffness": np.zeros(4)})
    (away,) = result_of(ply, ply.basis.zeros(), table=none).states
    of_two = replace(result, states=[away, result.states[0]])
    assert "untouched_tools" not in formed(of_two.until(0))
    assert "untouched_tools" in formed(replace(result, states=[away]))


def test_a_fillet_under_large_elements_is_a_warning():
    ply, _, state = on_cylinder(n=1)
    figures = formed(Result.of_state(ply, {}, state))
    assert figures["max_turn_of_normal_deg"] == pytest.approx(np.degrees(60 / R))
    assert "use elements of 44% of the size" in figures["coarse_elements"]


def test_a_ply_without_tools_has_no_figures():
    ply = square()
    assert formed(result_of(ply, ply.basis.zeros())) == {}


def test_a_run_that_stops_describes_the_ply_at_its_travel(stopped):
    figures = formed(stopped.result)
    assert "punch moved by 5 mm" in str(stopped)
    assert figures["punch_travel_mm"] == pytest.approx(5.0)
    assert figures["punch_force_N"] > 0
    assert "punch 5 of 35 mm" in figures["not_formed"]
    (punch, *_) = contacts(stopped.result.ply)
    state = stopped.result.states[-1]
    assert np.abs(punch.gaps(state.u, state.load_factor).min()) < 1e-6


@pytest.mark.parametrize(("bending", "curvature"), [((1, 0), 1 / R), ((0, 1), 0.0)])
def test_only_fibres_with_bending_stiffness_have_a_largest_curvature(
    bending, curvature
):
    """The warp follows a cylinder, the weft is straight."""
    ply = square()
    ply = Ply(ply.mesh, Fabric(10.0, 0.5, bending=bending), Full(), dimension=3)
    state = SimpleNamespace(u=bent(ply))
    (largest,) = figures._curvature(ply, state, []).values()
    assert largest == pytest.approx(curvature, rel=0.02, abs=1e-12)
