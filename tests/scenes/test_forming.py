"""Scenes of forming: figures of the hemisphere, symmetry, files, bad input."""

import csv
import json
import re
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import Delaunay
from skfem import MeshQuad

from skfem_textile import Fabric, OnePoint
from skfem_textile.cli import main as cli
from skfem_textile.contact import Compaction, contacts
from skfem_textile.drape import TriangleMesh
from skfem_textile.io import read_surface
from skfem_textile.scenes import (
    Case,
    double_dome_forming,
    forming,
    hemisphere_forming,
)
from skfem_textile.scenes.forming import _measured, _refuse_units
from tests.helpers import graph

CELLS = {"size": (3, 3)}


def case(scene, steps=1, bending=5.0, formulation=None):
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(bending, bending))
    more = {"formulation": formulation} if formulation else {}
    return Case(scene=scene, fabric=fabric, steps=steps, **more)


def summary(scene, steps=1, bending=5.0):
    run = case(scene, steps, bending, OnePoint())
    return run.summary(run.run())


def smallest_gap(result, tool):
    (contact,) = [term for term in result.ply.terms if term.name == tool]
    return contact.gaps(result.u, 1.0).min()


def test_the_tools_push_the_ply_to_the_full_travel():
    scene = hemisphere_forming(travel=20.0, size=(2, 2))
    run = case(scene, formulation=OnePoint())
    result = run.run()
    state, figures = result.states[-1], run.summary(result)
    assert figures["converged"]
    assert scene.driven_displacement(state).tolist() == [0, 0, 20.0]
    assert scene.reaction(state)[2] == pytest.approx(figures["reaction_z"])
    assert figures["reaction_z"] > 1
    u = result.ply.nodal(state.u)
    centre = np.hypot(*result.ply.nodes).argmin()
    (punch,) = (term for term in result.ply.terms if term.name == "punch")
    assert abs(punch.gaps(state.u, 1.0)[centre]) < 1e-6
    assert (punch.points @ u[2])[centre] == pytest.approx(20.0 - 0.15, abs=1e-6)


def test_the_clearance_is_between_punch_and_die():
    """Measured in the plane of the ply, from the punch that has passed it."""
    scene = hemisphere_forming(radius=40.0, clearance=3.0, travel=60.0)
    punch, die, _ = (tool.surface for tool in scene.tools)
    x = np.array([[41.0, 43.0], [0.0, 0.0], [-90.0, 20.0]])
    assert punch.level(x)[0] == pytest.approx(1.0)  # of the shaft below the hemisphere
    assert die.level(x)[1] == pytest.approx(0.0, abs=1e-12)


def test_the_ply_is_pulled_along_the_fibres_at_any_angle():
    """The resultant on an edge is the tension times its length, for ±45° too."""
    for fibres in (0.0, np.pi / 4):
        scene = hemisphere_forming(fibres=fibres, **CELLS)
        ply = case(scene).ply()
        (tension,) = [term for term in ply.terms if term.name == "edge tension"]
        force = -ply.nodal(tension.residual(ply.basis.zeros(), 0.5, {}))
        right = ply.nodes[0] > 150 - 1e-9
        inner = right & (ply.nodes[1] < 150 - 1e-9)
        assert force[0, right].sum() == pytest.approx(0.2 * 150)
        assert np.abs(force[1, inner]).max() < 1e-12


@pytest.mark.dear("the whole ply and its quarter are two runs")
def test_a_quarter_agrees_with_the_whole_ply():
    """To round-off without bending, which differs at the planes of symmetry."""
    quarter = summary(hemisphere_forming(travel=5.0, size=(2, 2)), bending=0.0)
    scene = hemisphere_forming(travel=5.0, size=(4, 4), part="whole")
    whole = summary(scene, bending=0.0)
    assert whole["reaction_z"] == pytest.approx(4 * quarter["reaction_z"], rel=1e-8)
    for name in ("max_shear_angle_deg", "max_fibre_strain"):
        assert whole[name] == pytest.approx(quarter[name], rel=1e-7)
    assert whole["max_holding_force_N"] < 1e-6
    assert "max_holding_force_N" not in quarter
    assert "held" not in whole


def test_fibres_at_any_angle_have_no_holding_force():
    scene = hemisphere_forming(travel=2.0, fibres=0.3, size=(2, 2))
    figures = summary(scene)
    assert scene.fibre_ends == {}
    assert figures["max_holding_force_N"] < 1e-6


def test_a_ply_beside_the_axis_of_the_tools_is_held_and_says_so():
    square = MeshQuad().refined(1).translated((-0.5, -0.5)).scaled(160.0)
    mesh = square.translated((9.0, 0.0)).with_defaults()
    scene = hemisphere_forming(mesh, radius=30.0, travel=2.0, part="whole")
    assert "held" in summary(scene)


