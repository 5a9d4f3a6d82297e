"""Pictures of a run, and errors in drawing."""

import json

import numpy as np
import pytest

from skfem_textile import Fabric
from skfem_textile.cli import main as cli
from skfem_textile.cli import results
from skfem_textile.cli.curve import DISPLACEMENT, FORCE, HALF_WIDTH, curve_of
from skfem_textile.scenes import Case, hemisphere
from skfem_textile.scenes.bias_extension import WIDTH
from tests.helpers.command_line import DRAWN, run, stop_early


def test_failed_drawing_loses_nothing(tmp_path, capsys, monkeypatch):
    def draw(*_):
        raise ValueError("no ink")

    monkeypatch.setattr(results, "draw", draw)
    assert run(tmp_path, *DRAWN) == 0
    assert (tmp_path / "out" / "summary.json").exists()
    out, err = capsys.readouterr()
    assert "the pictures were not drawn: no ink" in out
    assert err == ""


def test_the_load_is_plotted_against_the_driven_displacement(tmp_path, monkeypatch):
    pytest.importorskip("pyvista")
    plot = pytest.importorskip("skfem_textile.plot")
    curves = pytest.importorskip("skfem_textile.plot.curves")
    for name in ("fibre_strain", "shear_angle", "fibre_directions", "animation"):
        monkeypatch.setattr(plot, name, lambda *_, **__: None)
    drawn = []
    monkeypatch.setattr(curves, "curves", lambda *curve: drawn.append(curve))
    for scene, axis, number in (("strip", "x", 1), ("bias_extension", "y", 3)):
        out = tmp_path / scene
        options = ("--size", "2x4", "--steps", "2", "--rotate", "30")
        assert cli.main(["run", scene, "--out", str(out), *options]) == 0
        assert len(drawn) == number
        panels, xlabel, ylabel, file = drawn[0]
        assert (xlabel, ylabel) == ("Displacement (mm)", "Force (N)")
        assert file.name == "load.png"
        summary = json.loads((out / "summary.json").read_text())
        (lines,) = panels.values()
        moved, force, *bands = lines["run"]
        relative = summary["load_half_width"]  # None for the strip, without shear law
        ends = [half_width[-1] for half_width in bands]
        expected = [] if relative is None else [relative * abs(force[-1])]
        assert ends == pytest.approx(expected)
        assert len(bands) == (scene == "bias_extension")
        assert force[-1] == pytest.approx(summary[f"reaction_{axis}"])
        assert moved[0] == 0
        assert moved[-1] > 5
        labels = [curve[1:3] for curve in drawn]
        drawn.clear()
    assert labels[1:] == [
        ("Angle (°)", "Force (N)"),
        ("Angle (°)", "Normalised shear force (N/mm)"),
    ]
    theta, gamma = np.radians(45.0), np.radians(40.0)
    turned = np.sin(theta + np.array([0.0, 0.5, 1.0]) * gamma / 2)
    assert moved == pytest.approx(WIDTH * np.tan(theta) * (turned / np.sin(theta) - 1))


def test_a_load_of_round_off_is_not_drawn(tmp_path):
    """The forces of a frictionless tool cancel where nothing else loads the ply."""
    pytest.importorskip("matplotlib")
    scene = hemisphere(size=(2, 2), tension=0.0)
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
    result = Case(scene=scene, fabric=fabric, steps=1).run()
    curve = curve_of(scene, result)
    assert curve[DISPLACEMENT][-1] < -10
    assert scene.reaction(result.states[-1]).any()
    assert not curve[FORCE].any()
    assert HALF_WIDTH not in curve
    results.draw_curves(curve, None, tmp_path)
    assert not list(tmp_path.iterdir())
    test = {DISPLACEMENT: np.array([0.0, -9.0]), FORCE: np.array([0.0, 2.0])}
    results.draw_curves(curve, test, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["load.png"]


@pytest.mark.parametrize(
    ("moved", "loops", "label", "shown"),
    [
        ([0.0, -2.0, -3.0], False, "Displacement (mm)", {"run": 2, "test": 2}),
        ([0.0, 2.0, 1.0], False, "State", {"run": 2}),
        ([0.0, 2.0, 2.0], False, "State", {"run": 2}),
        ([0.0, 2.0, 1.0], True, "Displacement (mm)", {"run": 2, "test": 2}),
    ],
)
def test_a_curve_that_folds_back_is_drawn_over_the_states_unless_it_is_a_loop(
    tmp_path, monkeypatch, moved, loops, label, shown
):
    curves = pytest.importorskip("skfem_textile.plot.curves")
    drawn = []
    monkeypatch.setattr(curves, "curves", lambda *curve: drawn.append(curve))
    run = {DISPLACEMENT: np.array(moved), FORCE: np.array([0.0, 1.0, 3.0])}
    test = {DISPLACEMENT: np.array([0.0, -9.0]), FORCE: np.array([0.0, 2.0])}
    results.draw_curves(run, test, tmp_path, loops)
    ((panels, xlabel, _, _),) = drawn
    (lines,) = panels.values()
    assert xlabel == label
    assert {name: len(line) for name, line in lines.items()} == shown
    assert np.all(np.diff(lines["run"][0]) != 0)


@pytest.mark.dear("the only run whose pictures are drawn")
def test_pictures_are_written_and_nothing_is_printed_to_stderr(
    tmp_path, capfd, monkeypatch
):
    """Not by the libraries that draw either."""
    pytest.importorskip("pyvista")
    monkeypatch.delenv("DISPLAY", raising=False)
    small = "--size", "2x3", "--steps", "1", "--shear-stiffness", "1", "--mesh-as-is"
    assert run(tmp_path, *small) == 0
    assert capfd.readouterr().err == ""
    drawn = {
        p.stem for p in (tmp_path / "out").iterdir() if p.suffix in (".png", ".gif")
    }
    names = {"fibre_strain", "shear_angle", "fibre_directions", "load", "animation"}
    assert drawn == names


def test_a_run_that_stops_early_marks_the_failing_elements(tmp_path, monkeypatch):
    plot = pytest.importorskip("skfem_textile.plot")
    stop_early(monkeypatch)
    for name in ("fibre_strain", "shear_angle", "fibre_directions", "animation"):
        monkeypatch.setattr(plot, name, lambda *_, **__: None)
    drawn = []
    monkeypatch.setattr(plot, "verdict", lambda of, filename: drawn.append(of))
    assert run(tmp_path, *DRAWN) == 1
    (error,) = drawn
    assert len(error.elements) > 0
