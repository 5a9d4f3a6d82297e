"""Scenes of forming: figures of the hemisphere, symmetry, files, bad input."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import Delaunay
from skfem import MeshQuad

from skfem_textile import Fabric
from skfem_textile.cli import main as cli
from skfem_textile.drape import TriangleMesh
from skfem_textile.io import read_surface
from skfem_textile.scenes import (
    Case,
    double_dome_forming,
    forming,
    hemisphere_forming,
)
from tests.helpers import graph

CELLS = {"size": (4, 4)}


def case(scene, steps=1, bending=5.0):
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(bending, bending))
    return Case(scene=scene, fabric=fabric, steps=steps)


def summary(scene, steps=1, bending=5.0):
    run = case(scene, steps, bending)
    return run.summary(run.run())


def smallest_gap(result, tool):
    (contact,) = [term for term in result.ply.terms if term.name == tool]
    return contact.gaps(result.u, 1.0).min()


def test_the_tools_push_the_ply_to_the_full_travel():
    scene = hemisphere_forming(travel=40.0, **CELLS)
    result = case(scene).run()
    state, figures = result.states[-1], case(scene).summary(result)
    assert figures["converged"]
    assert scene.driven_displacement(state).tolist() == [0, 0, 40.0]
    assert scene.reaction(state)[2] == pytest.approx(figures["reaction_z"])
    assert figures["reaction_z"] > 5
    u = result.ply.nodal(state.u)
    centre = np.hypot(*result.ply.nodes).argmin()
    assert u[2, centre] == pytest.approx(40.0 - 0.15, abs=1e-6)


def test_a_smaller_clearance_bends_the_ply_more_sharply():
    """The free ply between punch and die is shorter, and the force is larger."""
    narrow, wide = (
        summary(hemisphere_forming("aligned", travel=30.0, clearance=c, **CELLS))
        for c in (2.0, 20.0)
    )
    assert narrow["punch_force_N"] > 1.01 * wide["punch_force_N"]


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


def test_a_quarter_agrees_with_the_whole_ply():
    """To round-off without bending, which differs at the planes of symmetry."""
    quarter = summary(hemisphere_forming(travel=25.0, size=(4, 4)), bending=0.0)
    scene = hemisphere_forming(travel=25.0, size=(8, 8), part="whole")
    whole = summary(scene, bending=0.0)
    assert whole["reaction_z"] == pytest.approx(4 * quarter["reaction_z"], rel=1e-8)
    for name in ("max_shear_angle_deg", "max_fibre_strain"):
        assert whole[name] == pytest.approx(quarter[name], rel=1e-7)
    assert whole["max_holding_force_N"] < 1e-6
    assert "max_holding_force_N" not in quarter


def test_fibres_at_any_angle_have_no_holding_force():
    scene = hemisphere_forming(travel=25.0, size=(6, 6), fibres=0.3)
    figures = summary(scene)
    assert scene.fibre_ends == {}
    assert figures["max_holding_force_N"] < 1e-6


@pytest.mark.parametrize(("shift", "is_held"), [(0.0, False), (9.0, True)])
def test_a_ply_beside_the_axis_of_the_tools_is_held_and_says_so(shift, is_held):
    mesh = MeshQuad().refined(2).translated((-0.5, -0.5)).scaled(160.0)
    mesh = mesh.translated((shift, 0.0)).with_defaults()
    options = {"radius": 30.0, "travel": 20.0, "part": "whole"}
    figures = summary(hemisphere_forming(mesh, **options))
    assert ("held" in figures) is is_held


def test_a_punch_that_travels_beyond_its_hemisphere_has_a_shaft():
    """Below the hemisphere the ply is at least one radius away from the axis."""
    scene = hemisphere_forming(radius=20.0, travel=35.0, **CELLS, width=120, height=120)
    result = case(scene, 3).run()
    assert result.converged
    x = result.ply.positions(result.u)
    beside = x[:, x[2] < 35.0 - 0.15 - 20.0]
    assert np.hypot(*beside[:2]).min() >= 20.0 - 1e-6


def test_a_double_dome_is_formed_to_its_full_travel():
    result = case(double_dome_forming(size=(6, 4)), 2).run()
    assert result.converged
    assert smallest_gap(result, "punch") == pytest.approx(0.0, abs=1e-6)
    assert result.states[-1].displacements["punch"].tolist() == [0, 0, 60]
    assert result.states[-1].reactions["punch"][2] > 10


SMALL = {"width": 100.0, "height": 100.0, "size": (4, 4)}


def test_tools_from_files_stay_in_their_axes(files):
    punch, die = map(read_surface, files)
    scene = forming(punch, die, travel=20.0, gap=1.0, part="quarter", **SMALL)
    lowest = die.facets.points[2].min()
    assert scene.axes.origin[2] == pytest.approx(lowest - 0.5)
    run = case(scene)
    result = run.run()
    assert result.converged
    assert smallest_gap(result, "punch") == pytest.approx(0.0, abs=1e-6)
    x = result.ply.nodal(result.u)[2] + scene.axes.origin[2]
    figures = run.summary(result)
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


def test_a_punch_that_moves_down_mirrors_one_that_moves_up(files):
    punch, die = map(read_surface, files)
    options = SMALL | {"gap": 1.0, "part": "quarter", "size": (3, 3)}
    one = summary(forming(punch, die, travel=8.0, **options))
    turned = np.diag([1.0, -1.0, -1.0])
    punch, die = (tool.moved(np.zeros(3), turned) for tool in (punch, die))
    other = summary(forming(punch, die, travel=-8.0, **options))
    # The triangles are not symmetric about y = 0.
    assert other["reaction_z"] == pytest.approx(-one["reaction_z"], rel=1e-3)
    assert one["reaction_z"] > 0.1


@pytest.mark.parametrize(
    ("up", "pressure"), [pytest.param(1, 0.02, marks=pytest.mark.slow), (-1, 10.0)]
)
def test_a_holder_presses_the_ply_on_the_flange_of_the_die(flanged, up, pressure):
    """With the pressure times the area there, not over the opening.

    It does not push the ply over the edge of the flange, which is smoothed.
    """
    moved = np.zeros(3), np.diag([1.0, -1.0, -1.0])
    tools = flanged if up > 0 else [tool.moved(*moved) for tool in flanged]
    options = {"pressure": pressure, "part": "quarter"} | SMALL | {"size": (10, 10)}
    run = case(forming(*tools, travel=10.0 * up, **options))
    result = run.run()
    figures = run.summary(result)
    x = result.ply.nodes + result.ply.nodal(result.u)[:2]
    (die,) = [term for term in result.ply.terms if term.name == "die"]
    far, some = (pressure * die.areas[np.hypot(*x) > r].sum() for r in (55, 49))
    assert 0 < far <= abs(figures["holder_force_N"]) <= some
    assert figures["holder_force_N"] * figures["punch_force_N"] > 0
    forces = [figures[f"{name}_force_N"] for name in ("punch", "die", "holder")]
    assert sum(forces) == pytest.approx(0.0, abs=1e-6)
    assert abs(forces[0]) == pytest.approx(1.55, rel=2e-3)


def test_without_pressure_a_holder_has_no_force(flanged):
    figures = summary(forming(*flanged, travel=5.0, pressure=0.0, **SMALL))
    assert figures["converged"]
    assert figures["holder_force_N"] == 0
    assert figures["punch_force_N"] == pytest.approx(-figures["die_force_N"])


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

    s = np.linspace(-90.0, 90.0, 28)
    die = TriangleMesh(*graph(s, lambda x, y: pyramid(x, y, 50.0, 30.0)))
    punch = graph(0.6 * s, lambda x, y: pyramid(x, y, 50.0, 40.0) - 40.3)
    scene = forming(TriangleMesh(*punch), die, travel=5.0, part="quarter", **SMALL)
    for tool in scene.tools[:2]:
        with pytest.raises(ValueError, match="crosses the undeformed ply"):
            case(replace(scene, tools=(replace(tool, side=None),))).ply()
    assert case(scene).run().converged


@pytest.mark.parametrize("shift", [(4.0, 0.0), (0.0, 4.0)])
def test_a_quarter_of_tools_without_its_symmetry_is_refused(files, shift):
    punch, die = map(read_surface, files)
    boundary = "left" if shift[0] else "bottom"
    for part in ("quarter", "whole"):
        scene = forming(
            punch, die, travel=20.0, gap=1.0, centre=shift, part=part, **SMALL
        )
        if part == "whole":
            assert case(scene).stepper()
            continue
        message = f"'punch' is not symmetric about the boundary '{boundary}'.*whole ply"
        with pytest.raises(ValueError, match=message) as error:
            case(scene).run()
        assert "\n" not in str(error.value)


def test_a_quarter_of_the_tools_suffices_for_a_quarter_of_the_ply(tmp_path):
    x, t = graph(np.linspace(0.0, 60.0, 13), lambda x, y: -(x**2 + y**2) / 200 - 0.5)
    punch = TriangleMesh(x, t)
    die = TriangleMesh(x + np.array([[0.0], [0.0], [36.5]]), t)
    scene = forming(punch, die, travel=10.0, part="quarter", **SMALL)
    assert case(scene).run().converged


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


def run(*words):
    return cli.main(["run", *map(str, words)])


def test_forming_runs_from_the_command_line(files, tmp_path):
    out = tmp_path / "out"
    punch, die = files
    ply = "--width", 100, "--height", 100, "--size", "4x4", "--part", "quarter"
    tools = "--punch", punch, "--die", die, "--travel", 15, "--holder-gap", 1
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
    written = {file.name for file in out.rglob("*")}
    assert {"tool_force.png", "animation.gif", "shear_angle.png"} <= written
    assert "load.png" not in written  # the same curve
    assert {"punch.stl", "die.stl", "steps.pvd"} <= written
    again = tmp_path / "again"
    assert run(out / "case.toml", "--out", again, "--no-render") == 0
    same = json.loads((again / "summary.json").read_text())
    assert same["reaction_z"] == figures["reaction_z"]


def test_hemisphere_forming_runs_from_the_command_line(tmp_path):
    out = tmp_path / "out"
    quick = "--size", "4x4", "--travel", 15, "--steps", 1, "--no-render"
    assert run("hemisphere_forming", *quick, "--out", out) == 0
    last = (out / "curve.csv").read_text().splitlines()[-1].split(",")
    assert float(last[0]) == 15.0
    assert float(last[1]) > 0