def test_forces_that_hold_are_compared_with_the_largest_force_of_the_run():
    """At the end of a process the tools may be open."""
    states = [
        SimpleNamespace(reactions={"centre": np.full(3, 0.01), "punch": np.full(3, F)})
        for F in (0.0, 9.0, 1e-12)
    ]
    tool = contacts(case(hemisphere_forming(size=(2, 2))).ply())[0]
    result = SimpleNamespace(states=states, ply=SimpleNamespace(terms=[tool]))
    assert "held" not in _measured(result, ["centre"])
    states[1].reactions["punch"] = np.full(3, 0.5)
    text = "2% of the largest force of a tool in the run"
    assert text in _measured(result, ["centre"])["held"]


@pytest.mark.parametrize("scene", [hemisphere_forming, double_dome_forming])
def test_a_centre_places_the_ply_in_the_axes_of_the_tools(scene):
    square = MeshQuad().refined(2).translated((-0.5, -0.5)).scaled(200.0)
    moved = scene(square.with_defaults(), travel=2.0, centre=(7.0, -5.0))
    beside = square.translated((7.0, -5.0)).with_defaults()
    still = scene(beside, travel=2.0, part="whole")
    for a, b in zip(moved.tools, still.tools, strict=True):
        here = np.vstack([square.p, 0.0 * square.p[:1]])
        there = np.vstack([beside.p, 0.0 * beside.p[:1]])
        assert np.allclose(a.surface.level(here)[0], b.surface.level(there)[0])
        assert np.allclose(a.stated(here), there)


@pytest.mark.dear("a run over the full travel of 60 mm")
def test_a_double_dome_is_formed_to_its_full_travel():
    scene = double_dome_forming(size=(3, 2))
    result = case(scene, formulation=OnePoint()).run()
    assert result.converged
    assert smallest_gap(result, "punch") == pytest.approx(0.0, abs=1e-6)
    assert result.states[-1].displacements["punch"].tolist() == [0, 0, 60]
    assert result.states[-1].reactions["punch"][2] > 10


SMALL = {"width": 100.0, "height": 100.0, "size": (3, 3)}


@pytest.fixture(scope="module")
def filed(files):
    """A case whose tools are files, and its result."""
    scene = forming(*map(read_surface, files), travel=4.0, **QUARTER)
    run = case(scene, formulation=OnePoint())
    return run, run.run()


QUARTER = SMALL | {"part": "quarter", "gap": 1.0}


def test_tools_from_files_stay_in_their_axes(files, filed):
    (run, result), (_, die) = filed, map(read_surface, files)
    axes, figures = run.scene.axes, run.summary(result)
    assert axes.origin[2] == pytest.approx(die.facets.points[2].min() - 0.5)
    assert result.converged
    assert smallest_gap(result, "punch") == pytest.approx(0.0, abs=1e-6)
    x = result.ply.nodal(result.u)[2] + axes.origin[2]
    assert x.min() <= figures["max_penetration_at_z_mm"] <= x.max()


def test_places_in_messages_are_in_the_axes_of_the_files(files):
    """The plane of the ply is z = 499.5 there, and its centre is at x = 3."""
    punch, die = map(read_surface, files)
    place = r"at \(([-\d.e]+), ([-\d.e]+), ([-\d.e]+)\) mm"
    scene = forming(punch, die, travel=36.0, gap=1.0, centre=(3.0, 0.0), **SMALL)
    with pytest.raises(ValueError, match=f"no room for the ply .*{place}") as error:
        case(scene).run()
    at = [float(x) for x in re.search(place, str(error.value)).groups()]
    assert at[2] == 499.5
    assert np.abs(at[:2]).max() <= 53.0


def test_a_punch_that_moves_down_mirrors_one_that_moves_up(files, filed):
    turned = np.diag([1.0, -1.0, -1.0])
    tools = (read_surface(file).moved(np.zeros(3), turned) for file in files)
    other = summary(forming(*tools, travel=-4.0, **QUARTER))["reaction_z"]
    one = filed[0].scene.reaction(filed[1].states[-1])[2]
    # The triangles are not symmetric about y = 0.
    assert other == pytest.approx(-one, rel=1e-3)
    assert one > 0.1


