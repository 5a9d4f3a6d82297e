"""User-defined specimens, and cases."""

import json

import numpy as np
import pytest

from skfem_textile import Condition, Fabric, Force, LoadStepper, Ply
from skfem_textile.cli import main as cli
from skfem_textile.scenes import Case, bias_extension, specimen, strip
from skfem_textile.scenes.rectangle import rectangle

# The scene `specimen`: a ply with user-defined conditions


def loaded(scene, steps=2):
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    return Case(scene=scene, fabric=fabric, steps=steps, solver="superlu").run()


def test_a_specimen_has_its_conditions():
    mesh = rectangle(50, 100, (3, 6), "irregular")
    moves = [("bottom", (0, 0)), ("top", ("free", 10.0)), ("left", ("free", "free"))]
    result = loaded(specimen(mesh, moves=moves))
    pull = Condition("top", 10.0, direction=(0, 1))
    fibres = bias_extension().warp, bias_extension().weft
    ply = Ply(mesh, Fabric(1e4, 0.5, *fibres))
    conditions = {"bottom": Condition("bottom"), "top": pull}
    expected = LoadStepper(ply, conditions, 2, solver="superlu").run()
    assert result.u == pytest.approx(expected.u, abs=1e-9)


def test_a_specimen_has_no_exact_solution():
    scene = specimen(size=(2, 4))
    summary = scene.summary(loaded(scene))
    assert summary["exact_answer"] == "none: the displacements are user-defined"
    assert "displacement_error_rms" not in summary
    turned = specimen(size=(2, 4)).rotated(0.3)
    other = turned.summary(loaded(turned))
    for name in ("reaction_x", "reaction_y", "energy"):
        assert other[name] == pytest.approx(summary[name], rel=1e-6, abs=1e-4)


def test_a_specimen_loaded_as_a_bias_extension_has_its_load():
    theirs = bias_extension(size=(4, 8), shear_angle=np.radians(20))
    end = theirs.displacement(np.array([[25.0], [100.0]]), 1.0)[1, 0]
    moves = [("bottom", (0, 0)), ("top", (0, end))]
    ours = specimen(size=(4, 8), moves=moves)
    assert ours.mesh.p == pytest.approx(theirs.mesh.p)
    # In one step: the two have different paths to the same final displacements.
    loads = [scene.reaction(loaded(scene, 1).states[-1])[1] for scene in (ours, theirs)]
    assert loads[0] == pytest.approx(loads[1], rel=1e-6)


def test_the_driven_boundary_is_named_or_moves_furthest():
    moves = [("left", (0, 0)), ("right", (3, "free")), ("top", (0, 2))]
    assert specimen(moves=moves).driven == "right"
    assert specimen(moves=moves, driven="top").driven == "top"


def case(**more):
    scene = strip(size=(3, 4))
    fabric = Fabric(1e4, 0.5, scene.warp, scene.weft)
    return Case(scene=scene, fabric=fabric, steps=2, **more)


def test_a_case_and_the_command_line_give_the_same_summary(tmp_path):
    laws = ("--fibre-stiffness", "1e4", "--shear-stiffness", "0.5")
    options = ("--size", "3x4", "--steps", "2", "--mesh-as-is", *laws)
    out = ("--no-render", "--out", str(tmp_path))
    assert cli.main(["run", "strip", *options, *out]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    one = case()
    computed = one.summary(one.run())
    for name, value in computed.items():
        if not name.endswith("time_s"):
            assert summary[name] == value, name


def test_a_case_with_loads_has_no_exact_solution():
    loaded = case(loads=(Force("top", np.array([0.1, 0.2])),))
    summary = loaded.summary(loaded.run())
    assert (
        summary["exact_answer"]
        == "none: forces act in addition to the conditions of the scene"
    )
    assert "displacement_error_rms" not in summary


def test_invalid_settings_are_rejected_by_the_constructor_of_the_stepper():
    with pytest.raises(ValueError, match="unknown solver 'abacus'"):
        case(solver="abacus").stepper()


@pytest.mark.parametrize(
    ("rise", "turn", "is_bias"),
    [(-3e-7, 3e-7, True), (-3e-6, 0.0, False), (0.0, 3e-6, False)],
)
def test_a_bias_test_is_recognised_up_to_rounding(rise, turn, is_bias):
    mesh = rectangle(50, 100 * (1 + rise), (3, 6), "aligned")
    moves = [("bottom", (0, 0)), ("top", (0, 5))]
    fibres = {"warp": np.pi / 4, "weft": 3 * np.pi / 4 + turn}
    assert (specimen(mesh, moves=moves, **fibres).shear_test is not None) == is_bias
