"""Plies are draped from their kinematic net, on the tool at its full size."""

import csv
import re
from dataclasses import replace

import numpy as np
import pytest

from skfem_textile import LoadStepper, Macro, Quadratic, drape
from skfem_textile.cli import main as cli
from skfem_textile.io import read_surface, write_draped, write_history
from skfem_textile.scenes import drape as on_tool
from skfem_textile.scenes import hemisphere
from skfem_textile.solve.states import NoEquilibriumError
from skfem_textile.solve.stepper import Run
from skfem_textile.surfaces.surface import distance
from tests.helpers import tool_shapes
from tests.helpers.tools import SMALL, case_of, plate, summary, write_sphere
from tests.scenes.drape.test_feasibility import box

pytestmark = pytest.mark.usefixtures("no_interval", "coarse_net")


# Equilibrium from the net


@pytest.mark.dear("a fillet and a flange around a dome need elements and triangles")
def test_a_hemisphere_with_a_flange_is_draped_at_once():
    """Growth stops on its way."""
    shape = tool_shapes.hemisphere_with_flange(50.0, fillet=8.0, flange=70.0, size=4.0)
    scene = on_tool(drape.TriangleMesh(*shape), width=180.0, height=180.0, size=(4, 4))
    result = case_of(scene, steps=2).run()
    assert [state.load_factor for state in result.states] == [0, 1]
    assert result.states[-1].verdict.stable
    x = result.ply.positions(result.u)
    assert np.abs(distance(scene.conditions["tool"].surface, x)).max() < 1e-8
    assert 40 < scene.summary(result)["max_shear_angle_deg"] < 52


@pytest.mark.parametrize(
    ("fibres", "tension", "bending"), [(np.pi / 4, 2.0, 0.0), (0.5, 0.0, 5.0)]
)
def test_the_state_from_the_net_is_that_of_growth_with_half_of_the_solves(
    fibres, tension, bending
):
    scene = hemisphere(
        size=(2, 2), width=120, height=120, fibres=fibres, tension=tension
    )
    case = case_of(scene, bending, steps=20)
    begun, ply = case.run(), case.ply()
    grown = LoadStepper(ply, scene.conditions, 2).run()
    off = ply.shear_angle(grown.u) - ply.shear_angle(begun.u)
    assert np.degrees(np.abs(off).max()) < 0.01
    assert begun.linear_solves <= grown.linear_solves / 2


@pytest.mark.parametrize("formulation", [Macro(), Quadratic()])
def test_every_node_starts_on_the_tool_in_the_net(formulation):
    """Also nodes at the centres and edge midpoints of elements."""
    scene = hemisphere("delaunay", size=(4, 4), fibres=np.pi / 4)
    ply = case_of(scene, formulation=formulation).ply()
    x = ply.positions(scene.initial_guess(ply))
    assert np.abs(distance(scene.conditions["tool"].surface, x)).max() < 1e-8
    middle = np.hypot(*ply.nodes) < 30
    # From the pole, along the surface.
    away = 100 * np.arcsin(np.hypot(*x[:2, middle]) / 100)
    flat = np.hypot(*ply.nodes[:, middle])
    np.testing.assert_allclose(away, flat, atol=0.01 * 30)


def test_a_ply_without_a_net_grows_with_the_tool():
    scene = on_tool(box(89.0), width=160.0, height=160.0, tension=0.0, size=(6, 6))
    case = case_of(scene, steps=20)
    assert scene.initial_guess(case.ply()) is None
    assert case.stepper().load_factors[-1] == 1
    assert len(case.stepper().load_factors) == case.steps


# States that are not on the tool


@pytest.fixture(scope="module")
def flat_part():
    x, t = plate(40.0, 5)
    return drape.ToolMesh(x, (t,))


def test_a_state_on_the_enlarged_tool_is_not_written_as_if_on_the_tool(
    tmp_path, flat_part
):
    coarse = drape.TriangleMesh(*plate(n=15))
    scene = on_tool(coarse, size=(2, 2), width=120.0, height=90.0)
    case = case_of(scene)
    grown = LoadStepper(case.ply(), scene.conditions, 2).run()
    assert not grown.not_on_tool
    stopped = replace(grown, states=grown.states[:2], converged=False)
    reason = "the ply lies on the tool enlarged by 2, not on the tool"
    figures = scene.summary(stopped)
    assert figures["not_on_tool"] == reason
    of_tool = "contact", "bridging", "beyond", "touches", "turn_of_normal", "_at_"
    assert not [key for key in figures if any(word in key for word in of_tool)]
    with pytest.raises(ValueError, match=reason):
        write_draped(stopped, tmp_path, scene.axes)
    pytest.importorskip("matplotlib")
    from skfem_textile import plot

    with pytest.raises(ValueError, match="does not lie on its tool at the load factor"):
        plot.draped(stopped)