@pytest.mark.dear("a fillet of a flange over whose edge a holder may push")
@pytest.mark.parametrize(
    ("up", "pressure", "n", "force"),
    [pytest.param(1, 0.02, 10, 1.568, marks=pytest.mark.slow), (-1, 10.0, 5, 0.534)],
)
def test_a_holder_presses_on_the_flange_of_the_die(flanged, up, pressure, n, force):
    """With the pressure times the area there, not over the opening.

    It does not push the ply over the edge of the flange, which is smoothed.
    """
    moved = np.zeros(3), np.diag([1.0, -1.0, -1.0])
    tools = flanged if up > 0 else [tool.moved(*moved) for tool in flanged]
    options = {"pressure": pressure, "part": "quarter"} | SMALL | {"size": (n, n)}
    run = case(forming(*tools, travel=float(n * up), **options))
    result = run.run()
    figures = run.summary(result)
    x = result.ply.nodes + result.ply.nodal(result.u)[:2]
    (die,) = [term for term in result.ply.terms if term.name == "die"]
    far, some = (pressure * die.areas[np.hypot(*x) > r].sum() for r in (55, 49))
    assert 0 < far <= abs(figures["holder_force_N"]) <= some
    assert figures["holder_force_N"] * figures["punch_force_N"] > 0
    forces = [figures[f"{name}_force_N"] for name in ("punch", "die", "holder")]
    assert sum(forces) == pytest.approx(0.0, abs=1e-6)
    assert abs(forces[0]) == pytest.approx(force, rel=2e-3)


def test_without_pressure_a_holder_has_no_force(flanged):
    options = SMALL | {"part": "quarter", "pressure": 0.0}
    figures = summary(forming(*flanged, travel=1.0, **options))
    assert figures["converged"]
    assert figures["holder_force_N"] == 0
    assert figures["punch_force_N"] == pytest.approx(-figures["die_force_N"])


@pytest.mark.parametrize(
    ("build", "edge"), [(hemisphere_forming, 50.0), (double_dome_forming, 80.0)]
)
def test_a_holder_of_a_scene_presses_beyond_the_opening_with_its_force(build, edge):
    """Beyond the fillet, or where the die is flat; beside the centre of the ply too."""
    options = {"radius": 40.0} if build is hemisphere_forming else {}
    for centre in (0.0, 0.0), (10.0, 0.0):
        scene = build(
            **{"width": 240.0, "height": 300.0, "size": (6, 6), "part": "whole"},
            **options,
            centre=centre,
            force=5.0,
            compaction=Compaction(0.3, 1e-3, 8.0),
        )
        ply = case(scene).ply()
        (holder,) = (x for x in ply.terms if x.name == "holder")
        p = ply.parameters_at_rest["holder"]
        force = holder.forces(ply.basis.zeros(), 0.0, p)
        assert force.sum() == pytest.approx(5.0)
        x, y = ply.nodes[:, force > 0] + np.array(centre)[:, None]
        element = 300 / 12
        assert np.hypot(x, y).min() > edge - element
        assert np.abs(y).max() == pytest.approx(150.0)


def irregular(height, radius, rng, offset=0.0):
    """Triangles of random vertices, 3 mm apart, with a ragged outline."""
    s = np.arange(-radius, radius, 3.0)
    x = np.array([a.ravel() for a in np.meshgrid(s, s)])
    x = (x + rng.uniform(-0.9, 0.9, x.shape))[:, np.hypot(*x) < radius]
    t = Delaunay(x.T).simplices
    edges = x[:, t] - x[:, np.roll(t, 1, axis=1)]
    t = t[np.hypot(*edges).max(axis=1) < 6.0]
    used, t = np.unique(t, return_inverse=True)
    x = x[:, used]
    z = height(np.hypot(x[0] - offset, x[1]))
    return TriangleMesh(np.array([*x, z]), t.reshape(-1, 3).T)


@pytest.mark.parametrize("offset", [0.0, 1.0])
def test_irregular_triangles_of_a_symmetric_tool_suffice_for_a_quarter(offset):
    """A cavity with fillets of 10 mm; not one that is 1 mm beside the axis."""
    rng = np.random.default_rng(0)

    def cavity(r):
        inner = np.sqrt(35.0**2 - np.minimum(r, 28.0) ** 2) - 21.0
        outer = 10.0 - np.sqrt(100.0 - np.clip(36.0 - r, 0.0, 8.0) ** 2)
        return np.where(r < 28.0, inner + 4.0, outer)

    die = irregular(cavity, 60.0, rng, offset)
    punch = irregular(lambda r: np.sqrt(60.0**2 - r**2) - 60.5, 45.0, rng)
    scene = forming(punch, die, travel=10.0, part="quarter", **SMALL)
    if not offset:
        case(scene).stepper()
        return
    with pytest.raises(ValueError, match="'die' is not symmetric about the boundary"):
        case(scene).stepper()


def test_sides_of_tools_with_sharp_edges_are_known():
    """The smooth surface bulges beyond both, into the ply, at rest."""

    def pyramid(x, y, top, most):
        r = np.maximum(np.abs(x), np.abs(y))
        return np.clip(2.0 * (top - r), 0.0, most)

    s = np.linspace(-90.0, 90.0, 19)
    die = TriangleMesh(*graph(s, lambda x, y: pyramid(x, y, 50.0, 30.0)))
    punch = graph(0.6 * s, lambda x, y: pyramid(x, y, 50.0, 40.0) - 40.3)
    scene = forming(TriangleMesh(*punch), die, travel=2.0, part="quarter", **SMALL)
    for tool in scene.tools[:2]:
        with pytest.raises(ValueError, match="crosses the undeformed ply"):
            case(replace(scene, tools=(replace(tool, side=None),))).ply()
    assert case(scene).stepper()


def test_a_quarter_of_the_tools_suffices_for_a_quarter_of_the_ply(tmp_path):
    x, t = graph(np.linspace(0.0, 60.0, 13), lambda x, y: -(x**2 + y**2) / 200 - 0.5)
    punch = TriangleMesh(x, t)
    die = TriangleMesh(x + np.array([[0.0], [0.0], [36.5]]), t)
    scene = forming(punch, die, travel=5.0, part="quarter", **SMALL)
    assert case(scene).stepper()


def test_the_side_of_the_triangles_does_not_matter(files):
    punch, die = map(read_surface, files)
    scene = forming(punch, die, travel=20.0, gap=1.0, **SMALL)
    x, (triangles,) = punch.facets.points, punch.facets.cells
    other = forming(
        TriangleMesh(x, triangles[::-1]), die, travel=20.0, gap=1.0, **SMALL
    )
    gaps = []
    for one in (scene, other):
        ply = case(one).ply()
        (contact,) = [term for term in ply.terms if term.name == "punch"]
        gaps.append(contact.gaps(ply.basis.zeros(), 0.5))
    np.testing.assert_allclose(*gaps, atol=1e-9)
    assert gaps[0].min() < -9


#: Pictures of a ply between tools.
DRAWN = (
    *("fibre_strain", "shear_angle", "fibre_directions", "animation"),
    *("formed", "section", "tool_force"),
)


def run(*words):
    return cli.main(["run", *map(str, words)])


@pytest.mark.dear("two runs of the command")
def test_forming_runs_from_the_command_line(files, tmp_path, monkeypatch):
    plot, out = pytest.importorskip("skfem_textile.plot"), tmp_path / "out"
    for picture in DRAWN:
        monkeypatch.setattr(plot, picture, lambda _, filename: filename.touch())
    punch, die = files
    ply = "--width", 100, "--height", 100, "--size", "2x2", "--part", "quarter"
    tools = "--punch", punch, "--die", die, "--travel", 4, "--holder-gap", 1
    assert run("forming", *tools, *ply, "--steps", 1, "--out", out) == 0
    figures = json.loads((out / "summary.json").read_text())
    assert figures["converged"]
    assert figures["inputs"]["scene"]["punch"] == [punch]
    with open(out / "history.csv", newline="") as file:
        history = [*csv.DictReader(file)]
    assert "punch_reaction_z" in history[0]
    for name in ("punch", "die", "holder"):
        for what in (
            "travel_mm",
            "force_N",
            "nodes_in_contact",
            "max_pressure_N_per_mm2",
        ):
            last = float(history[-1][f"{name}_{what}"])
            assert last == pytest.approx(figures[f"{name}_{what}"], rel=1e-11)
    last = (out / "curve.csv").read_text().splitlines()[-1].split(",")
    assert float(last[0]) == 4.0
    assert float(last[1]) == pytest.approx(figures["reaction_z"], rel=1e-11)
    written = {file.name for file in out.rglob("*")}
    assert {"tool_force.png", "animation.gif", "shear_angle.png"} <= written
    assert "load.png" not in written  # the same curve
    assert {"punch.stl", "die.stl", "steps.pvd"} <= written
    again = tmp_path / "again"
    assert run(out / "case.toml", "--out", again, "--no-render") == 0
    same = json.loads((again / "summary.json").read_text())
    assert same["reaction_z"] == figures["reaction_z"]


@pytest.mark.parametrize(
    ("ratio", "text"), [(15.0, ""), (25.0, "the punch extends over 25 mm and the die")]
)
def test_a_punch_and_a_die_in_two_units_are_refused(ratio, text):
    punch, die = (
        SimpleNamespace(facets=SimpleNamespace(points=np.diag([x, 1.0, 1.0])))
        for x in (ratio, 1.0)
    )
    with pytest.raises(ValueError, match=text) if text else nullcontext():
        _refuse_units(punch, die)