def stops(*_):
    raise NoEquilibriumError("the forces do not balance", advice="another fabric")


def interrupts(*_):
    raise KeyboardInterrupt


@pytest.mark.parametrize(("end", "code"), [(stops, 1), (interrupts, 130)])
def test_a_drape_that_ends_early_leaves_nothing_beside_its_tool(
    end, code, tool, tmp_path, monkeypatch, capsys
):
    """Files of an earlier run are removed."""
    for name in ("fibres.vtu", "part.vtu", "part.csv"):
        (tmp_path / name).touch()
    for way in ("_reach", "_step"):
        monkeypatch.setattr(Run, way, end)
    words = "run", "drape", "--tool", str(tool), *SMALL, "--part-mesh", str(tool)
    assert cli.main([*words, "--out", str(tmp_path)]) == code
    assert not [*tmp_path.glob("fibr*"), *tmp_path.glob("part*")]
    figures = summary(tmp_path)
    reason = "the ply is flat: no state on the tool was found"
    assert figures["not_on_tool"] == reason
    assert not figures["converged"]
    message = capsys.readouterr().err
    assert reason in message
    assert "turn_left" not in message
    assert "instead of the load" not in message
    assert cli.main(["report", str(tmp_path)]) == 0
    assert reason in (tmp_path / "report.html").read_text()


# Axes of messages: a sphere far from the origin, touched by the ply on its side


CENTRE = np.array([13.0, -7.0, 40.0])
SIDE = (112.8, -7.0, 40.0)


def place_in(text):
    """The first position in a message."""
    found = re.search(r"at \(([^)]*)\) mm", text)
    return np.array(found[1].split(","), dtype=float)


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    file = tmp_path_factory.mktemp("ball") / "ball.stl"
    return read_surface(write_sphere(file, n=642, centre=CENTRE))


def test_the_end_of_a_net_is_in_the_axes_of_the_file(ball):
    scene = on_tool(ball, point=SIDE, width=400.0, height=400.0, size=(4, 4))
    with pytest.raises(ValueError, match="does not reach all edges") as error:
        case_of(scene).ply()
    assert "fewer cells" not in str(error.value)
    at = place_in(str(error.value))
    assert np.linalg.norm(at - CENTRE) == pytest.approx(100.0, abs=2)


def test_gaps_between_nodes_are_in_the_axes_of_the_file(ball, caplog):
    options = {"size": (2, 2), "width": 200.0, "height": 200.0}
    case_of(on_tool(ball, point=SIDE, **options)).run()
    (line,) = [m for m in map(str, caplog.messages) if "deviate from the surface" in m]
    assert np.linalg.norm(place_in(line) - CENTRE) == pytest.approx(100.0, abs=20)


def test_reactions_and_places_are_in_the_axes_of_the_file(ball, tmp_path):
    """A ply without further loads is in equilibrium: the tool pushes it outwards."""
    scene = on_tool(ball, point=SIDE, size=(2, 2), width=80.0, height=80.0)
    touch = place_in(f"at {scene.conditions['tool'].place(np.zeros(3))}")
    np.testing.assert_allclose(touch, scene.axes.origin, atol=0.1)
    np.testing.assert_allclose(touch, SIDE, atol=1)
    result = case_of(scene).run()
    pushed = scene.reaction(result.states[-1])
    assert pushed @ (1, 0, 0) == pytest.approx(np.linalg.norm(pushed), rel=1e-2)
    write_history(result, tmp_path / "history.csv", scene.axes)
    (*_, last) = csv.DictReader((tmp_path / "history.csv").read_text().splitlines())
    written = [float(last[f"tool_reaction_{axis}"]) for axis in "xyz"]
    np.testing.assert_allclose(written, pushed, rtol=1e-6, atol=1e-6 * pushed[0])
